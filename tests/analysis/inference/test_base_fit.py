"""A search begins where it can lead somewhere."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from analysis.collision import Infeasible
from analysis.collision.effects import effect_named
from analysis.diagnosis.catalogue_search import search_from_base
from analysis.diagnosis.findings.criteria import CRITERIA
from analysis.diagnosis.search.forward_selection import Trail
from analysis.inference.fit import first_fit as module
from analysis.inference.fit.first_fit import base_fit, first_fit
from analysis.inference.joint.joint_data import JointData
from analysis.inference.model.base import SearchStart, base_named
from analysis.inference.model.samples import averaged_shots
from analysis.inference.noise.floor import white_floor
from analysis.inference.noise.site import STILL_FRAME
from tests.analysis.diagnosis.shots import KINDS, calm, shots


@pytest.mark.slow
def test_an_effect_that_draws_the_base_to_a_wall_is_found_from_where_the_collision_was_read() -> None:
    size = 2.9e5  # the contact that is read is drawn to a wall as well
    motions = shots({"cubic_stiffness": {"coefficient_n_per_m3": size}})
    given = first_fit(averaged_shots(motions), "paper", STILL_FRAME, calm)
    before = base_fit(JointData(averaged_shots(motions), base_named("paper")), given, calm)
    assert given.left > CRITERIA.drawn_far and not before.converged
    assert before.point.base[2] > 10 * 1e4  # the contact is not a tenth as stiff
    best, trail = search_from_base(Trail(before, [KINDS["cubic_stiffness"], KINDS["tilt"]], calm), given)
    assert trail.start is before and best.effects == (effect_named("cubic_stiffness"),)
    assert abs(best.point.values[0][effect_named("cubic_stiffness")]["coefficient_n_per_m3"] / size - 1) < 1e-3


@pytest.mark.parametrize(
    ("ends", "yielded", "tried"),
    [
        ([(0, 5.0), (1, 0.06), (2, 7.0)], [1, 0, 2], 3),  # the right valley first, those that went astray last
        ([(0, 5.0), (0, 5.0), (1, 0.06)], [0, 0], 2),  # two went to one place: no false valley, something is missing
        ([(0, 5.0), (None, 0.0), (1, 3.0)], [1, 0], 3),  # no motion from the second
    ],
)
def test_a_search_goes_on_first_from_where_a_rough_one_did_not_go_astray(
    monkeypatch: pytest.MonkeyPatch, ends: list[tuple[int | None, float]], yielded: list[int], tried: int
) -> None:
    starts = [SearchStart(base_named("paper"), np.ones(4), np.zeros((1, 3))) for _ in ends]
    asked: list[float] = []

    def search(_data: Any, start: SearchStart, noise: Any, _stop: Any, _evaluations: int) -> SearchStart:
        asked.append(noise.white_m)
        place, left = ends[next(k for k, one in enumerate(starts) if one is start)]
        if place is None:
            raise Infeasible("no motion")
        return replace(start, shared=np.full(4, 1.0 + place), left=left)

    monkeypatch.setattr(module, "_search_on_frame", search)
    nothing: Any = None
    found = list(module._noisy_search_ends(nothing, iter(starts), white_floor(1e-10, 1e-5), calm))
    assert [end.shared[0] - 1.0 for end in found] == yielded
    assert asked == [pytest.approx(1e-8)] * tried  # with the white noise enlarged
