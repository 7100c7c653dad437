"""Whether a set could tell its effect from any other of the catalogue: what is possible, before anyone tries.

Every other effect is offered, its shape taken where it is weak, with the base parameters free beside it; what it
cannot imitate of the true remainder, in units of the noise, is how far apart the two are.
"""

import math
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize, minimize_scalar

from instrument.bench.effects import CATALOGUE, PER_SHOT
from tests.bench.blind import Truth, clean_m, run, times_s
from tests.bench.strength import Tangents, base_tangents, best_base

Floats = NDArray[np.float64]
Mover = Callable[[str, Mapping[str, float]], Floats]
Weak = Callable[[float, float], Mapping[str, float]]  # (frequency in Hz, damping ratio) to a weak line's parameters

_THINNED = 4
_WEAK = 1e-3  # of the usual size: still linear, far above rounding
_LINES_HZ = {
    "block_mode": np.geomspace(200.0, 4000.0, 32),
    "second_plate_mode": np.geomspace(200.0, 8000.0, 32),
    "support_compliance": np.geomspace(200.0, 4000.0, 24),
}
_FRAME_HZ = np.geomspace(30.0, 2000.0, 110)
_TWO_SIGNS = {"tilt", "bearing_gradient", "cubic_stiffness", "contact_exponent", "sensor_drift", "cyclic_error"}
_ONE_SIGN = frozenset(CATALOGUE) - _TWO_SIGNS - frozenset(PER_SHOT)
_RELAXATION_S = np.geomspace(1e-4, 0.5, 24)
_RANGE_M = np.geomspace(5e-6, 3e-3, 24)  # a reach ends sharply: what it imitates, it imitates at one only


def separation(
    truth: Truth, tangents: Tangents | None = None, among: Collection[str] = tuple(CATALOGUE)
) -> dict[str, float]:
    """Return, for every effect ``among`` these that is not in ``truth``, the norm of what it cannot imitate.

    In units of white noise of ``truth.noise.white_m``.  Cost: about 5 s a set of three.
    """
    whole, plain = best_base(truth, tangents or base_tangents(truth))
    # The look-alikes stand beside the base that was fitted, not beside the true one: a soft clamp makes the plate soft.
    tangents = base_tangents(plain)
    whole = whole - tangents.orthogonal @ (tangents.orthogonal.T @ whole)
    # all but the chirp of the cyclic error is slow against a record's samples: every fourth tells as much
    views = {step: (whole[::step], _orthonormal(tangents.columns[::step])) for step in (1, _THINNED)}

    def rest(name: str, shapes: Floats) -> float:
        step = 1 if name == "cyclic_error" else _THINNED
        left, base = views[step]
        shapes = shapes[::step] if shapes.shape[0] == whole.size else shapes
        shapes = shapes / np.linalg.norm(shapes, axis=0)
        beyond = shapes - base @ (base.T @ shapes)
        beyond = beyond / np.linalg.norm(beyond, axis=0)
        size = np.linalg.lstsq(beyond, left, rcond=1e-6)[0]
        # No friction drives and no attraction repels: what has one sign imitates with that sign alone.
        fitted = beyond @ (np.maximum(size, 0.0) if name in _ONE_SIGN else size)
        explained = float(fitted @ fitted)
        return float((step * max(float(left @ left) - explained, 0.0)) ** 0.5 / truth.noise.white_m)

    least: dict[str, float] = {}
    best_at: dict[str, float] = {}
    moved = _mover(plain)
    for name, place, shapes in _shapes(plain, moved, [name for name in among if name not in truth.effects]):
        value = rest(name, shapes)
        if value < least.get(name, np.inf):
            least[name], best_at[name] = value, place
    stiffness = truth.bodies.plate_stiffness_n_per_m  # while the plate stands still it helps a clamp that gives
    own = [
        values["frequency_hz"] * math.sqrt(1 + stiffness * values.get("compliance_m_per_n", 0.0))
        for values in truth.effects.values()
        if "frequency_hz" in values
    ]

    def closest(name: str, place: float) -> float:
        """Return the least rest near a grid's point: a line is narrower than any grid, a reach ends sharply."""
        if name in _LINES:  # one line is best imitated by another at its own frequency
            return min(_finest(lambda at: rest(name, moved(name, _LINES[name](*at))), hz) for hz in own or [place])
        usual, free = _usual_but_weak(name), _FREE[name]
        return _nearest(lambda value: rest(name, moved(name, {**usual, free: value})), place)

    for name, place in best_at.items():
        if name in _LINES or name in _FREE:
            least[name] = min(least[name], closest(name, place))
    return least


def _finest(rest: Callable[[tuple[float, float]], float], frequency_hz: float) -> float:
    """Return the least ``rest`` of a line near ``frequency_hz``, its frequency and damping free."""
    found = minimize(
        lambda z: rest((frequency_hz * math.exp(0.01 * np.clip(z[0], -5, 5)), 3e-3 * math.exp(np.clip(z[1], -6, 4.6)))),
        np.zeros(2),
        method="Nelder-Mead",
        options={"maxfev": 30, "xatol": 1e-2, "fatol": 1e-2, "initial_simplex": [[0.0, 0.0], [0.3, 0.0], [0.0, 1.5]]},
    )
    return float(found.fun)


