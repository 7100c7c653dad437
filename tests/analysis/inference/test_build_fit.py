"""The builder of a fit: what is chosen, not fitted, stands in the covariance like everything else."""

import numpy as np

from analysis.collision.effects import named
from analysis.diagnosis.model_file import from_text, saved, to_text
from analysis.inference.fit.build_fit import Estimate, build_fit


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
