"""Score every effect of the catalogue on the residual of a fit, after projection off all fitted parameters."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from analysis.compiled import side_by_side
from analysis.inference.model.arrow import Arrow
from analysis.inference.model.free_parameters import TrialEffect
from analysis.inference.screen.columns import (
    KNOWN_PATH,
    MANY_STARTS,
    ColumnProducts,
    column_products,
    own_columns,
    products_along_paths,
)
from analysis.inference.screen.lines import scan, starts_near_strong_lines
from analysis.inference.screen.projector import Projector
from analysis.shot import Cancelled, Floats, Stop

_SPANNED = 1e-5  # relative length after projection below which a column depends linearly on the fitted parameters
_WORTH_REFINING = 12.0  # gain on the grid above which a line is searched between grid points


@dataclass(frozen=True, slots=True)
class Score:
    """The score of one start of an effect: ``gain`` in chi^2 for ``freedom`` parameters, by a linear step.

    ``start`` holds the values of each shot after this step.
    """

    kind: TrialEffect
    start: tuple[Mapping[str, float], ...]
    gain: float
    freedom: int
    power: float = 0.0  # squared norm of the column of ``unit`` amplitude, projected off the fitted parameters
    unit: float = 0.0

    def worth(self, samples: int) -> float:
        """Return the gain minus the cost of its parameters in the Bayesian information criterion."""
        return self.gain - self.freedom * math.log(samples)


def all_scores(
    at: Projector, kinds: Sequence[TrialEffect], stop: Stop, *, to_join: float | None = None
) -> list[list[Score]]:
    """Return the scores of every effect that has any, in the order of ``kinds``; arguments as for ``scores``.

    Raises Cancelled.
    """
    known = products_along_paths(at, kinds)
    if any(_looks_for_lines(kind) for kind in kinds):
        scan(at)  # several effects need it: computed here on all cores, since below one effect would wait for another

    def scored(kind: TrialEffect) -> list[Score]:
        if stop():
            raise Cancelled
        return scores(at, kind, to_join=to_join, grid=known.get(kind.effect))

    longest_first = sorted(kinds, key=lambda kind: -len(kind.starts))  # so that both cores end at the same time
    every = side_by_side(scored, longest_first)
    found = {kind.effect: listed for kind, listed in zip(longest_first, every, strict=True)}
    return [found[kind.effect] for kind in kinds if found[kind.effect]]


def scores(
    at: Projector, kind: TrialEffect, *, to_join: float | None = None, grid: ColumnProducts | None = None
) -> list[Score]:
    """Return the scores of one effect, one for each start, best first.

    ``to_join`` is the fall of the criterion required of an added effect; lines that cannot reach it are not refined.
    ``grid`` holds the products of the effect's own starts, if known.
    """
    if kind.effect.wave is not None:
        return _waves(at, kind)
    if any(free.name in (*kind.amplitude, "phase_rad") for free in kind.own):
        return _own_amplitudes(at, kind)
    freedom = _freedom(at, kind)
    out = _linear(at, kind, grid or column_products(at, kind, kind.starts, MANY_STARTS, kept=True), freedom)

    def more(some: Sequence[Mapping[str, float]]) -> list[Score]:
        return _linear(at, kind, column_products(at, kind, some, KNOWN_PATH), freedom)

    if _looks_for_lines(kind):
        # An added effect must pay for its parameters: only lines with that gain are refined.
        cost = 0.0 if to_join is None else freedom * math.log(at.left.size) + to_join
        lines = starts_near_strong_lines(at, kind, louder_than=cost)
        out += more(lines) if lines else []
    if out and "frequency_hz" in out[0].start[0] and max(score.gain for score in out) > _WORTH_REFINING:
        out += more(_between(out, kind))
    out.sort(key=lambda score: -score.gain)
    return out


def _looks_for_lines(kind: TrialEffect) -> bool:
    return kind.effect.wave is not None or "frequency_hz" in kind.starts[0]


def _freedom(at: Projector, kind: TrialEffect) -> int:
    return len(kind.shared) + len(kind.own) * len(at.problem.data.shots)


def _between(listed: Sequence[Score], kind: TrialEffect) -> list[Mapping[str, float]]:
    """Return starts around the two best peaks, since a weakly damped line is narrower than the grid's steps."""
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


