"""The diagnosis on the independent rig: ``python -m tests.benchmarks.buildings [--clean N] [--effects N] [--laws N]``.

``--clean`` sets a site without an effect, ``--effects`` sets of each effect at a site, of the sizes of ``EFFECTS``,
``--laws`` sets with a magnet at a site, drawn between ``MAGNETS_N``, on ``tests.building_rig``, which shares no code
with the program's own bench.  A third of the sets begin with a plate that swings.  Outcomes are kept line by line
(``--keep FILE``).
"""

import argparse
import os
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from analysis.diagnosis.findings.wording import in_words
from tests.benchmarks.kept_runs import kept_runs
from tests.benchmarks.loop_score import Share

if TYPE_CHECKING:
    from tests.building_rig import Rig

SITES = ("VC-A", "VC-B", "VC-C", "VC-D", "VC-E", "VC-F", "VC-G")
EFFECTS = {  # of the catalogue: the rig's own name for it, its size, the parameter that tells it
    "coulomb_friction": ("friction_n", 1.2e-4, "force_n"),
    "viscous_drag": ("drag_n_s_per_m", 8e-4, "coefficient_n_s_per_m"),
    "quadratic_drag": ("quadratic_n_s2_per_m2", 3e-3, "coefficient_n_s2_per_m2"),
    "plate_damping": ("plate_damping_n_s_per_m", 4e-3, "coefficient_n_s_per_m"),
    "cubic_stiffness": ("cubic_n_per_m3", 2.5e5, "coefficient_n_per_m3"),
}
MAGNET = "magnet"  # no effect of the catalogue: a law of the place that is to be learned
MAGNETS_N = (1e-4, 1e-3)
_LAW = "block place falling exponential"


@dataclass(frozen=True, slots=True)
class Case:
    """One set: the site, the effect it has ("": none), its seed and the number of its shots."""

    site: str
    effect: str
    seed: int
    shots: int = 3


@dataclass(frozen=True, slots=True)
class Outcome:
    """What was said: verdict, names (each with what it cannot be told from), and the true effect as (value, std)."""

    case: Case
    verdict: str
    named: tuple[tuple[str, ...], ...] = ()
    laws: tuple[str, ...] = ()
    found: tuple[float, float] | None = None
    seconds: float = 0.0
    cpu_seconds: float = 0.0
    problem: str = ""
    text: str = field(default="", compare=False)

    @property
    def score(self) -> str:
        """Get how well that is: "right", "in the class", "false", "unexplained", "missed" or "failed"."""
        if self.problem:
            return "failed"
        if self.case.effect == MAGNET and self.laws == (_LAW,) and not self.named:
            return "right"
        if not self.named and not self.laws:
            if self.verdict == "adequate":
                return "missed" if self.case.effect else "right"
            return "unexplained"
        if self.named == ((self.case.effect,),) and not self.laws:
            return "right"
        if len(self.named) == 1 and self.case.effect in self.named[0] and not self.laws:
            return "in the class"
        return "false"

    def as_json(self) -> dict[str, Any]:
        """Return a plain dictionary."""
        return asdict(self)


def from_json(values: dict[str, Any]) -> Outcome:
    """Return the outcome that a kept line holds."""
    named = tuple(tuple(names) for names in values["named"])
    found = tuple(values["found"]) if values["found"] else None
    case = Case(**values["case"])
    return Outcome(**{**values, "case": case, "named": named, "laws": tuple(values["laws"]), "found": found})


def cases(clean: int, of_each: int, laws: int, seed: int, shots: int) -> list[Case]:
    """Return the cases; every one has a seed of its own."""
    wanted = [(site, "") for _ in range(clean) for site in SITES]
    wanted += [(site, effect) for _ in range(of_each) for site in SITES for effect in EFFECTS]
    wanted += [(site, MAGNET) for _ in range(laws) for site in SITES]
    return [Case(site, effect, seed * 1_000_003 + place, shots) for place, (site, effect) in enumerate(wanted)]


def clean_rig(site: str, seed: int) -> "Rig":
    """Return a rig without an effect; in a third of all sets the plate begins with a swing."""
    from tests.building_rig import Rig

    return Rig(site, plate_swings=seed % 3 == 0)


def magnet_n(seed: int) -> float:
    """Return the force of a set's magnet."""
    least, most = np.log(MAGNETS_N)
    return float(np.exp(np.random.default_rng((seed, 0x3A6)).uniform(least, most)))


