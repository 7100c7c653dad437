"""The shot that decides, scored blind: ``python -m tests.benchmarks.next_shots [--sets N] [--page FILE]``.

Outcomes are kept line by line (``--keep FILE``), so that a run that was cut off goes on where it stopped.
"""

import argparse
import os
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.special import ndtr

from tests.benchmarks.kept_runs import kept_runs
from tests.benchmarks.loop_cases import SNRS, Case, cases
from tests.benchmarks.loop_score import Line, Share, share
from tests.benchmarks.next_shot_cases import NextOutcome, judge

_CLEAN = 500  # beyond the seed of the sets with an effect, that their numbers stay what they are
_FIFTH = 1.2
_KINDS = ("clean", "single", "natural", "pair", "beyond", "raw")


def main(arguments: list[str] | None = None) -> int:
    """Run the benchmark; return 0 when every target that was judged is met, 1 when not."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--sets", type=int, default=20, metavar="N", help="of every effect, over the strengths in turn")
    parser.add_argument("--clean", type=int, default=20, metavar="N", help="sets without an effect, of every noise")
    parser.add_argument("--effects", default="", metavar="NAME,...", help="only these")
    parser.add_argument("--below", type=float, default=float("inf"), metavar="SNR", help="only sets asked to be weaker")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--processes", type=int, default=min(2, os.cpu_count() or 1))
    parser.add_argument(
        "--random", type=int, default=1, metavar="N", help="shots at random beside every Nth set; 0: none"
    )
    parser.add_argument("--page", type=Path, metavar="FILE", help="write figures and every open set as Markdown")
    parser.add_argument("--keep", type=Path, metavar="FILE", help="outcomes, a JSON object a line; read back if there")
    options = parser.parse_args(arguments)
    wanted = set(filter(None, options.effects.split(",")))
    every = cases(dict.fromkeys(_KINDS, 0) | {"single": options.sets}, options.seed)
    todo = [case for case in every if (not wanted or case.names[0] in wanted) and case.snr < options.below]
    todo += cases(dict.fromkeys(_KINDS, 0) | {"clean": options.clean}, options.seed + _CLEAN)
    outcomes = []
    for done, outcome in enumerate(
        kept_runs(todo, partial(_one, options.random), options.processes, options.keep, _from_json), 1
    ):
        outcomes.append(outcome)
        print(f"{done}/{len(todo)} sets", file=sys.stderr, flush=True)
    scored = lines(outcomes)
    marks = {True: "met", False: "NOT MET", None: ""}
    for line in scored:
        print(f"{line.what:56s} {line.figure:48s} {line.target:32s} {marks[line.met]}")
    if options.page:
        options.page.parent.mkdir(parents=True, exist_ok=True)
        options.page.write_text(page(outcomes, options.seed), encoding="utf-8")
    return int(any(line.met is False for line in scored))


def exact(names: Sequence[str], left: Sequence[str], outcome: NextOutcome) -> bool:
    """Return whether just the true effects were named, each alone."""
    return set(names) == set(outcome.case.names) and not left


def one_with_two_readings(outcome: NextOutcome) -> bool:
    """Return whether the set ended as a class that was proven inseparable."""
    return outcome.proven and bool(outcome.open_last)


def lines(outcomes: Sequence[NextOutcome]) -> list[Line]:
    """Return the figures against what is asked."""
    clean = [o for o in outcomes if not o.case.names and not o.problem]
    ran = [o for o in outcomes if o.case.names and not o.problem]
    single = [o for o in ran if not one_with_two_readings(o)]
    proven = [o for o in ran if one_with_two_readings(o)]
    taken = [o for o in ran if o.steps]
    planned, random, twice = (
        share(taken, lambda o: exact(o.named, o.open_last, o)),
        share([o for o in taken if o.random_open is not None], lambda o: exact(o.random_named, o.random_open or (), o)),
        share([o for o in taken if o.twice_open is not None], lambda o: exact(o.twice_named, o.twice_open or (), o)),
    )
    apart = share(single, lambda o: exact(o.named, o.open_last, o))
    fewer = twice.value <= planned.value if twice.runs else None
    before = share(ran, lambda o: exact(o.named_first, o.open_first, o))
    after = share(ran, lambda o: exact(o.named, o.open_last, o))
    right = share(proven, lambda o: set(o.case.names) <= {*o.named, *o.open_last})
    wrong = share(ran, lambda o: bool(o.named) and not o.open_last and set(o.named) != set(o.case.names))
    shots = [len(o.steps) for o in taken]
    return [
        Line("exact name from the set alone", str(before), "shown", None),
        _asked("exact name after at most three planned shots", after, 0.95),
        Line("the same, proven inseparable apart", str(apart), "shown", None),
        _asked("proven inseparable, the true one among them", right, 0.99),
        Line("named alone, and wrong", str(wrong), "<= 1 %", wrong.value <= 0.01 if wrong.runs else None),
        Line("where shots were planned: exact after them", str(planned), "shown", None),
        Line("after as many at random", str(random), "shown", None),
        Line("after twice as many at random", str(twice), "<= planned", fewer),
        *_needed(ran),
        Line("planned shots a set", f"mean {np.mean(shots):.2f}" if shots else "–", "<= 3", None),
        *_reached(taken),
        _clean(share(clean, lambda o: bool(o.named))),
        Line("failed", str(share(outcomes, lambda o: bool(o.problem))), "0", not any(o.problem for o in outcomes)),
    ]


def _clean(named: Share) -> Line:
    return Line("clean, something named", str(named), "<= 1 %", named.value <= 0.01 if named.runs else None)


def _reached(taken: Sequence[NextOutcome]) -> list[Line]:
    """Return what planned shots reached of what was expected of them.

    A separation scatters by one norm, being the root of a chi^2: of a shot that is to bring five norms no forecast
    meets more than two thirds within a fifth.
    """
    both = [(e, r) for o in taken for e, r in o.steps if r is not None and e]
    if not both:
        return []
    expected, reached = np.array(both).T
    met = float(np.mean(np.abs(np.log(np.maximum(reached / expected, 1e-9))) < np.log(_FIFTH)))
    can_be = float(np.mean(ndtr((_FIFTH - 1) * expected) - ndtr((1 / _FIFTH - 1) * expected)))
    norms = reached - expected
    least, most = np.percentile(norms, [5, 95])
    return [
        Line(
            "reached over expected separation",
            f"median {np.median(reached / expected):.2f}, {100 * met:.0f} % within 20 % of {len(both)}",
            f"20 %, which {100 * can_be:.0f} % can be",
            None,
        ),
        Line(
            "reached less expected, norms",
            f"median {np.median(norms):+.2f}, 90 % in {least:+.1f} to {most:+.1f}",
            "",
            None,
        ),
    ]


def _needed(ran: Sequence[NextOutcome]) -> list[Line]:
    """Return how many shots a first plan has against how many at random are foretold to bring 5 norms, and as much."""
    needs = [o.needs for o in ran if o.needs is not None]
    mean = [float(np.mean([n[k] for n in needs])) if needs else 0.0 for k in range(3)]

    def line(what: str, random: float, target: str, met: bool | None) -> Line:
        return Line(what, f"{mean[0]:.2f} planned, {random:.2f} at random, {len(needs)} sets", target, met)

    half = mean[0] <= 0.5 * mean[2] if needs else None
    return [
        line("shots that bring 5 norms, foretold", mean[1], "shown", None),
        line("shots that bring what the plan does, foretold", mean[2], "half as many", half),
    ]


def _asked(what: str, got: Share, least: float) -> Line:
    return Line(what, str(got), f">= {100 * least:.0f} %", got.value >= least if got.runs else None)


def page(outcomes: Sequence[NextOutcome], seed: int) -> str:
    """Return figures and open sets as Markdown."""
    rows = [f"| {line.what} | {line.figure} | {line.target} |" for line in lines(outcomes)]
    sets = [
        f"| {o.case.names[0]} | {o.snr:.0f} | {o.case.seed} | {', '.join(o.open_first)} | {_steps(o)} | {_end(o)} |"
        for o in sorted(outcomes, key=lambda o: (o.case.names, o.snr, o.case.seed))
        if o.open_first
    ]
    single = sum(bool(o.case.names) for o in outcomes)
    return "\n".join(
        [
            "# Planned shots, scored blind",
            "",
            f"`python -m tests.benchmarks.next_shots --seed {seed}`: {single} sets of three",
            f"shots with one effect, residual SNR {', '.join(f'{snr:g}' for snr in SNRS)} in turn.",
            "",
            "| figure | measured | asked |",
            "|---|---|---|",
            *rows,
            "",
            "| true | SNR | seed | left open | expected → reached | in the end |",
            "|---|---|---|---|---|---|",
            *sets,
            "",
        ]
    )


def _steps(outcome: NextOutcome) -> str:
    told = [f"{expected:.1f} → {'–' if reached is None else f'{reached:.1f}'}" for expected, reached in outcome.steps]
    return ", ".join(told) or "–"


def _end(outcome: NextOutcome) -> str:
    if outcome.problem:
        return outcome.problem
    named = ", ".join(outcome.named) or "nothing"
    others = [name for name in outcome.open_last if name not in outcome.named]
    proof = f"; no shot tells (best {outcome.best:.1f})" if one_with_two_readings(outcome) else ""
    return f"{named}{f' (or {chr(44).join(others)})' if others else ''}{proof}"


def _one(every: int, case: Case) -> NextOutcome:
    from analysis.compiled.kernel_cache import use_kernel_cache

    use_kernel_cache()
    from analysis.diagnosis.diagnosis_of_shots import diagnose

    return judge(case, diagnose, at_random=bool(every) and case.seed % every == 0)


def _from_json(values: dict[str, Any]) -> NextOutcome:
    values["case"] = Case(**{**values["case"], "names": tuple(values["case"]["names"])})
    for name in ("named_first", "open_first", "named", "open_last", "random_named", "twice_named"):
        values[name] = tuple(values[name])
    for name in ("random_open", "twice_open"):
        values[name] = tuple(values[name]) if values[name] is not None else None
    values["needs"] = tuple(values["needs"]) if values.get("needs") else None
    values["cpu_s"] = tuple(values["cpu_s"])
    values["steps"] = tuple((expected, reached) for expected, reached in values["steps"])
    return NextOutcome(**values)


if __name__ == "__main__":
    raise SystemExit(main())
