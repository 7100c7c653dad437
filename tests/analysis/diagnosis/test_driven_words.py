"""What is said of a drive, whole sentences at a time."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.diagnosis import driven
from analysis.diagnosis.findings import driven_words
from analysis.diagnosis.findings.result import DriveEvidence, DriveRemainder, Errors, FoundEffect, Standing, Verdict
from analysis.drive.catalogue import GAIN_ERROR, LAWS
from analysis.drive.driven_fit import MassCheck
from analysis.drive.repeatability import Repeatability
from analysis.shot.quantity import Quantity

NONE = MassCheck(None, Quantity(95.0, 0.5), True)
LEFT = DriveRemainder(0.123, 0.456, 0.789, 0.1)


def evidence(mass: MassCheck = NONE, force_n: float = 2.0, **more: Any) -> DriveEvidence:
    given: dict[str, Any] = {"bandwidth_hz": 12.34, "unidentifiable": (), "remainder": LEFT} | more
    return DriveEvidence(Repeatability(force_n, True, 0.5), mass, **given)


def diagnosis(verdict: Verdict, effects: tuple[FoundEffect, ...] = (), held_n: float | None = None) -> Any:
    def of(force_n: float) -> Errors:
        return Errors(np.nan, np.nan, force_n, 1.0)

    return SimpleNamespace(
        verdict=verdict, effects=effects, error_before=of(60.0), error_after=of(3.0),
        error_held_out_after=None if held_n is None else of(held_n),
        fit_after=SimpleNamespace(parameters={"viscous_coefficient_n_s_per_m": Quantity(200.0, 1.0)}),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("limit", "words"),
    [
        (Repeatability(2.0, True, 0.5), "the repeatability of its cycle of 0.5 s"),
        (Repeatability(2.0, True), "the record-to-record repeatability for one input"),
        (Repeatability(2.0, False), "the noise of the force in this band"),
    ],
)
def test_the_limit_of_a_drive_is_worded_from_the_passes_it_was_observed_in(limit: Repeatability, words: str) -> None:
    told = driven_words.sentence(diagnosis(Verdict.ADEQUATE), replace(evidence(), repeatability=limit))
    assert f"3 N is 1.5 times {words} (2 N)." in told


def test_a_verdict_in_a_sentence() -> None:
    against = "3 N is 1.5 times the repeatability of its cycle of 0.5 s (2 N)."
    friction = FoundEffect(LAWS["coulomb_friction"], {"force_n": Quantity(20.0, 0.5)}, {})
    named = f"The drive has {driven_words.effect(friction, diagnosis(Verdict.ADEQUATE).fit_after)}."
    error = " Force error 60 -> 3 N rms"
    assert (
        driven_words.sentence(diagnosis(Verdict.EFFECT_FOUND, (friction,)), evidence()) == f"{named}{error}; {against}"
    )
    held = driven_words.sentence(diagnosis(Verdict.EFFECT_FOUND, (friction, friction), 4.0), evidence())
    assert held.count("; coulomb friction") == 1 and f"{error}, 4 N on the validation half; {against}" in held
    adequate = driven_words.sentence(diagnosis(Verdict.ADEQUATE), evidence())
    assert adequate == f"Adequate: mass, viscous drag and offset explain the force; {against}"
    none = driven_words.sentence(diagnosis(Verdict.UNEXPLAINED), evidence(force_n=0.0))
    assert none == (
        "Unexplained: 60 N rms remain and no catalogue law predicts them; 3 N is inf times the repeatability of its "
        "cycle of 0.5 s (0 N)."
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
        ("drive_delay", {"time_s": -0.0012}, ": the motion answers the force 1.2 ms earlier"),
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
    assert text.endswith(f"{said} (indistinguishable from: quadratic drag, bearing gradient)")
    for value in parameters.values():
        assert value.in_text() in text


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
    assert spots[2] == "coulomb friction of any size: in this motion it is a linear combination of effects in the model"
    assert spots[3] == "an error of the force's scale only rescales mass, drag and friction" and len(spots) == 4
    assert driven_words.blind_spots(evidence(stated)) == spots[:2]
    alike = FoundEffect(friction, {}, {}, (LAWS["quadratic_drag"],))
    alone = FoundEffect(friction, {}, {})
    assert "both ways" in driven_words.separating([alike], evidence(unidentifiable=(friction,)))
    assert driven_words.separating([alone, alike], evidence()).startswith("another motion: slower reversals")
    assert driven_words.separating([alone], evidence()) == ""


def test_what_remains_goes_with() -> None:
    assert driven_words.remainder(3.0, evidence()) == (
        "3 N rms remain, 1.5 times the repeatability of its cycle of 0.5 s (2 N); 12% of their power is correlated "
        "with the direction of motion; 46% with the position along the guide; 79% occurs in the 10% of samples around "
        "reversals"
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


def test_what_a_drive_leaves_goes_with_direction_place_and_reversals() -> None:
    random = np.random.default_rng(2)
    count = 900
    speed = np.sin(np.linspace(0.0, 40.0, count)) * np.linspace(0.5, 1.0, count)
    place = np.cumsum(speed) * 0.01
    turn = 2 * np.pi * place / np.ptp(place)
    slow = np.abs(speed) < 0.1 * np.abs(speed).max()
    for left, direction, along in (
        (np.where(speed > 0.0, 3.0 + 2.0 * speed, 1.0 - speed), 1.0, None),  # another line for either direction
        (2.0 + place + np.sin(turn) - np.cos(2 * turn) + np.sin(3 * turn), None, 1.0),
        (np.where(slow, 1.0, 0.0) * random.standard_normal(count), None, None),
    ):
        table: Any = SimpleNamespace(velocity_m_per_s=speed, displacement_m=place)
        found = driven.remainder(table, SimpleNamespace(residual_n=left))  # type: ignore[arg-type]
        assert direction is None or found.direction == pytest.approx(direction)
        assert along is None or found.place == pytest.approx(along)
        assert found.reversal_samples == slow.mean()
        assert found.reversals == pytest.approx(np.sum(left[slow] ** 2) / np.sum(left**2))
    assert found.reversals == pytest.approx(1.0) and found.direction < 0.05 and found.place < 0.05
    four = driven.remainder(table, SimpleNamespace(residual_n=np.sin(4 * turn)))  # type: ignore[arg-type]
    assert four.place < 0.9


@pytest.mark.parametrize(("rms_n", "explained"), [(3.0, True), (3.01, False)])
def test_a_drive_is_diagnosed_step_by_step(rms_n: float, explained: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[Any] = []
    asked: list[Any] = []
    earlier = np.array([True, True, False])
    table: Any = SimpleNamespace(stretches=[SimpleNamespace(bandwidth_hz=12.0)], earlier=earlier)
    delay = {"delta_bic": -40.0, "held_out_force_rms_without_it_n": 9.0}
    found = SimpleNamespace(laws=("coulomb_friction", "drive_delay"), nonlinear="nonlinear")
    searched = SimpleNamespace(
        found=found, unidentifiable=("quadratic_drag",), trials=(),
        evidence={"drive_delay": delay},
    )  # fmt: skip
    mass = MassCheck(None, Quantity(95.0, 0.5), True)

    class Fit:
        def __init__(self, laws: Any, mask: Any, nonlinear: Any, fixed: Any) -> None:
            asked.append((laws, mask is earlier if mask is not None else None, nonlinear, fixed))
            self.laws, self.rms_n = laws, rms_n if len(laws) == 2 else 50.0

        def rms_of(self, held: Any) -> float:
            assert held.tolist() == [False, False, True]
            return 7.0 if len(self.laws) == 2 else 70.0

        def parameters(self, law: str) -> Any:
            return {"of": law}

    class OfTable:
        @staticmethod
        def of(prepared: Any, *stop: Any) -> Any:
            assert prepared == ("prepared", "motions") and stop[0]() is False
            return table

    def search_laws(of: Any, accepted: Any, tell: Any) -> Any:
        assert of is table and accepted == ("coulomb_friction",)
        tell(0.5)
        return searched

    repeatability = Repeatability(2.0, True, 0.5)
    for name, made in {
        "Table": OfTable, "search_laws": search_laws,
        "prepare": lambda motions: ("prepared", motions),
        "regress": lambda of, laws, mask, nonlinear, fixed=None: Fit(laws, mask, nonlinear, fixed),
        "check_mass": lambda motions, free: mass if motions == "motions" and len(free.laws) == 2 else None,
        "filtered_noise_n": lambda motions, stretches, whole: (motions, stretches, len(whole.laws)),
        "repeatability_of": lambda of, whole, noise: repeatability if noise[2] == 2 and noise[0] == "motions" else None,
        "look_alikes": lambda of, whole, law: ("quadratic_drag",),
        "as_fit": lambda motions, whole, check, repeats, s: (motions, len(whole.laws), check, repeats, s > 0.0),
        "remainder": lambda of, whole: ("left", of, len(whole.laws)),
    }.items():  # fmt: skip
        monkeypatch.setattr(driven, name, made)
    given: Any = "motions"
    made = driven.diagnose_driven(given, ("coulomb_friction",), lambda *what: told.append(what))
    assert made.verdict is (Verdict.EFFECT_FOUND if explained else Verdict.PARTLY_EXPLAINED)
    assert made.effects == (
        FoundEffect(LAWS["drive_delay"], {"of": "drive_delay"}, delay, (LAWS["quadratic_drag"],)),  # type: ignore[dict-item]
    )
    forces = (made.error_before, made.error_after, made.error_held_out_before, made.error_held_out_after)
    assert [(one.force_rms_n, one.reduced_chi2) for one in forces if one] == [
        (50.0, 625.0), (rms_n, (rms_n / 2) ** 2), (70.0, 1225.0), (7.0, 12.25),
    ]  # fmt: skip
    assert all(one is not None and np.isnan(one.displacement_rms_m + one.velocity_rms_m_per_s) for one in forces)
    assert made.fit_before == ("motions", 1, mass, repeatability, False)  # type: ignore[comparison-overlap]
    assert made.fit_after == ("motions", 2, mass, repeatability, True) and made.seconds > 0.0  # type: ignore[comparison-overlap]
    drive = made.drive
    assert drive is not None and (drive.repeatability, drive.mass, drive.bandwidth_hz) == (repeatability, mass, 12.0)
    assert drive.unidentifiable == (LAWS["quadratic_drag"],)
    assert drive.remainder == (None if explained else ("left", table, 2))
    one, two = ("coulomb_friction",), found.laws
    assert asked == [(two, None, "nonlinear", None)] + [
        (laws, mask, "nonlinear", mass.fixed) for mask in (None, True) for laws in (one, two)
    ]
    trying = "trying the laws of a drive"
    assert told == [
        ("fitting mass, drag and offset", 0.0), (trying, 0.1), (trying, pytest.approx(0.45)),
        ("fitting the whole record", 0.85), ("distinguishing look-alikes", 0.9), ("diagnosed", 1.0),
    ]  # fmt: skip
