"""Laws off the catalogue, scored blind: ``python -m tests.benchmarks.laws [--sets N] [--clean N] [--page FILE]``.

Outcomes are kept line by line (``--keep FILE``), so that a run that was cut off goes on where it stopped.
"""

import argparse
import json
import multiprocessing
import os
import random
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tests.benchmarks.law_cases import LawCase, LawOutcome, cases, judge
from tests.benchmarks.law_score import lines, page


def main(arguments: list[str] | None = None) -> int:
    """Run the benchmark; return 0 when every target that was judged is met, 1 when not."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--sets", type=int, default=63, metavar="N", help="with a law, over all families in turn")
    parser.add_argument("--clean", type=int, default=300, metavar="N", help="sets without a law")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--processes", type=int, default=min(2, os.cpu_count() or 1))
    parser.add_argument("--page", type=Path, metavar="FILE", help="write figures and every set as Markdown")
    parser.add_argument("--keep", type=Path, metavar="FILE", help="outcomes, a JSON object a line; read back if there")
    options = parser.parse_args(arguments)
    todo = cases(options.sets, options.clean, options.seed)
    outcomes = []
    for done, outcome in enumerate(_all(todo, options.processes, options.keep), 1):
        outcomes.append(outcome)
        if done % 10 == 0 or done == len(todo):
            print(f"{done}/{len(todo)} sets", file=sys.stderr, flush=True)
    scored = lines(outcomes)
    marks = {True: "met", False: "NOT MET", None: ""}
    for line in scored:
        print(f"{line.what:44s} {line.figure:56s} {line.target:44s} {marks[line.met]}")
    if options.page:
        options.page.parent.mkdir(parents=True, exist_ok=True)
        options.page.write_text(page(outcomes, "make bench-loop"), encoding="utf-8")
    return int(any(line.met is False for line in scored))


def _one(case: LawCase) -> LawOutcome:
    from analysis.kernel_cache import keep_true

    keep_true()
    from analysis.diagnosis import diagnose  # type: ignore[attr-defined]

    return judge(case, diagnose)


def _all(todo: list[LawCase], processes: int, keep: Path | None) -> Iterator[LawOutcome]:
    kept = _read(keep) if keep else {}
    yield from (kept[case] for case in todo if case in kept)
    left = [case for case in todo if case not in kept]
    random.Random(0).shuffle(left)  # a run that is cut off is then a fair sample of all
    # spawned, and one thread each: a kernel's own threads would fight over the cores
    os.environ.setdefault("NUMBA_NUM_THREADS", "1")
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    with multiprocessing.get_context("spawn").Pool(processes) as pool:
        for outcome in pool.imap_unordered(_one, left, chunksize=1):
            if keep:
                keep.parent.mkdir(parents=True, exist_ok=True)
                with keep.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(outcome.as_json()) + "\n")
            yield outcome


def _read(keep: Path) -> dict[LawCase, LawOutcome]:
    kept: dict[LawCase, LawOutcome] = {}
    if not keep.exists():
        return kept
    for row in keep.read_text(encoding="utf-8").splitlines():
        values: dict[str, Any] = json.loads(row)
        values["case"] = LawCase(**values["case"])
        values["true"] = tuple(tuple(one) for one in values["true"])
        for name in ("effects", "laws", "chi2"):
            values[name] = tuple(values[name])
        values["held_out"] = tuple(values["held_out"]) if values["held_out"] else None
        kept[values["case"]] = LawOutcome(**values)
    return kept


if __name__ == "__main__":
    raise SystemExit(main())
