"""What a headless call writes and says: result files checked before the work, errors as one line on standard error."""

import json
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from analysis.shot import AnalysisError, Shot
from instrument.files import RecordingError, check_writable, one_line, write_text_atomic


@dataclass(frozen=True, slots=True)
class Outputs:
    """The files of a replay, each None where it is not requested; ``json`` may be "-", standard output."""

    json: str | None = None
    export: Path | None = None
    hdf5: bool = False
    report: Path | None = None
    model: Path | None = None


def check_outputs(json_to: str | None, folder: Path | None, *files: Path | None) -> None:
    """Raise RecordingError or OSError where a result could not be written; ``folder`` is made where it is missing."""
    named = [Path(json_to)] if json_to and json_to != "-" else []
    for path in (*named, *(file for file in files if file is not None)):
        check_writable(path)
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)


def json_text(result: Mapping[str, Any]) -> str:
    """Return a result as the text of a JSON file.  Raises ValueError where a number in it is not finite."""
    return json.dumps(result, indent=1, allow_nan=False) + "\n"


def write_json(text: str, json_to: str) -> None:
    """Write the text of a JSON file to a path, or to standard output ("-").  Raises RecordingError."""
    if json_to == "-":
        print(text, end="")
    else:
        write_text_atomic(Path(json_to), text, sync=True)


def say(line: object) -> None:
    """Print one line on standard error, after the program's name."""
    print(f"levimass: {line}", file=sys.stderr, flush=True)


def say_problem(shot: Shot) -> None:
    """Say why a shot was not analysed or not fitted, where that is so."""
    if shot.problem:
        say(problem_line(shot.path or shot.name, shot.problem))
    elif shot.fit_problem:
        say(problem_line(shot.path or shot.name, f"not fitted: {shot.fit_problem}"))


def problem_line(path: str, problem: str) -> str:
    """Return what is wrong with a shot in one line, with the file's name in it once."""
    flat = one_line(path, 600)
    return problem if Path(flat).name in problem else f"{flat}: {problem}"


def in_a_line(error: Exception, otherwise: object) -> str:
    """Return file and cause of an error; ``otherwise`` is named where the error names no file itself."""
    if isinstance(error, OSError):
        return f"{error.filename or otherwise}: {error.strerror or error}"
    text = str(error)
    return text if isinstance(error, RecordingError) else f"{otherwise}: {text}"


def own_fault(error: Exception) -> AnalysisError:
    """Return the error that reports a fault of this program: it must not stop the other outputs."""
    return AnalysisError(f"a fault of the program: {type(error).__name__}: {' '.join(str(error).split())}")