def _linear(at: Projector, kind: TrialEffect, products: ColumnProducts, freedom: int) -> list[Score]:
    """Return the scores of effects whose displacement is linear in the amplitude, with allowed signs only."""
    shots = at.problem.data.shots
    # After projection a column in the span of the fitted parameters is rounding error, with an arbitrary score.
    power = np.where(products.power < _SPANNED**2 * products.whole, 0.0, products.power)
    along = products.along
    free = next(free for free in kind.free_parameters if free.name == kind.amplitude[0])
    response_power = kind.effect.response_power
    out = []
    for k, begin in enumerate(products.starts):
        factor = float(along[k] / power[k]) if power[k] > 0 else 0.0
        start = dict(begin)
        if kind.inverse:  # the displacement is inversely proportional to the amplitude (a mass)
            factor = max(factor, 1e-9)
            start[free.name] = start[free.name] / factor
            factor = factor if factor > 1e-9 else 0.0
        elif response_power != 1.0:
            factor = max(factor, 0.0)
            start[free.name] = max(start[free.name] * factor ** (1 / response_power), free.lower)
        else:
            if free.lower >= 0:
                factor = max(factor, 0.0)
            start[free.name] = min(max(start[free.name] * factor, free.lower), free.upper)
        gain = 2 * factor * along[k] - factor**2 * power[k]
        out.append(Score(kind, (start,) * len(shots), float(gain), freedom, float(power[k]), begin[free.name]))
    return out


def distinct_starts(listed: Sequence[Score], most: int = 3, apart: float = 0.12) -> list[Score]:
    """Return up to ``most`` starts that differ: the best, and others not near it in frequency, time, range or order.

    Values are near each other if their logarithms differ by less than ``apart``.
    """
    out = list(listed[:1])
    for score in listed[1:]:
        mine = score.start[0]
        scales = [k for k in mine if k in ("frequency_hz", "relaxation_time_s", "range_m", "order")]
        near = any(all(abs(math.log(mine[k] / other.start[0][k])) < apart for k in scales) for other in out)
        if score.gain > 0.3 * listed[0].gain and scales and not near:
            out.append(score)
            if len(out) == most:
                break
    return out


def opposite(score: Score) -> Score | None:
    """Return the same start with the effect's sign reversed; None if its amplitude allows one sign only."""
    kind, start = score.kind, tuple(score.kind.times(one, -1.0) for one in score.start)
    free = [parameter for parameter in kind.free_parameters if parameter.name in kind.amplitude]
    allowed = all(one.lower <= values[one.name] <= one.upper for one in free for values in start)
    return replace(score, start=start) if allowed else None


def _own_amplitudes(at: Projector, kind: TrialEffect) -> list[Score]:
    """Score an effect with per-shot amplitudes (plate motion; a cyclic error's phase as two quadratures)."""
    shots = at.problem.data.shots
    freedom = _freedom(at, kind)
    out = []
    for start in kind.starts:
        if "phase_rad" in start:
            parts = [{**start, "phase_rad": 0.0}, {**start, "phase_rad": math.pi / 2}]
        else:
            parts = [{**start, **{n: 0.0 for n in kind.amplitude if n != name}} for name in kind.amplitude]
        bare = own_columns(at, kind, parts)
        if bare is None:
            continue
        gain, power, solution = _given_fit(at, bare)
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


def _given_fit(at: Projector, bare: Sequence[Floats]) -> tuple[float, float, Floats]:
    """Return the gain of per-shot columns, shape (n, k), given the fit, the first's squared norm, and amplitudes."""
    columns = Arrow.of(bare, 0).whitened(at.problem.data.shots, at.noise)
    projected = at.basis.projected_columns(columns)
    numbers = projected.solve(at.left)
    return float(numbers @ columns.pull(at.left)), float(projected.power[0]), numbers


def _waves(at: Projector, kind: TrialEffect) -> list[Score]:
    """Score a wave added by the sensor, with per-shot amplitude and phase; frequencies closer than 1 / record."""
    shots = at.problem.data.shots
    wave = kind.effect.wave
    assert wave is not None
    grid, total = scan(at)
    freedom = len(kind.shared) + len(shots)
    out = []
    for k in np.argsort(-total)[:8]:
        f = float(grid[int(k)])
        omega = 2 * math.pi * f
        bare = [np.stack([np.cos(omega * s.centre_s), np.sin(omega * s.centre_s)], axis=1) for s in shots]
        gain, power, solution = _given_fit(at, bare)
        starts = tuple(wave(f, solution.reshape(-1, 2)))
        out.append(Score(kind, starts, gain, freedom, power, omega))
    out.sort(key=lambda score: -score.gain)
    return out
