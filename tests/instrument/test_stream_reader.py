"""The reader of a digitizer, block by block: ring, trigger, thresholds, and what ends or stalls a stream."""

import pickle
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.shot.recording import Channel, Role, Setup
from instrument.capture.stream_reader import CaptureOptions, StreamReader, _check_block, check_settings
from instrument.devices import digitizer
from instrument.devices.digitizer import (
    Block,
    Capabilities,
    CaptureSettings,
    DigitizerError,
    block_samples,
    usual_settings,
)
from instrument.devices.ring import Ring
from instrument.trigger.light_switch import Edge, Level
from tests.instrument.capturing import SETTINGS
from tests.instrument.fake_digitizer import CHANNELS, FIRST, RATE_HZ, FakeDigitizer, samples

OPTIONS = CaptureOptions(Path("anywhere"), SETTINGS)


def _reader(digitizer: FakeDigitizer | None = None, options: CaptureOptions = OPTIONS) -> StreamReader:
    reader = StreamReader(digitizer or FakeDigitizer(), clock=lambda: 0.0)
    reader.start(options.settings or SETTINGS, options)
    return reader


def test_blocks_come_numbered_with_the_step_of_the_switch_in_them() -> None:
    reader = _reader()
    assert reader.switch_level is Level.UNKNOWN and reader.toggles == 0
    at, steps = 0, []
    while at < FIRST + 25_000:
        block = reader.read()
        assert block is not None and block.first == at and not block.ended and not block.fired
        np.testing.assert_array_equal(block.counts, samples(at, len(block.counts)))
        if block.step is not None:
            steps.append(at + block.step)
        at += len(block.counts)
    assert steps == [FIRST, FIRST + 20_000] and reader.toggles == 2 and reader.switch_level is Level.LOW
    low, high = reader.thresholds_v
    assert low is None and high is not None and 0.1 < high < 1.6  # it is low now: only a rise can come


def test_a_switch_whose_level_is_followed_is_read_once_in_20_us_and_a_step_sought_after_it_is_found_to_the_sample() -> (
    None
):
    reader = _reader(options=replace(OPTIONS, switch_low_v=0.5, switch_high_v=0.9))
    assert reader._switch is not None
    read, first_step = [], reader._switch.first_step
    reader._switch.first_step = lambda counts: (read.append(len(counts)), first_step(counts))[1]  # type: ignore[method-assign]
    at = 0
    while reader.toggles == 0:
        block = reader.read(closely=False)
        assert block is not None and block.step is None
        at += len(block.counts)
    assert at > FIRST and sum(read) <= at / (2e-5 * RATE_HZ) + len(read) and reader.switch_level is Level.HIGH
    while (block := reader.read()) is not None and block.step is None:
        pass
    assert block is not None and block.first + block.step == FIRST + 20_000 and reader.toggles == 2


def test_thresholds_are_in_volts_whichever_way_the_channel_counts() -> None:
    options = replace(OPTIONS, switch_low_v=0.5, switch_high_v=0.9)
    for per_count, offset in ((1e-3, 0.0), (1e-3, 0.2), (-1e-3, 1.0)):
        channels = (*CHANNELS[:2], Channel(Role.SWITCH, per_count, offset))
        reader = _reader(FakeDigitizer(channels=channels), options)
        assert reader.thresholds_v == pytest.approx((0.5, 0.9))
    scope = _reader(FakeDigitizer(hardware_trigger=True), options)
    assert scope.thresholds_v == (None, None)
    assert _reader(FakeDigitizer(channels=CHANNELS[:2])).thresholds_v == (None, None)


