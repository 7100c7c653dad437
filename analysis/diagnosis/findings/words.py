"""Sentences on a collision's diagnosis: verdict, residual, detection limits, shots that separate look-alikes."""

from collections.abc import Mapping, Sequence

from analysis.collision import NUISANCES, Effect, UserLaw
from analysis.diagnosis.findings import contact_laws
from analysis.diagnosis.findings.criteria import CRITERIA
from analysis.diagnosis.findings.result import Diagnosis, FoundEffect, Freedom, LearnedLaw, Remainder, Verdict
from analysis.shot import Fit, Quantity, split_unit

CLASSES = {
    frozenset({"coulomb_friction", "viscous_drag", "quadratic_drag"}): "a drag whose form is undetermined",
    frozenset({"plate_damping", "viscoelastic_arm"}): "a loss in the plate whose form is undetermined",
    frozenset({"cubic_stiffness", "contact_exponent"}): "a stiffness that grows with the load",
    frozenset({"support_compliance", "second_plate_mode"}): "a second plate mode with two interpretations",
}
FREEDOMS = {
    Freedom.KINKS: "kinks at touch, turnaround or release",
    Freedom.KINKS_WITH_SPEED: "kinks whose size grows with speed",
    Freedom.BASE_PER_SHOT: "plate and contact parameters that differ from shot to shot",
    Freedom.EFFECT_PER_SHOT: "an effect that differs from shot to shot",
    Freedom.EFFECT_AFTER_TURN: "an effect that differs after the turnaround",
    Freedom.SPEED_AGAINST_MOTION: "a speed-dependent force opposing the motion",
    Freedom.SPEED_ONE_WAY: "a speed-dependent force of fixed direction",
    Freedom.PLACE: "a position-dependent force",
    Freedom.BEND: "a force that depends on the plate's deflection",
    Freedom.BEND_AGAINST_MOTION: "a force that depends on the plate's deflection, opposing the motion",
}
_REDUCED = 0.995  # residual after over residual before: above this, no reduction is reported
# effects that are physically identical, wholly or in a limit: there, no shot of any rig can distinguish them
EQUIVALENT_EFFECTS = {
    frozenset({"plate_damping", "viscoelastic_arm"}): (
        "an arm that relaxes faster than the plate moves is equivalent to a dashpot of k tau"
    ),
    frozenset({"support_compliance", "second_plate_mode"}): (
        "a compliant clamp and a second plate mode are equivalent for the block: both make a plate with two modes"
    ),
}


def unit_of(parameter: str) -> str:
    """Return the unit in a parameter's name, or an empty string."""
    return split_unit(parameter.split(".")[0])[1]


def parameter_words(parameter: str) -> str:
    """Return a parameter's name in words, without its unit."""
    name, _, shot = parameter.partition(".")
    return split_unit(name)[0] + (f" of shot {shot}" if shot else "")


def quantity(name: str, value: Quantity, unit: str | None = None) -> str:
    """Return a parameter with its uncertainty and unit; without ``unit``, the unit is read from the name."""
    unit = unit_of(name) if unit is None else unit
    return f"{value.in_text()} {unit}".strip()


def numbers(parameters: Mapping[str, Quantity]) -> str:
    """Return an effect's parameters with their uncertainties, in words."""
    return ", ".join(f"{parameter_words(name)} {quantity(name, value)}" for name, value in parameters.items())


def found(one: FoundEffect) -> str:
    """Return the sentence of one found effect; phases, fitted per shot, are left to the table of parameters."""
    effect, others = one.effect, one.indistinguishable_from
    told = {key: q for key, q in one.parameters.items() if not key.startswith("phase_rad")}
    if isinstance(effect, UserLaw):
        units = {parameter.name: parameter.unit for parameter in effect.parameters}
        sizes = ", ".join(f"{key} {quantity(key, q, units.get(key))}" for key, q in told.items())
        size = f"{effect.formula.text} with {sizes}"
    else:
        size = numbers(told)
    if len(others) > CRITERIA.undetermined:
        best = f"{effect.short_words}: {size}"
        return f"a further small effect whose form these data do not determine (best fit: {best})"
    if others:
        group = frozenset(other.name for other in (effect, *others))
        klass = next((words for names, words in CLASSES.items() if group <= names), "")
        listed = " or ".join(other.short_words for other in (effect, *others))
        return f"{klass + ': ' if klass else ''}{listed}; as {effect.short_words}: {size}"
    return f"{effect.short_words}: {size}"


def learned(law: LearnedLaw) -> str:
    """Return the sentence of a learned law."""
    what = f"a force on the {law.where}" if law.where != "contact" else "a force between block and plate"
    what += " while they touch" if law.form == "constant" else f" as a function of {law.argument}"
    if law.form is None:
        return f"{what}, which matches no tested closed form (nearest: {law.nearest_form})"
    numbers = ", ".join(f"{name} {quantity(name, q, unit)}" for name, (q, unit) in law.parameters.items())
    others = [
        o.form + (f" in the {o.argument}" if (o.where, o.argument) != (law.where, law.argument) else "")
        for o in law.other_forms
    ]
    other = f"; {' or '.join(others)} cannot be excluded" if others else ""
    return f"{what}, {law.form}: {law.formula} with {numbers}{other}"


def sentence(diagnosis: Diagnosis) -> str:
    """Return the verdict on a collision as a few sentences."""
    effects, laws = diagnosis.effects, diagnosis.laws
    return (
        _verdict(diagnosis)
        + (_reduced(diagnosis) if effects or laws or diagnosis.verdict is Verdict.PARTLY_EXPLAINED else "")
        + contact_laws.sentence(effects, laws)
        + nuisance_sentence(diagnosis.fit_after)
    )


