"""The closed loop, scored blind: ``python -m tests.benchmarks.loop [--quick] [--only KIND,...] [--page FILE]``.

Hundreds of sets are drawn on a generator that shares no code with the analysis, diagnosed, and scored against what
was true.  Outcomes are kept line by line (``--keep FILE``), so that a run that was cut off goes on where it stopped.
"""

import argparse
import functools
import os
import sys
from pathlib import Path
from typing import Any

from tests.benchmarks.kept_runs import kept_runs

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
    for done, outcome in enumerate(kept_runs(todo, _one, options.processes, options.keep, _from_json), 1):
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
    from analysis.compiled.kernel_cache import use_kernel_cache

    use_kernel_cache()
    from analysis.diagnosis.diagnosis_of_shots import diagnose

    return diagnose


def _one(case: Any) -> Any:
    from tests.benchmarks.loop_cases import judge

    return judge(case, functools.partial(_diagnose()))


def _from_json(values: dict[str, Any]) -> Any:
    from tests.benchmarks.loop_cases import Case, Outcome

    values["case"] = Case(**{**values["case"], "names": tuple(values["case"]["names"])})
    values["named"] = tuple(values["named"])
    values["classes"] = tuple(tuple(c) for c in values["classes"])
    values["held_out"] = tuple(values["held_out"]) if values["held_out"] else None
    return Outcome(**values)


if __name__ == "__main__":
    raise SystemExit(main())
