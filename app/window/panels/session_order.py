"""Sort, filter and group the shots of a session."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from app.session import Entry


@dataclass(frozen=True, slots=True)
class Order:
    """``column`` None: the order taken; all ``words`` must occur; ``group`` is one of ``GROUPS``."""

    column: int | None = None
    falling: bool = False
    words: str = ""
    group: str = ""


def _day(entry: Entry) -> str:
    shot = entry.shot
    return (shot.started_at or "")[:10] if shot is not None and shot.started_at else "no date"


def _series(entry: Entry) -> str:
    return entry.name.rstrip("0123456789").rstrip("-_ .") or entry.name


GROUPS: dict[str, tuple[str, Callable[[Entry], str]]] = {
    "day": ("day", _day),
    "series": ("series", _series),
    "verdict": ("verdict", lambda entry: entry.verdict or "not diagnosed"),
    "model": ("base model", lambda entry: entry.settings.model),
}


def ordered(
    entries: Sequence[Entry],
    order: Order,
    value: Callable[[Entry, int], float | str | None],
    searched: Callable[[Entry], str],
) -> tuple[Entry | str, ...]:
    """Return the entries in this order, a heading before each group.

    ``value`` gives what a column sorts by (a number, a text, or None), ``searched`` the text to search.
    """
    words = order.words.lower().split()
    seen = [entry for entry in entries if all(word in searched(entry).lower() for word in words)]
    column = order.column
    if column is not None:
        there = [entry for entry in seen if not _missing(value(entry, column))]
        missing = [entry for entry in seen if _missing(value(entry, column))]
        there.sort(key=lambda entry: _key(value(entry, column)), reverse=order.falling)
        seen = [*there, *missing]
    if order.group not in GROUPS:
        return tuple(seen)
    _, of = GROUPS[order.group]
    groups: dict[str, list[Entry]] = {}
    for entry in seen:
        groups.setdefault(of(entry), []).append(entry)
    rows: list[Entry | str] = []
    for name, members in groups.items():
        rows += [f"{name}   ({len(members)})", *members]
    return tuple(rows)


def _missing(value: float | str | None) -> bool:
    return value is None or value == "" or (isinstance(value, float) and math.isnan(value))


def _key(value: float | str | None) -> tuple[float, str]:
    return (0.0, value.lower()) if isinstance(value, str) else (float(value or 0.0), "")
