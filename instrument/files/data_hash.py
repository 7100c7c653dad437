"""Which bytes a shot was analysed from: the SHA-512 of its data file, beside the one written when it was taken."""

import hashlib
import os
from dataclasses import dataclass
from pathlib import Path

from instrument.files.recording_error import RecordingError
from instrument.files.recording_metadata import read_metadata
from instrument.files.recording_search import recording_stem
from instrument.files.text_file import open_regular


@dataclass(frozen=True, slots=True)
class DataHash:
    """The data file's name, size and SHA-512 (hex) as it is now.

    ``recorded`` is the hash its metadata hold (``core:sha512``), None where there is none.
    """

    file: str
    size_bytes: int
    sha512: str
    recorded: str | None

    @property
    def agrees(self) -> bool | None:
        """Get whether the data are those that were taken; None where no hash was written then."""
        return None if self.recorded is None else self.recorded.lower() == self.sha512


def data_hash(path: Path | str) -> DataHash:
    """Hash the data of a recording, a motion record or a foreign file: tens of ms for 10 M samples.

    Raises RecordingError, one line, where they cannot be read.
    """
    path = Path(path)
    recorded = None
    stem = recording_stem(path)
    meta = stem.with_name(stem.name + ".sigmf-meta")
    if stem != path or meta.exists():
        recorded = read_metadata(meta).sha512
        path = stem.with_name(stem.name + ".sigmf-data")
    with os.fdopen(open_regular(path), "rb") as file:
        try:
            digest = hashlib.file_digest(file, "sha512").hexdigest()
            size = os.fstat(file.fileno()).st_size
        except OSError as error:
            raise RecordingError(path, error.strerror or str(error)) from None
    return DataHash(path.name, size, digest, recorded)
