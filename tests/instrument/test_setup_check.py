"""The checks of the guided set-up on synthetic signals."""

from typing import Any

import numpy as np
import pytest

from analysis.reading.site import read_site
from analysis.shot.recording import Channel, Role
from instrument.bench.frame import frame_of
from instrument.bench.site import Site
from instrument.devices.doctor import Grade
from instrument.live.live_view import ChannelSignal
from instrument.live.setup_check import CHECKED_SAMPLES, check_signals, judge, judge_site

RATE_HZ = 30e6
BITS = 12
VOLTS = 1.0 / 2048
PD0, PD1, SWITCH = (Channel(role, VOLTS) for role in (Role.REFERENCE, Role.MEASUREMENT, Role.SWITCH))


def _beat(frequency_hz: float, amplitude_v: float, noise_v: float = 0.005, n: int = 1 << 15) -> np.ndarray:
    rng = np.random.default_rng(int(frequency_hz))
    volts = amplitude_v * np.sin(2 * np.pi * frequency_hz / RATE_HZ * np.arange(n)) + rng.normal(0, noise_v, n)
    return np.clip(np.round(volts / VOLTS), -2048, 2047).astype(np.int16)


def _verdicts(
    *columns: tuple[Channel, np.ndarray], toggles: int = 0, rest_frequency_hz: float | None = None
) -> dict[str, tuple[str, str]]:
    channels = tuple(channel for channel, _ in columns)
    counts = np.stack([values for _, values in columns], axis=1)[-CHECKED_SAMPLES:]
    signals = check_signals(counts, channels, RATE_HZ, BITS)
    checks = judge(signals, RATE_HZ, toggles, rest_frequency_hz)
    return {c.name: (c.grade.value, c.line) for c in checks}


def test_a_good_rig_is_ok_throughout() -> None:
    switch = np.where(np.arange(1 << 15) < 20_000, 1800, 100).astype(np.int16)
    found = _verdicts((PD0, _beat(2.7301e6, 0.5)), (PD1, _beat(2.7299e6, 0.4)), (SWITCH, switch), toggles=1)
    assert [grade for grade, _ in found.values()] == ["ok"] * 4
    assert found["PD0"][1].startswith("beat at 2.730")
    assert "0.5 V (50 % of the range)" in found["PD0"][1]
    assert "toggled 1 time" in found["light switch"][1]


@pytest.mark.parametrize(
    ("values", "grade", "line"),
    [
        (_beat(2.73e6, 0.0), "fail", "no beat above the noise"),
        (_beat(2.73e6, 1.5), "fail", "lower the gain or the light"),
        (_beat(2.73e6, 0.3, noise_v=0.15), "warn", "weak against the noise"),
        (_beat(2.73e6, 0.02, noise_v=0.0005), "warn", "small for this range"),
        (_beat(13.1e6, 0.5), "warn", "close to half the sample rate"),
    ],
)
def test_each_fault_is_told_with_its_remedy(values: np.ndarray, grade: str, line: str) -> None:
    found = _verdicts((PD0, values), (PD1, _beat(2.73e6, 0.5)))
    assert found["PD0"][0] == grade
    assert line in found["PD0"][1]


def test_a_beat_elsewhere_asks_for_the_block_and_the_cable() -> None:
    found = _verdicts((PD0, _beat(2.73e6, 0.5)), (PD1, _beat(3.1e6, 0.5)))
    assert found["rest frequency"][0] == "warn"
    assert "+370.0 kHz" in found["rest frequency"][1]


def test_without_pd0_the_rest_frequency_must_be_given() -> None:
    switch = np.full(1 << 15, 100, np.int16)
    found = _verdicts((SWITCH, switch), (PD1, _beat(2.73e6, 0.5)))
    assert found["rest frequency"] == ("fail", "no channel carries PD0: give the rest frequency")
    assert found["light switch"][0] == "warn"
    assert judge([_signal(role=Role.SWITCH)], RATE_HZ, 2)[0].line == "at 0.50 V, toggled 2 times"
    known = _verdicts((SWITCH, switch), (PD1, _beat(2.73e6, 0.5)), rest_frequency_hz=2.731e6, toggles=3)
    assert known["rest frequency"][0] == "ok"
    assert known["light switch"] == ("ok", "at 0.05 V, toggled 3 times")


