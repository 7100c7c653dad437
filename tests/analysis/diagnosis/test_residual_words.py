"""What is said of a residual: its size above the white noise, and never zero as if that were a size."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from analysis.collision.effects import CATALOGUE
from analysis.diagnosis.evidence.lack_of_fit import NO_MISFIT, LackOfFit
from analysis.diagnosis.evidence.residual import remainder_of
from analysis.diagnosis.findings import words
from analysis.diagnosis.findings.result import Candidate, Freedom, Phase, Standing
from analysis.diagnosis.findings.wording import remark_on


def _fit(scale: float) -> Any:
    """Return a fit of one shot whose residual is ``scale`` times white noise of 0.1 nm."""
    noise_m, count = 1e-10, 4000
    left_m = scale * noise_m * np.random.default_rng(3).standard_normal(count)
    course = SimpleNamespace(
        touch_time_s=0.05, contact_time_s=0.03, turnaround_time_s=0.065, release_time_s=0.08, velocity_in_m_per_s=-0.2
    )
    shot = SimpleNamespace(
        valid=np.ones(count, dtype=bool),
        weight=1.0,
        course=course,
        centre_s=5e-5 * np.arange(count),
        spacing_s=5e-5,
        without_frame_motion=lambda _floor, left: left,
    )
    floor = SimpleNamespace(white_m=noise_m)
    data = SimpleNamespace(shots=[shot])
    return SimpleNamespace(
        problem=SimpleNamespace(data=data),
        noise=floor,
        residual_m=(left_m,),
        whitened=lambda: [left_m / noise_m],
    )


@pytest.mark.parametrize(
    ("scale", "weight", "said"),
    [
        (2.0, 1.0, "0.17 nm rms in displacement above"),
        (0.99, 1.0, "no net rms displacement"),
        (1.98, 2.0, "no net rms displacement"),
    ],
)
def test_a_residual_within_the_noise_is_not_said_to_be_0_nm(scale: float, weight: float, said: str) -> None:
    fit = _fit(scale)
    fit.problem.data.shots[0].weight = weight  # times the noise of the others
    text = words.remainder(remainder_of(cast(Any, fit)))
    assert text.startswith(said) and "above the white noise of 0.1 nm" in text
    assert not text.startswith("0 nm")


def test_what_a_residual_looks_like_has_a_size() -> None:
    misfit = LackOfFit(Freedom.PLACE, 104.0, 63.0, 4)
    said = words.remainder(remainder_of(cast(Any, _fit(2.0)), misfit))
    assert said.endswith("; it resembles a position-dependent force (10 noise norms)")
    beside = words.remainder(remainder_of(cast(Any, _fit(2.0)), misfit, [CATALOGUE["tilt"]]))
    assert "best imitated by tilt, which failed a test; the remaining residual resembles" in beside
    assert "resembles" not in words.remainder(remainder_of(cast(Any, _fit(2.0)), NO_MISFIT))


def test_every_kind_of_remainder_and_standing_has_words() -> None:
    assert set(words.FREEDOMS) == set(Freedom)
    for standing in Standing:
        remark = remark_on(Candidate(CATALOGUE["tilt"], 1.0, None, standing=standing, number=0.25))
        assert remark and "{" not in remark and "None" not in remark


@pytest.mark.parametrize("shots", [1, 2])
def test_a_line_is_told_that_all_shots_have(shots: int) -> None:
    one = _fit(1.0)
    (white,) = one.whitened()
    lined = white + 0.5 * np.sin(2 * np.pi * 417.0 * one.problem.data.shots[0].centre_s)
    fit = _fit(1.0)
    fit.problem.data.shots *= shots
    fit.residual_m *= shots
    fit.whitened = lambda: [lined] * shots
    line_hz = remainder_of(cast(Any, fit)).line_hz
    assert line_hz is not None and line_hz == pytest.approx(417.0, abs=5.0)
    assert remainder_of(cast(Any, _fit(1.0))).line_hz is None


@pytest.mark.parametrize(
    ("at_s", "phase"),
    [
        (0.0490, Phase.FLIGHT_IN),
        (0.0505, Phase.BOUNCES),
        (0.0540, Phase.BOUNCES),  # the last bounce of the paper's plate lasts until a seventh of the contact
        (0.0600, Phase.LOADING),
        (0.0640, Phase.LOADING),
        (0.0660, Phase.UNLOADING),
        (0.0760, Phase.UNLOADING),
        (0.0790, Phase.RELEASE),
        (0.0810, Phase.RELEASE),
        (0.0840, Phase.FLIGHT_OUT),
    ],
)
def test_a_residual_is_largest_where_something_happened(at_s: float, phase: Phase) -> None:
    fit = _fit(1.0)
    shot = fit.problem.data.shots[0]
    fit.residual_m[0][np.abs(shot.centre_s - at_s) < 3e-4] += 5e-9
    told = dict(remainder_of(cast(Any, fit)).phases)
    assert max(told, key=told.__getitem__) is phase
