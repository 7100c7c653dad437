"""Finds the steps of the light switch in a stream of counts: where the block crosses its beam."""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numba import njit
from numpy.typing import NDArray

from analysis.shot import Channel


class Edge(IntEnum):
    """Which step of the light switch triggers."""

    RISING = 1
    FALLING = -1
    EITHER = 0


class Level(IntEnum):
    """The side of its thresholds on which the light switch was last."""

    UNKNOWN = 0
    HIGH = 1
    LOW = -1


@dataclass(frozen=True, slots=True)
class TriggerSettings:
    """Which edge triggers, and the thresholds of the light switch.

    With ``low_counts`` and ``high_counts`` the level is high from ``high_counts`` on and low again at ``low_counts``
    (hysteresis between).  Without them a step is a change, from the extreme since the last step, by twelve times
    the noise of the first ``LEARNED_FROM`` samples and at least a twentieth of the digitizer's range.
    """

    edge: Edge = Edge.EITHER
    low_counts: float | None = None
    high_counts: float | None = None

    @classmethod
    def in_volts(cls, edge: Edge, low_v: float | None, high_v: float | None, channel: Channel) -> "TriggerSettings":
        """Return settings for thresholds in V on ``channel``; None: learned."""
        if low_v is None or high_v is None:
            return cls(edge)
        counts = [(v - channel.offset_v) / channel.volts_per_count for v in (low_v, high_v)]
        if channel.volts_per_count < 0:  # an inverting channel exchanges levels and edges
            return cls(Edge(-edge), counts[1], counts[0])
        return cls(edge, *counts)

    def __post_init__(self) -> None:
        if (self.low_counts is None) != (self.high_counts is None):
            raise ValueError("a light switch needs both thresholds or neither")
        if self.low_counts is not None and self.high_counts is not None and not self.low_counts < self.high_counts:
            raise ValueError("the light switch's low threshold must lie below its high one")


LEARNED_FROM = 4096  # samples from whose noise the step size is learned
_NOISES = 12.0  # a minute of noise at 30 MS/s reaches 6.3 sigma, so its extremes differ by twice that
_RANGE_SHARE = 0.05
_STRETCH = 1024  # samples skipped together if their extremes exclude a step

# indices into the state that is carried from block to block
_SWING, _LOW, _HIGH, _LEVEL, _MINIMUM, _MAXIMUM, _SEEN, _PREVIOUS, _SQUARES, _EDGES = _STATE = range(10)


class LightSwitch:
    """Finds the steps of the light switch in consecutive blocks; the result does not depend on the block lengths."""

    def __init__(self, settings: TriggerSettings, column: int, bits: int) -> None:
        self._settings = settings
        self._column = column
        self._least = max(2.0, _RANGE_SHARE * 2.0**bits)
        self._state = np.zeros(len(_STATE))
        self._state[_LOW] = np.nan if settings.low_counts is None else settings.low_counts
        self._state[_HIGH] = np.nan if settings.high_counts is None else settings.high_counts

    @property
    def level(self) -> Level:
        """Get the level of the light switch; UNKNOWN before its first step if thresholds are learned."""
        return Level(int(self._state[_LEVEL]))

    @property
    def toggles(self) -> int:
        """Get the number of steps so far."""
        return int(self._state[_EDGES])

    @property
    def moved_counts(self) -> float | None:
        """Get the range of the switch's channel since its last step; None if thresholds are given."""
        given = self._settings.low_counts is not None
        return None if given or not self._state[_SEEN] else float(self._state[_MAXIMUM] - self._state[_MINIMUM])

    @property
    def needed_counts(self) -> float:
        """Get the change of the channel that counts as a step, if thresholds are learned."""
        return max(float(self._state[_SWING]), self._least)

    @property
    def thresholds_counts(self) -> tuple[float | None, float | None]:
        """Get the levels at which the next step down and the next step up would be found.

        Learned levels follow the extremes since the last step: None on the side where the switch is, and None for
        both before ``LEARNED_FROM`` samples.
        """
        state = self._state.copy()  # another thread may advance it
        if self._settings.low_counts is not None:
            return float(state[_LOW]), float(state[_HIGH])
        if not state[_SWING]:
            return None, None
        falls = float(state[_MAXIMUM] - state[_SWING]) if state[_LEVEL] >= 0 else None
        rises = float(state[_MINIMUM] + state[_SWING]) if state[_LEVEL] <= 0 else None
        return falls, rises

    def first_step(self, counts: NDArray[np.int16]) -> int | None:
        """Return the index of the first triggering step in a block (n, channels), or None.

        The state advances over the whole block, whether a step is found or not.  About 0.25 ns per sample.
        """
        found = _scan(np.ascontiguousarray(counts), self._column, int(self._settings.edge), self._least, self._state)
        return None if found < 0 else int(found)


