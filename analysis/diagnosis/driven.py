"""Diagnose a driven slider: find the laws that explain the force residual of mass, drag and offset."""

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from analysis.collision import Effect
from analysis.diagnosis.result import (
    Candidate,
    Diagnosis,
    DriveEvidence,
    DriveRemainder,
    Errors,
    FoundEffect,
    Standing,
)
from analysis.diagnosis.verdict.acceptance import conclude
from analysis.drive import (
    GAIN_ERROR,
    LAWS,
    LawSearch,
    Mask,
    MassCheck,
    NonlinearValues,
    Regression,
    Repeatability,
    Split,
    Table,
    Trial,
    as_fit,
    check_mass,
    chi2,
    filtered_noise_n,
    laws_named,
    look_alikes,
    prepare,
    regress,
    repeatability_of,
    search_laws,
)
from analysis.shot import Floats, Motion, Progress, Stop

EXPLAINED_RATIO = 1.5  # times the repeatability: a residual up to here counts as explained


@dataclass(frozen=True, slots=True)
class _Halves:
    """A fit of the whole records, and the force residual (N rms) on the validation half of a fit of the other half."""

    whole: Regression
    held_n: float


def diagnose_driven(
    motions: Sequence[Motion],
    accepted: Sequence[Effect | str] = (),
    progress: Progress | None = None,
    cancelled: Stop | None = None,
) -> Diagnosis:
    """Return the diagnosis of driven records against mass, drag, offset and the ``accepted`` laws.

    The later half of each record is for validation: the fits that the gates judge do not use it.  Raises AnalysisError
    where there is nothing to judge, Cancelled when asked to stop.
    """
    began = time.perf_counter()
    tell = progress or (lambda _what, _fraction: None)
    tell("fitting mass, drag and offset", 0.0)
    table = Table.of(prepare(motions), cancelled or (lambda: False))
    split = Split.of(table)
    tell("trying the laws of a drive", 0.1)
    accepted_names = tuple(law.name for law in laws_named(accepted))
    searched = search_laws(split, accepted_names, lambda share: tell("trying the laws of a drive", 0.1 + 0.7 * share))
    tell("fitting the whole record", 0.85)
    free = regress(table, searched.found.laws, None, searched.found.nonlinear)
    mass_check = check_mass(motions, free)
    before = _halves(split, accepted_names, searched.found.nonlinear, mass_check)
    after = _halves(split, searched.found.laws, searched.found.nonlinear, mass_check)
    repeatability = repeatability_of(table, after.whole, filtered_noise_n(motions, table.stretches, after.whole))
    tell("distinguishing look-alikes", 0.9)
    effects = tuple(_found(split, after.whole, searched, law) for law in after.whole.laws if law not in accepted_names)
    explained = after.whole.rms_n <= EXPLAINED_RATIO * repeatability.force_n
    seconds = time.perf_counter() - began
    diagnosis = Diagnosis(
        verdict=conclude(explained=explained, effects=effects),
        effects=effects,
        candidates=_candidates(searched, mass_check),
        error_before=_errors(before.whole.rms_n, repeatability),
        error_after=_errors(after.whole.rms_n, repeatability),
        error_held_out_before=_errors(before.held_n, repeatability),
        error_held_out_after=_errors(after.held_n, repeatability),
        fit_before=as_fit(motions, before.whole, mass_check, repeatability, 0.0),
        fit_after=as_fit(motions, after.whole, mass_check, repeatability, seconds),
        seconds=seconds,
        drive=DriveEvidence(
            repeatability,
            mass_check,
            table.stretches[0].bandwidth_hz,
            laws_named(searched.unidentifiable),
            None if explained else remainder(table, after.whole),
        ),
    )
    tell("diagnosed", 1.0)
    return diagnosis


def _halves(split: Split, laws: tuple[str, ...], nonlinear: NonlinearValues, mass_check: MassCheck) -> _Halves:
    def fitted(mask: Mask | None) -> Regression:
        return regress(split.table, laws, mask, nonlinear, mass_check.fixed)

    return _Halves(fitted(None), fitted(split.kept).rms_of(split.held))


def _errors(force_n: float, repeatability: Repeatability) -> Errors:
    """Return the errors in force; an open-loop model's path drifts, so displacement and velocity are not compared."""
    return Errors(float("nan"), float("nan"), force_n, chi2(force_n, repeatability))


def _found(split: Split, whole: Regression, searched: LawSearch, law: str) -> FoundEffect:
    merit = searched.merits[law]
    evidence = {"delta_bic": merit.delta_bic, "held_out_force_rms_without_it_n": merit.without_it_n}
    others = laws_named(look_alikes(split.table, whole, law))
    return FoundEffect(LAWS[law], whole.parameters(law), evidence, others)


def remainder(table: Table, found: Regression) -> DriveRemainder:
    """Return the shares of the residual force's power that depend on direction, position and reversals."""
    left = found.residual_n
    speed, place = table.velocity_m_per_s, table.displacement_m
    slow = np.abs(speed) < 0.1 * float(np.abs(speed).max())
    one_way = np.stack([np.maximum(speed, 0.0), (speed > 0.0).astype(np.float64), speed, np.ones(speed.size)], axis=1)
    waves = [f(2.0 * np.pi * k * place / np.ptp(place)) for k in (1, 2, 3) for f in (np.sin, np.cos)]
    along = np.stack([np.ones(place.size), place, *waves], axis=1)
    reversals = float(left[slow] @ left[slow]) / float(left @ left)
    return DriveRemainder(_explained(left, one_way), _explained(left, along), reversals, float(np.mean(slow)))


def _explained(left: Floats, columns: Floats) -> float:
    solution, *_ = np.linalg.lstsq(columns, left, rcond=None)
    over = left - columns @ solution
    return 1.0 - float(over @ over) / float(left @ left)


def _candidates(searched: LawSearch, mass_check: MassCheck) -> tuple[Candidate, ...]:
    out = [_candidate(trial) for trial in searched.trials if len(trial.added) == 1]
    out += [Candidate(LAWS[law], 0.0, None, {}, Standing.MIXTURE) for law in searched.unidentifiable]
    gain = mass_check.gain_error
    if gain is None:
        out.append(Candidate(GAIN_ERROR, 0.0, None, {}, Standing.RESCALES))
    else:
        standing = Standing.MASS_AGREES if mass_check.agrees else Standing.MASS_DIFFERS
        score = abs(gain.value) / gain.std if gain.std > 0.0 else 0.0
        out.append(Candidate(GAIN_ERROR, score, None, {"fraction": gain}, standing, mass_check.fitted))
    return tuple(out)


def _candidate(trial: Trial) -> Candidate:
    (law,) = trial.added
    quantities = trial.found.parameters(law)
    first = next(iter(quantities.values()))
    score = abs(first.value) / first.std if first.std > 0.0 else 0.0
    return Candidate(
        LAWS[law], float(np.nan_to_num(score)), trial.delta_bic, quantities, Standing.VALIDATED, trial.validation_n
    )
