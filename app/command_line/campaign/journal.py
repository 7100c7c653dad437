"""What is done, a line a shot, on disk before the next is waited for; memory holds only where each line begins."""

import json
import os
import tempfile
from collections.abc import Collection
from pathlib import Path
from typing import IO, Any, cast

from app.command_line.campaign.task import Entry
from instrument.text_file import open_regular

JOURNAL = "campaign.jsonl"


class Journal:
    """The entries of a campaign by their stamps.  Without a path they are kept for this call alone.

    Two calls may append to one file: a line is one write.  Raises OSError, and RecordingError where no file can be.
    """

    def __init__(self, path: Path | None, wanted: Collection[str]) -> None:
        self._places: dict[str, int] = {}
        self._file: IO[bytes]
        if path is None:
            self._file = tempfile.TemporaryFile(buffering=0)  # noqa: SIM115 - held until close
            return
        if path.exists():
            os.close(open_regular(path))  # a pipe or a device would be waited for without end
        self._file = open(path, "a+b", buffering=0)  # noqa: SIM115 - held until close
        self._read(set(wanted))

    def __contains__(self, stamp: str) -> bool:
        return stamp in self._places

    def __len__(self) -> int:
        return len(self._places)

    def add(self, entry: Entry) -> None:
        """Append an entry."""
        line = json.dumps(entry, allow_nan=False).encode() + b"\n"
        self._file.seek(0, os.SEEK_END)
        self._file.write(line)
        self._places[entry["stamp"]] = self._file.tell() - len(line)

    def entry(self, stamp: str) -> Entry:
        """Return the entry that was last added under ``stamp``."""
        self._file.seek(self._places[stamp])
        with os.fdopen(os.dup(self._file.fileno()), "rb") as lines:
            return cast(Entry, json.loads(lines.readline()))

    def close(self) -> None:
        """Let go of the file."""
        self._file.close()

    def _read(self, wanted: set[str]) -> None:
        """Find what an earlier call left; lines cut off by a crash, or that say something else, are passed over."""
        self._file.seek(0)
        place = 0
        last = b"\n"
        with os.fdopen(os.dup(self._file.fileno()), "rb") as lines:
            for line in lines:
                if (stamp := _stamp_of(line)) in wanted:
                    self._places[stamp] = place
                place += len(line)
                last = line
        if not last.endswith(b"\n"):
            self._file.write(b"\n")  # whatever a crash left of the last line stays a line of its own


def _stamp_of(line: bytes) -> str | None:
    """Return the stamp of a whole entry, None for anything else."""
    try:
        entry: Any = json.loads(line)
        shot, row = entry["shot"], entry["row"]
        whole = shot["status"] in ("ok", "failed") and isinstance(shot["problem"], str | None)
        whole &= isinstance(entry["stamp"], str) and all(isinstance(cell, str) for cell in row)
    except (ValueError, KeyError, TypeError, RecursionError):
        return None
    return entry["stamp"] if whole else None
