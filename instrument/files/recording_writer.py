"""Write a recording while it is being captured, so that after a crash the samples so far can be read."""

import contextlib
import hashlib
import os
import stat
import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.shot import Channel, Gap, Recording, Setup
from instrument.files.atomic_file import as_recording_error, write_json_atomic
from instrument.files.recording_error import RecordingError, RecordingExists
from instrument.files.recording_metadata import Metadata, metadata_json, read_metadata

_REFRESH_S = 0.25  # shortest time between rewrites of a running capture's metadata
_CHUNK_BYTES = 4 * 2**20


class RecordingWriter:
    """A recording being written.  Raises RecordingError for every OSError; not thread-safe.

    A data file and a metadata file without ``core:sha512`` exist from the start, so an interrupted capture can be read
    up to its last samples.  ``close`` hashes, fsyncs, and replaces the metadata.  An existing recording is never
    overwritten.
    """

    def __init__(
        self,
        stem: Path | str,
        sample_rate_hz: float,
        channels: tuple[Channel, ...],
        setup: Setup,
        *,
        started_at: str | None = None,
        extra: Mapping[str, Any] | None = None,
    ) -> None:
        self.stem = Path(stem)
        self.data_path = self.stem.with_name(self.stem.name + ".sigmf-data")
        self.meta_path = self.stem.with_name(self.stem.name + ".sigmf-meta")
        self.samples = 0
        self._hash = hashlib.sha512()
        self._metadata = Metadata(
            sample_rate_hz, channels, setup, None, (), "", started_at, None, None, 0, dict(extra or {})
        )
        self._stale: bool  # this and the next: state since the metadata were last written
        self._refreshed_at: float
        if self.meta_path.exists():
            raise RecordingExists(self.meta_path)
        with as_recording_error(self.data_path):
            self._file = open(self.data_path, "xb", buffering=0)  # noqa: SIM115 - held until close
        try:
            self._write_metadata(sync=False)
        except RecordingError:
            self._file.close()
            with contextlib.suppress(OSError):
                self.data_path.unlink()
            raise

    def append(self, counts: NDArray[np.int16]) -> None:
        """Append samples, int16 of shape (n, channels)."""
        block = np.ascontiguousarray(counts, dtype="<i2")
        if block.ndim != 2 or block.shape[1] != len(self._metadata.channels):
            raise RecordingError(self.data_path, f"samples of shape {block.shape} do not fit its channels")
        view = block.reshape(-1).view(np.uint8).data
        with as_recording_error(self.data_path):
            written = 0
            while written < len(view):
                written += self._file.write(view[written : written + _CHUNK_BYTES])
        self._hash.update(view)
        self.samples += block.shape[0]
        if self._stale and time.monotonic() - self._refreshed_at > _REFRESH_S:
            self._write_metadata(sync=False)

    def gap(self, sample_start: int, samples_lost: int | None) -> None:
        """Note that samples were lost before ``sample_start``."""
        self._change(gaps=(*self._metadata.gaps, Gap(sample_start, samples_lost)))

    def trigger(self, sample: int) -> None:
        """Note the sample at which the light switch fired."""
        self._change(trigger_sample=sample)

    def note(self, text: str) -> None:
        """Set the operator's note."""
        self._change(note=text)

    def more(self, extra: Mapping[str, Any]) -> None:
        """Replace the extra metadata given at the start."""
        self._change(extra=dict(extra))

    def close(self, *, interrupted: bool = False) -> Path:
        """Write samples and final metadata to disk; return the metadata's path.

        If ``interrupted``, the hash is omitted, as in an interrupted capture.
        """
        with as_recording_error(self.data_path):
            os.fsync(self._file.fileno())
            self._file.close()
        if not interrupted:
            self._change(sha512=self._hash.hexdigest(), declared_samples=self.samples)
        self._write_metadata(sync=True)
        return self.meta_path

    def abandon(self) -> None:
        """Remove both files.  Never raises."""
        for action in (self._file.close, self.data_path.unlink, self.meta_path.unlink):
            with contextlib.suppress(OSError):
                action()

    def release(self) -> None:
        """Close the data file after an error, and keep it.  Never raises."""
        with contextlib.suppress(OSError):
            self._file.close()

    def _change(self, **what: Any) -> None:
        self._metadata = replace(self._metadata, **what)
        self._stale = True

    def _write_metadata(self, *, sync: bool) -> None:
        write_json_atomic(self.meta_path, metadata_json(self._metadata), sync=sync)
        self._stale = False
        self._refreshed_at = time.monotonic()


def write_recording(recording: Recording, stem: Path | str) -> Path:
    """Write a complete recording to ``stem``.sigmf-data and ``stem``.sigmf-meta; return the latter's path.

    An existing recording is never overwritten.  Raises RecordingError, and then leaves no file behind.
    """
    writer = RecordingWriter(
        stem,
        recording.sample_rate_hz,
        recording.channels,
        recording.setup,
        started_at=recording.started_at,
        extra=recording.extra,
    )
    try:
        step = max(1, _CHUNK_BYTES // (2 * len(recording.channels)))
        for start in range(0, recording.samples, step):
            writer.append(recording.counts[start : start + step])
        for gap in recording.gaps:
            writer.gap(gap.sample_start, gap.samples_lost)
        if recording.trigger_sample is not None:
            writer.trigger(recording.trigger_sample)
        writer.note(recording.note)
        return writer.close(interrupted="interrupted" in recording.flags)
    except BaseException:
        writer.abandon()
        raise


def rewrite_note(path: Path, note: str) -> None:
    """Change the note in the metadata file ``path`` of a recording.

    Raises RecordingError, also for a read-only file, because replacing a file would ignore the read-only attribute.
    """
    with as_recording_error(path):
        mode = path.stat().st_mode
    if not mode & stat.S_IWUSR:
        raise RecordingError(path, "is read-only: the note stays in the session")
    write_json_atomic(path, metadata_json(replace(read_metadata(path), note=note)), sync=True)
