"""The closed loop for a driven slider: what mass, drag and offset leave of the force, and what accounts for it."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from analysis.diagnosis.result import Candidate, Diagnosis, Errors, FoundEffect, Verdict
from analysis.model.driven import EFFECTS, Regression, Run, design, fit_driven, prepare, regress, rms
from analysis.motion import Motion
from analysis.quantity import Quantity

Floats = NDArray[np.float64]
BIC_AGAINST_BASE, BIC_AGAINST_NEXT = 10.0, 6.0  # EFFECTS.md section 4.6
SEPARABLE_SNR = 5.0  # EFFECTS.md section 4.7
PAYS = 0.02  # the share of the held-out force error an effect must take away
MOST_EFFECTS = 3
SMALL_REST = 1.5  # of the force's noise: a remainder up to here counts as accounted for
FORMS = {"coulomb_friction": "F_c sgn v", "quadratic_drag": "c v|v|", "bearing_gradient": "k_b (x - x0)"}


@dataclass(frozen=True, slots=True)
class _Trial:
    name: str
    found: Regression
    delta_bic: float
    held_out_n: float


def diagnose_driven(motions: Sequence[Motion]) -> Diagnosis:
    """Return the diagnosis of driven runs.  The later half of each run takes no part in the gates' fits."""
    began = time.perf_counter()
    runs = [prepare(motion) for motion in motions]
    kept, held = [_part(run, 0) for run in runs], [_part(run, 1) for run in runs]
    chosen: list[str] = []
    candidates: list[Candidate] = []
    effects: list[FoundEffect] = []
    while len(chosen) < MOST_EFFECTS:
        before, before_held = regress(kept, chosen), _held_out(kept, held, chosen)
        trials = sorted(
            (_try(name, kept, held, chosen, before) for name in EFFECTS if name not in chosen),
            key=lambda trial: trial.delta_bic,
        )
        if not chosen:
            candidates = [_candidate(trial) for trial in trials]
        best = trials[0] if trials else None
        if best is None or best.delta_bic > -BIC_AGAINST_BASE or best.held_out_n > (1.0 - PAYS) * before_held:
            break
        alike = _alike(best, trials[1:], kept, chosen)
        effects.append(_named(best, alike, regress(runs, [*chosen, best.name])))
        chosen.append(best.name)
    first, last = regress(runs), regress(runs, chosen)
    noise_n = float(np.median([np.nanmedian(motion.force_std_n) for motion in motions]))
    rest = _describe(runs, last, noise_n)
    adequate = last.rms_n <= SMALL_REST * noise_n
    verdict = Verdict.UNEXPLAINED
    if adequate:
        verdict = Verdict.EFFECT_FOUND if chosen else Verdict.ADEQUATE
    named = [replace(e, parameters=_parameters(last, e.name)) for e in effects]
    return Diagnosis(
        verdict=verdict,
        sentence=_sentence(named, first.rms_n, last.rms_n, noise_n, adequate),
        effects=tuple(named),
        candidates=tuple(candidates),
        error_before=_errors(first.residual_n, noise_n),
        error_after=_errors(last.residual_n, noise_n),
        error_held_out_before=_errors(_residual(kept, held, []), noise_n),
        error_held_out_after=_errors(_residual(kept, held, chosen), noise_n),
        fit_before=fit_driven(motions),
        fit_after=fit_driven(motions, chosen),
        remainder="" if adequate else rest,
        blind_spots=(
            "a constant force of the drive and a tilt of the guide are one number here: the offset",
            "an error of the force's scale only rescales mass and drag",
        ),
        separating_shot="",
        seconds=time.perf_counter() - began,
    )


def _part(run: Run, half: int) -> Run:
    middle = 0.5 * (run.time_s[0] + run.time_s[-1])
    use = (run.time_s < middle) if half == 0 else (run.time_s >= middle)
    arrays = ("time_s", "displacement_m", "velocity_m_per_s", "acceleration_m_per_s2", "force_n")
    return replace(run, **{name: getattr(run, name)[use] for name in arrays})


def _residual(kept: Sequence[Run], held: Sequence[Run], effects: Sequence[str]) -> tuple[Floats, ...]:
    values = regress(kept, effects).values
    out = []
    for here, there in zip(kept, held, strict=True):
        columns = design(there, effects)
        if "bearing_gradient" in effects:  # its zero is the mean place of the fitted part
            columns[:, 3 + list(effects).index("bearing_gradient")] = there.displacement_m - here.displacement_m.mean()
        out.append(there.force_n - columns @ values)
    return tuple(out)


def _held_out(kept: Sequence[Run], held: Sequence[Run], effects: Sequence[str]) -> float:
    return rms(_residual(kept, held, effects))


def _try(name: str, kept: Sequence[Run], held: Sequence[Run], chosen: Sequence[str], before: Regression) -> _Trial:
    found = regress(kept, [*chosen, name])
    # neighbouring samples repeat each other: only independent ones count in the likelihood
    n = found.independent_samples
    delta = n * 2.0 * float(np.log(found.rms_n / before.rms_n)) + float(np.log(max(n, 2.0)))
    return _Trial(name, found, delta, _held_out(kept, held, [*chosen, name]))


