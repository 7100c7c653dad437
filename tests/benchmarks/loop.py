"""The closed loop, scored blind: ``python -m tests.benchmarks.loop [--quick] [--only KIND,...] [--page FILE]``.

Hundreds of sets are drawn on a generator that shares no code with the analysis, diagnosed, and scored against what
was true.  Outcomes are kept line by line (``--keep FILE``), so that a run that was cut off goes on where it stopped.
"""

import argparse
import functools
import json
import multiprocessing
import os
import random
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

FULL = {"clean": 300, "single": 20, "natural": 4, "pair": 60, "beyond": 20, "raw": 12}
QUICK = {"clean": 4, "single": 1, "natural": 1, "pair": 2, "beyond": 1, "raw": 1}


def main(arguments: list[str] | None = None) -> int:
    """Run the benchmark; return 0 when every target that was judged is met, 1 when not, 2 without a diagnosis."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="a few runs of each kind: minutes, not an hour")
    parser.add_argument("--only", default="", metavar="KIND,...", help=f"of {', '.join(FULL)}")
    parser.add_argument("--runs", type=int, metavar="N", help="runs a cell, in place of the usual numbers")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--processes", type=int, default=min(2, os.cpu_count() or 1))
    parser.add_argument("--page", type=Path, metavar="FILE", help="write figures and confusion matrix as Markdown")
    parser.add_argument("--keep", type=Path, metavar="FILE", help="outcomes, a JSON object a line; read back if there")
    options = parser.parse_args(arguments)
    try:
        _diagnose()
    except ImportError as error:
        print(f"no diagnosis to benchmark: {error}", file=sys.stderr)
        return 2
    from tests.benchmarks.loop_cases import cases
    from tests.benchmarks.loop_page import page
    from tests.benchmarks.loop_score import lines

    runs = dict(QUICK if options.quick else FULL)
    if options.runs is not None:
        runs = dict.fromkeys(runs, options.runs)
    wanted = set(filter(None, options.only.split(","))) or set(runs)
    if unknown := wanted - set(runs):
        parser.error(f"--only: no kind {', '.join(sorted(unknown))}; there are {', '.join(runs)}")
    todo = [case for case in cases(runs, options.seed) if case.kind in wanted]
    outcomes = []
    for done, outcome in enumerate(_all(todo, options.processes, options.keep), 1):
        outcomes.append(outcome)
        if done % 20 == 0 or done == len(todo):
            print(f"{done}/{len(todo)} sets", file=sys.stderr, flush=True)
    scored = lines(outcomes)
    marks = {True: "met", False: "NOT MET", None: ""}
    for line in scored:
        print(f"{line.what:48s} {line.figure:48s} {line.target:32s} {marks[line.met]}")
    if options.page:
        options.page.parent.mkdir(parents=True, exist_ok=True)
        options.page.write_text(page(outcomes, "make bench-loop"), encoding="utf-8")
    return int(any(line.met is False for line in scored))


def _diagnose() -> Any:
    from analysis.kernel_cache import keep_true

    keep_true()
    from analysis.diagnosis import diagnose  # type: ignore[attr-defined]

    return diagnose


def _one(case: Any) -> Any:
    from tests.benchmarks.loop_cases import judge

    return judge(case, functools.partial(_diagnose()))


def _all(todo: list[Any], processes: int, keep: Path | None) -> Iterator[Any]:
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


def _read(keep: Path) -> dict[Any, Any]:
    from tests.benchmarks.loop_cases import Case, Outcome

    kept: dict[Any, Any] = {}
    if not keep.exists():
        return kept
    for row in keep.read_text(encoding="utf-8").splitlines():
        values = json.loads(row)
        values["case"] = Case(**{**values["case"], "names": tuple(values["case"]["names"])})
        values["named"] = tuple(values["named"])
        values["classes"] = tuple(tuple(c) for c in values["classes"])
        values["held_out"] = tuple(values["held_out"]) if values["held_out"] else None
        kept[values["case"]] = Outcome(**values)
    return kept


if __name__ == "__main__":
    raise SystemExit(main())
