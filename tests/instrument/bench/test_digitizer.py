"""The simulated rig as a digitizer: pace, loss, stop, pushes, and reproducible counts."""

import threading
import time
from types import SimpleNamespace

import numpy as np
import pytest

from instrument.bench import digitizer, rig
from instrument.bench.digitizer import BenchDigitizer
from instrument.bench.optics import Optics
from instrument.bench.rig import Bench
from instrument.bench.site import site_named
from instrument.devices.digitizer import CaptureSettings, DigitizerError
from instrument.devices.sources import open_source

RATE = 10e6
SETTINGS = CaptureSettings(RATE, 600_000, 60_000)


class Clock:
    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now


def _read(bench, samples, block=100_000):
    parts = []
    while sum(map(len, parts)) < samples:
        buffer = np.empty((min(block, samples - sum(map(len, parts))), len(bench.capabilities.channels)), np.int16)
        got = bench.read_into(buffer, 1.0)
        assert got.lost_before == 0 and got.samples > 0
        parts.append(buffer[: got.samples].copy())
    return np.concatenate(parts)


def _fast(**more):
    return BenchDigitizer(real_time=False, first_push_s=0.05, push_every_s=0.2, **more)


def test_a_push_crosses_the_switch_and_the_beat_rises():
    bench = _fast()
    bench.arm(SETTINGS)
    counts = _read(bench, 5_000_000)
    high = counts[:, 2] > 1000
    first = int(np.argmax(high))
    assert 0.05 < first / RATE < 0.5
    assert not high[: first - 100].any()
    piece = counts[first - 20_000 : first, 1].astype(float)
    spectrum = np.abs(np.fft.rfft((piece - piece.mean()) * np.hanning(piece.size)))
    beat = np.argmax(spectrum) * RATE / piece.size
    shift = beat - Optics().rest_frequency_hz
    assert 0.22 * 2 / 632.8e-9 < shift < 0.31 * 2 / 632.8e-9  # 0.265 m/s and what a hand is off by


def test_a_flight_is_computed_as_finely_whatever_the_hand_needs(monkeypatch):
    """Before the release and after the catch the path has few nodes; in between it has to show every bounce."""
    counts = []
    for held_s in (rig.HELD_NODES_S, rig.FLIGHT_NODES_S):
        monkeypatch.setattr(rig, "HELD_NODES_S", held_s)
        bench = _fast()
        bench.arm(SETTINGS)
        counts.append(_read(bench, 6_000_000))
    coarse, fine = (of.astype(int) for of in counts)
    first = int(np.argmax(fine[:, 2] > 1000))  # the block passes the switch, and strikes the plate a millisecond later
    flight = slice(first - 20_000, first + 300_000)
    assert np.array_equal(coarse[flight], fine[flight])
    held = slice(0, 500_000)
    assert not np.array_equal(coarse[held], fine[held]) and np.abs(coarse[held] - fine[held]).max() <= 1


def test_however_it_is_read_the_counts_are_the_same():
    one, other = _fast(), _fast()
    one.arm(SETTINGS)
    other.arm(SETTINGS)
    assert np.array_equal(_read(one, 1_500_000, 64_001), _read(other, 1_500_000, 700_000))


def test_each_arm_brings_another_push_and_each_seed_another_sequence():
    bench, again, other = _fast(), _fast(), _fast(rig=Bench(seed=2))
    shots = {}
    for name, source in (("bench", bench), ("again", again), ("other", other)):
        for arm in range(2):
            source.arm(SETTINGS)
            counts = _read(source, 5_000_000)
            shots[name, arm] = int(np.argmax(counts[:, 2] > 1000))
    assert shots["bench", 0] == shots["again", 0] and shots["bench", 1] == shots["again", 1]
    assert len({shots["bench", 0], shots["bench", 1], shots["other", 0]}) == 3


def test_real_time_gives_no_more_than_the_clock_allows():
    clock = Clock()
    bench = BenchDigitizer(clock=clock)
    bench.arm(SETTINGS)
    clock.now += 0.03
    buffer = np.empty((1_000_000, 3), np.int16)
    got = bench.read_into(buffer, 0.0)
    assert got.samples == pytest.approx(0.03 * RATE, abs=1) and got.lost_before == 0
    assert bench.read_into(buffer, 0.0).samples == 0