def _nearest(rest: Callable[[float], float], place: float) -> float:
    """Return the least ``rest`` near ``place``, a grid's point."""
    ends = (math.log(place / 1.4), math.log(place * 1.4))
    found = minimize_scalar(lambda z: rest(math.exp(z)), bounds=ends, method="bounded", options={"maxiter": 12})
    return float(found.fun)


def _usual_but_weak(name: str) -> dict[str, float]:
    return {key: p.usual * (_WEAK if p.scales else 1.0) for key, p in CATALOGUE[name].items()}


def _orthonormal(columns: Floats) -> Floats:
    result: Floats = np.linalg.qr(columns / np.linalg.norm(columns, axis=0))[0]
    return result


def _mover(truth: Truth) -> Mover:
    """Return what gives the change of a set by a weak effect, shape (samples, 1)."""
    plain = replace(truth, effects={})
    shots = range(len(truth.speeds_m_per_s))
    base = [clean_m(plain, shot) for shot in shots]

    def moved(name: str, values: Mapping[str, float]) -> Floats:
        weak = replace(truth, effects={name: dict(values)})
        return np.concatenate([clean_m(weak, shot) - base[shot] for shot in shots])[:, None]

    return moved


_LINES: Mapping[str, Weak] = {
    "block_mode": lambda hz, damping: {"mass_kg": 4e-7, "frequency_hz": hz, "damping_ratio": damping},
    "second_plate_mode": lambda hz, damping: {"mass_kg": 1.0, "frequency_hz": hz, "damping_ratio": damping},
    "support_compliance": lambda hz, _damping: {"compliance_m_per_n": 1e-8, "frequency_hz": hz},
}

_FREE: Mapping[str, str] = {"viscoelastic_arm": "relaxation_time_s", "adhesion": "range_m"}


def _shapes(truth: Truth, moved: Mover, names: Collection[str]) -> Iterator[tuple[str, float, Floats]]:
    """Yield (name, place, columns): the directions in which a weak effect of one of ``names`` can move the set.

    The place is a frequency, a time, a range or 0.  Columns hold every sample, or every fourth already.
    """
    plain = replace(truth, effects={})
    shots = range(len(truth.speeds_m_per_s))

    for name in names:
        usual = _usual_but_weak(name)
        if name in _LINES:
            for hz in _LINES_HZ[name]:
                yield name, hz, moved(name, _LINES[name](hz, 0.007))
        elif name == "viscoelastic_arm":
            for tau in _RELAXATION_S:
                yield name, tau, moved(name, {**usual, "relaxation_time_s": tau})
        elif name == "adhesion":
            for reach in _RANGE_M:
                yield name, reach, moved(name, {**usual, "range_m": reach})
        elif name == "demodulation_lag":
            yield name, 0.0, moved(name, {"time_s": 5e-6})
        elif name == "plate_motion":
            yield name, 0.0, _swinging(truth)
        elif name == "frame_vibration":
            time_s = times_s()[::_THINNED]
            for hz in _FRAME_HZ:
                wave = np.column_stack((np.sin(2 * np.pi * hz * time_s), np.cos(2 * np.pi * hz * time_s)))
                yield name, hz, _one_a_shot([wave for _ in shots])
        elif name == "cyclic_error":
            for order in (1.0, 2.0):
                yield name, 0.0, _cyclic(plain, order)
        else:
            yield name, 0.0, moved(name, usual)


def _swinging(truth: Truth) -> Floats:
    parts = []
    plain = replace(truth, effects={})
    for shot in range(len(truth.speeds_m_per_s)):
        still = clean_m(plain, shot)
        columns = []
        for values in ((1e-6, 0.0), (0.0, 1e-8)):
            effects = {"plate_motion": {"velocity_m_per_s": values[0], "displacement_m": values[1]}}
            only = replace(
                truth, effects=effects, speeds_m_per_s=(truth.speeds_m_per_s[shot],)
            )  # as a first shot, so that nothing is drawn for it
            columns.append(clean_m(only, 0) - still)
        parts.append(np.column_stack(columns))
    return _one_a_shot(parts)


def _cyclic(plain: Truth, order: float) -> Floats:
    parts = []
    time_s = times_s()
    for shot in range(len(plain.speeds_m_per_s)):
        trajectory = run(plain, shot)
        x, v = trajectory.block_m(time_s), trajectory.block_velocity_m_per_s(time_s)
        slow = np.abs(v) * 2 / 632.8e-9 * order < 45e3
        turn = 4 * np.pi * order * x / 632.8e-9
        parts.append(np.column_stack((np.where(slow, np.sin(turn), 0.0), np.where(slow, np.cos(turn), 0.0))))
    return np.vstack(parts)


def _one_a_shot(parts: list[Floats]) -> Floats:
    """Return columns that are free for every shot on its own."""
    width = parts[0].shape[1]
    result = np.zeros((sum(part.shape[0] for part in parts), width * len(parts)))
    row = 0
    for shot, part in enumerate(parts):
        result[row : row + part.shape[0], width * shot : width * (shot + 1)] = part
        row += part.shape[0]
    return result