def test_the_site_is_judged_by_what_it_costs():
    rate = 2500.0
    time_s = np.arange(round(2 * rate)) / rate
    still = frame_of(Site(third_octave_m_per_s=4e-7), 1).motion(time_s)[1]
    calm = judge_site(read_site(still, rate))
    assert calm.grade is Grade.OK and "meets VC-G" in calm.line
    pump = judge_site(read_site(still + 5e-5 * np.sin(2 * np.pi * 24.9 * time_s), rate))
    assert pump.grade is Grade.WARN and "pump" in pump.line and "24.9 Hz costs you a factor" in pump.line


@pytest.mark.parametrize("n", [64, 1001, CHECKED_SAMPLES])
def test_channels_checked_side_by_side_give_what_each_gives_alone(n):
    switch = np.where(np.arange(n) < 0.6 * n, 1800, 100).astype(np.int16)
    channels = Channel(Role.SWITCH, VOLTS, 0.1), PD0, Channel(Role.MEASUREMENT, -VOLTS)
    counts = np.stack((switch, _beat(2.7301e6, 1.1, n=n), _beat(2.7299e6, 0.2, 0.1, n=n)), axis=1)
    together = check_signals(counts, channels, RATE_HZ, BITS)
    for column, signal in enumerate(together):
        alone = check_signals(counts[:, column : column + 1], channels[column : column + 1], RATE_HZ, BITS)
        assert (signal,) == alone
    of_switch, reference, measurement = together
    assert of_switch.amplitude_v == pytest.approx(np.median(switch) * VOLTS + 0.1)
    assert (of_switch.clipped_fraction, measurement.clipped_fraction) == (0.0, 0.0)
    at_rail = (counts[:, 1] == 2047) | (counts[:, 1] == -2048)
    assert reference.clipped_fraction == np.mean(at_rail) > 0.05
    assert measurement.amplitude_v == pytest.approx(np.sqrt(2) * counts[:, 2].std() * VOLTS, rel=1e-12)
    if n > 64:  # else the line covers too much of the noise
        assert measurement.snr_db == pytest.approx(10 * np.log10(0.5 * 0.2**2 / 0.1**2), abs=1.0)


def test_one_sample_at_the_end_of_the_range_is_counted():
    for rail in (2047, -2048):
        counts = _beat(2.73e6, 0.5, n=CHECKED_SAMPLES)
        counts[77] = rail
        (signal,) = check_signals(counts[:, None], (PD1,), RATE_HZ, BITS)
        assert signal.clipped_fraction == 1 / CHECKED_SAMPLES


def test_a_switch_without_beats_is_checked():
    (signal,) = check_signals(np.full((64, 1), 100, np.int16), (SWITCH,), RATE_HZ, BITS)
    assert signal.amplitude_v == pytest.approx(100 * VOLTS) and signal.frequency_hz is None


def _signal(**other: object) -> ChannelSignal:
    good: dict[str, Any] = {
        "role": Role.REFERENCE, "amplitude_v": 0.5, "range_v": 1.0, "clipped_fraction": 0.0, "frequency_hz": 2.73e6,
        "snr_db": 40.0,
    }  # fmt: skip
    return ChannelSignal(**good | other)


@pytest.mark.parametrize(
    ("just_good", "just_not", "grade", "line"),
    [
        ({"clipped_fraction": 0.01}, {"clipped_fraction": 0.011}, "fail", "clipped in 1.1 % of the samples"),
        ({}, {"clipped_fraction": 1e-4}, "warn", "clips now and then"),
        ({"snr_db": 15.0}, {"snr_db": 14.9}, "warn", "weak against the noise"),
        ({"amplitude_v": 0.0501}, {"amplitude_v": 0.0499}, "warn", "small for this range"),
        ({"frequency_hz": 11.99e6}, {"frequency_hz": 12.01e6}, "warn", "close to half the sample rate"),
        ({}, {"frequency_hz": None}, "fail", "no beat above the noise"),
        ({}, {"snr_db": None}, "fail", "no beat above the noise"),
    ],
)
def test_a_beat_is_good_up_to_its_limits(just_good: dict, just_not: dict, grade: str, line: str) -> None:
    (good,) = judge([_signal(**just_good)], RATE_HZ, 0)
    (bad,) = judge([_signal(**just_not)], RATE_HZ, 0)
    assert line not in good.line and (bad.grade.value, line in bad.line) == (grade, True)


