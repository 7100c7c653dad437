"""Estimate and remove cross-talk of PD1 in PD0: the moving beat's frequency in the rest beat.

Cross-talk modulates PD0's phase at the Doppler frequency; as that passes through zero, it looks like the phase jump of
a lost sample.  Cables, amplifiers and boards couple linearly within a sample or two, so a few filter taps on PD1
describe it.  PD0's beat in PD1 acts like a leak of light and is removed as one (``phase_errors``).
"""

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from analysis.shot import Floats
from analysis.signal.survey import Survey

CROSS_TALK_REMOVED, CROSS_TALK_LEFT = "cross_talk_removed", "cross_talk"  # flags
BLOCK, MAX_BLOCKS = 1024, 256  # samples of a block, and blocks examined at most
REMOVED_ABOVE = 0.01  # relative to PD0's amplitude
LEFT_ABOVE = 0.02  # relative to PD0's amplitude, after removal: the coupling is then not linear
_BATCH = 64  # blocks of 32 KiB; with fewer the allocator maps later arrays anew: demodulation takes 20 % longer
_MAX_LAG = 1  # samples: taps at -1, 0 and 1
_MIN_SEPARATION_BINS = 6.0  # frequency bins of a block by which PD1's beat must differ from PD0's to be separable
_MIN_BLOCKS = 8
_FAULTY_BLOCK_RATIO = 4.0  # times the usual residual: a block with a lost sample or a flash
_SLOW_HZ = 20e3  # largest drift of a rest beat within a shot
_MIN_POWER = 1e-12  # of a combination of lags, relative to the strongest: less is rounding
_AT_REST_SHARE = 0.1  # a beat is at rest if its frequency span is below this share of the other channel's


@dataclass(frozen=True, slots=True)
class CrossTalk:
    """Cross-talk of PD1 in PD0: ``taps`` (3,) at lags of -1, 0, 1 samples, and amplitudes relative to PD0's beat."""

    taps: Floats
    ratio: float
    left: float  # the amplitude that the taps do not describe


def swapped_cables_span_hz(measurement: Survey, reference: Survey) -> float | None:
    """Return the frequency span in Hz of PD0's beat if it moves and PD1's does not (swapped cables), else None."""
    spans = []
    for seen in (measurement, reference):
        low, high = np.percentile(seen.frequency_hz[seen.seen], (5, 95))
        spans.append(float(high - low))
    moved = spans[1]
    return moved if moved > _SLOW_HZ and spans[0] < _AT_REST_SHARE * moved else None


def find_cross_talk(
    reference: NDArray[np.int16], moving: NDArray[np.int16], rest: Survey, beat: Survey, sample_rate_hz: float
) -> CrossTalk | None:
    """Return the cross-talk of ``moving`` in ``reference``, both (n,), or None if it is negligible.

    PD0's own tone is removed from stretches in which the moving body moves, and PD0's residual is fitted with PD1.
    """
    turns = float(np.median(rest.frequency_hz[rest.seen])) / sample_rate_hz
    at = np.interp(beat.sample, rest.sample[rest.seen], rest.frequency_hz[rest.seen])
    away = np.abs(beat.frequency_hz - at) > _MIN_SEPARATION_BINS * sample_rate_hz / BLOCK
    clear = beat.sample[beat.seen & away]
    clear = clear[(clear >= _MAX_LAG) & (clear + BLOCK + _MAX_LAG <= reference.size)]
    if clear.size < _MIN_BLOCKS:
        return None
    starts = clear[np.linspace(0, clear.size - 1, min(clear.size, MAX_BLOCKS)).astype(np.int64)]
    tone = _tone(turns)
    some = (starts[first : first + _BATCH] for first in range(0, starts.size, _BATCH))
    products = np.concatenate([_products(_blocks(reference, moving, at), tone) for at in some])
    taps = _solve_taps(products)
    remainder = _squares(products, np.append(taps, -1.0))
    sound = remainder <= _FAULTY_BLOCK_RATIO**2 * np.median(remainder)
    if sound.sum() < _MIN_BLOCKS:
        return None
    taps = _solve_taps(products[sound])
    amplitude = rest.amplitude_counts
    size = float(np.sqrt(2.0 / BLOCK * np.mean(_squares(products[sound], np.append(taps, 0.0)))))
    if size < REMOVED_ABOVE * amplitude:
        return None
    blocks = _blocks(reference, moving, starts[sound])
    return CrossTalk(taps, size / amplitude, _residual_ratio(blocks - (blocks @ tone) @ tone.T, taps, amplitude))


