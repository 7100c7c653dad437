"""How strong an effect is in a record: what the best base model leaves over, in units of the noise.

The base model here is this package's own collision without effects; nothing of the analysis is used.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from instrument.bench.effects import ALL, PER_SHOT
from instrument.bench.mechanics import Bodies
from tests.bench.blind import RATE_HZ, Truth, clean_m
from tests.bench.scaled import scaled

Floats = NDArray[np.float64]

SHARED = ("plate_mass_kg", "plate_stiffness_n_per_m", "contact_stiffness_n_per_m", "contact_damping_n_s_per_m")
_STEP = 1e-4
_ROUNDS = 16
_ANEW = 4
_SHARES = (1.0, 0.3, 0.1, 0.03)  # of a step
_FAR = 2e-3  # relative: from here on tangents are taken anew


@dataclass(frozen=True, slots=True)
class Tangents:
    """Derivatives of a set's displacements by the base parameters; shape (samples of all shots, parameters).

    Columns: the four of ``SHARED`` (relative), then for every shot its speed (m/s), time (s) and offset (m).
    """

    columns: Floats
    orthogonal: Floats  # the same space, orthonormal


def base_tangents(truth: Truth) -> Tangents:
    """Differentiate the base model of ``truth`` (its effects left out) numerically."""
    plain = replace(truth, effects={})
    shots = len(truth.speeds_m_per_s)
    parts = []
    for shot in range(shots):
        own = []
        for name in SHARED:
            up, down = (clean_m(plain, shot, _scaled(truth.bodies, name, 1 + s)) for s in (_STEP, -_STEP))
            own.append((up - down) / (2 * _STEP))
        speed = truth.speeds_m_per_s[shot]
        faster, slower = (clean_m(plain, shot, None, speed * (1 + s)) for s in (_STEP, -_STEP))
        block = np.zeros((own[0].size, 3 * shots))
        block[:, 3 * shot] = (faster - slower) / (2 * _STEP * speed)
        block[:, 3 * shot + 1] = np.gradient(clean_m(plain, shot), 1 / RATE_HZ)
        block[:, 3 * shot + 2] = 1.0
        parts.append(np.hstack((np.stack(own, axis=1), block)))
    columns = np.vstack(parts)
    scale = np.linalg.norm(columns, axis=0)
    return Tangents(columns, np.linalg.qr(columns / scale)[0])


def best_base(truth: Truth, tangents: Tangents) -> tuple[Floats, Truth]:
    """Return what the best base fit leaves of the noise-free set, in m, all shots in one row, and the rig of that fit.

    A base parameter that swallows an effect does so beyond the linear: steps of fixed tangents, shorter where a whole
    one leads astray, and tangents taken anew where they led far.
    """
    target = np.concatenate([clean_m(truth, shot) for shot in range(len(truth.speeds_m_per_s))])
    left, plain, moved = _descended(target, replace(truth, effects={}), tangents)
    for _ in range(_ANEW):
        if moved < _FAR:
            break
        left, plain, moved = _descended(target, plain, base_tangents(plain))
    return left, plain


def _descended(target: Floats, plain: Truth, tangents: Tangents) -> tuple[Floats, Truth, float]:
    """Return what is left of ``target`` beside ``tangents``, the rig there, and the largest relative change of it."""
    scale = np.linalg.norm(tangents.columns, axis=0)
    parameters = np.zeros(tangents.columns.shape[1])
    off: Floats = target - _base(plain, parameters)
    for _ in range(_ROUNDS):
        step = np.linalg.lstsq(tangents.columns / scale, off, rcond=1e-12)[0] / scale
        for share in _SHARES:
            trial = parameters + share * step
            trial[:4] = np.clip(trial[:4], -0.7, 2.0)
            there: Floats = target - _base(plain, trial)
            if np.linalg.norm(there) < 0.999 * np.linalg.norm(off):
                break
        else:
            break
        parameters, off = trial, there
    left = off - tangents.orthogonal @ (tangents.orthogonal.T @ off)
    speeds = tuple(v + float(change) for v, change in zip(plain.speeds_m_per_s, parameters[4::3], strict=True))
    return (
        left,
        replace(plain, bodies=_changed(plain.bodies, parameters), speeds_m_per_s=speeds),
        float(np.abs(parameters[:4]).max()),
    )


def residual_snr(truth: Truth, tangents: Tangents | None = None) -> float:
    """Return the norm of the best base fit's remainder over the standard deviation of white noise."""
    if not truth.effects:
        return 0.0
    left, _ = best_base(truth, tangents or base_tangents(truth))
    return float(np.linalg.norm(left)) / truth.noise.white_m


