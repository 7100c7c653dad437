"""The channels of a foreign file, for every format."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from instrument.files.recording_error import RecordingError, one_line

Column: TypeAlias = NDArray[np.integer[Any]] | NDArray[np.floating[Any]]
MOST_SAMPLES = 2**26  # per channel: two seconds at 30 MS/s; a longer file is no shot
MOST_CHANNELS = 256
LARGEST_FILE_BYTES = 4 * 2**30


@dataclass(frozen=True, slots=True)
class ForeignChannel:
    """One channel as named in the file; ``unit`` and ``sample_rate_hz`` if the file states them."""

    name: str
    samples: int
    kind: str  # numpy's name of the stored number: "int16", "float64"
    unit: str = ""
    sample_rate_hz: float | None = None


@dataclass(frozen=True, slots=True)
class ForeignContents:
    """The channels of a file in its order; ``flags`` as in a recording ("truncated")."""

    path: Path
    format: str
    channels: tuple[ForeignChannel, ...]
    started_at: str | None = None
    flags: tuple[str, ...] = ()

    def channel(self, name: str) -> ForeignChannel:
        """Return the channel of that name.  Raises RecordingError, which lists the channels."""
        for channel in self.channels:
            if channel.name == name:
                return channel
        shown = ", ".join(repr(c.name) for c in self.channels[:8])
        raise RecordingError(self.path, f"no channel {one_line(repr(name), 60)}; it holds {shown or 'none'}")


@dataclass(frozen=True, slots=True)
class ForeignColumn:
    """One channel's stored numbers, shape (n,), and their scale in volts if the file states it."""

    values: Column
    volts_per_unit: float | None = None
    offset_v: float = 0.0
    sample_rate_hz: float | None = None


def checked_channels(path: Path, channels: Sequence[ForeignChannel]) -> tuple[ForeignChannel, ...]:
    """Return at most ``MOST_CHANNELS`` of the channels.  Raises RecordingError if one is too long or there is none."""
    if not channels:
        raise RecordingError(path, "holds no channel of numbers")
    for channel in channels:
        if channel.samples > MOST_SAMPLES:
            cause = f"{channel.samples} samples, more than {MOST_SAMPLES}"
            raise RecordingError(path, cause, one_line(channel.name, 60))
    return tuple(channels[:MOST_CHANNELS])


def missing_package(path: Path, package: str, extra: str) -> RecordingError:
    """Return the error for a format whose reader is not installed."""
    return RecordingError(path, f"reading it needs {package}: pip install 'levimass[{extra}]'")
