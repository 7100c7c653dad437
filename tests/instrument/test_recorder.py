"""A shot while it comes in: who brings it to disk is woken by every block and by the end."""

import numpy as np
import pytest

from analysis.shot.recording import Channel, Role, Setup
from instrument.capture.recorder import GrowingShot
from instrument.devices.digitizer import CaptureSettings


@pytest.fixture
def shot() -> GrowingShot:
    settings = CaptureSettings(1e6, 100, 20)
    channels = (Channel(Role.SWITCH, 1e-3), Channel(Role.MEASUREMENT, 1e-3))
    counts = np.zeros((100, 2), np.int16)
    return GrowingShot(settings, channels, Setup(17.85e-3), "bench", "2026-01-01T00:00:00Z", 20, counts)


def _woken(shot: GrowingShot) -> bool:
    seen = shot.grown.is_set()
    shot.grown.clear()
    return seen


def test_every_block_and_the_end_wake_the_writer_and_a_loss_does_not(shot: GrowingShot) -> None:
    assert not _woken(shot)
    shot.append(np.ones((30, 2), np.int16))
    assert _woken(shot)
    shot.lost(5)
    assert not _woken(shot)
    shot.append(np.ones((30, 2), np.int16))
    assert _woken(shot) and not shot.complete
    shot.finish("the cable was pulled")
    assert _woken(shot) and shot.complete
    (gap,) = shot.gaps
    assert (gap.sample_start, gap.samples_lost) == (30, 5)


def test_no_more_is_taken_than_was_asked_for(shot: GrowingShot) -> None:
    shot.append(np.full((70, 2), 7, np.int16))
    shot.append(np.full((70, 2), 9, np.int16))
    assert (shot.filled, shot.room) == (100, 0)
    assert shot.counts[[0, 69, 70, 99], 0].tolist() == [7, 7, 9, 9]


@pytest.mark.parametrize(("filled", "short"), [(91, True), (92, False)])
def test_a_shot_that_lacks_more_than_a_tenth_after_its_trigger_is_cut_short(
    shot: GrowingShot, filled: int, short: bool
) -> None:
    """Of the 80 samples after the trigger, 72 are enough."""
    shot.append(np.zeros((filled, 2), np.int16))
    shot.finish("the cable was pulled")
    assert shot.ended_early == ("the cable was pulled" if short else None)
    assert ("cut_short" in shot.recording("a").flags) == short


def test_a_loss_before_the_first_sample_is_no_gap_of_the_shot(shot: GrowingShot) -> None:
    shot.lost(3)
    shot.append(np.zeros((100, 2), np.int16))
    shot.finish()
    assert shot.gaps == [] and shot.ended_early is None and shot.recording("a").flags == ()


def test_the_levels_about_a_step_are_measured_over_50_us_at_least_32_samples() -> None:
    """The middle of a slow step; an earlier pulse, beyond twice that reach, does not count."""
    for rate, reach in ((1e6, 50), (1e5, 32)):
        settings = CaptureSettings(rate, 1000, 200)
        counts = np.zeros((1000, 1), np.int16)
        counts[500:, 0] = 1000
        counts[480:520, 0] = np.linspace(0, 1000, 40)
        counts[200 : 484 - 2 * reach, 0] = 2000
        shot = GrowingShot(settings, (Channel(Role.SWITCH, 1e-3),), Setup(0.01), "bench", "", 485, counts, filled=1000)
        shot.finish()
        assert shot.trigger_sample == pytest.approx(500, abs=1), rate


def test_a_shot_tells_of_its_capture_only_what_there_is_to_tell(shot: GrowingShot) -> None:
    capture = {"source": "bench", "samples": 100, "pre_trigger_samples": 20}
    assert shot.extra == {"global": {"lmm:capture": capture}} and shot.recording("a").flags == ()
    shot.unseen_loss_s, shot.doubtful_rate_hz = 2e-3, 9e5
    shot.append(np.zeros((10, 2), np.int16))
    shot.lost(None)
    shot.append(np.zeros((5, 2), np.int16))
    shot.finish("pulled")
    own = {
        "lmm:capture": capture | {"unseen_loss_s": 2e-3},
        "lmm:delivered_rate_hz": 9e5,
        "lmm:ended_early": "pulled",
    }
    assert shot.extra == {"global": own}
    recording = shot.recording("b")
    assert recording.flags == ("gap", "cut_short", "rate_contradicted") and recording.trigger_sample is None
    assert (recording.samples, recording.name, recording.extra) == (15, "b", shot.extra)
    assert not recording.counts.flags.writeable
