"""Curves of a drive for plots: what the samples compared show, broken where a record is."""

from dataclasses import replace

import numpy as np

from analysis.drive.catalogue import LAWS
from analysis.drive.curves import _with_breaks, drive_curves
from analysis.drive.driven_fit import fit_driven
from analysis.drive.stretch import Table, prepare
from tests.analysis.drive.slider import Drive


def test_a_curve_is_broken_at_a_gap_and_time_goes_on() -> None:
    column, breaks = np.array([1.0, 2.0, 4.0, 9.0]), np.array([1, 3])
    np.testing.assert_array_equal(_with_breaks(column, breaks), [1.0, np.nan, 2.0, 4.0, np.nan, 9.0])
    assert _with_breaks(column, breaks, between=True).tolist() == [1.0, 1.5, 2.0, 4.0, 6.5, 9.0]
    assert _with_breaks(column, np.zeros(0, int)).tolist() == column.tolist()


def test_measured_and_modelled_force_are_those_of_the_samples_compared() -> None:
    whole = Drive(lambda x, v: 20.0 * np.sign(v), seconds=20.0, encoder_m=1e-6).motion()
    fit = fit_driven([whole], [LAWS["coulomb_friction"]])
    torn = replace(whole, force_n=np.where(np.arange(whole.force_n.size) == 2000, np.nan, whole.force_n))
    curves = drive_curves(torn, fit)
    table = Table.of(prepare([torn]))
    first = table.stretches[0].used.size
    assert len(table.stretches) == 2 and curves.bandwidth_hz == table.stretches[0].bandwidth_hz
    arrays = curves.displacement_m, curves.velocity_m_per_s, curves.measured_n, curves.modelled_n
    for array in arrays:
        assert np.flatnonzero(np.isnan(array)).tolist() == [first]
    kept = np.arange(table.time_s.size + 1) != first
    np.testing.assert_array_equal(curves.time_s[kept], table.time_s)
    assert np.all(np.diff(curves.time_s) > 0.0)
    np.testing.assert_array_equal(curves.displacement_m[kept], table.displacement_m)
    np.testing.assert_array_equal(curves.velocity_m_per_s[kept], table.velocity_m_per_s)
    np.testing.assert_array_equal(curves.measured_n[kept], table.force())
    values = np.array([quantity.value for quantity in fit.parameters.values()])
    columns = np.concatenate([table.base(), table.columns(LAWS["coulomb_friction"], ())], axis=1)
    np.testing.assert_allclose(curves.modelled_n[kept], columns @ values, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(curves.residual_n[kept], table.force() - columns @ values, atol=1e-8)
    assert not curves.repeatability.repeats and 0.0 < curves.repeatability.force_n < 1.0
    assert not np.isnan(drive_curves(whole, fit).measured_n).any()
