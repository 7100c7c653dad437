"""Results of the workbench's jobs, and the events that the screen gets from them."""

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from analysis.collision import Effect
from analysis.diagnosis import Diagnosis, SavedModel
from analysis.shot import Shot


class EventKind(StrEnum):
    """What happened."""

    SHOT = "shot"  # a new entry, analysed
    CHANGED = "changed"  # entries were read again or refitted
    EXPORTED = "exported"
    PRINT = "print"  # the text of a report, to be printed
    DIAGNOSED = "diagnosed"
    MODEL = "model"  # a model file was loaded
    UNLISTED = "unlisted"  # recordings were found that no session lists
    PROBLEM = "problem"


@dataclass(frozen=True, slots=True)
class Event:
    """The end of one piece of work, in words, with the entries it concerns."""

    kind: EventKind
    words: str
    numbers: tuple[int, ...] = ()
    paths: tuple[Path, ...] = ()


@dataclass(frozen=True, slots=True)
class Diagnosed:
    """A diagnosis and the entries it was made over, in the order of its fits."""

    diagnosis: Diagnosis
    numbers: tuple[int, ...]
    version: str = ""  # of the program that made it, where it is a cached result


@dataclass(frozen=True, slots=True)
class LoadedModel:
    """A model file that was read."""

    model: SavedModel
    path: Path


@dataclass(frozen=True, slots=True)
class OpenedShot:
    """A shot that was read and analysed, perhaps as a copy."""

    shot: Shot
    copy_of: int | None


@dataclass(frozen=True, slots=True)
class SavedElsewhere:
    """Shots that were only in memory, and their new paths."""

    paths: dict[str, Path]
    folder: Path
    problem: str | None = None  # why the others were not saved


@dataclass(frozen=True, slots=True)
class SessionResult:
    """The result of work on the shots of one session, ``turn`` sessions after the first."""

    turn: int
    result: object


@dataclass(frozen=True, slots=True)
class CachedResults:
    """Cached results of a session's shots, each (number, shot, version); ``missing`` have none."""

    shots: tuple[tuple[int, Shot, str], ...]
    missing: tuple[int, ...]
    diagnosed: tuple[Diagnosed, ...] = ()


@dataclass(frozen=True, slots=True)
class FilledEntry:
    """An entry of the session that was read and analysed."""

    number: int
    shot: Shot


@dataclass(frozen=True, slots=True)
class RefittedShot:
    """The shot of an entry fitted with these effects; ``of`` is the shot before the fit."""

    number: int
    of: Shot
    effects: tuple[Effect, ...]
    shot: Shot
