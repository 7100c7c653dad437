"""``make attack``: every attack at length, each in a process of its own, and one table at the end.

``python -m tests.attack [--seed N] [--share S] [KIND...]``.  The exit status is 1 where an attempt neither survived nor
was refused with one line, or took more than it may.
"""

import argparse
import importlib.util
import multiprocessing
import subprocess
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

from tests.attack.kinds import KINDS, TRIAL, attacked
from tests.attack.trial import UNDER_WAY, Outcome

BY_TESTS = {
    "cluster": ("tests/app/test_cluster.py", "tests/app/test_cluster_parts.py", "tests/app/test_campaign.py"),
    "full disk": ("tests/app/test_full_disk.py", "tests/instrument/test_capture_disk.py"),
}


def main(arguments: list[str] | None = None) -> int:
    """Attack; print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--share", type=float, default=1.0, help="of the usual number of attempts")
    parser.add_argument("kinds", nargs="*", metavar="KIND", help=f"of {', '.join([*KINDS, *BY_TESTS])} (default: all)")
    options = parser.parse_args(arguments)
    outcomes = []
    for name in options.kinds or [*KINDS, *BY_TESTS]:
        print(f"{name} ...", file=sys.stderr, flush=True)
        with tempfile.TemporaryDirectory(prefix="levimass-attack-") as folder:
            if name in BY_TESTS:
                outcomes.append(_by_tests(name))
            else:
                count = max(1, round(options.share * KINDS[name].count))
                outcomes.append(_apart(name, Path(folder), count, options.seed))
    print(f"{'attack':<14}{'tried':>7}{'survived':>10}{'one line':>10}{'failed':>8}{'s at most':>11}{'MB at most':>12}")
    for o in outcomes:
        print(
            f"{o.kind:<14}{o.tried:>7}{o.survived:>10}{o.refused:>10}{len(o.failed):>8}{o.seconds:>11.1f}{o.megabytes:>12.0f}"
        )
    for line in (line for outcome in outcomes for line in outcome.failed):
        print(line)
    tried, failed = sum(o.tried for o in outcomes), sum(len(o.failed) for o in outcomes)
    print(f"{tried} attempts, {failed} failed, seed {options.seed}")
    return int(failed > 0)


def _apart(name: str, folder: Path, count: int, seed: int) -> Outcome:
    """Attack in a process of its own; one that dies, or hangs and is ended, is a failure and says at which attempt."""
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as process:
        try:
            return process.submit(attacked, name, folder, count, seed).result()
        except BrokenProcessPool:
            begun = folder / TRIAL / UNDER_WAY
            number, _, words = (begun.read_text() if begun.exists() else "0: warming up").strip().partition(": ")
    outcome = Outcome(name, tried=int(number))
    outcome.failed.append(f"{name}: the process ended at attempt {number}: {words}")
    return outcome


def _by_tests(name: str) -> Outcome:
    """Run tests of a real cluster, or of a real disk: they are the attack."""
    outcome = Outcome(name)
    if name == "cluster" and importlib.util.find_spec("distributed") is None:
        outcome.failed.append("cluster: dask.distributed is not installed")
        return outcome
    for tests in BY_TESTS[name]:
        ran = subprocess.run([sys.executable, "-m", "pytest", tests], capture_output=True, text=True, check=False)
        outcome.tried += 1
        if ran.returncode == 0:
            outcome.survived += 1
        else:
            outcome.failed.append(f"{name}: {tests}: {' '.join(ran.stdout.split())[-300:]}")
    return outcome


if __name__ == "__main__":
    raise SystemExit(main())
