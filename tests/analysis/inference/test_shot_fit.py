"""The turns of a fit on a moving frame, and the joint data of shots."""

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from analysis.collision.effects import effect_named, effects_named
from analysis.collision.parameters import PAPER
from analysis.inference.fit import shot_fit
from analysis.inference.fit.problem import Fitted
from analysis.inference.fit.relinearised_frame import half_way
from analysis.inference.fit.shot_fit import _settled, fit_shots
from analysis.inference.joint import joint_data
from analysis.inference.joint.joint_data import JointData, frame_motions_of
from analysis.inference.model.base import base_named
from analysis.inference.model.effective_parameters import Point
from analysis.inference.model.samples import averaged_shots
from analysis.inference.noise.sway import with_plates
from analysis.reading.read import read_frame_motion
from analysis.shot.consistency import FRAME_MOVES_FAR
from analysis.shot.shot import AnalysisError
from tests.analysis.collision.simulated import shot
from tests.building_rig import CURVES_M_PER_S, Rig


def point(base: list[float], own: list[list[float]], values: Any = ()) -> Point:
    return Point(np.array(base), np.array(own), values)


def test_half_way_is_the_mean_of_base_and_plates_with_the_effects_of_the_second() -> None:
    one = point([1.0, 4.0], [[1.0, 2.0, 3.0]], ({"first": 1},))
    two = point([3.0, 8.0], [[5.0, 2.0, 1.0]], ({"second": 2},))
    found, plates = half_way((one, ((1.0, 2.0),)), (two, ((3.0, 8.0),)))
    assert found.base.tolist() == [2.0, 6.0] and found.own.tolist() == [[3.0, 2.0, 2.0]]
    assert found.values == two.values and plates == ((2.0, 5.0),)
    assert half_way((one, ()), (two, ((3.0, 8.0),)))[1] == ((3.0, 8.0),)


def turns(
    steps: list[float], monkeypatch: pytest.MonkeyPatch, *, moves: bool = True, far: bool = False
) -> tuple[Any, list[Any]]:
    """Return what settles where every search moves its one parameter so far, and the points it was begun at."""
    begun: list[Any] = []
    left = iter(steps)

    def minimum(problem: Any, z: np.ndarray, stop: Any) -> Any:
        begun.append((float(z[0]), problem.made_at))
        square = SimpleNamespace(curvature=np.eye(1))
        return SimpleNamespace(parameters=z + next(left), square=square)

    def of(made_at: Any) -> Any:
        return SimpleNamespace(
            made_at=made_at, data=SimpleNamespace(site=SimpleNamespace(moves=moves)), with_softened_contact=lambda p: p,
            pack=lambda p: p.base.copy(),
            unpack=lambda z: point([float(z[0])], [[0.0, 0.0, 0.0]]),
        )  # fmt: skip

    monkeypatch.setattr(shot_fit, "_minimum_from", minimum)
    monkeypatch.setattr(shot_fit, "frame_moves_far", lambda problem: far and problem.made_at == "begin")
    monkeypatch.setattr(shot_fit, "_at_motion", lambda problem, here, plates: of((float(here.base[0]), plates)))
    monkeypatch.setattr(shot_fit, "likeliest_plates", lambda problem, z: ((float(z[0]), 0.0),))
    problem: Any = of("begin")
    settled = _settled(problem, point([0.0], [[0.0, 0.0, 0.0]]), (), lambda: False)
    return settled, begun


def test_a_frames_contribution_is_computed_anew_until_the_motion_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    """From the second turn on by half steps, as full ones would alternate."""
    small = 0.5 * shot_fit._SMALL_MOVE
    (problem, found, undecided), begun = turns([4.0, -2.0, small], monkeypatch)
    assert begun == [(0.0, "begin"), (4.0, (4.0, ((4.0, 0.0),))), (3.0, (3.0, ((3.0, 0.0),)))]
    assert problem.made_at == begun[-1][1] and found.parameters[0] == 3.0 + small and undecided.tolist() == [0.0]
    (_, found, _), begun = turns([7.0], monkeypatch, moves=False)
    assert found.parameters[0] == 7.0 and len(begun) == 1
    for far, most in ((False, 4), (True, 12)):  # where a frame moves far, the turns come to an end more slowly
        moves = [4.0, -2.0] * most
        (_, _, undecided), begun = turns(moves, monkeypatch, far=far)
        assert len(begun) == most
        assert undecided[0] == pytest.approx(moves[most - 1] / np.sqrt(2.0))  # one standard deviation of two


def test_a_search_of_too_many_or_equal_effects_is_refused() -> None:
    motion = shot()
    four = effects_named(("viscous_drag", "tilt", "block_mode", "coulomb_friction"))
    for effects in (four, ("tilt", "tilt")):
        with pytest.raises(ValueError, match="at most 3 different ones"):
            fit_shots([motion], effects=effects)
    with pytest.raises(ValueError, match="no shot to fit"):
        fit_shots([])


def test_the_data_of_several_shots() -> None:
    motions = [shot(seed=seed) for seed in (1, 2)]
    data = JointData(averaged_shots(motions), base_named("paper"))
    assert data.band_hz == pytest.approx((2.5 / data.shots[0].length_s, 0.45 / 5e-5))
    assert data.count == 4 and data.stated_noise.white_m == data.shots[0].white_m
    assert data.white_noise.white_m == pytest.approx(1.5e-10 / np.sqrt(5), rel=0.3)
    assert data.white_noise.rms_m == (0.0, 0.0) and data.white_noise.spacing_s == data.shots[0].spacing_s
    for count, enough in ((100, True), (99, False)):  # differences of third order
        valid = np.arange(data.shots[0].valid.size) < count + 3
        few = replace(data, shots=(replace(data.shots[0], valid=valid),))
        if enough:
            assert few.white_noise.white_m > 0.0
        else:
            with pytest.raises(AnalysisError, match="too few samples"):
                _ = few.white_noise
    still = [replace(one, displacement_m=np.zeros(one.valid.size)) for one in data.shots]
    assert 0.0 < replace(data, shots=tuple(still)).white_noise.white_m <= 1e-15
    plates = with_plates(data.shots, ((1.0, 2.0), (3.0, 4.0)))
    assert [one.plate for one in plates] == [(1.0, 2.0), (3.0, 4.0)] and with_plates(data.shots, ()) == data.shots


