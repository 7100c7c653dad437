"""Samples that a digitizer lost without reporting it are found and counted, and the shot is read as with gaps."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.pipeline import analyse
from analysis.shot.quantity import Quantity
from analysis.shot.recording import Gap
from analysis.shot.shot import AnalysisSettings
from analysis.signal.demodulation import demodulate
from analysis.signal.losses import find_losses
from tests.analysis.disturbance import without_samples
from tests.analysis.signal.beats import free_flight, make_recording
from tests.analysis.synthetic_collision import Synthetic
from tests.beats import REST_HZ, recording_of

SHORT = Synthetic(duration_s=0.02)
LOST = {30_000: 1, 61_440: 2, 90_001: 12, 90_301: 3, 120_500: 256, 150_000: 4}


@pytest.mark.parametrize("snr_db", [35.0, 22.0])
def test_each_loss_is_found_to_a_few_samples_and_counted(snr_db: float) -> None:
    recording = without_samples(recording_of(SHORT, snr_db=snr_db), LOST)
    found = {gap.sample_start: gap.samples_lost for gap in find_losses(recording, REST_HZ)}
    stored = np.array(list(LOST)) - np.concatenate([[0], np.cumsum(list(LOST.values()))[:-1]])
    assert list(found.values()) == list(LOST.values())
    assert np.abs(np.array(list(found)) - stored).max() <= 3


@pytest.mark.parametrize("snr_db", [15.0, 10.0])
@pytest.mark.parametrize("size", [1, 3, 4])
def test_a_loss_is_found_in_little_light(size: int, snr_db: float) -> None:
    """Four samples are 0.09 of a period more than a whole one."""
    recording = recording_of(SHORT, snr_db=snr_db)
    assert find_losses(recording, REST_HZ) == ()
    (found,) = find_losses(without_samples(recording, {90_001: size}), REST_HZ)
    assert found.samples_lost == size and abs(found.sample_start - 90_001) <= 3


@pytest.mark.parametrize("apart", [12, 40, 90, 104, 150, 190, 230])
def test_two_losses_close_together_are_two(apart: int) -> None:
    """Taken for one or for none, they leave the rest beat a step, and every displacement behind it wrong."""
    recording = without_samples(recording_of(SHORT, snr_db=30.0), {90_000: 4, 90_004 + apart: 3, 120_500: 2})
    found = [(gap.sample_start, gap.samples_lost) for gap in find_losses(recording, REST_HZ)]
    assert [count for _, count in found] == [4, 3, 2]
    assert np.abs(np.array([at for at, _ in found]) - [90_000, 90_000 + apart, 120_493]).max() <= 3


@pytest.mark.parametrize("size", [1, 9, 16])
def test_the_first_of_two_close_losses_is_counted_whatever_few_samples_it_took(size: int) -> None:
    recording = without_samples(recording_of(SHORT, snr_db=30.0), {90_000: size, 90_040 + size: 3})
    assert [gap.samples_lost for gap in find_losses(recording, REST_HZ)] == [size, 3]


@pytest.mark.parametrize("rest_hz", [0.2e6, 4.9e6])
def test_losses_are_found_though_the_rest_beat_nearly_meets_its_mirror_image(rest_hz: float) -> None:
    """Near zero and near half the sample rate both are read together unless enough of their periods are."""
    whole = make_recording(free_flight(-0.01), 200_000, rest_hz=rest_hz, snr_db=35.0)
    assert find_losses(whole, rest_hz) == ()
    found = find_losses(without_samples(whole, {60_000: 1, 120_500: 3}), rest_hz)
    assert [gap.samples_lost for gap in found] == [1, 3]
    assert np.abs(np.array([gap.sample_start for gap in found]) - [60_000, 120_499]).max() <= 3


def test_nothing_is_lost_where_nothing_was_lost() -> None:
    recording = recording_of(SHORT)
    assert find_losses(recording, REST_HZ) == ()
    assert "samples_lost" not in demodulate(recording, AnalysisSettings()).flags


def test_a_modulated_rest_beat_has_no_losses() -> None:
    """A laser whose rest phase moves by a tenth of a cycle within a tenth of a millisecond."""
    recording = recording_of(SHORT)
    time = np.arange(recording.samples) / recording.sample_rate_hz
    counts = recording.counts.copy()
    wobble = 0.05 * np.tanh((time - 0.01) / 5e-5)
    counts[:, 0] = np.round(0.7 * 2048 * np.cos(2 * np.pi * (REST_HZ * time + wobble)))
    assert find_losses(replace(recording, counts=counts), REST_HZ) == ()


def test_readings_are_right_with_samples_lost_in_the_contact() -> None:
    whole = recording_of(Synthetic(duration_s=0.06, touch_s=0.012003))
    lossy = without_samples(whole, {200_000: 2, 261_000: 4, 300_000: 1})
    shot = analyse(lossy)
    assert {"samples_lost", "gap"} <= set(shot.flags)
    assert "rest_unsteady" not in shot.flags
    assert shot.impact is not None
    reference = analyse(whole).impact
    assert reference is not None
    for name in ("velocity_in_m_per_s", "velocity_out_m_per_s", "force_peak_n", "contact_time_s"):
        one, other = getattr(shot.impact, name), getattr(reference, name)
        assert isinstance(one, Quantity)
        assert isinstance(other, Quantity)
        assert abs(one.value - other.value) < 5.0 * np.hypot(one.std, other.std), name


WHOLE = {60_000: 11, 140_000: 22}  # periods of the rest beat, to 0.006 of one: PD0 runs on as if nothing were missing


@pytest.mark.parametrize("snr_db", [35.0, 26.0])
def test_losses_of_whole_periods_of_the_rest_beat_are_found_by_the_moving_one(snr_db: float) -> None:
    recording = without_samples(recording_of(SHORT, snr_db=snr_db), WHOLE)
    motion = demodulate(recording, AnalysisSettings())
    assert {"samples_lost", "gap"} <= set(motion.flags)
    whole = demodulate(recording_of(SHORT, snr_db=snr_db), AnalysisSettings())
    late = slice(-400, -100)
    shared = np.interp(motion.time_s[late], whole.time_s, whole.displacement_m)
    assert np.abs(motion.displacement_m[late] - shared).max() < 5e-9  # was off by fringes, 0.3 um each


def test_beside_a_gap_that_is_known_only_what_was_not_reported_is_found() -> None:
    recording = without_samples(recording_of(SHORT), {60_000: 12, 120_000: 7})
    known = replace(recording, gaps=(Gap(60_000, 12),))
    (found,) = find_losses(known, REST_HZ)
    assert found.samples_lost == 7 and abs(found.sample_start - 119_988) <= 3


def test_a_kink_beside_a_loss_that_is_known_or_found_is_that_loss() -> None:
    """Whole periods of the rest beat are looked for at the others alone."""
    recording = without_samples(recording_of(SHORT), {60_000: 11, 120_000: 22})
    (first, second) = find_losses(recording, REST_HZ, [60_000, 119_989])
    assert (first.samples_lost, second.samples_lost) == (11, 22)
    for near, apart in ((60_000, True), (60_000 + 140, False), (60_000 - 140, False)):  # twice a block of 64
        known = replace(recording, gaps=(Gap(near, 11),))
        found = find_losses(known, REST_HZ, [60_000, 119_989])
        assert [gap.samples_lost for gap in found] == ([22] if apart else [11, 22])
    jumped = without_samples(recording_of(SHORT), {60_000: 3})
    assert len(find_losses(jumped, REST_HZ, [60_050])) == 1


@pytest.mark.parametrize("most", [2, 3])
def test_what_loses_too_often_is_no_digitizer_that_skips(most: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("analysis.signal.losses.MAX_LOSSES", most)
    found = find_losses(without_samples(recording_of(SHORT), {40_000: 1, 80_000: 2, 120_000: 3}), REST_HZ)
    assert len(found) == (3 if most == 3 else 0)