def _alike(best: _Trial, others: Sequence[_Trial], kept: Sequence[Run], chosen: Sequence[str]) -> tuple[str, ...]:
    """Return the candidates that this data could not tell from the best one."""
    base = np.concatenate([design(run, chosen) for run in kept])
    basis, _ = np.linalg.qr(base / np.linalg.norm(base, axis=0))

    def projected(name: str) -> Floats:
        column = np.concatenate([EFFECTS[name][1](run) for run in kept])
        return np.asarray(column - basis @ (basis.T @ column))

    mine = projected(best.name)
    share = best.found.independent_samples / mine.size
    value = best.found.values[-1]
    snr = abs(value) * float(np.linalg.norm(mine)) * np.sqrt(share) / best.found.rms_n
    alike = []
    for other in others:
        theirs = projected(other.name)
        cosine = float(mine @ theirs / (np.linalg.norm(mine) * np.linalg.norm(theirs)))
        apart = snr * np.sqrt(max(0.0, 1.0 - cosine**2))
        if apart < SEPARABLE_SNR or other.delta_bic - best.delta_bic < BIC_AGAINST_NEXT:
            alike.append(other.name)
    return tuple(alike)


def _parameters(found: Regression, name: str) -> dict[str, Quantity]:
    key = EFFECTS[name][0]
    return {key: found.quantity(f"{name}.{key}")}


def _candidate(trial: _Trial) -> Candidate:
    quantity = _parameters(trial.found, trial.name)
    (value,) = quantity.values()
    score = abs(value.value) / value.std if value.std > 0.0 else float("inf")
    return Candidate(trial.name, score, trial.delta_bic, quantity, f"held-out force error {trial.held_out_n:.3g} N")


def _named(trial: _Trial, alike: tuple[str, ...], whole: Regression) -> FoundEffect:
    parameters = _parameters(whole, trial.name)
    ((key, value),) = parameters.items()
    evidence = {"delta_bic": trial.delta_bic, "held_out_force_rms_n": trial.held_out_n}
    words = trial.name.replace("_", " ")
    return FoundEffect(trial.name, parameters, evidence, alike, f"{words}, {FORMS[trial.name]}: {key} {value}")


def _errors(residual: Sequence[Floats], noise_n: float) -> Errors:
    """Return the errors; without a loop around it the model's own path drifts, so only the force is compared."""
    force = rms(residual)
    return Errors(float("nan"), float("nan"), force, (force / noise_n) ** 2 if noise_n > 0.0 else float("nan"))


def _describe(runs: Sequence[Run], found: Regression, noise_n: float) -> str:
    """Say what the remaining force goes with: direction, reversals, place."""
    rest = np.concatenate(found.residual_n)
    speed = np.concatenate([run.velocity_m_per_s for run in runs])
    place = np.concatenate([run.displacement_m for run in runs])
    total = float(rest @ rest)
    fastest = float(np.abs(speed).max())
    slow = np.abs(speed) < 0.1 * fastest
    forward = np.maximum(speed, 0.0)
    asymmetric = _explained(rest, np.stack([forward, (speed > 0.0).astype(np.float64), speed, np.ones_like(speed)], 1))
    wave = [f(2.0 * np.pi * k * place / np.ptp(place)) for k in (1, 2, 3) for f in (np.sin, np.cos)]
    by_place = _explained(rest, np.stack([np.ones_like(place), place, *wave], axis=1))
    at_reversal = float(rest[slow] @ rest[slow]) / total
    parts = [
        f"{rms([rest]):.3g} N rms remain, {rms([rest]) / noise_n:.0f} times the force's own noise ({noise_n:.2g} N)",
        f"{asymmetric:.0%} of their power goes with the direction of motion (friction that differs between both ways)",
        f"{by_place:.0%} with the place along the guide",
        f"{at_reversal:.0%} stand in the {np.mean(slow):.0%} of samples around reversals",
    ]
    return "; ".join(parts)


def _explained(rest: Floats, columns: Floats) -> float:
    solution, *_ = np.linalg.lstsq(columns, rest, rcond=None)
    left = rest - columns @ solution
    return 1.0 - float(left @ left) / float(rest @ rest)


def _sentence(effects: Sequence[FoundEffect], before_n: float, after_n: float, noise_n: float, adequate: bool) -> str:
    if not effects:
        if adequate:
            return "Adequate: mass, viscous drag and offset leave nothing above the force's noise."
        return f"Unexplained: {before_n:.3g} N rms remain and no effect of the catalogue accounts for them."
    names = " and ".join(effect.name.replace("_", " ") for effect in effects)
    alike = [other for effect in effects for other in effect.indistinguishable_from]
    text = f"{names[0].upper()}{names[1:]}: force error {before_n:.3g} -> {after_n:.3g} N rms."
    if alike:
        text += f" This data does not tell it from {', '.join(name.replace('_', ' ') for name in alike)}."
    if not adequate:
        text += (
            f" {after_n:.3g} N is still {after_n / noise_n:.0f} times the force's noise: something is still missing."
        )
    return text
