"""Read text tables of oscilloscopes and data loggers: a few header lines, then one row per sample."""

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from io import StringIO
from itertools import islice, pairwise
from pathlib import Path
from typing import TextIO

import numpy as np
from numpy.typing import NDArray

from instrument.files.foreign_file import (
    MAX_SAMPLES,
    ForeignChannel,
    ForeignColumn,
    ForeignContents,
    checked_channels,
)
from instrument.files.recording_error import RecordingError, one_line
from instrument.files.text_file import open_regular

_LARGEST_BYTES = 2 * 2**30
_HEADER_BYTES, _HEADER_LINES = 2**18, 200  # the first row must begin within these
_ROWS = 2**19  # rows read at once
_DELIMITERS = (";", "\t", ",", " ")
_TIME_NAME = re.compile(r"(time|zeit|t|seconds?)\b", re.IGNORECASE)
_TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "μs": 1e-6, "ns": 1e-9}
_TIME_SUFFIX = re.compile(r"(?:time|zeit|t)_([mun\u00b5\u03bc]?s)$", re.IGNORECASE)
_NUMBER = re.compile(r"[+-]?((\d+[.,]?\d*|[.,]\d+)(e[+-]?\d+)?|nan|inf)", re.IGNORECASE)
_UNIT_CELL = re.compile(r"[\[(].{1,12}[\])]|\S{0,3}")
_UNIT = re.compile(r"^(.*?)\s*[\[(]([^\])]{1,12})[\])]$")


@dataclass(frozen=True, slots=True)
class _Layout:
    delimiter: str
    decimal_comma: bool
    first_row: int  # number of header lines
    names: tuple[str, ...]
    units: tuple[str, ...]
    time_column: int | None
    step_s: float | None = None  # stated in the header


def contents(path: Path) -> ForeignContents:
    """Return all columns except the time; the rate is that of the mean step of the first thousand rows."""
    layout = _layout(path)
    rows = _rows(path, layout)
    rate = 1.0 / layout.step_s if layout.step_s else None
    if layout.time_column is not None:
        with _text(path) as file:
            start = next(_blocks(path, file, layout, [layout.time_column], 1000))[:, 0]
        span = float(start[-1] - start[0])
        rate = (start.size - 1) / (span * _seconds(layout)) if span > 0.0 and np.isfinite(span) else None
    found = [
        ForeignChannel(name, rows, "text", unit, rate)
        for index, (name, unit) in enumerate(zip(layout.names, layout.units, strict=True))
        if index != layout.time_column
    ]
    return ForeignContents(path, "csv", checked_channels(path, found))


def columns(path: Path, names: Sequence[str], timed: bool) -> list[ForeignColumn]:
    """Return the named columns; if ``timed``, with the rate of the time column (equal steps required) or header.

    Raises RecordingError for a row without numbers and for unequal time steps.
    """
    layout = _layout(path)
    wanted = [layout.names.index(name) for name in names]
    time_column = layout.time_column if timed else None
    read = wanted if time_column is None else [*wanted, time_column]
    parts: list[NDArray[np.float64]] = []
    rows = 0
    with _text(path) as file:
        for block in _blocks(path, file, layout, read, _ROWS):
            rows += block.shape[0]
            if rows > MAX_SAMPLES:
                raise RecordingError(path, f"more than {MAX_SAMPLES} rows")
            parts.append(block)
    if rows < 2:
        raise RecordingError(path, f"{rows} rows of numbers, at least 2 are needed")
    table = np.concatenate(parts)
    stated = 1.0 / layout.step_s if layout.step_s and timed else None
    rate = stated if time_column is None else _even_rate(path, layout, table[:, -1])
    return [ForeignColumn(np.ascontiguousarray(table[:, i]), sample_rate_hz=rate) for i in range(len(wanted))]


