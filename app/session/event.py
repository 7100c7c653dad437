"""What the workbench's jobs hand back, and what the screen is told of it."""

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from analysis.diagnosis.model_file import SavedModel
from analysis.diagnosis.result import Diagnosis
from analysis.shot.shot import Shot


class Kind(StrEnum):
    """What may happen."""

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
    """One thing that ended, in words, with the entries it concerns."""

    kind: Kind
    words: str
    numbers: tuple[int, ...] = ()
    paths: tuple[Path, ...] = ()


@dataclass(frozen=True, slots=True)
class Diagnosed:
    """A diagnosis and the entries it was made over, in the order of its fits."""

    diagnosis: Diagnosis
    numbers: tuple[int, ...]
    version: str = ""  # of the program that made it, where it was kept from before


@dataclass(frozen=True, slots=True)
class Loaded:
    """A model file that was read."""

    model: SavedModel
    path: Path


@dataclass(frozen=True, slots=True)
class Opened:
    """A shot that was read and analysed, perhaps as a copy."""

    shot: Shot
    copy_of: int | None


@dataclass(frozen=True, slots=True)
class SavedElsewhere:
    """Shots that were only in memory, and where they are now."""

    paths: dict[str, Path]
    folder: Path
    problem: str | None = None  # why the others were not saved


@dataclass(frozen=True, slots=True)
class InSession:
    """What came of work on the shots of one session, ``turn`` sessions after the first."""

    turn: int
    result: object


@dataclass(frozen=True, slots=True)
class Reopened:
    """What was kept of a session's shots: (number, shot, version) each; ``missing`` are to be analysed."""

    shots: tuple[tuple[int, Shot, str], ...]
    missing: tuple[int, ...]
    diagnosed: tuple[Diagnosed, ...] = ()


@dataclass(frozen=True, slots=True)
class Filled:
    """An entry of the session that was read and analysed."""

    number: int
    shot: Shot


@dataclass(frozen=True, slots=True)
class Refitted:
    """The shot of an entry, fitted with these effects; ``of`` is the shot as it was when the fit was asked for."""

    number: int
    of: Shot
    effects: tuple[str, ...]
    shot: Shot
