"""What is said of a drive, whole sentences at a time."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.diagnosis import driven, driven_words
from analysis.diagnosis.result import DriveEvidence, DriveRemainder, Errors, FoundEffect, Standing, Verdict
from analysis.drive.catalogue import GAIN_ERROR, LAWS
from analysis.drive.driven_fit import MassCheck
from analysis.drive.repeatability import Repeatability
from analysis.shot.quantity import Quantity

NONE = MassCheck(None, Quantity(95.0, 0.5), True)
LEFT = DriveRemainder(0.123, 0.456, 0.789, 0.1)


def evidence(mass: MassCheck = NONE, force_n: float = 2.0, **more: Any) -> DriveEvidence:
    given: dict[str, Any] = {"bandwidth_hz": 12.34, "unidentifiable": (), "remainder": LEFT} | more
    return DriveEvidence(Repeatability(force_n, True, "what its cycle repeats to"), mass, **given)


def diagnosis(verdict: Verdict, effects: tuple[FoundEffect, ...] = (), held_n: float | None = None) -> Any:
    def of(force_n: float) -> Errors:
        return Errors(np.nan, np.nan, force_n, 1.0)

    return SimpleNamespace(
        verdict=verdict, effects=effects, error_before=of(60.0), error_after=of(3.0),
        error_held_out_after=None if held_n is None else of(held_n),
        fit_after=SimpleNamespace(parameters={"viscous_coefficient_n_s_per_m": Quantity(200.0, 1.0)}),
    )  # fmt: skip


def test_a_verdict_in_a_sentence() -> None:
    against = "3 N is 1.5 times what its cycle repeats to (2 N)."
    friction = FoundEffect(LAWS["coulomb_friction"], {"force_n": Quantity(20.0, 0.5)}, {})
    named = f"The drive has {driven_words.effect(friction, diagnosis(Verdict.ADEQUATE).fit_after)}."
    error = " Force error 60 -> 3 N rms"
    assert (
        driven_words.sentence(diagnosis(Verdict.EFFECT_FOUND, (friction,)), evidence()) == f"{named}{error}; {against}"
    )
    held = driven_words.sentence(diagnosis(Verdict.EFFECT_FOUND, (friction, friction), 4.0), evidence())
    assert held.count("; coulomb friction") == 1 and f"{error}, 4 N on the validation half; {against}" in held
    adequate = driven_words.sentence(diagnosis(Verdict.ADEQUATE), evidence())
    assert adequate == f"Adequate: mass, viscous drag and offset leave nothing to speak of; {against}"
    none = driven_words.sentence(diagnosis(Verdict.UNEXPLAINED), evidence(force_n=0.0))
    assert none == (
        "Unexplained: 60 N rms remain and no law of the catalogue predicts them; 3 N is inf times what its cycle "
        "repeats to (0 N)."
    )


def test_a_stated_mass_is_told_to_be_right_or_wrong() -> None:
    stated, fitted = Quantity(80.0, 0.1), Quantity(96.0, 0.5)
    right = driven_words.sentence(diagnosis(Verdict.ADEQUATE), evidence(MassCheck(stated, fitted, True)))
    assert right.endswith(f" The mass is the stated one, {stated} kg; force and motion give {fitted} kg.")
    wrong = driven_words.sentence(diagnosis(Verdict.ADEQUATE), evidence(MassCheck(stated, fitted, False)))
    assert wrong.endswith("is used. The mass is wrong, or the force is, by a factor of 0.833.")
    assert f"The stated mass of {stated} kg is contradicted: force and motion give {fitted} kg" in wrong


@pytest.mark.parametrize(
    ("law", "values", "said"),
    [
        (
            "stribeck_friction", {"force_n": 5.0, "speed_m_per_s": 0.02},
            ": friction rises from 20 to 25 N towards rest, below some 20 mm/s",
        ),
        (
            "stribeck_friction", {"force_n": -12.0, "speed_m_per_s": 0.002},
            ": friction falls, against Stribeck's sign, from 20 to 8 N towards rest, below some 2 mm/s",
        ),
        ("drive_delay", {"time_s": 0.0012}, ": the motion answers the force 1.2 ms later"),
        ("drive_delay", {"time_s": -0.0012}, ": the motion answers the force 1.2 ms before it is told"),
        (
            "directional_viscous_drag", {"coefficient_n_s_per_m": -35.0},
            ": 165 N s/m forward, 235 N s/m backward",
        ),
        ("position_ripple", {"sine_n": 3.0, "cosine_n": -4.0, "pitch_m": 0.01}, ": an amplitude of 5 N"),
        ("cubic_stiffness", {"coefficient_n_per_m3": 2e4}, ""),
    ],
)  # fmt: skip
def test_a_law_in_words_and_numbers(law: str, values: dict[str, float], said: str) -> None:
    parameters = {name: Quantity(value, 0.1 * abs(value)) for name, value in values.items()}
    of_fit = {"coulomb_friction.force_n": Quantity(20.0, 1.0), "viscous_coefficient_n_s_per_m": Quantity(200.0, 1.0)}
    fit: Any = SimpleNamespace(parameters=of_fit)
    one = FoundEffect(LAWS[law], parameters, {}, (LAWS["quadratic_drag"], LAWS["bearing_gradient"]))
    text = driven_words.effect(one, fit)
    assert text.startswith(f"{LAWS[law].short_words}, {LAWS[law].formula}: ")
    assert text.endswith(f"{said} (as well: quadratic drag, bearing gradient)")
    for value in parameters.values():
        assert value.in_a_sentence() in text


def test_without_friction_in_the_fit_what_rises_towards_rest_rises_from_nothing() -> None:
    parameters = {"force_n": Quantity(5.0, 0.1), "speed_m_per_s": Quantity(0.02, 0.001)}
    fit: Any = SimpleNamespace(parameters={})
    text = driven_words.effect(FoundEffect(LAWS["stribeck_friction"], parameters, {}), fit)
    assert text.endswith("rises from 0 to 5 N towards rest, below some 20 mm/s")


def test_what_the_records_could_not_show() -> None:
    friction = LAWS["coulomb_friction"]
    stated = MassCheck(Quantity(95.0, 0.1), Quantity(95.0, 0.1), True)
    spots = driven_words.blind_spots(evidence(unidentifiable=(friction,)))
    assert spots[0].startswith("anything faster than 12.3 Hz") and "the offset" in spots[1]
    assert spots[2] == "coulomb friction of any size: in this motion it is a mixture of what is in the model"
    assert spots[3] == "an error of the force's scale only rescales mass, drag and friction" and len(spots) == 4
    assert driven_words.blind_spots(evidence(stated)) == spots[:2]
    alike = FoundEffect(friction, {}, {}, (LAWS["quadratic_drag"],))
    alone = FoundEffect(friction, {}, {})
    assert "both ways" in driven_words.separating([alike], evidence(unidentifiable=(friction,)))
    assert driven_words.separating([alone, alike], evidence()).startswith("another motion: slower reversals")
    assert driven_words.separating([alone], evidence()) == ""


def test_what_remains_goes_with() -> None:
    assert driven_words.remainder(3.0, evidence()) == (
        "3 N rms remain, 1.5 times what its cycle repeats to (2 N); 12% of their power goes with the direction of "
        "motion; 46% with the place along the guide; 79% stand in the 10% of samples around reversals"
    )
    assert driven_words.remainder(3.0, evidence(remainder=None)) == ""


def test_candidates_are_single_laws_what_is_mixed_and_the_scale_of_the_force() -> None:
    def trial(*laws: str, value: float = 8.0, std: float = 2.0) -> Any:
        found = SimpleNamespace(parameters=lambda law: {"force_n": Quantity(-value, std)})
        return SimpleNamespace(added=laws, found=found, delta_bic=-30.0, validation_n=1.5)

    searched: Any = SimpleNamespace(
        trials=(trial("coulomb_friction"), trial("cubic_stiffness", "drive_delay"), trial("bearing_gradient", std=0.0)),
        unidentifiable=("quadratic_drag",),
    )
    one, none, mixed, gain = driven._candidates(searched, NONE)
    assert (one.name, one.score, one.delta_bic, one.standing, one.number) == (
        "coulomb_friction", 4.0, -30.0, Standing.VALIDATED, 1.5,
    )  # fmt: skip
    assert none.score == 0.0 and (mixed.name, mixed.standing) == ("quadratic_drag", Standing.MIXTURE)
    assert (gain.effect, gain.score, gain.standing) == (GAIN_ERROR, 0.0, Standing.RESCALES)
    for agrees, standing in ((True, Standing.MASS_AGREES), (False, Standing.MASS_DIFFERS)):
        mass = MassCheck(Quantity(80.0, 0.0), Quantity(100.0, 1.0), agrees)
        gain = driven._candidates(searched, mass)[-1]
        assert gain.standing is standing and gain.number == mass.fitted
        assert gain.parameters["fraction"].value == pytest.approx(-0.2) and gain.score == pytest.approx(0.2 / 0.008)
