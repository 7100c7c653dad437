"""The fit: the truth within its uncertainty, from data alone, over the range of rigs and speeds; its flags."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.collision.effects import effect_named
from analysis.collision.parameters import PAPER
from analysis.inference.fit.shot_fit import fit_shots
from analysis.inference.model.course import NoCollision
from analysis.inference.model.samples import averaged_shot
from analysis.inference.noise.flights import noise_of_flights
from analysis.shot.shot import Cancelled
from tests.analysis.collision.simulated import shot
from tests.analysis.synthetic_collision import PLATE_N_PER_M, Synthetic, motion_of

NAMES = (
    "plate_stiffness_n_per_m",
    "plate_mass_kg",
    "contact_stiffness_n_per_m",
    "contact_damping_n_s_per_m",
)
SIGMAS = 4.5  # a chance of 7e-6 a number


@pytest.mark.parametrize(
    ("velocity", "plate", "mass", "contact", "damping"),
    [
        (-0.265, 221.4, 1.984e-4, 1e4, 0.4),
        (-0.05, 50.0, 1.2e-4, 8e3, 0.5),
        (-0.6, 1000.0, 4e-4, 2e4, 0.3),
        (-0.275, 57.0, 8.05e-5, 3.3e4, 0.54),
        (-0.314, 105.0, 4.35e-4, 2.94e4, 0.17),
        (-0.15, 616.0, 1.2e-4, 2.2e4, 0.15),
    ],
)
def test_truth_is_found_from_the_data_alone(
    velocity: float, plate: float, mass: float, contact: float, damping: float
) -> None:
    truth = (plate, mass, contact, damping)
    collision = replace(PAPER, velocity_in_m_per_s=velocity, **dict(zip(NAMES, truth, strict=True)))
    samples = int((0.035 + collision.contact_time_estimate_s) * 1e5)
    fit = fit_shots([shot(collision, samples=samples, seed=int(plate))])
    assert fit.converged
    for name, value in zip(NAMES, truth, strict=True):
        assert abs(fit.parameters[name].value - value) < SIGMAS * fit.parameters[name].std
        assert fit.parameters[name].std < 1e-2 * value
    one = fit.shots[0]
    assert abs(one.velocity_in_m_per_s.value - velocity) < SIGMAS * one.velocity_in_m_per_s.std
    assert abs(one.touch_time_s.value - 0.0123456) < SIGMAS * one.touch_time_s.std
    assert fit.reduced_chi2 == pytest.approx(1.0, abs=0.15)
    assert one.overlay.events_s[0] == ("touch", one.touch_time_s.value)


def test_a_wandering_floor_is_learned_and_owned_up_to() -> None:
    motion = shot(white_m=1e-10, floor_m=5e-10, seed=3)
    samples = averaged_shot(motion)
    noise, _ = noise_of_flights([samples])
    assert noise.rms_m[0] > 2e-10
    step_m2 = 2 * 5e-10**2 * samples.spacing_s / 3e-3
    averaged_m = np.sqrt(1e-10**2 / samples.factor - step_m2 / 6)  # means of what wanders step as if they had less
    assert noise.white_m == pytest.approx(averaged_m, rel=0.2)
    fit = fit_shots([motion])
    for name in NAMES:
        assert abs(fit.parameters[name].value - getattr(PAPER, name)) < SIGMAS * fit.parameters[name].std
    clean = fit_shots([shot(white_m=1e-10, seed=3)])
    assert fit.parameters["plate_stiffness_n_per_m"].std > 2 * clean.parameters["plate_stiffness_n_per_m"].std


def test_gaps_do_no_harm() -> None:
    motion = shot(seed=5)
    displacement, valid = motion.displacement_m.copy(), motion.valid.copy()
    for begin, end in ((300, 340), (1500, 1530), (2900, 3000), (5500, 6000)):
        displacement[begin:end], valid[begin:end] = np.nan, False
    fit = fit_shots([replace(motion, displacement_m=displacement, valid=valid)])
    assert fit.converged
    for name in NAMES:
        assert abs(fit.parameters[name].value - getattr(PAPER, name)) < SIGMAS * fit.parameters[name].std
    assert np.isnan(fit.shots[0].residual_m[~valid]).all()


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("quadratic_drag", (1.3e-3,)),
        ("cubic_stiffness", (2.6e5,)),
        ("contact_exponent", (0.1,)),
        ("second_plate_mode", (6.5e-3, 1170.0, 0.026)),
        ("sensor_drift", (1.3e-4,)),
    ],
)
def test_joint_fit_with_an_effect_finds_it(name: str, values: tuple[float, ...]) -> None:
    speeds = (-0.15, -0.4)
    motions = [shot(PAPER.at_speed(v), effects={name: values}, seed=i, samples=5500) for i, v in enumerate(speeds)]
    fit = fit_shots(motions, effects=(name,))
    assert fit.converged and fit.effects == (effect_named(name),)
    assert fit.reduced_chi2 == pytest.approx(1.0, abs=0.1)
    found = [q for key, q in fit.parameters.items() if key.startswith(name)]
    for quantity, value in zip(found, values, strict=True):
        assert abs(quantity.value - value) < SIGMAS * quantity.std + 2e-3 * abs(value)
    for key in NAMES:
        assert abs(fit.parameters[key].value - getattr(PAPER, key)) < SIGMAS * fit.parameters[key].std
    assert fit.covariance.shape == (4 + len(values), 4 + len(values))


def test_what_cannot_be_fitted_says_why() -> None:
    motion = shot()
    flight = replace(motion, displacement_m=motion.time_s * -0.2)
    with pytest.raises(NoCollision, match="no turnaround"):
        fit_shots([flight])
    with pytest.raises(NoCollision, match=r"begins in contact|no block moving"):
        fit_shots([replace(motion, valid=motion.time_s > 0.02)])
    with pytest.raises(ValueError, match="no base model"):
        fit_shots([motion], model="wishful")
    with pytest.raises(ValueError, match="no effect"):
        fit_shots([motion], effects=("magic",))
    with pytest.raises(Cancelled):
        fit_shots([motion], cancelled=lambda: True)


@pytest.mark.parametrize("seed", [28, 29, 30])
def test_a_collision_integrated_elsewhere_converges(seed: int) -> None:
    fit = fit_shots([motion_of(Synthetic(noise_m=0.3e-9), seed=seed)])
    assert fit.converged and not fit.flags
    assert abs(fit.parameters["plate_stiffness_n_per_m"].value - PLATE_N_PER_M) < SIGMAS * (
        fit.parameters["plate_stiffness_n_per_m"].std
    )