@njit(cache=True, nogil=True, error_model="numpy")
def _scan(counts, column, edge, least, state):  # type: ignore[no-untyped-def]
    """Advance ``state`` over counts[:, column]; O(n), nothing allocated.

    Almost no stretch contains a step.  Its extremes show this at a fifth of the cost of checking every sample.
    """
    found = -1
    for begin in range(0, counts.shape[0], _STRETCH):
        end = min(begin + _STRETCH, counts.shape[0])
        lowest, highest = _extremes(counts[begin:end], column)
        if not _passes(lowest, highest, state):
            step = _first_step(counts[begin:end], column, edge, least, state)
            if found < 0 and step >= 0:
                found = begin + step
    return found


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _extremes(counts, column):  # type: ignore[no-untyped-def]
    """Return the lowest and the highest of counts[:, column].

    The loop vectorises only without branches, with an unsigned counter and a known spacing; otherwise it costs 1 ns per
    sample instead of 0.25.
    """
    lowest = counts[0, column]
    highest = lowest
    if counts.shape[1] == 3:
        flat = counts.reshape(counts.size)[column:]
        for i in range(np.uint32(counts.shape[0])):
            value = flat[np.uint32(3) * i]
            lowest = value if value < lowest else lowest
            highest = value if value > highest else highest
    else:
        for i in range(counts.shape[0]):
            lowest, highest = min(lowest, counts[i, column]), max(highest, counts[i, column])
    return lowest, highest


@njit(cache=True, nogil=True, error_model="numpy")
def _passes(lowest, highest, state):  # type: ignore[no-untyped-def]
    """Return whether a stretch of samples with these extremes has no step; if so, advance ``state`` over it.

    False if the stretch may contain one, or if the noise is not learned yet.  Apart from level and extremes, the state
    is used for learning only.
    """
    level = state[_LEVEL]
    if state[_LOW] == state[_LOW]:
        if (level <= 0.0 and highest >= state[_HIGH]) or (level >= 0.0 and lowest <= state[_LOW]):
            return False
    elif state[_SEEN] == 0.0 or state[_SWING] == 0.0:
        return False
    else:
        minimum, maximum = min(state[_MINIMUM], lowest), max(state[_MAXIMUM], highest)
        rises, falls = minimum + state[_SWING], maximum - state[_SWING]
        if (level <= 0.0 and highest >= rises) or (level >= 0.0 and lowest <= falls):
            return False
        state[_MINIMUM], state[_MAXIMUM] = minimum, maximum
    return True


@njit(cache=True, nogil=True, error_model="numpy")
def _first_step(counts, column, edge, least, state):  # type: ignore[no-untyped-def]  # noqa: C901 (kernel)
    """Advance ``state`` over counts[:, column] sample by sample; return the first triggering step, -1 for none."""
    given = state[_LOW] == state[_LOW]
    found = -1
    for i in range(counts.shape[0]):
        value = float(counts[i, column])
        level = int(state[_LEVEL])
        step = 0
        if given:
            if value >= state[_HIGH]:
                step = 1
            elif value <= state[_LOW]:
                step = -1
            if step == level:
                step = 0
            elif level == 0:  # the first level is not a step
                state[_LEVEL] = step
                step = 0
        else:
            if state[_SEEN] == 0.0:
                state[_MINIMUM] = state[_MAXIMUM] = value
            if state[_SWING] == 0.0:
                # differences of neighbours measure the noise independently of level and slope
                if state[_SEEN] > 0.0:
                    state[_SQUARES] += (value - state[_PREVIOUS]) ** 2
                if state[_SEEN] == LEARNED_FROM:
                    state[_SWING] = max(least, _NOISES * np.sqrt(0.5 * state[_SQUARES] / LEARNED_FROM))
                    state[_MINIMUM] = state[_MAXIMUM] = value
            state[_MINIMUM] = min(state[_MINIMUM], value)
            state[_MAXIMUM] = max(state[_MAXIMUM], value)
            if state[_SWING] > 0.0:
                if level <= 0 and value >= state[_MINIMUM] + state[_SWING]:
                    step = 1
                elif level >= 0 and value <= state[_MAXIMUM] - state[_SWING]:
                    step = -1
        state[_PREVIOUS] = value
        state[_SEEN] += 1.0
        if step != 0:
            state[_LEVEL] = step
            state[_MINIMUM] = state[_MAXIMUM] = value
            state[_EDGES] += 1.0
            if found < 0 and (edge == 0 or edge == step):
                found = i
    return found


def middle_of_step(switch: NDArray[np.int16], near: int, reach: int) -> int:
    """Return the sample at which a step found at ``near`` crosses the middle between its two levels.

    ``switch`` has shape (n,); the levels are medians of up to ``reach`` samples from ``near - 2 reach`` and from
    ``near + reach``.  Returns ``near`` if the levels do not differ significantly.
    """
    begin = near - reach
    after = switch[near + reach : near + 2 * reach]
    if begin <= 0 or after.size == 0:
        return near
    before = switch[max(0, begin - reach) : begin]
    low, high = float(np.median(before)), float(np.median(after))
    noise = max(float(np.std(before)), float(np.std(after)), 0.5)
    if abs(high - low) < 4 * noise:
        return near
    window = switch[begin : near + reach].astype(np.float64)
    middle = 0.5 * (low + high)
    beyond = window >= middle if high > low else window <= middle
    return begin + int(np.argmax(beyond)) if beyond.any() else near
