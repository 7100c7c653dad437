"""The response to a frame's motion follows the motion that a fit gives, with the effects that act on it."""

from types import SimpleNamespace as Some
from typing import Any

import numpy as np
import pytest

from analysis.collision import Infeasible
from analysis.inference.fit import relinearised_frame
from analysis.inference.fit.relinearised_frame import (
    frame_hides_effects,
    frame_moves_far,
    with_frame_relinearised,
)
from analysis.inference.noise.site import STILL_FRAME
from tests.analysis.diagnosis.shots import calm

WHITE_M, STD = 1e-10, (2e-7, 3e-4)
MOVING = Some(moves=True)


class Stage:
    """Fits of one parameter and one plate, whose response is wrong by ``offs`` and whose criteria are ``bics``.

    Each fit finds its parameter and plate at ``found``, by the place of its linearisation, in standard deviations;
    the plate moves by its displacement (0) or its velocity (1).
    """

    def __init__(self, patch: pytest.MonkeyPatch, offs: Any, bics: Any, found: Any, *, by: int = 0) -> None:
        self.offs, self.bics, self.found, self.by = iter(offs), iter(bics), found, by
        self.linearised: list[tuple[float, float]] = []
        patch.setattr(relinearised_frame, "on_site", self.on_site)
        patch.setattr(relinearised_frame, "replace", self.replaced)
        patch.setattr(relinearised_frame, "likeliest_plates", lambda problem, z: problem.plates)
        patch.setattr(relinearised_frame, "half_way", lambda one, other: self.mean(one, other))

    def mean(self, one: Any, other: Any) -> Any:
        (x, (p,)), (y, (q,)) = one, other
        return 0.5 * (x + y), (tuple(0.5 * np.add(p, q)),)

    def on_site(self, shots: Any, _site: Any, _base: Any, at: float, plates: Any) -> Any:
        self.linearised.append((at, plates[0][self.by] / STD[self.by]))
        return (Some(sway=self.sway(), plate=plates[0]),)

    def sway(self) -> Any:
        return Some(largest_difference_m=lambda _other, _noise: next(self.offs) * WHITE_M, plate_std=STD)

    def replaced(self, one: Any, **changes: Any) -> Any:
        if "shots" in changes:
            return Some(shots=changes["shots"], site=MOVING, base=None)
        shots = changes["data"].shots
        return Some(fit=lambda _z, *, cancelled: self.fit(shots, next(self.bics), self.linearised[-1]))

    def fit(self, shots: Any, bic: float, at: tuple[float, float] = (0.0, 0.0)) -> Any:
        z, plate = self.found(*at)
        problem = Some(
            data=Some(shots=shots, site=MOVING, base=None),
            plates=(tuple(plate * std * (place == self.by) for place, std in enumerate(STD)),),
            pack=lambda at: np.array([at]),
        )
        return Some(problem=problem, point=z, z=np.array([z]), inverse=np.eye(1), noise=Some(white_m=WHITE_M), bic=bic)

    def relinearised(self) -> tuple[Any, bool]:
        return relinearised_frame._repeated(self.fit((Some(sway=self.sway(), plate=(0.0, 0.0)),), 0.0), calm)


@pytest.mark.parametrize(("off", "anew"), [(0.021, True), (0.019, False)])
def test_it_is_computed_anew_where_it_is_wrong_by_a_fiftieth_of_the_noise(
    monkeypatch: pytest.MonkeyPatch, off: float, anew: bool
) -> None:
    stage = Stage(monkeypatch, [off, 0.0], [-10.0], lambda z, plate: (1.0, 2.0))
    found, agree = stage.relinearised()
    assert agree and found.bic == (-10.0 if anew else 0.0)
    assert stage.linearised == [(1.0, 2.0)] * (2 if anew else 1)


@pytest.mark.parametrize(
    ("bics", "off", "turns", "taken", "agree"),
    [
        ((-10.0, -20.0, -19.0), 1.0, 3, -20.0, False),  # the plates run away from what is still missing
        ((-10.0, -9.1), 1.0, 2, -9.1, True),
        ((-10.0, -20.0, -19.1), 1.0, 3, -19.1, True),
        ((-10.0, -10.9), 29.0, 2, -10.9, True),
        (tuple(-0.9 * k for k in range(1, 13)), 31.0, 12, -0.9 * 12, False),  # little changed, by chance
        (tuple(-2.0 * k for k in range(1, 13)), 1.0, 12, -24.0, False),
    ],
)
def test_fit_and_response_are_repeated_until_they_agree(
    monkeypatch: pytest.MonkeyPatch, bics: tuple[float, ...], off: float, turns: int, taken: float, agree: bool
) -> None:
    stage = Stage(monkeypatch, [off] * 20, bics, lambda z, plate: (z + 1.0, plate + 1.0))
    found, agreed = stage.relinearised()
    assert (found.bic, agreed) == (taken, agree) and len(stage.linearised) == turns


