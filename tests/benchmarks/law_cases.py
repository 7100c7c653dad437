"""The blind cases of laws off the catalogue: which law, how large, on which rig; and running one of them.

The shots come from ``tests.law_rigs``, which shares nothing with the analysis.
"""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from analysis.shot.motion import Motion
from tests.law_rigs import Bodies, Force, LawRig, Memory

NOISE_M = 1e-10
NORMS = (20.0, 20_000.0)  # of the noise: what a law leaves beside the base
_SMALL = 1e-3  # of the size drawn: there the norms grow as the size, and no friction holds the plate
SPEEDS = (0.13, 0.18, 0.25, 0.33, 0.42)


@dataclass(frozen=True, slots=True)
class LawCase:
    """One blind set before it is drawn; ``family`` "clean" has no law."""

    family: str
    seed: int
    shots: int = 3


@dataclass(frozen=True)
class Family:
    """A kind of law: where it acts, on what, in which form.

    ``draw`` gives its numbers, the size ``a`` among them, and what a rig of any size has of it.
    """

    where: str
    argument: str
    form: str
    draw: Callable[[np.random.Generator], tuple[dict[str, float], Callable[[float], dict[str, Any]]]]


@dataclass(frozen=True, slots=True)
class LawOutcome:
    """What was true, what was said."""

    case: LawCase
    true: tuple[tuple[str, str, str], ...]  # where, argument, form
    truth: dict[str, float]
    verdict: str
    effects: tuple[str, ...] = ()
    laws: tuple[dict[str, Any], ...] = ()
    chi2: tuple[float, float] = (math.nan, math.nan)
    held_out: tuple[float, float] | None = None
    held_out_chi2: float = math.nan
    norms: float = math.nan  # of what the base fit leaves, over the noise
    noise_m: float = NOISE_M
    seconds: float = 0.0
    classes: tuple[tuple[str, ...], ...] = ()  # of every effect, what it is said not to be told from
    beside: dict[str, float] = field(default_factory=dict)  # effect said: norms its row leaves of the law, at best
    problem: str = ""
    said: str = field(default="", compare=False)

    def as_json(self) -> dict[str, Any]:
        """Return a plain dictionary."""
        return asdict(self)


def _log(random: np.random.Generator, low: float, high: float) -> float:
    return float(math.exp(random.uniform(math.log(low), math.log(high))))


def _sign(random: np.random.Generator) -> float:
    return float(random.choice([-1.0, 1.0]))


def _at_x(x: float, *_: float) -> float:
    return x


def _at_v(_x: float, v: float, *_: float) -> float:
    return v


def _at_y(_x: float, _v: float, y: float, _u: float) -> float:
    return y


def _at_u(_x: float, _v: float, _y: float, u: float) -> float:
    return u


def _on_block(force: Force, *kinks: Force) -> dict[str, Any]:
    return {"on_block": force, "kinks": kinks}


def _on_plate(force: Force, *kinks: Force) -> dict[str, Any]:
    return {"on_plate": force, "kinks": kinks}


def _between(force: Force) -> dict[str, Any]:
    return {"between": force}


def _sgn(value: float) -> float:
    return 1.0 if value > 0 else -1.0


def _place_exponential(r: np.random.Generator) -> Any:
    a, b = _sign(r) * _log(r, 1e-4, 1e-2), _log(r, 2e-4, 1.5e-3)
    return {"a": a, "b": b}, lambda a: _on_block(lambda x, *_: a * math.exp(-abs(x) / b), _at_x)


def _place_bump(r: np.random.Generator) -> Any:
    a, b, c = _sign(r) * _log(r, 3e-4, 1e-2), r.uniform(2e-4, 6e-4), -r.uniform(3e-4, 1e-3)
    return {"a": a, "b": b, "c": c}, lambda a: _on_block(lambda x, *_: a * math.exp(-(((x - c) / b) ** 2)))


