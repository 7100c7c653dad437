"""The fitted contact's COR against the closed form, the limits and brute-force differences."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as examples
from hypothesis import strategies as st

from analysis.collision.effects import effect_named
from analysis.collision.parameters import PAPER, Collision, Variant
from analysis.fitted.readings_from_fit import contact_cor, fitted_contact_cor
from analysis.shot.fit import Fit
from analysis.shot.quantity import NotSeen, Quantity

NAMES = ("plate_stiffness_n_per_m", "plate_mass_kg", "contact_stiffness_n_per_m", "contact_damping_n_s_per_m")


def fit_of(collision: Collision, covariance: np.ndarray, model: str = "paper", **changes: object) -> Fit:
    names = NAMES[2:] if model == "contact" else NAMES
    parameters = {
        name: Quantity(getattr(collision, name), float(np.sqrt(covariance[i, i]))) for i, name in enumerate(names)
    }
    return replace(Fit(model, parameters, covariance, (), 1.0, 1e-10, True), **changes)  # type: ignore[arg-type]


def damped_bounce(zeta: float) -> float:
    """-v_out/v_in of a mass on spring and dashpot, released where the overlap is gone: exp(-pi zeta/sqrt(1-zeta^2))."""
    return math.exp(-math.pi * zeta / math.sqrt(1.0 - zeta**2))


@pytest.mark.parametrize("zeta", [0.0, 0.05, 0.3, 0.8])
def test_one_body_contact_is_the_damped_bounce(zeta: float) -> None:
    stiffness, mass = 1e4, 17.85e-3
    collision = Collision(mass, -0.265, 0.0, math.inf, stiffness, 2.0 * zeta * math.sqrt(stiffness * mass))
    assert contact_cor(collision) == pytest.approx(damped_bounce(zeta), rel=1e-10)


def test_a_soft_plate_bounces_with_the_reduced_mass() -> None:
    """Without the plate's spring the two bodies are a damped bounce of their reduced mass."""
    free = replace(PAPER, plate_stiffness_n_per_m=0.0)
    reduced = 1.0 / (1.0 / free.block_mass_kg + 1.0 / free.plate_mass_kg)
    zeta = free.contact_damping_n_s_per_m / 2.0 / math.sqrt(free.contact_stiffness_n_per_m * reduced)
    assert contact_cor(free) == pytest.approx(damped_bounce(zeta), rel=1e-10)


@examples(max_examples=30, deadline=None)
@given(
    speed=st.floats(0.05, 0.6),
    stiffness=st.floats(50.0, 1000.0),
    damping=st.floats(0.0, 0.6),
    variant=st.sampled_from(list(Variant)),
)
def test_independent_of_speed(speed: float, stiffness: float, damping: float, variant: Variant) -> None:
    rig = replace(PAPER, plate_stiffness_n_per_m=stiffness, contact_damping_n_s_per_m=damping, variant=variant)
    assert contact_cor(rig.at_speed(-speed)) == pytest.approx(contact_cor(rig), rel=1e-9)


def test_independent_of_a_mass_error() -> None:
    scaled = Collision(
        *(
            1.03 * v if i != 1 else v
            for i, v in enumerate(
                (
                    PAPER.block_mass_kg,
                    PAPER.velocity_in_m_per_s,
                    PAPER.plate_stiffness_n_per_m,
                    PAPER.plate_mass_kg,
                    PAPER.contact_stiffness_n_per_m,
                    PAPER.contact_damping_n_s_per_m,
                )
            )
        )
    )
    assert contact_cor(scaled) == pytest.approx(contact_cor(PAPER), rel=1e-11)


