"""``levimass --prepare``: everything compiled beforehand, for an installer or the image of a lab's computers."""

import sys
import time

from analysis.compiled import kernel_cache
from app.session.jobs import Report
from app.session.prepare import complete
from app.session.prepare import prepare as compile_all


def prepare(jobs: int | None = None) -> int:
    """Compile what is not compiled yet, over ``jobs`` processes, telling how far it is; return the exit status."""
    if complete():
        print(f"levimass: everything is compiled already, in {kernel_cache.root()}")
        return 0
    began = time.monotonic()
    if not compile_all(progress_lines(), lambda: False, at_once=jobs):
        print("levimass: not everything could be compiled; it will be when it is needed", file=sys.stderr)
        return 1
    print(f"levimass: compiled in {time.monotonic() - began:.0f} s, kept in {kernel_cache.root()}")
    return 0


def progress_lines() -> Report:
    """Return what tells progress on standard error, a line for each step of it."""
    last = ""

    def report(words: str, share: float) -> None:
        nonlocal last
        line = f"{100 * share:3.0f} %  {words}"
        if line != last:
            print(line, file=sys.stderr)
        last = line

    return report
