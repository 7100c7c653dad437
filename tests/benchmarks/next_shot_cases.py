"""Blind sets that a diagnosis leaves open, the planned shots taken, and as many at random beside them."""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from analysis.diagnosis.findings.criteria import CRITERIA
from analysis.diagnosis.findings.result import Diagnosis
from analysis.inference.model.samples import Samples, averaged_shots
from analysis.planning.distances import screen_shots
from analysis.planning.model_comparison import compare_models
from analysis.planning.next_shot import NextShot, Reach, contact_s, first_indistinguishable
from analysis.planning.shot_log import PlannedStep, next_step, plan_next
from analysis.shot.motion import Motion
from tests.analysis.shots import shots_of
from tests.bench.blind import Take, Truth, records
from tests.benchmarks.loop_cases import Case, as_motion, draw

MOST = 3
MAX_AT_RANDOM = 9
_SET_OFF = 0.02  # part by which a speed that was asked for is missed
Diagnose = Callable[[Sequence[Motion]], Diagnosis]


@dataclass(frozen=True, slots=True)
class NextOutcome:
    """What a set said at once, after the planned shots, and after as many and twice as many at random.

    ``open_*`` are the effects between which it was undecided; ``steps`` (expected, reached) of every planned shot,
    nothing expected of those that turned out another's than the plan could part;
    ``proven`` says that the plan found no shot to tell them apart, with the best ``best`` noise norms.
    """

    case: Case
    snr: float
    named_first: tuple[str, ...]
    open_first: tuple[str, ...]
    named: tuple[str, ...] = ()
    open_last: tuple[str, ...] = ()
    steps: tuple[tuple[float, float | None], ...] = ()
    proven: bool = False
    best: float = 0.0
    random_open: tuple[str, ...] | None = None
    random_named: tuple[str, ...] = ()
    twice_open: tuple[str, ...] | None = None
    twice_named: tuple[str, ...] = ()
    truth: dict[str, dict[str, float]] = field(default_factory=dict)
    needs: tuple[int, float, float] | None = None  # shots planned at first; at random for 5 norms, for as much
    cpu_s: tuple[float, float, float] = (0.0, 0.0, 0.0)  # first diagnosis; plans and theirs; at random
    problem: str = ""

    def as_json(self) -> dict[str, Any]:
        """Return a plain dictionary."""
        return asdict(self)


def judge(case: Case, diagnose: Diagnose, *, at_random: bool = True) -> NextOutcome:
    """Draw a case, have it diagnosed, take what is planned until it is settled, and write down what was said."""
    rig = draw(case, bounded=False)
    truth = rig.truth
    began = time.process_time()
    motions = _motions(truth)
    first, like = diagnose(motions), averaged_shots(motions)
    diagnosed = time.process_time()
    spent = (diagnosed - began, 0.0, 0.0)
    outcome = NextOutcome(case, rig.snr, _names(first), _open(first), truth=dict(truth.effects), cpu_s=spent)
    if not outcome.open_first:
        return replace(outcome, named=outcome.named_first)
    random = np.random.default_rng((case.seed, 0x19))
    said, steps, now = first, (), truth
    try:
        standing = plan_next(shots_of(_motions(now)), said, steps)
        if standing.plan is not None and standing.plan.settles:
            levels = (CRITERIA.separation, standing.plan.separation)
            enough, as_much = _needed_at_random(first, _motions(truth), levels, case.seed)
            outcome = replace(outcome, needs=(len(standing.plan.shots), enough, as_much))
        while not standing.settled and len(standing.steps) < MOST:
            step: PlannedStep = next_step(standing)
            now = taken(now, step.shot, like, random)
            shown = _motions(now)
            said = diagnose(shown)
            standing = plan_next(shots_of(shown), said, (*standing.steps, step), left=MOST - len(standing.steps) - 1)
    except Exception as error:
        return replace(outcome, problem=f"{type(error).__name__}: {error}"[:200])
    settled = time.process_time()
    outcome = replace(
        outcome,
        cpu_s=(spent[0], settled - diagnosed, 0.0),
        named=_names(said),
        open_last=_open(said),
        steps=tuple((s.expected_separation if s.leader in s.expected else 0.0, s.reached) for s in standing.steps),
        proven=standing.plan is not None and not standing.plan.settles,
        best=0.0 if standing.plan is None else standing.plan.best,
    )
    count = len(standing.steps)
    if not at_random or not count:
        return outcome
    one, two = (diagnose(_motions(_at_random(truth, n, like, random))) for n in (count, 2 * count))
    return replace(
        outcome,
        random_open=_open(one),
        random_named=_names(one),
        twice_open=_open(two),
        twice_named=_names(two),
        cpu_s=(*outcome.cpu_s[:2], time.process_time() - settled),
    )