def at_snr(
    truth: Truth, snr: float, tangents: Tangents | None = None, *, tolerance: float = 0.05
) -> tuple[Truth, float]:
    """Return ``truth`` with its effects scaled so that they stand out by ``snr``, and the SNR reached.

    No parameter grows beyond three times its usual range: an effect that cannot be made so strong comes back weaker,
    and one whose strength the base model swallows again and again comes back with what was found.
    """
    tangents = tangents or base_tangents(truth)
    most = strongest(truth)
    strength = min(1.0, most)
    best, reached = truth, 0.0
    for _ in range(10):
        trial = replace(truth, effects=scaled(truth.effects, strength))
        found = residual_snr(trial, tangents)
        if abs(np.log(max(found, 1e-9) / snr)) < abs(np.log(max(reached, 1e-9) / snr)):
            best, reached = trial, found
        if abs(found / snr - 1) < tolerance or found <= 0.0:
            break
        wanted = min(strength * (snr / found) ** 0.9, most)
        if wanted == strength:
            break
        strength = wanted
    return best, reached


def strongest(truth: Truth) -> float:
    limits = []
    for name, values in truth.effects.items():
        known = ALL[name]
        for key, value in values.items():
            if not known[key].scales or value == 0.0:
                continue
            # the modal mass of the plate is the one that grows as the effect vanishes
            small, large = abs(value), 3 * known[key].high
            limits.append(small * 3 / known[key].low if name == "second_plate_mode" else large / small)
    return min(limits, default=1.0)


def cramer_rao(truth: Truth, tangents: Tangents | None = None) -> dict[str, dict[str, float]]:
    """Return the least standard deviation of every shared parameter of the effects, base parameters free too.

    White noise of ``truth.noise.white_m``; parameters that differ from shot to shot are left out of the result but
    free in it.
    """
    tangents = tangents or base_tangents(truth)
    names: list[tuple[str, str]] = []
    columns = []
    for name, values in truth.effects.items():
        known = ALL[name]
        for key, value in values.items():
            if key == "order" or key in PER_SHOT.get(name, ()):
                continue
            step = 1e-3 * abs(value) if value else 1e-3 * known[key].usual
            up, down = (_with(truth, name, key, value + s) for s in (step, -step))
            shots = range(len(truth.speeds_m_per_s))
            columns.append(np.concatenate([(clean_m(up, i) - clean_m(down, i)) / (2 * step) for i in shots]))
            names.append((name, key))
    result: dict[str, dict[str, float]] = {name: {} for name in truth.effects}
    if not columns:
        return result
    whole = np.column_stack((*columns, tangents.columns))
    scale = np.linalg.norm(whole, axis=0)
    covariance = np.linalg.pinv((whole / scale).T @ (whole / scale), rcond=1e-13)
    std = truth.noise.white_m * np.sqrt(np.diag(covariance)) / scale
    for (name, key), value in zip(names, std, strict=False):
        result[name][key] = float(value)
    return result


def _with(truth: Truth, name: str, key: str, value: float) -> Truth:
    effects = {n: dict(v) for n, v in truth.effects.items()}
    effects[name][key] = value
    return replace(truth, effects=effects)


def _scaled(bodies: Bodies, name: str, factor: float) -> Bodies:
    return replace(bodies, **{name: getattr(bodies, name) * factor})


def _changed(bodies: Bodies, parameters: Sequence[float] | Floats) -> Bodies:
    for name, change in zip(SHARED, parameters, strict=False):
        bodies = _scaled(bodies, name, 1 + float(change))
    return bodies


def _base(plain: Truth, parameters: Sequence[float] | Floats) -> Floats:
    bodies = _changed(plain.bodies, parameters)
    parts = []
    for shot, speed in enumerate(plain.speeds_m_per_s):
        d_speed, d_time, offset = (float(p) for p in parameters[4 + 3 * shot : 7 + 3 * shot])
        x = clean_m(plain, shot, bodies, speed + d_speed)
        # a shift of time, to second order: times are moved by far less than a sample
        rate = np.gradient(x, 1 / RATE_HZ)
        parts.append(x + d_time * rate + 0.5 * d_time**2 * np.gradient(rate, 1 / RATE_HZ) + offset)
    return np.concatenate(parts)
