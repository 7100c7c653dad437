"""Which file a window keeps its session in: two windows open at once never write the same."""

import contextlib
from pathlib import Path

from app.session.session import Session
from instrument.folder_lock import FolderHeld, FolderLock
from instrument.recording_error import RecordingError

MOST_WINDOWS = 20


def own_session(folder: Path) -> Session:
    """Return the session kept in ``folder``, or the next one where another window has that open, and says so.

    ``close`` gives it free.  Where no lock can be had (a folder that cannot be written) the first is taken.
    """
    with contextlib.suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
    for number in range(1, MOST_WINDOWS + 1):
        path = folder / ("session.json" if number == 1 else f"session-{number}.json")
        try:
            lock = FolderLock(folder, f".{path.name}.lock")
        except FolderHeld:
            continue
        except RecordingError:
            break
        session = Session.reopen(path)
        session.give_free = lock.release
        if number > 1 and session.problem is None:
            session.problem = f"another window has the session open: this one keeps its own, {path.name}"
        return session
    return Session.reopen(folder / "session.json")
