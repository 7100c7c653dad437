"""Laws off the catalogue, scored blind: ``python -m tests.benchmarks.laws [--sets N] [--clean N] [--page FILE]``.

Outcomes are kept line by line (``--keep FILE``), so that a run that was cut off goes on where it stopped.
"""

import argparse
import os
import sys
from pathlib import Path
from typing import Any

from tests.benchmarks.kept_runs import kept_runs
from tests.benchmarks.law_cases import LawCase, LawOutcome, cases, judge
from tests.benchmarks.law_score import lines, page


def main(arguments: list[str] | None = None) -> int:
    """Run the benchmark; return 0 when every target that was judged is met, 1 when not."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--sets", type=int, default=63, metavar="N", help="with a law, over all families in turn")
    parser.add_argument("--clean", type=int, default=300, metavar="N", help="sets without a law")
    parser.add_argument("--only", metavar="NAME", help='a family, "memory" or "pair"')
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--processes", type=int, default=min(2, os.cpu_count() or 1))
    parser.add_argument("--page", type=Path, metavar="FILE", help="write figures and every set as Markdown")
    parser.add_argument("--keep", type=Path, metavar="FILE", help="outcomes, a JSON object a line; read back if there")
    options = parser.parse_args(arguments)
    todo = cases(options.sets, options.clean, options.seed, options.only)
    outcomes = []
    for done, outcome in enumerate(kept_runs(todo, _one, options.processes, options.keep, _from_json), 1):
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
    from analysis.compiled.kernel_cache import use_kernel_cache

    use_kernel_cache()
    from analysis.diagnosis.diagnosis_of_shots import diagnose

    return judge(case, diagnose)


def _from_json(values: dict[str, Any]) -> LawOutcome:
    values["case"] = LawCase(**values["case"])
    values["true"] = tuple(tuple(one) for one in values["true"])
    for name in ("effects", "laws", "chi2"):
        values[name] = tuple(values[name])
    values["classes"] = tuple(tuple(one) for one in values.get("classes", ()))
    values["held_out"] = tuple(values["held_out"]) if values["held_out"] else None
    return LawOutcome(**values)


if __name__ == "__main__":
    raise SystemExit(main())
