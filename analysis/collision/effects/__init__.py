"""The catalogue of effects that the base model may lack: one small function and one row per effect."""

from collections.abc import Iterable, Mapping

from analysis.collision.effects import in_contact, on_block, on_plate, on_sensor
from analysis.collision.effects.row import Acts, Effect, Parameter

CATALOGUE: Mapping[str, Effect] = {
    row.name: row for rows in (on_block.ROWS, on_plate.ROWS, in_contact.ROWS, on_sensor.ROWS) for row in rows
}
NUISANCES: Mapping[str, Effect] = {row.name: row for row in on_block.NUISANCES}  # per shot, and never a finding
WIDER: Mapping[str, Effect] = {row.name: row for row in on_sensor.WIDER}  # tried if the effect they widen was found
MOST_AT_ONCE = 3


def findings(names: Iterable[str]) -> tuple[str, ...]:
    """Return those of the named effects that a diagnosis may find: all but the nuisances."""
    return tuple(name for name in names if name not in NUISANCES)


def sensors(names: Iterable[str]) -> list[Effect]:
    """Return those of the named effects that act on the measured path, in the order in which they act.

    The cyclic error comes last, as it depends on the path with lag and vibration.
    """
    wanted = set(names)
    places = [row for row in CATALOGUE.values() if row.sensor is not None]
    wider = [row for row in WIDER.values() if row.name in wanted]
    rows = [one for row in places for one in (row, *(other for other in wider if other.widens == row.name))]
    return [row for row in rows if row.name in wanted]


def named(name: str) -> Effect:
    """Return the effect called ``name``, or the law in the name (``laws.own``).  Raises ValueError."""
    if "{" in name:
        from analysis.collision.laws.own import from_key  # imports this module

        return from_key(name).effect
    if name in NUISANCES:
        return NUISANCES[name]
    if name in WIDER:
        return WIDER[name]
    try:
        return CATALOGUE[name]
    except KeyError:
        raise ValueError(f"no effect {name!r}; there are {', '.join(CATALOGUE)}") from None


__all__ = [
    "CATALOGUE",
    "MOST_AT_ONCE",
    "NUISANCES",
    "WIDER",
    "Acts",
    "Effect",
    "Parameter",
    "findings",
    "named",
    "sensors",
]
