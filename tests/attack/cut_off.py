"""Export, report, result and model file killed while they are written: each is the old one or the new, and whole."""

import json
import random
import signal
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

from instrument.bench.simulated_shots import simulate
from tests.attack.trial import SURVIVED, Attempt

HOUSE = Path(__file__).resolve().parents[2]
WRITER = """
import json, sys
from pathlib import Path
from analysis.diagnosis.findings.model_file import saved, to_text
from analysis.report import result
from app.report.exports import export
from app.report.exports import export_hdf5
from app.report.page import report_of
from app.session.load import load_and_analyse
from instrument.files.atomic_file import write_text_atomic

shot, out = load_and_analyse(Path(sys.argv[1])), Path(sys.argv[2])
assert shot.fit is not None, shot.problem or shot.fit_problem
texts = {
    "result.json": json.dumps(result([shot], None)) + "\\n",
    "report.html": report_of([shot]),
    "model.toml": to_text(saved(shot.fit, ["shot"])) + "# end\\n",
}
print("ready", flush=True)
while True:
    for name, text in texts.items():
        write_text_atomic(out / name, text, sync=True)
    export([shot], out)
    export_hdf5([shot], out)
"""


def outputs(folder: Path, random_: random.Random) -> Iterator[Attempt]:
    """Kill the process that writes at random moments, and look at what it leaves."""
    meta = simulate(folder, 1, seed=random_.randrange(100))[0]
    number = 0
    while True:
        number += 1
        yield "killed", lambda number=number: _killed(meta, folder / f"out-{number}", random_.uniform(0.0, 0.8))


def _killed(meta: Path, out: Path, after_s: float) -> str:
    out.mkdir()
    command = [sys.executable, "-c", WRITER, str(meta), str(out)]
    with subprocess.Popen(command, cwd=HOUSE, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as writer:
        assert writer.stdout is not None and writer.stderr is not None
        assert writer.stdout.readline() == b"ready\n", writer.stderr.read()[-300:]
        try:
            writer.wait(after_s)
        except subprocess.TimeoutExpired:
            writer.send_signal(signal.SIGKILL)
    for path in out.iterdir():
        if path.name.startswith("."):
            assert path.suffix == ".new", f"{path.name} is left"
            continue
        check_whole(path)
    return SURVIVED


def check_whole(path: Path) -> None:
    """Check that a result is whole."""
    if path.suffix == ".h5":
        import h5py

        with h5py.File(path) as file:
            assert file["motion/displacement_m"].shape == file["motion/valid"].shape
        return
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".json":
        assert json.loads(text)["shots"][0]["status"] == "ok"
    elif path.suffix == ".toml":
        assert text.endswith("# end\n") and tomllib.loads(text)["base"] == "paper"
    elif path.suffix == ".html":
        assert text.rstrip().endswith("</html>")
    else:
        first, *_, last = text.splitlines()
        assert text.endswith("\n") and first.count(",") <= last.count(","), path.name  # words may hold commas
