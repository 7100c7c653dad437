"""The low-pass of a drive's force and motion, which samples are compared, and the table of them."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.drive import stretch as module
from analysis.drive.catalogue import LAWS
from analysis.drive.stretch import Stretch, Table, _in_motion, derived, low_pass, prepare
from analysis.shot.shot import AnalysisError, Cancelled
from tests.analysis.drive.slider import RATE_HZ, Drive, Floats


def response(taps: Floats, frequency_hz: Floats, rate_hz: float) -> Floats:
    """Return the response of a filter whose taps are centred on no delay."""
    at = np.arange(taps.size) - taps.size // 2
    return np.asarray(np.exp(-2j * np.pi * np.outer(frequency_hz, at) / rate_hz) @ taps)


@pytest.mark.parametrize(("rate_hz", "bandwidth_hz"), [(200.0, 7.0), (1e3, 90.0)])
@pytest.mark.parametrize("later", [0.0, 0.4, -0.13])
def test_the_low_pass_passes_its_band_and_no_other_and_delays_by_as_much_as_asked(
    rate_hz: float, bandwidth_hz: float, later: float
) -> None:
    later_s = later / bandwidth_hz
    taps = low_pass(rate_hz, bandwidth_hz, later_s)
    assert taps.sum() == pytest.approx(1.0, abs=1e-14)
    edge = np.array([0.0, 0.2, 0.5, 0.65, 1.0, 1.35, 1.5, 2.0]) * bandwidth_hz
    through = response(taps, edge, rate_hz) * np.exp(2j * np.pi * edge * later_s)
    np.testing.assert_allclose(through, [1.0, 1.0, 1.0, 1.0, 0.5, 0.0, 0.0, 0.0], atol=3e-3)
    reach = 3.0 / bandwidth_hz * rate_hz
    assert taps.size // 2 - reach == pytest.approx(0.5 / bandwidth_hz * rate_hz, abs=2.0)


def test_velocity_and_acceleration_are_the_derivatives_of_what_the_low_pass_leaves() -> None:
    frequency = np.linspace(0.05, 99.0, 300)
    turn, low = 2j * np.pi * frequency, response(low_pass(200.0, 12.0), frequency, 200.0)
    for order, taps in enumerate(derived(200.0, 12.0), start=1):
        error = np.abs(response(taps, frequency, 200.0) - turn**order * low)
        assert error[frequency < 90.0].max() < 3e-6 * (2 * np.pi * 12.0) ** order
        assert abs(taps.sum()) < 1e-9 * np.abs(taps).sum()  # of a place that does not change


@pytest.mark.parametrize("step", [1, 3, 7])
@pytest.mark.parametrize("later_s", [0.0, 0.012])
def test_a_column_is_smoothed_at_the_samples_compared(step: int, later_s: float) -> None:
    column = np.random.default_rng(step).standard_normal(500)
    half = low_pass(200.0, 12.0).size // 2
    used = np.arange(-half % step, 500, step)
    used = used[used > 150]
    none = np.zeros(500)
    one = Stretch(none, none, none, none, none, used, step, 200.0, 12.0, 0)
    by_numpy = np.convolve(column, low_pass(200.0, 12.0, later_s), mode="same")
    np.testing.assert_allclose(one.smooth(column, later_s), by_numpy[used], atol=1e-12)


def test_samples_beside_a_long_standstill_are_left_out_and_a_reversal_stays_in() -> None:
    moves = np.ones(40, dtype=bool)
    moves[10:14] = False  # as long as the filter
    moves[22:27] = False
    left = np.ones(40, dtype=bool)
    left[18:31] = False
    assert _in_motion(moves, 4).tolist() == left.tolist()
    moves[:5] = False
    left[:9] = False
    assert _in_motion(moves, 4).tolist() == left.tolist()


def test_what_is_compared_is_evenly_thinned_and_away_from_the_ends_and_from_a_gap() -> None:
    drive = Drive(seconds=20.0, encoder_m=1e-6)
    motion = drive.motion()
    force = motion.force_n.copy()
    force[1500] = np.nan
    one, two = prepare([replace(motion, force_n=force)])
    for edge_s in (one.time_s[one.used[0]] - motion.time_s[0], motion.time_s[-1] - two.time_s[two.used[-1]]):
        assert 10.0 <= edge_s * one.bandwidth_hz < 10.0 + 2.0  # and one step of the thinning, at most
    np.testing.assert_array_equal(one.time_s, motion.time_s[:1500])
    np.testing.assert_array_equal(two.time_s, motion.time_s[1501:])
    np.testing.assert_array_equal(two.force_n, motion.force_n[1501:])
    for part in (one, two):
        assert set(np.diff(part.used)) == {part.step}
        assert part.step == int(RATE_HZ / (3.0 * part.bandwidth_hz)) > 3 and part.sample_rate_hz == RATE_HZ
    for part in (one, two):
        for seen, true in zip(
            (part.displacement_m, part.velocity_m_per_s, part.acceleration_m_per_s2),
            drive._path(part.time_s),
            strict=True,
        ):
            np.testing.assert_allclose(seen[part.used], true[part.used], atol=2e-3 * np.abs(true).max())


def test_all_records_are_compared_in_the_narrowest_of_their_bands() -> None:
    quiet, coarse = Drive().motion(), Drive(encoder_m=3e-5, seed=2).motion()
    bands = [prepare([motion])[0].bandwidth_hz for motion in (quiet, coarse)]
    assert bands[1] < 0.7 * bands[0]
    both = prepare([quiet, coarse])
    assert [part.bandwidth_hz for part in both] == [bands[1]] * 2
    assert [part.record for part in both] == [0, 1]
    table = Table.of(both)
    assert np.unique(table.record, return_counts=True)[1].tolist() == [part.used.size for part in both]
    np.testing.assert_array_equal(table.base()[:, 0], table.acceleration_m_per_s2)
    np.testing.assert_array_equal(table.base()[:, 1:], np.stack([table.velocity_m_per_s, 1 + 0 * table.time_s], axis=1))
    np.testing.assert_array_equal(table.force(2e-3), np.concatenate([part.smooth(part.force_n, 2e-3) for part in both]))
    friction = [part.smooth(np.sign(part.velocity_m_per_s)) for part in both]
    np.testing.assert_array_equal(table.columns(LAWS["coulomb_friction"], ())[:, 0], np.concatenate(friction))


@pytest.mark.parametrize("lasts", [True, False])
def test_records_too_short_for_their_filter_are_refused(lasts: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    motion = Drive(seconds=6.0).motion()
    (part,) = prepare([motion])
    ends_s = 10.0 / part.bandwidth_hz
    whole = round(part.used.size * RATE_HZ / (3.0 * part.bandwidth_hz))
    monkeypatch.setattr(module, "MIN_SAMPLES", whole if lasts else whole + 1)
    if lasts:
        assert prepare([motion])[0].used.tolist() == part.used.tolist()
    else:
        with pytest.raises(AnalysisError, match=rf"^some {whole} samples of .* counting {ends_s:.3g} s at each end"):
            prepare([motion])


def test_a_force_of_nothing_is_refused_and_one_that_changes_a_little_is_not() -> None:
    motion = Drive().motion()
    with pytest.raises(AnalysisError, match="nothing is driven by it"):
        prepare([motion, replace(motion, force_n=np.full(motion.force_n.size, 3.0))])
    with pytest.raises(AnalysisError, match="nothing is driven by it"):
        prepare([replace(motion, force_n=np.full(motion.force_n.size, np.nan))])
    gap = np.where(np.arange(motion.force_n.size) == 5, np.nan, motion.force_n)
    assert prepare([replace(motion, force_n=gap)])


def test_a_table_that_is_stopped_says_so() -> None:
    parts = prepare([Drive(seconds=6.0).motion()])
    Table.of(parts).raise_if_cancelled()
    with pytest.raises(Cancelled):
        Table.of(parts, lambda: True).raise_if_cancelled()
