"""Compute the photodiodes' int16 counts from a path, fast enough for real time.

Noise is a function of seed and sample index, so a stream does not depend on the lengths of its blocks.
"""

import math

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


# sin(2 pi s), s in turns, -1/4 to 1/4, in odd powers: least squares at the Chebyshev nodes, error below 4e-9
_S1, _S3, _S5, _S7, _S9 = np.array([6.28318516, -41.34165493, 81.60099819, -76.54965682, 39.53581371], np.float32)
_QUARTER, _HALF, _PER_TURN, _TURN = np.float32(0.25), np.float32(0.5), 2.0**32, np.float32(2.0**-32)
_LANES = 32  # samples that the processor computes at once; segments are padded to a multiple
_RUN = 1024  # samples whose noise is computed at a time


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _cos_turns(turns: float) -> float:
    """Return cos(2 pi turns) for float32 ``turns`` from -1/2 to 1/2: error below 3e-7."""
    s = _QUARTER - abs(turns)
    t = s * s
    return s * (_S1 + t * (_S3 + t * (_S5 + t * (_S7 + t * _S9))))  # type: ignore[no-any-return]


# "contract" allows fused multiply-add where the processor has it, which changes the last bit
@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def _fill_turns(phase, places, out):  # type: ignore[no-untyped-def]
    """Fill ``out`` (m,), float32, with a phase in turns, -1/2 to 1/2, at the samples' ``places`` (m,) in a segment.

    ``phase`` is the phase in turns at the first sample, its step per sample, and the factors of place^2 and place^3.
    The linear part is counted in 2^-32 turns, which wrap without error; float32 would have an error of 1e-5 rad.
    """
    p2, p3 = np.float32(phase[2]), np.float32(phase[3])
    turned = np.uint32(np.int64(math.floor((phase[0] - math.floor(phase[0])) * _PER_TURN)))
    step = np.uint32(np.int64(math.floor(phase[1] * _PER_TURN + 0.5)))
    for i in range(places.shape[0]):
        u = places[i]
        at = np.float32(np.int32(turned)) * _TURN + u * u * (p2 + u * p3)
        out[i] = at - np.floor(at + _HALF)
        turned = np.uint32(turned + step)


@njit(cache=True, nogil=True, error_model="numpy")
def _fill_line(first, last, places, out):  # type: ignore[no-untyped-def]
    """Fill ``out`` (m,) with the straight line from ``first`` to ``last``, float32."""
    start, rise = np.float32(first), np.float32(last - first)
    for i in range(places.shape[0]):
        out[i] = start + rise * places[i]


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def _add_beat(factor, light, turns, out):  # type: ignore[no-untyped-def]
    """Add the beat of amplitude ``factor`` times ``light`` and phase ``turns`` to ``out``; (m,), float32."""
    for i in range(out.shape[0]):
        out[i] += factor * light[i] * _cos_turns(turns[i])


# gathering, computing and interleaving need a loop each: a combined loop would not vectorise
@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _draw(drawn, shift, draws, gauss, noise) -> None:  # type: ignore[no-untyped-def]
    """Fill ``noise`` (m,) with one draw or the sum of two, from the bits of ``drawn`` that begin at ``shift``."""
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
    if channels == 3:  # a literal spacing is vectorised: 0.1 ns per sample, not 0.6
        flat = out.reshape(out.size)
        for i in range(m):
            flat[3 * i], flat[3 * i + 1], flat[3 * i + 2] = rows[0, i], rows[1, i], rows[2, i]
    else:
        for c in range(channels):
            for i in range(m):
                out[i, c] = rows[c, i]


