"""What each channel of a foreign file looks like: level, beat, how far it moves; and whether two are swapped.

Looked at in an errand, over the beginning of the record: a beat that moves is PD1's, one that stands still PD0's, two
levels are the light switch's, and a column that rises by one a row is the export's own counter.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from analysis.shot.recording import Role
from analysis.shot.shot import Shot
from instrument.files.foreign import csv_table, hdf5, tdms, wav
from instrument.files.foreign.contents import ForeignChannel, ForeignColumn, ForeignContents

LOOKED_AT = 2**22  # samples of a channel
PARTS, PART = 48, 4096  # stretches over the record in which the beat is looked for, and their length at most
MOVES = 0.02  # of its frequency: a beat that changes by less stands still
LINE = 12.0  # times the median power: less is no beat
Floats = NDArray[np.float64]
COLUMNS = {"hdf5": hdf5.columns, "tdms": tdms.columns, "wav": wav.columns}


class Kind(StrEnum):
    """What a channel looks like."""

    MOVING = "beat that moves"
    STILL = "beat at rest"
    SWITCH = "two levels"
    COUNTER = "counts its rows"
    FLAT = "flat"
    OTHER = "no beat"


@dataclass(frozen=True, slots=True)
class ChannelLook:
    """``amplitude`` in the file's own unit; frequencies in Hz, or in parts of the sample rate where none is stated."""

    name: str
    kind: Kind
    amplitude: float
    low: float | None = None  # of the beat over the record
    high: float | None = None
    in_hz: bool = False


def looks_of(held: ForeignContents) -> tuple[ChannelLook, ...]:
    """Return what a file's channels look like.  Raises RecordingError, and whatever a spoilt file's library raises."""
    names = [channel.name for channel in held.channels]
    return tuple(_look(c, column) for c, column in zip(held.channels, _columns(held, names), strict=True))


def proposed(looks: Sequence[ChannelLook]) -> Mapping[Role, str]:
    """Return which channel each role probably has; a role that nothing fits is left out.

    The beat that moves furthest is PD1's, the one that moves least PD0's; where none moves nothing tells them apart.
    """
    found: dict[Role, str] = {}
    beats = [look for look in looks if look.kind in (Kind.MOVING, Kind.STILL)]
    beats.sort(key=lambda look: (look.high or 0.0) - (look.low or 0.0))
    if beats and beats[-1].kind is Kind.MOVING:
        found[Role.MEASUREMENT] = beats[-1].name
    if len(beats) > 1 and Role.MEASUREMENT in found:
        found[Role.REFERENCE] = beats[0].name
    switch = next((look for look in looks if look.kind is Kind.SWITCH), None)
    if switch is not None:
        found[Role.SWITCH] = switch.name
    return found


def _columns(held: ForeignContents, names: Sequence[str]) -> list[ForeignColumn]:
    if held.format == "csv":
        return csv_table.columns(held.path, names, False)
    return COLUMNS[held.format](held.path, names)


def _look(channel: ForeignChannel, column: ForeignColumn) -> ChannelLook:
    values = np.asarray(column.values[:LOOKED_AT], dtype=np.float64)
    values = values[np.isfinite(values)]
    if values.size < 64:
        return ChannelLook(channel.name, Kind.OTHER, 0.0)
    amplitude = float(np.std(values)) * 2.0**0.5
    if amplitude == 0.0:
        return ChannelLook(channel.name, Kind.FLAT, 0.0)
    steps = np.diff(values)
    if np.all(steps > 0) and float(np.ptp(steps)) <= 1e-6 * float(np.mean(steps)) * values.size:
        return ChannelLook(channel.name, Kind.COUNTER, amplitude)
    if _two_levels(values):
        return ChannelLook(channel.name, Kind.SWITCH, amplitude)
    rate = column.sample_rate_hz or channel.sample_rate_hz
    lines = _lines(values) * (rate or 1.0)
    if lines.size < 3:
        return ChannelLook(channel.name, Kind.OTHER, amplitude, in_hz=rate is not None)
    low, high = float(lines.min()), float(lines.max())
    kind = Kind.MOVING if high - low > MOVES * float(np.median(lines)) else Kind.STILL
    return ChannelLook(channel.name, kind, amplitude, low, high, rate is not None)


def _two_levels(values: Floats) -> bool:
    """Return whether nearly all samples lie at one of two levels, with few changes between them."""
    middle, half = 0.5 * (values.min() + values.max()), 0.5 * float(np.ptp(values))
    away = np.abs(values - middle)
    changes = int(np.count_nonzero(np.diff(values > middle)))
    return bool(np.mean(away > 0.6 * half) > 0.98 and changes < max(8, values.size // 2000))


def _lines(values: Floats) -> Floats:
    """Return the strongest line of each stretch in which there is one, in parts of the sample rate, shape (m,)."""
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
        if power[top] > LINE * float(np.median(power[2:])) and 1 < top < power.size - 1:
            a, b, c = np.log(np.maximum(power[top - 1 : top + 2], 1e-300))
            shift = 0.5 * (a - c) / (a - 2 * b + c) if a - 2 * b + c < 0 else 0.0
            found.append((top + shift) / length)
    return np.array(found)


WORD = "swapped"  # of what the demodulation says where PD0's beat moves and PD1's stands still


def is_swapped(shot: Shot | None) -> bool:
    """Return whether a shot was not analysed because its PD0 and PD1 are swapped."""
    return shot is not None and shot.problem is not None and WORD in shot.problem
