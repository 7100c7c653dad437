"""Score every catalogue effect on what a fit leaves over, with everything already fitted projected out."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from analysis.collision.effects import named
from analysis.collision.parameters import Infeasible
from analysis.compiled.side_by_side import side_by_side
from analysis.inference.fit.arrow import Arrow
from analysis.inference.fit.effective_parameters import Point, to_actual, to_effective
from analysis.inference.fit.free_parameters import TrialEffect
from analysis.inference.fit.hypothesis import Hypothesis
from analysis.inference.fit.samples import Samples
from analysis.inference.screen import first_order
from analysis.inference.screen.lines import near_loud_lines, scan
from analysis.inference.screen.projector import Projector

Floats = NDArray[np.float64]
MANY_STARTS = 8  # from here on a path with propagators costs less than a trajectory a start
KNOWN_PATH = 1  # the same where the path is there already
SPANNED = 1e-5  # of a column's length: less than this beside what is fitted, and it is a mixture of that
WORTH_REFINING = 12.0  # of gain on the grid, for a line to be looked at between its points


@dataclass(frozen=True, slots=True)
class Score:
    """What one start of an effect would explain: ``gain`` of chi^2 for ``freedom`` parameters, from a linear step.

    ``start`` holds the values a shot that this step leads to.
    """

    kind: TrialEffect
    start: tuple[Mapping[str, float], ...]
    gain: float
    freedom: int
    power: float = 0.0  # squared norm of what ``unit`` of the amplitude does beside everything fitted
    unit: float = 0.0

    def worth(self, samples: int) -> float:
        """Return the gain less its price in the Bayesian information criterion."""
        return self.gain - self.freedom * math.log(samples)


def scores(at: Projector, kind: TrialEffect, *, to_join: float | None = None) -> list[Score]:
    """Return the scores of one effect, one a start, best first.

    ``to_join`` is the fall of the criterion for which it may join: only what may come to that counts.
    """
    if named(kind.name).wave is not None:
        return _waves(at, kind)
    with_it = Hypothesis(
        at.fitted.hypothesis.data,
        (*at.fitted.hypothesis.effects, kind),
        {**at.fitted.hypothesis.fixed, kind.name: fixed_of(kind, kind.starts[0])},
    )
    point = at.fitted.point
    effective = to_effective(point)
    shots = at.fitted.hypothesis.data.shots
    # A sensor's ripple is finer than the averaged samples: it is averaged like the data.
    sensor = named(kind.name).sensor is not None
    base = at.once(
        f"base seen finely {sensor}",
        lambda: [_shown(at.fitted.hypothesis, i, point, sensor) for i in range(len(shots))],
    )
    freedom = len(kind.shared) + len(kind.own) * len(shots)

    def column(start: Mapping[str, float]) -> list[Floats] | None:
        values = tuple({**v, kind.name: start} for v in effective.values)
        try:
            moved = to_actual(Point(effective.base, effective.own, values))
            x = [_shown(with_it, i, moved, sensor) for i in range(len(shots))]
        except Infeasible:
            return None
        return [(a - b)[:, None] for a, b in zip(x, base, strict=True)]

    if any(free.name in (*kind.amplitude, "phase_rad") for free in kind.own):
        return _own_amplitudes(at, kind, column, freedom)
    grid = partial(_columns, at, kind, kind.starts, column)
    starts, bare = at.once(f"columns of {kind.name}", grid, nearby=True)
    out = _linear(at, kind, starts, at.once(kind.name, lambda: at.whitened(bare)), freedom)

    def more(some: Sequence[Mapping[str, float]]) -> list[Score]:
        inside, columns = _columns(at, kind, some, column, KNOWN_PATH)
        return _linear(at, kind, inside, at.whitened(columns), freedom)

    if "frequency_hz" in kind.starts[0]:
        # One that is to join pays its parameters: it is asked only where as much stands at its frequency.
        cost = 0.0 if to_join is None else freedom * math.log(at.left.size) + to_join
        lines = near_loud_lines(at, kind, louder_than=cost)
        out += more(lines) if lines else []
    if out and "frequency_hz" in out[0].start[0] and max(score.gain for score in out) > WORTH_REFINING:
        out += more(_between(out, kind))
    out.sort(key=lambda score: -score.gain)
    return out


def _shown(hypothesis: Hypothesis, index: int, point: Point, sensor: bool) -> Floats:
    if not sensor:
        return hypothesis.coarse(index, point)
    return hypothesis.averaged(index, point)


def _columns(
    at: Projector,
    kind: TrialEffect,
    starts: Sequence[Mapping[str, float]],
    column: Callable[[Mapping[str, float]], list[Floats] | None],
    few: int = MANY_STARTS,
) -> tuple[list[Mapping[str, float]], list[Floats]]:
    """Return the starts that have a trajectory and their columns, shot by shot of shape (n, starts).

    More than ``few`` are taken to first order.
    """
    shots = at.fitted.hypothesis.data.shots
    inside = [start for start in starts if within(start, shots)]
    if len(inside) > few:
        found = _first_order(at, kind, inside)
        if found is not None:
            return inside, found
    each = [column(start) for start in inside]
    good = [(start, c) for start, c in zip(inside, each, strict=True) if c is not None]
    joined = [
        np.concatenate([np.empty((s.valid.size, 0)), *(c[i] for _, c in good)], axis=1) for i, s in enumerate(shots)
    ]
    return [start for start, _ in good], joined


def _first_order(at: Projector, kind: TrialEffect, starts: Sequence[Mapping[str, float]]) -> list[Floats] | None:
    """Return the columns of starts to first order, or None where that does not serve this effect."""
    effect = named(kind.name)
    shots = [at.fitted.hypothesis.shot_at(i, at.fitted.point) for i in range(len(at.fitted.hypothesis.data.shots))]
    steps = np.array([first_order.steps_for(shots[0], effect, start) for start in starts])

    def of_shot(index: int) -> Floats | None:
        out = np.empty((shots[index].time_s.size, len(starts)))
        for some in np.unique(steps):
            make = partial(first_order.path_of, shots[index], int(some))
            path = at.once(f"path {index} {some}", make, nearby=True)
            which = np.flatnonzero(steps == some)
            part = first_order.responses(shots[index], path, effect, [starts[int(k)] for k in which])
            if part is None:
                return None
            out[:, which] = part
        return out

    try:
        found = side_by_side(of_shot, range(len(shots)))
    except Infeasible:
        return None
    every = [columns for columns in found if columns is not None and np.all(np.isfinite(columns))]
    return every if len(every) == len(shots) else None


def _between(listed: Sequence[Score], kind: TrialEffect) -> list[Mapping[str, float]]:
    """Return starts around the best two peaks: a line that hardly fades is narrower than the grid's steps."""
    ranked = sorted(listed, key=lambda score: -score.gain)
    peaks = [ranked[0]]
    for score in ranked[1:]:
        if abs(math.log(score.start[0]["frequency_hz"] / peaks[0].start[0]["frequency_hz"])) > 0.1:
            peaks.append(score)
            break
    out: list[Mapping[str, float]] = []
    amplitude = kind.amplitude[0]
    for peak in peaks:
        start = {**peak.start[0], amplitude: kind.starts[0][amplitude]}
        dampings = [0.003, 0.015, 0.06] if "damping_ratio" in start else [None]
        for factor in np.exp(np.linspace(-0.03, 0.03, 13)):
            for damping in dampings:
                more = {} if damping is None else {"damping_ratio": damping}
                out.append({**start, **more, "frequency_hz": start["frequency_hz"] * float(factor)})
    return out


