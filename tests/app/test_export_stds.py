"""The CSV's standard uncertainties are what its samples scatter by, in a building too."""

import numpy as np
import pytest

from analysis.pipeline import analyse
from analysis.shot.quantity import Quantity
from app.report.exports import motion_columns
from instrument.bench.rig import Bench
from instrument.bench.simulated_shots import record_shot
from instrument.bench.site import site_named


@pytest.mark.parametrize("site", ["quiet", "VC-D", "VC-A"])
def test_the_force_scatters_in_flight_as_its_column_says(site: str) -> None:
    shot = analyse(record_shot(Bench(site=site_named(site), seed=5), 0, 0.27, 10e6, 0.06)[0])
    columns = motion_columns(shot)
    assert shot.impact is not None and isinstance(shot.impact.touch_time_s, Quantity)
    flown = columns["time_s"] < shot.impact.touch_time_s.value - 1e-3
    scatter = float(np.nanstd(columns["force_n"][flown]))
    stated = float(np.nanmedian(columns["force_std_n"][flown]))
    assert 0.7 < scatter / stated < 1.4
    mass = shot.motion.moving_mass_kg if shot.motion is not None else 0.0
    assert columns["acceleration_std_m_per_s2"][flown] * mass == pytest.approx(columns["force_std_n"][flown])
    slow = np.polynomial.Polynomial.fit(columns["time_s"][flown], columns["displacement_m"][flown], 1)
    left = columns["displacement_m"][flown] - slow(columns["time_s"][flown])
    assert float(np.std(left)) < 2.0 * float(np.nanmedian(columns["displacement_std_m"][flown]))
