"""Keep the large arrays of a session's shots in memory-mapped temporary files instead of in memory.

Each shot has about fifteen arrays with a value per sample, but the window shows one shot at a time.  The arrays are
read from an unnamed file on access, so that 300 shots take some megabytes of memory instead of 220 MB.
"""

import mmap
import sys
import tempfile
import time
import weakref
from pathlib import Path
from typing import TypeVar, cast

import numpy as np

from app.session.result_archive import NotStorable, rebuild, split

PIECE_BYTES = 16 * 2**20  # size of one file, whose disk space is freed once no array refers to it
MIN_BYTES = 4096  # smaller arrays stay in memory
RELEASE_EVERY_S = 5.0
_ALIGNED = 64
Result = TypeVar("Result")


class Spool:
    """Moves the large arrays of results to files in ``folder``; they stay in memory if the files cannot be written."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._piece: _Piece | None = None
        self._mapped: weakref.WeakSet[mmap.mmap] = weakref.WeakSet()
        self._released_s = 0.0

    def moved(self, result: Result) -> Result:
        """Return the same shot or diagnosis with its large arrays, now read-only, mapped from a file."""
        try:
            body, arrays = split(result)
            large = [array for array in arrays if array.nbytes >= MIN_BYTES]
            places = iter(self._written(large))
        except (NotStorable, OSError, ValueError):
            return result
        return cast(Result, rebuild(body, [next(places) if a.nbytes >= MIN_BYTES else a for a in arrays]))

    def _written(self, arrays: list[np.ndarray]) -> list[np.ndarray]:
        sizes = [-(-array.nbytes // _ALIGNED) * _ALIGNED for array in arrays]
        whole = sum(sizes)
        if not whole:
            return []
        piece = self._piece
        if piece is None or piece.used + whole > piece.size:
            self._folder.mkdir(parents=True, exist_ok=True)
            piece = self._piece = _Piece(self._folder, max(PIECE_BYTES, whole))
            self._mapped.add(piece.memory)
        begin = piece.used
        content = b"".join(
            np.ascontiguousarray(array).tobytes().ljust(size, b"\0") for array, size in zip(arrays, sizes, strict=True)
        )
        piece.append(content)
        starts = begin + np.cumsum([0, *sizes[:-1]])
        return [piece.array(array, int(start)) for array, start in zip(arrays, starts, strict=True)]

    def release(self) -> None:
        """Every ``RELEASE_EVERY_S`` free the memory of mapped arrays; the next access reads them from disk again."""
        now = time.monotonic()
        if sys.platform == "win32" or now - self._released_s < RELEASE_EVERY_S:
            return
        self._released_s = now
        for memory in list(self._mapped):
            memory.madvise(mmap.MADV_DONTNEED)


class _Piece:
    """One unnamed file, filled from its start; it is deleted with the last array that refers to it."""

    def __init__(self, folder: Path, size: int) -> None:
        self.size, self.used = size, 0
        self._file = tempfile.TemporaryFile(dir=folder, prefix=".levimass-", buffering=0)  # noqa: SIM115 - held
        weakref.finalize(self, self._file.close)
        self._file.truncate(size)
        self.memory = mmap.mmap(self._file.fileno(), size, access=mmap.ACCESS_READ)  # keeps the file open by itself

    def append(self, content: bytes) -> None:
        """Append all of ``content``.  Raises OSError, after which ``used`` is unchanged."""
        done = 0
        self._file.seek(self.used)
        while done < len(content):
            done += self._file.write(content[done:])
        self.used += len(content)

    def array(self, like: np.ndarray, start: int) -> np.ndarray:
        """Return the array at byte ``start`` of the file, with the type and shape of ``like``."""
        flat = np.frombuffer(self.memory, like.dtype, like.size, start)
        return flat.reshape(like.shape)
