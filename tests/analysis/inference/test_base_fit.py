"""A search begins where it can lead somewhere."""

import pytest

from analysis.collision.effects import named
from analysis.diagnosis.search.from_base import explored
from analysis.diagnosis.verdict.criteria import CRITERIA
from analysis.inference.fit.base import base_named
from analysis.inference.fit.first_fit import base_fit, first_fit
from analysis.inference.fit.joint_data import JointData
from analysis.inference.fit.samples import averaged_shots
from tests.analysis.diagnosis.shots import KINDS, calm, shots


@pytest.mark.slow
def test_an_effect_that_draws_the_base_to_a_wall_is_found_from_where_the_collision_was_read() -> None:
    size = 2.9e5  # the contact that is read is drawn to a wall as well
    motions = shots({"cubic_stiffness": {"coefficient_n_per_m3": size}})
    given = first_fit(motions, "paper", None, calm)
    before = base_fit(JointData(averaged_shots(motions), base_named("paper")), given, calm)
    assert given.left > CRITERIA.drawn_far and not before.converged
    assert before.point.base[2] > 10 * 1e4  # the contact is not a tenth as stiff
    best, trail = explored(before, given, [KINDS["cubic_stiffness"], KINDS["tilt"]], calm)
    assert trail.start is before and best.effects == (named("cubic_stiffness"),)
    assert abs(best.point.values[0][named("cubic_stiffness")]["coefficient_n_per_m3"] / size - 1) < 1e-3