def test_samples_that_are_not_fetched_in_time_are_lost_and_counted():
    clock = Clock()
    bench = BenchDigitizer(clock=clock, memory_s=0.05)
    bench.arm(SETTINGS)
    clock.now += 0.2
    buffer = np.empty((1_000_000, 3), np.int16)
    got = bench.read_into(buffer, 0.0)
    assert got.samples == pytest.approx(0.05 * RATE, abs=1)
    assert got.lost_before == pytest.approx(0.15 * RATE, abs=1)
    unbroken = BenchDigitizer(real_time=False)
    unbroken.arm(SETTINGS)
    end = got.lost_before + got.samples
    assert np.array_equal(buffer[: got.samples], _read(unbroken, end)[got.lost_before :])
    clock.now += 0.01
    assert bench.read_into(buffer, 0.0).lost_before == 0


def test_a_patient_rig_runs_slow_where_the_computer_does_and_loses_nothing(monkeypatch):
    clock = Clock()
    bench = BenchDigitizer(clock=clock, memory_s=0.05, patient=True)
    make = bench._make

    def slowly(base, out):
        clock.now += 1.0  # for a chunk of some ms
        return make(base, out)

    monkeypatch.setattr(bench, "_make", slowly)
    bench.arm(SETTINGS)
    buffer = np.empty((1_000_000, 3), np.int16)
    parts = []
    for _ in range(4):
        clock.now += 0.2
        got = bench.read_into(buffer, 0.0)
        assert got.lost_before == 0 and 0 < got.samples <= 0.05 * RATE + 1
        parts.append(buffer[: got.samples].copy())
    unbroken = BenchDigitizer(real_time=False)
    unbroken.arm(SETTINGS)
    assert np.array_equal(np.concatenate(parts), _read(unbroken, sum(map(len, parts))))


def test_stop_from_another_thread_ends_a_read_that_waits():
    bench = BenchDigitizer(clock=lambda: 0.0)
    bench.arm(SETTINGS)
    buffer = np.empty((1000, 3), np.int16)
    threading.Timer(0.05, bench.stop).start()
    before = time.monotonic()
    got = bench.read_into(buffer, 20.0)
    assert time.monotonic() - before < 5.0
    assert got.ended and got.samples == 0


def test_a_stop_while_a_long_block_is_computed_does_not_wait_for_the_rest_of_it(monkeypatch):
    """A block of many chunks takes as long to compute; what was computed by then is delivered."""
    bench = _fast()
    bench.arm(SETTINGS)
    make = bench._make

    def stopped(base, out):
        bench.stop()
        make(base, out)

    monkeypatch.setattr(bench, "_make", stopped)
    buffer = np.empty((1_000_000, 3), np.int16)
    got = bench.read_into(buffer, 1.0)
    assert got.ended and 0 < got.samples < len(buffer) / 2
    unbroken = _fast()
    unbroken.arm(SETTINGS)
    assert np.array_equal(buffer[: got.samples], _read(unbroken, got.samples))


def test_a_block_that_nobody_pushes_stands_still():
    bench = BenchDigitizer(real_time=False, push_every_s=0.0)
    bench.arm(SETTINGS)
    assert not (_read(bench, 5_000_000)[:, 2] > 1000).any()


def test_what_it_cannot_do_is_refused_in_one_line():
    bench = BenchDigitizer()
    with pytest.raises(DigitizerError, match="not armed"):
        bench.read_into(np.empty((10, 3), np.int16), 0.0)
    with pytest.raises(DigitizerError, match="1 MS/s"):
        bench.arm(CaptureSettings(1e6, 1000, 0))
    with pytest.raises(DigitizerError, match="pre-trigger"):
        bench.arm(CaptureSettings(RATE, 1000, 2000))
    bench.arm(SETTINGS)
    with pytest.raises(DigitizerError, match="shape"):
        bench.read_into(np.empty((10, 2), np.int16), 0.0)
    bench.close()
    bench.close()
    with pytest.raises(DigitizerError, match="closed"):
        bench.arm(SETTINGS)


def test_two_channels_and_eight_bits():
    bench = _fast(rig=Bench(optics=Optics(bits=8, with_switch=False)))
    bench.arm(SETTINGS)
    counts = _read(bench, 200_000)
    assert counts.shape[1] == 2 and bench.setup.digitizer_bits == 8
    assert -128 <= counts.min() < -80 and 80 < counts.max() <= 127
    assert bench.capabilities.bits == 8 and not bench.capabilities.hardware_trigger


