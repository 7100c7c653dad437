"""Writing a recording while it is being taken, so that a crash at any moment leaves what came so far readable."""

import contextlib
import hashlib
import json
import os
import stat
import threading
import time
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.shot.recording import Channel, Gap, Recording, Setup
from instrument.files.into_place import into_place, same_rights, sync_folder
from instrument.files.recording_error import RecordingError, RecordingExists
from instrument.files.recording_metadata import Metadata, metadata_json, read_metadata

_REFRESH_S = 0.25  # metadata of a running capture are rewritten at most this often
_CHUNK_BYTES = 4 * 2**20


class RecordingWriter:
    """One recording growing on disk.

    From the first moment there are a data file and a metadata file without ``core:sha512``: a capture that is cut
    off reopens as far as it got.  ``close`` hashes, fsyncs, and puts the final metadata in place with ``os.replace``.
    An existing recording is never overwritten.  Every OSError comes as a RecordingError.  Not thread-safe.
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
        self._stale = False
        self._refreshed_at = 0.0
        if self.meta_path.exists():
            raise RecordingExists(self.meta_path)
        with _as_recording_error(self.data_path):
            self._file = open(self.data_path, "xb", buffering=0)  # noqa: SIM115 - held until close
        try:
            self._write_metadata(sync=False)
        except RecordingError:
            self._file.close()
            with contextlib.suppress(OSError):
                self.data_path.unlink()
            raise

    def append(self, counts: NDArray[np.int16]) -> None:
        """Write samples, int16 of shape (n, channels), after those already there."""
        block = np.ascontiguousarray(counts, dtype="<i2")
        if block.ndim != 2 or block.shape[1] != len(self._metadata.channels):
            raise RecordingError(self.data_path, f"samples of shape {block.shape} do not fit its channels")
        view = block.reshape(-1).view(np.uint8).data
        with _as_recording_error(self.data_path):
            written = 0
            while written < len(view):
                written += self._file.write(view[written : written + _CHUNK_BYTES])
        self._hash.update(view)
        self.samples += block.shape[0]
        if self._stale and time.monotonic() - self._refreshed_at > _REFRESH_S:
            self._write_metadata(sync=False)

    def gap(self, sample_start: int, samples_lost: int | None) -> None:
        """Note that samples were lost before ``sample_start``; nothing is filled in."""
        self._metadata = replace(self._metadata, gaps=(*self._metadata.gaps, Gap(sample_start, samples_lost)))
        self._stale = True

    def trigger(self, sample: int) -> None:
        """Note the sample at which the light switch fired."""
        self._metadata = replace(self._metadata, trigger_sample=sample)
        self._stale = True

    def note(self, text: str) -> None:
        """Set the operator's note."""
        self._metadata = replace(self._metadata, note=text)
        self._stale = True

    def more(self, extra: Mapping[str, Any]) -> None:
        """Replace the foreign metadata given at the start."""
        self._metadata = replace(self._metadata, extra=dict(extra))
        self._stale = True

    def close(self, *, interrupted: bool = False) -> Path:
        """Bring samples and final metadata safely to disk and return the metadata's path.

        ``interrupted`` leaves the hash out: the recording is then one that was cut off.
        """
        with _as_recording_error(self.data_path):
            os.fsync(self._file.fileno())
            self._file.close()
        if not interrupted:
            self._metadata = replace(self._metadata, sha512=self._hash.hexdigest(), declared_samples=self.samples)
        self._write_metadata(sync=True)
        return self.meta_path

    def abandon(self) -> None:
        """Remove both files: nothing of this recording is wanted.  Never raises."""
        for action in (self._file.close, self.data_path.unlink, self.meta_path.unlink):
            with contextlib.suppress(OSError):
                action()

    def release(self) -> None:
        """Close the file as it is, after an error; what was written stays.  Never raises."""
        with contextlib.suppress(OSError):
            self._file.close()

    def _write_metadata(self, *, sync: bool) -> None:
        write_json_beside(self.meta_path, metadata_json(self._metadata), sync=sync)
        self._stale = False
        self._refreshed_at = time.monotonic()


