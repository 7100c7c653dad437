"""Figures 4 to 7 show the same collision measured and simulated, the plate computed from the force."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from analysis.collision.parameters import PAPER
from analysis.collision.solver.general import solve
from analysis.paper.paper_figures import figures, plate_from_force
from analysis.reading.read import read_impact
from analysis.shot.quantity import NotSeen, Quantity
from tests.analysis.shots import fit_of, shot_of
from tests.analysis.synthetic_collision import Synthetic, motion_of


def test_plate_follows_the_force() -> None:
    time = np.arange(-1e-3, 40e-3, 1e-6)
    run = solve(PAPER, (), time)
    found = plate_from_force(time, run.force_n, PAPER.plate_stiffness_n_per_m, PAPER.plate_mass_kg)
    # the force jumps at touch and release, which the line between two samples smears over one of them
    assert np.abs(found - run.plate_displacement_m).max() < 1e-3 * np.abs(run.plate_displacement_m).max()


def test_both_columns_show_the_same_collision() -> None:
    motion = motion_of(Synthetic(speed_m_per_s=0.2))
    shown = figures(PAPER, shot_of(motion=motion, impact=read_impact(motion)))
    assert [figure.number for figure in shown] == [4, 5, 6, 7]
    for figure, allowed in zip(shown, (0.03, 0.03, 0.02, 0.06), strict=True):
        for row in figure.rows:
            assert row.measured is not None
            x, y = row.measured.x, row.measured.y
            if figure.number == 6:  # the smooth part, past the bounces: both branches lie on one line
                x, y = x[x > 0.8 * x.max()], y[x > 0.8 * x.max()]
                far = row.simulated.x > 0.8 * row.simulated.x.max()
                model = np.polyval(np.polyfit(row.simulated.x[far], row.simulated.y[far], 1), x)
            else:
                model = np.interp(x, row.simulated.x, row.simulated.y)
            rms = float(np.sqrt(np.mean((y - model) ** 2)))
            assert rms < allowed * np.ptp(row.simulated.y), (figure.number, row.y_label)


def test_the_measured_curves_are_the_motion_about_the_contact_and_the_plate_is_that_of_a_converged_fit() -> None:
    motion = motion_of(Synthetic(speed_m_per_s=0.2, noise_m=0.0))
    impact = read_impact(motion)
    assert isinstance(impact.touch_time_s, Quantity) and isinstance(impact.release_time_s, Quantity)
    since = motion.time_s - impact.touch_time_s.value
    inside = (since >= -3e-3) & (motion.time_s <= impact.release_time_s.value + 3e-3)
    since, force = since[inside], motion.force_n[inside]
    near = (since >= -0.2e-3) & (since <= 4.5e-3)
    fit = fit_of(plate_stiffness_n_per_m=(300.0, 1.0), plate_mass_kg=(4e-4, 1e-6))
    own = (PAPER.plate_stiffness_n_per_m, PAPER.plate_mass_kg)
    for used, (k, m) in ((fit, (300.0, 4e-4)), (replace(fit, converged=False), own), (None, own)):
        shown = figures(PAPER, shot_of(motion=motion, impact=impact, fit=used))
        (speed, pull), (first,), (loop,), (gap,) = (figure.rows for figure in shown)
        for row, x, y in (
            (speed, since * 1e3, motion.velocity_m_per_s[inside]),
            (pull, since * 1e3, force),
            (first, since[near] * 1e3, force[near]),
        ):
            assert row.measured is not None and not row.missing
            np.testing.assert_allclose(row.measured.x, x, rtol=1e-12)
            np.testing.assert_array_equal(row.measured.y, y)
        # at the touch the block is at zero, on the way in: before it stands where it would fly from
        assert loop.measured is not None and gap.measured is not None
        flying = since < -1e-3
        np.testing.assert_allclose(loop.measured.x[flying], 1e3 * 0.2 * since[flying], atol=1e-5)
        np.testing.assert_array_equal(loop.measured.y, force)
        np.testing.assert_allclose(np.diff(loop.measured.x), -1e3 * np.diff(motion.displacement_m[inside]), atol=1e-12)
        # the plate by direct integration of its equation, from rest
        w = np.sqrt(k / m)
        steps = np.diff(since, prepend=since[0])
        phase = w * since
        plate = (
            np.cos(phase) * np.cumsum(force * np.sin(phase) * steps)
            - np.sin(phase) * np.cumsum(force * np.cos(phase) * steps)
        ) / (m * w)
        apart = -loop.measured.x * 1e-3 - plate
        np.testing.assert_allclose(gap.measured.y, 1e6 * apart[near], atol=0.02 * np.ptp(gap.measured.y))
        np.testing.assert_array_equal(gap.measured.x, first.measured.x)
    assert [figure.title for figure in shown] == [
        *("velocity and force", "force at the first contact", "force against deflection", "gap between the bodies"),
    ]
    assert [(row.x_label, row.y_label) for figure in shown for row in figure.rows] == [
        ("time after touch (ms)", "velocity (m/s)"),
        ("time after touch (ms)", "force (N)"),
        ("time after touch (ms)", "force (N)"),
        ("deflection (mm)", "force (N)"),
        ("time after touch (ms)", "gap (µm)"),
    ]


def test_the_simulated_curves_are_the_solution_at_the_shots_own_speed_from_before_the_touch_past_the_release() -> None:
    motion = motion_of(Synthetic(speed_m_per_s=0.2))
    impact = replace(read_impact(motion), velocity_in_m_per_s=Quantity(-0.31, 1e-6))
    for shot, speed in ((None, -0.265), (shot_of(motion=motion, impact=impact), -0.31)):
        (swing, _), (first,), (loop,), (gap,) = (figure.rows for figure in figures(PAPER, shot))
        time = swing.simulated.x * 1e-3
        run = solve(PAPER.at_speed(speed), (), time)
        assert time[0] == pytest.approx(-3e-3) and 28.8e-3 + 2e-3 < time[-1] < 28.8e-3 + 5e-3
        assert np.diff(time).max() < 2.1e-6  # the first bounces last half a millisecond
        near = (swing.simulated.x >= -0.2) & (swing.simulated.x <= 4.5)
        for curve, x, y in (
            (swing.simulated, time * 1e3, run.velocity_m_per_s),
            (first.simulated, time[near] * 1e3, run.force_n[near]),
            (loop.simulated, -run.displacement_m * 1e3, run.force_n),
            (gap.simulated, time[near] * 1e3, run.gap_m[near] * 1e6),
        ):
            np.testing.assert_allclose(curve.x, x, rtol=1e-9, atol=1e-12)
            np.testing.assert_allclose(curve.y, y, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"impact": None, "motion": None, "problem": "no beat"}, "no beat"),
        ({"impact": None}, "no impact in this shot"),
        ({"touch_time_s": NotSeen("x")}, "no impact in this shot"),
        ({"velocity_in_m_per_s": NotSeen("x")}, "no impact in this shot"),
        ({"force_n": np.nan}, "no impact in this shot"),
        ({"release_time_s": Quantity(0.010003 - 5.9e-3, 1e-6)}, "no impact in this shot"),  # ten samples
    ],
)
def test_what_shows_no_whole_impact_has_no_measured_curves_and_says_why(changes: dict[str, Any], why: str) -> None:
    motion = motion_of(Synthetic())
    impact = read_impact(motion)
    parts: dict[str, Any] = {"motion": motion, "impact": impact}
    for key, value in changes.items():
        if key in ("impact", "motion", "problem"):
            parts[key] = value
        elif key == "force_n":
            force = motion.force_n.copy()
            force[np.searchsorted(motion.time_s, 0.02)] = value
            parts["motion"] = replace(motion, force_n=force)
        else:
            parts["impact"] = replace(impact, **{key: value})
    assert {(row.measured, row.missing) for figure in figures(PAPER, shot_of(**parts)) for row in figure.rows} == {
        (None, why)
    }


def test_without_a_recording_the_measured_curves_are_missing_with_a_reason() -> None:
    for figure in figures(PAPER):
        assert all(row.measured is None and row.missing == "no recording" for row in figure.rows)
    impact = shot_of().impact
    assert impact is not None
    unfinished = replace(impact, release_time_s=NotSeen("the record ends"))
    shot = shot_of(motion=motion_of(Synthetic()), impact=unfinished)
    assert all(row.measured is None and row.missing for figure in figures(PAPER, shot) for row in figure.rows)


@pytest.mark.parametrize("number", [4, 5, 6, 7])
def test_curves_are_finite(number: int) -> None:
    figure = next(f for f in figures(PAPER) if f.number == number)
    for row in figure.rows:
        assert np.isfinite(row.simulated.x).all() and np.isfinite(row.simulated.y).all() and row.simulated.x.size > 100
