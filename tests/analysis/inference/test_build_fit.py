"""The builder of a fit: what is chosen, not fitted, stands in the covariance like everything else."""

import numpy as np
import pytest

from analysis.collision.effects import named
from analysis.diagnosis.model_file import from_text, saved, to_text
from analysis.inference.fit.build_fit import Estimate, _has_loud_moment, build_fit


def test_a_fit_with_a_chosen_parameter_is_saved_and_read_again() -> None:
    estimate = Estimate(
        model="paper",
        effects=(named("cyclic_error"),),
        values=np.array([221.4, 1e-9]),
        covariance=np.array([[4.0, 1e-11], [1e-11, 1e-20]]),
        shared={"plate_stiffness_n_per_m": 0, "cyclic_error.amplitude_m": 1},
        free=2,
        converged=True,
        how="fit",
        chosen={"cyclic_error.order": 2.0},
    )
    fit = build_fit(estimate, (), 1e-10, (), 0.0)
    assert fit.converged and fit.parameters["cyclic_error.order"].std == 0.0
    again = from_text(to_text(saved(fit, ["a"])))
    assert list(again.parameters) == list(fit.parameters)
    assert np.array_equal(again.covariance, fit.covariance)
    assert np.array_equal(fit.covariance[:2, :2], estimate.covariance)
    assert not fit.covariance[2].any() and not fit.covariance[:, 2].any()


@pytest.mark.parametrize(
    ("louder", "share", "rings"),
    [(1.0, 0.0, False), (3.0, 0.05, True), (3.0, 0.35, True), (3.0, 0.45, False), (1.1, 0.05, False)],
)
def test_a_residual_rings_that_is_loud_for_a_moment_and_not_throughout(
    louder: float, share: float, rings: bool
) -> None:
    whitened = np.random.default_rng(1).standard_normal(15_000)
    whitened[: round(share * whitened.size)] *= louder
    assert _has_loud_moment(whitened) is rings
    assert not _has_loud_moment(whitened[:200])  # too short to tell
