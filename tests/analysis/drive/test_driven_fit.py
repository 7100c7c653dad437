"""The fit of a driven slider: what its stated mass is held against, and what its error is measured by."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.collision.effects.row import Effect
from analysis.drive.bandwidth import force_noise
from analysis.drive.catalogue import LAWS
from analysis.drive.driven_fit import MassCheck, check_mass, filtered_noise_n, fit_driven, prediction_residual_n
from analysis.drive.regression import regress
from analysis.drive.repeatability import Repeatability
from analysis.drive.stretch import Table, prepare
from analysis.shot.motion import Motion
from analysis.shot.quantity import Quantity
from analysis.shot.shot import AnalysisError
from tests.analysis.drive.slider import MASS, OFFSET, VISCOUS, Drive


def stated(*masses: tuple[float, float]) -> list[Motion]:
    given: Any = [SimpleNamespace(moving_mass_kg=mass, moving_mass_u_kg=spread) for mass, spread in masses]
    return list(given)


def fitted(value: float, std: float) -> Any:
    return SimpleNamespace(quantity=lambda name: {"moving_mass_kg": Quantity(value, std, "")}[name])


@pytest.mark.parametrize(
    ("mass", "std", "spread", "agrees"),
    [
        (101.9, 0.1, 0.0, True),  # a fiftieth of the stated mass
        (102.1, 0.1, 0.0, False),
        (98.1, 0.1, 0.0, True),
        (97.9, 0.1, 0.0, False),
        (119.9, 3.0, 4.0, True),  # four times the root of the squares of both
        (120.1, 3.0, 4.0, False),
    ],
)
def test_a_stated_mass_agrees_within_a_fiftieth_or_four_sigmas(
    mass: float, std: float, spread: float, agrees: bool
) -> None:
    check = check_mass(stated((np.nan, 0.0), (100.0, spread)), fitted(mass, std))
    assert check == MassCheck(Quantity(100.0, spread, "stated"), Quantity(mass, std, ""), agrees)
    assert check.fixed == ({"moving_mass_kg": 100.0} if agrees else {})
    assert check.gain_error is not None
    assert check.gain_error.value == pytest.approx(100.0 / mass - 1.0)
    draws = np.random.default_rng(1).standard_normal((2, 4000))
    ratios = (100.0 + spread * draws[0]) / (mass + std * draws[1])
    assert check.gain_error.std == pytest.approx(np.std(ratios), rel=0.05)


def test_a_light_slider_is_weighed_too() -> None:
    assert check_mass(stated((0.04, 0.0)), fitted(0.0405, 1e-4)).agrees


def test_without_a_stated_mass_there_is_nothing_to_hold_it_against() -> None:
    check = check_mass(stated((np.nan, 0.0)), fitted(95.0, 1.0))
    assert (check.stated, check.agrees, check.fixed, check.gain_error) == (None, True, {}, None)


def test_a_mass_that_cannot_be_is_refused_with_its_cause() -> None:
    with pytest.raises(AnalysisError, match="80, 95 are stated of one drive"):
        check_mass(stated((95.0, 1.0), (80.0, 1.0), (95.0, 1.0)), fitted(95.0, 1.0))
    with pytest.raises(AnalysisError, match="the sign of"):
        check_mass(stated((95.0, 1.0)), fitted(-4.1, 1.0))
    for mass in (-3.9, 0.0):
        with pytest.raises(AnalysisError, match="does not weigh it"):
            check_mass(stated((95.0, 1.0)), fitted(mass, 1.0))


def test_chi2_is_the_square_of_the_error_over_what_the_drive_repeats_to() -> None:
    assert Repeatability(2.0, True).chi2(6.0) == 9.0
    assert np.isnan(Repeatability(0.0, True).chi2(6.0))


@pytest.mark.parametrize(("noise_n", "encoder_m"), [(2.0, 1e-7), (1e-3, 2e-6), (1.5, 2e-6)])
def test_the_noise_of_force_and_acceleration_is_all_that_is_left_of_a_clean_drive(
    noise_n: float, encoder_m: float
) -> None:
    motions = [Drive(noise_n=noise_n, encoder_m=encoder_m, seed=seed, seconds=20.0).motion() for seed in (1, 2)]
    table = Table.of(prepare(motions))
    found = regress(table)
    assert filtered_noise_n(motions, table.stretches, found) == pytest.approx(found.rms_n, rel=0.15)


def test_the_noise_of_several_records_is_their_root_mean_square() -> None:
    motions = [Drive(noise_n=noise, encoder_m=1e-8, seed=3).motion() for noise in (1.0, 7.0)]
    table = Table.of(prepare(motions))
    found = regress(table)
    alone = [filtered_noise_n([motion], table.stretches, found) for motion in motions]
    assert filtered_noise_n(motions, table.stretches, found) == pytest.approx(
        np.sqrt(np.mean(np.square(alone))), rel=1e-3
    )
    assert alone[1] / alone[0] == pytest.approx(force_noise(motions[1]) / force_noise(motions[0]), rel=0.05)


def test_a_fit_of_a_clean_drive_says_so() -> None:
    motion = replace(Drive(mass_kg=MASS).motion(), moving_mass_u_kg=0.3)
    fit = fit_driven([motion, motion])
    assert fit.reduced_chi2 == pytest.approx(1.0, abs=0.2)
    assert fit.model == "driven" and fit.shots == () and fit.converged and fit.effects == ()
    assert fit.noise_std_m == pytest.approx(float(np.nanmedian(motion.displacement_std_m)))
    assert fit.covariance[0, 0] == 0.3**2 and fit.parameters["moving_mass_kg"].std == 0.3
    assert np.sqrt(np.diag(fit.covariance)) == pytest.approx([q.std for q in fit.parameters.values()])
    free = fit_driven([Drive().motion()])
    assert free.covariance[0, 0] == pytest.approx(free.parameters["moving_mass_kg"].std ** 2, rel=1e-9) != 0.0
    off = fit_driven([Drive(mass_kg=80.0).motion()])
    assert off.flags == ("mass_disagrees",) and off.parameters["moving_mass_kg"].value == pytest.approx(MASS, rel=1e-2)


def test_a_saved_model_predicts_all_but_the_offset() -> None:
    drive = Drive(lambda x, v: 20.0 * np.sign(v) + 11.0, noise_n=1e-6, encoder_m=1e-9)
    table = Table.of(prepare([drive.motion()]))
    laws: list[Effect] = [LAWS["coulomb_friction"]]

    def left(mass: float) -> np.ndarray:
        known = {
            "moving_mass_kg": mass, "viscous_coefficient_n_s_per_m": VISCOUS, "offset_n": OFFSET,
            "coulomb_friction.force_n": 20.0,
        }  # fmt: skip
        return prediction_residual_n(table, laws, {name: Quantity(value, 0.0, "") for name, value in known.items()})

    assert np.abs(left(MASS)).max() < 0.01
    wrong = table.acceleration_m_per_s2 * (MASS - 90.0)
    np.testing.assert_allclose(left(90.0), wrong - wrong.mean(), atol=0.01)
