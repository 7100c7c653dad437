"""Where a joint fit with effects may begin: the linear estimate, and sizes too large for it to see."""

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from analysis.collision.effects.row import Effect
from analysis.collision.parameters import Floats, Infeasible
from analysis.inference.fit.response import Model
from analysis.inference.fit.search import Problem
from analysis.inference.screen.tangents import Candidate, Gain, Projection, candidates

_POINTS = 3  # of a grid that are followed up
Chosen = tuple[tuple[str, float], ...]


def effect_starts(
    bare: Problem, bases: Sequence[Floats], model: Model, given: Mapping[str, float]
) -> Iterator[tuple[Chosen, Floats]]:
    """Yield (values of parameters that are not fitted, start vector) for ``model``, the likeliest first.

    ``bare`` is the same problem without effects, ``bases`` sets of its parameters to begin from: its minimum, and
    where the effect may have drawn that far away, a guess that the effect disturbs less.  ``given`` fixes starts by
    full name.  From each base first the linear estimate at the best points of the effects' grids (or a fraction of it,
    where the whole makes things worse: the base parameters have yet to give way), and natural sizes there, then large
    ones.
    """
    rankings: list[dict[str, list[tuple[Candidate, Gain]]]] = []
    for base in bases:
        ranked = _ranked(bare, base, model, given)
        rankings.append(ranked)
        yield from _from(bare, base, model, given, ranked, [("linear", 0)])
        if all(name in given for name in model.shared_effect_names):
            return
    more = [("linear", place) for place in range(1, _POINTS)]
    for base, ranked in zip(bases, rankings, strict=True):
        most = max(len(found) for found in ranked.values())
        natural = [("natural", place) for place in range(most)]
        # What the base parameters have swallowed the linear estimate takes for nothing: there the natural size is best.
        swallowed = any(effect.inverse for effect in model.effects)
        rounds = [*natural, *more[: most - 1]] if swallowed else [*more[: most - 1], *natural]
        rounds.append(("large", 0))
        yield from _from(bare, base, model, given, ranked, rounds)


def _from(
    bare: Problem,
    base: Floats,
    model: Model,
    given: Mapping[str, float],
    ranked: Mapping[str, list[tuple[Candidate, Gain]]],
    rounds: Sequence[tuple[str, int]],
) -> Iterator[tuple[Chosen, Floats]]:
    for size, place in rounds:
        values: dict[str, float] = {}
        own: list[dict[str, float]] = [{} for _ in bare.shots]
        for effect in model.effects:
            found = ranked[effect.name]
            candidate, gain = found[min(place, len(found) - 1)]
            _put(effect, candidate, gain, size, values, own)
        values |= {name: value for name, value in given.items() if "." in name}
        chosen = tuple((name, values[name]) for name, _, _, p in model.effect_parameters if p.fixed)
        problem = Problem(Model(model.base, model.effects, chosen), bare.shots, bare.whitened)
        fractions = (1.0, 0.1, 0.01) if size == "linear" else (1.0,)
        options = [_vector(bare, base, model, _fraction(model, values, f), own) for f in fractions]
        costs = [_chi2(problem, option) for option in options]
        yield chosen, options[int(np.argmin(costs))]


def _fraction(model: Model, values: dict[str, float], fraction: float) -> dict[str, float]:
    smaller = dict(values)
    for effect in model.effects:
        name = f"{effect.name}.{effect.amplitude}"
        if name in smaller:
            smaller[name] *= 1 / fraction if effect.inverse else fraction
    return smaller


def _chi2(problem: Problem, parameters: Floats) -> float:
    try:
        return problem.chi2(parameters)
    except Infeasible:
        return math.inf


def _ranked(
    bare: Problem, base: Floats, model: Model, given: Mapping[str, float]
) -> dict[str, list[tuple[Candidate, Gain]]]:
    """Return each effect's grid points, best first, neighbours of a better one left out."""
    projection = Projection(bare, base)
    every: dict[str, list[Candidate]] = {effect.name: [] for effect in model.effects}
    for candidate in candidates(bare, base, list(every)):
        every[candidate.name].append(candidate)
    out: dict[str, list[tuple[Candidate, Gain]]] = {}
    for name, found in every.items():
        nearest = min(_distance(candidate, given) for candidate in found)
        found = [candidate for candidate in found if _distance(candidate, given) <= nearest + 1e-9]
        falls = projection.falls(found)
        kept: list[Candidate] = []
        for place in np.argsort(-falls):
            if len(kept) >= _POINTS:
                break
            candidate = found[int(place)]
            if all(_apart(candidate, other) for other in kept):
                kept.append(candidate)
        out[name] = [(candidate, projection.gain(candidate)) for candidate in kept]
    return out


def _distance(candidate: Candidate, given: Mapping[str, float]) -> float:
    wanted = {key: given.get(f"{candidate.name}.{key}") for key in candidate.point}
    return sum(abs(math.log(candidate.point[k] / v)) for k, v in wanted.items() if v is not None and v > 0)


def _apart(one: Candidate, other: Candidate) -> bool:
    return max((abs(math.log(one.point[k] / other.point[k])) for k in one.point), default=0.0) > 0.3


def _put(
    effect: Effect,
    candidate: Candidate,
    gain: Gain,
    size: str,
    values: dict[str, float],
    own: list[dict[str, float]],
) -> None:
    """Write an effect's starting values: the grid's point, and an amplitude of the wanted size and physical sign."""
    for parameter in effect.parameters:
        name = f"{effect.name}.{parameter.name}"
        if not parameter.own:
            values[name] = candidate.point.get(parameter.name, parameter.scale)
            continue
        for mine in own:
            mine[name] = parameter.tried[0] if parameter.tried else parameter.scale
    amplitudes = gain.amplitudes
    row = effect.parameters[effect.index(effect.amplitude)]
    if effect.own:
        for index, mine in enumerate(own):
            for place, parameter in enumerate(effect.parameters):
                linear = float(amplitudes[len(effect.parameters) * index + place])
                mine[f"{effect.name}.{parameter.name}"] = linear if size == "linear" else parameter.scale
        return
    if candidate.own:  # two quadratures a shot: one amplitude, a phase each
        pairs = amplitudes.reshape(len(own), 2)
        sizes = np.hypot(pairs[:, 0], pairs[:, 1])
        for pair, mine in zip(pairs, own, strict=True):
            mine[f"{effect.name}.phase_rad"] = float(np.arctan2(pair[1], pair[0]))
        amplitude = float(np.mean(sizes))
    else:
        amplitude = float(amplitudes[0])
        if candidate.inverse:
            amplitude = 1 / amplitude if amplitude > 1e-6 else row.scale * 10
    natural = row.scale if amplitude >= 0 or row.lower >= 0 else -row.scale
    if size == "natural":
        amplitude = natural
    elif size == "large":
        amplitude = natural * (0.1 if effect.inverse else 15.0)
    elif not row.lower < amplitude < row.upper:
        amplitude = 0.1 * row.scale
    values[f"{effect.name}.{effect.amplitude}"] = min(max(amplitude, row.lower), row.upper)


def _vector(
    bare: Problem, base: Floats, model: Model, values: Mapping[str, float], own: list[dict[str, float]]
) -> Floats:
    out = [base[: bare.shared], np.array([values[name] for name in model.shared_effect_names])]
    for index in range(len(bare.shots)):
        out.append(base[bare.own_slice(index)])
        out.append(np.array([own[index][name] for name in model.own_names[bare.own :]]))
    return np.concatenate(out)
