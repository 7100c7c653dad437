"""Trigger without a light switch: fires when the block starts to move, as its beat leaves the rest frequency."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

WINDOW_S = 0.5e-3  # window in which a frequency is counted: resolves 2 kHz, 0.6 mm/s
_LEARNED_FROM = 20  # windows from which the rest frequency is learned, without PD0 and a given value
_CONFIRMED_BY = 2  # windows in a row beyond the threshold

# indices into the state: those of the windows, then six for each of the two channels
_POSITION, _WINDOWS, _REST, _QUIET, _BEYOND, _SEEN = _OF_WINDOWS = range(6)
_MEAN, _LEVEL, _SIDE, _CROSSINGS, _SUM, _SQUARES = _OF_CHANNEL = range(6)
_CHANNEL = len(_OF_WINDOWS)
_PER_CHANNEL = len(_OF_CHANNEL)


class MotionTrigger:
    """Fires when the block exceeds ``speed_m_per_s`` from rest; the result does not depend on the block lengths.

    Frequencies are counted at crossings of the mean, with hysteresis, in windows of ``WINDOW_S``.  The rest frequency
    is PD0's, or ``rest_frequency_hz``, or the beat's in the first 10 ms.
    """

    def __init__(
        self,
        measurement_column: int,
        reference_column: int | None,
        sample_rate_hz: float,
        wavelength_m: float,
        speed_m_per_s: float,
        rest_frequency_hz: float | None = None,
    ) -> None:
        self._columns = measurement_column, -1 if reference_column is None else reference_column
        self._rate_hz = sample_rate_hz
        self._window = max(64, round(WINDOW_S * sample_rate_hz))
        self._doppler_hz = 2 * speed_m_per_s / wavelength_m
        self._rest_hz = rest_frequency_hz or 0.0
        self._state = np.zeros(_CHANNEL + len(self._columns) * _PER_CHANNEL)
        self._state[_REST] = self._rest_hz

    def first_step(self, counts: NDArray[np.int16]) -> int | None:
        """Return the index of the trigger in a block of counts (n, channels), or None; 3 ns per sample and channel."""
        found = _scan(
            counts, self._columns, self._window, self._rate_hz, self._doppler_hz, self._rest_hz > 0, self._state
        )
        return None if found < 0 else int(found)


@njit(cache=True, nogil=True, error_model="numpy")
def _scan(counts, columns, window, rate, doppler, given, state):  # type: ignore[no-untyped-def]
    """Advance ``state`` over both beats; O(n), nothing allocated."""
    _, reference = columns
    found = -1
    for i in range(counts.shape[0]):
        for c in range(len(columns)):
            column = columns[c]
            if column < 0:
                continue
            base = _CHANNEL + _PER_CHANNEL * c
            value = float(counts[i, column])
            state[base + _SUM] += value
            state[base + _SQUARES] += value * value
            above = value - state[base + _MEAN]
            if state[base + _SIDE] <= 0.0 and above > state[base + _LEVEL]:
                state[base + _SIDE] = above
                state[base + _CROSSINGS] += 1.0
            elif state[base + _SIDE] >= 0.0 and above < -state[base + _LEVEL]:
                state[base + _SIDE] = above
        state[_POSITION] += 1.0
        if state[_POSITION] < window:
            continue
        beat = state[_CHANNEL + _CROSSINGS] * rate / window
        rest = state[_CHANNEL + _PER_CHANNEL + _CROSSINGS] * rate / window
        for c in range(len(columns)):
            base = _CHANNEL + _PER_CHANNEL * c
            mean = state[base + _SUM] / window
            state[base + _MEAN] = mean
            state[base + _LEVEL] = 0.3 * np.sqrt(state[base + _SQUARES] / window - mean * mean)
            state[base + _CROSSINGS] = 0.0
            state[base + _SUM] = 0.0
            state[base + _SQUARES] = 0.0
        state[_POSITION] = 0.0
        state[_WINDOWS] += 1.0
        if state[_WINDOWS] < 2.0:
            continue  # the first window only gives mean and level
        if reference < 0:
            if not given and state[_SEEN] < _LEARNED_FROM:
                state[_SEEN] += 1.0
                state[_REST] += (beat - state[_REST]) / state[_SEEN]
                continue
            rest = state[_REST]
        off = abs(beat - rest)
        if off < 0.5 * doppler:
            state[_QUIET] = 1.0
            state[_BEYOND] = 0.0
        elif off > doppler and state[_QUIET] > 0.0:
            state[_BEYOND] += 1.0
            if state[_BEYOND] >= _CONFIRMED_BY:
                state[_QUIET] = 0.0
                state[_BEYOND] = 0.0
                if found < 0:
                    found = i
        else:
            state[_BEYOND] = 0.0
    return found