def test_the_frames_motion_is_read_where_it_is_not_known_and_there_is_a_plate(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(joint_data, "read_frame_motion", lambda motion: f"read in {motion.time_s.size}")
    motions = [shot(samples=6000), shot(samples=6100)]
    slow = [motions[0], replace(motions[1], sample_rate_hz=1e3)]
    known: Any = [None, "known"]
    assert frame_motions_of(motions, "paper", None) == ("read in 6000", "read in 6100")
    assert frame_motions_of(motions, "paper", known) == (None, "known")
    assert frame_motions_of(motions, "contact", known) == (None, None) == frame_motions_of(slow, "paper", known)


def test_what_stays_undecided_between_turns_is_added_to_the_covariance(monkeypatch: pytest.MonkeyPatch) -> None:
    left = Fitted(cast(Any, None), np.zeros(2), math.nan, (), np.diag([1.0, 4.0]), True)
    said: list[Any] = []
    flags: list[Any] = []
    monkeypatch.setattr(shot_fit, "_reweighed", lambda *_: left)
    monkeypatch.setattr(
        shot_fit, "as_fit", lambda fitted, *_, **how: (said.append(fitted.inverse), flags.append(how["flags"]))
    )
    monkeypatch.setattr(shot_fit._SearchEnd, "_plate_rings", lambda *_: False)
    problem: Any = SimpleNamespace(names=(), noise=None)
    found: Any = SimpleNamespace(at_bound=(), square=SimpleNamespace(chi2=1.0))
    for far in (False, True):
        monkeypatch.setattr(shot_fit, "frame_moves_far", lambda one, far=far: far and one is problem)
        for undecided in ([2.0, -1.0], [0.0, 0.0]):
            end = shot_fit._SearchEnd(problem, found, True, np.array(undecided))
            end.as_fit([], "paper", 0.0, lambda: False)
    np.testing.assert_array_equal(said[0], [[5.0, -2.0], [-2.0, 5.0]])
    assert flags == [[], [], ["frame_moves_far"], []]


@pytest.mark.parametrize("seed", [5, 17, 22])
def test_a_fit_on_a_frame_that_moves_far_is_right_or_says_that_it_may_not_be(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An office: 400 um/s in every third-octave.  After four turns these were off by 4 to 6 of their uncertainties."""
    monkeypatch.setitem(CURVES_M_PER_S, "office", 400e-6)
    rig = Rig("office")
    motions = rig.shots(seed, (0.2 + 0.008 * seed,))
    fit = fit_shots(motions, vibrations=[read_frame_motion(one) for one in motions])
    bodies = rig.bodies
    true = {
        "plate_stiffness_n_per_m": bodies.plate_n_per_m,
        "plate_mass_kg": bodies.plate_kg,
        "contact_stiffness_n_per_m": bodies.contact_n_per_m,
        "contact_damping_n_s_per_m": bodies.contact_n_s_per_m,
    }
    far = [abs(fit.parameters[name].value - value) / fit.parameters[name].std for name, value in true.items()]
    assert fit.converged and fit.on_frames
    assert max(far) < 3.5 or FRAME_MOVES_FAR in fit.flags, (far, fit.flags)


def test_a_joint_fit_of_clean_shots_is_the_truth_with_its_uncertainty() -> None:
    size = 2e-4
    motions = [
        shot(replace(PAPER, velocity_in_m_per_s=v), effects={"viscous_drag": (size,)}, seed=k)
        for k, v in enumerate((-0.2, -0.33))
    ]
    fit = fit_shots(motions, effects=["viscous_drag"])
    assert fit.converged and fit.flags == () and fit.model == "paper" and fit.effects == (effect_named("viscous_drag"),)
    assert fit.reduced_chi2 == pytest.approx(1.0, abs=0.15) and 0.0 < fit.seconds < 600.0
    assert fit.chi2 == pytest.approx(fit.reduced_chi2 * (fit.samples - fit.free_parameters), rel=0.01)
    assert fit.free_parameters == 5 + 2 * 3 and not fit.on_frames
    truth = {name: getattr(PAPER, name) for name in list(fit.parameters)[:4]}
    truth["viscous_drag.coefficient_n_s_per_m"] = size
    assert set(fit.parameters) == set(truth)
    for name, true in truth.items():
        found = fit.parameters[name]
        assert abs(found.value - true) < 4.5 * found.std < 0.2 * true, name
    for one, motion, speed in zip(fit.shots, motions, (-0.2, -0.33), strict=True):
        assert abs(one.velocity_in_m_per_s.value - speed) < 4.5 * one.velocity_in_m_per_s.std < 1e-4
        assert one.residual_m.size == motion.time_s.size
        assert np.nanstd(one.residual_m) == pytest.approx(1.5e-10, rel=0.05)
        assert one.reduced_chi2 == pytest.approx(1.0, abs=0.2)
    without = fit_shots(motions)
    assert without.reduced_chi2 > 2.0 and set(without.parameters) == set(list(truth)[:4])