@pytest.mark.parametrize("variant", list(Variant))
def test_uncertainty_is_that_of_differences(variant: Variant) -> None:
    """Against derivatives taken by differences of the solver, with correlated parameters."""
    collision = replace(PAPER, variant=variant)
    values = np.array([getattr(collision, name) for name in NAMES])
    root = np.diag(1e-3 * values) @ (np.eye(4) + 0.3 * np.tril(np.ones((4, 4)), -1))
    covariance = root @ root.T
    gradient = []
    for name, value in zip(NAMES, values, strict=True):
        up, down = (contact_cor(replace(collision, **{name: value * f})) for f in (1 + 1e-5, 1 - 1e-5))
        gradient.append((up - down) / (2e-5 * value))
    expected = math.sqrt(np.array(gradient) @ covariance @ np.array(gradient))
    reading = fitted_contact_cor(fit_of(collision, covariance, variant.name.lower()), collision.block_mass_kg)
    assert isinstance(reading, Quantity)
    assert reading.value == pytest.approx(contact_cor(collision), rel=1e-9)
    assert reading.std == pytest.approx(expected, rel=1e-5)


def test_one_body_fit() -> None:
    mass, damping = 0.09, 0.75
    collision = Collision(mass, -0.2, 0.0, math.inf, 186.0, damping)
    reading = fitted_contact_cor(fit_of(collision, np.diag([1.0, 1e-4]), "contact"), mass)
    assert isinstance(reading, Quantity)
    assert reading.value == pytest.approx(damped_bounce(damping / 2.0 / math.sqrt(186.0 * mass)), rel=1e-9)
    assert reading.std > 0.0


def test_a_contact_that_no_solution_can_follow_states_so() -> None:
    """So damped that plate and block part a million times more slowly than they meet; found by `make attack`."""
    stuck = replace(
        PAPER,
        plate_stiffness_n_per_m=152.476,
        plate_mass_kg=1.33738e-3,
        contact_stiffness_n_per_m=175.4395,
        contact_damping_n_s_per_m=127.0518,
    )
    reading = fitted_contact_cor(fit_of(stuck, np.eye(4)), stuck.block_mass_kg)
    assert not isinstance(reading, Quantity) and "cannot be followed" in reading.reason


def test_a_model_without_contact_states_why() -> None:
    fit = fit_of(PAPER, np.eye(4))
    for other, word in (
        (replace(fit, converged=False), "converge"),
        (replace(fit, model="driven", parameters={}), "no base model 'driven'"),
        (replace(fit, effects=(effect_named("adhesion"),)), "adhesion"),
        (replace(fit, covariance=np.full((4, 4), np.nan)), "determine"),
    ):
        reading = fitted_contact_cor(other, PAPER.block_mass_kg)
        assert isinstance(reading, NotSeen) and word in reading.reason


def test_a_contact_that_never_lets_go_has_no_cor() -> None:
    """Critically damped and more: the overlap goes towards nothing and does not pass it."""
    mass, stiffness = 0.02, 1e4
    critical = 2.0 * math.sqrt(stiffness * mass)
    for share, lets_go in ((0.99, True), (1.5, False)):
        held = Collision(mass, -0.2, 0.0, math.inf, stiffness, share * critical)
        assert math.isnan(contact_cor(held)) is not lets_go
        reading = fitted_contact_cor(fit_of(held, np.eye(2), "contact"), mass)
        assert isinstance(reading, Quantity) is lets_go
        assert lets_go or (isinstance(reading, NotSeen) and reading.reason == "the fitted contact never lets go")


def test_a_mass_that_was_fitted_is_the_blocks() -> None:
    mass = 0.05
    collision = Collision(mass, -1.0, 0.0, math.inf, 200.0, 0.5)
    fit = fit_of(collision, np.diag([1.0, 1e-4, 1.0])[:2, :2], "contact")
    own = replace(fit, parameters={**fit.parameters, "moving_mass_kg": Quantity(mass, 1e-3)}, covariance=np.eye(3))
    reading = fitted_contact_cor(own, 0.02)
    assert isinstance(reading, Quantity) and reading.value == pytest.approx(contact_cor(collision), rel=1e-9)
    stated = fitted_contact_cor(fit, 0.02)
    lighter = replace(collision, block_mass_kg=0.02)
    assert isinstance(stated, Quantity) and stated.value == pytest.approx(contact_cor(lighter), rel=1e-9)
    missing = fitted_contact_cor(replace(fit, parameters={}), mass)
    assert isinstance(missing, NotSeen) and "has no contact" in missing.reason
