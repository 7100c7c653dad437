"""Fit a free flight by a polynomial, with its velocity at any instant; average both flights in bins."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from analysis.reading.floor_spectrum import waves_of
from analysis.shot import Floats, Motion
from analysis.signal import MIN_NOISE_M, white_noise

Mask = NDArray[np.bool_]

LONGEST_FLIGHT_S = 0.040  # longest flight used on each side: a longer one adds drift, not information
MIN_SAMPLES = 400  # samples used in a slow record, even if that is longer
SHORTEST_CURVED_S = 0.003  # flight below which only a straight line is fitted
BIN_S = 0.5e-3  # shortest bin: a line of 900 Hz still passes
MAX_BINS = 110


@dataclass(frozen=True, slots=True)
class Flight:
    """A polynomial through the displacement of a free flight, about ``time_zero_s``.

    ``coefficients`` are position, velocity, half acceleration, ... (SI), with ``covariance``.  ``noise_std_m`` is the
    white noise of one sample.
    """

    time_zero_s: float
    coefficients: Floats
    covariance: Floats
    noise_std_m: float
    first: int
    last: int

    @property
    def acceleration_m_per_s2(self) -> float:
        """Get the flight's constant acceleration; 0 if the flight was too short to fit one."""
        return 2.0 * float(self.coefficients[2]) if self.coefficients.size > 2 else 0.0

    def position_m(self, time_s: Floats) -> Floats:
        """Return the flight's displacement in m, extrapolated to any times in s."""
        return np.asarray(np.polynomial.polynomial.polyval(time_s - self.time_zero_s, self.coefficients))

    def velocity(self, time_s: float) -> tuple[float, float]:
        """Return velocity and its standard deviation in m/s at one time in s."""
        tau = time_s - self.time_zero_s
        powers = np.arange(self.coefficients.size)
        row = np.where(powers > 0, powers * tau ** np.maximum(powers - 1, 0), 0.0)
        return float(row @ self.coefficients), float(np.sqrt(row @ self.covariance @ row))


def fit_flight(motion: Motion, first: int, last: int, *, nearest: int, curved: bool = False) -> Flight | None:
    """Fit the flight between samples ``first`` and ``last`` (inclusive), with time zero at sample ``nearest``.

    The fit is quadratic if the flight is long enough, so that drag and tilt do not bias the velocity at its end, or if
    ``curved``; else straight.  All noise is taken as white.  None with fewer than 4 valid samples.
    """
    index = np.arange(max(first, 0), min(last, motion.time_s.size - 1) + 1)
    index = index[motion.valid[index] & np.isfinite(motion.displacement_m[index])]
    if index.size < 4:
        return None
    zero = float(motion.time_s[min(max(nearest, 0), motion.time_s.size - 1)])
    tau = motion.time_s[index] - zero
    degree = 2 if (curved or tau[-1] - tau[0] >= SHORTEST_CURVED_S) and index.size >= 12 else 1
    falling, covariance = np.polyfit(tau, motion.displacement_m[index], degree, cov="unscaled")
    residual = motion.displacement_m[index] - np.polyval(falling, tau)
    freedom = max(index.size - degree - 1, 1)
    stated = float(np.nanmedian(motion.displacement_std_m[index]))
    std = float(np.sqrt(residual @ residual / freedom)) if freedom >= 8 else stated
    covariance = covariance[::-1, ::-1] * max(std, 1e-30) ** 2
    return Flight(zero, falling[::-1], covariance, std, int(index[0]), int(index[-1]))


@dataclass(frozen=True, slots=True)
class Bins:
    """The displacement of both free flights in bins of about half a millisecond, shorter than vibration periods."""

    time_s: Floats
    value_m: Floats
    into: Mask  # of the incoming flight
    each: int  # samples per bin
    step_s: float  # between samples
    std_m: float  # white noise of a bin

    @property
    def resolution_hz(self) -> float:
        """Get the smallest distance of two lines that can be resolved."""
        return 1.0 / (float(np.ptp(self.time_s)) + self.each * self.step_s)

    @property
    def middle_s(self) -> float:
        """Get the time origin of the waves."""
        return 0.5 * float(self.time_s[0] + self.time_s[-1])

    def waves(self, frequency_hz: Floats) -> tuple[Floats, Floats]:
        """Return cosines and sines, each (n, f), averaged over the bins."""
        return waves_of(self.time_s - self.middle_s, self.each, self.step_s, frequency_hz)


def binned(motion: Motion, into: tuple[int, int], out: tuple[int, int] | None) -> Bins:
    """Return bins of both flights, of equal length, counted outwards from the contact; bins with holes are left out."""
    step = 1.0 / motion.sample_rate_hz
    total = into[1] - into[0] + 1 + (out[1] - out[0] + 1 if out is not None else 0)
    each = max(1, round(BIN_S / step), -(-total // MAX_BINS))
    pieces = []
    for first, last, backwards in ((*into, True), *(((*out, False),) if out is not None else ())):
        count = (last - first + 1) // each
        start = last + 1 - count * each if backwards else first
        pieces.append((start, count))
    time, value, side, thirds = [], [], [], []
    for number, (start, count) in enumerate(pieces):
        stretch = slice(start, start + count * each)
        x = motion.displacement_m[stretch]
        rows = x.reshape(count, each)
        whole = np.isfinite(rows).all(axis=1) & motion.valid[stretch].reshape(count, each).all(axis=1)
        time.append(motion.time_s[stretch].reshape(count, each).mean(axis=1)[whole])
        value.append(rows[whole].mean(axis=1))
        side.append(np.full(int(whole.sum()), number == 0))
        third = np.diff(x, 3)
        thirds.append(third[np.isfinite(third)])
    third = np.concatenate(thirds)
    stated = float(np.nanmedian(motion.displacement_std_m))
    white = white_noise(third) if third.size > 30 else stated
    return Bins(
        np.concatenate(time), np.concatenate(value), np.concatenate(side), each, step,
        max(white, MIN_NOISE_M) / np.sqrt(each),
    )  # fmt: skip


def select(bins: Bins, keep: Mask) -> Bins:
    return replace(bins, time_s=bins.time_s[keep], value_m=bins.value_m[keep], into=bins.into[keep])
