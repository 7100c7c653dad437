"""The closed loop for a driven slider: what mass, drag and offset leave of the force, and what accounts for it."""

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from analysis.diagnosis import driven_words as words
from analysis.diagnosis.result import Candidate, Diagnosis, Errors, FoundEffect, Verdict
from analysis.diagnosis.verdict.conclusion import conclude
from analysis.drive.alike import look_alikes
from analysis.drive.fit import as_fit, chi2, noise_n
from analysis.drive.mass import Weighed, weigh
from analysis.drive.regress import BentValues, Regression, regress
from analysis.drive.repeat import Floor, floor
from analysis.drive.run import prepare
from analysis.drive.search import Explored, Ground, Trial, explore
from analysis.drive.table import Mask, Table
from analysis.shot.motion import Motion
from analysis.shot.shot import Progress, Stop

SMALL_REST = 1.5  # of the floor: a remainder up to here counts as accounted for


@dataclass(frozen=True, slots=True)
class _Halves:
    """What a model leaves: over everything, and of the half that took no part."""

    whole: Regression
    held_n: float


def diagnose_driven(
    motions: Sequence[Motion],
    accepted: Sequence[str] = (),
    progress: Progress | None = None,
    cancelled: Stop | None = None,
) -> Diagnosis:
    """Return the diagnosis of driven records against mass, drag, offset and the ``accepted`` laws.

    The later half of each record takes no part in the fits that the gates are asked of.  Raises AnalysisError where
    there is nothing to judge, Cancelled when asked to stop.
    """
    began = time.perf_counter()
    tell = progress or (lambda _what, _share: None)
    tell("fitting mass, drag and offset", 0.0)
    table = Table.of(prepare(motions), cancelled or (lambda: False))
    ground = Ground.of(table)
    tell("trying the laws of a drive", 0.1)
    explored = explore(ground, accepted, lambda share: tell("trying the laws of a drive", 0.1 + 0.7 * share))
    tell("fitting the whole record", 0.85)
    free = regress(table, explored.found.laws, None, explored.found.bent)
    weighed = weigh(motions, free)
    before = _halves(ground, tuple(accepted), explored.found.bent, weighed)
    after = _halves(ground, explored.found.laws, explored.found.bent, weighed)
    below = floor(table, after.whole, noise_n(motions, table.runs, after.whole))
    tell("telling look-alikes apart", 0.9)
    effects = tuple(_found(ground, after.whole, explored, law) for law in after.whole.laws if law not in accepted)
    verdict = conclude(explained=after.whole.rms_n <= SMALL_REST * below.force_n, effects=effects)
    seconds = time.perf_counter() - began
    diagnosis = Diagnosis(
        verdict=verdict,
        sentence=words.sentence(effects, before.whole, after.whole, after.held_n, below, weighed),
        effects=effects,
        candidates=_candidates(explored, weighed),
        error_before=_errors(before.whole.rms_n, below),
        error_after=_errors(after.whole.rms_n, below),
        error_held_out_before=_errors(before.held_n, below),
        error_held_out_after=_errors(after.held_n, below),
        fit_before=as_fit(motions, before.whole, weighed, below, 0.0),
        fit_after=as_fit(motions, after.whole, weighed, below, seconds),
        remainder="" if verdict in (Verdict.ADEQUATE, Verdict.EFFECT_FOUND) else words.rest(table, after.whole, below),
        blind_spots=words.blind_spots(table, explored.coinciding, weighed),
        separating_shot=words.separating(effects, explored.coinciding),
        seconds=seconds,
    )
    tell("diagnosed", 1.0)
    return diagnosis


def _halves(ground: Ground, laws: tuple[str, ...], bent: BentValues, weighed: Weighed) -> _Halves:
    def fitted(mask: Mask | None) -> Regression:
        return regress(ground.table, laws, mask, bent, weighed.fixed)

    return _Halves(fitted(None), fitted(ground.kept).foretold_n(ground.held))


def _errors(force_n: float, below: Floor) -> Errors:
    """Return the errors; without a loop around it the model's own path drifts, so only the force is compared."""
    return Errors(float("nan"), float("nan"), force_n, chi2(force_n, below))


def _found(ground: Ground, whole: Regression, explored: Explored, law: str) -> FoundEffect:
    pay = explored.pays[law]
    evidence = {"delta_bic": pay.delta_bic, "held_out_force_rms_without_it_n": pay.without_n}
    others = look_alikes(ground.table, whole, law)
    parameters = whole.parameters(law)
    return FoundEffect(law, parameters, evidence, others, words.effect(law, parameters, whole, others))


def _candidates(explored: Explored, weighed: Weighed) -> tuple[Candidate, ...]:
    out = [_candidate(trial) for trial in explored.trials if len(trial.added) == 1]
    coincides = "not identifiable: in this motion it is a mixture of what is in the model"
    out += [Candidate(law, 0.0, None, {}, coincides) for law in explored.coinciding]
    gain = weighed.gain_error
    if gain is None:
        remark = "not identifiable: while no mass is stated it only rescales mass, drag and friction"
        out.append(Candidate("gain_error", 0.0, None, {}, remark))
    else:
        remark = "the stated mass agrees" if weighed.agrees else f"the same as a mass of {weighed.fitted} kg"
        score = abs(gain.value) / gain.std if gain.std > 0.0 else 0.0
        out.append(Candidate("gain_error", score, None, {"fraction": gain}, remark))
    return tuple(out)


def _candidate(trial: Trial) -> Candidate:
    (law,) = trial.added
    quantities = trial.found.parameters(law)
    first = next(iter(quantities.values()))
    score = abs(first.value) / first.std if first.std > 0.0 else 0.0
    remark = f"foretold force error {trial.held_out_n:.3g} N"
    return Candidate(law, float(np.nan_to_num(score)), trial.delta_bic, quantities, remark)