def _verdict(diagnosis: Diagnosis) -> str:
    verdict, effects, laws = diagnosis.verdict, diagnosis.effects, diagnosis.laws
    if verdict is Verdict.ADEQUATE:
        return "The model is adequate: no missing effect within the detection limits." + _trace(diagnosis.remainder)
    left = remainder(diagnosis.remainder)
    if verdict is Verdict.UNEXPLAINED:
        tried = " and no catalogue effect accounts for it"
        untried = " and the catalogue was not tried within the time limit"
        return f"Unexplained: the residual is significant{tried if diagnosis.compared else untried}: {left}."
    named = " and ".join([*map(found, effects), *map(learned, laws)])
    if verdict in (Verdict.EFFECT_FOUND, Verdict.LAW_LEARNED):
        return f"The model lacks {named}."
    alike = " and ".join(map(found, diagnosis.imitated_by))
    parts = [f"the model lacks {named}"] if effects else [f"the residual mostly resembles {named}"] if laws else []
    if alike:
        parts.append(
            f"the {'remaining residual' if parts else 'residual'} mostly resembles {alike}, which failed a test"
        )
    elif diagnosis.remainder is None:
        parts.append("it failed a test")
    parts.append(left if diagnosis.remainder is None else f"a significant residual remains: {left}")
    return f"Partly explained: {'; '.join(parts)}."


def _trace(left: Remainder | None) -> str:
    """Describe a residual of an adequate model that is too faint to be distinguished from noise; "" if none."""
    if left is None or left.looks_like is None:
        return ""
    return (
        f" A trace that resembles {FREEDOMS[left.looks_like]} ({left.norms:.1f} noise norms) is too weak to distinguish"
        " from noise."
    )


def remainder(left: Remainder | None) -> str:
    """Describe the residual of a collision model."""
    if left is None:
        return "residual consistent with noise"
    size = f"{_nm(left.rms_m)} rms in displacement" if left.rms_m > 0.0 else "no net rms displacement"
    phases = "".join(f", {phase.value.replace('_', ' ')} {_nm(rms_m)}" for phase, rms_m in left.phases)
    parts = [f"{size} above the white noise of {_nm(left.noise_m)}{phases}"]
    if left.speed_power is not None:
        parts.append(f"its size scales as speed^{left.speed_power:.1f}")
    if left.line_hz is not None:
        parts.append(f"spectral line at {left.line_hz:.0f} Hz")
    if left.imitated_by:
        imitating = " with ".join(effect.short_words for effect in left.imitated_by)
        parts.append(f"best imitated by {imitating}, which failed a test")
    if left.looks_like is not None:
        what = "the remaining residual" if left.imitated_by else "it"
        parts.append(f"{what} resembles {FREEDOMS[left.looks_like]} ({left.norms:.0f} noise norms)")
    return "; ".join(parts)


def _nm(size_m: float) -> str:
    size_nm = size_m * 1e9
    return f"{size_nm:.2g} nm" if size_nm < 1000 else f"{size_nm / 1000:.2g} µm"


def _reduced(diagnosis: Diagnosis) -> str:
    to = diagnosis.error_after.displacement_rms_m / diagnosis.error_before.displacement_rms_m
    return f" Residual reduced to {100 * to:.2g} %." if to < _REDUCED else ""


def nuisance_sentence(fit: Fit) -> str:
    """Return a sentence on the nuisance effects fitted per shot in addition to its start; "" if none."""
    own: dict[str, list[float]] = {}
    for shot in fit.shots:
        for full, quantity in shot.own_parameters.items():
            if full.split(".")[0] in NUISANCES:
                own.setdefault(full, []).append(quantity.value)
    if not own:
        return ""
    spans = [
        f"{parameter_words(full.split('.')[1])} the contact {min(v):.2g} to {max(v):.2g}" for full, v in own.items()
    ]
    name, _, parameter = next(iter(own)).partition(".")
    return f" Fitted per shot: {NUISANCES[name].short_words}, {', '.join(spans)} {unit_of(parameter)}."


def blind_spots(diagnosis: Diagnosis) -> tuple[str, ...]:
    """Return the detection limits of the shots as sentences; () for an unexplained residual."""
    if diagnosis.verdict is Verdict.UNEXPLAINED:
        return ()
    hidden = [
        f"{spot.effect.short_words} of any size"
        if spot.least is None
        else f"{spot.effect.short_words} below {spot.least:.1g} {unit_of(spot.parameter)}".strip()
        for spot in diagnosis.blind_spots
    ]
    return (*hidden, "a wrong wavelength, a cosine error and a wrong mass, which only rescale the parameters")


def separating_shot(diagnosis: Diagnosis) -> str:
    """Return the shots that would distinguish effects from their look-alikes; "" if none are needed."""
    alike = [found for found in diagnosis.effects if found.indistinguishable_from]
    speeds = diagnosis.speeds_m_per_s
    return "; ".join(dict.fromkeys(_separating(one.effect, one.indistinguishable_from, speeds) for one in alike))


def _separating(effect: Effect, others: Sequence[Effect], speeds: Sequence[float]) -> str:
    fast, slow = max(speeds), min(speeds)
    if any(one.at_rest for one in (effect, *others[:1])):
        return f"a slow shot at {0.3 * slow:.2g} m/s, recorded over the whole flight: drift effects grow with time"
    if fast < 1.6 * slow:
        return (
            f"two more shots, at {0.5 * slow:.2g} and {1.6 * fast:.2g} m/s: the candidates depend differently on speed"
        )
    return f"two more shots at {1.5 * fast:.2g} m/s, and more than one at {slow:.2g} m/s"
