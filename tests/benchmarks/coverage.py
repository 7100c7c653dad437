"""Do the intervals hold?  ``python -m tests.benchmarks.coverage [--shots N] [--seed S] [--keep FILE] [--page FILE]``.

Shots of a bench in buildings from VC-A to VC-G, every sixth of them plain, the others with a machine's line, a knock,
samples that nobody says were lost, an eighth of the light or 8 bits, are analysed and compared with what was true.
Outcomes are kept line by line, so that a run that was cut off goes on where it stopped.
"""

import argparse
import json
import math
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tests.benchmarks.kept_runs import pooled

QUICK_SHOTS = 84


def main(arguments: list[str] | None = None) -> int:
    """Run the benchmark; print its tables, and write them into a page where one is named."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--shots", type=int, default=QUICK_SHOTS, help=f"how many ({QUICK_SHOTS})")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--processes", type=int, default=min(2, os.cpu_count() or 1))
    parser.add_argument("--keep", type=Path, metavar="FILE", help="outcomes, a JSON object a line; read back if there")
    parser.add_argument("--page", type=Path, metavar="FILE", help="put the tables between the page's coverage marks")
    parser.add_argument("--faults", action="store_true", help="list every number that is off without a word")
    options = parser.parse_args(arguments)
    from tests.benchmarks.coverage_table import faults, into_page, tables

    outcomes = []
    for outcome in _all(options.seed, options.shots, options.processes, options.keep):
        outcomes.append(outcome)
        if len(outcomes) % 50 == 0:
            print(f"{len(outcomes)}/{options.shots} shots", file=sys.stderr, flush=True)
    text = tables(outcomes, options.seed)
    print(text)
    if options.faults:
        print("\nOff without a word, worst first:\n", *faults(outcomes), sep="\n")
    if options.page:
        into_page(options.page, text)
    return 0


def one(at: tuple[int, int]) -> dict[str, Any]:
    """Return the outcome of shot (seed, index): each number as [value, std, truth], null where it was refused."""
    from analysis.compiled.kernel_cache import use_kernel_cache

    use_kernel_cache()
    from analysis.pipeline import analyse
    from analysis.report import shot_result
    from tests.benchmarks.coverage_shots import Case, draw

    case = Case(*at)
    drawn = draw(case)
    said = shot_result(analyse(drawn.recording))
    read = {name: _read(said, name, true) for name, true in drawn.truth.items()}
    return {
        "seed": case.seed,
        "index": case.index,
        "site": case.site,
        "condition": case.condition,
        "status": said["status"],
        "flags": said["flags"],
        "chi2": (said["fit"] or {}).get("reduced_chi2"),
        "read": read,
        "bound": drawn.bound,
        "bent": drawn.bent,
    }


def _read(said: dict[str, Any], name: str, true: float) -> list[float] | None:
    group, _, key = name.rpartition(".")
    table = {"": said, "cor_kinetic": said["cor_kinetic"], "fit": (said["fit"] or {}).get("parameters")}[group]
    found = (table or {}).get(key)
    if found is None or found["value"] is None or found["std"] is None or not math.isfinite(found["value"]):
        return None
    return [found["value"], found["std"], true]


def _all(seed: int, shots: int, processes: int, keep: Path | None) -> Iterator[dict[str, Any]]:
    kept = {}
    if keep and keep.exists():
        lines = (json.loads(line) for line in keep.read_text(encoding="utf-8").splitlines() if line.endswith("}"))
        kept = {line["index"]: line for line in lines if line["seed"] == seed and line["index"] < shots}
    yield from kept.values()
    left = [(seed, index) for index in range(shots) if index not in kept]
    yield from pooled(left, one, processes, keep, dict)


if __name__ == "__main__":
    raise SystemExit(main())
