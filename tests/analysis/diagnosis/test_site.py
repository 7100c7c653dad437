"""What a building does in flight as well is said to be perhaps the site's own."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from analysis.diagnosis.floor import Floor
from analysis.diagnosis.site import in_building, may_be_site

TIME_S = np.arange(1200) * 5e-5
TOUCH_S, CONTACT_S = 0.012, 0.028
SWAY_M = 1e-7 * np.sin(2 * np.pi * 67.0 * TIME_S + 0.3)


def fit(left_m: np.ndarray, wander_m: float = 1e-7) -> Any:
    """Return as much of a fit as is looked at: one shot of the usual length."""
    course = SimpleNamespace(touch_time_s=TOUCH_S, contact_time_s=CONTACT_S)
    shot = SimpleNamespace(centre_s=TIME_S, valid=np.ones(TIME_S.size, dtype=np.bool_), course=course)
    data = SimpleNamespace(shots=[shot])
    floor = Floor(2e-11, (wander_m, 0.0), (0.1, 0.1), 5e-5)
    return cast(Any, SimpleNamespace(hypothesis=SimpleNamespace(data=data), floor=floor, residual_m=[left_m]))


@pytest.mark.parametrize(("wander_m", "building"), [(3e-10, False), (1.2e-8, True)])
def test_a_floor_far_above_the_beats_noise_is_a_buildings(wander_m: float, building: bool) -> None:
    assert in_building(fit(SWAY_M, wander_m)) is building


@pytest.mark.parametrize(("times", "site"), [(1.0, True), (6.0, False)])
def test_what_is_as_large_in_flight_may_be_the_site(times: float, site: bool) -> None:
    contact = (TIME_S >= TOUCH_S) & (TIME_S < TOUCH_S + CONTACT_S)
    assert may_be_site(fit(np.where(contact, times * SWAY_M, SWAY_M))) is site
    assert not may_be_site(fit(np.where(contact, times * SWAY_M, SWAY_M), 3e-10))  # a quiet bench has no site