def test_a_stream_serves_what_neither_its_options_nor_its_ring_rule_out() -> None:
    reader = _reader()
    assert reader.continues(SETTINGS, OPTIONS)
    assert reader.continues(replace(SETTINGS, samples=77_000), replace(OPTIONS, folder=Path("elsewhere")))
    assert reader.stream is not None
    block = block_samples(RATE_HZ)
    most = reader.stream.ring.capacity - 2 * block
    assert reader.continues(replace(SETTINGS, samples=most, pre_trigger_samples=most), OPTIONS)
    for settings, options in (
        (replace(SETTINGS, samples=most + 1, pre_trigger_samples=most + 1), OPTIONS),
        (replace(SETTINGS, sample_rate_hz=2e6), OPTIONS),
        (SETTINGS, replace(OPTIONS, setup=Setup(0.5))),
        (SETTINGS, replace(OPTIONS, edge=Edge.RISING)),
        (SETTINGS, replace(OPTIONS, switch_low_v=0.1)),
        (SETTINGS, replace(OPTIONS, switch_high_v=0.1)),
    ):
        assert not reader.continues(settings, options)
    reader.stop()
    assert not reader.continues(SETTINGS, OPTIONS) and not reader._digitizer.running.is_set()  # type: ignore[attr-defined]
    assert not _reader(FakeDigitizer(max_samples=10**6)).continues(SETTINGS, OPTIONS)


def test_the_ring_holds_the_part_before_the_trigger_and_half_a_second() -> None:
    block = block_samples(RATE_HZ)
    for before in (0, 4_000, 700_000):
        reader = _reader(options=replace(OPTIONS, settings=CaptureSettings(RATE_HZ, 800_000, before)))
        assert reader.stream is not None
        assert before + 0.5 * RATE_HZ <= reader.stream.ring.capacity < before + 0.5 * RATE_HZ + block
        assert reader.stream.ring.capacity % block == 0
    ring = reader.stream.ring
    reader.start(SETTINGS, OPTIONS)
    assert reader.stream.ring is ring  # large enough, and not four times too large
    assert reader.stream is not None and reader.stream.start == ring.total
    reader.start(CaptureSettings(RATE_HZ, 5_000_000, 5_000_000), OPTIONS)
    grown = reader.stream.ring
    assert grown is not ring
    reader.start(SETTINGS, OPTIONS)
    assert reader.stream.ring is not grown


def test_losses_are_noted_before_the_sample_they_precede() -> None:
    reader = _reader(FakeDigitizer(gaps={10_000: 300, 20_000: None}))
    while reader.stream is not None and reader.stream.losses < 2:
        reader.read()
    assert reader.stream is not None
    assert reader.stream.gaps == [(10_000, 300), (20_000 - 300, None)] and reader.stream.lost == 300


def test_a_stream_says_what_its_device_and_its_operator_know() -> None:
    setup = Setup(0.5, rest_frequency_hz=91e3, digitizer_bits=8)
    stream = _reader(options=replace(OPTIONS, setup=setup)).stream
    assert stream is not None and stream.setup == replace(setup, digitizer_bits=12)
    assert (stream.source, stream.channels, stream.settings) == ("fake", CHANNELS, SETTINGS)
    own = _reader().stream
    assert own is not None and own.setup == FakeDigitizer().setup


@pytest.mark.parametrize(
    ("how", "endless", "judged"),
    [
        ({}, True, False),
        ({"real_time": True}, True, True),
        ({"real_time": True, "simulated": True}, True, False),
        ({"real_time": True, "max_samples": 10**6}, False, False),
        ({"real_time": True, "hardware_trigger": True}, False, False),
    ],
)
def test_the_rate_of_an_endless_stream_in_real_time_is_judged(how: dict[str, Any], endless: bool, judged: bool) -> None:
    reader = _reader(FakeDigitizer(**how))
    assert (reader.endless, reader._delivered is not None, reader.running) == (endless, judged, True)
    assert reader.simulated == how.get("simulated", False)
    assert reader.hardware_trigger == how.get("hardware_trigger", False)


def test_a_stream_that_comes_at_half_its_rate_is_doubted_and_one_whose_reader_is_late_is_not() -> None:
    now = [100.0]
    for pace_s, most, doubtful_hz in ((0.01, 5_000, 5e5), (0.005, 5_000, None), (0.01, 40_000, None)):
        digitizer = FakeDigitizer(
            real_time=True, before_block=lambda fake, at, most=most: Block(most) if most > 5_000 else None
        )
        reader = StreamReader(digitizer, clock=lambda: now[0])
        reader.start(SETTINGS, OPTIONS)
        for _ in range(200):
            now[0] += pace_s
            reader.read()
        assert reader.stream is not None
        if doubtful_hz is None and most == 5_000:
            digitizer.gaps[digitizer.at] = None  # a loss of unknown length begins the comparison anew
            reader.read()
        assert reader.stream.doubtful_rate_hz == (None if doubtful_hz is None else pytest.approx(doubtful_hz, rel=1e-2))


