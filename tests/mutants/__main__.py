"""``make mutants``: faults drawn by a seed, each in a copy of the program, and whether a test notices.

``python -m tests.mutants [--faults N] [--seed S] [--jobs J] [--seconds T] [--covered FOLDER] [PATH...]``.  A file is
drawn as often as it has places for a fault; of PATH, if given, alone.  A fault is put to the tests that ran its line
when the whole suite ran without it (kept in FOLDER: made there first, in a quarter of an hour), the nearest and
quickest first, then to the nearest test files whole; where no test is seen to run the line, as in a compiled kernel,
to all test files that import it.  Kernels go into a folder of the run's own, begun with those that are compiled
already: they lie there under a stamp of their sources, so none answers for another.  What takes more than T seconds is
counted by itself: a search without an end is seen, but so is a busy machine.  The exit status is 1 where a fault
survived.
"""

import argparse
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from itertools import islice
from pathlib import Path
from queue import Queue
from typing import NamedTuple

from analysis.compiled import kernel_cache
from tests.mutants.covered import Covered
from tests.mutants.imports import TOPS, Imports
from tests.mutants.operators import Fault, faults_of

ROOT = Path(__file__).resolve().parents[2]
_NEAREST = 6  # test files that are run whole before a fault is said to survive
_SHARE = 0.4  # of the time allowed that the tests of a fault should take: noted lines slow them down, so does company


class End(NamedTuple):
    """What became of a fault: "noticed", "timed out", "survived" or "no test", and the test that noticed it."""

    word: str
    test: str = ""


def main(arguments: list[str] | None = None) -> int:
    """Draw the faults, run the tests on each, print the table and what survived."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--faults", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--seconds", type=float, default=120.0, help="the longest that the tests of one fault may take")
    parser.add_argument("--covered", type=Path, default=ROOT / ".mutants", help="what ran which line, kept from before")
    parser.add_argument("paths", nargs="*", help="files or folders of the program (default: all)")
    options = parser.parse_args(arguments)
    covered, imports = Covered.kept_in(options.covered, ROOT), Imports(ROOT)
    paths = [p for p in imports.program() if not options.paths or p.startswith(tuple(options.paths))]
    places = [fault for path in paths for fault in faults_of(ROOT, path)]
    in_order = random.Random(options.seed).sample(places, len(places))
    drawn = list(islice((fault for fault in in_order if fault.parses(ROOT)), options.faults))
    ends: list[tuple[Fault, End]] = []
    with tempfile.TemporaryDirectory(prefix="levimass-mutants-") as folder:
        copies: Queue[Path] = Queue()
        for number in range(options.jobs):
            copies.put(_copied(Path(folder) / str(number)))

        def tried(fault: Fault) -> tuple[Fault, End]:
            copy, near = copies.get(), imports.tests_of(fault.path)
            ran = covered.tests_of(fault.path, fault.line, near, _SHARE * options.seconds)
            # a line that runs at an import, or in a fixture of a whole module, is credited to no test or to the first
            tries = [tests for tests in (ran, near[:_NEAREST] if ran else near) if tests] or [[]]
            try:
                ends = (_end_of(fault, copy, tests, options.seconds) for tests in tries)
                return fault, next((end for end in ends if end.word != "survived"), End("survived"))
            finally:
                copies.put(copy)

        with ThreadPoolExecutor(options.jobs) as pool:
            for fault, end in pool.map(tried, drawn):
                ends.append((fault, end))
                print(f"{end.word:<9} {_words(fault)}  {end.test}".rstrip(), file=sys.stderr, flush=True)
    print(_table(ends))
    return int(any(end.word == "survived" for _, end in ends))


def _copied(place: Path) -> Path:
    """Copy the program and its tests, the recordings beside them, and the kernels compiled so far."""
    tree = place / "tree"
    tree.mkdir(parents=True)
    for name in (*TOPS, "levimass", "resources", "docs", "packaging"):
        shutil.copytree(ROOT / name, tree / name, ignore=shutil.ignore_patterns("__pycache__"))
    for file in ROOT.iterdir():
        if file.is_file():
            shutil.copy2(file, tree / file.name)
    if (ROOT.parent / "shared").is_dir():
        (place / "shared").symlink_to(ROOT.parent / "shared", target_is_directory=True)
    if kernel_cache.cache_folder().is_dir():
        shutil.copytree(kernel_cache.cache_folder(), place / "kernels" / "levimass")
    return tree


def _end_of(fault: Fault, tree: Path, tests: list[str], seconds: float) -> End:
    if not tests:
        return End("no test")
    file = tree / fault.path
    source = file.read_bytes()
    file.write_bytes(fault.applied(source))
    environment = os.environ | {
        "NUMBA_CACHE_DIR": str(tree.parent / "kernels"),
        "PYTHONPATH": str(tree),  # a process that a test starts must not import the unchanged program
        "QT_QPA_PLATFORM": "offscreen",
        "PYTHONDONTWRITEBYTECODE": "1",
        "LEVIMASS_LINES_FOLLOWED": "1",
    }
    options = ["-x", "-q", "-p", "no:cacheprovider", "--tb=no", "-rfE", "-m", "not slow"]
    command = [sys.executable, "-m", "pytest", *options, *tests]
    running = subprocess.Popen(
        command, cwd=tree, env=environment, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
        start_new_session=True,
    )  # fmt: skip
    try:
        printed, _ = running.communicate(timeout=seconds)
    except subprocess.TimeoutExpired:
        _kill_with_children(running)
        return End("timed out")
    finally:
        file.write_bytes(source)
    failed = (line for line in printed.splitlines() if line.startswith(("FAILED ", "ERROR ")))
    return End("noticed", next(failed, f"(status {running.returncode})")) if running.returncode else End("survived")


def _kill_with_children(running: subprocess.Popen[str]) -> None:
    """Kill a run of tests and the processes that it has started, which would hold its output open."""
    if sys.platform == "win32":
        running.kill()
    else:
        os.killpg(running.pid, signal.SIGKILL)
    running.wait()


def _words(fault: Fault) -> str:
    short = (" ".join(text.split())[:90] for text in (fault.before, fault.after))
    return f"{fault.path}:{fault.line} ({fault.kind}) " + " -> ".join(short)


def _table(ends: list[tuple[Fault, End]]) -> str:
    count = Counter(("/".join(fault.path.split("/")[:2]).removesuffix(".py"), end.word) for fault, end in ends)
    lines = [f"{'package':<28}{'faults':>8}{'noticed':>9}{'timed out':>11}{'survived':>10}{'no test':>9}"]
    for package in sorted({package for package, _ in count}):
        numbers = [count[package, end] for end in ("noticed", "timed out", "survived", "no test")]
        lines.append(f"{package:<28}{sum(numbers):>8}{numbers[0]:>9}{numbers[1]:>11}{numbers[2]:>10}{numbers[3]:>9}")
    lines += ["", "survived or without a test:"]
    lines += [_words(fault) for fault, end in ends if end.word in ("survived", "no test")]
    return "\n".join(lines)


if __name__ == "__main__":
    raise SystemExit(main())
