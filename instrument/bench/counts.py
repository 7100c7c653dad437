"""The kernel that turns a path into the int16 counts of the photodiodes, fast enough for real time.

Noise is a function of seed and sample index, so a stream does not depend on the lengths of its blocks.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.special import ndtri

Floats = NDArray[np.float64]

# columns of the parameter array
(
    TURNS_PER_SAMPLE,
    START_TURNS,
    REFERENCE_A,
    REFERENCE_OFFSET,
    REFERENCE_SIGMA,
    MEASUREMENT_A,
    MEASUREMENT_OFFSET,
    MEASUREMENT_SIGMA,
    LEAK,
    LEAK_ORDER,
    LEAK_TURNS,
    SWITCH_LOW,
    SWITCH_HIGH,
    SWITCH_SIGMA,
    SWITCH_X,
    SWITCH_WIDTH,
    LOWEST,
    HIGHEST,
) = range(18)
PARAMETERS = 18

_BITS = 12
_MASK = np.uint64((1 << _BITS) - 1)


def _gauss_table() -> NDArray[np.float32]:
    quantiles = ndtri((np.arange(1 << _BITS) + 0.5) / (1 << _BITS))
    table: NDArray[np.float32] = (quantiles / np.sqrt(2.0 * np.mean(quantiles**2))).astype(np.float32)
    return table


GAUSS = _gauss_table()  # the sum of two independent draws has variance one


def _cosine_series(terms: int) -> tuple[float, ...]:
    """Return the Taylor coefficients of cos(2 pi b) in b^2."""
    series = [1.0]
    for k in range(1, terms):
        series.append(-series[-1] * (2.0 * math.pi) ** 2 / ((2 * k - 1) * 2 * k))
    return tuple(series)


_C0, _C1, _C2, _C3, _C4, _C5, _C6 = _cosine_series(7)


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _cos_turns(turns: float) -> float:
    """Return cos(2 pi turns) by a Taylor series about the nearest half turn: error below 2e-8, and it vectorises."""
    half = 0.5 * np.floor(2.0 * turns + 0.5)  # math.floor gives an integer, whose conversions do not vectorise
    sign = 1.0 - 4.0 * (half - np.floor(half))
    b = turns - half
    s = b * b
    return float(sign * (_C0 + s * (_C1 + s * (_C2 + s * (_C3 + s * (_C4 + s * (_C5 + s * _C6)))))))


# products and sums in one instruction where the processor has it: this changes the last bit of a double, and the
# beats are float32 afterwards
@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def _beat(offset, amplitude, phase, places, out):  # type: ignore[no-untyped-def]
    """Fill ``out`` (m,) with a beat; amplitude and phase (turns) are polynomials in the samples' ``places``, 0 to 1.

    Cost: about 0.6 ns per sample.
    """
    a0, a1 = amplitude
    p0, p1, p2, p3 = phase
    for i in range(out.shape[0]):
        u = places[i]  # to turn the index into a float takes as long as the polynomial
        out[i] = offset + (a0 + a1 * u) * _cos_turns(p0 + u * (p1 + u * (p2 + u * p3)))


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def _add_beat(amplitude, phase, places, out):  # type: ignore[no-untyped-def]
    """Add a beat to ``out``; arguments as of ``_beat``."""
    a0, a1 = amplitude
    p0, p1, p2, p3 = phase
    for i in range(out.shape[0]):
        u = places[i]
        out[i] += (a0 + a1 * u) * _cos_turns(p0 + u * (p1 + u * (p2 + u * p3)))


# one loop each for what gathers, what computes and what interleaves: together they would not vectorise
@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _draw(drawn, shift, draws, gauss, noise) -> None:  # type: ignore[no-untyped-def]
    """Fill ``noise`` (m,) with the sum of one or two draws, from the bits of ``drawn`` that begin at ``shift``."""
    if draws == 1:
        for i in range(noise.shape[0]):
            noise[i] = gauss[(drawn[i] >> shift) & _MASK]
    else:
        for i in range(noise.shape[0]):
            z = drawn[i] >> shift
            noise[i] = gauss[z & _MASK] + gauss[(z >> np.uint64(_BITS)) & _MASK]


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _to_counts(level, sigma, noise, rails, out) -> int:  # type: ignore[no-untyped-def]
    """Round ``level`` plus noise into ``out`` (m,), limited to the rails; return the number of limited samples."""
    lowest, highest = rails
    beyond = 0
    for i in range(out.shape[0]):
        value = level[i] + sigma * noise[i]
        within = min(max(value, lowest), highest)
        beyond += int(within != value)  # no branch, so that it vectorises
        out[i] = np.int16(np.int32(np.floor(within + np.float32(0.5))))
    return beyond


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _interleave(rows, out) -> None:  # type: ignore[no-untyped-def]
    """Copy ``rows`` (channels, m or more) into ``out`` (m, channels)."""
    m, channels = out.shape
    if channels == 3:  # a spacing that is known vectorises: 0.1 ns per sample, not 0.6
        flat = out.reshape(out.size)
        for i in range(m):
            flat[3 * i], flat[3 * i + 1], flat[3 * i + 2] = rows[0, i], rows[1, i], rows[2, i]
    else:
        for c in range(channels):
            for i in range(m):
                out[i, c] = rows[c, i]


class PathNodes(NamedTuple):
    """The path at nodes of equal spacing, arrays of shape (nodes,); slopes are per segment.

    ``path_turns`` is 2 x / lambda, subtracted from the rest beat (block inward: beat above rest); ``rest_turns`` is the
    laser's deviation from a steady rest beat; ``light`` scales the measurement beat.
    """

    path_turns: Floats
    path_slope: Floats
    rest_turns: Floats
    rest_slope: Floats
    light: Floats
    position_m: Floats


@njit(cache=True, nogil=True, error_model="numpy")
def fill_counts(
    first_sample: int,
    per_segment: int,
    nodes: PathNodes,
    p: Floats,
    noise: tuple[int, NDArray[np.float32]],
    columns: tuple[int, int, int],
    out: NDArray[np.int16],
    clipped: NDArray[np.int64],
) -> None:
    """Fill ``out`` (n, channels) with counts of the samples from ``first_sample`` on.

    Node j is at sample ``first_sample + j * per_segment``.  ``noise`` is the seed and GAUSS, ``columns`` are those of
    reference, measurement and switch in ``out``, -1 when not recorded.  Clipped samples are added to ``clipped``
    (channels,).  Cost: about 4 ns per sample of three channels.
    """
    path_turns, path_slope, rest_turns, rest_slope, light, position_m = nodes
    seed, gauss = noise
    reference, measurement, switch = columns
    n = out.shape[0]
    ref = np.empty(per_segment, np.float32)
    mea = np.empty(per_segment, np.float32)
    swi = np.empty(per_segment, np.float32)
    drawn = np.empty(per_segment, np.uint64)
    noisy = np.empty(per_segment, np.float32)
    rows = np.empty((out.shape[1], per_segment), np.int16)
    rails = np.float32(p[LOWEST]), np.float32(p[HIGHEST])
    s_ref, s_mea = np.float32(p[REFERENCE_SIGMA]), np.float32(p[MEASUREMENT_SIGMA])
    s_swi = np.float32(p[SWITCH_SIGMA] * math.sqrt(2.0))
    a_ref, o_ref = p[REFERENCE_A], p[REFERENCE_OFFSET]
    o_mea = p[MEASUREMENT_OFFSET]
    step = p[TURNS_PER_SAMPLE]
    inverse = 1.0 / per_segment
    places = np.arange(per_segment) * inverse
    segments = (n + per_segment - 1) // per_segment
    for j in range(segments):
        begin = j * per_segment
        m = min(per_segment, n - begin)
        # cubic Hermite of both phases, as polynomials in u = i / per_segment
        d = path_turns[j + 1] - path_turns[j]
        p0, p1 = path_turns[j] - math.floor(path_turns[j]), path_slope[j]
        p2 = 3.0 * d - 2.0 * path_slope[j] - path_slope[j + 1]
        p3 = path_slope[j] + path_slope[j + 1] - 2.0 * d
        d = rest_turns[j + 1] - rest_turns[j]
        start = p[START_TURNS] + step * begin + rest_turns[j]
        r0, r1 = start - math.floor(start), rest_slope[j] + step * per_segment
        r2 = 3.0 * d - 2.0 * rest_slope[j] - rest_slope[j + 1]
        r3 = rest_slope[j] + rest_slope[j + 1] - 2.0 * d
        a0 = p[MEASUREMENT_A] * light[j]
        a1 = p[MEASUREMENT_A] * (light[j + 1] - light[j])
        if reference >= 0:
            _beat(o_ref, (a_ref, 0.0), (r0, r1, r2, r3), places, ref[:m])
        _beat(o_mea, (a0, a1), (r0 - p0, r1 - p1, r2 - p2, r3 - p3), places, mea[:m])
        if p[LEAK] != 0.0:  # light in the wrong arm: a second beat, harmonic of the path
            w = p[LEAK_ORDER] - 1.0
            base = path_turns[j] * w
            base -= math.floor(base)
            turns = r0 + base + p[LEAK_TURNS], r1 + w * p1, r2 + w * p2, r3 + w * p3
            _add_beat((p[LEAK] * a0, p[LEAK] * a1), turns, places, mea[:m])
        if switch >= 0:
            e0 = (position_m[j] - p[SWITCH_X]) / p[SWITCH_WIDTH]
            e1 = (position_m[j + 1] - p[SWITCH_X]) / p[SWITCH_WIDTH]
            swing = p[SWITCH_HIGH] - p[SWITCH_LOW]
            if min(abs(e0), abs(e1)) > 6.0 and (e0 > 0.0) == (e1 > 0.0):
                level = np.float32(p[SWITCH_LOW] + (swing if e0 < 0.0 else 0.0))
                for i in range(m):
                    swi[i] = level
            else:
                for i in range(m):
                    e = e0 + (e1 - e0) * (i * inverse)
                    swi[i] = p[SWITCH_LOW] + swing * 0.5 * math.erfc(e)
        for i in range(m):
            z = np.uint64(seed) + np.uint64(first_sample + begin + i) * np.uint64(0x9E3779B97F4A7C15)
            z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
            z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
            drawn[i] = z ^ (z >> np.uint64(31))
        if reference >= 0:
            _draw(drawn, np.uint64(0), 2, gauss, noisy[:m])
            clipped[reference] += _to_counts(ref, s_ref, noisy, rails, rows[reference, :m])
        _draw(drawn, np.uint64(24), 2, gauss, noisy[:m])
        clipped[measurement] += _to_counts(mea, s_mea, noisy, rails, rows[measurement, :m])
        if switch >= 0:
            _draw(drawn, np.uint64(48), 1, gauss, noisy[:m])
            _to_counts(swi, s_swi, noisy, rails, rows[switch, :m])
        _interleave(rows, out[begin : begin + m])