def taken(truth: Truth, shot: NextShot, like: Sequence[Samples], random: np.random.Generator) -> Truth:
    """Return the set with one shot more, its speed as near to what was asked for as a hand comes.

    Recorded as long as the program records it, from the contacts of the first shots, ``like``.
    """
    speed = shot.speed_m_per_s * (1 + _SET_OFF * float(random.uniform(-1, 1)))
    whole_s = round(shot.before_s + contact_s(shot, like) + shot.after_s, 4)
    takes = [truth.take(index) for index in range(len(truth.speeds_m_per_s))]
    return replace(
        truth,
        speeds_m_per_s=(*truth.speeds_m_per_s, speed),
        takes=(*takes, Take(shot.added_mass_kg, shot.before_s, whole_s)),
    )


def _at_random(truth: Truth, count: int, like: Sequence[Samples], random: np.random.Generator) -> Truth:
    """Return the set with shots that nobody planned: any speed, weights and record that a plan could have asked for."""
    for _ in range(count):
        truth = taken(truth, _any_shot(random), like, random)
    return truth


def _any_shot(random: np.random.Generator) -> NextShot:
    reach = Reach()
    low, high = min(reach.speeds_m_per_s), max(reach.speeds_m_per_s)
    speed = math.exp(random.uniform(math.log(low), math.log(high)))
    before = random.uniform(0.01, max(0.011, min(reach.before_s(speed), 0.1)))
    return NextShot(speed, float(random.choice(reach.added_kg)), before, float(random.uniform(0.02, reach.after_s)))


def _needed_at_random(
    diagnosis: Diagnosis, motions: Sequence[Motion], levels: Sequence[float], seed: int
) -> tuple[float, ...]:
    """Return how many shots at random bring each of ``levels`` in noise norms, on the mean of some sequences of them.

    To first order; ``MAX_AT_RANDOM`` where so many do not.
    """
    open_class, random = (
        compare_models(diagnosis.fit_after, first_indistinguishable(diagnosis), motions),
        np.random.default_rng((seed, 0x20)),
    )
    assert open_class is not None
    shots = [_any_shot(random) for _ in range(3 * MAX_AT_RANDOM)]
    distances = screen_shots(open_class, shots, lambda _: None, lambda: False)
    parted = distances.without(distances.inseparable_pairs(MOST))
    counts = []
    for _ in range(20):
        drawn = [shots[i] for i in random.permutation(len(shots)) if shots[i] in distances.each]
        reached = [
            min(parted.nearest(tuple(drawn[:n])).values(), default=0.0)
            for n in range(1, min(len(drawn), MAX_AT_RANDOM))
        ]
        counts.append([next((n for n, r in enumerate(reached, 1) if r >= at), MAX_AT_RANDOM) for at in levels])
    return tuple(float(mean) for mean in np.mean(counts, axis=0))


def _motions(truth: Truth) -> tuple[Motion, ...]:
    return tuple(as_motion(record) for record in records(truth))


def _open(diagnosis: Diagnosis) -> tuple[str, ...]:
    return tuple(effect.name for effect in first_indistinguishable(diagnosis))


def _names(diagnosis: Diagnosis) -> tuple[str, ...]:
    return tuple(effect.name for effect in diagnosis.effects)
