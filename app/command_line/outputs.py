"""Output of headless commands: files, checked for writability first, and one-line errors on standard error."""

import json
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from analysis.shot import AnalysisError, Shot
from instrument.files import RecordingError, check_writable, error_words, one_line, write_text_atomic


@dataclass(frozen=True, slots=True)
class Outputs:
    """Output files of a replay, None if not requested; ``json`` may be "-" for standard output."""

    json: str | None = None
    export: Path | None = None
    hdf5: bool = False
    report: Path | None = None
    model: Path | None = None


def check_outputs(json_to: str | None, folder: Path | None, *files: Path | None) -> None:
    """Raise RecordingError or OSError if an output could not be written; make ``folder`` if it is missing."""
    named = [Path(json_to)] if json_to and json_to != "-" else []
    for path in (*named, *(file for file in files if file is not None)):
        check_writable(path)
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)


def json_text(result: Mapping[str, Any]) -> str:
    """Return a result as the text of a JSON file.  Raises ValueError for a number that is not finite."""
    return json.dumps(result, indent=1, allow_nan=False) + "\n"


def write_json(text: str, json_to: str) -> None:
    """Write a JSON text to a path, or to standard output ("-").  Raises RecordingError."""
    if json_to == "-":
        print(text, end="")
    else:
        write_text_atomic(Path(json_to), text, sync=True)


def say(line: object) -> None:
    """Print one line on standard error, prefixed with the program's name."""
    print(f"levimass: {line}", file=sys.stderr, flush=True)


def say_problem(shot: Shot) -> None:
    """Print why a shot was not analysed or not fitted; nothing for a fitted shot."""
    if shot.problem:
        say(problem_line(shot.path or shot.name, shot.problem))
    elif shot.fit_problem:
        say(problem_line(shot.path or shot.name, f"not fitted: {shot.fit_problem}"))


def problem_line(path: str, problem: str) -> str:
    """Return one line on a shot's problem that contains the name of the file exactly once."""
    flat = one_line(path, 600)
    return problem if Path(flat).name in problem else f"{flat}: {problem}"


def error_line(error: Exception, otherwise: object) -> str:
    """Return one line with file and cause of an error; ``otherwise`` is named if the error names no file.

    An unexpected exception is a fault of the program, and the line says so.
    """
    if isinstance(error, OSError):
        return f"{error.filename or otherwise}: {error.strerror or error}"
    if isinstance(error, RecordingError):
        return str(error)
    fault = "" if isinstance(error, AnalysisError) else f"a fault of the program: {type(error).__name__}: "
    return f"{otherwise}: {fault}{error_words(error)}"
