"""Recordings whose metadata lie and whose data change under the reader."""

import copy
import hashlib
import json
import os
import random
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from analysis.shot.shot import AnalysisSettings
from app.session.load import load_and_analyse
from instrument.bench.simulated_shots import simulate
from tests.attack.trial import SURVIVED, Attempt, refused_in_a_line
from tests.instrument.mutating import NASTY, spoilt_json

READ_ONLY = AnalysisSettings(fit=False)  # what a file asks for is met before the model is fitted
NUMBERS = (
    0,
    -1,
    1,
    2**31,
    2**53,
    2**63,
    10**9,
    10**400,
    1e-320,
    1e-300,
    1e-30,
    1e-9,
    1e-3,
    1e3,
    1e12,
    1e30,
    1e300,
    0.5,
)


def claims(folder: Path, random_: random.Random) -> Iterator[Attempt]:
    """Metadata that claim what no rig has, one number or several at a time; the known ones first."""
    meta = simulate(folder, 1, seed=random_.randrange(100))[0]
    head = json.loads(meta.read_text())
    samples = meta.with_suffix(".sigmf-data").stat().st_size // (2 * head["global"]["core:num_channels"])
    channels = head["global"]["lmm:channels"]
    gap = {"core:label": "gap", "core:sample_start": samples // 2}
    known: list[tuple[str, Any]] = [
        *((f"a gap of {lost:g}", {"annotations": [{**gap, "lmm:samples_lost": lost}]}) for lost in (1e5, 1e9, 2.0**53)),
        ("ten gaps as long as the file", {"annotations": [{**gap, "lmm:samples_lost": samples}] * 10}),
        ("a gap at every tenth sample", {"annotations": [
            {**gap, "core:sample_start": n, "lmm:samples_lost": 1} for n in range(1, samples, 10)]}),
        ("1000 gaps", {"annotations": [
            {**gap, "core:sample_start": n, "lmm:samples_lost": 1} for n in range(1, samples, samples // 1000)]}),
        ("5.5 million empty annotations", b'{"annotations": [' + b"{}," * 5_500_000 + b"{}]}"),
        ("300,000 empty annotations", {"annotations": [{}] * 300_000}),
        ("a note of a million letters", {"annotations": [{"core:label": "note", "core:comment": "x" * 999_999}]}),
        ("64 channels", {"global": {**head["global"], "core:num_channels": 64, "lmm:channels": channels * 32}}),
        ("10,000 channels", {"global": {**head["global"], "lmm:channels": channels * 5000}}),
        ("a hash that is another", {"global": {**head["global"], "core:sha512": hashlib.sha512(b"").hexdigest()}}),
        ("deep", b'{"global":' * 100_000),
        ("a key twice", b'{"global": {}, "global": {}}'),
    ]  # fmt: skip
    for words, change in known:
        yield words, _written(meta, change if isinstance(change, bytes) else json.dumps({**head, **change}).encode())
    places = [("global", key) for key in head["global"]] + [("setup", key) for key in head["global"]["lmm:setup"]]
    places += [("setup", "rest_frequency_hz"), ("setup", "moving_mass_kg"), ("channel", "volts_per_count"),
               ("channel", "offset_v"), ("global", "lmm:trigger_sample"), ("global", "lmm:samples")]  # fmt: skip
    while True:
        spoilt = copy.deepcopy(head)
        whole = spoilt["global"]
        inner = {"global": whole, "setup": whole["lmm:setup"], "channel": whole["lmm:channels"][-1]}
        said = []
        for where, key in random_.sample(places, random_.choice((1, 1, 1, 2, 3))):
            inside = inner[where]
            inside[key] = random_.choice((*NUMBERS, *(-n for n in NUMBERS), *NASTY))
            said.append(f"{key} = {str(inside[key])[:20]}")
        text = json.dumps(spoilt).encode("utf-8", "surrogatepass")
        yield ", ".join(said), _written(meta, text if random_.random() < 0.8 else spoilt_json(spoilt, random_))


def _written(meta: Path, text: bytes) -> Any:
    def attempt() -> str:
        meta.write_bytes(text)
        return analysed(meta)

    return attempt


def analysed(path: Path) -> str:
    """Open and analyse a recording as --replay does."""
    shot = load_and_analyse(path, settings=READ_ONLY)
    return SURVIVED if shot.problem is None else refused_in_a_line(shot.problem)


def moving_data(folder: Path, random_: random.Random) -> Iterator[Attempt]:
    """Data files that shrink, grow, vanish or turn into something else while they are read."""
    meta = simulate(folder, 1, seed=random_.randrange(100))[0]
    data = meta.with_suffix(".sigmf-data")
    whole = data.read_bytes()

    def meanwhile(change: Any) -> str:
        for left in (data,):
            if left.is_dir() and not left.is_symlink():
                left.rmdir()
            else:
                left.unlink(missing_ok=True)
        data.write_bytes(whole)
        delay_s = random_.uniform(0.0, 0.01)
        timer = threading.Timer(delay_s, change)
        timer.start()
        try:
            return analysed(meta)
        finally:
            timer.join()

    def shrink() -> None:
        os.truncate(data, random_.choice((0, 1, 4096, len(whole) // 2)))

    def grow() -> None:
        with open(data, "ab") as file:
            file.write(whole)

    def overwrite() -> None:
        data.write_bytes(np.random.default_rng(1).bytes(len(whole)))

    def folder_instead() -> None:
        data.unlink()
        data.mkdir()

    def endless_link() -> None:
        data.unlink()
        data.symlink_to("/dev/zero")

    def pipe() -> None:
        data.unlink()
        os.mkfifo(data)

    kinds = [shrink, grow, overwrite, data.unlink, folder_instead, endless_link, pipe]
    while True:
        change = random_.choice(kinds)
        yield getattr(change, "__name__", "removed"), lambda change=change: meanwhile(change)