def judge(case: Case) -> Outcome:
    """Draw a case, have it diagnosed, and write down what was said."""
    from analysis.diagnosis.diagnosis_of_shots import diagnose

    rig = clean_rig(case.site, case.seed)
    if case.effect == MAGNET:
        rig = rig.with_bodies(magnet_n=magnet_n(case.seed))
    elif case.effect:
        name, size, _ = EFFECTS[case.effect]
        rig = rig.with_bodies(**{name: size})
    speeds = (0.20, 0.265, 0.33, 0.15)[: case.shots]
    motions = rig.shots(case.seed, speeds)
    began, cpu = time.perf_counter(), time.process_time()
    try:
        said = diagnose(motions)
    except Exception as error:
        return Outcome(case, "failed", problem=f"{type(error).__name__}: {error}"[:200])
    found = None
    for effect in said.effects:
        if effect.name == case.effect:
            told = effect.parameters[EFFECTS[case.effect][2]]
            found = (told.value, told.std)
    for law in said.laws:
        if case.effect == MAGNET and "a" in law.parameters:
            force, _ = law.parameters["a"]
            found = (force.value, force.std)
    return Outcome(
        case,
        said.verdict.value,
        tuple((one.name, *(other.name for other in one.indistinguishable_from)) for one in said.effects),
        tuple(f"{law.where} {law.argument} {law.form}" for law in said.laws),
        found,
        time.perf_counter() - began,
        time.process_time() - cpu,
        text=in_words(said).remainder[:200],
    )


def _one(case: Case) -> Outcome:
    from analysis.compiled.kernel_cache import use_kernel_cache

    use_kernel_cache()
    return judge(case)


def main(arguments: list[str] | None = None) -> int:
    """Run the benchmark and print how the sets ended."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--clean", type=int, default=0, metavar="N", help="clean sets a site")
    parser.add_argument("--effects", type=int, default=0, metavar="N", help="sets an effect and site")
    parser.add_argument("--laws", type=int, default=0, metavar="N", help="sets with a law of the place, a site")
    parser.add_argument("--shots", type=int, default=3)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--processes", type=int, default=min(2, os.cpu_count() or 1))
    parser.add_argument("--keep", type=Path, metavar="FILE", help="outcomes, a JSON object a line; read back if there")
    options = parser.parse_args(arguments)
    todo = cases(options.clean, options.effects, options.laws, options.seed, options.shots)
    outcomes: list[Outcome] = []
    for outcome in kept_runs(todo, _one, options.processes, options.keep, from_json):
        outcomes.append(outcome)
        if outcome.score != "right":
            print(f"  {outcome.case}: {outcome.score}, {outcome.verdict} {outcome.named} {outcome.laws} "
                  f"{outcome.problem}{outcome.text}", flush=True)  # fmt: skip
        if len(outcomes) % 20 == 0:
            print(f"{len(outcomes)}/{len(todo)} sets", file=sys.stderr, flush=True)
    print(table(outcomes, options.seed))
    return 0


def table(outcomes: Sequence[Outcome], seed: int) -> str:
    """Return how the sets ended, how far the sizes found lie from the true ones, and how long that took."""
    commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=False)
    cpu = sorted(outcome.cpu_seconds for outcome in outcomes)
    text = [f"{len(outcomes)} sets of seed {seed} at {commit.stdout.strip()}: {cpu[len(cpu) // 2]:.1f} s of CPU "
            f"(median), {cpu[-1]:.0f} s at most"]  # fmt: skip
    clean = [outcome for outcome in outcomes if not outcome.case.effect]
    for what, bad in (("false name or law", ("false",)), ("not adequate", ("false", "unexplained", "failed"))):
        text.append(f"clean, {what}: {Share(sum(outcome.score in bad for outcome in clean), len(clean))}")
    for effect in (*EFFECTS, MAGNET):
        of = [outcome for outcome in outcomes if outcome.case.effect == effect]
        counts = Counter(outcome.score for outcome in of)
        told = [(o.found, EFFECTS[effect][1] if effect in EFFECTS else magnet_n(o.case.seed)) for o in of]
        pulls = [(found[0] - true) / found[1] for found, true in told if found is not None and found[1] > 0]
        rms = (sum(pull**2 for pull in pulls) / len(pulls)) ** 0.5 if pulls else float("nan")
        text.append(f"{effect:18s} {dict(counts)}; off by {rms:.2f} standard deviations (rms of {len(pulls)})")
    return "\n".join(text)


if __name__ == "__main__":
    raise SystemExit(main())