def _place_inverse_square(r: np.random.Generator) -> Any:
    a, b = _sign(r) * _log(r, 2e-4, 1e-2), _log(r, 2e-4, 1e-3)
    return {"a": a, "b": b}, lambda a: _on_block(lambda x, *_: a / (1 + abs(x) / b) ** 2, _at_x)


def _speed_power(r: np.random.Generator) -> Any:
    n = float(r.choice([0.5, 1.5, 3.0]))
    a = -_log(r, 3e-4, 5e-3) / 0.3**n
    return {"a": a, "n": n}, lambda a: _on_block(lambda _x, v, *_: a * abs(v) ** n * _sgn(v), _at_v)


def _speed_tanh(r: np.random.Generator) -> Any:
    a, b = -_log(r, 3e-4, 5e-3), r.uniform(0.03, 0.15)
    return {"a": a, "b": b}, lambda a: _on_block(lambda _x, v, *_: a * math.tanh(v / b))


def _one_way(r: np.random.Generator) -> Any:
    a = _sign(r) * _log(r, 5e-4, 1e-2) / 0.3**2
    return {"a": a}, lambda a: _on_block(lambda _x, v, *_: a * v * v)


def _squeeze(r: np.random.Generator) -> Any:
    a, b = -_log(r, 1e-3, 2e-2), _log(r, 2e-4, 1e-3)
    return {"a": a, "b": b}, lambda a: _on_block(lambda x, v, *_: a * math.exp(-abs(x) / b) * v, _at_x)


def _bend_hinge(r: np.random.Generator) -> Any:
    a, c = _log(r, 2.0, 60.0), -r.uniform(3e-4, 9e-4)
    return {"a": a, "c": c}, lambda a: _on_plate(lambda _x, _v, y, _u: a * max(0.0, c - y), lambda _x, _v, y, _u: y - c)


def _bend_power(r: np.random.Generator) -> Any:
    n = float(r.choice([1.5, 2.5]))
    a = -_log(r, 3e-3, 3e-2) / 1e-3**n
    return {"a": a, "n": n}, lambda a: _on_plate(lambda _x, _v, y, _u: a * abs(y) ** n * _sgn(y), _at_y)


def _plate_speed_power(r: np.random.Generator) -> Any:
    n = float(r.choice([1.5, 3.0]))
    a = -_log(r, 3e-4, 5e-3) / 0.2**n
    return {"a": a, "n": n}, lambda a: _on_plate(lambda _x, _v, _y, u: a * abs(u) ** n * _sgn(u), _at_u)


def _bend_against(r: np.random.Generator) -> Any:
    n = float(r.choice([1.5, 2.0]))
    a = -_log(r, 3e-4, 1e-2) / 1e-3**n
    return {"a": a, "n": n}, lambda a: _on_plate(lambda _x, _v, y, u: a * abs(y) ** n * _sgn(u), _at_u, _at_y)


def _bend_times_rate(r: np.random.Generator) -> Any:
    n = float(r.choice([1.0, 2.0]))
    a = -_log(r, 3e-3, 5e-2) / 1e-3**n
    return {"a": a, "n": n}, lambda a: _on_plate(lambda _x, _v, y, u: a * abs(y) ** n * u, _at_y)


def _overlap_power(r: np.random.Generator) -> Any:
    n = float(r.choice([1.7, 2.0, 2.5]))
    a = _log(r, 3e-3, 5e-2) / 3e-5**n
    return {"a": a, "n": n}, lambda a: _between(lambda x, _v, y, _u: a * max(y - x, 0.0) ** n)


def _overlap_reach(r: np.random.Generator) -> Any:
    a, b = -_log(r, 1e-3, 2e-2), _log(r, 3e-6, 3e-5)
    return {"a": a, "b": b}, lambda a: _between(lambda x, _v, y, _u: a * math.exp(-abs(y - x) / b))


def _overlap_rate_tanh(r: np.random.Generator) -> Any:
    a, b = _log(r, 2e-3, 3e-2), r.uniform(0.02, 0.15)
    return {"a": a, "b": b}, lambda a: _between(lambda _x, v, _y, u: a * math.tanh((u - v) / b))