def _linear(
    at: Projector, kind: TrialEffect, starts: Sequence[Mapping[str, float]], bare: Floats, freedom: int
) -> list[Score]:
    """Return the scores of columns in whose amplitude the displacement is linear (signs kept physical)."""
    shots = at.fitted.hypothesis.data.shots
    whole = np.einsum("ij,ij->j", bare, bare)
    power = whole - at.basis.power(bare)
    # What the fitted parameters do as well leaves rounding, which would look like anything.
    power[power < SPANNED**2 * whole] = 0.0
    along = bare.T @ at.left  # which has nothing of what is spanned
    free = next(free for free in kind.free_parameters if free.name == kind.amplitude[0])
    grows_as = named(kind.name).grows_as
    out = []
    for k, begin in enumerate(starts):
        factor = float(along[k] / power[k]) if power[k] > 0 else 0.0
        start = dict(begin)
        if kind.inverse:  # its effect goes as one over the amplitude (a mass)
            factor = max(factor, 1e-9)
            start[free.name] = start[free.name] / factor
            factor = factor if factor > 1e-9 else 0.0
        elif grows_as != 1.0:
            factor = max(factor, 0.0)
            start[free.name] = max(start[free.name] * factor ** (1 / grows_as), free.lower)
        else:
            if free.lower >= 0:
                factor = max(factor, 0.0)
            start[free.name] = min(max(start[free.name] * factor, free.lower), free.upper)
        gain = 2 * factor * along[k] - factor**2 * power[k]
        out.append(Score(kind, (start,) * len(shots), float(gain), freedom, float(power[k]), begin[free.name]))
    return out


