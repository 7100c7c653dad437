"""A capture killed at random moments: ``python -m tests.benchmarks.kill [--times 100]``.

Every shot that was said to be saved must open whole and pass its hash, an interrupted one opens as far as it got,
the settings are intact.  Prints what was left; raises where that does not hold.
"""

import argparse
import os
import random
import signal
import sys
import tempfile
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import IO

from tests.instrument import writing_process
from tests.instrument.killing import kill_once


def forked(folder: Path) -> tuple[Callable[[], None], IO[str]]:
    """Start the writing process as a copy of this one, which has imported everything already."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reading)
        sys.stdout = os.fdopen(writing, "w")
        writing_process.main(folder)
    os.close(writing)

    def kill() -> None:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)

    return kill, os.fdopen(reading)


def main() -> None:
    """Kill and print."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--times", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    moment = random.Random(options.seed)
    left: Counter[str] = Counter()
    ended: Counter[str] = Counter()
    for _ in range(options.times):
        with tempfile.TemporaryDirectory() as name:
            found = kill_once(Path(name), moment, forked)
        left.update(found)
        ended["with a shot under way" if found["as far as it got"] else "between shots"] += 1
    print(f"killed {options.times} times, {dict(ended)}")
    for words, number in left.items():
        print(f"    {number:6d} recordings {words}")
    print("every saved shot opened whole, every settings file was intact")


if __name__ == "__main__":
    main()