def _overlap_times_rate(r: np.random.Generator) -> Any:
    n = float(r.choice([0.5, 1.5]))
    a = _log(r, 2e-2, 0.3) / 3e-5**n
    return {"a": a, "n": n}, lambda a: _between(lambda x, v, y, u: a * max(y - x, 0.0) ** n * (u - v))


def _bristle(r: np.random.Generator) -> Any:
    """A bristle on the block that bends until it slips: sigma z, z' = v - |v| z / z_slip."""
    top, slip = _log(r, 5e-4, 5e-3), _log(r, 5e-5, 4e-4)

    def rate(_x: float, v: float, _y: float, _u: float, z: float) -> float:
        return v - abs(v) * z / slip

    return {"a": top, "b": slip}, lambda a: {"memory": Memory(rate, on_block=lambda *s: -a * s[4] / slip)}


def _maxwell(r: np.random.Generator) -> Any:
    """A spring and a dashpot one after the other, beside the plate's own spring."""
    k, tau = _log(r, 1.0, 15.0), _log(r, 1e-3, 1e-2)

    def rate(_x: float, _v: float, _y: float, u: float, z: float) -> float:
        return u - z / tau

    return {"a": k, "tau": tau}, lambda a: {"memory": Memory(rate, on_plate=lambda *s: -a * s[4])}


FAMILIES: dict[str, Family] = {
    "place exponential": Family("block", "place", "exponential", _place_exponential),
    "place bump": Family("block", "place", "Gaussian off zero", _place_bump),
    "place inverse square": Family("block", "place", "inverse square", _place_inverse_square),
    "speed power": Family("block", "speed against the motion", "power", _speed_power),
    "speed tanh": Family("block", "speed against the motion", "tanh", _speed_tanh),
    "speed one way": Family("block", "speed one way", "quadratic", _one_way),
    "squeeze film": Family("block", "place times speed", "exponential", _squeeze),
    "bend hinge": Family("plate", "bend", "hinge below", _bend_hinge),
    "bend power": Family("plate", "bend", "power, odd", _bend_power),
    "plate speed power": Family("plate", "plate speed", "power, odd", _plate_speed_power),
    "bend against motion": Family("plate", "bend against motion", "power", _bend_against),
    "bend times rate": Family("plate", "bend times rate", "power", _bend_times_rate),
    "overlap power": Family("contact", "overlap", "power", _overlap_power),
    "overlap reach": Family("contact", "overlap", "exponential", _overlap_reach),
    "overlap rate tanh": Family("contact", "overlap rate", "tanh", _overlap_rate_tanh),
    "overlap times rate": Family("contact", "overlap times rate", "power", _overlap_times_rate),
    "bristle": Family("block", "memory", "", _bristle),
    "Maxwell arm": Family("plate", "memory", "", _maxwell),
}
TWO = (
    ("place exponential", "overlap power"),
    ("bend hinge", "speed one way"),
    ("squeeze film", "bend power"),
)


