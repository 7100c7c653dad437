"""A law written by the user, or learned from data: an effect like those of the catalogue, made from a formula.

The solver chooses its steps by the law's fastest rate, which comes from the slopes of the formula over the motion of a
collision.
"""

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np

from analysis.collision.effects import CATALOGUE, NUISANCES, WIDER_EFFECTS, effect_named
from analysis.collision.effects.kernel import ON_BLOCK, ON_PLATE, PAIR
from analysis.collision.effects.row import Acts, Effect, Parameter
from analysis.collision.laws.formula import STATE, TIME, Formula, FormulaError, kernel_of, read
from analysis.collision.parameters import PAPER, Collision, Floats

MAX_PARAMETERS = 3
PLACES = {
    "block": (Acts.ON_BLOCK, ON_BLOCK),
    "plate": (Acts.ON_PLATE, ON_PLATE),
    "contact": (Acts.IN_CONTACT, PAIR),
}
_PLACE_NAMES = ("x", "y", "d")
_STEP = 1e-30
_RANDOM_STATES = 400
_UNIT_DRAWS = np.random.default_rng(1).uniform(-1.0, 1.0, (6, _RANDOM_STATES))


class LawError(ValueError):
    """The reason why a law cannot be used, in one line."""


@dataclass(frozen=True, slots=True, eq=False, repr=False, kw_only=True)
class UserLaw(Effect):
    """A law as it was written, with the functions that the solver and the search need.

    ``where`` is "block", "plate" or "contact" (between the two; the force on the block).  The formula's force is in N,
    positive to the right; ``parameters`` keep their written order.  ``definition`` is the whole law as JSON.
    """

    where: str
    formula: Formula
    definition: str = field(init=False)

    def __post_init__(self) -> None:
        text = json.dumps(self.written(), ensure_ascii=False, separators=(",", ":"))
        object.__setattr__(self, "definition", text)

    @property
    def key(self) -> str:
        """Get the name followed by the definition; ``law_from_key`` restores the law from it."""
        return self.name + self.definition

    @property
    def short_words(self) -> str:
        """Get the words given with the law."""
        return self.words

    def written(self) -> dict[str, Any]:
        """Return the law as a table that ``law_from_table`` reads."""
        table: dict[str, Any] = {
            "name": self.name, "words": self.words, "where": self.where, "formula": self.formula.text,
        }  # fmt: skip
        table["parameters"] = {
            p.name: {"unit": p.unit, "start": p.tried[0]}
            | ({"lower": p.lower} if math.isfinite(p.lower) else {})
            | ({"upper": p.upper} if math.isfinite(p.upper) else {})
            | ({"own": True} if p.own else {})
            for p in self.parameters
        }
        return table

    def __hash__(self) -> int:
        return hash(self.definition)

    def __reduce__(self) -> tuple[Callable[[str], "UserLaw"], tuple[str]]:
        return law_from_key, (self.key,)


def law_from_table(table: Mapping[str, Any]) -> UserLaw:
    """Return the law that a table describes (docs/own-laws.md).  Raises LawError, which names the faulty key."""
    _check_keys(table, ("name", "words", "where", "formula", "parameters"))
    name, where, text = (_text(table, key) for key in ("name", "where", "formula"))
    _check_name(name)
    if where not in PLACES:
        raise LawError(f"where: {where!r}, but a law acts on {', '.join(PLACES)}")
    words = _text(table, "words") if "words" in table else name.replace("_", " ").strip() or name
    given = table.get("parameters")
    if not isinstance(given, Mapping) or not 1 <= len(given) <= MAX_PARAMETERS:
        raise LawError(f"parameters: a law has one to {MAX_PARAMETERS} of them")
    parameters = tuple(_parameter(key, value) for key, value in given.items())
    return _law(name, words, where, _formula(text, where, parameters), parameters)