@pytest.mark.parametrize(
    ("how", "stalls"), [({}, True), ({"simulated": True}, False), ({"hardware_trigger": True}, False)]
)
def test_a_stream_without_a_sample_for_three_seconds_has_stopped(how: dict[str, Any], stalls: bool) -> None:
    now = [100.0]
    digitizer = FakeDigitizer(before_block=lambda *_: Block(0), **how)
    reader = StreamReader(digitizer, clock=lambda: now[0])
    reader.start(SETTINGS, OPTIONS)
    now[0] = 103.0
    assert reader.read() is None
    now[0] = 103.1
    if stalls:
        with pytest.raises(DigitizerError, match=r"no samples came for 3 s"):
            reader.read()
    else:
        assert reader.read() is None


def test_the_device_s_own_trigger_goes_before_that_of_the_switch() -> None:
    def told(fake: FakeDigitizer, at: int) -> Block | None:
        return Block(200, trigger_sample=7) if at == 30_000 else None

    reader = _reader(FakeDigitizer(before_block=told))
    while (block := reader.read()) is not None and block.first < 30_000:
        assert block.step is None
    assert block is not None and (block.step, len(block.counts)) == (7, 200)
    scope = _reader(FakeDigitizer(hardware_trigger=True))
    for _ in range(12):  # the switch steps on the way
        block = scope.read()
        assert block is not None and block.step is None


def test_a_device_that_says_that_it_fired_has_sent_no_sample_yet() -> None:
    for ended in (False, True):
        reader = _reader(FakeDigitizer(before_block=lambda *_, ended=ended: Block(0, ended=ended, fired=True)))
        ring = reader.stream.ring if reader.stream is not None else None
        block = reader.read()
        assert block is not None and ring is not None
        assert (block.fired, block.ended, block.step, block.lost_before, len(block.counts)) == (True, ended, None, 0, 0)
        assert block.first == ring.total == 0 and ring.oldest == 0  # and no sample in the ring is claimed for it


def test_why_a_switch_has_not_fired_is_told_until_it_has() -> None:
    reader = _reader()
    for _ in range(5):
        reader.read()
    assert reader.why_no_step() == "the light switch moved by 0 counts, a step takes 205"
    given = _reader(options=replace(OPTIONS, switch_low_v=0.5, switch_high_v=0.9))
    given.read()
    assert given.why_no_step() == "the light switch never crossed its thresholds"
    assert _reader(FakeDigitizer(channels=CHANNELS[:2])).why_no_step() == ""
    for one in (reader, given):
        while not one.toggles:
            one.read()
        assert one.why_no_step() == ""


def test_settings_that_no_shot_can_have_arm_nothing_and_a_block_that_cannot_be_is_a_fault() -> None:
    for wrong in (CaptureSettings(RATE_HZ, 0, 0), CaptureSettings(RATE_HZ, 10, 11), CaptureSettings(0.0, 10, 1)):
        digitizer = FakeDigitizer()
        with pytest.raises(DigitizerError, match=r"a shot of|sample rate of"):
            StreamReader(digitizer).start(wrong, OPTIONS)
        assert digitizer.armed == 0
    for nonsense in (Block(10**7), Block(-1), Block(5, lost_before=-3)):
        with pytest.raises(DigitizerError, match="the digitizer sent nonsense: stop it, re-plug it"):
            _reader(FakeDigitizer(before_block=lambda *_, nonsense=nonsense: nonsense)).read()


def test_an_ended_stream_runs_no_more_and_stays_readable() -> None:
    reader = _reader(FakeDigitizer(max_samples=7_000))
    first, last = reader.read(), reader.read()
    assert first is not None and last is not None and not first.ended and last.ended
    assert not reader.running and reader.stream is not None and reader.stream.ring.total == 7_000