def test_a_block_is_pushed_after_0_8_s_and_3_s_after_each_return_in_samples_that_are_not_computed_yet(monkeypatch):
    asked = []

    class Stage:
        shots = 7

        def __init__(self, rig, rate_hz, first_shot):
            self.of = rig, rate_hz, first_shot

        def push(self, time_s):
            asked.append((time_s, bench._next_sample / RATE))
            return SimpleNamespace(end_s=time_s + 1.1)

        def fill(self, first, out):
            out[:] = first // 200_000

    monkeypatch.setattr(digitizer, "SimulatedStream", Stage)
    bench = BenchDigitizer(real_time=False, first_shot=5)
    bench.arm(SETTINGS)
    assert bench._stage.of == (bench._rig, RATE, 5)
    buffer = np.empty((1_000_000, 3), np.int16)
    for _ in range(90):
        bench.read_into(buffer, 0.0)
    assert [time_s for time_s, _ in asked] == pytest.approx([0.8, 4.9, 9.0], abs=1e-9)
    for time_s, begun_s in asked:
        assert time_s - 0.04 - 1e-9 <= begun_s < time_s - 0.02 + 1e-9
    bench.arm(SETTINGS)
    assert bench._stage.of[2] == 7  # the sequence of pushes goes on


def test_what_a_first_push_needs_is_compiled_beforehand_without_touching_the_stream(monkeypatch):
    done = []

    class Stage(rig.SimulatedStream):
        def push(self, time_s):
            done.append(("push", time_s))
            return super().push(time_s)

        def fill(self, first_sample, out):
            at = (first_sample + 1) / RATE
            flies = any(pushed.release_s <= at <= pushed.caught_s for pushed in self._pushed)
            done.append(("fill", flies, out.shape))
            super().fill(first_sample, out)

    monkeypatch.setattr(digitizer, "SimulatedStream", Stage)
    bench = BenchDigitizer(real_time=False)
    bench.prepare()
    assert done == [("push", 0.8), ("fill", True, (200_000, 3))] and bench._stage is None
    bench.arm(SETTINGS)
    plain = BenchDigitizer(real_time=False)
    plain.arm(SETTINGS)
    assert np.array_equal(_read(bench, 300_000), _read(plain, 300_000))


def test_a_source_is_the_rig_that_its_options_describe():
    bench = open_source("bench?speed=0.35&added=0.05&first=3&seed=4&site=VC-D&effect=tilt:angle_rad=1e-4")
    assert bench._rig == Bench(
        effects={"tilt": {"angle_rad": 1e-4}}, site=site_named("VC-D"), seed=4, velocity_m_per_s=0.35,
        velocity_spread=0.02, added_kg=0.05,
    )  # fmt: skip
    assert (bench._patient, bench._shots, bench._real_time) == (True, 3, True)
    plain = open_source("bench")
    assert plain._rig == Bench() and plain._shots == 0
    able = plain.capabilities
    assert (able.name, able.bits, able.rates_hz) == ("Simulated bench", 12, (10e6, 15e6, 20e6, 30e6))
    assert (able.max_samples, able.hardware_trigger, able.real_time, able.simulated) == (None, False, True, True)
    assert plain.setup == Bench().setup and plain.setup.moving_mass_kg == 17.85e-3
    assert plain._memory_s == 0.5 and (plain._first_push_s, plain._push_every_s) == (0.8, 3.0)


@pytest.mark.parametrize(("rate", "sampled"), [(8e6, True), (7.99e6, False), (60e6, True), (60.1e6, False)])
def test_a_rate_must_resolve_the_beat_of_a_fast_block(rate, sampled):
    bench = BenchDigitizer()
    if sampled:
        bench.arm(CaptureSettings(rate, 1, 1))
    else:
        with pytest.raises(DigitizerError, match=r"cannot sample at .* MS/s: choose 8 to 60 MS/s"):
            bench.arm(CaptureSettings(rate, 1, 1))
    for samples, before in ((0, 0), (5, -1), (5, 6)):
        with pytest.raises(DigitizerError, match=r"pre-trigger|cannot sample"):
            bench.arm(CaptureSettings(rate, samples, before))


def test_a_reader_is_given_a_whole_block_or_what_came_by_its_deadline():
    now, waits = [100.0], []
    bench = BenchDigitizer(clock=lambda: now[0])
    bench.arm(SETTINGS)

    class Stop:
        def wait(self, seconds):
            waits.append(seconds)
            now[0] += seconds
            return False

        def is_set(self):
            return False

    bench._stop = Stop()
    buffer = np.empty((1_000_000, 3), np.int16)
    assert bench.read_into(buffer, 1.0).samples == pytest.approx(400_000, abs=5)  # 40 ms
    assert waits == [pytest.approx(0.04, abs=1e-6)]
    assert bench.read_into(buffer, 0.01).samples == pytest.approx(100_000, abs=5)
    assert bench.read_into(buffer[:1000], 1.0).samples == 1000
    now[0] += 0.3
    assert bench.read_into(buffer, 1.0).samples == 1_000_000  # what waits fills the buffer
    for wrong in (buffer[:, :2], buffer[0], buffer.astype(np.int32)):
        with pytest.raises(DigitizerError, match="for 3 channels of int16"):
            bench.read_into(wrong, 0.0)
