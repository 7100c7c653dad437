"""How the channels look right now: the answers an operator wants before arming."""

import numpy as np
from numpy.typing import NDArray

from analysis.shot.recording import Channel, Role
from instrument.live.snapshot import ChannelSignal

CHECKED_SAMPLES = 8192
_LINE_HALF_WIDTH = 4  # bins that one line of the Hann window takes
_STANDS_OUT_DB = 3.0  # line against all noise together: in 4096 bins the greatest noise line is 20 dB below that


def check_signals(
    counts: NDArray[np.int16], channels: tuple[Channel, ...], sample_rate_hz: float, bits: int
) -> tuple[ChannelSignal, ...]:
    """Return how each channel looks in ``counts``, shape (n, channels), n at least 64; O(n log n)."""
    rail = 1 << (bits - 1)
    signals = []
    for column, channel in enumerate(channels):
        values = counts[:, column].astype(np.float64)
        clipped = float(np.mean((values >= rail - 1) | (values <= -rail)))
        scale = abs(channel.volts_per_count)
        if channel.role is Role.SWITCH:
            level = float(np.median(values)) * channel.volts_per_count + channel.offset_v
            signals.append(ChannelSignal(channel.role, level, clipped, None, None))
            continue
        frequency, snr = _strongest_line(values - values.mean(), sample_rate_hz)
        amplitude = float(values.std()) * np.sqrt(2.0) * scale
        signals.append(ChannelSignal(channel.role, float(amplitude), clipped, frequency, snr))
    return tuple(signals)


def _strongest_line(values: NDArray[np.float64], sample_rate_hz: float) -> tuple[float | None, float | None]:
    """Return (frequency in Hz, power against all the rest in dB) of the strongest line, None where none stands out."""
    power = np.abs(np.fft.rfft(values * np.hanning(values.size))) ** 2
    power[:_LINE_HALF_WIDTH] = 0.0
    peak = int(np.argmax(power))
    if power[peak] <= 0.0:
        return None, None
    low, high = max(0, peak - _LINE_HALF_WIDTH), peak + _LINE_HALF_WIDTH + 1
    line = float(power[low:high].sum())
    rest = float(power.sum()) - line
    snr = 10 * np.log10(line / max(rest, 1e-12 * line))
    if snr < -_STANDS_OUT_DB:
        return None, None
    offset = 0.0
    if 0 < peak < power.size - 1 and min(power[peak - 1], power[peak + 1]) > 0:
        left, middle, right = np.log(power[peak - 1 : peak + 2])
        if 2 * middle > left + right:
            offset = 0.5 * (left - right) / (left - 2 * middle + right)
    return float((peak + offset) * sample_rate_hz / values.size), float(snr)
