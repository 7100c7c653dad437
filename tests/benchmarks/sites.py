"""The diagnosis in buildings: ``python -m tests.benchmarks.sites [--clean N] [--effects N] [--seed S] [--keep FILE]``.

``--clean`` sets a site without an effect, and ``--effects`` sets of each effect at a site, scaled so that it stands out
by twelve (``--norms``) norms of what noise and site leave to first order.  Their displacement has white noise; with
``--recorded`` the sets are beats of a path that wanders, recorded and demodulated.  Outcomes are kept line by line, so
that a run that was cut off goes on where it stopped.
"""

import argparse
import os
import subprocess
import sys
from collections import Counter
from collections.abc import Sequence
from operator import attrgetter
from pathlib import Path

from tests.benchmarks.buildings import SITES
from tests.benchmarks.kept_runs import kept_runs
from tests.benchmarks.loop_score import Share
from tests.benchmarks.site_cases import EFFECTS, NORMS, Case, Outcome, from_json

SCORES = ("right", "in the class", "with a false partner", "wrong", "unnamed", "missed", "failed")


def cases(
    sites: Sequence[str], effects: Sequence[str], clean: int, of_each: int, seed: int, norms: float, recorded: bool
) -> list[Case]:
    """Return the cases, effects of so many noise ``norms``; every one has a seed of its own."""
    wanted = [(site, "") for _ in range(clean) for site in sites]
    wanted += [(site, effect) for _ in range(of_each) for site in sites for effect in effects]
    return [
        Case(site, effect, seed * 1_000_003 + place, norms, recorded) for place, (site, effect) in enumerate(wanted)
    ]


def main(arguments: list[str] | None = None) -> int:
    """Run the benchmark and print how the sets of every site, and of every effect, ended."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--clean", type=int, default=0, metavar="N", help="clean sets a site")
    parser.add_argument("--effects", type=int, default=0, metavar="N", help="sets an effect and site")
    parser.add_argument("--sites", default=",".join(SITES))
    parser.add_argument("--only", default=",".join(EFFECTS), metavar="EFFECT,...")
    parser.add_argument("--norms", type=float, default=NORMS, help="how far an effect stands out of noise and site")
    parser.add_argument("--recorded", action="store_true", help="beats, demodulated, of a path that wanders")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--processes", type=int, default=min(2, os.cpu_count() or 1))
    parser.add_argument("--keep", type=Path, metavar="FILE", help="outcomes, a JSON object a line; read back if there")
    options = parser.parse_args(arguments)
    sites, effects = options.sites.split(","), options.only.split(",")
    todo = cases(sites, effects, options.clean, options.effects, options.seed, options.norms, options.recorded)
    outcomes: list[Outcome] = []
    for outcome in kept_runs(todo, _one, options.processes, options.keep, from_json):
        outcomes.append(outcome)
        if outcome.score != "right":
            print(_told(outcome), flush=True)
        if len(outcomes) % 20 == 0:
            print(f"{len(outcomes)}/{len(todo)} sets", file=sys.stderr, flush=True)
    print(table(outcomes, options.seed))
    return 0


def _one(case: Case) -> Outcome:
    from analysis.compiled.kernel_cache import use_kernel_cache

    use_kernel_cache()
    from analysis.diagnosis.diagnosis_of_shots import diagnose
    from tests.benchmarks.site_cases import judge

    return judge(case, diagnose)


def _told(outcome: Outcome) -> str:
    case = outcome.case
    named = " + ".join("/".join((name, *others)) for name, others in zip(outcome.named, outcome.classes, strict=True))
    return (
        f"  {case.site} {case.effect or 'nothing'} ({outcome.norms:.0f} norms, seed {case.seed}): {outcome.score}, "
        f"{outcome.verdict} {named} {outcome.problem}".rstrip()
    )


def table(outcomes: Sequence[Outcome], seed: int) -> str:
    """Return how the sets ended, by site and by effect."""
    commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=False)
    cpu = sorted(outcome.seconds for outcome in outcomes)
    median = cpu[len(cpu) // 2]
    text = [f"{len(outcomes)} sets of seed {seed} at {commit.stdout.strip()}, {median:.0f} s of CPU (median)"]
    clean = [outcome for outcome in outcomes if not outcome.case.effect]
    for site in dict.fromkeys(outcome.case.site for outcome in clean):
        false = [outcome.score != "right" for outcome in clean if outcome.case.site == site]
        text.append(f"clean, {site}: not adequate {Share(sum(false), len(false))}")
    strong = [outcome for outcome in outcomes if outcome.case.effect]
    if strong:
        text.append(f"{'':26s}" + " ".join(f"{score:>20s}" for score in SCORES))
    for key in (attrgetter("case.site"), attrgetter("case.effect")):
        for of in dict.fromkeys(map(key, strong)):
            counts = Counter(outcome.score for outcome in strong if key(outcome) == of)
            text.append(f"{of:26s}" + " ".join(f"{counts[score] or '':>20}" for score in SCORES))
    return "\n".join(text)


if __name__ == "__main__":
    raise SystemExit(main())
