"""Read TDMS files (LabVIEW, DIAdem): channels named "group/channel", volts by the scaling in the file."""

import logging
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np

from instrument.files.foreign_file import (
    ForeignChannel,
    ForeignColumn,
    ForeignContents,
    checked_channels,
    missing_package,
)
from instrument.files.recording_error import RecordingError, one_line

_MAX_SCALES = 64  # limit, as the library allocates a list of the length stated in the file
_TRUNCATION_LOGGERS = {"nptdms.reader", "nptdms.tdms_segment"}  # they report truncated segments


def contents(path: Path) -> ForeignContents:
    """Return every numeric channel, with rate and unit from its waveform properties."""
    with _library_warnings() as warnings, _opened(path) as file:
        found = [
            ForeignChannel(name, len(channel), str(channel.dtype), _unit(channel), _rate(channel))
            for name, channel in _channels(path, file).items()
        ]
        started = next((s for c in _channels(path, file).values() if (s := _started(c)) is not None), None)
    return ForeignContents(path, "tdms", checked_channels(path, found), started, ("truncated",) if warnings else ())


def columns(path: Path, names: Sequence[str]) -> list[ForeignColumn]:
    """Return the named channels; counts with a single linear scale stay counts, all others are scaled by the file."""
    with _library_warnings(), _opened(path) as file:
        channels = _channels(path, file)
        return [_column(channels[name]) for name in names]


def _column(channel: Any) -> ForeignColumn:
    scale = _linear_scale(channel.properties)
    if scale is not None and channel.data_type.nptype is not None:
        raw = np.asarray(channel.read_data(scaled=False))
        if raw.dtype.kind in "iu" and raw.dtype.itemsize <= 2:
            return ForeignColumn(raw, scale[0], scale[1], _rate(channel))
    return ForeignColumn(np.asarray(channel.read_data(scaled=True)), sample_rate_hz=_rate(channel))


def _linear_scale(properties: Any) -> tuple[float, float] | None:
    """Return (slope, intercept) if the channel's only scale is linear, else None."""
    try:
        if int(properties["NI_Number_Of_Scales"]) != 1 or properties["NI_Scale[0]_Scale_Type"] != "Linear":
            return None
        slope = float(properties["NI_Scale[0]_Linear_Slope"])
        intercept = float(properties["NI_Scale[0]_Linear_Y_Intercept"])
    except (KeyError, TypeError, ValueError):
        return None
    return (slope, intercept) if np.isfinite([slope, intercept]).all() and abs(slope) > 1e-30 else None


def _channels(path: Path, file: Any) -> dict[str, Any]:
    size = os.stat(path).st_size
    found = {}
    for group in file.groups():
        for channel in group.channels():
            if any(_scales(part.properties) > _MAX_SCALES for part in (channel, group, file)):
                raise RecordingError(path, f"more than {_MAX_SCALES} scales", channel.name)
            dtype = channel.dtype
            if dtype is None or dtype.kind not in "iuf" or len(channel) < 2:
                continue
            stored = getattr(channel.data_type, "size", None) or 1
            if len(channel) * stored > size:  # TDMS is not compressed, so the stated length is false
                raise RecordingError(path, "claims more samples than the file holds", channel.name)
            found[f"{group.name}/{channel.name}"] = channel
    return found


def _scales(properties: Any) -> int:
    try:
        return int(properties.get("NI_Number_Of_Scales", 0))
    except (TypeError, ValueError, OverflowError):
        return 0


def _rate(channel: Any) -> float | None:
    try:
        step = float(channel.properties["wf_increment"])
    except (KeyError, TypeError, ValueError):
        return None
    return 1.0 / step if 1e-12 < step < 1e12 else None


def _unit(channel: Any) -> str:
    return one_line(str(channel.properties.get("unit_string", "")), 20)


def _started(channel: Any) -> str | None:
    start = channel.properties.get("wf_start_time")
    return f"{np.datetime_as_string(start, unit='us')}Z" if isinstance(start, np.datetime64) else None


@contextmanager
def _library_warnings() -> Iterator[list[str]]:
    """Collect the library's warnings about truncated files, and suppress its log output."""
    warnings: list[str] = []

    def collect(record: logging.LogRecord) -> bool:
        if record.name in _TRUNCATION_LOGGERS:
            warnings.append(one_line(record.getMessage()))
        return False

    with suppress(ImportError):
        import nptdms  # noqa: F401 - creates its loggers
    loggers = [logging.getLogger(name) for name in list(logging.root.manager.loggerDict) if name.startswith("nptdms")]
    for logger in loggers:
        logger.addFilter(collect)
    try:
        yield warnings
    finally:
        for logger in loggers:
            logger.removeFilter(collect)


def _opened(path: Path) -> Any:
    try:
        from nptdms import TdmsFile
    except ImportError:
        raise missing_package(path, "npTDMS", "tdms") from None
    return TdmsFile.open(path)
