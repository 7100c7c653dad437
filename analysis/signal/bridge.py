"""Bridge gaps in a beat's phase (light too weak, or samples lost) without losing count of the fringes."""

import numpy as np
from numpy.typing import NDArray

from analysis.shot import Floats
from analysis.signal.filters import stretches

Singles = NDArray[np.float32]
Segment = tuple[int, Floats, Singles]
LONGEST_PHASES = 400  # longest hole that is bridged; over a longer one motion is not predictable to half a fringe
REACH = 160  # phases on either side from which the motion in a hole is predicted
_LEAST = 12
DOUBT_CYCLES = 0.25
JOIN_REACH = 48  # motion samples on either side of a long gap
_JOIN_DOUBT = 0.2  # fringes


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
        self._clear(0)
        self._shift = 0.0

    def feed(self, first: int, phase: Floats, power: Singles) -> list[Segment]:
        """Add phases from index ``first`` on; return the finished ones as (first, phase, power) without holes.

        The arrays are views of the bridge's memory, valid until the next call.
        """
        ready: list[Segment] = []
        if phase.size == 0:
            return ready
        if self._phase.size == 0 and self._done == 0:
            self._clear(first)
        missing = first - (self._first + self._phase.size)
        if missing > LONGEST_PHASES:
            ready += self.finish()
            self.holes.append((self._first + self._phase.size, first))
            self.breaks.append(first)
            self._clear(first)
        elif missing > 0:
            self._append(np.full(missing, np.nan), np.zeros(missing, np.float32))
        self._append(phase, power)
        return ready + self._release(last=False)

    def finish(self) -> list[Segment]:
        """Return the remaining phases; a hole at the end of the stream is left unbridged."""
        return self._release(last=True)

    def _clear(self, first: int) -> None:
        self._first = first  # index of the oldest phase held
        self._done = 0  # number of phases held that were already returned
        self._phase: Floats = np.empty(0)
        self._power: Singles = np.empty(0, np.float32)

    def _append(self, phase: Floats, power: Singles) -> None:
        self._phase = np.concatenate((self._phase, phase + self._shift))
        self._power = np.concatenate((self._power, power))

    def _release(self, last: bool) -> list[Segment]:
        size = self._phase.size
        margin = 0 if last else self._box + self._guard + _LEAST
        limit = max(self._done, size - margin)
        bad = self._bad()
        if bad is not None:
            for start, stop in stretches(bad):
                if stop <= self._done:
                    continue
                if not last and stop + REACH + margin > size:
                    limit = max(self._done, min(limit, start))
                    break
                self._mend(start, stop, bad)
        out = (self._first + self._done, self._phase[self._done : limit], self._power[self._done : limit])
        self._done = limit
        drop = max(0, self._done - REACH - self._box - self._guard - _LEAST)
        self._first += drop
        self._done -= drop
        self._phase, self._power = self._phase[drop:], self._power[drop:]
        return [out] if out[1].size else []

    def _bad(self) -> NDArray[np.bool_] | None:
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
            if stop - start < _LEAST and start > 0 and stop < bad.size:
                bad[start:stop] = True
        return bad

    def _mend(self, start: int, stop: int, bad: NDArray[np.bool_]) -> None:
        self.holes.append((self._first + start, self._first + stop))
        reach = int(np.clip(stop - start, 4 * _LEAST, REACH))
        before = np.arange(max(0, start - reach), start)
        after = np.arange(stop, min(self._phase.size, stop + reach))
        if bad[after].any():
            after = after[: int(np.argmax(bad[after]))]
        before = before[np.isfinite(self._phase[before])]
        if before.size < _LEAST or after.size < _LEAST or stop - start > LONGEST_PHASES:
            self._phase[start:stop] = np.where(np.isfinite(self._phase[start:stop]), self._phase[start:stop], 0.0)
            if before.size >= _LEAST and after.size >= _LEAST:
                self.doubtful += 1
            return
        middle = 0.5 * (start + stop - 1)
        base = np.rint(self._phase[before[-1]])
        left = np.polynomial.Polynomial.fit(before - middle, self._phase[before] - base, 2)
        right = np.polynomial.Polynomial.fit(after - middle, self._phase[after] - base, 2)
        apart = float(right(0.0) - left(0.0))
        whole = np.rint(apart)
        if abs(apart - whole) > DOUBT_CYCLES:
            self.doubtful += 1
        self._phase[stop:] -= whole
        self._shift -= float(whole)
        span = float(stop - start + 1)
        u = (np.arange(start, stop) - (start - 1)) / span
        a, b = float(left(start - 1 - middle)), float(right(stop - middle)) - whole
        slope_a = float(left.deriv()(start - 1 - middle)) * span
        slope_b = float(right.deriv()(stop - middle)) * span
        self._phase[start:stop] = base + (
            a * (1 + 2 * u) * (1 - u) ** 2
            + slope_a * u * (1 - u) ** 2
            + b * u**2 * (3 - 2 * u)
            - slope_b * u**2 * (1 - u)
        )


def joined(
    displacement_m: Floats, breaks: tuple[int, ...], fringe_m: float, degree: int = 2, reach: int = JOIN_REACH
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
        if before.size < _LEAST or after.size < _LEAST:
            continue
        middle = 0.5 * (before[-1] + after[0])
        apart = [_mismatch(out, before[-n:], after[:n], middle, degree) / fringe_m for n in (reach // 2, reach)]
        whole = np.rint(apart[-1])
        out[after[0] :] -= whole * fringe_m
        sure = sure and abs(apart[0] - apart[1]) < _JOIN_DOUBT and abs(apart[1] - whole) < 2 * _JOIN_DOUBT
    return out, not sure


def _mismatch(
    displacement: Floats, before: NDArray[np.intp], after: NDArray[np.intp], middle: float, degree: int
) -> float:
    base = displacement[before[-1]]
    left = np.polynomial.Polynomial.fit(before - middle, displacement[before] - base, degree)
    right = np.polynomial.Polynomial.fit(after - middle, displacement[after] - base, degree)
    return float(right(0.0) - left(0.0))