@pytest.mark.parametrize(
    ("rate", "total", "before", "fits"),
    [
        (1e12, 1, 0, True),
        (1.001e12, 1, 0, False),
        (0.0, 1, 0, False),
        (-1.0, 1, 0, False),
        (1e6, 0, 0, False),
        (1e6, 10, 10, True),
        (1e6, 10, 11, False),
        (1e6, 10, -1, False),
        (1e6, 2**29, 0, True),
        (1e6, 2**29 + 1, 0, False),
    ],
)
def test_settings_are_refused_beyond_their_limits(rate: float, total: int, before: int, fits: bool) -> None:
    settings = CaptureSettings(rate, total, before)
    if fits:
        check_settings(settings, 2)
    else:
        with pytest.raises(DigitizerError):
            check_settings(settings, 2)


@pytest.mark.parametrize(
    ("per_count", "offset", "fits"),
    [(1e-29, 0, True), (-1e-3, 9e8, True), (9e-31, 0, False), (2e6, 0, False), (1e-3, -1.1e9, False), (0.0, 0, False)],
)
def test_a_scale_that_no_recording_can_hold_is_refused(per_count: float, offset: float, fits: bool) -> None:
    digitizer = FakeDigitizer(channels=(Channel(Role.MEASUREMENT, per_count, offset),))
    if fits:
        _reader(digitizer)
    else:
        with pytest.raises(DigitizerError, match="V per count"):
            _reader(digitizer)
        assert digitizer.armed == 0


def test_usual_settings_are_a_sixth_of_a_second_at_the_fastest_rate_up_to_the_paper_s() -> None:
    class Offers(FakeDigitizer):
        own: CaptureSettings | None = None
        rates: tuple[float, ...] = ()
        most: int | None = None

        @property
        def capabilities(self) -> Any:
            return replace(super().capabilities, rates_hz=self.rates, max_samples=self.most)

        def default_settings(self) -> CaptureSettings | None:
            return self.own

    device = Offers()
    for rates, most, expected in (
        ((1e6, 30e6, 50e6), None, (30e6, 5_000_000, 312_500)),
        ((50e6, 40e6), None, (40e6, 6_666_667, 416_666)),
        ((6e6,), 1_000, (6e6, 1_000, 62)),
    ):
        device.rates, device.most = rates, most
        assert usual_settings(device) == CaptureSettings(*expected)
    device.own = CaptureSettings(2e6, 500, 400)
    assert usual_settings(device) == CaptureSettings(2e6, 500, 400)
    device.most = 300
    assert usual_settings(device) == CaptureSettings(2e6, 300, 300)
    device.own, device.rates = None, ()
    with pytest.raises(DigitizerError, match="no sample rate"):
        usual_settings(device)


@pytest.mark.parametrize(
    ("rate", "expected"), [(1e3, 256), (6.4e3, 256), (1e6, 40_000), (26e6, 1_040_000), (1e8, 1 << 20)]
)
def test_a_block_is_forty_milliseconds_within_its_limits(rate: float, expected: int) -> None:
    assert block_samples(rate) == expected


def test_a_device_that_says_nothing_of_it_is_real_and_loses_nothing_unseen() -> None:
    able = Capabilities("scope", CHANNELS, 8, (), None, hardware_trigger=False, real_time=True)
    assert not able.simulated and able.unseen_loss_s == 0.0
    assert Block(5) == Block(5, lost_before=0, ended=False, trigger_sample=None, fired=False)
    told = Block(5, None, True, 3, True)
    assert pickle.loads(pickle.dumps(told)) == told


@pytest.mark.parametrize(
    ("block", "sound"),
    [
        (Block(0), True),
        (Block(10, None, True, 9), True),
        (Block(11), False),
        (Block(-1), False),
        (Block(5, lost_before=-1), False),
        (Block(5, lost_before=10**12), True),
        (Block(1, trigger_sample=0), True),
        (Block(1, trigger_sample=1), False),
        (Block(0, trigger_sample=0), True),  # an empty block may report that it fired
        (Block(0, trigger_sample=1), False),
        (Block(5, trigger_sample=-1), False),
        (Block(5, trigger_sample=5), False),
    ],
)
def test_a_block_that_cannot_be_is_refused(block: Block, sound: bool) -> None:
    if sound:
        _check_block(block, 10)
    else:
        with pytest.raises(DigitizerError, match="sent nonsense"):
            _check_block(block, 10)


