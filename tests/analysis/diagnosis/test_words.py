"""What a diagnosis of a collision says, whole sentences at a time."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from analysis.collision.effects import effect_named, effects_named
from analysis.diagnosis.findings import words
from analysis.diagnosis.findings.result import FoundEffect, Freedom, Phase, Remainder, Verdict
from analysis.shot.quantity import Quantity

DRAG, TILT, MODE, FRICTION, SQUARE = effects_named(
    ("viscous_drag", "tilt", "block_mode", "coulomb_friction", "quadratic_drag")
)
FORCE = Quantity(2e-5, 1e-6)
LEFT = Remainder(2.34e-9, 1e-10, ((Phase.LOADING, 5e-9), (Phase.FLIGHT_OUT, 3.2e-6)), 1.96, 417.3, Freedom.PLACE, 12.4)


def found(effect: Any, *others: Any, **parameters: Quantity) -> FoundEffect:
    return FoundEffect(effect, parameters or {"force_n": FORCE}, {}, others)


def diagnosis(verdict: Verdict, effects: tuple[FoundEffect, ...] = (), after: float = 0.25, **more: Any) -> Any:
    given: dict[str, Any] = {
        "verdict": verdict, "effects": effects, "laws": (), "imitated_by": (), "remainder": None, "compared": True,
        "error_before": SimpleNamespace(displacement_rms_m=2e-9), "fit_after": SimpleNamespace(shots=()),
        "error_after": SimpleNamespace(displacement_rms_m=after * 2e-9), "blind_spots": (),
        "speeds_m_per_s": (0.2, 0.3),
    }  # fmt: skip
    return SimpleNamespace(**(given | more))


def test_a_parameter_in_words() -> None:
    assert words.unit_of("coefficient_n_s_per_m") == "N s/m" == words.unit_of("coefficient_n_s_per_m.2")
    assert (
        words.parameter_words("moving_mass_kg") == "moving mass"
        and words.parameter_words("velocity_m_per_s.3") == "velocity of shot 3"
    )
    assert words.quantity("force_n", FORCE) == f"{FORCE.in_text()} N"
    assert words.quantity("share", FORCE) == FORCE.in_text()
    assert words.quantity("force_n", FORCE, "mN") == f"{FORCE.in_text()} mN"


def test_a_found_effect_alone_in_its_class_and_among_too_many() -> None:
    size = f"force {FORCE.in_text()} N"
    assert words.found(found(FRICTION)) == f"{FRICTION.short_words}: {size}"
    assert words.found(found(FRICTION, phase_rad=FORCE, force_n=FORCE)) == f"{FRICTION.short_words}: {size}"
    assert words.found(found(FRICTION, DRAG, SQUARE)) == (
        f"a drag whose form is undetermined: {FRICTION.short_words} or {DRAG.short_words} or {SQUARE.short_words}; as "
        f"{FRICTION.short_words}: {size}"
    )
    assert words.found(found(FRICTION, TILT)) == (
        f"{FRICTION.short_words} or {TILT.short_words}; as {FRICTION.short_words}: {size}"
    )
    many = effects_named(("viscous_drag", "tilt", "block_mode", "quadratic_drag", "sensor_drift"))
    assert " or " in words.found(found(FRICTION, *many))
    assert words.found(found(FRICTION, *many, effect_named("plate_damping"))) == (
        f"a further small effect whose form these data do not determine (best fit: {FRICTION.short_words}: {size})"
    )


def test_the_verdict_in_sentences() -> None:
    lacks = f"The model lacks {words.found(found(FRICTION))} and {words.found(found(TILT))}."
    both = diagnosis(Verdict.EFFECT_FOUND, (found(FRICTION), found(TILT)))
    assert words.sentence(both) == f"{lacks} Residual reduced to 25 %."
    assert words.sentence(diagnosis(Verdict.EFFECT_FOUND, both.effects, 0.996)) == lacks
    assert words.sentence(diagnosis(Verdict.EFFECT_FOUND, both.effects, 0.994)).endswith("reduced to 99 %.")
    adequate = "The model is adequate: no missing effect within the detection limits."
    assert words.sentence(diagnosis(Verdict.ADEQUATE)) == adequate
    assert words.sentence(diagnosis(Verdict.ADEQUATE, remainder=LEFT)) == (
        f"{adequate} A trace that resembles a position-dependent force (12.4 noise norms) is too weak to distinguish"
        " from noise."
    )
    left = words.remainder(LEFT)
    for compared, said in (
        (True, " and no catalogue effect accounts for it"),
        (False, " and the catalogue was not tried within the time limit"),
    ):
        none = diagnosis(Verdict.UNEXPLAINED, remainder=LEFT, compared=compared)
        assert words.sentence(none) == f"Unexplained: the residual is significant{said}: {left}."
    partly = diagnosis(Verdict.PARTLY_EXPLAINED, (found(FRICTION),), remainder=LEFT, imitated_by=(found(TILT),))
    assert words.sentence(partly) == (
        f"Partly explained: the model lacks {words.found(found(FRICTION))}; the remaining residual mostly "
        f"resembles {words.found(found(TILT))}, which failed a test; a significant residual remains: {left}."
        " Residual reduced to 25 %."
    )
    alike = diagnosis(Verdict.PARTLY_EXPLAINED, imitated_by=(found(TILT),))
    assert words.sentence(alike).startswith(
        f"Partly explained: the residual mostly resembles {words.found(found(TILT))}, which failed a test; "
        "residual consistent with noise."
    )
    assert words.sentence(diagnosis(Verdict.PARTLY_EXPLAINED, (found(FRICTION),))).startswith(
        f"Partly explained: the model lacks {words.found(found(FRICTION))}; it failed a test; "
        "residual consistent with noise."
    )


def test_a_remainder_in_words() -> None:
    assert words.remainder(LEFT) == (
        "2.3 nm rms in displacement above the white noise of 0.1 nm, loading 5 nm, flight out 3.2 µm; its size scales "
        "as speed^2.0; spectral line at 417 Hz; it resembles a position-dependent force (12 noise norms)"
    )
    assert words.remainder(None) == "residual consistent with noise"


def test_what_each_shot_has_for_itself_is_told_by_its_span() -> None:
    def shot(before: float, after: float) -> Any:
        own = {
            "flight_acceleration.before_m_per_s2": before,
            "flight_acceleration.after_m_per_s2": after,
            "tilt.a": 1.0,
        }
        return SimpleNamespace(own_parameters={name: Quantity(value, 0.0) for name, value in own.items()})

    fit: Any = SimpleNamespace(shots=[shot(0.012, -0.02), shot(-0.015, 0.01)])
    assert words.nuisance_sentence(fit) == (
        " Fitted per shot: flight acceleration, before the contact -0.015 to 0.012, after the contact -0.02 to "
        "0.01 m/s²."
    )
    none: Any = SimpleNamespace(shots=[SimpleNamespace(own_parameters={"tilt.a": Quantity(1.0, 0.0)})])
    assert words.nuisance_sentence(none) == ""


def test_blind_spots_in_words() -> None:
    spots = (
        SimpleNamespace(effect=FRICTION, parameter="force_n", least=2.3e-5),
        SimpleNamespace(effect=TILT, parameter="x", least=None),
    )
    last = "a wrong wavelength, a cosine error and a wrong mass, which only rescale the parameters"
    assert words.blind_spots(diagnosis(Verdict.ADEQUATE, blind_spots=spots)) == (
        f"{FRICTION.short_words} below 2e-05 N", f"{TILT.short_words} of any size", last,
    )  # fmt: skip
    assert words.blind_spots(diagnosis(Verdict.UNEXPLAINED, blind_spots=spots)) == ()


@pytest.mark.parametrize(
    ("effects", "speeds", "said"),
    [
        (
            (found(DRAG, SQUARE),), (0.2, 0.31),
            "two more shots, at 0.1 and 0.5 m/s: the candidates depend differently on speed",
        ),
        ((found(DRAG, SQUARE),), (0.2, 0.33), "two more shots at 0.49 m/s, and more than one at 0.2 m/s"),
        ((found(DRAG),), (0.2, 0.33), ""),
        (
            (found(effect_named("sensor_drift"), FRICTION),), (0.2, 0.33),
            "a slow shot at 0.06 m/s, recorded over the whole flight: drift effects grow with time",
        ),
        (
            (found(FRICTION, effect_named("sensor_drift"), DRAG),), (0.2, 0.33),
            "a slow shot at 0.06 m/s, recorded over the whole flight: drift effects grow with time",
        ),
    ],
)  # fmt: skip
def test_the_shot_that_would_separate_look_alikes(
    effects: tuple[FoundEffect, ...], speeds: tuple[float, ...], said: str
) -> None:
    assert words.separating_shot(diagnosis(Verdict.EFFECT_FOUND, effects, speeds_m_per_s=speeds)) == said
    assert words.separating_shot(diagnosis(Verdict.EFFECT_FOUND, effects * 2, speeds_m_per_s=speeds)) == said


def law(**changes: Any) -> Any:
    given: dict[str, Any] = {
        "where": "block", "argument": "place", "form": "cubic", "formula": "a*x**3", "nearest_form": "cubic",
        "parameters": {"a": (FORCE, "N/m³")}, "other_forms": (),
    }  # fmt: skip
    return SimpleNamespace(**(given | changes))


def test_a_learned_law_in_a_sentence() -> None:
    size = f"a {FORCE.in_text()} N/m³"
    assert words.learned(law()) == f"a force on the block as a function of place, cubic: a*x**3 with {size}"
    contact = law(where="contact", argument="overlap", form="constant", formula="a")
    assert words.learned(contact) == f"a force between block and plate while they touch, constant: a with {size}"
    assert words.learned(law(form=None)) == (
        "a force on the block as a function of place, which matches no tested closed form (nearest: cubic)"
    )
    others = (
        SimpleNamespace(form="linear", where="block", argument="place"),
        SimpleNamespace(form="sine", where="plate", argument="bend"),
    )
    assert words.learned(law(other_forms=others)).endswith(f"{size}; linear or sine in the bend cannot be excluded")


def test_a_trace_is_told_only_where_it_has_a_shape() -> None:
    seen = words.sentence(diagnosis(Verdict.ADEQUATE, remainder=LEFT))
    assert seen.endswith(
        " A trace that resembles a position-dependent force (12.4 noise norms) is too weak to distinguish from noise."
    )
    bare = words.sentence(diagnosis(Verdict.ADEQUATE))
    shapeless = replace(LEFT, looks_like=None)
    assert words.sentence(diagnosis(Verdict.ADEQUATE, remainder=shapeless)) == bare and "trace" not in bare
