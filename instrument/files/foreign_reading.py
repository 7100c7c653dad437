"""Read a foreign file as a recording, using its mapping, and list its channels; includes the WAV reader."""

import os
import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from analysis.shot import Channel, Recording, Role
from instrument.files import csv_table, foreign_hdf5, foreign_tdms
from instrument.files.foreign_file import (
    FORMATS,
    LARGEST_FILE_BYTES,
    MAX_SAMPLES,
    Column,
    ForeignChannel,
    ForeignColumn,
    ForeignContents,
    ForeignMapping,
    MappedChannel,
    checked_channels,
    format_of,
)
from instrument.files.recording_error import RecordingError
from instrument.files.recording_file import CLIPPED_SHARE
from instrument.files.text_file import open_regular
from instrument.trigger import LightSwitch, TriggerSettings

Result = TypeVar("Result")


def _wav_contents(path: Path) -> ForeignContents:
    """Return the channels, named "channel 1" and so on.  Raises RecordingError."""
    rate, values = _read_wav(path)
    samples, width = values.shape
    channels = [ForeignChannel(f"channel {n + 1}", samples, str(values.dtype), "", rate) for n in range(width)]
    return ForeignContents(path, "wav", checked_channels(path, channels))


def _wav_columns(path: Path, names: Sequence[str]) -> list[ForeignColumn]:
    """Return the named channels; the full scale of integers is 1 V unless the mapping states another."""
    rate, values = _read_wav(path)
    chosen = [values[:, int(name.removeprefix("channel ")) - 1] for name in names]
    return [ForeignColumn(column, sample_rate_hz=rate) for column in chosen]


def _read_wav(path: Path) -> tuple[float, Column]:
    """Return rate and samples, shape (n, channels), memory-mapped if the number format allows it."""
    from scipy.io import wavfile  # imported late: scipy.io is slow to import

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", wavfile.WavFileWarning)
        try:
            rate, values = wavfile.read(path, mmap=True)
        except Exception:  # 24-bit samples and truncated files cannot be mapped
            rate, values = wavfile.read(path)
    if not (rate and values.size) or values.dtype.kind not in "iuf":
        raise RecordingError(path, "holds no samples")
    return float(rate), values.reshape(values.shape[0], -1)


_CONTENTS: dict[str, Callable[[Path], ForeignContents]] = {
    "tdms": foreign_tdms.contents,
    "hdf5": foreign_hdf5.contents,
    "wav": _wav_contents,
    "csv": csv_table.contents,
}
_COLUMNS = {"hdf5": foreign_hdf5.columns, "tdms": foreign_tdms.columns, "wav": _wav_columns}


def foreign_channels(path: Path | str) -> ForeignContents:
    """Return the channels of a foreign file, without their samples.  Raises RecordingError."""
    path = Path(path)
    return _call_reader(path, _CONTENTS[_format(path)], path)


def foreign_columns(contents: ForeignContents, names: Sequence[str]) -> list[ForeignColumn]:
    """Return the samples of the named channels of a foreign file.  A damaged file may raise any exception."""
    if contents.format == "csv":
        return csv_table.columns(contents.path, names, False)
    return _COLUMNS[contents.format](contents.path, names)


def read_foreign(path: Path | str, mapping: ForeignMapping) -> Recording:
    """Return a foreign file as a recording, with the channels in the mapping's order.

    Integers of 8 and 16 bits are kept as counts; wider numbers are rounded to 16 bits over the range they span.
    Without a ``trigger_sample`` the first step of the light switch, if recorded, is the trigger.  Channels of different
    lengths are cut to the shortest, with flag "unequal".  Raises RecordingError.
    """
    path = Path(path)
    kind = _format(path)
    if mapping.format != kind:
        raise RecordingError(path, f"its mapping is for {mapping.format}, this is {kind}")
    contents = foreign_channels(path)
    names = [contents.channel(channel.name).name for channel in mapping.channels]
    if kind == "csv":
        columns = _call_reader(path, csv_table.columns, path, names, mapping.sample_rate_hz is None)
    else:
        columns = _call_reader(path, _COLUMNS[kind], path, names)
    samples = min(column.values.size for column in columns)
    if not 2 <= samples <= MAX_SAMPLES:
        raise RecordingError(path, f"{samples} samples, at least 2 are needed" if samples < 2 else "too many samples")
    rate = mapping.sample_rate_hz or _rate(path, mapping, columns)
    counts = np.empty((samples, len(columns)), np.int16)
    channels = []
    for index, (mapped, column) in enumerate(zip(mapping.channels, columns, strict=True)):
        channels.append(_channel(path, mapped, column, counts[:, index]))
    counts.flags.writeable = False
    flags = list(contents.flags)
    if any(column.values.size != samples for column in columns):
        flags.append("unequal")
    recording = Recording(
        name=path.stem,
        counts=counts,
        sample_rate_hz=rate,
        channels=tuple(channels),
        setup=replace(mapping.setup, digitizer_bits=_bits(mapping, columns)),
        trigger_sample=mapping.trigger_sample,
        started_at=contents.started_at,
        flags=tuple(flags),
        path=str(path),
    )
    return _triggered(path, recording)


def _call_reader(path: Path, read: Callable[..., Result], *arguments: object) -> Result:
    """Call a format's reader, and convert any exception of its library (damaged file) to RecordingError."""
    try:
        return read(*arguments)
    except RecordingError:
        raise
    except Exception as error:
        cause = str(error) or type(error).__name__
        raise RecordingError(path, f"cannot be read as {format_of(path)} ({cause})") from None