def write_recording(recording: Recording, stem: Path | str) -> Path:
    """Write a whole recording to ``stem``.sigmf-data and .sigmf-meta and return the latter's path.

    Raw first, metadata last; an existing recording is never overwritten.  RecordingError says why it failed, and
    nothing is left behind then.
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
    """Put another note into the metadata file ``path`` of a recording on disk; samples stay.

    Raises RecordingError, also for a file that is marked read-only: replacing a file asks its folder alone, so that the
    mark would otherwise protect nothing, least of all from an administrator.
    """
    with _as_recording_error(path):
        mode = path.stat().st_mode
    if not mode & stat.S_IWUSR:
        raise RecordingError(path, "is read-only: the note stays in the session")
    write_json_beside(path, metadata_json(replace(read_metadata(path), note=note)), sync=True)


def write_json_beside(path: Path, value: Mapping[str, Any], *, sync: bool) -> None:
    """Write JSON to a file beside ``path`` and move it into place, so that ``path`` is always whole."""
    try:
        text = json.dumps(value, indent=1, allow_nan=False)
    except (TypeError, ValueError) as error:
        raise RecordingError(path, f"cannot be written as JSON ({error})") from None
    write_text_beside(path, text + "\n", sync=sync)


def write_text_beside(path: Path, text: str | Iterable[str], *, sync: bool) -> None:
    """Write text, whole or piece by piece, as ``write_beside`` does; a file's name in it may hold bytes no text has."""
    pieces = (text,) if isinstance(text, str) else text
    write_beside(path, (piece.encode("utf-8", errors="backslashreplace") for piece in pieces), sync=sync)


def write_beside(path: Path, content: Iterable[bytes | memoryview], *, sync: bool) -> None:
    """Write a file, in pieces, beside ``path``, fsync it, and ``os.replace`` it into place.  Raises RecordingError.

    A link stays a link, to the new content; a device or a pipe is written into, as nothing may take its place.
    """
    check_writable(path)
    with _as_recording_error(path):
        if _is_device(path):
            path.write_bytes(b"".join(content))
            return
        path = Path(os.path.realpath(path))
        short = hashlib.sha256(os.fsencode(path.name)).hexdigest()[:12]  # a legal name plus anything may be none
        beside = path.with_name(f".{short}.{os.getpid()}-{threading.get_ident()}.new")  # another window may too
        try:
            with open(beside, "wb") as file:
                same_rights(beside, path)  # before anything stands in it
                file.writelines(content)
                if sync:
                    file.flush()
                    os.fsync(file.fileno())
            into_place(beside, path)
        except BaseException:
            with contextlib.suppress(OSError):
                beside.unlink()
            raise
        if sync:
            sync_folder(path.parent)


def check_writable(path: Path) -> None:
    """Raise RecordingError where ``write_beside`` would fail: better said before hours of work than after."""
    with _as_recording_error(path):
        with contextlib.suppress(FileNotFoundError):
            os.lstat(path)  # a name that is too long, or through a file, is no name
        if os.path.isdir(path):
            raise IsADirectoryError(0, "a folder, not a file")
        place = path if _is_device(path) else Path(os.path.realpath(path)).parent
        os.stat(place)
        if place != path and not os.path.isdir(place):
            raise NotADirectoryError(0, f"{place} is not a folder")
        if not os.access(place, os.W_OK):
            raise PermissionError(0, "no right to write there")


def _is_device(path: Path) -> bool:
    return os.path.exists(path) and not os.path.isfile(path)


@contextlib.contextmanager
def _as_recording_error(path: Path) -> Any:
    try:
        yield
    except FileExistsError:
        raise RecordingExists(path) from None
    except FileNotFoundError:
        raise RecordingError(path, "the folder does not exist") from None
    except OSError as error:
        raise RecordingError(path, error.strerror or str(error)) from error