def apart(listed: Sequence[Score]) -> list[Score]:
    """Return starts that lie apart: the best, and the next that is not its neighbour on a frequency grid."""
    out = list(listed[:1])
    for score in listed[1:]:
        mine = score.start[0]
        scales = [k for k in mine if k in ("frequency_hz", "relaxation_time_s", "range_m", "order")]
        near = any(all(abs(math.log(mine[k] / other.start[0][k])) < 0.12 for k in scales) for other in out)
        if score.gain > 0.3 * listed[0].gain and scales and not near:
            out.append(score)
            if len(out) == 3:
                break
    return out


def within(start: Mapping[str, float], shots: Sequence[Samples]) -> bool:
    """Return whether a start's line, if it has one, lies within what the records can show."""
    f = start.get("frequency_hz")
    return f is None or 2.5 / max(s.length_s for s in shots) < f < 0.45 / shots[0].spacing_s


def fixed_of(kind: TrialEffect, start: Mapping[str, float]) -> Mapping[str, float]:
    """Return the values of a start that are not searched."""
    names = {free.name for free in kind.free_parameters}
    return {name: value for name, value in start.items() if name not in names}


def _own_amplitudes(
    at: Projector, kind: TrialEffect, column: Callable[[Mapping[str, float]], list[Floats] | None], freedom: int
) -> list[Score]:
    """Score an effect whose amplitudes are every shot's own (plate motion; cyclic error's phase as two quadratures)."""
    shots = at.fitted.hypothesis.data.shots
    out = []
    for start in kind.starts:
        if "phase_rad" in start:
            parts = [{**start, "phase_rad": 0.0}, {**start, "phase_rad": math.pi / 2}]
        else:
            parts = [{**start, **{n: 0.0 for n in kind.amplitude if n != name}} for name in kind.amplitude]
        makes = [partial(column, part) for part in parts]
        found = [at.once(f"column of {kind.name} {p}", m, nearby=True) for p, m in zip(parts, makes, strict=True)]
        if any(f is None for f in found):
            continue
        bare = [np.concatenate([f[s] for f in found if f is not None], axis=1) for s in range(len(shots))]
        gain, power, solution = _own_columns(at, bare)
        starts = []
        for s in range(len(shots)):
            mine = solution[s * len(parts) : (s + 1) * len(parts)]
            if "phase_rad" in start:
                name = kind.amplitude[0]
                size = float(np.sqrt(np.mean(np.sum(solution.reshape(-1, 2) ** 2, axis=1))))
                phase = math.atan2(float(mine[1]), float(mine[0]))
                starts.append({**start, name: start[name] * size, "phase_rad": phase})
            else:
                starts.append({n: start[n] * float(mine[k]) for k, n in enumerate(kind.amplitude)})
        out.append(Score(kind, tuple(starts), gain, freedom, power, start[kind.amplitude[0]]))
    out.sort(key=lambda score: -score.gain)
    return out


def _own_columns(at: Projector, bare: Sequence[Floats]) -> tuple[float, float, Floats]:
    """Return what columns of each shot's own, shape (n, k) a shot, explain: gain, power of the first, their numbers."""
    columns = Arrow.of(bare, 0).whitened(at.fitted.hypothesis.data.shots, at.floor)
    beside = at.basis.beside(columns)
    numbers = beside.solve(at.left)
    return float(numbers @ columns.pull(at.left)), float(beside.products[0, 0]), numbers


def _waves(at: Projector, kind: TrialEffect) -> list[Score]:
    """Score a wave that the sensor adds: any amplitude and phase a shot, frequencies dense against 1 / record."""
    shots = at.fitted.hypothesis.data.shots
    wave = named(kind.name).wave
    assert wave is not None
    grid, total = scan(at)
    freedom = len(kind.shared) + len(shots)
    out = []
    for k in np.argsort(-total)[:8]:
        f = float(grid[int(k)])
        omega = 2 * math.pi * f
        bare = [np.stack([np.cos(omega * s.centre_s), np.sin(omega * s.centre_s)], axis=1) for s in shots]
        gain, power, solution = _own_columns(at, bare)
        starts = tuple(wave(f, solution.reshape(-1, 2)))
        out.append(Score(kind, starts, gain, freedom, power, omega))
    out.sort(key=lambda score: -score.gain)
    return out
