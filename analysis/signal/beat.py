"""Demodulate int16 counts to the phase of one beat, with identical results for any division into blocks.

Outputs are computed in batches of fixed size at fixed absolute sample counts.  A batch always runs the same
instructions on the same values, so the boundaries of a caller's blocks do not change the result.
"""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from analysis.shot import Floats
from analysis.signal.integer_filter import LINE_BYTES, TOGETHER, WIDTH, four_dots, integer_taps, prefetch
from analysis.signal.tuning import BATCH, PHASE_STEPS, OscillatorSchedule, Tuning

_FAST = {"contract", "reassoc", "nsz", "arcp"}
_KERNEL: dict[str, Any] = {"cache": True, "nogil": True, "error_model": "numpy", "fastmath": _FAST}
_STEP = 1.0 / PHASE_STEPS
_LINE = LINE_BYTES // 2  # counts

Counts = NDArray[np.int16]
Singles = NDArray[np.float32]


def _arctangent_coefficients() -> tuple[np.float32, ...]:
    """Return c of atan(q) / (2 pi) = q (c0 + c1 s + ...), s = q^2, 0 <= q <= 1; error below 1e-8 cycles."""
    s = 0.5 * (1 - np.cos(np.pi * (np.arange(200) + 0.5) / 200))
    q = np.sqrt(s)
    series = np.polynomial.Chebyshev.fit(s, np.arctan(q) / (2 * np.pi * q), 8, domain=[0, 1])
    return tuple(np.float32(c) for c in series.convert(kind=np.polynomial.Polynomial).coef)


_C0, _C1, _C2, _C3, _C4, _C5, _C6, _C7, _C8 = _arctangent_coefficients()


@njit(**_KERNEL)
def _take(flat: Counts, channels: int, column: int, start: int, count: int, out: Counts) -> None:
    """Copy ``count`` samples of one interleaved column; 0.07 ns per sample, limited by memory.

    Without the unsigned counter or the literal stride the loop is not vectorised and takes four times as long.
    """
    column_on = flat[start * channels + column :]
    if channels == 1:
        for j in range(np.uint32(count)):
            out[j] = column_on[j]
    elif channels == 2:
        for j in range(np.uint32(count)):
            out[j] = column_on[np.uint32(2) * j]
    elif channels == 3:
        for j in range(np.uint32(count)):
            out[j] = column_on[np.uint32(3) * j]
    else:
        for j in range(np.uint32(count)):
            out[j] = column_on[np.uint32(channels) * j]


@njit(**_KERNEL)
def _mix(
    samples: Counts, stride: int, taps: Counts, out: NDArray[np.int32], ahead: Counts, place: int, fetched: int
) -> None:
    """Write the dot products of both rows of ``taps`` with a batch's windows, ``stride`` apart; 0.1 ns per sample.

    Meanwhile ``fetched`` counts of ``ahead`` from ``place`` on are prefetched, which saves 0.1 ns per sample later.
    """
    lines = fetched // (BATCH // TOGETHER * _LINE) + 1
    for j in range(0, BATCH, TOGETHER):
        for line in range(lines):
            prefetch(ahead, place + line * _LINE)
        place += lines * _LINE
        four_dots(samples, j * stride, stride, taps, out, j)


@njit(**_KERNEL)
def _turn(sums: NDArray[np.int32], restore: Singles, turn: Singles, power: Singles) -> None:
    """Write phase (-0.5..0.5 cycles) and |z|^2 of one batch by a polynomial arctangent; 1e-7 cycles, 0.4 ns each."""
    gain_re, gain_im, steady = restore[0], restore[1], restore[2]
    for j in range(BATCH):
        re = np.float32(sums[0, j]) * gain_re - steady
        im = np.float32(sums[1, j]) * gain_im
        power[j] = re * re + im * im
        across, along = abs(re), abs(im)
        high, low = max(across, along), min(across, along)
        q = low / max(high, np.float32(1e-30))
        s = q * q
        t = _C4 + s * (_C5 + s * (_C6 + s * (_C7 + s * _C8)))
        t = q * (_C0 + s * (_C1 + s * (_C2 + s * (_C3 + s * t))))
        t = np.float32(0.25) - t if along > across else t
        t = np.float32(0.5) - t if re < 0 else t
        turn[j] = -t if im < 0 else t


@njit(**_KERNEL)
def _unwrap(
    turn: Singles, first: int, nominal: int, steps: int, state: Floats, slips: NDArray[np.int32], phase: Floats
) -> None:
    """Subtract the nominal oscillator and unwrap with an integer count of cycles; phase in cycles, shape (BATCH,).

    ``state`` = [whole cycles so far, fractional phase of the previous sample].  Each phase step is assumed to be the
    one nearest to this batch's oscillator, ``steps``.  Oscillators are exact, integers modulo PHASE_STEPS.  Differences
    are vectorised; only the integer sum is sequential.
    """
    start = np.int64((first * nominal) % PHASE_STEPS)
    expected = (steps - nominal) * _STEP
    for j in range(BATCH):
        phase[j] = np.float64(turn[j]) - ((start + j * nominal) & (PHASE_STEPS - 1)) * _STEP
    slips[0] = np.int32(np.rint(phase[0] - state[1] - expected))
    before, after, slips_after = phase[0 : BATCH - 1], phase[1:BATCH], slips[1:BATCH]
    for j in range(BATCH - 1):
        slips_after[j] = np.int32(np.rint(after[j] - before[j] - expected))
    state[1] = phase[BATCH - 1]
    whole = np.int32(0)
    for j in range(BATCH):
        whole -= slips[j]
        slips[j] = whole
    base = state[0]
    for j in range(BATCH):
        phase[j] += base + slips[j]
    state[0] = base + whole


