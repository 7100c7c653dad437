"""Files laid beside the recordings: none is run or obeyed, and no journal is believed that was altered."""

import contextlib
import json
import os
import random
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from app.command_line.campaign.journal import JOURNAL, Journal
from app.report.exports import shot_columns
from instrument.bench.simulated_shots import simulate
from tests.attack.trial import REFUSED, SURVIVED, Attempt
from tests.instrument.mutating import spoilt_bytes

HOUSE = Path(__file__).resolve().parents[2]
MARK = "open('MARK', 'w').write('ran')\n"
PLANTED = {
    ".numba_config.yaml": "cache_dir: crafted\ndisable_jit: 1\n",
    "yaml.py": MARK,
    "numba.py": MARK,
    "analysis/__init__.py": MARK,
    "sitecustomize.py": MARK,
    "usercustomize.py": MARK,
    "numpy/__init__.py": MARK,
    "_posixshmem.py": MARK,
    "qt.conf": "[Paths]\nPlugins = crafted\n",
    "dask.yaml": "distributed:\n  worker:\n    preload: evil.py\n",
    "evil.py": MARK,
    "pyvenv.cfg": "home = crafted\n",
    "python311._pth": "crafted\nimport site\n",
    "libusb-1.0.so": "no library",
    "matplotlibrc": "backend: module://evil\n",
    "levimass.toml": "model = 'evil'\n",
}


def planted(folder: Path, random_: random.Random) -> Iterator[Attempt]:
    """Start the program where each file lies, and where all of them do."""
    meta = simulate(folder / "shots", 1, seed=random_.randrange(100))[0]
    cases: list[dict[str, str]] = [PLANTED, *({name: text} for name, text in PLANTED.items())]
    for number, files in enumerate(cases):
        here = folder / str(number)
        for name, text in files.items():
            (here / name).parent.mkdir(parents=True, exist_ok=True)
            (here / name).write_text(text)
        yield ", ".join(files), lambda here=here: _started(here, meta)


def _started(here: Path, meta: Path) -> str:
    before = {path.relative_to(here) for path in here.rglob("*")}
    environment = {name: text for name, text in os.environ.items() if not name.startswith("NUMBA_")}
    environment |= {"PYTHONPATH": str(HOUSE), "PYTHONDONTWRITEBYTECODE": "1"}
    command = [sys.executable, "-P", "-m", "app", "--replay", str(meta), "--no-diagnose", "--json", "out.json"]
    done = subprocess.run(command, cwd=here, env=environment, capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 0 and done.stderr == "", done.stderr[-300:]
    new = {path.relative_to(here) for path in here.rglob("*")} - before
    assert new == {Path("out.json")}, new
    assert json.loads((here / "out.json").read_text())["shots"][0]["status"] == "ok"
    return SURVIVED


def journals(folder: Path, random_: random.Random) -> Iterator[Attempt]:
    """Journals of campaigns with bytes at random: an entry comes back as it was written, or not at all."""
    path = folder / JOURNAL
    shot = {"status": "ok", "problem": None, "flags": ["wander"], "velocity_in_m_per_s": {"value": -0.265, "std": 1e-6}}
    entries = {str(n): {"stamp": str(n), "shot": shot, "row": [str(n)] * len(shot_columns())} for n in range(5)}
    with contextlib.closing(Journal(path, ())) as journal:
        for entry in entries.values():
            journal.add(entry)
    whole = path.read_bytes()
    while True:
        content = spoilt_bytes(whole, random_)

        def attempt(content: bytes = content) -> str:
            path.write_bytes(content)
            with contextlib.closing(Journal(path, set(entries))) as journal:
                for stamp, entry in entries.items():
                    assert stamp not in journal or journal.entry(stamp) == entry, "a forged entry is served"
                return SURVIVED if all(stamp in journal for stamp in entries) else REFUSED

        yield f"{len(content)} bytes", attempt
