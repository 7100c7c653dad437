"""The response to a frame's motion follows the motion that a fit gives, with the effects that act on it."""

from types import SimpleNamespace as Some
from typing import Any

import numpy as np
import pytest

from analysis.collision import Infeasible
from analysis.inference.fit import relinearised_frame
from analysis.inference.fit.relinearised_frame import with_frame_relinearised
from analysis.inference.noise.site import STILL_FRAME
from tests.analysis.diagnosis.shots import calm

WHITE_M, STD = 1e-10, (2e-7, 3e-4)
MOVING = Some(moves=True)


class _Data:
    def __init__(self, shots: Any, site: Any = MOVING) -> None:
        self.shots, self.site, self.base = shots, site, None


def _sway(off: float, plate: tuple[float, float] = (0.0, 0.0)) -> Any:
    return Some(
        largest_difference_m=lambda _other, _noise: off * WHITE_M,
        likeliest_plate=lambda _left, _noise: plate,
        plate_std=STD,
    )


def _fit(shots: Any, site: Any = MOVING) -> Any:
    point, noise = Some(values="with the effect"), Some(white_m=WHITE_M, site=(0.0,))
    problem = Some(data=_Data(shots, site), noise=noise, residual_m=lambda _z: [None] * len(shots))
    return Some(problem=problem, point=point, noise=noise, z=None, bic=0.0)


def _replaced(one: Any, **changes: Any) -> Any:
    if isinstance(one, _Data):
        return _Data(changes["shots"], one.site)
    return Some(data=changes["data"], fit=lambda _z, *, cancelled: _fit(changes["data"].shots))


def _with_plates(shots: Any, plates: Any) -> Any:
    if not plates:
        return shots
    return [Some(**{**vars(shot), "plate": plate}) for shot, plate in zip(shots, plates, strict=True)]


@pytest.mark.parametrize(
    ("off", "moved", "anew"), [(0.021, 0.0, True), (0.019, 0.0, False), (0.0, 0.61, True), (0.0, 0.59, False)]
)
@pytest.mark.parametrize("place", [0, 1])
def test_it_is_computed_anew_where_it_is_wrong_or_a_plate_is_elsewhere(
    monkeypatch: pytest.MonkeyPatch, off: float, moved: float, anew: bool, place: int
) -> None:
    """Wrong by a fiftieth of the white noise; the plate by 0.6 of its std, in displacement or velocity."""
    plate = np.zeros(2)
    plate[place] = -moved * STD[place]
    computed = []

    def on_site(shots: Any, _site: Any, _base: Any, at: Any, plates: Any) -> Any:
        computed.append(at.values)
        shots = _with_plates(shots, plates)
        return tuple(Some(sway=_sway(0.0, shot.plate), plate=shot.plate) for shot in shots)

    monkeypatch.setattr(relinearised_frame, "on_site", on_site)
    monkeypatch.setattr(relinearised_frame, "replace", _replaced)
    calmer = Some(sway=_sway(0.0), plate=(0.0, 0.0))
    before = _fit((calmer, Some(sway=_sway(off, (float(plate[0]), float(plate[1]))), plate=(0.0, 0.0))))
    found = with_frame_relinearised(before, calm)
    assert (found is not before) is anew
    assert set(computed) == {"with the effect"}
    if anew and moved:
        assert found.problem.data.shots[1].plate == tuple(plate)


@pytest.mark.parametrize(
    ("bics", "turns", "taken"),
    [
        ((-10.0, -5.0, -6.0, -7.0, -6.9), 5, 4),
        ((-10.0, -5.0, -4.9, -9.0), 3, 2),
        (tuple(-1.0 - k for k in range(9)), 8, 8),
        ((-10.0, -10.9, -20.0), 2, 2),
        ((-10.0, -9.1, -20.0), 2, 2),
        ((0.9, -20.0), 1, 1),
    ],
)
def test_plates_are_followed_as_long_as_that_makes_the_shots_likelier(
    monkeypatch: pytest.MonkeyPatch, bics: tuple[float, ...], turns: int, taken: int
) -> None:
    """Of an effect that is still missing plates run away; two turns are made anyway, eight at most.

    What changes the criterion by less than one is the last.
    """
    fitted: list[Any] = []

    def refitted(one: Any, **changes: Any) -> Any:
        if isinstance(one, _Data):
            return _Data(changes["shots"], one.site)

        def fit(_z: Any, *, cancelled: Any) -> Any:
            fitted.append(_fit(changes["data"].shots))
            fitted[-1].bic = bics[len(fitted) - 1]
            return fitted[-1]

        return Some(data=changes["data"], fit=fit)

    def on_site(shots: Any, _site: Any, _base: Any, _at: Any, plates: Any) -> Any:
        shots = _with_plates(shots, plates)
        return tuple(Some(sway=_sway(0.0, (shot.plate[0] + STD[0], 0.0)), plate=shot.plate) for shot in shots)

    monkeypatch.setattr(relinearised_frame, "on_site", on_site)
    monkeypatch.setattr(relinearised_frame, "replace", refitted)
    found = with_frame_relinearised(_fit((Some(sway=_sway(0.0, (STD[0], 0.0)), plate=(0.0, 0.0)),)), calm)
    assert len(fitted) == turns and found is fitted[taken - 1]


def test_a_response_that_cannot_be_computed_leaves_the_fit_as_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    def too_fast(*_: Any) -> Any:
        raise Infeasible("too many steps")

    monkeypatch.setattr(relinearised_frame, "on_site", too_fast)
    before = _fit((Some(sway=_sway(1.0), plate=(0.0, 0.0)),))
    assert with_frame_relinearised(before, calm) is before


def test_a_fit_at_rest_stays_as_it_is() -> None:
    before = _fit((Some(sway=None),), site=STILL_FRAME)
    assert with_frame_relinearised(before, calm) is before


def test_plates_are_read_anew_and_the_farthest_move_is_told_in_standard_deviations() -> None:
    def shot(likely: tuple[float, float], taken: tuple[float, float]) -> Any:
        def read(left: float, noise: Any) -> tuple[float, float]:
            return likely[0], likely[1] + left * noise.white_m

        sway = Some(plate_std=(2.0, 10.0), likeliest_plate=read)
        return Some(sway=sway, plate=taken)

    shots = [shot((1.0, 3.0), (2.0, 5.0)), shot((7.0, 1.0), (6.0, -20.0)), shot((0.0, 0.0), (0.0, 0.0))]

    def fit(shots: Any, left: list[float]) -> Any:
        noise = Some(white_m=0.5, site=(0.0,))
        return Some(problem=Some(data=Some(shots=shots), noise=noise, residual_m=lambda z: z * left), z=1)

    plates, moved = relinearised_frame._plates(fit(shots, [4.0, 2.0, 0.0]))
    assert plates == ((1.0, 5.0), (7.0, 2.0), (0.0, 0.0)) and moved == 2.2
    still = [shot((1.0, 3.0), (1.1, 3.0))]
    assert relinearised_frame._plates(fit(still, [0.0]))[1] == pytest.approx(0.05)