@njit(cache=True, nogil=True, error_model="numpy")
def fill_counts(
    first_sample: int,
    per_segment: int,
    nodes: Floats,
    p: Floats,
    noise: tuple[int, NDArray[np.float32]],
    columns: tuple[int, int, int],
    out: NDArray[np.int16],
    clipped: NDArray[np.int64],
) -> None:
    """Fill ``out`` (n, channels) with counts of the samples from ``first_sample`` on.

    The rows of ``nodes`` (5, m) describe the path at samples ``first_sample + j * per_segment``: 2 x / lambda, which is
    subtracted from the rest beat (block inward: beat above rest); its slope per segment; the laser's deviation in turns
    from a steady rest beat, linear between nodes; the relative amplitude of the light; the block's position in m.
    ``noise`` is (seed, GAUSS).  ``columns`` are those of reference, measurement and switch in ``out``, -1 if absent.
    Clipped samples are added to ``clipped`` (channels,).  Cost: about 5 ns per sample of three channels.
    """
    seed, gauss = noise
    reference, measurement, switch = columns
    n = out.shape[0]
    run = per_segment * max(1, _RUN // per_segment)
    filled = -(-per_segment // _LANES) * _LANES  # samples filled per segment; the next one overwrites the excess
    places = (np.arange(filled) / per_segment).astype(np.float32)
    levels, work = np.empty((3, run + _LANES), np.float32), np.ones((5, run + _LANES), np.float32)
    drawn = np.empty(run, np.uint64)
    noisy = np.empty(run, np.float32)
    rows = np.empty((out.shape[1], run), np.int16)
    rails = np.float32(p[LOWEST]), np.float32(p[HIGHEST])
    s_ref, s_mea = np.float32(p[REFERENCE_SIGMA]), np.float32(p[MEASUREMENT_SIGMA])
    s_swi = np.float32(p[SWITCH_SIGMA] * math.sqrt(2.0))
    for begin in range(0, n, run):
        m = min(run, n - begin)
        _fill_levels(begin // per_segment, -(-m // per_segment), per_segment, nodes, p, places, work, levels)
        for i in range(m):
            z = np.uint64(seed) + np.uint64(first_sample + begin + i) * np.uint64(0x9E3779B97F4A7C15)
            z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
            z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
            drawn[i] = z ^ (z >> np.uint64(31))
        if reference >= 0:
            _draw(drawn, np.uint64(0), 2, gauss, noisy[:m])
            clipped[reference] += _to_counts(levels[0], s_ref, noisy, rails, rows[reference, :m])
        _draw(drawn, np.uint64(24), 2, gauss, noisy[:m])
        clipped[measurement] += _to_counts(levels[1], s_mea, noisy, rails, rows[measurement, :m])
        if switch >= 0:
            _draw(drawn, np.uint64(48), 1, gauss, noisy[:m])
            _to_counts(levels[2], s_swi, noisy, rails, rows[switch, :m])
        _interleave(rows, out[begin : begin + m])


@njit(cache=True, nogil=True, error_model="numpy")
def _fill_levels(first, segments, per_segment, nodes, p, places, work, levels) -> None:  # type: ignore[no-untyped-def]
    """Fill the noise-free ``levels`` (3, m) of PD0, PD1 and switch from node ``first`` on, in float32.

    ``work`` (5, m) receives the phases of both beats and of the leak, and the light; its last row holds ones.
    """
    path_turns, path_slope, rest_turns, light, position_m = nodes[0], nodes[1], nodes[2], nodes[3], nodes[4]
    rest, beat, leaked, lit, steady = work[0], work[1], work[2], work[3], work[4]
    switch = levels[2]
    swing = p[SWITCH_HIGH] - p[SWITCH_LOW]
    for segment in range(segments):
        j, piece = first + segment, slice(segment * per_segment, segment * per_segment + places.shape[0])
        # cubic Hermite of the path, as a polynomial in u = i / per_segment
        d = path_turns[j + 1] - path_turns[j]
        p0, p1 = path_turns[j], path_slope[j] / per_segment
        p2 = 3.0 * d - 2.0 * path_slope[j] - path_slope[j + 1]
        p3 = path_slope[j] + path_slope[j + 1] - 2.0 * d
        r0 = p[START_TURNS] + p[TURNS_PER_SAMPLE] * (j * per_segment) + rest_turns[j]
        r1 = (rest_turns[j + 1] - rest_turns[j]) / per_segment + p[TURNS_PER_SAMPLE]
        _fill_turns((r0, r1, 0.0, 0.0), places, rest[piece])
        _fill_turns((r0 - p0, r1 - p1, -p2, -p3), places, beat[piece])
        if p[LEAK]:
            w = p[LEAK_ORDER] - 1.0
            _fill_turns((r0 + w * p0 + p[LEAK_TURNS], r1 + w * p1, w * p2, w * p3), places, leaked[piece])
        _fill_line(light[j], light[j + 1], places, lit[piece])
        e0 = (position_m[j] - p[SWITCH_X]) / p[SWITCH_WIDTH]
        e1 = (position_m[j + 1] - p[SWITCH_X]) / p[SWITCH_WIDTH]
        if min(e0, e1) > 6.0:
            _fill_line(p[SWITCH_LOW], p[SWITCH_LOW], places, switch[piece])
        elif max(e0, e1) < -6.0:
            _fill_line(p[SWITCH_HIGH], p[SWITCH_HIGH], places, switch[piece])
        else:
            edge = switch[piece]
            for i in range(places.shape[0]):
                edge[i] = p[SWITCH_LOW] + swing * 0.5 * math.erfc(e0 + (e1 - e0) * places[i])
    levels[0, :] = np.float32(p[REFERENCE_OFFSET])
    _add_beat(np.float32(p[REFERENCE_A]), steady, rest, levels[0])
    levels[1, :] = np.float32(p[MEASUREMENT_OFFSET])
    _add_beat(np.float32(p[MEASUREMENT_A]), lit, beat, levels[1])
    if p[LEAK]:  # light leaking into the wrong arm adds a second beat, at a harmonic of the path's phase
        _add_beat(np.float32(p[LEAK] * p[MEASUREMENT_A]), lit, leaked, levels[1])
