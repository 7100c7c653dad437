"""From int16 counts to the phase of one beat: one pass, the same bits for any cutting of the record.

Outputs are computed in batches of fixed size whose boundaries are fixed on the absolute sample count; a batch always
runs through the same instructions on the same values, so where a caller cuts his blocks cannot show in the result.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from analysis.signal.tuning import PHASE_STEPS, Tuning

BATCH = 64  # decimated samples computed together; their input stays in the first cache
_FAST = {"contract", "reassoc", "nsz", "arcp"}
_KERNEL: dict[str, Any] = {"cache": True, "nogil": True, "error_model": "numpy", "fastmath": _FAST}
_STEP = 1.0 / PHASE_STEPS
_VECTOR = 32  # taps handled together: two of the widest vectors

Counts = NDArray[np.int16]
Singles = NDArray[np.float32]
Floats = NDArray[np.float64]


def _arctangent_coefficients() -> tuple[np.float32, ...]:
    """Return c of atan(q) / (2 pi) = q (c0 + c1 s + ...), s = q^2, 0 <= q <= 1; error below 1e-8 cycles."""
    s = 0.5 * (1 - np.cos(np.pi * (np.arange(200) + 0.5) / 200))
    q = np.sqrt(s)
    series = np.polynomial.Chebyshev.fit(s, np.arctan(q) / (2 * np.pi * q), 8, domain=[0, 1])
    return tuple(np.float32(c) for c in series.convert(kind=np.polynomial.Polynomial).coef)


_C0, _C1, _C2, _C3, _C4, _C5, _C6, _C7, _C8 = _arctangent_coefficients()


@njit(**_KERNEL)
def _take(flat: Counts, channels: int, column: int, start: int, count: int, offset: np.float32, out: Singles) -> None:
    """Convert ``count`` samples of one interleaved column to float32, offset off; one pass, 0.1-0.2 ns a sample.

    An unsigned counter and a stride written out: with either missing the loop is not vectorised and costs fourfold.
    """
    column_on = flat[start * channels + column :]
    if channels == 1:
        for j in range(np.uint32(count)):
            out[j] = np.float32(column_on[j]) - offset
    elif channels == 2:
        for j in range(np.uint32(count)):
            out[j] = np.float32(column_on[np.uint32(2) * j]) - offset
    elif channels == 3:
        for j in range(np.uint32(count)):
            out[j] = np.float32(column_on[np.uint32(3) * j]) - offset
    else:
        for j in range(np.uint32(count)):
            out[j] = np.float32(column_on[np.uint32(channels) * j]) - offset


@njit(**_KERNEL)
def _halve(samples: Singles, count: int, out: Singles) -> None:
    """Halve the rate: weights 1 3 3 1 on neighbouring samples (a zero of third order at the Nyquist frequency)."""
    near, far, halved = samples[0 : 2 * count], samples[2 : 2 * count + 2], out[0:count]  # or it will not vectorise
    for j in range(count):
        halved[j] = near[2 * j] + far[2 * j + 1] + np.float32(3) * (near[2 * j + 1] + far[2 * j])


@njit(**_KERNEL)
def _mix(samples: Singles, stride: int, taps_re: Singles, taps_im: Singles, z_re: Singles, z_im: Singles) -> None:
    """Filter one batch to its complex baseband, shapes (BATCH,): 0.13 ns a sample of input.

    Four outputs share each load of the taps; the taps' number is a whole number of vectors, so that none is left over.
    """
    length = taps_re.shape[0]
    for j in range(0, BATCH, 4):
        x0 = samples[j * stride : j * stride + length]
        x1 = samples[(j + 1) * stride : (j + 1) * stride + length]
        x2 = samples[(j + 2) * stride : (j + 2) * stride + length]
        x3 = samples[(j + 3) * stride : (j + 3) * stride + length]
        re0, re1, re2, re3 = np.float32(0), np.float32(0), np.float32(0), np.float32(0)
        im0, im1, im2, im3 = np.float32(0), np.float32(0), np.float32(0), np.float32(0)
        for k in range(length):
            a, b = taps_re[k], taps_im[k]
            re0 += a * x0[k]
            im0 += b * x0[k]
            re1 += a * x1[k]
            im1 += b * x1[k]
            re2 += a * x2[k]
            im2 += b * x2[k]
            re3 += a * x3[k]
            im3 += b * x3[k]
        z_re[j], z_re[j + 1], z_re[j + 2], z_re[j + 3] = re0, re1, re2, re3
        z_im[j], z_im[j + 1], z_im[j + 2], z_im[j + 3] = im0, im1, im2, im3


@njit(**_KERNEL)
def _turn(z_re: Singles, z_im: Singles, turn: Singles, power: Singles) -> None:
    """Write the angle in cycles (-0.5..0.5) and |z|^2 of one batch; polynomial arctangent, 1e-7 cycles, 0.3 ns."""
    for j in range(BATCH):
        re, im = z_re[j], z_im[j]
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
    """Take the nominal oscillator off and add whole cycles, counted as an integer; phase in cycles, shape (BATCH,).

    ``state`` = [whole cycles so far, fractional phase of the sample before].  A step is taken to be the one nearest
    to this batch's oscillator, ``steps``.  Oscillators are exact: integers modulo PHASE_STEPS.  Differences are taken
    side by side, only the integer sum is sequential.
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
def _read(
    flat: Counts,
    channels: int,
    column: int,
    samples: int,
    carry: Counts,
    carried: int,
    offset: np.float32,
    decimation: int,
    halved: bool,
    need: int,
    taps_re: Singles,
    taps_im: Singles,
    oscillators: NDArray[np.int64],
    guide: NDArray[np.int32],
    nominal: int,
    first: int,
    state: Floats,
    scratch: Singles,
    halves: Singles,
    lanes: Singles,
    slips: NDArray[np.int32],
    phase: Floats,
    power: Singles,
) -> tuple[int, int]:
    """Run every whole batch that ``carry`` and ``flat`` together hold; return (outputs, samples used up).

    Batch b (absolute) is mixed with oscillator ``guide[b]``, the last entry serving all later ones.  About 0.5 ns a
    sample at 30 MS/s and a decimation of 30; nothing is allocated.
    """
    step = BATCH * decimation
    used, done = 0, 0
    while carried + samples - used >= need:
        old = max(0, min(carried - used, need))
        if old > 0:
            _take(carry, 1, 0, used, old, offset, scratch)
        if old < need:
            _take(flat, channels, column, used + old - carried, need - old, offset, scratch[old:])
        which = guide[min((first + done) // BATCH, guide.shape[0] - 1)]
        if halved:
            _halve(scratch, need // 2 - 1, halves)
            _mix(halves, decimation // 2, taps_re[which], taps_im[which], lanes[0], lanes[1])
        else:
            _mix(scratch, decimation, taps_re[which], taps_im[which], lanes[0], lanes[1])
        _turn(lanes[0], lanes[1], lanes[2], power[done : done + BATCH])
        _unwrap(lanes[2], first + done, nominal, oscillators[which], state, slips, phase[done : done + BATCH])
        used += step
        done += BATCH
    return done, used


@dataclass(frozen=True, slots=True, eq=False)
class Guide:
    """Which oscillator reads which batch: ``steps`` (g,) in PHASE_STEPS, ``batch`` (b,) an index into them."""

    steps: NDArray[np.int64]
    batch: NDArray[np.int32]

    @property
    def nominal(self) -> int:
        """Get the oscillator that phases are given relative to."""
        return int(self.steps[self.steps.size // 2])


def fixed_guide(tuning: Tuning, frequency_hz: float) -> Guide:
    """Return the guide of a beat that stays near one frequency."""
    return Guide(np.array([tuning.steps(frequency_hz)], np.int64), np.zeros(1, np.int32))


def following_guide(
    tuning: Tuning, sample: NDArray[np.int64], frequency_hz: Floats, samples: int, spacing_hz: float
) -> Guide:
    """Return the guide of a beat seen at ``frequency_hz`` (n,) at ``sample`` (n,): straight lines, rounded.

    ``samples`` is the recording's length, ``spacing_hz`` the distance between oscillators.
    """
    batches = samples // (BATCH * tuning.decimation) + 1
    centre = (np.arange(batches) + 0.5) * (BATCH * tuning.decimation)
    wanted = np.interp(centre, sample, frequency_hz)
    rounded = np.rint(wanted / spacing_hz).astype(np.int64)
    values, batch = np.unique(rounded, return_inverse=True)
    steps = np.array([tuning.steps(float(v) * spacing_hz) for v in values], np.int64)
    return Guide(steps, batch.reshape(-1).astype(np.int32))


class BeatReader:
    """Reads the phase of one beat from interleaved counts, block by block.

    Output m (absolute) is the phase of samples m D .. m D + L - 1 about their centre, so that a reader started
    elsewhere in the record (``start_sample`` after a gap) stays on the same grid.
    """

    def __init__(
        self, tuning: Tuning, guide: Guide, column: int, offset_counts: float = 0.0, start_sample: int = 0
    ) -> None:
        self.tuning = tuning
        self.guide = guide
        self.column = column
        self._offset = np.float32(offset_counts)
        taps = tuning.taps(guide.steps)
        padded = -(-taps.shape[1] // _VECTOR) * _VECTOR
        self._taps_re = np.zeros((guide.steps.size, padded), dtype=np.float32)
        self._taps_im = np.zeros((guide.steps.size, padded), dtype=np.float32)
        self._taps_re[:, : taps.shape[1]] = taps.real
        self._taps_im[:, : taps.shape[1]] = taps.imag
        self._need = (BATCH - 1) * tuning.decimation + tuning.length
        self.index = -(-start_sample // tuning.decimation)  # of the next output
        self._skip = self.index * tuning.decimation - start_sample
        self._carry = np.zeros(self._need + BATCH * tuning.decimation, dtype=np.int16)
        self._carried = 0
        self._state = np.zeros(2)
        self._scratch = np.zeros(self._need + _VECTOR, dtype=np.float32)
        self._halves = np.zeros(self._need // 2 + _VECTOR if tuning.halved else 1, dtype=np.float32)
        self._lanes = np.empty((3, BATCH), dtype=np.float32)
        self._slips = np.empty(BATCH, dtype=np.int32)
        self._phase = np.empty(0)
        self._power = np.empty(0, dtype=np.float32)

    @property
    def oscillator_hz(self) -> float:
        """Get the frequency in Hz whose phase is taken off the beat's."""
        return self.tuning.oscillator_hz(self.guide.nominal)

    def feed(self, counts: Counts) -> tuple[int, Floats, Singles]:
        """Take counts of shape (n, channels); return (index of the first output, phase in cycles, |z|^2).

        The phase is the beat's less the oscillator's (``oscillator_hz`` times the time of each window's centre).
        Both arrays, shape (m,), are views of the reader's own memory, valid until the next call.
        """
        if self._skip:
            dropped = min(self._skip, counts.shape[0])
            self._skip -= dropped
            counts = counts[dropped:]
        return self._run(counts, self.column)

    def finish(self) -> tuple[int, Floats, Singles]:
        """Return the outputs that whole windows of samples still allow; the reader is done afterwards."""
        left = max(0, (self._carried - self.tuning.length) // self.tuning.decimation + 1)
        first, phase, power = self._run(np.zeros((self._need, 1), dtype=np.int16), 0)
        return first, phase[:left], power[:left]

    def _run(self, counts: Counts, column: int) -> tuple[int, Floats, Singles]:
        samples, channels = counts.shape
        flat = np.asarray(np.ascontiguousarray(counts)).reshape(-1).view()
        flat.flags.writeable = False  # one compiled kernel for recordings, maps and buffers alike
        most = ((self._carried + samples) // (BATCH * self.tuning.decimation) + 1) * BATCH
        if self._phase.size < most:
            self._phase = np.empty(most)
            self._power = np.empty(most, dtype=np.float32)
        first = self.index
        done, used = _read(
            flat, channels, column, samples, self._carry, self._carried, self._offset, self.tuning.decimation,
            self.tuning.halved, self._need, self._taps_re, self._taps_im, self.guide.steps, self.guide.batch,
            self.guide.nominal, first, self._state, self._scratch, self._halves, self._lanes, self._slips, self._phase,
            self._power,
        )  # fmt: skip
        kept_old = max(0, self._carried - used)
        if kept_old:
            self._carry[:kept_old] = self._carry[used : self._carried].copy()
        fresh = counts[max(0, used - self._carried) :, column]
        self._carry[kept_old : kept_old + fresh.size] = fresh
        self._carried = kept_old + fresh.size
        self.index += done
        return first, self._phase[:done], self._power[:done]