@pytest.mark.parametrize(
    ("setup", "wavelength_m"),
    [
        (Setup(0.01, wavelength_air_m=600e-9, wavelength_vacuum_m=700e-9), 600e-9),
        (Setup(0.01, wavelength_vacuum_m=700e-9, rest_frequency_hz=91e3), 700e-9),
        (Setup(0.01), 632.8e-9),
    ],
)
def test_a_device_without_a_switch_triggers_on_a_block_of_five_centimetres_a_second(
    setup: Setup, wavelength_m: float
) -> None:
    for channels, columns in ((CHANNELS[:2], (1, 0)), (CHANNELS[1::-1], (0, 1)), (CHANNELS[1:2], (0, -1))):
        reader = StreamReader(FakeDigitizer(channels=channels))
        reader.start(SETTINGS, replace(OPTIONS, setup=setup))
        motion = reader._motion
        assert motion is not None and motion._columns == columns and motion._rate_hz == RATE_HZ
        assert motion._doppler_hz == pytest.approx(2 * 0.05 / wavelength_m, rel=1e-6)
        assert motion._rest_hz == (setup.rest_frequency_hz or 0.0)
    for how in ({}, {"channels": CHANNELS[:1]}, {"channels": CHANNELS[:2], "hardware_trigger": True}):
        other = StreamReader(FakeDigitizer(**how))
        other.start(SETTINGS, OPTIONS)
        assert other._motion is None and (other._switch is not None) == (how == {})


@pytest.mark.parametrize(
    ("rate", "block", "before", "blocks"),
    [
        (1e3, 256, 0, 12),  # half a second is two blocks: a reader lags by more
        (1e3, 256, 1, 13),
        (100e6, 1 << 20, 0, 48),  # half a second
        (100e6, 1 << 20, 100_000_000, 128),  # 512 MiB of two channels
        (100e6, 1 << 20, 200_000_000, 199),  # the part before the trigger and eight blocks
    ],
)
def test_a_ring_is_limited_to_512_mib_unless_the_part_before_the_trigger_needs_more(
    rate: float, block: int, before: int, blocks: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[int] = []

    def ring(capacity: int, channels: int) -> SimpleNamespace:
        made.append(capacity)
        return SimpleNamespace(capacity=capacity, channels=channels)

    monkeypatch.setattr(digitizer, "Ring", ring)
    reader = StreamReader(FakeDigitizer(channels=CHANNELS[:2]))
    reader._block = block
    settings = CaptureSettings(rate, 300_000_000, before)
    reader._ring_for(settings, 2)
    assert made == [blocks * block]
    for factor, channels, fits in ((1, 2, True), (4, 2, True), (4.1, 2, False), (0.99, 2, False), (1, 3, False)):
        held = Ring(0, channels)
        held.capacity = round(factor * blocks * block)
        reader.stream = SimpleNamespace(ring=held)  # type: ignore[assignment]
        reader._ring_for(settings, 2)
        assert (len(made) == 1) == fits
        del made[1:]


def test_a_reader_says_that_a_device_is_being_armed_while_it_is_and_no_longer() -> None:
    seen: list[tuple[bool, bool]] = []

    class Slow(FakeDigitizer):
        def arm(self, settings: CaptureSettings) -> None:
            seen.append((reader.starting, reader.running))
            super().arm(settings)

    reader = StreamReader(Slow())
    reader.start(SETTINGS, OPTIONS)
    assert seen == [(True, False)] and not reader.starting and reader.running
    with pytest.raises(DigitizerError, match="the fake knows one rate"):
        reader.start(CaptureSettings(2e6, 100, 10), OPTIONS)
    assert len(seen) == 2 and not reader.starting and not reader.running
