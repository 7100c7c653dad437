"""Unbroken stretches of driven records, force and motion through one low-pass, and all compared samples in a table.

Derivatives of the displacement are known in a limited band only.  Force and every law's force therefore pass the same
low-pass as displacement, velocity and acceleration ("parallel filtering" in the identification of robots: M. Gautier,
1997; A. Janot, P.-O. Vandanjon, M. Gautier, IEEE Trans. Control Syst. Technol. 22, 2014).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from analysis.drive.bandwidth import bandwidth_of
from analysis.shot import AnalysisError, Cancelled, Floats, Motion, Stop
from analysis.signal import stretches as unbroken

if TYPE_CHECKING:
    from analysis.drive.catalogue import Law

Mask = NDArray[np.bool_]
MIN_SAMPLES = 200
STANDSTILL_SIGMAS = 5.0
OVERSAMPLED = 3.0  # sample rate kept, in units of the bandwidth; further samples would only be interpolated
LONGEST_DELAY = 0.5  # longest delay between force and motion that is searched, in 1 / bandwidth
_KAISER = 5.65  # 60 dB
_HALF_LENGTH = 3.0  # half length of the low-pass, in 1 / bandwidth
_LOST = 3.0 * _HALF_LENGTH + 2.0 * LONGEST_DELAY  # lost at each end of a stretch to the filters, in 1 / bandwidth
_MAX_CACHED = 40  # column sets of laws kept per table


@dataclass(frozen=True, slots=True, eq=False)
class Stretch:
    """One unbroken stretch of a record; arrays of shape (n,), evenly sampled, not thinned.

    Displacement, velocity and acceleration are low-passed at ``bandwidth_hz``; ``force_n`` is as measured, and
    ``smooth`` passes it, or the force of a law, through the same low-pass.  ``used``, shape (m,), holds the indices of
    the compared samples; ``record`` is the index of the record.
    """

    time_s: Floats
    displacement_m: Floats
    velocity_m_per_s: Floats
    acceleration_m_per_s2: Floats
    force_n: Floats
    used: NDArray[np.int64]
    step: int  # every ``step``-th sample is compared
    sample_rate_hz: float
    bandwidth_hz: float
    record: int

    def smooth(self, column: Floats, later_s: float = 0.0) -> Floats:
        """Return a column (n,) after the low-pass at the samples used (m,), delayed by ``later_s``."""
        from scipy.signal import upfirdn  # slow import (all of scipy.stats): not at every start

        taps = low_pass(self.sample_rate_hz, self.bandwidth_hz, later_s)
        thinned = upfirdn(taps, np.concatenate([column, np.zeros(taps.size // 2)]), 1, self.step)
        return np.asarray(thinned[(self.used + taps.size // 2) // self.step])


@lru_cache(maxsize=64)
def low_pass(sample_rate_hz: float, bandwidth_hz: float, later_s: float = 0.0) -> Floats:
    """Return the taps of the low-pass of force and motion, shape (2 half + 1,), delayed by ``later_s``."""
    reach = max(4, int(np.ceil(_HALF_LENGTH * sample_rate_hz / bandwidth_hz)))
    moved = later_s * sample_rate_hz
    half = reach + int(np.ceil(LONGEST_DELAY * sample_rate_hz / bandwidth_hz))
    at = np.arange(-half, half + 1) - moved
    inside = np.clip(1.0 - (at / reach) ** 2, 0.0, None)
    window = np.i0(_KAISER * np.sqrt(inside)) * (np.abs(at) <= reach)
    taps = np.sinc(2.0 * bandwidth_hz / sample_rate_hz * at) * window
    return np.asarray(taps / taps.sum())


@lru_cache(maxsize=16)
def derived(sample_rate_hz: float, bandwidth_hz: float) -> tuple[Floats, Floats]:
    """Return the taps, each (2 half + 1,), that turn a displacement into velocity (1/s) and acceleration (1/s^2).

    Their response is that of ``low_pass`` times i w and (i w)^2, within about 1e-6 due to truncation.  The derivative
    filters of a motion are flatter than that low-pass, by 5e-3 near their edge.  With a force of high signal-to-noise
    ratio, this difference would appear as a delay or as an additional mass.
    """
    taps = low_pass(sample_rate_hz, bandwidth_hz)
    length = 8 * taps.size
    turn = 2.0j * np.pi * np.fft.rfftfreq(length, 1.0 / sample_rate_hz)
    half = taps.size  # twice the half length of the low-pass
    spectrum = np.fft.rfft(np.roll(np.pad(taps, (0, length - taps.size)), -(taps.size // 2)))
    # beyond the low-pass's length only an alternating tail remains, which is tapered
    beyond = np.clip((np.abs(np.arange(-half, half + 1)) - taps.size // 2) / (half - taps.size // 2), 0.0, None)
    soft = np.cos(0.5 * np.pi * beyond) ** 2
    velocity, acceleration = (
        soft * np.roll(np.fft.irfft(spectrum * factor, length), half)[: 2 * half + 1] for factor in (turn, turn**2)
    )
    return np.asarray(velocity), np.asarray(acceleration - acceleration.mean())


def prepare(motions: Sequence[Motion]) -> tuple[Stretch, ...]:
    """Return the stretches of all records, at the narrowest of the records' bandwidths.

    Raises AnalysisError if a record has no measured force, no motion, or too few samples.
    """
    for motion in motions:
        if not motion.force_measured:
            raise AnalysisError("force_n: no such column; a driven slider needs the measured force")
        known = motion.force_n[np.isfinite(motion.force_n)]
        if known.size == 0 or float(np.ptp(known)) == 0.0:
            raise AnalysisError("force_n: the force is the same throughout; nothing is driven by it")
    bandwidth_hz = min(bandwidth_of(motion) for motion in motions)
    made = [stretch for index, motion in enumerate(motions) for stretch in _stretches_of(motion, index, bandwidth_hz)]
    count = sum(stretch.used.size for stretch in made)
    whole = sum(round(stretch.used.size * stretch.sample_rate_hz / (OVERSAMPLED * bandwidth_hz)) for stretch in made)
    if count < 20 or whole < MIN_SAMPLES:
        raise AnalysisError(
            f"some {whole} samples of motion under force are too few to fit a slider (at least {MIN_SAMPLES}, "
            f"not counting {_LOST / bandwidth_hz:.3g} s at each end that the filter of {bandwidth_hz:.3g} Hz takes)"
        )
    return tuple(stretch for stretch in made if stretch.used.size)


def _stretches_of(motion: Motion, record: int, bandwidth_hz: float) -> list[Stretch]:
    rate = motion.sample_rate_hz
    filters = derived(rate, bandwidth_hz)
    half = int(np.ceil(_HALF_LENGTH * rate / bandwidth_hz))
    from scipy.signal import fftconvolve  # slow import (all of scipy.stats): not at every start

    edge = filters[0].size // 2 + half
    velocity_gain = float(np.linalg.norm(filters[0]))
    noise_m = float(np.nanmedian(motion.displacement_std_m))
    step = max(1, int(rate / (OVERSAMPLED * bandwidth_hz)))
    taps = low_pass(rate, bandwidth_hz)
    out = []
    for start, stop in unbroken(np.isfinite(motion.displacement_m) & np.isfinite(motion.force_n)):
        piece = slice(start, stop)
        x = motion.displacement_m[piece]
        place, velocity, acceleration = (
            np.asarray(fftconvolve(x - x[0], each, mode="same")) for each in (taps, *filters)
        )
        place += x[0]
        moves = _in_motion(np.abs(velocity) > STANDSTILL_SIGMAS * velocity_gain * noise_m, half)
        moves[:edge] = moves[-edge:] = False
        used = np.arange(-(taps.size // 2) % step, stop - start, step)  # the outputs of a decimating filter
        columns = (motion.time_s[piece], place, velocity, acceleration, motion.force_n[piece])
        time_s, place, velocity, acceleration, force = (np.asarray(c, dtype=np.float64) for c in columns)
        out.append(
            Stretch(time_s, place, velocity, acceleration, force, used[moves[used]], step, rate, bandwidth_hz, record)
        )  # fmt: skip
    return out


def _in_motion(moves: NDArray[np.bool_], half: int) -> NDArray[np.bool_]:
    """Return the mask of samples beyond the filter's reach of any standstill longer than it; reversals stay in."""
    out = np.ones(moves.shape, dtype=np.bool_)
    for start, stop in unbroken(~moves):
        if stop - start > half:
            out[max(0, start - half) : stop + half] = False
    return out


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """The compared samples of all stretches, m in total; arrays of shape (m,).

    ``earlier`` marks the first half of each record, which a diagnosis fits to predict the other.  ``stop`` is called at
    every evaluation of a fit; if it returns True, Cancelled is raised.
    """

    stretches: tuple[Stretch, ...]
    time_s: Floats
    displacement_m: Floats
    velocity_m_per_s: Floats
    acceleration_m_per_s2: Floats
    record: NDArray[np.int64]
    earlier: Mask
    stop: Stop
    _seen: dict[tuple[str, tuple[float, ...]], Floats] = field(default_factory=dict)

    @classmethod
    def of(cls, stretches: Sequence[Stretch], stop: Stop = lambda: False) -> Table:
        def all_of(name: str) -> Floats:
            return np.concatenate([getattr(stretch, name)[stretch.used] for stretch in stretches])

        record = np.concatenate([np.full(stretch.used.size, stretch.record) for stretch in stretches])
        time_s, earlier = all_of("time_s"), np.zeros(record.size, dtype=np.bool_)
        for of in (record == one for one in np.unique(record)):
            earlier |= of & (time_s < 0.5 * (time_s[of].min() + time_s[of].max()))
        return cls(
            tuple(stretches), time_s, all_of("displacement_m"), all_of("velocity_m_per_s"),
            all_of("acceleration_m_per_s2"), record, earlier, stop,
        )  # fmt: skip

    def raise_if_cancelled(self) -> None:
        if self.stop():
            raise Cancelled

    def force(self, later_s: float = 0.0) -> Floats:
        """Return the filtered measured force, shape (m,), delayed by ``later_s``."""
        return self._cached("", (later_s,), lambda stretch: (stretch.force_n,), later_s)[:, 0]

    def columns(self, law: Law, nonlinear: tuple[float, ...]) -> Floats:
        """Return the filtered force of a law per unit of each of its k linear parameters, shape (m, k)."""
        make = law.force
        assert make is not None
        return self._cached(law.name, nonlinear, lambda stretch: make(stretch, nonlinear))

    def base(self) -> Floats:
        """Return the regressors of mass, drag and offset, shape (m, 3)."""
        return np.stack([self.acceleration_m_per_s2, self.velocity_m_per_s, np.ones(self.time_s.size)], axis=1)

    def _cached(self, name: str, at: tuple[float, ...], make, later_s: float = 0.0) -> Floats:  # type: ignore[no-untyped-def]
        found = self._seen.pop((name, at), None)
        if found is None:
            found = np.concatenate([np.stack([s.smooth(c, later_s) for c in make(s)], axis=1) for s in self.stretches])
        self._seen[name, at] = found
        while len(self._seen) > _MAX_CACHED:
            self._seen.pop(next(iter(self._seen)))
        return found
