"""Open and lock session files, one window per file; find recordings that no session lists."""

import contextlib
from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass
from pathlib import Path

from app.session.session import SCHEMA, Session
from instrument.files import CheckedTable, FolderLock, FolderLocked, RecordingError, read_json, read_metadata

MAX_WINDOWS = 20


def named_session(path: Path) -> Session:
    """Return the session in ``path``.  Raises RecordingError if another window has it open or it is no session."""
    unlock = lock_session(path)
    if not is_session(path):  # checked first, because ``reopen`` renames a file that it cannot read
        unlock()
        raise RecordingError(path, "no such file" if not path.exists() else "this is not a Levimass session")
    session = Session.reopen(path)
    session.unlock = unlock
    return session


def is_session(path: Path) -> bool:
    """Return whether the first characters of a file are those of a session."""
    try:
        with path.open(encoding="utf-8", errors="replace") as file:
            return path.suffix == ".json" and SCHEMA in file.read(200)
    except OSError:
        return False


def lock_session(path: Path) -> Callable[[], None]:
    """Lock a session file for this window; return the function that unlocks it.  Raises RecordingError."""
    try:
        return FolderLock(path.parent, f".{path.name}.lock").release
    except FolderLocked:
        raise RecordingError(path, "this session is open in another window") from None


def last_session(name: str, folder: Path) -> Session:
    """Return the session in the file ``name`` or, if that fails, the unnamed one in ``folder``."""
    if name:
        try:
            return named_session(Path(name))
        except RecordingError as error:
            session = own_session(folder)
            session.read_problem = session.read_problem or f"{error}: the session without a name is open"
            return session
    return own_session(folder)


def own_session(folder: Path) -> Session:
    """Return the unnamed session in ``folder``; if another window has it open, the next free one.

    If no lock can be made (a read-only folder), the first unnamed session is used.
    """
    with contextlib.suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
    for number in range(1, MAX_WINDOWS + 1):
        path = folder / ("session.json" if number == 1 else f"session-{number}.json")
        try:
            lock = FolderLock(folder, f".{path.name}.lock")
        except FolderLocked:
            continue
        except RecordingError:
            break
        session = Session.reopen(path)
        session.unlock = lock.release
        if number > 1 and session.read_problem is None:
            session.read_problem = f"the session is open in another window; this window uses {path.name}"
        return session
    return Session.reopen(folder / "session.json")


MOST = 1000  # number of newest recordings in the folder that are checked


@dataclass(frozen=True, slots=True)
class Unlisted:
    """Recordings that no session lists, newest first; ``cut_off``: the program ended while capturing them."""

    complete: tuple[Path, ...] = ()
    cut_off: tuple[Path, ...] = ()


def unlisted(folder: Path, listed: Collection[str], before_s: float) -> Unlisted:
    """Return the recordings in ``folder`` that are not in ``listed``.

    Left out are files written at or after ``before_s`` (s since the epoch), because their capture may not be
    complete, and files with unreadable metadata.
    """
    try:
        found = [(path.stat().st_mtime, path) for path in folder.glob("*.sigmf-meta") if str(path) not in listed]
    except OSError:
        return Unlisted()
    newest = [path for written_s, path in sorted(found, reverse=True)[:MOST] if written_s < before_s]
    closed: list[Path] = []
    cut_off: list[Path] = []
    for path in newest:
        try:
            (cut_off if read_metadata(path).sha512 is None else closed).append(path)
        except RecordingError:
            continue
    return Unlisted(tuple(closed), tuple(cut_off))


def listed_by(sessions: Iterable[Path]) -> set[str]:
    """Return the recordings that these session files list or leave out; files that are no session are ignored."""
    paths: set[str] = set()
    for file in sessions:
        try:
            document = CheckedTable(file, read_json(file))
            shots = document.objects("shots") or ()
            paths.update(path for shot in shots if (path := shot.text("path", 10_000)) is not None)
            left_out = document.get("left_out")
        except RecordingError:
            continue
        if isinstance(left_out, list):
            paths.update(path for path in left_out if isinstance(path, str))
    return paths
