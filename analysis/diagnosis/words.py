"""Sentences a person can use: the verdict, what could not be seen, what would separate look-alikes."""

from collections.abc import Mapping, Sequence

from analysis.collision import NUISANCES, Effect, OwnLaw
from analysis.diagnosis import contact_family
from analysis.diagnosis.result import FoundEffect, LearnedLaw, Verdict
from analysis.diagnosis.verdict.criteria import CRITERIA
from analysis.shot import Fit, Quantity, words_and_unit

CLASSES = {
    frozenset({"coulomb_friction", "viscous_drag", "quadratic_drag"}): "a drag whose form is undetermined",
    frozenset({"plate_damping", "viscoelastic_arm"}): "a loss in the plate whose form is undetermined",
    frozenset({"cubic_stiffness", "contact_exponent"}): "a stiffness that grows with the load",
    frozenset({"support_compliance", "second_plate_mode"}): "a plate of two modes, whose second has two readings",
}
CALM = "residual consistent with noise"
_REDUCED = 0.995  # of the residual before: what is closer to it than that is no reduction to speak of
# what is the same by physics, wholly or in a limit: no shot of any rig tells them apart there
ONE_WITH_TWO_READINGS = {
    frozenset({"plate_damping", "viscoelastic_arm"}): (
        "an arm that relaxes faster than the plate moves is a dashpot of k tau: one loss, two readings"
    ),
    frozenset({"support_compliance", "second_plate_mode"}): (
        "a clamp that gives and a second mode are the same plate with two modes, seen from the block: one, two readings"
    ),
}


def unit_of(parameter: str) -> str:
    """Return the unit that a parameter's name carries, or nothing."""
    return words_and_unit(parameter.split(".")[0])[1]


def stem(parameter: str) -> str:
    """Return a parameter's name without its unit, in words."""
    name, _, shot = parameter.partition(".")
    return words_and_unit(name)[0] + (f" of shot {shot}" if shot else "")


def quantity(name: str, value: Quantity, unit: str | None = None) -> str:
    """Return a parameter with its uncertainty and unit, which its name carries where it is not given."""
    unit = unit_of(name) if unit is None else unit
    return f"{value.in_a_sentence()} {unit}".strip()


def found(effect: Effect, parameters: Mapping[str, Quantity], others: Sequence[Effect]) -> str:
    """Return the sentence of one found effect; a phase, every shot's own, is for the table of parameters."""
    told = {key: q for key, q in parameters.items() if not key.startswith("phase_rad")}
    if isinstance(effect, OwnLaw):
        units = {parameter.name: parameter.unit for parameter in effect.parameters}
        sizes = ", ".join(f"{key} {quantity(key, q, units.get(key))}" for key, q in told.items())
        numbers = f"{effect.formula.text} with {sizes}"
    else:
        numbers = ", ".join(f"{stem(key)} {quantity(key, q)}" for key, q in told.items())
    if len(others) > CRITERIA.undetermined:
        best = f"{effect.short_words}: {numbers}"
        return f"a further small effect whose form this data does not determine (best as {best})"
    if others:
        group = frozenset(one.name for one in (effect, *others))
        klass = next((words for names, words in CLASSES.items() if group <= names), "")
        listed = " or ".join(one.short_words for one in (effect, *others))
        return f"{klass + ': ' if klass else ''}{listed}; as {effect.short_words}: {numbers}"
    return f"{effect.short_words}: {numbers}"


def learned(law: LearnedLaw) -> str:
    """Return the sentence of a learned law."""
    what = f"a force on the {law.where}" if law.where != "contact" else "a force between block and plate"
    what += " while they touch" if law.form == "constant" else f" that follows the {law.argument}"
    if law.form is None:
        return f"{what}, by no closed form that was tried (nearest: {law.nearest_form})"
    numbers = ", ".join(f"{name} {quantity(name, q, unit)}" for name, (q, unit) in law.parameters.items())
    others = [
        o.form + (f" in the {o.argument}" if (o.where, o.argument) != (law.where, law.argument) else "")
        for o in law.other_forms
    ]
    other = f"; {' or '.join(others)} cannot be excluded" if others else ""
    return f"{what}, {law.form}: {law.formula} with {numbers}{other}"


