"""The journal of a campaign: a file with one line per finished shot, indexed in memory by line position."""

import hashlib
import json
import os
import tempfile
from collections.abc import Collection
from pathlib import Path
from typing import IO, Any, cast

from app.command_line.campaign.task import Entry
from app.report import shot_columns
from instrument.files import RecordingError, open_regular

JOURNAL = "campaign.jsonl"
_HEAD = b'{"sha256": "'
_BETWEEN = b'", "entry": '
_BEGIN = len(_HEAD) + 64 + len(_BETWEEN)


class Journal:
    """Finished shots of a campaign by their stamps; ``path`` None: in a temporary file, for this call only.

    Two calls may append to the same file, because each line is one write.  Lines with a wrong checksum are ignored
    and counted in ``unreadable_lines``.  Raises OSError, and RecordingError if ``path`` is not a regular file.
    """

    def __init__(self, path: Path | None, wanted: Collection[str]) -> None:
        self._places: dict[str, int] = {}
        self.path = path
        self.unreadable_lines = 0
        self._file: IO[bytes]
        if path is None:
            self._file = tempfile.TemporaryFile(buffering=0)  # noqa: SIM115 - held until close
            return
        if path.exists():
            os.close(open_regular(path))  # refuses pipes and devices, which could block for ever
        self._file = open(path, "a+b", buffering=0)  # noqa: SIM115 - held until close
        self._read(set(wanted))

    def __contains__(self, stamp: str) -> bool:
        return stamp in self._places

    def add(self, entry: Entry) -> None:
        text = json.dumps(entry, allow_nan=False).encode()
        line = _HEAD + hashlib.sha256(text).hexdigest().encode() + _BETWEEN + text + b"}\n"
        self._file.seek(0, os.SEEK_END)
        self._file.write(line)
        self._places[entry["stamp"]] = self._file.tell() - len(line)

    def entry(self, stamp: str) -> Entry:
        """Return the newest entry with this stamp.  Raises RecordingError if the file was changed in the meantime."""
        self._file.seek(self._places[stamp])
        with os.fdopen(os.dup(self._file.fileno()), "rb") as lines:
            entry = _entry_of(lines.readline())
        if entry is None or entry["stamp"] != stamp:
            raise RecordingError(self.path or Path(JOURNAL), "was changed while being read; repeat the command")
        return entry

    def close(self) -> None:
        self._file.close()

    def _read(self, wanted: set[str]) -> None:
        """Index the entries of earlier calls; lines truncated by a crash or altered are ignored."""
        self._file.seek(0)
        place = 0
        last = b"\n"
        with os.fdopen(os.dup(self._file.fileno()), "rb") as lines:
            for line in lines:
                entry = _entry_of(line)
                if entry is None:
                    self.unreadable_lines += bool(line.strip())
                elif entry["stamp"] in wanted:
                    self._places[entry["stamp"]] = place
                place += len(line)
                last = line
        if not last.endswith(b"\n"):
            self._file.write(b"\n")  # separates a line truncated by a crash from the next


def _entry_of(line: bytes) -> Entry | None:
    """Return the entry of a line, or None if the line was altered or is not valid."""
    text = line[_BEGIN:].removesuffix(b"\n").removesuffix(b"}")
    if line != _HEAD + hashlib.sha256(text).hexdigest().encode() + _BETWEEN + text + b"}\n":
        return None
    try:
        entry: Any = json.loads(text, parse_constant=_refuse)
        shot, row = entry["shot"], entry["row"]
        whole = shot["status"] in ("ok", "failed") and isinstance(shot["problem"], str | None)
        whole &= isinstance(shot["flags"], list) and isinstance(entry["stamp"], str)
        whole &= isinstance(row, list) and len(row) == len(shot_columns()) and all(isinstance(c, str) for c in row)
        json.dumps(entry, allow_nan=False)  # refuses 1e999, which is read as infinity
    except (ValueError, KeyError, TypeError, RecursionError):
        return None
    return cast(Entry, entry) if whole else None


def _refuse(word: str) -> float:
    raise ValueError(f"{word} is not a number")
