"""Guess the role of each channel of a foreign file: varying beat (PD1), constant beat (PD0), two levels (switch).

Only the beginning of the record is used.  A column that rises by the same step in each row is a row counter.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from analysis.shot import Floats, Role
from instrument.files import ForeignChannel, ForeignColumn, ForeignContents, foreign_columns

USED_SAMPLES = 2**22  # samples used of each channel
PARTS, PART = 48, 4096  # number of parts searched for a beat, and their greatest length in samples
MIN_VARIATION = 0.02  # least relative change of frequency of a varying beat
MIN_LINE_POWER = 12.0  # least power of a beat's spectral line, in units of the median power


class ChannelKind(StrEnum):
    """The kind of signal in a channel."""

    MOVING = "beat, varying frequency"
    STILL = "beat, constant frequency"
    SWITCH = "two levels"
    COUNTER = "row counter"
    FLAT = "flat"
    OTHER = "no beat"


@dataclass(frozen=True, slots=True)
class ChannelSummary:
    """Signal in one channel: ``amplitude`` in the file's unit, beat in Hz or in units of an unknown sample rate."""

    name: str
    kind: ChannelKind
    amplitude: float
    low: float | None = None  # lowest frequency of the beat
    high: float | None = None
    in_hz: bool = False


def summarise_channels(contents: ForeignContents) -> tuple[ChannelSummary, ...]:
    """Return the kind of signal in each channel of a file.  Raises RecordingError; for a damaged file any error."""
    names = [channel.name for channel in contents.channels]
    return tuple(
        _summary(c, column) for c, column in zip(contents.channels, foreign_columns(contents, names), strict=True)
    )


def proposed_roles(looks: Sequence[ChannelSummary]) -> Mapping[Role, str]:
    """Return the probable channel of each role; a role without a channel is left out.

    PD1 is the beat whose frequency varies most, PD0 the one that varies least; if none varies, both are left out.
    """
    found: dict[Role, str] = {}
    beats = [look for look in looks if look.kind in (ChannelKind.MOVING, ChannelKind.STILL)]
    beats.sort(key=lambda look: (look.high or 0.0) - (look.low or 0.0))
    if beats and beats[-1].kind is ChannelKind.MOVING:
        found[Role.MEASUREMENT] = beats[-1].name
    if len(beats) > 1 and Role.MEASUREMENT in found:
        found[Role.REFERENCE] = beats[0].name
    switch = next((look for look in looks if look.kind is ChannelKind.SWITCH), None)
    if switch is not None:
        found[Role.SWITCH] = switch.name
    return found


def _summary(channel: ForeignChannel, column: ForeignColumn) -> ChannelSummary:
    values = np.asarray(column.values[:USED_SAMPLES], dtype=np.float64)
    values = values[np.isfinite(values)]
    if values.size < 64:
        return ChannelSummary(channel.name, ChannelKind.OTHER, 0.0)
    amplitude = float(np.std(values)) * 2.0**0.5
    if amplitude == 0.0:
        return ChannelSummary(channel.name, ChannelKind.FLAT, 0.0)
    steps = np.diff(values)
    if np.all(steps > 0) and float(np.ptp(steps)) <= 1e-6 * float(np.mean(steps)) * values.size:
        return ChannelSummary(channel.name, ChannelKind.COUNTER, amplitude)
    if _two_levels(values):
        return ChannelSummary(channel.name, ChannelKind.SWITCH, amplitude)
    rate = column.sample_rate_hz or channel.sample_rate_hz
    lines = _lines(values) * (rate or 1.0)
    if lines.size < 3:
        return ChannelSummary(channel.name, ChannelKind.OTHER, amplitude, in_hz=rate is not None)
    low, high = float(lines.min()), float(lines.max())
    kind = ChannelKind.MOVING if high - low > MIN_VARIATION * float(np.median(lines)) else ChannelKind.STILL
    return ChannelSummary(channel.name, kind, amplitude, low, high, rate is not None)


def _two_levels(values: Floats) -> bool:
    """Return whether nearly all samples are at one of two levels, with few transitions between them."""
    middle, half = 0.5 * (values.min() + values.max()), 0.5 * float(np.ptp(values))
    away = np.abs(values - middle)
    changes = int(np.count_nonzero(np.diff(values > middle)))
    return bool(np.mean(away > 0.6 * half) > 0.98 and changes < max(8, values.size // 2000))


def _lines(values: Floats) -> Floats:
    """Return the frequency of the strongest line of each part that has one, in units of the sample rate, (m,)."""
    length = min(PART, values.size // 8)
    if length < 32:
        return np.empty(0)
    starts = np.linspace(0, values.size - length, PARTS).astype(int)
    window = np.hanning(length)
    found = []
    for start in starts:
        part = values[start : start + length]
        power = np.abs(np.fft.rfft((part - part.mean()) * window)) ** 2
        power[:2] = 0.0
        top = int(np.argmax(power))
        if power[top] > MIN_LINE_POWER * float(np.median(power[2:])) and 1 < top < power.size - 1:
            a, b, c = np.log(np.maximum(power[top - 1 : top + 2], 1e-300))
            shift = 0.5 * (a - c) / (a - 2 * b + c) if a - 2 * b + c < 0 else 0.0
            found.append((top + shift) / length)
    return np.array(found)