def sentence(
    verdict: Verdict,
    *,
    effects: Sequence[FoundEffect] = (),
    laws: Sequence[LearnedLaw] = (),
    imitations: Sequence[FoundEffect] = (),
    remainder: str = "",
    reduced_to: float | None = None,
    fit: Fit | None = None,
) -> str:
    """Return the verdict on a collision as a few sentences.

    ``imitations`` did not pass every gate; ``reduced_to`` is the error after over that before (displacement rms);
    ``fit`` is that of the model after, for what each shot has of its own.
    """
    return (
        _verdict(verdict, effects, laws, imitations, remainder)
        + _reduced(reduced_to if effects or laws or (imitations and verdict is Verdict.PARTLY_EXPLAINED) else None)
        + contact_family.sentence(effects, laws)
        + (taken_along(fit) if fit is not None else "")
    )


def _verdict(
    verdict: Verdict,
    effects: Sequence[FoundEffect],
    laws: Sequence[LearnedLaw],
    imitations: Sequence[FoundEffect],
    remainder: str,
) -> str:
    if verdict is Verdict.ADEQUATE:
        return "The model is adequate: nothing is missing that this data could show."
    if verdict is Verdict.UNEXPLAINED:
        return f"Unexplained: something is missing that no effect of the catalogue accounts for: {remainder}."
    named = " and ".join([*(effect.sentence for effect in effects), *map(learned, laws)])
    if verdict in (Verdict.EFFECT_FOUND, Verdict.LAW_LEARNED):
        return f"The model lacks {named}."
    alike = " and ".join(effect.sentence for effect in imitations)
    parts = [f"the model lacks {named}"] if effects else [f"what is missing is mostly like {named}"] if laws else []
    if alike:
        parts.append(
            f"what {'remains' if parts else 'is missing'} is mostly like {alike}, which did not pass every test"
        )
    elif remainder == CALM:
        parts.append("it did not pass every test")
    parts.append(CALM if remainder == CALM else f"a significant residual remains: {remainder}")
    return f"Partly explained: {'; '.join(parts)}."


def _reduced(to: float | None) -> str:
    return f" Residual reduced to {100 * to:.2g} %." if to is not None and to < _REDUCED else ""


def taken_along(fit: Fit) -> str:
    """Return what each shot was given for itself beside its start, as a further sentence, or nothing."""
    own: dict[str, list[float]] = {}
    for shot in fit.shots:
        for full, quantity in shot.own_parameters.items():
            if full.split(".")[0] in NUISANCES:
                own.setdefault(full, []).append(quantity.value)
    if not own:
        return ""
    spans = [f"{stem(full.split('.')[1])} the contact {min(v):.2g} to {max(v):.2g}" for full, v in own.items()]
    name, _, parameter = next(iter(own)).partition(".")
    return f" Each shot has its own {NUISANCES[name].short_words}: {', '.join(spans)} {unit_of(parameter)}."


def separating(effect: Effect, others: Sequence[Effect], speeds: Sequence[float]) -> str:
    """Return the shot that would tell look-alikes apart."""
    fast, slow = max(speeds), min(speeds)
    if any(one.at_rest for one in (effect, *others[:1])):
        return f"a slow shot, at {0.3 * slow:.2g} m/s, recorded for as long as it flies: what drifts grows with time"
    if fast < 1.6 * slow:
        return f"two more, at {0.5 * slow:.2g} m/s and at {1.6 * fast:.2g} m/s: each goes with the speed its own way"
    return f"two more shots at {1.5 * fast:.2g} m/s, and more than one at {slow:.2g} m/s"
