"""What small effects do along a trajectory serves every fit that goes nearly the same way, and no other."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.inference.fit.added_effect import refit
from analysis.inference.fit.problem import Fitted, Linearised
from tests.analysis.diagnosis.shots import KINDS, base_fit, calm, shots

ASKED = ("block_mode", "coulomb_friction", "contact_exponent", "sensor_drift", "plate_motion")


@pytest.fixture(scope="module")
def before_and_beside() -> tuple[Fitted, Linearised, Fitted]:
    """Return a base fit, the same linearised and with effects scored on it, and the fit with the drag it lacks."""
    before = base_fit(shots({"viscous_drag": {"coefficient_n_s_per_m": 2e-6}}))
    at = before.linearise()
    for name in ASKED:
        at.scores(KINDS[name])
    beside = refit(at, KINDS["viscous_drag"], at.scores(KINDS["viscous_drag"])[0].start, calm)
    assert beside is not None and beside.bic < before.bic - 100
    return before, at, beside


def test_near_by_the_scores_are_those_of_columns_made_anew(
    before_and_beside: tuple[Fitted, Linearised, Fitted],
) -> None:
    _, at, beside = before_and_beside
    near, anew = beside.linearise(near=at), beside.linearise()
    assert near.trajectories is at.trajectories and anew.trajectories is not at.trajectories
    for name in ASKED:
        shared, own = near.scores(KINDS[name])[0], anew.scores(KINDS[name])[0]
        assert shared.gain == pytest.approx(own.gain, rel=0.02, abs=0.05), name
        assert shared.power == pytest.approx(own.power, rel=0.02), name


def test_what_lies_elsewhere_is_asked_anew(before_and_beside: tuple[Fitted, Linearised, Fitted]) -> None:
    _, at, beside = before_and_beside
    lines = beside.problem.derivatives(beside.z)
    assert at.trajectories.serve(beside.problem, beside.z, lines)
    assert not at.trajectories.serve(beside.problem, beside.z, [(x + 1e-6, slope) for x, slope in lines])
    z = at.z.copy()
    z[0] += np.log(1.02)  # of the plate's stiffness
    assert not at.trajectories.serve(at.problem, z, at.lines)
    other = base_fit(shots({}, seed=4))
    assert not at.trajectories.serve(other.problem, other.z, other.problem.derivatives(other.z))


def test_a_drag_that_drives_explains_nothing_and_one_that_brakes_what_a_fit_gains(
    before_and_beside: tuple[Fitted, Linearised, Fitted],
) -> None:
    before, at, beside = before_and_beside
    drag = KINDS["viscous_drag"]
    (brakes,) = at.scores(drag)
    assert brakes.gain == pytest.approx(before.chi2(at.noise) - beside.chi2(at.noise), rel=0.05)
    assert brakes.start[0]["coefficient_n_s_per_m"] == pytest.approx(2e-6, rel=0.2)
    (drives,) = replace(at, left=-at.left, whole=-at.whole, done={}).scores(drag)
    assert drives.gain == 0.0 and drives.start[0]["coefficient_n_s_per_m"] == 0.0


@pytest.mark.parametrize(
    ("name", "shared", "of_each_shot"),
    [("viscous_drag", 1, 0), ("block_mode", 3, 0), ("plate_motion", 0, 2), ("frame_vibration", 2, 1)],
)
def test_an_effect_pays_for_what_all_shots_share_and_for_each_shots_own(
    before_and_beside: tuple[Fitted, Linearised, Fitted], name: str, shared: int, of_each_shot: int
) -> None:
    _, at, _ = before_and_beside
    count = len(at.problem.data.shots)
    assert count > 1
    assert {score.freedom for score in at.scores(KINDS[name])} == {shared + of_each_shot * count}
