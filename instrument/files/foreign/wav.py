"""Reads WAV files: channels by number, the rate from the header."""

import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from instrument.files.foreign.contents import ForeignChannel, ForeignColumn, ForeignContents, checked_channels
from instrument.files.recording_error import RecordingError, one_line


def contents(path: Path) -> ForeignContents:
    """Return the channels, named "channel 1" and so on.  Raises RecordingError."""
    rate, values = _read(path)
    channels = [
        ForeignChannel(f"channel {n + 1}", values.shape[0], str(values.dtype), "", rate) for n in range(values.shape[1])
    ]
    return ForeignContents(path, "wav", checked_channels(path, channels))


def columns(path: Path, names: Sequence[str]) -> list[ForeignColumn]:
    """Return the named channels; the full scale of integers is 1 V unless the mapping states another."""
    rate, values = _read(path)
    chosen = [values[:, int(name.removeprefix("channel ")) - 1] for name in names]
    return [ForeignColumn(column, None, 0.0, rate) for column in chosen]


def _read(path: Path) -> tuple[float, NDArray[np.floating[Any]] | NDArray[np.integer[Any]]]:
    """Return rate and samples, shape (n, channels), memory-mapped if the width of the numbers allows it."""
    from scipy.io import wavfile  # imported late: scipy.io is slow to import

    for mapped in (True, False):  # 24-bit samples and truncated files cannot be mapped
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", wavfile.WavFileWarning)
                rate, values = wavfile.read(path, mmap=mapped)
        except Exception as error:  # the reader raises many kinds on a damaged file
            cause = one_line(str(error), 100) or type(error).__name__
            continue
        if rate <= 0 or values.size == 0 or values.dtype.kind not in "iuf":
            raise RecordingError(path, "holds no samples")
        return float(rate), values.reshape(values.shape[0], -1)
    raise RecordingError(path, f"not a WAV file that can be read ({cause})")
