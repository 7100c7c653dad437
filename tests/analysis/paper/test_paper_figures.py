"""Figures 4 to 7 show the same collision measured and simulated, the plate computed from the force."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.collision.general import solve
from analysis.collision.parameters import PAPER
from analysis.paper.paper_figures import figures, plate_from_force
from analysis.reading.read import read_impact
from analysis.shot.quantity import NotSeen
from tests.analysis.shots import shot_of
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
