"""Kills a capture at random moments and checks the files that it left."""

import json
import random
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import IO

from app.session.settings import Settings
from app.session.settings_store import load
from instrument.files.recording_error import RecordingError
from instrument.files.recording_file import data_hash, read_recording

HOUSE = Path(__file__).resolve().parents[2]


def started(folder: Path) -> tuple[Callable[[], None], IO[str]]:
    """Start the writing process; return what kills it and what it says."""
    process = subprocess.Popen(
        [sys.executable, "-m", "tests.instrument.writing_process", str(folder)],
        cwd=HOUSE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
    )  # fmt: skip
    assert process.stdout is not None

    def kill() -> None:
        process.kill()
        process.wait()

    return kill, process.stdout


def kill_once(
    folder: Path,
    moment: random.Random,
    start: Callable[[Path], tuple[Callable[[], None], IO[str]]] = started,
) -> dict[str, int]:
    """Start the writing process, kill it at a random moment after its first shot, and check what is left.

    Returns how many recordings were complete, opened as far as they got, and held no sample yet.  Raises
    AssertionError where a shot that was said to be saved does not open whole, or the settings do not.
    """
    kill, output = start(folder)
    with output:
        first = output.readline()
        time.sleep(moment.uniform(0.0, 0.3))
        kill()
        rest = output.read().splitlines()
    said = [json.loads(line) for line in [first, *rest] if line.strip().endswith('"')]
    assert said
    for path in said:
        assert data_hash(path).agrees, path
        assert read_recording(path).samples > 0
    left = {"complete": 0, "as far as it got": 0, "without a sample": 0}
    for data in sorted(folder.glob("*.sigmf-data")):
        try:
            recording = read_recording(data)
        except RecordingError as error:
            assert "holds no samples" in str(error) or "no such file" in str(error), error
            assert data.stat().st_size == 0
            left["without a sample"] += 1
            continue
        assert recording.samples == data.stat().st_size // 6
        if "interrupted" in recording.flags:
            left["as far as it got"] += 1
        else:
            assert data_hash(data).agrees
            left["complete"] += 1
    settings, words = load(folder / "settings.json")
    assert not words and settings != Settings(), words
    return left
