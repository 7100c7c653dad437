"""Open raw recordings: two SigMF files with one stem (docs/formats.md), or a foreign file that has a mapping.

The ``sigmf`` package is not used, for three reasons.  Every error must name file and key in one line.  Metadata of
other programs must neither refer outside their folder (``core:dataset``) nor allocate without bound.  A capture must be
readable while it is being written.  The tests check the format against the package.  The samples are read, not
memory-mapped: if another program truncates a mapped file, the next access ends the process (SIGBUS).
"""

import hashlib
import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from analysis.shot import DELIVERED_KEY, RATE_CONTRADICTED, Recording, Role, Shot
from instrument.background import beside
from instrument.files.foreign_file import find_mapping, format_of, read_mapping
from instrument.files.recording_error import FileNotReached, RecordingError, system_message
from instrument.files.recording_metadata import Metadata, read_metadata
from instrument.files.recording_search import recording_files
from instrument.files.text_file import open_regular

ALTERED = "data_altered"
ENDED_EARLY = "lmm:ended_early"  # global key: why a capture ended before all requested samples arrived
_PIECE_BYTES = 4 * 2**20
_CLIPPING_CHECK = 256, 256  # places in the file, and samples at each: enough to detect clipping, and fast
CLIPPED_SHARE = 1e-3  # share of the samples at an extreme above which a file counts as clipped


def read_recording(path: Path | str) -> Recording:
    """Read a recording; its counts are int16, shape (samples, channels).  Raises RecordingError.

    Flags: "interrupted" (never closed: no hash), "truncated" (fewer samples than stated in the metadata),
    "longer_than_declared", "data_altered" (right number of samples but wrong hash), "gap", "trigger_lost" (beyond the
    samples), "cut_short" (ended before all requested samples arrived), "rate_contradicted" (by the computer's clock),
    "clipped" (judged by samples across the file).  Cost: 3 ms per MB, mostly for the hash.
    """
    recording, sha512 = read_without_hash(path)
    if sha512 is None or hash_matches(recording, sha512):
        return recording
    return replace(recording, flags=(*recording.flags, ALTERED))


def read_without_hash(path: Path | str) -> tuple[Recording, str | None]:
    """Read a recording without checking its hash; return it and the SHA-512 (hex) that its counts should have.

    The hash is None if there is nothing to compare: never closed, or another number of samples than the metadata state.
    """
    meta, data = recording_files(path)
    metadata = read_metadata(meta)
    counts, left_over = _samples(data, len(metadata.channels))
    samples = counts.shape[0]
    declared = metadata.declared_samples if metadata.declared_samples is not None else samples
    truncated = left_over > 0 or samples < max(declared, metadata.at_least_samples)
    longer = samples > declared and not truncated
    trigger = metadata.trigger_sample
    trigger_lost = trigger is not None and trigger >= samples
    gaps = tuple(gap for gap in metadata.gaps if gap.sample_start < samples)
    stated = metadata.extra.get("global", {})
    flags = {
        "interrupted": metadata.sha512 is None,
        "truncated": truncated,
        "longer_than_declared": longer,
        "trigger_lost": trigger_lost,
        "gap": bool(gaps),
        "cut_short": ENDED_EARLY in stated,
        RATE_CONTRADICTED: DELIVERED_KEY in stated,
        "clipped": _clipped(counts, metadata),
    }
    recording = Recording(
        name=meta.name.removesuffix(".sigmf-meta"),
        counts=counts,
        sample_rate_hz=metadata.sample_rate_hz,
        channels=metadata.channels,
        setup=metadata.setup,
        trigger_sample=None if trigger_lost else trigger,
        gaps=gaps,
        started_at=metadata.started_at,
        note=metadata.note,
        flags=tuple(flag for flag, applies in flags.items() if applies),
        path=str(meta),
        extra=metadata.extra,
    )
    return recording, None if truncated or longer else metadata.sha512


def hash_matches(recording: Recording, sha512: str, cancelled: Callable[[], bool] = lambda: False) -> bool:
    """Return whether the counts have the hash ``sha512`` (hex), or True once ``cancelled()``, checked every few ms.

    hashlib releases the interpreter's lock, so that other threads run meanwhile.
    """
    digest = hashlib.sha512()
    octets = recording.counts.reshape(-1).view(np.uint8)
    for start in range(0, octets.size, _PIECE_BYTES):
        if cancelled():
            return True
        digest.update(octets[start : start + _PIECE_BYTES].data)
    return digest.hexdigest() == sha512.lower()


def _refuse_outside_link(data: Path) -> None:
    """Raise RecordingError for a link that leads outside the recording's folder."""
    meta, _ = recording_files(data)
    try:
        # links of both files into the same other folder are allowed
        if data.is_symlink() and data.resolve().parent not in (data.parent.resolve(), meta.resolve().parent):
            raise RecordingError(data, "a link to outside the recording's folder; copy the file here instead")
    except (OSError, RuntimeError) as error:
        raise RecordingError(data, f"a link that leads nowhere ({error})") from None


