"""Too many of everything: a folder of 10,000 files, two windows with one session, captures that are killed."""

import random
import threading
from collections.abc import Iterator
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import replace
from io import StringIO
from pathlib import Path

from analysis.shot.shot import Shot
from app.command_line.cli import main
from app.session.session import Session
from instrument.files.recording_search import find_recordings
from tests.app.synthetic import bare_shot
from tests.attack.trial import SURVIVED, Attempt, refused_in_a_line
from tests.instrument.killing import kill_once


def folders(folder: Path, random_: random.Random) -> Iterator[Attempt]:
    """A folder of thousands of files of every kind: all found, none twice; no shot, one line each."""

    def found(count: int) -> str:
        place = folder / f"of {count}"
        place.mkdir()
        for n in range(count):
            kind = n % 5
            name = ("shot-%d.sigmf-meta", "shot-%d.sigmf-data", "m%d.csv", "x%d.tdms", ".hidden%d")[kind] % n
            (place / name).write_bytes(random_.randbytes(20))
        shots = find_recordings([place])
        assert len(shots) == len(set(shots)) == 2 * len(range(0, count, 5)), len(shots)
        return SURVIVED

    def replayed(count: int) -> str:
        place = folder / f"replayed {count}"
        place.mkdir()
        for n in range(count):
            (place / f"shot-{n}.sigmf-meta").write_bytes(random_.randbytes(20))
        out, err = StringIO(), StringIO()
        with redirect_stdout(out), redirect_stderr(err):
            assert main(["--replay", str(place), "--no-diagnose"]) == 1
        lines = err.getvalue().splitlines()
        assert len(lines) == count
        for line in lines:
            refused_in_a_line(line)
        return SURVIVED

    yield "10,000 files", lambda: found(10_000)
    yield "2,000 recordings that are none", lambda: replayed(2_000)


def sessions(folder: Path, random_: random.Random) -> Iterator[Attempt]:
    """Two programs that write one session file at once, as two versions may: whichever wins, the file is whole."""
    number = 0
    while True:
        number += 1

        def attempt(number: int = number) -> str:
            path = folder / f"session-{number}.json"
            windows = [Session(path), Session(path)]

            def work(session: Session) -> None:
                for n in range(20):
                    session.add(_shot(f"shot-{n}"))
                    session.set_note(session.entries[-1].number, "x" * random_.randrange(5000))

            threads = [threading.Thread(target=work, args=(session,)) for session in windows]
            for thread in threads:
                thread.start()
            while any(thread.is_alive() for thread in threads):
                if path.exists():
                    assert Session.reopen(path).problem is None
            for thread in threads:
                thread.join()
            assert all(session.problem is None for session in windows), [session.problem for session in windows]
            assert len(Session.reopen(path).entries) == 20
            assert [left.name for left in folder.glob("*.new")] == []
            return SURVIVED

        yield "two windows", attempt


def _shot(name: str) -> Shot:
    return replace(bare_shot(name), path=f"/data/{name}.sigmf-meta")


def kills(folder: Path, random_: random.Random) -> Iterator[Attempt]:
    """A capture killed at random moments: every shot that was said to be saved opens whole."""
    number = 0
    while True:
        number += 1

        def attempt(number: int = number) -> str:
            place = folder / str(number)
            place.mkdir(parents=True)
            kill_once(place, random_)
            return SURVIVED

        yield "killed", attempt
