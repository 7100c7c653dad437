"""``levimass paper``: compare the paper's numbers with this program's, and draw the paper's figures 4 to 7."""

import os
import textwrap
from pathlib import Path

from analysis.collision import Infeasible
from analysis.paper import Reproduction, Status, reproduce, to_result
from analysis.shot import Shot
from app.command_line.outputs import error_line, json_text, say, say_problem, write_json
from app.report import PAPER_SECTIONS, paper_cells, shown_number
from app.session import load_and_analyse
from instrument.files import RecordingError, find_recordings

_WIDTHS = (42, 24, 10, 10, 10, 25, 24)
_LINE = 120


def paper(json_to: str | None, figures_to: Path | None, recording: Path | None) -> int:
    """Print the comparison; if requested, write it as JSON ("-": standard output) and draw figures 4 to 7.

    Returns the exit status: 1 if the recording could not be analysed or an output could not be written.
    """
    shot, ok = _shot(recording)
    try:
        result = reproduce(shot)
    except (Infeasible, ValueError) as error:
        say(f"the paper's model could not be solved: {error}")
        return 1
    if json_to != "-":
        print(table(result))
    try:
        if json_to is not None:
            write_json(json_text(to_result(result)), json_to)
        if figures_to is not None:
            ok = _figures(shot, figures_to, quiet=json_to == "-") and ok
    except (RecordingError, OSError) as error:
        say(error_line(error, figures_to or json_to))
        ok = False
    return 0 if ok else 1


def table(result: Reproduction) -> str:
    """Return the comparison for a terminal: a line for each number, followed by the cause of a difference."""
    lines = [result.title, result.authors]
    head = ("", "paper", "as printed", "simulated", "recomputed", "recording", "difference")
    with_recording = result.recording is not None
    for section, words in PAPER_SECTIONS.items():
        rows = [row for row in result.rows if row.section == section]
        lines += ["", words, _columns(head, with_recording)]
        for row in rows:
            lines.append(_columns(paper_cells(row), with_recording))
            if row.traced_to:
                lines += textwrap.wrap(row.traced_to, _LINE - 4, initial_indent="    ", subsequent_indent="    ")
    count = {status: sum(row.status is status for row in result.rows) for status in Status}
    lines += [
        "",
        f"{count[Status.AGREES]} agree as printed, {count[Status.TRACED]} explained, {count[Status.OPEN]} unresolved:",
    ]
    lines += [
        f"  unresolved: {row.what} ({shown_number(row, row.error_after, relative=True) or '–'})"
        for row in result.open_rows
    ]
    return "\n".join(lines)


def _columns(texts: tuple[str, ...], with_recording: bool) -> str:
    pairs = [pair for n, pair in enumerate(zip(texts, _WIDTHS, strict=True)) if with_recording or n != 5]
    return " ".join(text.ljust(width) for text, width in pairs).rstrip()


def _shot(recording: Path | None) -> tuple[Shot | None, bool]:
    if recording is None:
        return None, True
    try:
        found = find_recordings([recording])
    except RecordingError as error:
        say(error)
        return None, False
    if not found:
        say(f"{recording}: no recording found")
        return None, False
    shot = load_and_analyse(found[0])
    if shot.problem:
        say_problem(shot)
        return None, False
    return shot, True


def _figures(shot: Shot | None, folder: Path, *, quiet: bool) -> bool:
    if not os.environ.get("QT_QPA_PLATFORM"):
        os.environ["QT_QPA_PLATFORM"] = "offscreen"  # no display is needed
    try:
        from app.command_line.figures import write_figures
    except ImportError as error:
        say(f"figures need Qt, which does not start here: {error}")
        return False
    for path in write_figures(shot, folder):
        if not quiet:
            print(path)
    if shot is None:
        say("no recording given: the figures show the simulation alone")
    return True
