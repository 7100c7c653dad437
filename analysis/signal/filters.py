"""The filters from phase to force: a decimating low-pass, and the derivatives of displacement.

All are linear and without delay (taps symmetric or antisymmetric about the centre sample), so ``derivatives`` distorts
a model's displacement exactly as the measured one.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from analysis.shot import Floats

HALF_POWER_SHARE = 0.5  # of the output rate: the decimator's 3 dB point, which keeps decimated noise white
FLAT_SHARE = 0.3  # of the output rate: below it the decimator is flat (0.1 %; the band-pass before it droops by 2 %)
MAX_BANDWIDTH_SHARE = 0.35  # of the motion rate: the widest valid bandwidth of the derivative filters
_HALF_LENGTH = 3.0  # of the derivative filters, in 1 / bandwidth
_KAISER = 5.65  # 60 dB
_EDGE_DEGREE = 3


@lru_cache(maxsize=32)
def decimator_taps(factor: int, spread: float) -> Floats:
    """Return the symmetric low-pass, shape (12 factor + 1,), that decimates a phase by ``factor``.

    It is a Kaiser-windowed sinc with its half-power point at half the output rate: its power response and the mirror
    image of that response add up to one there, so white phase noise stays white.  ``spread`` is the second moment, in
    inputs squared, of the preceding smoothing, and is compensated: cubics pass both filters unchanged (factor > 2).
    """
    half = 6 * factor
    n = np.arange(-half, half + 1)
    u = n / half
    window = np.kaiser(2 * half + 1, 6.2)
    low, high = 0.4, 0.6
    taps = window
    for _ in range(40):
        cut = 0.5 * (low + high)
        sinc = np.sinc(2 * cut * n / factor) * window
        taps = (
            sinc / sinc.sum()
            if factor == 2
            else _with_moments(u, (sinc, sinc * u**2), (0, 2), (1.0, -spread / half**2))
        )
        if np.sum(taps * np.cos(2 * np.pi * HALF_POWER_SHARE / factor * n)) > np.sqrt(0.5):
            high = cut
        else:
            low = cut
    return _frozen(taps)


@dataclass(frozen=True, slots=True)
class Derivatives:
    """The derivative filters of one motion rate and bandwidth.

    ``velocity`` and ``acceleration`` have shape (2 half + 1,), in order of time; their dot product with the
    displacement around a sample is in m/s and m/s^2.  The ``edge_*`` matrices, shape (half, 2 half + 1), give the
    first ``half`` samples of a stretch from its first 2 half + 1 samples.
    """

    half: int
    velocity: Floats
    acceleration: Floats
    edge_velocity: Floats
    edge_acceleration: Floats

    @property
    def velocity_gain(self) -> float:
        """Get the standard deviation of velocity per white standard deviation of displacement, in 1/s."""
        return float(np.sqrt(np.sum(self.velocity**2)))

    @property
    def acceleration_gain(self) -> float:
        """Get the standard deviation of acceleration per white standard deviation of displacement, in 1/s^2."""
        return float(np.sqrt(np.sum(self.acceleration**2)))


@lru_cache(maxsize=32)
def derivative_filters(sample_rate_hz: float, bandwidth_hz: float) -> Derivatives:
    """Return derivative filters: flat to 0.6 ``bandwidth_hz``, half amplitude near it, 60 dB down beyond 1.5 of it.

    They are the first and second derivative of a sinc low-pass, Kaiser-windowed and adjusted to be exact for
    polynomials up to the fourth (velocity) and fifth degree (acceleration): no bias from jerk.

    Raises ValueError if the sample rate is too low for the bandwidth.
    """
    if not 0 < bandwidth_hz <= MAX_BANDWIDTH_SHARE * sample_rate_hz * (1 + 1e-9):
        raise ValueError(
            f"bandwidth {bandwidth_hz:g} Hz: a motion rate of {sample_rate_hz:g} Hz carries at most "
            f"{MAX_BANDWIDTH_SHARE * sample_rate_hz:g} Hz"
        )
    half = max(4, int(np.ceil(_HALF_LENGTH * sample_rate_hz / bandwidth_hz)))
    n = np.arange(-half, half + 1)
    window = np.kaiser(2 * half + 1, _KAISER)
    x = 2 * np.pi * bandwidth_hz / sample_rate_hz * n
    safe = np.where(n == 0, 1.0, x)
    first = np.where(n == 0, 0.0, (np.cos(x) - np.sin(safe) / safe) / safe)
    second = np.where(n == 0, -1 / 3, -(np.sin(x) + 2 * (np.cos(x) - np.sin(safe) / safe) / safe) / safe)
    odd = -first * window  # minus, as the taps are used in a dot product, not a convolution
    even = second * window
    low = np.sinc(x / np.pi) * window
    u = n / half
    slope = sample_rate_hz / half  # change of u per second
    velocity = _with_moments(u, (odd, odd * u**2), (1, 3), (slope, 0.0))
    acceleration = _with_moments(u, (even, low, low * u**2), (0, 2, 4), (0.0, 2 * slope**2, 0.0))
    edge_velocity, edge_acceleration = _edge_filters(2 * half + 1, half, sample_rate_hz)
    return Derivatives(
        half, _frozen(velocity), _frozen(acceleration), _frozen(edge_velocity), _frozen(edge_acceleration)
    )


def derivatives(displacement_m: Floats, sample_rate_hz: float, bandwidth_hz: float) -> tuple[Floats, Floats]:
    """Return (velocity in m/s, acceleration in m/s^2), both shape (n,), of a displacement of shape (n,).

    A Motion is made with these filters.  NaN in the displacement separates stretches; nothing is padded.  Within half a
    filter length of a stretch's ends (0.3 ms at 10 kHz) the value is that of a cubic fitted to the outermost filter
    length; ``derivative_gains`` gives its larger noise.  A stretch shorter than a filter length becomes NaN.
    """
    filters = derivative_filters(float(sample_rate_hz), float(bandwidth_hz))
    displacement = np.asarray(displacement_m, dtype=np.float64)
    velocity = np.full(displacement.shape, np.nan)
    acceleration = np.full(displacement.shape, np.nan)
    length, half = 2 * filters.half + 1, filters.half
    for start, stop in stretches(np.isfinite(displacement)):
        if stop - start < length:
            continue
        piece = displacement[start:stop] - displacement[start]
        for out, taps, edge, sign in (
            (velocity, filters.velocity, filters.edge_velocity, -1.0),
            (acceleration, filters.acceleration, filters.edge_acceleration, 1.0),
        ):
            out[start + half : stop - half] = np.convolve(piece, taps[::-1], mode="valid")
            out[start : start + half] = edge @ piece[:length]
            out[stop - half : stop] = sign * (edge @ piece[: -length - 1 : -1])[::-1]
    return velocity, acceleration


def derivative_gains(
    finite: NDArray[np.bool_], sample_rate_hz: float, bandwidth_hz: float, walk: bool = False
) -> tuple[Floats, Floats]:
    """Return the noise gains (1/s, 1/s^2) of each sample of ``derivatives``, shape (n,); NaN where that returns NaN.

    A gain times the white standard deviation of displacement is the standard deviation of velocity or acceleration.
    With ``walk`` the gains (1/s^0.5, 1/s^1.5) apply to a random walk, per m/s^0.5 of its growth.
    """
    filters = derivative_filters(float(sample_rate_hz), float(bandwidth_hz))
    half = filters.half
    out = []
    for taps, edge_taps in (
        (filters.velocity, filters.edge_velocity),
        (filters.acceleration, filters.edge_acceleration),
    ):
        inner, edge = _gain(taps[None, :], sample_rate_hz, walk)[0], _gain(edge_taps, sample_rate_hz, walk)
        gain = np.full(finite.shape, np.nan)
        for start, stop in stretches(finite):
            if stop - start < 2 * half + 1:
                continue
            gain[start:stop] = inner
            gain[start : start + half] = edge
            gain[stop - half : stop] = edge[::-1]
        out.append(gain)
    return out[0], out[1]


def _gain(rows: Floats, sample_rate_hz: float, walk: bool) -> Floats:
    if walk:  # each step of a random walk shifts all later samples
        rows = np.cumsum(rows[:, ::-1], axis=1) / np.sqrt(sample_rate_hz)
    return np.asarray(np.sqrt(np.sum(rows**2, axis=1)))


def stretches(finite: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return (start, stop) of every run of True in an array of shape (n,)."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], finite, [False])).astype(np.int8)))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def first_run(mask: NDArray[np.bool_], length: int) -> int | None:
    """Return the first index at which ``length`` consecutive elements are True, or None."""
    count = np.cumsum(np.concatenate([[0], ~mask]))
    clear = np.flatnonzero(count[length:] == count[:-length])
    return int(clear[0]) if clear.size else None


def _with_moments(u: Floats, shapes: tuple[Floats, ...], powers: tuple[int, ...], moments: tuple[float, ...]) -> Floats:
    """Return the linear combination of ``shapes`` whose moments sum(shape u^power) are ``moments``."""
    basis = np.stack(shapes)
    weights = np.linalg.solve(np.stack([basis @ u**power for power in powers]), np.array(moments))
    return np.asarray(weights @ basis)


def _edge_filters(length: int, rows: int, sample_rate_hz: float) -> tuple[Floats, Floats]:
    position = np.linspace(-1.0, 1.0, length)
    scale = 2.0 / (length - 1)
    powers = position[:, None] ** np.arange(_EDGE_DEGREE + 1)
    solve = np.linalg.pinv(powers)
    at = position[:rows]
    zero, one = np.zeros_like(at), np.ones_like(at)
    slope = np.stack([zero, one, 2 * at, 3 * at**2], axis=1) * (scale * sample_rate_hz)
    curvature = np.stack([zero, zero, 2 * one, 6 * at], axis=1) * (scale * sample_rate_hz) ** 2
    return slope @ solve, curvature @ solve


def _frozen(array: Floats) -> Floats:
    array.flags.writeable = False
    return array
