"""The catalogue of effects that the base model may lack: one small function and one row per effect."""

from collections.abc import Iterable, Mapping

from analysis.collision.effects import in_contact, on_block, on_plate, on_sensor
from analysis.collision.effects.row import Effect

CATALOGUE: Mapping[str, Effect] = {
    row.name: row for rows in (on_block.ROWS, on_plate.ROWS, in_contact.ROWS, on_sensor.ROWS) for row in rows
}
NUISANCES: Mapping[str, Effect] = {row.name: row for row in on_block.NUISANCES}  # fitted per shot, and never a finding
# tried if the effect they widen was found
WIDER_EFFECTS: Mapping[str, Effect] = {row.name: row for row in on_sensor.WIDER_EFFECTS}
MAX_EFFECTS = 3


def without_nuisances(effects: Iterable[Effect]) -> tuple[Effect, ...]:
    """Return those effects that a diagnosis may report as findings: all except the nuisances."""
    nuisances = set(NUISANCES.values())
    return tuple(effect for effect in effects if effect not in nuisances)


def sensor_effects(effects: Iterable[Effect]) -> list[Effect]:
    """Return those effects that act on the measured path, in the order in which they act.

    The cyclic error comes last, because it depends on the path that already includes lag and vibration.
    """
    order = list(CATALOGUE)  # one that widens another acts right after it
    acting = {effect for effect in effects if effect.sensor is not None}
    return sorted(acting, key=lambda effect: (order.index(effect.widens or effect.name), effect.widens))


def effect_named(name: str) -> Effect:
    """Return the effect called ``name`` in the catalogue.  Raises ValueError."""
    for rows in (CATALOGUE, NUISANCES, WIDER_EFFECTS):
        if name in rows:
            return rows[name]
    raise ValueError(f"no effect is called {name!r}; there are {', '.join(CATALOGUE)}")


def effects_named(effects: Iterable[Effect | str]) -> tuple[Effect, ...]:
    """Return effects, after looking up those that a script gives by catalogue name.  Raises ValueError."""
    return tuple(effect_named(effect) if isinstance(effect, str) else effect for effect in effects)
