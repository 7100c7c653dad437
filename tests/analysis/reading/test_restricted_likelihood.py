"""The restricted likelihood against the density of a normal distribution, by matrices written out."""

from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import approx_fprime, minimize
from scipy.stats import multivariate_normal

from analysis.reading.restricted_likelihood import (
    Bands,
    Curvature,
    RestrictedLikelihood,
    ShotResidual,
    chain_precision,
    mixture_covariance,
    points_about,
)

SAMPLES, BANDS, NUMBERS = 14, 2, 5
AT = np.array([0.3, -0.4, 0.9])
PRECISION = np.array([[4.0, 0.5, 0.0], [0.5, 1.0, -0.2], [0.0, -0.2, 2.0]])


def shot(seed: int, places: tuple[int, ...]) -> ShotResidual:
    """Return a shot all of whose directions are the bands' too: its rows are the samples themselves."""
    random = np.random.default_rng(seed)
    along = random.standard_normal((SAMPLES, 1 + len(places)))
    factors = random.standard_normal((SAMPLES, NUMBERS))
    shares = random.uniform(0.2, 1.0, (BANDS, NUMBERS))
    rest = np.zeros((1 + len(places), 1 + len(places)))
    return ShotResidual(along, rest, SAMPLES, 0.7 * seed, np.array(places, dtype=np.intp), Bands(factors, shares))


SHOTS = (shot(1, (0, 1)), shot(2, (0, 2)))


def covariance(one: ShotResidual, at: Any) -> Any:
    return (
        np.exp(at[0]) * np.eye(SAMPLES) + one.bands.factors * (np.exp(at[1:]) @ one.bands.shares) @ one.bands.factors.T
    )


def written_out(at: Any) -> tuple[float, Any, Any]:
    """Return the log of the density integrated over the parameters, their values and their covariance."""
    whole = np.zeros((2 * SAMPLES, 2 * SAMPLES))
    design, values = np.zeros((2 * SAMPLES, 3)), np.zeros(2 * SAMPLES)
    for k, one in enumerate(SHOTS):
        rows = slice(k * SAMPLES, (k + 1) * SAMPLES)
        whole[rows, rows] = covariance(one, at)
        design[rows, one.places] = one.along[:, 1:]
        values[rows] = one.along[:, 0]
    inverse = np.linalg.inv(whole)
    found = np.linalg.inv(design.T @ inverse @ design)
    best = found @ design.T @ inverse @ values
    value = multivariate_normal(np.zeros(2 * SAMPLES), whole).logpdf(values - design @ best)
    value += 0.5 * np.linalg.slogdet(found)[1]  # the 2 pi of the integral is a constant
    return value - 0.5 * sum(one.logs for one in SHOTS) - 0.5 * at @ PRECISION @ at, best, found


def test_the_likelihood_is_the_density_with_the_parameters_integrated_over_and_its_slope_the_derivative() -> None:
    likelihood = RestrictedLikelihood(SHOTS, PRECISION)
    for at in (AT, -AT):
        here = likelihood.at(at)
        value, best, found = written_out(at)
        assert here.value == pytest.approx(value, rel=1e-9)
        assert here.covariance == pytest.approx(found, rel=1e-8)
        assert here.profile == pytest.approx(value - 0.5 * np.linalg.slogdet(found)[1], rel=1e-9)
        assert here.slope == pytest.approx(approx_fprime(at, lambda z: written_out(z)[0], 1e-6), abs=1e-4)
        assert likelihood.fits(np.stack([at, AT]))[0][0] == pytest.approx(best, rel=1e-8)
        assert likelihood.fits(np.stack([AT, at]))[1][1] == pytest.approx(found, rel=1e-8)


def test_what_lies_across_the_bands_counts_as_white_noise_alone() -> None:
    """The same samples, those without motion given as products only."""
    one = shot(1, (0, 1))
    still = np.random.default_rng(9).standard_normal((6, 3))
    whole = ShotResidual(
        np.vstack([one.along, still]), np.zeros((3, 3)), SAMPLES + 6, 0.0, one.places,
        Bands(np.vstack([one.bands.factors, np.zeros((6, NUMBERS))]), one.bands.shares),
    )  # fmt: skip
    parts = ShotResidual(one.along, still.T @ still, SAMPLES + 6, 0.0, one.places, one.bands)
    here, there = (RestrictedLikelihood((each,), PRECISION).at(AT) for each in (whole, parts))
    assert there.value == pytest.approx(here.value, rel=1e-12)
    assert there.slope == pytest.approx(here.slope, rel=1e-9)
    assert parts.products(AT) == pytest.approx(parts.whitened(AT).products, rel=1e-12)


def test_the_curvature_is_the_expected_one_of_a_shot_whose_parameters_are_known() -> None:
    """Fisher's information of a normal distribution: half the trace of (V^-1 dV)(V^-1 dV)."""
    one = ShotResidual(shot(1, ()).along, np.zeros((1, 1)), SAMPLES, 0.0, np.zeros(0, np.intp), shot(1, ()).bands)
    likelihood = RestrictedLikelihood((one,), PRECISION)
    here = likelihood.at(AT)
    inverse = np.linalg.inv(covariance(one, AT))
    changes = [np.exp(AT[0]) * np.eye(SAMPLES)]
    changes += [np.exp(AT[1 + k]) * one.bands.factors * one.bands.shares[k] @ one.bands.factors.T for k in range(BANDS)]
    fisher = [[0.5 * np.trace(inverse @ a @ inverse @ b) for b in changes] for a in changes]
    assert likelihood.curvature(here) == pytest.approx(PRECISION + np.array(fisher), rel=1e-9)


