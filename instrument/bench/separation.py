"""Whether a set could tell its effect from any other of the catalogue: what is possible, before anyone tries.

Every other effect is offered, its shape taken where it is weak, with the base parameters free beside it; what it
cannot imitate of the true remainder, in units of the noise, is how far apart the two are.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from instrument.bench.blind import Truth, clean_m, run, times_s
from instrument.bench.effects import CATALOGUE
from instrument.bench.strength import Tangents, base_tangents, remainder_m

Floats = NDArray[np.float64]

_THINNED = 4
_WEAK = 1e-3  # of the usual size: still linear, far above rounding
_BLOCK_HZ = np.geomspace(200.0, 4000.0, 32)
_PLATE_HZ = np.geomspace(1000.0, 8000.0, 24)
_CLAMP_HZ = np.geomspace(200.0, 4000.0, 16)
_FRAME_HZ = np.geomspace(30.0, 2000.0, 110)
_RELAXATION_S = np.geomspace(1e-4, 3e-2, 8)
_RANGE_M = np.geomspace(5e-6, 3e-4, 5)


def separation(truth: Truth, tangents: Tangents | None = None) -> dict[str, float]:
    """Return, for every catalogue effect that is not in ``truth``, the norm of what it cannot imitate, over the noise.

    White noise of ``truth.noise.white_m``.  Cost: about 1.5 s a set of three.
    """
    tangents = tangents or base_tangents(truth)
    whole = remainder_m(truth, tangents)
    # all but the chirp of the cyclic error is slow against a record's samples: every fourth tells as much
    views = {step: (whole[::step], _orthonormal(tangents.columns[::step])) for step in (1, _THINNED)}
    least: dict[str, float] = {}
    for name, shapes in _shapes(truth):
        step = 1 if name == "cyclic_error" else _THINNED
        left, base = views[step]
        shapes = shapes[::step] if shapes.shape[0] == whole.size else shapes
        shapes = shapes / np.linalg.norm(shapes, axis=0)
        beyond = shapes - base @ (base.T @ shapes)
        beyond = beyond / np.linalg.norm(beyond, axis=0)
        fitted = beyond @ np.linalg.lstsq(beyond, left, rcond=1e-6)[0]
        explained = float(fitted @ fitted)
        rest = (step * max(float(left @ left) - explained, 0.0)) ** 0.5 / truth.noise.white_m
        least[name] = min(rest, least.get(name, np.inf))
    return least


def _orthonormal(columns: Floats) -> Floats:
    result: Floats = np.linalg.qr(columns / np.linalg.norm(columns, axis=0))[0]
    return result


def _shapes(truth: Truth) -> Iterator[tuple[str, Floats]]:
    """Yield (name, columns): the directions in which a weak effect of that name can move the set.

    Columns hold every sample, or every fourth already; effects of ``truth`` itself are left out.
    """
    plain = replace(truth, effects={})
    shots = range(len(truth.speeds_m_per_s))
    base = [clean_m(plain, shot) for shot in shots]

    def moved(name: str, values: Mapping[str, float]) -> Floats:
        weak = replace(truth, effects={name: dict(values)})
        return np.concatenate([clean_m(weak, shot) - base[shot] for shot in shots])[:, None]

    for name, known in CATALOGUE.items():
        if name in truth.effects:
            continue
        usual = {key: p.usual * (_WEAK if p.scales else 1.0) for key, p in known.items()}
        if name == "block_mode":
            for hz in _BLOCK_HZ:
                yield name, moved(name, {**usual, "frequency_hz": hz, "damping_ratio": 0.005})
        elif name == "second_plate_mode":
            for hz in _PLATE_HZ:
                yield name, moved(name, {"mass_kg": 1.0, "frequency_hz": hz, "damping_ratio": 0.01})
        elif name == "support_compliance":
            for hz in _CLAMP_HZ:
                yield name, moved(name, {"compliance_m_per_n": 1e-8, "frequency_hz": hz})
        elif name == "viscoelastic_arm":
            for tau in _RELAXATION_S:
                yield name, moved(name, {**usual, "relaxation_time_s": tau})
        elif name == "adhesion":
            for reach in _RANGE_M:
                yield name, moved(name, {**usual, "range_m": reach})
        elif name == "demodulation_lag":
            yield name, moved(name, {"time_s": 5e-6})
        elif name == "plate_motion":
            yield name, _swinging(truth, base)
        elif name == "frame_vibration":
            time_s = times_s()[::_THINNED]
            for hz in _FRAME_HZ:
                wave = np.column_stack((np.sin(2 * np.pi * hz * time_s), np.cos(2 * np.pi * hz * time_s)))
                yield name, _one_a_shot([wave for _ in shots])
        elif name == "cyclic_error":
            for order in (1.0, 2.0):
                yield name, _cyclic(plain, order)
        else:
            yield name, moved(name, usual)


def _swinging(truth: Truth, base: list[Floats]) -> Floats:
    parts = []
    for shot, still in enumerate(base):
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
