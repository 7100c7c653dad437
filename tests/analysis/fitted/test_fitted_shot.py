"""Flags, the contact's COR and the effects in the settings are those of the shot's present fit."""

from dataclasses import replace

import pytest

from analysis.collision.effects import named
from analysis.collision.effects.row import Effect
from analysis.fitted.fitted_shot import fit_again, with_fit
from analysis.shot.consistency import concerning
from analysis.shot.fit import Fit
from analysis.shot.quantity import NotSeen, Quantity
from analysis.shot.shot import Shot
from tests.analysis.shots import PAPER_FIT
from tests.app import synthetic


def of_fit(contact_damping_n_s_per_m: float, *flags: str, effects: tuple[Effect, ...] = ()) -> Fit:
    damping = Quantity(contact_damping_n_s_per_m, 1e-4)
    parameters = {**PAPER_FIT.parameters, "contact_damping_n_s_per_m": damping}
    return replace(PAPER_FIT, parameters=parameters, flags=flags, effects=effects)


def contact(shot: Shot) -> float:
    assert shot.impact is not None
    reading = shot.impact.cor_kinetic.contact
    assert isinstance(reading, Quantity)
    return reading.value


def test_a_new_fit_replaces_all_of_the_old_one() -> None:
    shot = replace(synthetic.shot(), flags=("clipped",))
    first = with_fit(shot, of_fit(0.4, "contact_damping_n_s_per_m_at_bound"))
    assert first.flags == ("clipped", "contact_damping_n_s_per_m_at_bound")
    second = with_fit(first, of_fit(0.2, effects=(named("tilt"),)))
    assert second.flags == ("clipped",)
    assert contact(second) > contact(first) + 0.05
    assert second.settings.effects == (named("tilt"),)
    assert with_fit(first, second.fit) == second
    assert second.impact is not None and shot.impact is not None
    others = replace(second.impact, cor_kinetic=shot.impact.cor_kinetic)
    assert others == shot.impact


def test_a_flag_of_the_motion_is_kept_when_the_fit_is_replaced() -> None:
    shot = synthetic.shot()
    assert shot.motion is not None
    shot = replace(shot, motion=replace(shot.motion, flags=("noise_not_known",)), flags=("noise_not_known",))
    assert with_fit(with_fit(shot, of_fit(0.4, "noise_not_known")), of_fit(0.4)).flags == ("noise_not_known",)


def test_a_failed_fit_is_flagged_until_one_succeeds() -> None:
    failed = with_fit(with_fit(synthetic.shot(), of_fit(0.4, "one")), None)
    assert failed.fit is None and failed.flags == ("fit_failed",)
    assert failed.impact is not None and isinstance(failed.impact.cor_kinetic.contact, NotSeen)
    again = with_fit(failed, replace(of_fit(0.4), converged=False))
    assert again.flags == ("fit_not_converged",)


@pytest.mark.parametrize("missing", ["motion", "impact"])
def test_a_shot_without_anything_to_fit_is_unchanged(missing: str) -> None:
    shot = replace(synthetic.shot(), **{missing: None})
    assert fit_again(shot, ("tilt",)) is shot


def test_a_joint_fit_gives_each_shot_its_own_part() -> None:
    shot = synthetic.shot()
    assert shot.fit is not None
    parts = tuple(replace(shot.fit.shots[0], reduced_chi2=value) for value in (1.5, 2.5))
    mine = replace(shot.fit, shots=parts, reduced_chi2=2.0).of_shot(1)
    assert mine.shots == (parts[1],) and mine.reduced_chi2 == 2.5


def test_vibration_flags_concern_the_fitted_numbers_alone() -> None:
    shot = synthetic.shot()
    assert shot.impact is not None
    shaken = replace(shot, impact=replace(shot.impact, flags=("vibration",)), flags=("vibration",))
    fitted = with_fit(shaken, of_fit(0.4))
    assert "plate_shaken" in concerning("plate_mass_kg", fitted.flags)
    assert concerning("stiffness_slope_n_per_m", fitted.flags) == ()
    assert "plate_shaken" not in with_fit(replace(fitted, impact=shot.impact), of_fit(0.4)).flags
