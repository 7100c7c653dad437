"""A digitizer in a subprocess: the same samples, gaps and faults, and its end is always noticed."""

import errno
import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from instrument.background import worker_process
from instrument.bench.digitizer import BenchDigitizer
from instrument.capture.acquisition import State
from instrument.capture.capture import Capture
from instrument.capture.stream_reader import CaptureOptions
from instrument.devices.digitizer import Block, CaptureSettings, Digitizer, DigitizerError
from instrument.files.recording_file import open_recording
from instrument.process import device_process, shared_ring, subprocess_digitizer
from instrument.process.subprocess_digitizer import SubprocessDigitizer, open_in_subprocess
from tests.child import child_id
from tests.instrument.devices.scpi_emulator import EmulatedScope, TcpScope
from tests.instrument.fake_digitizer import FIRST, RATE_HZ, FakeDigitizer, samples
from tests.instrument.process import devices

ONE = CaptureSettings(RATE_HZ, 20_000, 2_000)


@pytest.fixture
def opened() -> Iterator[Callable[..., SubprocessDigitizer]]:
    """Open digitizers that are closed at the test's end."""
    living: list[SubprocessDigitizer] = []

    def open_one(opener: Callable[[], Digitizer]) -> SubprocessDigitizer:
        living.append(SubprocessDigitizer(opener))
        return living[-1]

    yield open_one
    for digitizer in living:
        digitizer.close()
        assert child_id(digitizer) is None


def read(digitizer: Digitizer, buffer: np.ndarray, limit_s: float = 10.0) -> Block:
    """Return the next block that brings something."""
    end = time.monotonic() + limit_s
    while time.monotonic() < end:
        block = digitizer.read_into(buffer, 0.2)
        if block.samples or block.ended:
            return block
    raise AssertionError("no block came")


def gone(process: int) -> bool:
    """Return whether a process has ended."""
    try:
        state = Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()[0]
    except OSError:
        return True
    return state == "Z"


def until(true: Callable[[], bool], limit_s: float = 20.0) -> None:
    """Wait until ``true`` holds."""
    end = time.monotonic() + limit_s
    while not true():
        assert time.monotonic() < end, "it never came true"
        time.sleep(0.01)


def test_the_samples_gaps_and_end_are_those_of_the_device_however_they_are_read(opened):
    digitizer = opened(partial(FakeDigitizer, gaps={10_000: 77, 30_077: None}, max_samples=40_000))
    assert digitizer.capabilities == FakeDigitizer(max_samples=40_000).capabilities
    assert digitizer.setup.moving_mass_kg == 0.01785
    digitizer.prepare()
    assert digitizer.default_settings() is None
    digitizer.arm(ONE)
    at, came, losses, ended = 0, 0, [], False
    rng = np.random.default_rng(3)
    while not ended:
        buffer = np.empty((int(rng.integers(1, 7_000)), 3), np.int16)
        block = read(digitizer, buffer)
        if block.lost_before != 0:
            losses.append((came, block.lost_before))
            at += block.lost_before or 1_234
        assert np.array_equal(buffer[: block.samples], samples(at, block.samples))
        at, came, ended = at + block.samples, came + block.samples, block.ended
    assert came == 40_000
    assert losses == [(10_000, 77), (30_000, None)]
    assert digitizer.read_into(buffer, 0.0) == Block(0, ended=True)
    digitizer.arm(ONE)
    assert read(digitizer, buffer).samples > 0


def test_a_refusal_to_open_is_the_device_s_own_sentence():
    with pytest.raises(DigitizerError) as refusal:
        SubprocessDigitizer(devices.refused)
    assert (refusal.value.what, refusal.value.remedy) == ("no such device is plugged in", "plug it in")
    with pytest.raises(DigitizerError, match=r"unexpected: .*a bug"):
        SubprocessDigitizer(devices.broken)


def test_a_child_that_ends_at_once_is_told_and_leaves_no_pipe_open(monkeypatch):
    """The window keeps the error, and with it whatever the error still holds."""
    ends = []

    class Context:
        @staticmethod
        def Pipe(duplex):
            ends.extend(multiprocessing.Pipe(duplex))
            return ends[-2:]

        @staticmethod
        def Process(**how):
            return SimpleNamespace(start=int, pid=1, join=lambda s: None, is_alive=bool, exitcode=3, close=int)

    monkeypatch.setattr(worker_process.multiprocessing, "get_context", lambda kind: Context)
    with pytest.raises(DigitizerError, match=r"ended by itself .status 3."):
        device_process.DeviceProcess(FakeDigitizer, lambda: False, 5.0)
    assert len(ends) == 4 and all(end.closed for end in ends)


def test_a_source_is_named_as_anywhere_and_a_recording_is_played_here(tmp_path):
    with pytest.raises(DigitizerError, match="unknown source"):
        open_in_subprocess("frequency counter")
    with pytest.raises(DigitizerError, match="nothing to replay"):
        open_in_subprocess(f"replay:{tmp_path / 'none'}")


