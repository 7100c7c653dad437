"""Diagnose a driven slider: find the laws that explain the force residual of mass, drag and offset."""

import time
from collections.abc import Sequence

import numpy as np

from analysis.collision import Effect
from analysis.diagnosis.driven_search import LawSearch, Trial, look_alikes, search_laws
from analysis.diagnosis.evidence.prediction_errors import force_errors
from analysis.diagnosis.findings.criteria import CRITERIA
from analysis.diagnosis.findings.result import (
    Candidate,
    Diagnosis,
    DriveEvidence,
    DriveRemainder,
    FoundEffect,
    Standing,
)
from analysis.diagnosis.verdict.acceptance import conclude
from analysis.drive import (
    GAIN_ERROR,
    LAWS,
    MassCheck,
    Regression,
    Table,
    as_fit,
    check_mass,
    filtered_noise_n,
    laws_named,
    prepare,
    project_out,
    regress,
    repeatability_of,
)
from analysis.inference import orthonormal
from analysis.shot import Floats, Motion, Progress, Quantity, Stop


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
    tell("trying the laws of a drive", 0.1)
    given = tuple(law.name for law in laws_named(accepted))
    searched = search_laws(table, given, lambda share: tell("trying the laws of a drive", 0.1 + 0.7 * share))
    tell("fitting the whole record", 0.85)
    laws, nonlinear = searched.found.laws, searched.found.nonlinear
    mass_check = check_mass(motions, regress(table, laws, None, nonlinear))
    before, after = (regress(table, some, None, nonlinear, mass_check.fixed) for some in (given, laws))
    halves = (regress(table, some, table.earlier, nonlinear, mass_check.fixed) for some in (given, laws))
    held_before_n, held_after_n = (half.rms_of(~table.earlier) for half in halves)
    repeatability = repeatability_of(table, after, filtered_noise_n(motions, table.stretches, after))
    tell("distinguishing look-alikes", 0.9)
    effects = tuple(
        FoundEffect(LAWS[law], after.parameters(law), evidence, laws_named(look_alikes(table, after, law)))
        for law, evidence in searched.evidence.items()
    )
    explained = after.rms_n <= CRITERIA.drive_explained * repeatability.force_n
    seconds = time.perf_counter() - began
    diagnosis = Diagnosis(
        verdict=conclude(explained=explained, effects=effects),
        effects=effects,
        candidates=_candidates(searched, mass_check),
        error_before=force_errors(before.rms_n, repeatability),
        error_after=force_errors(after.rms_n, repeatability),
        error_held_out_before=force_errors(held_before_n, repeatability),
        error_held_out_after=force_errors(held_after_n, repeatability),
        fit_before=as_fit(motions, before, mass_check, repeatability, 0.0),
        fit_after=as_fit(motions, after, mass_check, repeatability, seconds),
        seconds=seconds,
        drive=DriveEvidence(
            repeatability,
            mass_check,
            table.stretches[0].bandwidth_hz,
            laws_named(searched.unidentifiable),
            None if explained else remainder(table, after),
        ),
    )
    tell("diagnosed", 1.0)
    return diagnosis


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
    over = project_out(orthonormal(columns), left)
    return 1.0 - float(over @ over) / float(left @ left)


def _candidates(searched: LawSearch, mass_check: MassCheck) -> tuple[Candidate, ...]:
    out = [_candidate(trial) for trial in searched.trials if len(trial.added) == 1]
    out += [Candidate(LAWS[law], 0.0, None, {}, Standing.MIXTURE) for law in searched.unidentifiable]
    gain = mass_check.gain_error
    if gain is None:
        return (*out, Candidate(GAIN_ERROR, 0.0, None, {}, Standing.RESCALES))
    standing = Standing.MASS_AGREES if mass_check.agrees else Standing.MASS_DIFFERS
    return (*out, Candidate(GAIN_ERROR, _sigmas(gain), None, {"fraction": gain}, standing, mass_check.fitted))


def _candidate(trial: Trial) -> Candidate:
    (law,) = trial.added
    quantities = trial.found.parameters(law)
    score = float(np.nan_to_num(_sigmas(next(iter(quantities.values())))))
    return Candidate(LAWS[law], score, trial.delta_bic, quantities, Standing.VALIDATED, trial.validation_n)


def _sigmas(size: Quantity) -> float:
    return abs(size.value) / size.std if size.std > 0.0 else 0.0
