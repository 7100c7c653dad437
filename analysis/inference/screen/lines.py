"""Find spectral lines in the residual of a fit: the gain in chi^2 of a sinusoid at each frequency."""

from collections.abc import Mapping

import numpy as np

from analysis.compiled import side_by_side
from analysis.inference.model.free_parameters import TrialEffect
from analysis.inference.screen.projector import Projector
from analysis.inference.screen.whitened_columns import WhitenedColumns, column_by_column
from analysis.shot import Floats

_LOUD = 5  # maximum number of refined lines
_TURNED = 32  # samples computed by rotation from one with computed phases
_AT_ONCE = 96  # frequencies per block, whose columns fit into the processor's cache
_APART = 1.0  # least separation of two lines in line widths, each one over the record's length


def scan(at: Projector) -> tuple[Floats, Floats]:
    """Return frequencies in Hz and the gain in chi^2 of a line at each, both of shape (k,).

    The spacing is less than one over the record's length.  Every shot has its own amplitude and phase.
    """
    known: tuple[Floats, Floats, Floats] = at.once("scan", lambda: (at.left, *_scan(at)))
    if known[0] is not at.left:  # projectors of one fit share cached results
        at.done["scan"] = known = (at.left, *_scan(at))
    return known[1:]


def _scan(at: Projector) -> tuple[Floats, Floats]:
    shots = at.problem.data.shots
    length = max(shot.length_s for shot in shots)
    steps, f = [], at.problem.data.band_hz[0]
    while f < min(2500.0, 0.4 / shots[0].spacing_s):
        steps.append(f)
        f += min(0.03 * f, 0.4 / length)
    grid = np.array(steps)
    total = np.zeros(grid.size)
    if not at.left.any():
        return grid, total
    # The projection is done per shot, without coupling: shared parameters absorb little of a line.
    of_shots = zip(at.basis.own, at.basis.shared, at.tangents.parts(at.left), strict=True)
    fitted = [np.column_stack(of_shot) for of_shot in of_shots]

    def of_part(part: tuple[int, int]) -> Floats:
        index, first = part
        shot = shots[index]
        waves = _waves(grid[first : first + _AT_ONCE], shot.centre_s)
        return _gain(WhitenedColumns.of(shot, at.noise, waves), fitted[index])

    parts = [(index, first) for index in range(len(shots)) for first in range(0, grid.size, _AT_ONCE)]
    for (_, first), gain in zip(parts, side_by_side(of_part, parts), strict=True):
        total[first : first + gain.size] += gain
    return grid, total


def _gain(waves: WhitenedColumns, fitted: Floats) -> Floats:
    """Return the gain in chi^2 of each of f lines, given their cosines and then their sines, shape (n, 2 f).

    The last ``fitted`` column is the residual, the others are an orthonormal basis of what is fitted.
    """
    both = waves.products_with(fitted)
    taken, along = both[:-1], both[-1]
    count = along.size // 2
    c, s = slice(0, count), slice(count, None)
    a, b, d = (
        waves.products(one, other) - column_by_column(taken[:, one], taken[:, other])
        for one, other in ((c, c), (c, s), (s, s))
    )
    determinant = np.maximum(a * d - b * b, 1e-12 * a * d + 1e-300)
    p, q = along[c], along[s]
    x, y = (d * p - b * q) / determinant, (a * q - b * p) / determinant
    return np.asarray(x * p + y * q)


def _waves(frequency_hz: Floats, time_s: Floats) -> Floats:
    """Return cosines and sines, shape (n, 2 k), at evenly spaced times, by rotation; about 5 ns per value."""
    spacing = (time_s[-1] - time_s[0]) / (time_s.size - 1)
    near = 2 * np.pi * spacing * np.arange(_TURNED)[:, None] * frequency_hz
    far = 2 * np.pi * time_s[::_TURNED, None, None] * frequency_hz
    by_cos, by_sin, cos, sin = np.cos(near), np.sin(near), np.cos(far), np.sin(far)
    count = frequency_hz.size
    out = np.empty((len(far), _TURNED, 2 * count))
    out[..., :count] = cos * by_cos - sin * by_sin
    out[..., count:] = sin * by_cos + cos * by_sin
    # The shape is given in full: with no frequency numpy could not infer it.
    return out.reshape(len(far) * _TURNED, 2 * count)[: time_s.size]


def starts_near_strong_lines(at: Projector, kind: TrialEffect, louder_than: float) -> list[Mapping[str, float]]:
    """Return start values of weakly damped lines at and near the frequencies with more gain than ``louder_than``.

    The width of these lines is one over the record's length; a grid with steps of a few per cent misses them at 1 kHz.
    """
    grid, total = scan(at)
    width = 1 / max(shot.length_s for shot in at.problem.data.shots)
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