def timed_column(path: Path, name: str, rate_hz: float | None) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the time in s and the numbers of one column, each of shape (n,).

    The time follows from ``rate_hz`` if given, else from the table's time column, whose steps need not be equal, else
    from the step in the header.  Raises RecordingError.
    """
    layout = _layout(path)
    if rate_hz is None and layout.time_column is not None:
        time, values = columns(path, [layout.names[layout.time_column], name], False)
        return time.values * _seconds(layout), values.values  # type: ignore[return-value] # floats, all of them
    step_s = 1.0 / rate_hz if rate_hz else layout.step_s
    if step_s is None:
        raise RecordingError(path, "no column is the time; give the rate (--rate)")
    values = columns(path, [name], False)[0]
    return np.arange(values.values.size) * step_s, values.values  # type: ignore[return-value]


def _even_rate(path: Path, layout: _Layout, time: NDArray[np.float64]) -> float:
    step = float(time[-1] - time[0]) / (time.size - 1)
    if not (np.isfinite(step) and step > 0.0):
        raise RecordingError(path, "the time does not rise; give the rate in the mapping (--rate)")
    off = np.abs(time - (time[0] + step * np.arange(time.size)))
    worst = int(np.argmax(off))
    if not off[worst] < 0.4 * step:
        row = layout.first_row + worst + 1
        cause = f"time steps are not equal (line {row}); if the true steps are, give the rate in the mapping (--rate)"
        raise RecordingError(path, cause)
    return 1.0 / (step * _seconds(layout))


def _layout(path: Path) -> _Layout:
    lines = _beginning(path)
    found = {delimiter: row for delimiter in _DELIMITERS if (row := _first_row(lines, delimiter)) is not None}
    if not found:
        raise RecordingError(path, f"no row of numbers in its first {len(lines)} lines" if lines else "file is empty")
    delimiter = max(found, key=lambda one: found[one][0])  # the one that makes most columns
    width, first = found[delimiter]
    comma = delimiter != "," and any("," in line for line in lines[first:])  # any row, as the first may be all zeros
    above, step_s = _above([_cells(line, delimiter) for line in lines[:first]], width)
    names, units = _names_and_units(above, width)
    times = [n for n, name in enumerate(names) if _TIME_NAME.match(name) or units[n] in _TIME_UNITS]
    time = times[0] if times and width > 1 else None
    return _Layout(delimiter, comma, first, tuple(names), tuple(units), time, step_s)


def _first_row(lines: Sequence[str], delimiter: str) -> tuple[int, int] | None:
    """Return the number of cells and the index of the first row of numbers, or None."""
    odd = False  # True after a lone row of numbers in the header (a count of samples), until the next text line
    for index, line in enumerate(lines):
        cells = _cells(line, delimiter)
        if not cells or not all(map(_is_number, cells)):
            odd = False
        elif not odd:
            following = _cells(lines[index + 1], delimiter) if index + 1 < len(lines) else cells
            odd = len(following) != len(cells) or not any(map(_is_number, following))
            if not odd:
                return len(cells), index
    return None


def _above(header: Sequence[list[str]], width: int) -> tuple[list[list[str]], float | None]:
    """Return the header lines that have a cell above each column, and the time step in s if the header states it."""
    if above := [cells for cells in header if len(cells) == width]:
        return above, None
    # oscilloscopes write "X,CH1,CH2,Start,Increment" above rows of three
    wider = [cells for cells in header if len(cells) > width]
    named = [cells[:width] for cells in wider if not any(map(_is_number, cells[:width]))]
    return named[:1], _stated_step(wider)


def _names_and_units(above: Sequence[Sequence[str]], width: int) -> tuple[list[str], list[str]]:
    """Return name and unit ("": none) of each column from the header lines above it, of which the last may be units."""
    heads = above[-1] if above else [""] * width
    units = [""] * width
    if len(above) > 1 and all(map(_UNIT_CELL.fullmatch, heads)):
        heads, units = above[-2], [cell.strip("()[]") for cell in heads]
    split = [(head, unit) if unit else _name_and_unit(head) for head, unit in zip(heads, units, strict=True)]
    names = [one_line(name, 60) or f"column {n}" for n, (name, _) in enumerate(split, 1)]
    return list(_distinct(names)), [unit for _, unit in split]


def _name_and_unit(head: str) -> tuple[str, str]:
    """Split "force [N]"; of "time_ms" return all and the unit; the unit is "" if none is stated."""
    if match := _UNIT.match(head):
        return match[1] or head, match[2]
    match = _TIME_SUFFIX.match(head)
    return head, match[1] if match else ""


def _distinct(names: Sequence[str]) -> Iterator[str]:
    """Yield the names, each repetition with its number."""
    seen = Counter[str]()
    for name in names:
        seen[name] += 1
        yield f"{name} ({seen[name]})" if seen[name] > 1 else name


def _stated_step(header: Sequence[Sequence[str]]) -> float | None:
    """Return the time step in s below "Increment" in an oscilloscope's header, or None."""
    for names, values in pairwise(header):
        for name, value in zip(names, values, strict=False):
            if name.lower() == "increment" and _is_number(value):
                step_s = float(value.replace(",", "."))
                return step_s if step_s > 0.0 else None
    return None


