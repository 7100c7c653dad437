"""A diagnosis' own fit beside the fit of the same model to the same shots."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.collision.effects import effect_named
from analysis.diagnosis.catalogue_search import accept
from analysis.diagnosis.findings.model_file import from_text, saved, to_text
from analysis.inference.fit.as_fit import _has_transient_excess, _sway_left_std_m, as_fit, effect_parameters
from analysis.inference.fit.shot_fit import fit_shots
from analysis.pipeline import analyse
from analysis.shot.fit import Fit
from analysis.shot.quantity import Quantity
from instrument.bench.rig import Bench
from instrument.bench.simulated_shots import record_shot
from tests.analysis.diagnosis.shots import KINDS, base_fit, calm, shots


def test_the_velocity_out_is_that_after_the_last_release_with_its_own_uncertainty() -> None:
    name = "coulomb_friction"
    motions = shots({name: {"force_n": 2e-5}}, count=2)
    ours = as_fit(accept(base_fit(motions), list(KINDS.values()), (effect_named(name),), calm), motions, "paper", 0.0)
    other = fit_shots(motions, effects=(name,))
    for mine, theirs in zip(ours.shots, other.shots, strict=True):
        out, reference = mine.velocity_out_m_per_s, theirs.velocity_out_m_per_s
        assert out.value == pytest.approx(reference.value, abs=reference.std)
        assert out.std == pytest.approx(reference.std, rel=0.4)
        # The velocities in and out hang together through restitution, but are not equally well known.
        assert out.std != pytest.approx(mine.velocity_in_m_per_s.std, rel=1e-3)


def test_a_shot_that_its_model_does_not_describe_is_as_unsure_as_what_is_left_says() -> None:
    """Birge's ratio, from a recording through the whole analysis: 380 times the noise's chi^2, 19.5 times its std."""

    def fit_of(n_per_m3: float) -> Fit:
        bench = Bench(effects={"cubic_stiffness": {"coefficient_n_per_m3": n_per_m3}} if n_per_m3 else {}, seed=5)
        fit = analyse(record_shot(bench, 0, 0.265, 10e6, 0.06)[0]).fit
        assert fit is not None
        return fit

    described, lacking = fit_of(0.0), fit_of(3e4)
    assert described.reduced_chi2 < 1.2 and lacking.reduced_chi2 > 100.0
    for name, parameter in lacking.parameters.items():
        grown = parameter.std / described.parameters[name].std
        assert grown == pytest.approx(np.sqrt(lacking.reduced_chi2), rel=0.05), name


def test_a_remainder_below_the_noise_makes_nothing_surer_and_one_above_it_does_the_reverse() -> None:
    motions = shots({}, count=2)
    fitted = base_fit(motions)
    freedom = fitted.samples - fitted.problem.size

    def stds(chi2: float) -> np.ndarray:
        return np.array([q.std for q in as_fit(fitted, motions, "paper", 0.0, chi2=chi2).parameters.values()])

    assert stds(0.25 * freedom) == pytest.approx(stds(0.0), rel=1e-12)
    assert stds(4.0 * freedom) == pytest.approx(2.0 * stds(0.0), rel=1e-9)


def test_the_noise_of_a_sample_is_that_of_the_motion_and_not_of_the_means_that_were_fitted() -> None:
    motions = shots({}, count=2)
    fitted = base_fit(motions)
    white = replace(fitted.noise, white_m=1e-10, rms_m=(3e-10, 0.0))
    factor = fitted.problem.data.shots[0].factor
    assert factor > 1
    fit = as_fit(replace(fitted, problem=fitted.problem.with_noise(white)), motions, "paper", 0.0)
    assert fit.noise_std_m == pytest.approx(np.sqrt(factor * 1e-20 + 9e-20), rel=1e-12)


def test_an_effects_own_parameters_carry_the_number_of_their_shot_from_the_second_on() -> None:
    effect = effect_named("plate_motion")  # how the plate still swings from the shot before
    fitted = accept(base_fit(shots({})), list(KINDS.values()), (effect,), calm)
    found = effect_parameters(fitted)[effect]
    speeds = [values[effect]["velocity_m_per_s"] for values in fitted.point.values]
    assert [found[f"velocity_m_per_s{number}"].value for number in ("", ".2", ".3")] == speeds
    assert len(set(speeds)) == 3 and len(found) == 6  # with as many displacements


def test_a_fit_with_a_chosen_parameter_is_saved_and_read_again() -> None:
    """The order of a cyclic error is chosen, not fitted: it stands in the covariance like everything else."""
    ripple = {"amplitude_m": 3e-9, "order": 2.0}
    fit = fit_shots(shots({"cyclic_error": ripple}, count=1), effects=("cyclic_error",))
    assert fit.converged
    assert fit.parameters["cyclic_error.order"] == Quantity(2.0, 0.0, "chosen")
    assert list(fit.parameters)[-1] == "cyclic_error.order"
    again = from_text(to_text(saved(fit, ["a"])))
    assert list(again.parameters) == list(fit.parameters)
    assert np.array_equal(again.covariance, fit.covariance)
    assert fit.covariance.shape == (6, 6) and np.all(np.diag(fit.covariance)[:5] > 0.0)
    assert not fit.covariance[5].any() and not fit.covariance[:, 5].any()


@pytest.mark.parametrize(
    ("louder", "share", "rings"),
    [(1.0, 0.0, False), (3.0, 0.05, True), (3.0, 0.35, True), (3.0, 0.45, False), (1.1, 0.05, False)],
)
def test_a_residual_rings_that_is_loud_for_a_moment_and_not_throughout(
    louder: float, share: float, rings: bool
) -> None:
    whitened = np.random.default_rng(1).standard_normal(15_000)
    whitened[: round(share * whitened.size)] *= louder
    assert _has_transient_excess(whitened) is rings
    assert not _has_transient_excess(whitened[:200])  # too short to tell


@pytest.mark.parametrize("rows", [60, 512])
def test_what_a_fit_leaves_of_a_frames_motion_is_what_generalised_least_squares_does(rows: int) -> None:
    """Of the whole covariance C - J (J^T C^-1 J)^-1 J^T without its white part, between samples that are known."""
    valid = np.ones(rows + 20, dtype=bool)
    valid[:20] = False
    times = np.arange(rows + 20) * 1e-3
    turn = 2 * np.pi * np.outer(times[valid], [3.0, 8.0])
    basis, factors, band = np.hstack([np.cos(turn), np.sin(turn)]), np.diag([3e-9, 2e-9, 3e-9, 2e-9]), [0, 1, 0, 1]
    derivatives = np.zeros((rows + 20, 3))
    derivatives[valid, :2] = np.stack([np.ones(rows), times[valid]], axis=1) * [1e3, 1.0]
    sway = SimpleNamespace(basis=basis, factors=factors, band=np.array(band))
    shot: Any = SimpleNamespace(sway=sway, valid=valid, weight=2.0, time_s=times + 5e-4, centre_s=times)
    strengths = (np.log(4.0), np.log(0.25))
    noise: Any = SimpleNamespace(white_m=5e-10, site=strengths)
    found = _sway_left_std_m(shot, noise, derivatives)
    sines = basis @ factors * np.array([2.0, 0.5, 2.0, 0.5])
    moved = sines @ sines.T
    inverse = np.linalg.inv(moved + 1e-18 * np.eye(rows))
    some = derivatives[valid, :2]
    taken = some @ np.linalg.inv(some.T @ inverse @ some) @ some.T
    left = np.sqrt(np.maximum(np.diag(moved - taken), 0.0))
    expected = np.interp(shot.time_s, times[valid], left)
    if rows == 60:  # every sample is a point
        np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-13)
    else:  # each of 128 stands for four
        np.testing.assert_allclose(found, expected, atol=0.03 * expected.max())
