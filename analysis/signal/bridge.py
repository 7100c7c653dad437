"""Bridge gaps in a beat's phase (light too weak, or samples lost) without losing count of the fringes."""

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from analysis.shot import Floats
from analysis.signal.filters import stretches

Singles = NDArray[np.float32]
Segment = tuple[int, Floats, Singles]
MAX_BRIDGED_PHASES = 400  # longest hole that is bridged; over a longer one motion is not predictable to half a fringe
SIDE_PHASES = 160  # phases on either side from which the motion in a hole is predicted
_MIN_PHASES = 12
DOUBTFUL_CYCLES = 0.25
JOIN_SAMPLES = 48  # motion samples on either side of a long gap
_DOUBTFUL_FRINGES = 0.2  # fringes


class Bridge:
    """Fills short holes in a beat's fine phases before they are decimated.

    A hole is where phases are missing, or where the beat's power (mean over ``box`` phases) is below ``threshold``,
    widened by ``guard`` phases.  A piece between two holes that is too short to show the motion belongs to the hole.
    Parabolas fitted on either side are extrapolated to the middle of the hole.  Their difference, rounded to whole
    fringes, is subtracted from the later side, and a cubic fills the hole.  Block boundaries do not affect the result.

    ``holes`` lists (first, last + 1) of each hole; ``breaks`` the first phases after holes too long to bridge;
    ``doubtful`` counts bridges whose mismatch was over a quarter fringe from a whole number, and unbridged holes.
    """

    def __init__(self, threshold: float, box: int, guard: int) -> None:
        self.holes: list[tuple[int, int]] = []
        self.breaks: list[int] = []
        self.doubtful = 0
        self._threshold = threshold
        self._box = box
        self._guard = guard
        self._restart(0)
        self._shift = 0.0

    def feed(self, first: int, phase: Floats, power: Singles) -> list[Segment]:
        """Add phases from index ``first`` on; return the finished ones as (first, phase, power) without holes.

        The arrays are views of the bridge's memory, valid until the next call.
        """
        ready: list[Segment] = []
        if phase.size == 0:
            return ready
        if self._phase.size == 0 and self._done == 0:
            self._restart(first)
        missing = first - (self._first + self._phase.size)
        if missing > MAX_BRIDGED_PHASES:
            ready += self.finish()
            self.holes.append((self._first + self._phase.size, first))
            self.breaks.append(first)
            self._restart(first)
        elif missing > 0:
            self._append(np.full(missing, np.nan), np.zeros(missing, np.float32))
        self._append(phase, power)
        return ready + self._release(last=False)

    def finish(self) -> list[Segment]:
        """Return the remaining phases; a hole at the end of the stream is left unbridged."""
        return self._release(last=True)

    def _restart(self, first: int) -> None:
        self._first = first  # index of the oldest phase held
        self._done = 0  # number of phases held that were already returned
        self._phase: Floats = np.empty(0)
        self._power: Singles = np.empty(0, np.float32)

    def _append(self, phase: Floats, power: Singles) -> None:
        self._phase = np.concatenate((self._phase, phase + self._shift))
        self._power = np.concatenate((self._power, power))

    def _release(self, last: bool) -> list[Segment]:
        size = self._phase.size
        margin = 0 if last else self._box + self._guard + _MIN_PHASES
        limit = max(self._done, size - margin)
        bad = self._find_holes()
        if bad is not None:
            for start, stop in stretches(bad):
                if stop <= self._done:
                    continue
                if not last and stop + SIDE_PHASES + margin > size:
                    limit = max(self._done, min(limit, start))
                    break
                self._fill_hole(start, stop, bad)
        out = (self._first + self._done, self._phase[self._done : limit], self._power[self._done : limit])
        self._done = limit
        drop = max(0, self._done - SIDE_PHASES - self._box - self._guard - _MIN_PHASES)
        self._first += drop
        self._done -= drop
        self._phase, self._power = self._phase[drop:], self._power[drop:]
        return [out] if out[1].size else []

    def _find_holes(self) -> NDArray[np.bool_] | None:
        if self._power.size == 0 or float(self._power.min()) >= self._threshold:
            return None
        box = self._box
        total = np.cumsum(np.concatenate((np.zeros(1), self._power.astype(np.float64))))
        centre = np.arange(self._power.size)
        low, high = np.maximum(centre - box // 2, 0), np.minimum(centre + (box - box // 2), centre.size)
        dark = (total[high] - total[low]) / (high - low) < self._threshold
        if not dark.any():
            return None
        count = np.cumsum(np.concatenate((np.zeros(1, np.int64), dark)))
        wide = np.minimum(centre + self._guard + 1, centre.size)
        bad = np.asarray(count[wide] - count[np.maximum(centre - self._guard, 0)] > 0)
        for start, stop in stretches(~bad):
            if stop - start < _MIN_PHASES and start > 0 and stop < bad.size:
                bad[start:stop] = True
        return bad

    def _fill_hole(self, start: int, stop: int, bad: NDArray[np.bool_]) -> None:
        self.holes.append((self._first + start, self._first + stop))
        reach = int(np.clip(stop - start, 4 * _MIN_PHASES, SIDE_PHASES))
        before = np.arange(max(0, start - reach), start)
        after = np.arange(stop, min(self._phase.size, stop + reach))
        if bad[after].any():
            after = after[: int(np.argmax(bad[after]))]
        before = before[np.isfinite(self._phase[before])]
        if before.size < _MIN_PHASES or after.size < _MIN_PHASES or stop - start > MAX_BRIDGED_PHASES:
            self._phase[start:stop] = np.where(np.isfinite(self._phase[start:stop]), self._phase[start:stop], 0.0)
            if before.size >= _MIN_PHASES and after.size >= _MIN_PHASES:
                self.doubtful += 1
            return
        middle = 0.5 * (start + stop - 1)
        left, right = _sides(self._phase, before, after, middle, 2)
        apart = float(right(0.0) - left(0.0))
        whole = np.rint(apart)
        if abs(apart - whole) > DOUBTFUL_CYCLES:
            self.doubtful += 1
        self._phase[stop:] -= whole
        self._shift -= float(whole)
        from scipy.interpolate import CubicHermiteSpline  # slow import: only where a hole is filled

        begin, end = start - 1 - middle, stop - middle
        values, slopes = [left(begin), right(end) - whole], [left.deriv()(begin), right.deriv()(end)]
        self._phase[start:stop] = self._phase[before[-1]] + CubicHermiteSpline([begin, end], values, slopes)(
            np.arange(start, stop) - middle
        )


def join_stretches(
    displacement_m: Floats, breaks: tuple[int, ...], fringe_m: float, degree: int = 2, reach: int = JOIN_SAMPLES
) -> tuple[Floats, bool]:
    """Join the stretches of a displacement (n,) at ``breaks`` by whole fringes; return it and whether that is unsure.

    The motion on either side of a break is extrapolated to the middle of the gap by a polynomial of ``degree`` through
    ``reach`` samples, and the later side is shifted until both meet within half a fringe.  The shift is unsure where
    half as many samples give a result more than a fifth of a fringe away, or where the remaining mismatch is large.
    This happens when the force changed in the gap: the velocity is then right on both sides but the position unknown.
    """
    out = displacement_m.copy()
    sure = True
    for at in breaks:
        known = np.flatnonzero(np.isfinite(out))
        before, after = known[known < at][-reach:], known[known >= at][:reach]
        if before.size < _MIN_PHASES or after.size < _MIN_PHASES:
            continue
        middle = 0.5 * (before[-1] + after[0])
        sides = [_sides(out, before[-n:], after[:n], middle, degree) for n in (reach // 2, reach)]
        apart = [float(right(0.0) - left(0.0)) / fringe_m for left, right in sides]
        whole = np.rint(apart[-1])
        out[after[0] :] -= whole * fringe_m
        sure = sure and abs(apart[0] - apart[1]) < _DOUBTFUL_FRINGES and abs(apart[1] - whole) < 2 * _DOUBTFUL_FRINGES
    return out, not sure


def _sides(
    values: Floats, before: NDArray[np.intp], after: NDArray[np.intp], middle: float, degree: int
) -> tuple[Polynomial, Polynomial]:
    """Return polynomials through the samples before and after a gap, relative to the last one before it."""
    left, right = (Polynomial.fit(side - middle, values[side] - values[before[-1]], degree) for side in (before, after))
    return left, right
