"""What is declared of each number decides where it stands; a table of all, and how each is found."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pytest

from analysis.shot.quantity import NotSeen, Quantity
from analysis.shot.shot import AnalysisSettings
from analysis.uncertainty.numbers import (
    NUMBERS,
    Group,
    Origin,
    ResultNumber,
    collision_numbers,
    number_with_key,
    read_number,
    series_numbers,
    shown_numbers,
    with_unit,
)
from tests.analysis.shots import shot_of
from tests.analysis.synthetic_collision import MASS_KG, Synthetic, motion_from

# key: unit, heading of its column; "r" the same in other shots, "l" listed, "L" shown large, "v" varies with speed
# alone, "f" shown on request
TABLE = {
    "velocity_in_m_per_s": ("m/s", "v in (m/s)", "lLv"),
    "velocity_out_m_per_s": ("m/s", "v out (m/s)", "lLv"),
    "cor_quasi_static": ("1", "COR quasi-static", "rlLh"),
    "cor_impulse": ("1", "COR impulse ratio", "r"),
    "cor_kinetic.force_peaks": ("1", "COR kinetic, peaks", "rl"),
    "cor_kinetic.onsets": ("1", "COR kinetic, onsets", "rf"),
    "cor_kinetic.flights": ("1", "COR kinetic, flights", "rf"),
    "cor_kinetic.contact": ("1", "COR fitted contact", "rf"),
    "force_peak_n": ("N", "F max (N)", "lL"),
    "force_fwhm_s": ("s", "pulse width (ms)", ""),
    "contact_time_s": ("s", "contact time (ms)", "L"),
    "deflection_max_m": ("m", "deflection (mm)", ""),
    "plate_stiffness_n_per_m": ("N/m", "k_p (N/m)", "rl"),
    "plate_mass_kg": ("kg", "m_p* (g)", "r"),
    "contact_stiffness_n_per_m": ("N/m", "k_N (N/m)", "r"),
    "contact_damping_n_s_per_m": ("N s/m", "γ_N (N s/m)", "r"),
    "stiffness_slope_n_per_m": ("N/m", "slope of F (N/m)", "r"),
    "stiffness_from_slope_n_per_m": ("N/m", "k_p from slope (N/m)", ""),
    "youngs_modulus_pa": ("Pa", "E (GPa)", ""),
    "moving_mass_kg": ("kg", "mass (g)", "L"),
    "viscous_coefficient_n_s_per_m": ("N s/m", "viscous drag (N s/m)", "L"),
    "offset_n": ("N", "offset (N)", "L"),
    "reduced_chi2": ("1", "χ²/ν", ""),
    "stated_mass_kg": ("kg", "moving mass (g)", ""),
}


def marks(number: ResultNumber) -> str:
    said = (number.repeats, number.listed, number.large, number.headline, not number.in_series, bool(number.folded))
    return "".join(mark for mark, is_so in zip("rlLhvf", said, strict=True) if is_so)


def test_the_numbers_are_these_with_these_units_and_places() -> None:
    assert {n.key: (n.unit, n.head, marks(n)) for n in NUMBERS}.items() >= TABLE.items()


def test_files_series_and_budgets_take_the_numbers_of_their_kind() -> None:
    keys = list(TABLE)

    def among(numbers: Iterable[ResultNumber]) -> list[str]:
        return [number.key for number in numbers if number.key in TABLE]

    assert among(collision_numbers(Origin.READ)) == [*keys[:12], "stiffness_slope_n_per_m"]
    assert among(collision_numbers(Origin.FITTED)) == keys[12:16]
    assert among(collision_numbers(Origin.DERIVED)) == keys[17:19]
    assert among(collision_numbers(Origin.STATED)) == keys[22:]  # a drive's are none of a collision
    assert among(series_numbers()) == [*keys[2:12], *keys[12:17]]
    assert among(n for n in NUMBERS if callable(n.equation)) == keys[:19]
    assert among(shown_numbers(Group.PLATE)) == keys[12:17]
    assert among(shown_numbers(Group.DRIVE)) == keys[19:22]
    assert number_with_key("offset_n").group is Group.DRIVE
    with pytest.raises(KeyError, match="nothing"):
        number_with_key("nothing")
    assert (with_unit("x", "mm"), with_unit("x", "")) == ("x (mm)", "x")


def test_a_number_is_found_in_the_impact_the_fit_or_the_motion_or_it_is_said_why_not() -> None:
    rig = Synthetic()
    time = np.arange(0.0, 0.01, 1e-5)
    shot = shot_of(motion=motion_from(time, -0.2 * time, rig))
    assert shot.impact is not None and shot.fit is not None
    assert read_number(shot, "force_peak_n") is shot.impact.force_peak_n
    assert read_number(shot, "cor_kinetic.flights") is shot.impact.cor_kinetic.flights
    assert read_number(shot, "plate_mass_kg") is shot.fit.parameters["plate_mass_kg"]
    assert read_number(shot, "stated_mass_kg") == Quantity(MASS_KG, 1e-6, "as stated for the shot")
    assert read_number(shot, "reduced_chi2") == Quantity(1.0, 0.0, "the fit of this shot alone")
    blind = replace(shot, impact=None, motion=None, fit=None, problem="no light")
    for key in ("force_peak_n", "stated_mass_kg"):
        assert read_number(blind, key) == NotSeen("no light")
    nothing = replace(blind, problem=None)
    assert (read_number(nothing, "force_peak_n"), read_number(nothing, "stated_mass_kg")) == (
        NotSeen("no impact"),
        NotSeen("no motion"),
    )
    unsaid = replace(shot, motion=motion_from(time, -0.2 * time, rig))
    assert unsaid.motion is not None
    unsaid = replace(unsaid, motion=replace(unsaid.motion, moving_mass_kg=float("nan")))
    assert read_number(unsaid, "stated_mass_kg") == NotSeen("no mass is stated")
    guess = replace(shot, fit=replace(shot.fit, converged=False))
    assert read_number(guess, "plate_mass_kg") == NotSeen("the fit did not converge, so its numbers are guesses")
    assert read_number(guess, "reduced_chi2") == read_number(blind, "reduced_chi2") == NotSeen("no converged fit")
    other = replace(shot, fit=replace(shot.fit, parameters={}))
    assert read_number(other, "plate_mass_kg") == NotSeen("not in the model paper")
    unfitted = replace(shot, fit=None, settings=AnalysisSettings(fit=False))
    assert read_number(unfitted, "plate_mass_kg") == NotSeen("no fit")
