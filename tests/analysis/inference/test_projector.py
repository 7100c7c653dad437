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


def test_a_drag_that_drives_explains_nothing_and_one_that_brakes_what_a_fit_gains(
    before_and_beside: tuple[Projector, Fitted],
) -> None:
    at, beside = before_and_beside
    drag = KINDS["viscous_drag"]
    (brakes,) = scores(at, drag)
    assert brakes.gain == pytest.approx(at.fitted.chi2(at.floor) - beside.chi2(at.floor), rel=0.05)
    assert brakes.start[0]["coefficient_n_s_per_m"] == pytest.approx(2e-6, rel=0.2)
    (drives,) = scores(replace(at, left=-at.left, whole=-at.whole, done={}), drag)
    assert drives.gain == 0.0 and drives.start[0]["coefficient_n_s_per_m"] == 0.0


@pytest.mark.parametrize(
    ("name", "shared", "of_each_shot"),
    [("viscous_drag", 1, 0), ("block_mode", 3, 0), ("plate_motion", 0, 2), ("frame_vibration", 2, 1)],
)
def test_an_effect_pays_for_what_all_shots_share_and_for_each_shots_own(
    before_and_beside: tuple[Projector, Fitted], name: str, shared: int, of_each_shot: int
) -> None:
    at, _ = before_and_beside
    count = len(at.fitted.hypothesis.data.shots)
    assert count > 1
    assert {score.freedom for score in scores(at, KINDS[name])} == {shared + of_each_shot * count}