def test_two_faults_are_told_together_and_a_falling_channel_has_the_same_range() -> None:
    counts, channels = np.zeros((64, 2), np.int16), (PD0, Channel(Role.MEASUREMENT, -VOLTS))
    assert [signal.range_v for signal in check_signals(counts, channels, RATE_HZ, BITS)] == [1.0, 1.0]
    (both,) = judge([_signal(snr_db=3.0, amplitude_v=0.01)], RATE_HZ, 0)
    assert both.line == (
        "beat at 2.7300 MHz, 0.01 V (1 % of the range), 3 dB; weak against the noise: align the beams; "
        "small for this range: raise the gain"
    )
    assert both.grade is Grade.WARN and both.name == "PD0"
    (wide,) = judge([_signal(range_v=4.0)], RATE_HZ, 0)
    assert wide.line == "beat at 2.7300 MHz, 0.5 V (12 % of the range), 40 dB"


@pytest.mark.parametrize(("shift_hz", "grade"), [(20e3, "ok"), (-20e3, "ok"), (20.1e3, "warn"), (-20.1e3, "warn")])
def test_a_block_in_a_hand_is_near_the_rest_frequency(shift_hz: float, grade: str) -> None:
    moving = _signal(role=Role.MEASUREMENT, frequency_hz=2.73e6 + shift_hz)
    checks = judge([_signal(), moving], RATE_HZ, 0)
    assert (checks[-1].name, checks[-1].grade.value) == ("rest frequency", grade)
    assert f"PD1 is {shift_hz / 1e3:+.1f} kHz from" in checks[-1].line
    # PD0 goes before a frequency that is given; without its beat there is nothing to compare with
    assert judge([_signal(), moving], RATE_HZ, 0, 9e6)[-1] == checks[-1]
    none = judge([_signal(frequency_hz=None), moving], RATE_HZ, 0, 2.73e6)
    assert [check.name for check in none] == ["PD0", "PD1"]


@pytest.mark.parametrize("frequency_hz", [1.234567e6, 2.73e6, 11.1e6])
def test_frequency_and_strength_of_a_line_are_those_that_were_put_in(frequency_hz: float) -> None:
    (signal,) = check_signals(_beat(frequency_hz, 0.4, 0.04, CHECKED_SAMPLES)[:, None], (PD1,), RATE_HZ, BITS)
    assert signal.frequency_hz == pytest.approx(frequency_hz, abs=0.05 * RATE_HZ / CHECKED_SAMPLES)
    assert signal.snr_db == pytest.approx(10 * np.log10(0.4**2 / 2 / 0.04**2), abs=0.4)


@pytest.mark.parametrize("snr_db", [-2.0, -4.0])
def test_a_line_3_db_below_the_noise_is_still_one(snr_db: float) -> None:
    amplitude = 0.1 * np.sqrt(2) * 10 ** (snr_db / 20)
    (signal,) = check_signals(_beat(2.73e6, amplitude, 0.1, CHECKED_SAMPLES)[:, None], (PD1,), RATE_HZ, BITS)
    assert (signal.frequency_hz is not None) == (signal.snr_db is not None) == (snr_db > -3.0)


def test_a_slow_drift_is_no_beat_and_a_flat_channel_has_none() -> None:
    drift = 1000 * np.sin(2 * np.pi * np.arange(CHECKED_SAMPLES) / CHECKED_SAMPLES)
    noise = np.random.default_rng(1).normal(0.0, 3.0, CHECKED_SAMPLES)
    for counts in (drift + noise, np.full(CHECKED_SAMPLES, 5.0)):
        (signal,) = check_signals(np.round(counts).astype(np.int16)[:, None], (PD1,), RATE_HZ, BITS)
        assert signal.frequency_hz is None and signal.snr_db is None