def _format(path: Path) -> str:
    kind = format_of(path)
    if kind is None:
        raise RecordingError(path, f"no format this program reads; it reads SigMF and {', '.join(sorted(FORMATS))}")
    with os.fdopen(open_regular(path)) as file:  # refuses a pipe, on which the readers would hang
        size = os.fstat(file.fileno()).st_size
    if size > LARGEST_FILE_BYTES:
        raise RecordingError(path, f"larger than {LARGEST_FILE_BYTES // 2**30} GiB")
    return kind


def _channel(path: Path, mapped: MappedChannel, column: ForeignColumn, into: np.ndarray) -> Channel:
    """Fill ``into``, shape (n,), with the channel's counts; return the channel with the counts' scale."""
    values = column.values[: into.size]
    try:
        counts, unit_per_count, offset = to_counts(values)
    except ValueError as error:
        raise RecordingError(path, str(error), mapped.name) from None
    into[:] = counts
    volts, shift = mapped.volts_per_unit, mapped.offset_v
    if volts is None:
        kind = column.values.dtype
        full_scale = 1.0 if kind.kind == "f" else 2.0 ** (1 - 8 * kind.itemsize)
        volts, inner = column.volts_per_unit or full_scale, column.offset_v
        shift = inner if shift is None else shift
    return Channel(mapped.role, volts * unit_per_count, volts * offset + (shift or 0.0))


def _bits(mapping: ForeignMapping, columns: list[ForeignColumn]) -> int:
    """Return the number of bits that defines the rails: the digitizer's if the stored counts were kept, else 16."""
    kept = all(column.values.dtype.kind in "iu" and column.values.dtype.itemsize <= 2 for column in columns)
    widest = max(8 * column.values.dtype.itemsize for column in columns)
    return min(mapping.setup.digitizer_bits, widest) if kept else 16


def _rate(path: Path, mapping: ForeignMapping, columns: list[ForeignColumn]) -> float:
    rates = [column.sample_rate_hz for column in columns if column.sample_rate_hz is not None]
    if not rates:
        raise RecordingError(path, "does not state its sample rate; give it in the mapping (--rate)")
    if max(rates) - min(rates) > 1e-9 * max(rates):
        raise RecordingError(path, "its channels were sampled at different rates")
    return rates[0]


def _triggered(path: Path, recording: Recording) -> Recording:
    trigger = recording.trigger_sample
    if trigger is not None and trigger >= recording.samples:
        return replace(recording, trigger_sample=None, flags=(*recording.flags, "trigger_lost"))
    column = recording.column(Role.SWITCH)
    if trigger is not None or column is None:
        return recording
    reach = int(np.ptp(recording.counts[:, column].astype(np.int32)))  # few files state the digitizer's bits
    bits = min(recording.setup.digitizer_bits, reach.bit_length())
    step = LightSwitch(TriggerSettings(), column, bits).first_step(recording.counts)
    return replace(recording, trigger_sample=step)


_TOP = 32000  # counts of the largest deviation, below the rail so that it does not count as clipped
_RAIL = 32767
_CLIPPED_RATIO = 4.0  # clipped: also more than this many times as many samples at the extreme as at the next level


def to_counts(values: Column) -> tuple[NDArray[np.int16], float, float]:
    """Return (counts, unit_per_count, offset), value = counts * unit_per_count + offset, for values of shape (n,).

    Wider numbers are rounded to 1/64000 of the range they span, which is below the noise of any 12-bit digitizer.
    An extreme at which the values are clipped becomes the rail of the counts.  Raises ValueError for NaN and
    infinity.
    """
    kind = values.dtype
    if kind == np.int16 or kind == np.int8:
        return np.ascontiguousarray(values, dtype=np.int16), 1.0, 0.0
    if kind == np.uint8 or kind == np.uint16:
        middle = 128 if kind == np.uint8 else 32768
        return (values.astype(np.int32) - middle).astype(np.int16), 1.0, float(middle)
    low, high = float(values.min()), float(values.max())
    if not (np.isfinite(low) and np.isfinite(high)):
        raise ValueError(f"sample {np.argmin(np.isfinite(values))} is not a finite number")
    offset, half = 0.5 * low + 0.5 * high, 0.5 * high - 0.5 * low
    if half / _RAIL < np.finfo(np.float64).tiny:  # constant, or a step too small to divide by
        return np.zeros(values.size, np.int16), 1.0, offset
    unit = half / (_RAIL if _is_clipped(values, high, -1) or _is_clipped(values, low, 1) else _TOP)
    counts = np.empty(values.size, np.int16)
    step = 2**20
    for start in range(0, values.size, step):  # block by block, to avoid a whole copy as floats
        block = values[start : start + step].astype(np.float64)
        counts[start : start + step] = np.rint((block - offset) / unit)
    return counts, unit, offset


def _is_clipped(values: Column, extreme: float, inward: int) -> bool:
    at = int(np.count_nonzero(values == extreme))
    if at <= CLIPPED_SHARE * values.size or at < 8:
        return False
    rest = values[values != extreme]
    following = rest.max() if inward < 0 else rest.min()
    return bool(at > _CLIPPED_RATIO * np.count_nonzero(rest == following))