def test_parameters_that_take_part_of_the_motion_leave_less_curvature_by_what_they_project_out() -> None:
    one = shot(1, (0, 1))
    likelihood = RestrictedLikelihood((one,), PRECISION)
    inverse = np.linalg.inv(covariance(one, AT))
    design = one.along[:, 1:]
    left = inverse - inverse @ design @ np.linalg.inv(design.T @ inverse @ design) @ design.T @ inverse
    changes = [np.exp(AT[0]) * np.eye(SAMPLES)]
    changes += [np.exp(AT[1 + k]) * one.bands.factors * one.bands.shares[k] @ one.bands.factors.T for k in range(BANDS)]
    fisher = [[0.5 * np.trace(left @ a @ left @ b) for b in changes] for a in changes]
    assert likelihood.curvature(likelihood.at(AT)) == pytest.approx(PRECISION + np.array(fisher), rel=1e-9)


@pytest.mark.parametrize("start", [np.zeros(3), np.array([3.0, -6.0, 5.0])])
def test_the_search_ends_at_the_greatest_likelihood_from_near_and_far(start: Any) -> None:
    found = RestrictedLikelihood(SHOTS, PRECISION).greatest((start,), Curvature())
    best = minimize(lambda z: -written_out(z)[0], np.zeros(3), method="BFGS")
    assert found.value == pytest.approx(-best.fun, abs=5e-3)
    assert found.at == pytest.approx(best.x, abs=0.15)
    again = RestrictedLikelihood(SHOTS, PRECISION).greatest((found.at,), Curvature())
    assert again.value >= found.value


def test_where_motion_drowns_all_there_is_no_likelihood_and_no_curvature() -> None:
    likelihood = RestrictedLikelihood(SHOTS, PRECISION)
    nowhere = likelihood.at(np.array([-60.0, 60.0, 60.0]))
    assert nowhere.value == -np.inf
    with pytest.raises(np.linalg.LinAlgError):
        likelihood.curvature(nowhere)
    assert likelihood.greatest((nowhere.at,), Curvature()).at is nowhere.at


def test_a_parameter_of_no_shot_has_unit_variance_and_disturbs_no_other() -> None:
    alone = RestrictedLikelihood((shot(1, (0, 1)),), PRECISION).at(AT)
    beside = RestrictedLikelihood((shot(1, (0, 2)),), PRECISION).at(AT)
    assert beside.value == pytest.approx(alone.value, rel=1e-12)
    assert beside.covariance[np.ix_([0, 2], [0, 2])] == pytest.approx(alone.covariance, rel=1e-12)
    assert beside.covariance[1].tolist() == [0.0, 1.0, 0.0]


def test_the_root_is_that_of_one_and_the_motion_its_diagonal_a_part_larger() -> None:
    bands = shot(1, (0,)).bands
    motion = bands.factors @ np.diag(np.exp(AT[1:] - AT[0]) @ bands.shares) @ bands.factors.T
    root = bands.root(AT, 0.1)
    assert root @ root.T == pytest.approx(np.eye(SAMPLES) + motion + 0.1 * np.diag(np.diag(motion)), rel=1e-12)
    assert root == pytest.approx(np.tril(root))
    plain = bands.root(AT)
    assert plain @ plain.T == pytest.approx(np.eye(SAMPLES) + motion, rel=1e-12)


@pytest.mark.parametrize("wrong", [np.nan, np.inf])
def test_what_is_no_number_has_no_root(wrong: float) -> None:
    bands = shot(1, (0,)).bands
    bands.factors[2, 1] = wrong
    with pytest.raises(np.linalg.LinAlgError), np.errstate(invalid="ignore"):
        bands.root(AT)


def test_numbers_of_a_chain_are_as_likely_as_their_sizes_and_steps() -> None:
    level, step, at = np.array([2.0, np.inf, 3.0]), np.array([0.5, 4.0]), np.array([0.3, -1.0, 2.0])
    square = (0.3 / 2.0) ** 2 + (2.0 / 3.0) ** 2 + (1.3 / 0.5) ** 2 + (3.0 / 4.0) ** 2
    assert at @ chain_precision(level, step) @ at == pytest.approx(square)


@pytest.mark.parametrize("pairs", [2, 6])
def test_points_lie_in_pairs_about_the_mean_with_the_covariance_of_the_precision(pairs: int) -> None:
    mean = np.array([1.0, -2.0, 0.5])
    points = points_about(mean, PRECISION, pairs)
    assert points.shape == (2 * pairs, 3)
    assert 0.5 * (points[:pairs] + points[pairs:]) == pytest.approx(np.tile(mean, (pairs, 1)))
    level, turn = np.linalg.eigh(PRECISION)
    unit = (points - mean) @ (turn * np.sqrt(level)) @ turn.T
    spread = unit.T @ unit / (2 * pairs)
    assert np.diag(spread) == pytest.approx(np.ones(3))
    if pairs >= 3:
        assert spread == pytest.approx(np.eye(3), abs=1e-9)


def test_a_mixtures_covariance_is_that_of_its_density() -> None:
    weights, values, stds = np.array([0.3, 0.7]), np.array([[1.0], [-2.0]]), np.array([0.5, 2.0])
    about = np.array([0.4])

    def density(x: float) -> float:
        of_part = np.exp(-0.5 * ((x - values[:, 0]) / stds) ** 2) / (stds * np.sqrt(2 * np.pi))
        return float(weights @ of_part)

    square, _ = quad(lambda x: (x - about[0]) ** 2 * density(x), -30.0, 30.0)
    covariances = (stds**2)[:, None, None]
    assert mixture_covariance(weights, values, covariances, about)[0, 0] == pytest.approx(square, rel=1e-6)