def _beginning(path: Path) -> list[str]:
    with open(open_regular(path), "rb") as file:
        size = file.seek(0, 2)
        if size > _LARGEST_BYTES:
            raise RecordingError(path, f"larger than {_LARGEST_BYTES // 2**20} MiB")
        file.seek(0)
        raw = file.read(_HEADER_BYTES)
    if b"\x00" in raw:
        raise RecordingError(path, "not a text table")
    lines = list(StringIO(raw.decode("utf-8-sig", "replace"), newline=None))  # same line ends as in ``_text``
    return lines[: -1 if size > len(raw) else None][:_HEADER_LINES]


def _cells(line: str, delimiter: str) -> list[str]:
    cells = [cell.strip().strip('"') for cell in (line.split() if delimiter == " " else line.split(delimiter))]
    while cells and not cells[-1]:
        cells.pop()  # many programs end their lines with a delimiter
    return cells


def _is_number(cell: str) -> bool:
    return _NUMBER.fullmatch(cell) is not None


def _seconds(layout: _Layout) -> float:
    """Return the unit of the time column in s."""
    assert layout.time_column is not None
    return _TIME_UNITS.get(layout.units[layout.time_column], 1.0)


def _text(path: Path) -> TextIO:
    return open(path, encoding="utf-8-sig", errors="replace")


def _blocks(
    path: Path, file: TextIO, layout: _Layout, wanted: Sequence[int], rows: int
) -> Iterator[NDArray[np.float64]]:
    """Yield blocks of at most ``rows`` rows of the wanted columns, shape (n, len(wanted))."""
    lines: Iterator[str] = islice(file, layout.first_row, None)
    if layout.decimal_comma:
        lines = (line.replace(",", ".") for line in lines)
    if '"' in _beginning(path)[layout.first_row]:
        lines = (line.replace('"', "") for line in lines)
    delimiter = None if layout.delimiter == " " else layout.delimiter
    at = layout.first_row
    while block := list(islice(lines, rows)):
        try:
            values = np.loadtxt(
                block, delimiter=delimiter, usecols=list(wanted), ndmin=2, dtype=np.float64, comments=None
            )
        except (ValueError, IndexError, OverflowError) as error:
            # loadtxt counts rows from 1 in some errors and from 0 in others; only the start of the block is certain
            cause = str(error).split(";")[0]
            raise RecordingError(path, f"{cause}, counted from line {at + 1}") from None
        if values.size:
            yield values
        at += len(block)


def _rows(path: Path, layout: _Layout) -> int:
    with open(path, "rb") as file:
        count, last = 0, b"\n"
        while block := file.read(2**20):
            count += block.count(b"\n")
            last = block[-1:]
    return max(0, count + (last != b"\n") - layout.first_row)
