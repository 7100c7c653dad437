"""Lines in what a fit leaves over: which frequencies stand out, whatever rings there."""

from collections.abc import Mapping
from functools import partial

import numpy as np
from numpy.typing import NDArray

from analysis.inference.fit.free_parameters import TrialEffect
from analysis.inference.screen.projector import FEW_SHOTS, Projector

Floats = NDArray[np.float64]
_LOUD = 5  # lines that are looked at more closely
_TURNED = 32  # samples from one whose waves are known
_APART = 1.0  # in widths of a line, that is in one over the record's length


def scan(at: Projector) -> tuple[Floats, Floats]:
    """Return frequencies in Hz, dense against one over the record, and the gain of a line there; each shape (k,).

    Any amplitude and phase a shot.
    """
    known: tuple[Floats, Floats, Floats] = at.once("scan", lambda: (at.left, *_scan(at)))
    if known[0] is not at.left:  # projectors of one fit share what was done for it
        at.done["scan"] = known = (at.left, *_scan(at))
    return known[1:]


def _scan(at: Projector) -> tuple[Floats, Floats]:
    shots = at.fitted.hypothesis.data.shots
    length = max(shot.length_s for shot in shots)
    steps, f = [], 2.5 / length
    while f < min(2500.0, 0.4 / shots[0].spacing_s):
        steps.append(f)
        f += min(0.03 * f, 0.4 / length)
    grid = np.array(steps)
    total = np.zeros(grid.size)
    for index, (shot, left) in enumerate(zip(shots, at.tangents.parts(at.left), strict=True)):
        key = f"lines {index}"
        make = partial(_waves, grid, shot.centre_s)
        if len(shots) <= FEW_SHOTS:
            both = at.once(key, partial(shot.whitened, at.floor, at.once(key, make, nearby=True)))
        else:
            both = shot.whitened(at.floor, make())
        # Projecting inside the shot: the shared parameters take little of a line, the shot's own take what they can.
        inner = at.basis.of_shot(index).T @ both
        cross = both.T @ left
        c, s = slice(0, grid.size), slice(grid.size, None)
        a = np.einsum("ij,ij->j", both[:, c], both[:, c]) - np.einsum("ij,ij->j", inner[:, c], inner[:, c])
        b = np.einsum("ij,ij->j", both[:, c], both[:, s]) - np.einsum("ij,ij->j", inner[:, c], inner[:, s])
        d = np.einsum("ij,ij->j", both[:, s], both[:, s]) - np.einsum("ij,ij->j", inner[:, s], inner[:, s])
        determinant = np.maximum(a * d - b * b, 1e-12 * a * d + 1e-300)
        p, q = cross[c], cross[s]
        x, y = (d * p - b * q) / determinant, (a * q - b * p) / determinant
        total += x * p + y * q
    return grid, total


def _waves(frequency_hz: Floats, time_s: Floats) -> Floats:
    """Return cosines and sines, shape (n, 2 k), at even times; about 10 ns a value, by turning those of some on."""
    spacing = (time_s[-1] - time_s[0]) / (time_s.size - 1)
    near = np.exp(2j * np.pi * spacing * np.arange(_TURNED)[:, None] * frequency_hz)
    far = np.exp(2j * np.pi * time_s[::_TURNED, None] * frequency_hz)
    whole = far[:, None, :] * near[None, :, :]
    # The shape is stated in full: where no frequency fits into a record there is nothing to infer it from.
    turned = whole.reshape(len(far) * _TURNED, frequency_hz.size)[: time_s.size]
    return np.concatenate([turned.real, turned.imag], axis=1)


def near_loud_lines(at: Projector, kind: TrialEffect, louder_than: float) -> list[Mapping[str, float]]:
    """Return starts of a line that hardly fades, at and beside the frequencies that stand out by more than a gain.

    Such a line is as narrow as one over the record, which at a kilohertz no grid of some per cent would meet.
    """
    grid, total = scan(at)
    width = 1 / max(shot.length_s for shot in at.fitted.hypothesis.data.shots)
    loud: list[float] = []
    for k in np.argsort(-total):
        if not total[k] > louder_than:
            break
        if all(abs(grid[k] - other) > _APART * width for other in loud):
            loud.append(float(grid[k]))
        if len(loud) == _LOUD:
            break
    start = kind.starts[0]
    dampings = ({"damping_ratio": 0.003}, {"damping_ratio": 0.015}) if "damping_ratio" in start else ({},)
    return [
        {**start, **damping, "frequency_hz": f + beside * width}
        for f in loud
        for beside in (-0.25, 0.0, 0.25)
        for damping in dampings
    ]
