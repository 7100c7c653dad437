"""Replay as a digitizer: every sample once, gaps as data, paced by the clock."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from analysis.shot.recording import Gap, Recording, Role
from instrument.devices.digitizer import Block, CaptureSettings, DigitizerError
from instrument.devices.replay import ReplayDigitizer
from instrument.files.recording_writer import write_recording


def play(digitizer: ReplayDigitizer, length: int = 1_700) -> tuple[np.ndarray, list[Block]]:
    """Return everything played since ``arm`` and the blocks it came in."""
    buffer = np.empty((length, len(digitizer.capabilities.channels)), np.int16)
    parts, blocks = [], []
    while True:
        block = digitizer.read_into(buffer, 1.0)
        parts.append(buffer[: block.samples].copy())
        blocks.append(block)
        if block.ended:
            return np.concatenate(parts), blocks


def test_all_samples_come_once_and_gaps_begin_a_block(shot: Recording) -> None:
    digitizer = ReplayDigitizer([shot], real_time=False)
    settings = digitizer.default_settings()
    assert settings == CaptureSettings(30e6, 20_000, 5_000)
    assert not digitizer.capabilities.hardware_trigger
    for _ in range(2):  # from the first again after the last
        digitizer.arm(settings)
        counts, blocks = play(digitizer)
        np.testing.assert_array_equal(counts, shot.counts)
        starts = np.cumsum([0, *(b.samples for b in blocks)])[:-1]
        lost = {int(s): b.lost_before for s, b in zip(starts, blocks, strict=True) if b.lost_before != 0}
        assert lost == {12_000: 77, 15_000: None}
        assert digitizer.read_into(np.empty((10, 3), np.int16), 0.1) == Block(0, ended=True)


def test_without_a_light_switch_the_kept_trigger_is_the_hardware_s(shot: Recording) -> None:
    two = replace(shot, counts=np.ascontiguousarray(shot.counts[:, :2]), channels=shot.channels[:2], gaps=())
    digitizer = ReplayDigitizer([two], real_time=False)
    assert digitizer.capabilities.hardware_trigger
    digitizer.arm(digitizer.default_settings())
    _, blocks = play(digitizer, 1_024)
    at = [(i, b.trigger_sample) for i, b in enumerate(blocks) if b.trigger_sample is not None]
    assert at == [(5_000 // 1_024, 5_000 % 1_024)]


def test_real_time_follows_the_clock(shot: Recording) -> None:
    now = [10.0]
    digitizer = ReplayDigitizer(
        [replace(shot, gaps=())], clock=lambda: now[0], sleep=lambda s: now.__setitem__(0, now[0] + s)
    )
    digitizer.arm(digitizer.default_settings())
    buffer = np.empty((4_000, 3), np.int16)
    came = 0
    for _ in range(200):
        block = digitizer.read_into(buffer, 0.05)
        came += block.samples
        assert came <= (now[0] - 10.0) * 30e6 + 0.6
        if block.ended:
            break
    assert block.ended
    assert now[0] - 10.0 == pytest.approx(20_000 / 30e6, rel=0.2)
    digitizer.arm(digitizer.default_settings())
    assert digitizer.read_into(buffer, 0.0).samples == 0  # nothing is due yet, and it returns


def test_stop_ends_and_a_wrong_rate_is_refused(shot: Recording) -> None:
    digitizer = ReplayDigitizer([shot])
    with pytest.raises(DigitizerError, match="samples/s"):
        digitizer.arm(CaptureSettings(1e6, 100, 0))
    digitizer.arm(CaptureSettings(30e6, 100, 0))
    digitizer.stop()
    digitizer.stop()
    assert digitizer.read_into(np.empty((10, 3), np.int16), 0.1) == Block(0, ended=True)
    digitizer.close()


def test_a_folder_is_played_in_order_and_broken_ones_are_named(shot: Recording, tmp_path: Path) -> None:
    write_recording(shot, tmp_path / "shot-1")
    write_recording(replace(shot, sample_rate_hz=10e6), tmp_path / "shot-2")
    (tmp_path / "shot-0.sigmf-meta").write_text("{")
    digitizer = ReplayDigitizer([tmp_path], real_time=False)
    names = []
    for _ in range(2):
        names.append(digitizer.capabilities.name)
        digitizer.arm(digitizer.default_settings())
        play(digitizer)
    assert names == ["replay of shot-1", "replay of shot-2"]
    with pytest.raises(DigitizerError, match=r"shot-0.*not JSON"):
        digitizer.default_settings()
    assert digitizer.capabilities.name == "replay of shot-1" and digitizer.setup == shot.setup
    assert digitizer.capabilities.channels[2].role is Role.SWITCH
    two = ReplayDigitizer([tmp_path / "shot-0.sigmf-meta", tmp_path / "shot-2.sigmf-meta"])
    assert two.capabilities.name == "replay of shot-2"
    with pytest.raises(DigitizerError, match=r"shot-0.*not JSON.*: replay another recording"):
        ReplayDigitizer([tmp_path / "shot-0.sigmf-meta"])
    with pytest.raises(DigitizerError, match="nothing to replay"):
        ReplayDigitizer([])
    with pytest.raises(DigitizerError, match="no such file"):
        ReplayDigitizer([tmp_path / "none"])


def test_a_replay_waits_for_half_of_what_is_wanted_and_for_no_longer_than_it_may(shot: Recording) -> None:
    now, slept = [10.0], []

    def sleep(seconds: float) -> None:
        slept.append(seconds)
        now[0] += seconds

    slow = replace(shot, sample_rate_hz=1000.0, gaps=(), trigger_sample=None)
    digitizer = ReplayDigitizer([slow], clock=lambda: now[0], sleep=sleep)
    able = digitizer.capabilities
    assert (able.bits, able.rates_hz, able.max_samples, able.real_time) == (12, (1000.0,), 20_000, False)
    assert digitizer.default_settings() == CaptureSettings(1000.0, 20_000, 0)
    digitizer.arm(digitizer.default_settings())
    buffer = np.empty((4_000, 3), np.int16)
    assert digitizer.read_into(buffer, 5.0).samples == 2_000 and slept == [2.0]
    assert digitizer.read_into(buffer, 0.5).samples == 500 and slept == pytest.approx([2.0, 0.5])
    now[0] = 29.9995  # to the nearest sample; a reader that is late loses none
    for wanted in (4_000, 4_000, 4_000, 4_000, 1_500):
        assert digitizer.read_into(buffer, 0.0).samples == wanted
    assert len(slept) == 2 and digitizer.read_into(buffer, 0.0) == Block(0, ended=True)


def test_losses_at_one_place_are_one_and_of_unknown_length_if_one_of_them_is(shot: Recording) -> None:
    gaps = (Gap(0, 4), Gap(100, 5), Gap(100, 6), Gap(300, 5), Gap(300, None))
    digitizer = ReplayDigitizer([replace(shot, gaps=gaps)], real_time=False)
    digitizer.arm(digitizer.default_settings())
    _, blocks = play(digitizer, 20_000)
    assert [(block.samples, block.lost_before) for block in blocks] == [(100, 4), (200, 11), (19_700, None)]