@njit(**_KERNEL)
def _read(  # noqa: PLR0913 (kernel)
    flat: Counts,
    channels: int,
    column: int,
    samples: int,
    buffer: Counts,
    filled: int,
    decimation: int,
    need: int,
    taps: NDArray[np.int16],
    restore: Singles,
    oscillators: NDArray[np.int64],
    schedule: NDArray[np.int32],
    nominal: int,
    first: int,
    state: Floats,
    sums: NDArray[np.int32],
    turn: Singles,
    slips: NDArray[np.int32],
    phase: Floats,
    power: Singles,
) -> tuple[int, int]:
    """Run every whole batch in ``buffer`` followed by ``flat``; return (outputs, samples left in ``buffer``).

    Batch b (absolute) is mixed with oscillator ``schedule[b]``; the last entry serves all later batches.  Costs about
    0.25 ns per sample at 30 MS/s and a decimation of 50; nothing is allocated.
    """
    used, done = 0, 0
    step = BATCH * decimation
    kept = need - step
    while True:
        fresh = min(samples - used, need - filled)
        _take(flat, channels, column, used, fresh, buffer[filled:])
        used += fresh
        filled += fresh
        if filled < need:
            return done, filled
        which = schedule[min((first + done) // BATCH, schedule.shape[0] - 1)]
        _mix(buffer, decimation, taps[which], sums, flat, used * channels, step * channels)
        _turn(sums, restore[which], turn, power[done : done + BATCH])
        _unwrap(turn, first + done, nominal, oscillators[which], state, slips, phase[done : done + BATCH])
        for j in range(kept):
            buffer[j] = buffer[step + j]
        filled = kept
        done += BATCH


class BeatReader:
    """Reads the phase of one beat from interleaved counts, block by block.

    Output m (absolute) is the phase at the centre of samples m D .. m D + L - 1 (D the decimation, L the window's
    length), so a reader started later in the record (``start_sample`` after a gap) stays on the same grid.
    """

    def __init__(
        self,
        tuning: Tuning,
        schedule: OscillatorSchedule,
        column: int,
        offset_counts: float = 0.0,
        start_sample: int = 0,
    ) -> None:
        self.tuning = tuning
        self.schedule = schedule
        self.column = column
        turns = schedule.steps / (PHASE_STEPS * tuning.decimation)
        self._taps, self._restore = integer_taps(tuning.window, turns, offset_counts)
        self._need = (BATCH - 1) * tuning.decimation + tuning.length
        self.index = -(-start_sample // tuning.decimation)  # index of the next output
        self._skip = self.index * tuning.decimation - start_sample
        self._buffer = np.zeros(self._need + WIDTH, dtype=np.int16)  # taps are padded to whole vectors with zeros
        self._filled = 0
        self._state = np.zeros(2)
        self._sums = np.empty((2, BATCH), dtype=np.int32)
        self._turn = np.empty(BATCH, dtype=np.float32)
        self._slips = np.empty(BATCH, dtype=np.int32)
        self._phase = np.empty(0)
        self._power = np.empty(0, dtype=np.float32)

    @property
    def oscillator_hz(self) -> float:
        """Get the frequency in Hz whose phase is subtracted from the beat's."""
        return self.tuning.oscillator_hz(self.schedule.nominal)

    def feed(self, counts: Counts) -> tuple[int, Floats, Singles]:
        """Process counts of shape (n, channels); return (index of the first output, phase in cycles, |z|^2).

        The phase is the beat's minus the oscillator's (``oscillator_hz`` times the time of each window's centre).
        Both arrays, shape (m,), are views of the reader's memory, valid until the next call.
        """
        if self._skip:
            dropped = min(self._skip, counts.shape[0])
            self._skip -= dropped
            counts = counts[dropped:]
        return self._run(counts, self.column)

    def finish(self) -> tuple[int, Floats, Singles]:
        """Return the last outputs that have a complete window; the reader cannot be used afterwards."""
        left = max(0, (self._filled - self.tuning.length) // self.tuning.decimation + 1)
        first, phase, power = self._run(np.zeros((self._need, 1), dtype=np.int16), 0)
        return first, phase[:left], power[:left]

    def _run(self, counts: Counts, column: int) -> tuple[int, Floats, Singles]:
        samples, channels = counts.shape
        flat = np.asarray(np.ascontiguousarray(counts)).reshape(-1).view()
        flat.flags.writeable = False  # so that one compiled kernel serves recordings, memory maps and buffers
        most = ((self._filled + samples) // (BATCH * self.tuning.decimation) + 1) * BATCH
        if self._phase.size < most:
            self._phase = np.empty(most)
            self._power = np.empty(most, dtype=np.float32)
        first = self.index
        done, self._filled = _read(
            flat, channels, column, samples, self._buffer, self._filled, self.tuning.decimation, self._need,
            self._taps, self._restore, self.schedule.steps, self.schedule.batch, self.schedule.nominal, first,
            self._state, self._sums, self._turn, self._slips, self._phase, self._power,
        )  # fmt: skip
        self.index += done
        return first, self._phase[:done], self._power[:done]