def test_a_refused_arming_and_an_unplugging_are_said_and_the_next_arming_recovers(opened):
    digitizer = opened(devices.Unplugged)
    child = child_id(digitizer)
    buffer = np.empty((4_000, 3), np.int16)
    with pytest.raises(DigitizerError) as refusal:
        digitizer.arm(ONE)
    assert (refusal.value.what, refusal.value.remedy) == ("the device is busy", "wait")
    digitizer.arm(ONE)
    came = []
    with pytest.raises(DigitizerError, match="unplugged: plug it in, then arm again"):
        while True:
            block = read(digitizer, buffer)
            came.append(buffer[: block.samples].copy())
    assert np.array_equal(np.concatenate(came), samples(0, 5_000)), "what came before is delivered"
    digitizer.arm(ONE)
    assert read(digitizer, buffer).samples > 0
    assert child_id(digitizer) == child


def test_a_parent_that_stands_still_loses_nothing_silently(opened, monkeypatch):
    monkeypatch.setattr(subprocess_digitizer, "AHEAD_S", 0.05)
    digitizer = opened(partial(devices.Leaky, 0.02))
    digitizer.arm(ONE)
    buffer = np.empty((30_000, 3), np.int16)
    at = lost = 0
    stood = False
    while lost < 0.1 * RATE_HZ:
        if at > 0.05 * RATE_HZ and not stood:
            stood = True
            time.sleep(1.6)  # 0.4 s of the device's: the ring holds four blocks, 0.16 s, the device 0.02 s
        block = read(digitizer, buffer)
        at, lost = at + block.lost_before, lost + block.lost_before
        assert np.array_equal(buffer[: block.samples], samples(at, block.samples))
        at += block.samples
        assert at < RATE_HZ, "more was lost than was said"


@pytest.mark.parametrize(("simulated", "lag_s"), [(False, 1.5), (True, 0.5)])
def test_memory_for_a_parent_that_lags_is_for_devices_that_do_not_wait(opened, simulated, lag_s):
    digitizer = opened(partial(FakeDigitizer, real_time=True, simulated=simulated))
    digitizer.arm(ONE)
    assert digitizer._ring.ahead == pytest.approx(lag_s * RATE_HZ, abs=0.04 * RATE_HZ)


def test_standing_still_for_less_than_the_ring_costs_nothing(opened):
    digitizer = opened(partial(devices.Leaky, 0.1))
    digitizer.arm(ONE)
    buffer = np.empty((30_000, 3), np.int16)
    at, stood = 0, False
    while at < 0.5 * RATE_HZ:
        if at > 0.05 * RATE_HZ and not stood:
            stood = True
            time.sleep(0.8)  # twice what the device holds
        block = read(digitizer, buffer)
        assert block.lost_before == 0
        assert np.array_equal(buffer[: block.samples], samples(at, block.samples))
        at += block.samples


def test_a_stop_reaches_a_driver_that_reads(opened):
    digitizer = opened(partial(devices.Deaf, hears=True))
    digitizer.arm(ONE)
    threading.Timer(0.2, digitizer.stop).start()
    begun = time.monotonic()
    assert read(digitizer, np.empty((100, 3), np.int16)) == Block(0, ended=True)
    assert time.monotonic() - begun < 3.0
    digitizer.arm(ONE)  # the child is free for it


def test_a_driver_that_hangs_is_told_and_left_behind(opened, monkeypatch):
    monkeypatch.setattr(subprocess_digitizer, "ANSWER_S", 0.5)
    digitizer = opened(partial(devices.Deaf, hears=False))
    child = child_id(digitizer)
    digitizer.arm(ONE)
    with pytest.raises(DigitizerError, match="does not answer"):
        read(digitizer, np.empty((100, 3), np.int16))
    assert gone(child)
    digitizer.arm(ONE)
    assert child_id(digitizer) not in (None, child)


def test_a_child_that_dies_is_told_and_the_next_arming_starts_another(opened, tmp_path):
    digitizer = opened(partial(devices.Crashing, tmp_path / "mark"))
    buffer = np.empty((4_000, 3), np.int16)
    digitizer.arm(ONE)
    with pytest.raises(DigitizerError, match=r"ended by itself .killed by signal 9.: arm again"):
        read(digitizer, buffer)
    digitizer.stop()  # harmless
    digitizer.arm(ONE)
    assert np.array_equal(buffer[: read(digitizer, buffer).samples], samples(0, 4_000))


def test_closing_does_not_wait_for_a_preparation(opened):
    digitizer = opened(devices.slow_to_prepare)
    preparing = threading.Thread(target=digitizer.prepare)
    preparing.start()
    time.sleep(0.1)
    begun = time.monotonic()
    digitizer.close()
    preparing.join(1.0)
    assert not preparing.is_alive()
    assert time.monotonic() - begun < 15.0
    with pytest.raises(DigitizerError, match="was closed"):
        digitizer.arm(ONE)


