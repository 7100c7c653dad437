"""What small effects do along a trajectory serves every fit that goes nearly the same way, and no other."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.inference.fit.added_effect import refit
from analysis.inference.fit.hypothesis_fit import Fitted
from analysis.inference.screen.projector import Projector, projector
from analysis.inference.screen.screening import scores
from tests.analysis.diagnosis.shots import KINDS, base_fit, calm, shots

ASKED = ("block_mode", "coulomb_friction", "contact_exponent", "sensor_drift", "plate_motion")


@pytest.fixture(scope="module")
def before_and_beside() -> tuple[Projector, Fitted]:
    """Return the projector of a base fit on which effects were scored, and the fit with the drag it lacks."""
    at = projector(base_fit(shots({"viscous_drag": {"coefficient_n_s_per_m": 2e-6}})))
    for name in ASKED:
        scores(at, KINDS[name])
    beside = refit(at, KINDS["viscous_drag"], scores(at, KINDS["viscous_drag"])[0].start, calm)
    assert beside is not None and beside.bic < at.fitted.bic - 100
    return at, beside


def test_near_by_the_scores_are_those_of_columns_made_anew(before_and_beside: tuple[Projector, Fitted]) -> None:
    at, beside = before_and_beside
    near, anew = projector(beside, near=at), projector(beside)
    assert near.trajectories is at.trajectories and anew.trajectories is not at.trajectories
    for name in ASKED:
        shared, own = scores(near, KINDS[name])[0], scores(anew, KINDS[name])[0]
        assert shared.gain == pytest.approx(own.gain, rel=0.02, abs=0.05), name
        assert shared.power == pytest.approx(own.power, rel=0.02), name


def test_what_lies_elsewhere_is_asked_anew(before_and_beside: tuple[Projector, Fitted]) -> None:
    at, beside = before_and_beside
    moved = replace(beside, residual_m=tuple(left + 1e-6 for left in beside.residual_m))
    assert not at.trajectories.serve(moved)
    z = at.fitted.z.copy()
    z[0] += np.log(1.02)  # of the plate's stiffness
    assert not at.trajectories.serve(replace(at.fitted, z=z))
    other = base_fit(shots({}, seed=4))
    assert not at.trajectories.serve(other)