def without_cross_talk(reference: NDArray[np.int16], moving: NDArray[np.int16], found: CrossTalk) -> NDArray[np.int16]:
    """Return ``reference``, (n,), minus ``moving`` filtered with the taps."""
    mean = float(moving[:: max(1, moving.size // 4096)].mean())
    beat = np.pad(moving.astype(np.float32) - np.float32(mean), _MAX_LAG, mode="edge")
    out = reference.astype(np.float32)
    for tap, lag in zip(found.taps, range(-_MAX_LAG, _MAX_LAG + 1), strict=True):
        out -= np.float32(tap) * beat[_MAX_LAG - lag : beat.size - _MAX_LAG - lag]
    return np.clip(np.rint(out), -32768, 32767).astype(np.int16)


def _blocks(reference: NDArray[np.int16], moving: NDArray[np.int16], starts: NDArray[np.int64]) -> Floats:
    """Return blocks that begin at ``starts`` (m,): PD1 at each lag, then PD0; shape (m, lags + 1, BLOCK)."""
    blocks = np.empty((starts.size, 2 * _MAX_LAG + 2, BLOCK))
    for column, lag in enumerate(range(-_MAX_LAG, _MAX_LAG + 1)):
        blocks[:, column] = sliding_window_view(moving, BLOCK)[starts - lag]
    blocks[:, -1] = sliding_window_view(reference, BLOCK)[starts]
    return blocks


def _tone(turns: float) -> Floats:
    """Return an orthonormal basis (BLOCK, 5) of an offset and of a tone near ``turns`` cycles per sample."""
    n = np.arange(BLOCK) - 0.5 * (BLOCK - 1)
    wave = np.exp(2j * np.pi * turns * n)
    drift = n / BLOCK  # of the tone's frequency and amplitude
    columns = [wave.real, wave.imag, drift * wave.real, drift * wave.imag, np.ones(BLOCK)]
    return np.asarray(np.linalg.qr(np.stack(columns, axis=1))[0])


def _products(blocks: Floats, tone: Floats) -> Floats:
    """Return the scalar products of each block's rows after removal of ``tone``, shape (m, lags + 1, lags + 1)."""
    along = blocks @ tone
    return np.asarray(blocks @ blocks.swapaxes(1, 2) - along @ along.swapaxes(1, 2))


def _squares(products: Floats, weights: Floats) -> Floats:
    """Return the sum of squares of each block's rows combined with ``weights``, shape (m,)."""
    return np.asarray(np.einsum("mij,i,j->m", products, weights, weights))


def _solve_taps(products: Floats) -> Floats:
    """Return the taps by least squares over all blocks; combinations of lags with negligible power get zero."""
    total = products.sum(axis=0)
    return np.asarray(np.linalg.pinv(total[:-1, :-1], rcond=_MIN_POWER, hermitian=True) @ total[:-1, -1])


def _residual_ratio(blocks: Floats, taps: Floats, amplitude: float) -> float:
    """Return the residual amplitude of PD1's beat, at any phase, relative to PD0's: 90th percentile over the blocks.

    Blocks are examined separately, as the residual of a coupling that varies within the shot averages to zero.
    """
    remainder = blocks[:, -1] - taps @ blocks[:, :-1]
    beat = blocks[:, _MAX_LAG]
    turned = np.fft.fft(beat)
    turned[:, BLOCK // 2 :] = 0.0
    analytic = 2.0 * np.fft.ifft(turned)
    power = np.sum(np.abs(analytic) ** 2, axis=1)
    gain = 2.0 * np.abs(np.sum(remainder * np.conj(analytic), axis=1)) / power
    size = gain * np.sqrt(power / BLOCK) / amplitude
    noise = 3.0 * np.std(remainder) * np.sqrt(2.0 / BLOCK) / amplitude
    return float(np.percentile(np.maximum(size - noise, 0.0), 90))
