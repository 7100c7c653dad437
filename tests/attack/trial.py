"""One attempt of an attack: it survives, or is refused with one line; anything else is a fault of the program."""

import contextlib
import faulthandler
import random
import resource
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

SURVIVED, REFUSED = "survived", "refused"
LONGEST_S, MAX_MB = 10.0, 500.0  # that one attempt may take on a quiet machine
HANGS_S = 180.0  # by the clock, on a busy one: an attempt that has not ended by then never does
UNDER_WAY = "attempt.txt"  # in the folder of the attempts: the one under way, where the process does not outlive it

Attempt = tuple[str, Callable[[], str]]  # what is tried in words; it returns SURVIVED or REFUSED
Attack = Callable[[Path, random.Random], Iterator[Attempt]]  # without end, or as many as there are


@dataclass(slots=True)
class Outcome:
    """What became of one kind of attack."""

    kind: str
    tried: int = 0
    survived: int = 0
    refused: int = 0
    seconds: float = 0.0  # processor time of the slowest attempt, its threads included
    megabytes: float = 0.0  # of the greediest attempt, beyond what was held before it
    failed: list[str] = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        self.failed = []


def carry_out(kind: str, attack: Attack, folder: Path, count: int, seed: int, hangs_s: float | None = None) -> Outcome:
    """Make at most ``count`` attempts in ``folder``; a failure is listed in the outcome, never raised.

    An attempt that takes longer than ``hangs_s`` by the clock ends this process, with its stacks on standard error.
    """
    outcome = Outcome(kind)
    folder.mkdir(parents=True, exist_ok=True)
    for what, attempt in attack(folder, random.Random(seed)):
        words = ascii(what)[1:-1]
        if outcome.tried == count:
            break
        outcome.tried += 1
        _forget_the_most()
        before = most_megabytes()
        if hangs_s is not None:
            (folder / UNDER_WAY).write_text(f"{outcome.tried}: {words}\n")
            faulthandler.dump_traceback_later(hangs_s, exit=True)
        begun = time.process_time()
        try:
            ended = attempt()
        except BaseException as error:
            if isinstance(error, KeyboardInterrupt):
                raise
            outcome.failed.append(f"{kind}: {words}: {type(error).__name__}: {' '.join(str(error).split())[:300]}")
        else:
            outcome.survived += ended == SURVIVED
            outcome.refused += ended == REFUSED
        spent, grown = time.process_time() - begun, most_megabytes() - before
        if spent > LONGEST_S:
            outcome.failed.append(f"{kind}: {words}: {spent:.0f} s of processor time")
        if grown > MAX_MB:
            outcome.failed.append(f"{kind}: {words}: {grown:.0f} MB")
        outcome.seconds = max(outcome.seconds, spent)
        outcome.megabytes = max(outcome.megabytes, grown)
    if hangs_s is not None:
        faulthandler.cancel_dump_traceback_later()
    return outcome


def refused_in_a_line(words: str, *named: str) -> str:
    """Return REFUSED; AssertionError where ``words`` are not one printable line, or lack one of ``named``."""
    assert "\n" not in words.rstrip("\n") and 0 < len(words) < 900, words[:300]
    assert all(character.isprintable() or character == "\n" for character in words), repr(words[:300])
    assert "Traceback" not in words and "fault of the program" not in words and "unexpected" not in words, words
    for name in named:
        assert name in words, f"{name} is not named: {words}"
    return REFUSED


def most_megabytes() -> float:
    """Return the most memory this process held since it was last forgotten, or ever where that cannot be."""
    with contextlib.suppress(OSError):
        for line in Path("/proc/self/status").read_text().splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) / 1024
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return most / 1024 if sys.platform != "darwin" else most / 2**20


def _forget_the_most() -> None:
    """Let the system count anew, on Linux alone: what one attempt takes is not hidden behind a greedy one before it."""
    with contextlib.suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")
