"""The check of a source's signals without a screen."""

import numpy as np
import pytest

from analysis.shot.recording import Channel, Recording, Role, Setup
from instrument.devices.digitizer import Block, DigitizerError
from instrument.devices.doctor import Grade
from instrument.devices.replay import ReplayDigitizer
from instrument.live.setup_check import try_signals
from tests.instrument.fake_digitizer import FakeDigitizer


def test_a_stream_is_watched_and_every_toggle_counted() -> None:
    now = [0.0]

    def tick(fake: FakeDigitizer, at: int) -> Block | None:
        now[0] = at / 1e6
        return None

    digitizer = FakeDigitizer(before_block=tick)
    lines = {check.name: check.line for check in try_signals(digitizer, 0.2, lambda: now[0])}
    assert "beat at 0.0910 MHz" in lines["PD0"] and "beat at 0.0910 MHz" in lines["PD1"]
    assert "toggled 6 times" in lines["light switch"]
    assert not digitizer.running.is_set()


def test_a_shot_of_a_device_that_triggers_itself_is_judged() -> None:
    n = np.arange(40_000)
    counts = np.rint(1500 * np.sin(2 * np.pi * 0.1 * n))[:, None].astype(np.int16)
    setup = Setup(0.01785, rest_frequency_hz=1e6, digitizer_bits=12)
    shot = Recording("s", counts, 1e7, (Channel(Role.MEASUREMENT, 1e-3),), setup, trigger_sample=5_000)
    replay = ReplayDigitizer([shot], real_time=False)
    assert replay.capabilities.hardware_trigger
    grades = {check.name: check.grade.value for check in try_signals(replay)}
    assert grades == {"PD1": "ok", "rest frequency": "ok"}


def test_a_device_that_sends_nothing_is_said() -> None:
    now = [0.0]

    def silence(fake: FakeDigitizer, at: int) -> Block:
        now[0] += 0.5
        return Block(0)

    with pytest.raises(DigitizerError, match=r"fake sent no samples in 3 s: fire its trigger, and check its cables"):
        try_signals(FakeDigitizer(before_block=silence), clock=lambda: now[0])


@pytest.mark.parametrize(("sent", "judged"), [(511, False), (512, True)])
def test_a_sixteenth_of_what_is_checked_is_enough_to_judge_a_stream_that_ends(sent: int, judged: bool) -> None:
    digitizer = FakeDigitizer(max_samples=sent)
    if judged:
        assert [check.name for check in try_signals(digitizer)] == ["PD0", "PD1", "light switch", "rest frequency"]
    else:
        with pytest.raises(DigitizerError, match=r"fake sent no samples in 3 s"):
            try_signals(digitizer)


def test_a_device_that_triggers_itself_has_twenty_seconds_and_whatever_fails_it_is_stopped() -> None:
    now, asked = [0.0], []

    class Silent(FakeDigitizer):
        def read_into(self, buffer: np.ndarray, timeout_s: float) -> Block:
            asked.append((buffer.shape, timeout_s))
            now[0] += 0.5
            return super().read_into(buffer, timeout_s)

    silent = Silent(hardware_trigger=True, before_block=lambda *_: Block(0))
    with pytest.raises(DigitizerError, match="fake sent no samples before its trigger: fire its trigger, and check"):
        try_signals(silent, clock=lambda: now[0])
    assert now[0] == 20.0 and set(asked) == {((1 << 17, 3), 0.05)} and not silent.running.is_set()

    def unplugged(fake: FakeDigitizer, at: int) -> Block:
        raise DigitizerError("unplugged")

    broken = FakeDigitizer(before_block=unplugged)
    with pytest.raises(DigitizerError, match="unplugged"):
        try_signals(broken)
    assert broken.armed == 1 and not broken.running.is_set()


def test_a_beat_that_is_gone_at_the_end_is_told_though_it_was_there_before() -> None:
    now = [0.0]

    class Darkened(FakeDigitizer):
        def read_into(self, buffer: np.ndarray, timeout_s: float) -> Block:
            block = super().read_into(buffer, timeout_s)
            now[0] = self.at / 1e6
            if now[0] > 0.9:
                buffer[: block.samples, 1] = 0
            return block

    grades = {check.name: check.grade for check in try_signals(Darkened(), 1.0, lambda: now[0])}
    assert grades["PD0"] is Grade.OK and grades["PD1"] is Grade.FAIL


@pytest.mark.parametrize("simulated", [True, False])
def test_a_busy_computer_delays_a_simulated_device_and_no_other(simulated: bool) -> None:
    """On one that compiled something else the bench was told to check its cables."""
    now = [0.0]

    def late(fake: FakeDigitizer, at: int) -> Block | None:
        now[0] += 0.5 if now[0] < 10.0 else 0.05
        return Block(0) if now[0] < 10.0 else None

    digitizer = FakeDigitizer(before_block=late, simulated=simulated)
    if simulated:
        assert {check.name for check in try_signals(digitizer, 0.2, lambda: now[0])} >= {"PD0", "PD1"}
        assert now[0] == pytest.approx(10.2, abs=0.11)
    else:
        with pytest.raises(DigitizerError, match=r"no samples in 0\.2 s"):
            try_signals(digitizer, 0.2, lambda: now[0])


@pytest.mark.parametrize("rests_from_s", [0.3, 0.36, 0.5])
def test_a_block_that_rests_for_a_quarter_of_the_watch_is_found_at_rest(rests_from_s: float) -> None:
    """The operator may let go of the block, or stop it, while its signals are watched."""
    now = [0.0]

    class Handled(FakeDigitizer):
        def read_into(self, buffer: np.ndarray, timeout_s: float) -> Block:
            n = self.at + np.arange(5_000)
            block = super().read_into(buffer, timeout_s)
            moves = np.flatnonzero((n[: block.samples] < 1e6 * rests_from_s) | (n[: block.samples] >= end))
            buffer[moves, 1] = np.rint(1500 * np.sin(2 * np.pi * 0.15 * n[moves]))
            now[0] = self.at / 1e6
            return block

    end = 1e6 * (rests_from_s + 0.25)
    grades = {check.name: check.grade for check in try_signals(Handled(), 1.0, lambda: now[0])}
    assert grades["rest frequency"] is Grade.OK