@cache
def law_from_key(key: str) -> UserLaw:
    """Return the law with this ``key``, as stored in files.  Raises LawError."""
    name, brace, rest = key.partition("{")
    try:
        return law_from_table(json.loads(brace + rest))
    except (ValueError, RecursionError) as why:
        raise LawError(f"no law can be read from {name!r}: {why}") from None


def known_effect(key: str) -> Effect | None:
    """Return the catalogue effect or law that a file stores under this ``key``; None if there is none."""
    if key in CATALOGUE or key in WIDER_EFFECTS or key in NUISANCES:
        return effect_named(key)
    try:
        law = law_from_key(key)
    except LawError:
        return None
    return law if law.key == key else None


def _check_keys(table: Mapping[str, Any], known: Sequence[str], inside: str = "") -> None:
    for key in table:
        if key not in known:
            raise LawError(f"{inside}unknown key {key!r}; there are {', '.join(known)}")


def _check_name(name: str) -> None:
    if not name.isidentifier() or not name.isascii() or len(name) > 40:
        raise LawError(f"name: {name!r} is not a word of letters, digits and _ (at most 40)")
    if name in CATALOGUE:
        raise LawError(f"name: the catalogue has an effect called {name!r} already")


def _formula(text: str, where: str, parameters: Sequence[Parameter]) -> Formula:
    try:
        formula = read(text, [p.name for p in parameters])
    except FormulaError as error:
        raise LawError(f"formula: {error}") from None
    if not formula.state and where != "contact":  # in contact a constant acts only while the bodies touch
        raise LawError(f"formula: it names nothing of the motion ({', '.join(STATE)})")
    if formula.timed and where == "contact":
        raise LawError(
            "formula: t is for laws of the block or the plate; in contact name d, d_rate or the plate's bend"
        )
    return formula


def _text(table: Mapping[str, Any], key: str) -> str:
    value = table.get(key)
    if not isinstance(value, str) or not value.strip():
        raise LawError(f"{key}: missing, or not a text" if key in table else f"{key}: missing")
    return value.strip()


def _parameter(name: str, table: object) -> Parameter:
    if not name.isidentifier() or not name.isascii() or name.startswith("_"):
        raise LawError(f"parameters: {name!r} is not a word of letters, digits and _")
    if not isinstance(table, Mapping):
        raise LawError(f"parameters.{name}: write it as {{unit = ..., start = ...}}")
    _check_keys(table, ("unit", "start", "lower", "upper", "own"), f"parameters.{name}: ")
    unit = table.get("unit")
    if not isinstance(unit, str):
        raise LawError(f'parameters.{name}.unit: missing ("" where it has none)')
    own = table.get("own", False)
    if not isinstance(own, bool):
        raise LawError(f"parameters.{name}.own: true where every shot has its own value, or false")
    start = _number(name, table, "start", math.nan)
    lower, upper = _number(name, table, "lower", -math.inf), _number(name, table, "upper", math.inf)
    if not start or not math.isfinite(start):
        raise LawError(f"parameters.{name}.start: a finite number other than 0, of the size to be expected")
    if not lower <= start <= upper or lower == upper:
        raise LawError(f"parameters.{name}: start {start:g} is not between {lower:g} and {upper:g}")
    return Parameter(name, unit, abs(start), lower, upper, tried=(start,), own=own)


def _number(name: str, table: Mapping[str, Any], key: str, otherwise: float) -> float:
    value = table.get(key, otherwise)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise LawError(f"parameters.{name}.{key}: {value!r} is not a number")
    try:
        return float(value)
    except OverflowError:
        raise LawError(f"parameters.{name}.{key}: beyond all size") from None


@cache
def _law(name: str, words: str, where: str, formula: Formula, parameters: tuple[Parameter, ...]) -> UserLaw:
    acts, adds_to = PLACES[where]
    return UserLaw(
        name,
        words,
        acts,
        parameters,
        _amplitude(formula, parameters),
        kernel_of(formula, adds_to, while_touching=acts is Acts.IN_CONTACT),
        rough=acts is Acts.IN_CONTACT,
        nonlinear=not formula.straight,
        kinked=formula.kinked,
        hidden=int(formula.timed),
        fastest=lambda values, collision: _fastest(where, formula, parameters, values, collision),
        where=where,
        formula=formula,
    )


