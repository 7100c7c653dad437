"""``levimass --paper``: every number of the paper beside this program's, and figures 4 to 7 from a recording."""

import json
import os
import sys
import textwrap
from pathlib import Path

from analysis.model.exact import TooManyEvents
from analysis.paper import PaperRow, Reproduction, Status, reproduce, to_result
from analysis.quantity import Quantity
from analysis.shot import Shot
from app.load import load_and_analyse
from app.outputs import in_a_line
from instrument.recording_error import RecordingError
from instrument.recording_search import find_recordings
from instrument.recording_writer import write_text_beside

SECTIONS = {
    "input": "What the paper's rig and simulation were made with",
    "simulation": "The simulation",
    "measurement": "The measurement",
    "plate": "The plate",
    "instrument": "The instrument",
}
SCALES = {"s": (1e3, "ms"), "m": (1e3, "mm"), "kg": (1e3, "g"), "Pa": (1e-9, "GPa"), "1": (1.0, "")}
OWN_SCALES = {"wavelength": (1e9, "nm"), "record_length": (1.0, "s"), "input.step_s": (1e9, "ns")}
_WIDTHS = (42, 24, 10, 10, 10, 25, 24)
_LINE = 120


def paper(json_to: str | None, figures_to: Path | None, recording: Path | None) -> int:
    """Print the reproduction; write it as JSON ("-": standard output) and figures 4 to 7 where asked for.

    Returns the exit status: 1 where the recording could not be analysed or something could not be written.
    """
    shot, ok = _shot(recording)
    try:
        result = reproduce(shot)
    except (TooManyEvents, ValueError) as error:
        print(f"levimass: the paper's model could not be solved: {error}", file=sys.stderr)
        return 1
    text = json.dumps(to_result(result), indent=1, allow_nan=False) + "\n"
    print(text if json_to == "-" else table(result), end="" if json_to == "-" else "\n")
    try:
        if json_to is not None and json_to != "-":
            write_text_beside(Path(json_to), text, sync=True)
        if figures_to is not None:
            ok = _figures(shot, figures_to, quiet=json_to == "-") and ok
    except (RecordingError, OSError) as error:
        print(f"levimass: {in_a_line(error, figures_to or json_to)}", file=sys.stderr)
        ok = False
    return 0 if ok else 1


def table(result: Reproduction) -> str:
    """Return the reproduction for a terminal: a line a number, and below it what a difference was traced to."""
    lines = [result.title, result.authors]
    head = ("", "paper", "as printed", "simulated", "recomputed", "recording", "difference")
    with_recording = result.recording is not None
    for section, words in SECTIONS.items():
        rows = [row for row in result.rows if row.section == section]
        lines += ["", words, _columns(head, with_recording)]
        for row in rows:
            lines.append(_columns(cells(row), with_recording))
            if row.traced_to:
                lines += textwrap.wrap(row.traced_to, _LINE - 4, initial_indent="    ", subsequent_indent="    ")
    count = {status: sum(row.status is status for row in result.rows) for status in Status}
    lines += ["", f"{count[Status.AGREES]} agree as printed, {count[Status.TRACED]} traced, {count[Status.OPEN]} open:"]
    lines += [f"  open: {row.what} ({shown(row, row.error_after, relative=True) or '–'})" for row in result.open_rows]
    return "\n".join(lines)


def cells(row: PaperRow) -> tuple[str, ...]:
    """Return a row as text: what, paper, as printed, simulated, recomputed, recording, difference and status."""
    said = row.paper_words or shown(row, row.paper) or "–"
    unit = unit_of(row)
    what = f"{row.what} ({unit})" if unit else row.what
    recorded = str(row.recorded.scaled(_scale(row)[0])) if isinstance(row.recorded, Quantity) else ""
    if row.status in (Status.INPUT, Status.ADDED):
        difference = row.status.value
    else:
        before, after = (shown(row, error, relative=True) for error in (row.error_before, row.error_after))
        change = before if row.error_before == row.error_after else f"{before} → {after or '–'}"
        difference = f"{change} {row.status.value}"
    numbers = (shown(row, value) for value in (row.printed, row.simulated, row.recomputed))
    return what, said, *numbers, recorded, difference


def shown(row: PaperRow, value: float | None, *, relative: bool = False) -> str:
    """Return a number of a row in its readable unit, or a relative difference in per cent; empty for None."""
    if value is None:
        return ""
    if relative:
        if value > 2.0:
            return f"×{value + 1.0:.{0 if value > 99.0 else 1}f}"
        if abs(value) < 5e-7:
            return "none"
        return f"{value * 1e6:+.0f} ppm" if abs(value) < 5e-4 else f"{value * 100.0:+.2g} %"
    return f"{value * _scale(row)[0]:.7g}"


def unit_of(row: PaperRow) -> str:
    """Return the readable unit that ``shown`` uses."""
    return _scale(row)[1]


def scale_of(row: PaperRow) -> float:
    """Return the factor from SI to the readable unit."""
    return _scale(row)[0]


def _scale(row: PaperRow) -> tuple[float, str]:
    return OWN_SCALES.get(row.key) or SCALES.get(row.unit, (1.0, row.unit))


def _columns(texts: tuple[str, ...], with_recording: bool) -> str:
    pairs = [pair for n, pair in enumerate(zip(texts, _WIDTHS, strict=True)) if with_recording or n != 5]
    return " ".join(text.ljust(width) for text, width in pairs).rstrip()


def _shot(recording: Path | None) -> tuple[Shot | None, bool]:
    if recording is None:
        return None, True
    try:
        found = list(find_recordings([recording]))
    except RecordingError as error:
        print(f"levimass: {error}", file=sys.stderr)
        return None, False
    if not found:
        print(f"levimass: {recording}: no recording there", file=sys.stderr)
        return None, False
    shot = load_and_analyse(found[0])
    if shot.problem:
        print(f"levimass: {shot.path or shot.name}: {shot.problem}", file=sys.stderr)
        return None, False
    return shot, True


def _figures(shot: Shot | None, folder: Path, *, quiet: bool) -> bool:
    if not os.environ.get("QT_QPA_PLATFORM"):
        os.environ["QT_QPA_PLATFORM"] = "offscreen"  # pictures need no screen
    try:
        from app.figures import write_figures
    except ImportError as error:
        print(f"levimass: figures need Qt, which does not start here: {error}", file=sys.stderr)
        return False
    for path in write_figures(shot, folder):
        if not quiet:
            print(path)
    if shot is None:
        print("levimass: no recording given: the figures show the simulation alone", file=sys.stderr)
    return True
