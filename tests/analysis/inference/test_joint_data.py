"""Shots that are fitted together: their band and noise, and which of them can show a frame's motion."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.collision import Infeasible
from analysis.collision.parameters import PAPER
from analysis.inference.joint import joint_data as module
from analysis.inference.joint.joint_data import (
    JointData,
    frame_motions_of,
    joint_data,
)
from analysis.inference.model.base import SearchStart, base_named
from analysis.inference.model.samples import averaged_shots
from analysis.inference.noise.site import STILL_FRAME
from analysis.shot import AnalysisError
from tests.analysis.collision.simulated import shot

BASE = base_named("paper")


@pytest.fixture(scope="module")
def shots() -> tuple[Any, ...]:
    return averaged_shots([shot(PAPER, seed=1), shot(PAPER, seed=2, samples=5000)])


def test_a_line_is_told_from_a_drift_and_not_aliased(shots: Any) -> None:
    slowest, fastest = JointData(shots, BASE).band_hz
    assert slowest == pytest.approx(2.5 / max(one.length_s for one in shots))
    assert slowest < 2.5 / min(one.length_s for one in shots)
    assert fastest == pytest.approx(0.45 / shots[0].spacing_s) and JointData(shots, BASE).count == 4


def test_white_noise_is_that_of_third_differences_and_needs_a_hundred_of_them(shots: Any) -> None:
    data = JointData(shots, BASE)
    random = np.random.default_rng(3)
    level = [replace(one, displacement_m=7e-11 * random.standard_normal(one.valid.size)) for one in shots]
    assert JointData(tuple(level), BASE).white_noise.white_m == pytest.approx(7e-11, rel=0.1)
    assert data.white_noise.spacing_s == shots[0].spacing_s == data.stated_noise.spacing_s
    assert data.stated_noise.white_m == shots[0].white_m and not data.white_noise.coloured

    def few(count: int) -> JointData:
        kept = [replace(one, valid=np.arange(one.valid.size) < count) for one in shots]
        return JointData(tuple(kept), BASE)

    assert few(53).white_noise.white_m > 0.0
    with pytest.raises(AnalysisError, match="too few samples"):
        _ = few(52).white_noise
    left = data.left_m([one.displacement_m - 1.0 for one in shots])
    assert [one.tolist() for one in left] == [pytest.approx([1.0] * len(one.displacement_m)) for one in shots]


def test_a_frames_motion_is_read_where_records_are_quick_and_there_is_a_plate(monkeypatch: pytest.MonkeyPatch) -> None:
    quick, slow = (
        SimpleNamespace(sample_rate_hz=rate, time_s=np.array([3.0, end])) for rate, end in ((1e4, 4.0), (9.9e3, 5.0))
    )
    given: Any = [quick, slow]
    monkeypatch.setattr(module, "read_frame_motion", lambda motion: motion.sample_rate_hz)
    assert frame_motions_of(given[:1] * 2, "paper", None) == (1e4, 1e4)
    assert frame_motions_of(given[:1], "paper", ["known"]) == ("known",)  # type: ignore[list-item]
    for motions, model in ((given, "paper"), (given[:1], "contact")):
        assert frame_motions_of(motions, model, ["known"] * len(motions)) == (None,) * len(motions)  # type: ignore[list-item]


def test_shots_take_the_plates_of_a_beginning_and_the_frame_as_it_moves_there(monkeypatch: pytest.MonkeyPatch) -> None:
    motions = [shot(PAPER)]
    begin = SearchStart(BASE, np.ones(4), np.zeros((1, 3)), ((1e-9, 2e-6),))
    site: Any = "a building"
    monkeypatch.setattr(
        module, "on_site", lambda shots, where, base, at, plates: (*plates, where, base, at.base.tolist())
    )
    found = joint_data(averaged_shots(motions, 1e5), begin, site)
    assert found.shots == ((1e-9, 2e-6), site, BASE, [1.0] * 4) and found.site is site and found.base is BASE
    monkeypatch.undo()
    still = joint_data(averaged_shots(motions, 1e5), begin, STILL_FRAME)
    assert still.site is STILL_FRAME and still.shots[0].factor == 1 and still.shots[0].plate == (0.0, 0.0)
    assert joint_data(averaged_shots(motions), begin, STILL_FRAME).shots[0].factor == 5

    def nowhere(*_: Any) -> Any:
        raise Infeasible("no collision")

    monkeypatch.setattr(module, "on_site", nowhere)
    assert joint_data(averaged_shots(motions), begin, site).site is STILL_FRAME