def _amplitude(formula: Formula, parameters: Sequence[Parameter]) -> str:
    """Return a shared parameter whose value 0 turns the law off, preferably one in which the law is linear."""
    states, start = _random_states(PAPER), {p.name: p.tried[0] for p in parameters}
    with np.errstate(all="ignore"):
        here = np.broadcast_to(formula.values(states, start), (_RANDOM_STATES,))
        if not np.all(np.isfinite(here)):
            raise LawError("formula: no finite force somewhere within an ordinary collision, at the parameters' start")
        if not np.any(here):
            raise LawError("formula: no force anywhere within an ordinary collision, at the parameters' start")
        off, linear = [], []
        for name, value in ((p.name, p.tried[0]) for p in parameters if not p.own):
            nothing = np.asarray(formula.values(states, start | {name: 0.0}))
            if np.all(np.isfinite(nothing)) and not np.any(nothing):
                off.append(name)
                if np.allclose(formula.values(states, start | {name: 2 * value}), 2 * here, rtol=1e-9, atol=0):
                    linear.append(name)
    if not off:
        shared = "parameter" if not any(p.own for p in parameters) else "parameter that the shots share"
        raise LawError(f"formula: no {shared} turns the law off at 0; multiply it by one")
    return (linear or off)[0]


def _random_states(collision: Collision) -> dict[str, Floats]:
    """Return random states within the motion of a collision, arrays of shape (_RANDOM_STATES,)."""
    c = collision
    speed = abs(c.velocity_in_m_per_s)
    inverse = 1 / c.block_mass_kg + 1 / c.plate_mass_kg
    overlap = speed / math.sqrt(c.contact_stiffness_n_per_m * inverse)
    deepest = speed * c.contact_time_estimate_s / math.pi
    u = _UNIT_DRAWS
    bend = 0.5 * deepest * (u[2] - 1.0)
    return {
        "x": 1.2 * bend + overlap * u[0], "v": speed * u[1], "y": bend, "u": 2 * speed * u[3],
        "d": 0.5 * overlap * (u[4] + 1.0), "d_rate": speed * u[5], "t": c.contact_time_estimate_s * (u[0] + 1.0),
    }  # fmt: skip


def _fastest(
    where: str, formula: Formula, parameters: Sequence[Parameter], values: Floats, collision: Collision
) -> float:
    """Return the law's fastest rate in rad/s, from its slopes in position and velocity over the motion."""
    given = {p.name: float(v) for p, v in zip(parameters, values, strict=True)}
    on_plate = where != "block" and math.isfinite(collision.plate_mass_kg)
    mass = min(collision.block_mass_kg, collision.plate_mass_kg) if on_plate else collision.block_mass_kg
    states, rate = _random_states(collision), 0.0
    for name in formula.state:
        if name == TIME:
            rate = max(rate, _rate_of_change(formula, given, states))
            continue
        with np.errstate(all="ignore"):
            slope = np.imag(formula.values(states | {name: states[name] + 1j * _STEP}, given)) / _STEP / mass
        steep = float(np.max(np.abs(slope), initial=0.0, where=np.isfinite(slope)))
        rate = max(rate, math.sqrt(steep) if name in _PLACE_NAMES else steep)
    return rate


def _rate_of_change(formula: Formula, given: Mapping[str, float], states: Mapping[str, Floats]) -> float:
    """Return the rate in rad/s at which the law changes in time: rms derivative over rms force."""
    with np.errstate(all="ignore"):
        moved = formula.values({**states, TIME: states[TIME] + 1j * _STEP}, given)
    force, rate = np.real(moved), np.imag(moved) / _STEP
    size = math.sqrt(float(np.mean(force**2, where=np.isfinite(force))))
    return math.sqrt(float(np.mean(rate**2, where=np.isfinite(rate)))) / size if size > 0.0 else 0.0
