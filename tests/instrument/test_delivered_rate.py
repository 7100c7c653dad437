"""The rate of the samples by the computer's clock: a wrong rate makes all speeds wrong."""

import time
from pathlib import Path

import pytest

from app.words.flags import FLAGS
from instrument.capture.acquisition import State
from instrument.devices.digitizer import Block
from instrument.files.recording_file import read_recording
from instrument.live.stream import DeliveredRate
from tests.instrument.capturing import Capturing, until
from tests.instrument.fake_digitizer import RATE_HZ, FakeDigitizer


def after(
    seconds: float, share: float, *, waits: bool = False, stall_s: float = 0.0, lost: int | None = 0
) -> float | None:
    """Return what is doubted of a stream that brought ``share`` of its rate for so long."""
    rate, block = DeliveredRate(1e6), 10_000
    for k in range(round(seconds * share / 0.01) + 1):
        now = 5.0 + 0.01 * k / share + (stall_s if k > 20 else 0.0)
        rate.add(block, lost if k == 30 else 0, now, waits=waits)
    return rate.doubtful_hz


@pytest.mark.parametrize("share", [0.5, 0.8, 2.0])
def test_a_device_at_another_rate_is_told(share: float) -> None:
    assert after(4.0, share) == pytest.approx(share * 1e6, rel=0.01)


def test_a_percent_is_told_once_it_is_more_than_a_driver_may_be_late() -> None:
    assert after(60.0, 0.99) == pytest.approx(0.99e6, rel=1e-3)
    assert after(60.0, 1.01) == pytest.approx(1.01e6, rel=1e-3)


def test_a_device_at_its_rate_is_not() -> None:
    assert after(4.0, 1.0) is None
    assert after(600.0, 1.0001) is None  # a crystal is right to parts in ten thousand
    assert after(0.9, 0.5) is None  # too short to tell
    assert after(4.0, 1.0, stall_s=0.2) is None  # a driver that was late
    assert after(4.0, 0.5, waits=True) is None  # the computer is late


@pytest.mark.parametrize(
    ("passed_s", "off_s", "told"),
    [
        (10.0, 0.304, False),  # 0.3 s that a driver may be late, and 5e-4 of the time
        (10.0, 0.306, True),
        (10.0, -0.304, False),
        (10.0, -0.306, True),
        (1000.0, 0.79, False),
        (1000.0, 0.81, True),
        (0.99, 0.5, False),  # too short to tell
        (1.0, 0.5, True),
    ],
)
def test_a_rate_is_doubted_from_where_neither_a_driver_nor_a_crystal_can_be_so_far_off(
    passed_s: float, off_s: float, told: bool
) -> None:
    rate = DeliveredRate(1e6)
    rate.add(77_000, 0, 5.0, waits=False)  # the first block only starts the clock
    came = round((passed_s - off_s) * 1e6)
    rate.add(came - 1000, 1000, 5.0 + passed_s, waits=False)
    assert rate.doubtful_hz == (pytest.approx(came / passed_s) if told else None)
    rate.add(round(off_s * 1e6), 0, 5.0 + passed_s, waits=False)
    assert rate.doubtful_hz is None  # it came after all
    rate.add(10**9, None, 100.0, waits=False)  # a loss of unknown length: begun anew
    rate.add(2_000_000, 0, 102.0, waits=False)
    assert rate.doubtful_hz is None


def test_what_was_lost_and_said_counts_as_delivered() -> None:
    assert after(4.0, 1.0, stall_s=1.0) is not None
    assert after(4.0, 1.0, stall_s=1.0, lost=1_000_000) is None


def test_the_recording_of_a_half_delivering_device_says_so(tmp_path: Path) -> None:
    begun: list[float] = []

    def half(_fake: FakeDigitizer, at: int) -> Block | None:
        """Let samples of 1 MS/s come at half of that."""
        begun.append(time.monotonic() - 2.0 * at / RATE_HZ)
        time.sleep(max(0.0, begun[0] + 2.0 * at / RATE_HZ - time.monotonic()))
        return None

    with Capturing(tmp_path, FakeDigitizer(before_block=half, real_time=True), live=False) as rig:
        until(rig.capture, lambda s: s.signal.samples_read > 0.8 * RATE_HZ)
        rig.capture.arm()
        shot = until(rig.capture, lambda s: bool(s.finished)).finished[0]
        until(rig.capture, lambda s: s.state is State.IDLE)
    assert shot.path is not None
    recording = read_recording(shot.path)
    assert "rate_contradicted" in recording.flags and "rate_contradicted" in FLAGS
    assert 0.0 < recording.extra["global"]["lmm:delivered_rate_hz"] < 0.6 * RATE_HZ  # a busy one is later still