def test_closing_does_not_wait_for_an_arming(opened, monkeypatch):
    monkeypatch.setattr(subprocess_digitizer, "ANSWER_S", 0.2)
    digitizer = opened(devices.slow_to_arm)
    threading.Timer(0.2, digitizer.stop).start()
    begun = time.monotonic()
    with pytest.raises(DigitizerError, match="given up: arm again"):
        digitizer.arm(ONE)
    assert time.monotonic() - begun < 10.0


def test_what_is_simulated_may_be_late(opened, monkeypatch):
    monkeypatch.setattr(subprocess_digitizer, "ANSWER_S", 0.2)
    bench = opened(BenchDigitizer)
    bench.arm(CaptureSettings(10e6, 20_000, 2_000))
    buffer = np.empty((20_000, 3), np.int16)
    assert read(bench, buffer).samples > 0
    child = child_id(bench)
    os.kill(child, signal.SIGSTOP)  # as good as starved by other programs
    while bench.read_into(buffer, 0.1).samples:  # what had come before
        pass
    for _ in range(8):
        assert bench.read_into(buffer, 0.1).samples == 0
    os.kill(child, signal.SIGCONT)
    assert read(bench, buffer).samples > 0 and child_id(bench) == child


def test_no_memory_is_one_line(opened, monkeypatch):
    def none_left(name: str, size: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(shared_ring, "_reserve", none_left)
    digitizer = opened(FakeDigitizer)
    with pytest.raises(DigitizerError, match=r"MB of shared memory cannot be had .No space left on device."):
        digitizer.arm(ONE)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="looks into /proc and /dev/shm")
def test_a_killed_parent_leaves_no_child_and_no_memory():
    command = [sys.executable, "-m", "tests.instrument.process.parent"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as parent:
        assert parent.stdout is not None
        try:
            child = int(parent.stdout.readline())
            assert not gone(child)
            mapped = Path(f"/proc/{child}/maps").read_text().splitlines()
        finally:  # else it streams on and is waited for
            parent.kill()
    shared = [line for line in mapped if "/dev/shm/" in line and "/sem." not in line]
    assert shared, "the child has the memory"
    assert all(line.endswith("(deleted)") for line in shared), "the memory has no name while it is used"
    until(lambda: gone(child))


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="looks into /proc")
def test_closing_gives_the_memory_back(opened):
    """A window that changes its source often may keep closed digitizers alive for a while."""
    digitizer = opened(FakeDigitizer)
    digitizer.arm(ONE)
    ring = digitizer._ring.key[0].lstrip("/")
    mapped = Path("/proc/self/maps")
    assert ring in mapped.read_text()
    digitizer.close()
    assert ring not in mapped.read_text()


def test_a_shot_is_captured_through_it(opened, tmp_path):
    said: list[str] = []
    digitizer = opened(FakeDigitizer)
    with Capture(digitizer, CaptureOptions(tmp_path, ONE), live=False, say=said.append) as capture:
        capture.arm()
        until(lambda: capture.latest().shots == 1 and capture.latest().state is State.IDLE)
        path = capture.latest().finished[-1].path
    recording = open_recording(path)
    first = FIRST - ONE.pre_trigger_samples
    offset = recording.trigger_sample - ONE.pre_trigger_samples
    assert abs(offset) <= 1
    period = samples(first, ONE.samples)[:, 2]
    assert np.array_equal(np.asarray(recording.counts)[:, 2] > 800, period > 800)
    assert said == []


def test_an_oscilloscope_s_shot_is_fetched_and_given_up_through_it():
    scope = EmulatedScope("rigol", polls_until_trigger=1)
    with TcpScope(scope) as server:
        digitizer = open_in_subprocess(f"scpi:127.0.0.1:{server.port}?channels=1,2")
        try:
            settings = digitizer.default_settings()
            assert settings is not None
            digitizer.arm(settings)
            buffer, counts, ended, at = np.empty((100_000, 2), np.int16), [], False, None
            while not ended:
                block = read(digitizer, buffer)
                if block.trigger_sample is not None:
                    at = sum(map(len, counts)) + block.trigger_sample
                counts.append(buffer[: block.samples].copy())
                ended = block.ended
            whole = np.concatenate(counts)
            assert whole.shape == (settings.samples, 2)
            assert np.array_equal(whole[:, 0], scope.codes(1).astype(int) - 128)
            assert at == settings.pre_trigger_samples

            scope.polls_until_trigger = 10**9
            digitizer.arm(settings)
            threading.Timer(0.2, digitizer.stop).start()
            assert read(digitizer, buffer) == Block(0, ended=True)
        finally:
            digitizer.close()