@pytest.mark.parametrize("by", [0, 1])
def test_steps_of_plates_that_go_back_and_forth_are_halved(monkeypatch: pytest.MonkeyPatch, by: int) -> None:
    """A fit that overshoots as far as it was off never ends with whole steps, and at once with a half one."""
    stage = Stage(monkeypatch, [1.0, 1.0, 0.0], [-10.0, -20.0], lambda z, plate: (0.0, 2.0 - plate), by=by)
    found, agree = stage.relinearised()
    assert agree and found.bic == -20.0 and [plate for _, plate in stage.linearised] == [2.0, 1.0, 1.0]


def test_steps_of_parameters_that_go_back_and_forth_are_halved_and_may_cost(monkeypatch: pytest.MonkeyPatch) -> None:
    stage = Stage(monkeypatch, [1.0, 1.0, 1.0, 0.0], [-10.0, -20.0, -15.0], lambda z, plate: (2.0 - z, 0.0))
    found, agree = stage.relinearised()
    assert agree and found.bic == -15.0 and [z for z, _ in stage.linearised] == [2.0, 0.0, 1.0, 1.0]


def test_a_response_that_cannot_be_computed_leaves_the_fit_as_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    def too_fast(*_: Any) -> Any:
        raise Infeasible("too many steps")

    stage = Stage(monkeypatch, [1.0], [], lambda z, plate: (1.0, 1.0))
    monkeypatch.setattr(relinearised_frame, "on_site", too_fast)
    found, agree = stage.relinearised()
    assert found.bic == 0.0 and not agree


def test_a_fit_at_rest_stays_as_it_is() -> None:
    before: Any = Some(problem=Some(data=Some(site=STILL_FRAME)))
    assert with_frame_relinearised(before, calm) is before


@pytest.mark.parametrize(("far", "agree"), [(True, False), (True, True), (False, False)])
def test_a_frame_hides_effects_where_it_moves_far_and_fit_and_response_do_not_agree(
    monkeypatch: pytest.MonkeyPatch, far: bool, agree: bool
) -> None:
    fitted: Any = Some(problem="problem")
    monkeypatch.setattr(relinearised_frame, "frame_moves_far", lambda one: far and one == "problem")
    monkeypatch.setattr(relinearised_frame, "_repeated", lambda one, stop: (one, agree and stop is calm))
    assert frame_hides_effects(fitted, calm) is (far and not agree)


@pytest.mark.parametrize(("variance_m2", "far"), [(1.01e-11, True), (0.99e-11, False)])
def test_a_frame_moves_far_by_what_its_square_adds_in_contact(variance_m2: float, far: bool) -> None:
    """A hundredfold white noise of 0.1 nm, times a deflection of 1 mm."""
    time_s = np.array([0.0, 1.0, 2.0, 3.0, 4.0])
    shot: Any = Some(
        centre_s=time_s, valid=np.ones(5, np.bool_), displacement_m=np.array([9.0, 1e-3, 0.5e-3, 0.0, 9.0]),
        course=Some(touch_time_s=0.5, release_time_s=3.5),
        sway=Some(variances_read_m2=lambda: np.array([9.0, *[variance_m2] * 3, 9.0])),
    )  # fmt: skip
    lost: Any = Some(**{**vars(shot), "course": Some(touch_time_s=5.0, release_time_s=6.0)})
    still: Any = Some(sway=None)

    def problem(*shots: Any, site: tuple[float, ...] = (-2.0, 3.9)) -> Any:
        return Some(data=Some(shots=shots), noise=Some(white_m=WHITE_M, site=site))

    assert frame_moves_far(problem(still, shot)) is far
    assert not frame_moves_far(problem(still, lost)) and not frame_moves_far(problem(still, site=()))
    assert not frame_moves_far(problem(still, shot, site=(-2.0, 4.1)))  # a force that bends the flights, no frame