def _samples(data: Path, channels: int) -> tuple[NDArray[np.int16], int]:
    """Return the counts, shape (samples, channels), and the number of bytes after the last whole sample."""
    _refuse_outside_link(data)
    frame = 2 * channels
    with os.fdopen(open_regular(data), "rb", buffering=0) as file:
        size = os.fstat(file.fileno()).st_size  # samples added later by a running capture are not read
        try:
            content = np.empty(size, np.uint8)
            filled = 0
            while count := file.readinto(content[filled : filled + _PIECE_BYTES].data):
                filled += count
        except OSError as error:
            raise FileNotReached(data, system_message(error)) from None
        except MemoryError:
            raise RecordingError(
                data, f"{size / 2**30:.1f} GiB, more than this machine's memory has room for"
            ) from None
    samples, left_over = divmod(filled, frame)  # ``filled`` is below ``size`` if the file was truncated meanwhile
    if samples == 0:
        raise RecordingError(data, "holds no samples")
    counts = content[: samples * frame].view("<i2").reshape(samples, channels)
    counts.flags.writeable = False
    return counts, left_over


def _clipped(counts: NDArray[np.int16], metadata: Metadata) -> bool:
    """Return whether a beat reaches the digitizer's rails; the switch channel is ignored."""
    beats = [i for i, channel in enumerate(metadata.channels) if channel.role is not Role.SWITCH]
    places, length = _CLIPPING_CHECK
    starts = np.linspace(0, max(0, counts.shape[0] - length), places).astype(np.int64)
    values = np.concatenate([counts[start : start + length] for start in np.unique(starts)])[:, beats]
    rail = 1 << (metadata.setup.digitizer_bits - 1)
    at_rail = (values >= rail - 1) | (values <= -rail)
    return bool(np.any(at_rail.mean(axis=0) > CLIPPED_SHARE))


@dataclass(frozen=True, slots=True)
class DataHash:
    """Name, size and SHA-512 (hex) of a data file; ``recorded`` is the hash in its metadata, or None."""

    file: str
    size_bytes: int
    sha512: str
    recorded: str | None

    @property
    def agrees(self) -> bool | None:
        """Get whether the data are unaltered; None if no hash was recorded."""
        return None if self.recorded is None else self.recorded.lower() == self.sha512


def data_hash(path: Path | str) -> DataHash:
    """Hash the data file of a recording, a motion record or a foreign file; tens of ms for 10 M samples.

    Raises RecordingError.
    """
    path = Path(path)
    recorded = None
    meta, data = recording_files(path)
    if path in (meta, data) or meta.exists():
        recorded = read_metadata(meta).sha512
        path = data
    with os.fdopen(open_regular(path), "rb") as file:
        try:
            digest = hashlib.file_digest(file, "sha512").hexdigest()
            size = os.fstat(file.fileno()).st_size
        except OSError as error:
            raise RecordingError(path, system_message(error)) from None
    return DataHash(path.name, size, digest, recorded)


def open_recording(path: Path | str) -> Recording:
    """Open a recording.  Raises RecordingError, whose message explains how to give a missing mapping."""
    path = Path(path)
    return _foreign(path) or read_recording(path)


def open_without_hash(path: Path | str) -> Recording:
    """Open a recording like ``open_recording``, but without checking the hash of its data."""
    path = Path(path)
    return _foreign(path) or read_without_hash(path)[0]


def analyse_and_check_hash(path: Path | str, analyse: Callable[[Recording], Shot]) -> Shot:
    """Analyse a recording while a second thread checks the hash of its data; flag "data_altered" if it differs.

    The hash takes a third of the analysis's time.  Raises what ``open_recording`` and ``analyse`` raise.
    """
    path = Path(path)
    recording = _foreign(path)
    if recording is not None:
        return analyse(recording)
    recording, sha512 = read_without_hash(path)
    if sha512 is None:
        return analyse(recording)
    with beside("hash", lambda _, cancelled: hash_matches(recording, sha512, cancelled)) as comparison:
        shot = analyse(recording)
        return shot if comparison.wait() else replace(shot, flags=(*shot.flags, ALTERED))


def _foreign(path: Path) -> Recording | None:
    """Return the recording in a foreign file, or None if ``path`` names no foreign format.  Raises RecordingError."""
    if path.is_dir():
        raise RecordingError(path, _why_no_recording(path))
    if format_of(path) is None:
        return None
    mapping = find_mapping(path)
    if mapping is None:
        if not path.exists():
            raise RecordingError(path, "no such file")
        raise RecordingError(path, f"nothing says which of its channels is which; {_advice(path)}")
    from instrument.files.foreign_reading import read_foreign

    return read_foreign(path, read_mapping(mapping))


def _why_no_recording(folder: Path) -> str:
    try:
        foreign = next((p for p in sorted(folder.iterdir()) if format_of(p) is not None and p.is_file()), None)
    except OSError as error:
        return system_message(error)
    if foreign is None:
        return "this folder holds no recording"
    return f"this folder holds no recording, but {foreign.name}; {_advice(foreign)}"


def _advice(path: Path) -> str:
    return f"'levimass map {path.name}' lists them and shows how to say it"
