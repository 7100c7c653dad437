"""The catalogue of what the base model may lack: one small function and one row an effect."""

from collections.abc import Iterable, Mapping

from analysis.collision.effects import in_contact, on_block, on_plate, on_sensor, taken_along
from analysis.collision.effects.row import Acts, Effect, Parameter

CATALOGUE: Mapping[str, Effect] = {
    row.name: row for rows in (on_block.ROWS, on_plate.ROWS, in_contact.ROWS, on_sensor.ROWS) for row in rows
}
TAKEN_ALONG: Mapping[str, Effect] = {row.name: row for row in taken_along.ROWS}  # each shot's own, no finding
WIDER: Mapping[str, Effect] = {row.name: row for row in on_sensor.WIDER}  # asked where what they widen was found
MOST_AT_ONCE = 3


def findings(names: Iterable[str]) -> tuple[str, ...]:
    """Return those of the named effects that a diagnosis may find: not what is only taken along."""
    return tuple(name for name in names if name not in TAKEN_ALONG)


def sensors(names: Iterable[str]) -> list[Effect]:
    """Return those of the named effects that act on what is measured, in the order in which they act.

    A ripple of the light repeats with the path that is shown, lag and frame and all, whichever was found first.
    """
    wanted = set(names)
    places = [row for row in CATALOGUE.values() if row.sensor is not None]
    wider = [row for row in WIDER.values() if row.name in wanted]
    rows = [one for row in places for one in (row, *(other for other in wider if other.widens == row.name))]
    return [row for row in rows if row.name in wanted]


def named(name: str) -> Effect:
    """Return the effect called ``name``, or the law that the name holds (``laws.own``); ValueError lists those of
    the catalogue."""
    if "{" in name:
        from analysis.collision.laws.own import from_key  # the catalogue does without it

        return from_key(name).effect
    if name in TAKEN_ALONG:
        return TAKEN_ALONG[name]
    if name in WIDER:
        return WIDER[name]
    try:
        return CATALOGUE[name]
    except KeyError:
        raise ValueError(f"no effect {name!r}; there are {', '.join(CATALOGUE)}") from None


__all__ = [
    "CATALOGUE",
    "MOST_AT_ONCE",
    "TAKEN_ALONG",
    "WIDER",
    "Acts",
    "Effect",
    "Parameter",
    "findings",
    "named",
    "sensors",
]
