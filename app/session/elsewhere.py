"""Shots that are only in memory, saved to another folder: where they then are, also those not analysed by then."""

from collections.abc import Callable
from pathlib import Path

from app.session.event import Event, Kind, SavedElsewhere
from app.session.jobs import Asked, Jobs, Report
from app.session.session import Session
from instrument.files.recording_error import PartlySaved


class Elsewhere:
    """Saves, and knows by a shot's name where it was saved."""

    def __init__(self, session: Session, errands: Jobs) -> None:
        self._session, self._errands = session, errands
        self._ahead: dict[str, str] = {}  # paths of shots whose analysis is still under way, by name

    def save(self, save: Callable[[Path], dict[str, Path]], folder: Path) -> None:
        """Queue the saving of shots that are only in memory; ``save`` does it and returns each one's path by name."""

        def work(_: Report, __: Asked) -> SavedElsewhere:
            try:
                return SavedElsewhere(save(folder), folder)
            except PartlySaved as error:
                return SavedElsewhere(error.saved, folder, str(error))

        self._errands.submit("saving elsewhere", work, "save")

    def path_of(self, name: str) -> str | None:
        """Return where a shot was saved before it was analysed, once, or None."""
        return self._ahead.pop(name, None)

    def take(self, result: SavedElsewhere) -> Event:
        """Let the session know the new paths; return what is to be said."""
        for name, path in result.paths.items():
            if not self._session.set_path(name, str(path)):
                self._ahead[name] = str(path)
        count = len(result.paths)
        words = f"{count} shot{'s' if count > 1 else ''} saved to {result.folder}" if count else "no shot waits"
        if result.problem is None:
            return Event(Kind.EXPORTED, words)
        before = f"{words}; " if count else ""
        return Event(Kind.PROBLEM, f"{before}the rest stays in memory: {result.problem}")