def cases(sets: int, clean: int, seed: int, only: str | None = None) -> list[LawCase]:
    """Return ``sets`` blind cases over all families in turn, with 3 to 5 shots, and ``clean`` without a law.

    ``only`` is a family, or "memory" for those that have one, or "pair".
    """
    kinds = [*FAMILIES, *(" and ".join(pair) for pair in TWO)]
    if only is not None:
        groups = {"memory": [n for n, f in FAMILIES.items() if f.argument == "memory"], "pair": kinds[len(FAMILIES) :]}
        kinds = groups.get(only, [only])
    found = [LawCase(kinds[i % len(kinds)], seed * 1_000_003 + i, 3 + i // len(kinds) % 3) for i in range(sets)]
    return found + [LawCase("clean", seed * 1_000_003 + 500_000 + i) for i in range(clean)]


def draw(case: LawCase) -> tuple[LawRig, tuple[tuple[str, str, str], ...], dict[str, float]]:
    """Return the rig of a case, its laws (where, argument, form) and their numbers."""
    random = np.random.default_rng((case.seed, 0x1A3))
    bodies = Bodies(
        block_kg=random.uniform(14e-3, 22e-3),
        plate_kg=random.uniform(1.5e-4, 3e-4),
        k_p=random.uniform(160.0, 260.0),
        k_n=_log(random, 6e3, 1.5e4),
        gamma_n=random.uniform(0.25, 0.5),
    )
    rig = LawRig(noise_m=NOISE_M, seed=case.seed, bodies=bodies)
    parts: dict[str, Any] = {}
    kinks: tuple[Force, ...] = ()
    true, numbers = [], {}
    for place, name in enumerate([] if case.family == "clean" else case.family.split(" and ")):
        family = FAMILIES[name]
        values, of_size = family.draw(random)
        values["a"] *= _SMALL
        alone = replace(rig, **of_size(values["a"]))
        values["a"] *= _log(random, *NORMS) / alone.norms(SPEEDS[: case.shots])
        part = of_size(values["a"])
        kinks += part.pop("kinks", ())
        parts |= part
        true.append((family.where, family.argument, family.form))
        numbers |= {f"{key}{place or ''}": value for key, value in values.items()}
    return replace(rig, **parts, kinks=kinks), tuple(true), numbers


ROWS: dict[str, dict[str, Any]] = {  # of the catalogue, each as a rig of its own, small
    "cubic_stiffness": _on_plate(lambda _x, _v, y, _u: -10.0 * y**3),
    "plate_damping": _on_plate(lambda _x, _v, _y, u: -1e-5 * u),
    "nonlinear_contact_damping": _between(lambda x, v, y, u: 10.0 * max(y - x, 0.0) * (u - v)),
}


def row_leaves(rig: LawRig, row: str, speeds: Sequence[float]) -> float:
    """Return what a row of the catalogue leaves of a rig's law at its best, in norms of the noise."""
    parts = {"kinks": (), **ROWS[row]}
    return rig.norms(speeds, [LawRig(bodies=rig.bodies, **parts)])


def judge(case: LawCase, diagnose: Callable[[Sequence[Motion]], Any]) -> LawOutcome:
    """Draw a case, have it diagnosed, and write down what was said beside what was true."""
    rig, true, numbers = draw(case)
    random = np.random.default_rng((case.seed, 0x5EED))
    speeds = [s * random.uniform(0.95, 1.05) for s in SPEEDS[: case.shots]]
    shown = rig.shots(speeds)
    began = time.perf_counter()
    try:
        said = diagnose(shown)
    except Exception as error:
        return LawOutcome(case, true, numbers, "failed", problem=f"{type(error).__name__}: {error}"[:300])
    seconds = time.perf_counter() - began
    held = None
    if said.error_held_out_before is not None and said.error_held_out_after is not None:
        held = (said.error_held_out_before.displacement_rms_m, said.error_held_out_after.displacement_rms_m)
    laws = tuple(
        {
            "where": law.where,
            "argument": law.argument,
            "form": law.form,
            "nearest": law.nearest_form,
            "parameters": {key: (q.value, q.std) for key, (q, _) in law.parameters.items()},
            "others": [(o.where, o.argument, o.form, o.delta_bic) for o in law.other_forms],
            "same": law.same_by_gauge,
            "freedom": law.evidence["degrees_of_freedom"],
        }
        for law in said.laws
    )
    return LawOutcome(
        case=case,
        true=true,
        truth=numbers,
        verdict=str(said.verdict),
        effects=tuple(effect.name for effect in said.effects),
        laws=laws,
        chi2=(said.error_before.reduced_chi2, said.error_after.reduced_chi2),
        held_out=held,
        held_out_chi2=float(said.laws[0].evidence["held_out_chi2"]) if said.laws else math.nan,
        norms=rig.norms(speeds),
        seconds=seconds,
        classes=tuple(tuple(other.name for other in one.indistinguishable_from) for one in said.effects),
        beside={effect.name: row_leaves(rig, effect.name, speeds) for effect in said.effects if effect.name in ROWS},
        said=said.sentence,
    )
