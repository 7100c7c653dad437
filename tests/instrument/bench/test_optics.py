"""Photodiodes and switch: frequency, sign, amplitude, noise, steps, rails, and when the switch fires."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from scipy.stats import norm

from analysis.shot.recording import Role
from instrument.bench.optics import (
    FLIGHT_NODES_S,
    HELD_NODES_S,
    DropOut,
    Optics,
    Path,
    _turns_modulo_one,
    fill,
    node_times_s,
)
from instrument.bench.sines import path_vibration

RATE = 10e6


def _counts(optics, velocity=0.0, start=0.0, samples=200_000, first=0, seed=1):
    time = node_times_s(first, samples, RATE)
    x = start + velocity * time
    out = np.empty((samples, len(optics.roles)), np.int16)
    clipped = fill(optics, Path(time, x, np.full_like(x, velocity), x), first, RATE, seed, out)
    return out, clipped


def _beat(column, frequency):
    """Return amplitude, frequency (Hz), offset and residual rms of a steady beat, by least squares."""
    n = column.size
    time = np.arange(n) / RATE
    z = np.cumsum(column * np.exp(-2j * np.pi * frequency * time) * np.hanning(n))
    halves = np.array([z[n // 2], z[-1] - z[n // 2]])
    frequency += np.angle(halves[1] / halves[0]) / (2 * np.pi) / (time[-1] * 0.37)  # a first correction, refined:
    for _ in range(4):
        a = np.c_[np.cos(2 * np.pi * frequency * time), np.sin(2 * np.pi * frequency * time), np.ones(n)]
        a = np.c_[a, time[:, None] * a[:, :2]]
        c = np.linalg.lstsq(a, column, rcond=None)[0]
        frequency += (c[4] * c[0] - c[3] * c[1]) / (c[0] ** 2 + c[1] ** 2) / (2 * np.pi)
    rest = column - a @ c
    return np.hypot(c[0], c[1]), frequency, c[2], rest.std()


@pytest.mark.parametrize("velocity", [-0.265, 0.0, 0.262])
def test_doppler_shift_has_the_sign_of_the_physics(velocity):
    optics = Optics()
    out, _ = _counts(optics, velocity, start=5e-3)
    expected = optics.rest_frequency_hz - 2 * velocity / optics.wavelength_m  # inward (v < 0): above the rest beat
    _, frequency, _, _ = _beat(out[:, 1].astype(float), expected)
    assert frequency == pytest.approx(expected, abs=0.2)


@pytest.mark.parametrize("spacing_s", [FLIGHT_NODES_S, HELD_NODES_S])
def test_between_its_nodes_the_beat_follows_speed_acceleration_and_jerk(spacing_s):
    optics = Optics(bits=16, reference_snr_db=200.0, measurement_snr_db=200.0, with_switch=False)
    samples = 10_000
    speed, acceleration, jerk = 0.2, 500.0, 1.5e6
    time = node_times_s(0, samples, RATE, spacing_s)
    out = np.empty((samples, 2), np.int16)
    x = speed * time + acceleration * time**2 / 2 + jerk * time**3 / 6
    fill(optics, Path(time, x, speed + acceleration * time + jerk * time**2 / 2, x), 0, RATE, 1, out)
    t = np.arange(samples) / RATE
    moved = speed * t + acceleration * t**2 / 2 + jerk * t**3 / 6
    turns = optics.rest_frequency_hz * t - 2 * moved / optics.wavelength_m
    volts = np.stack(
        (
            optics.reference_offset_v + optics.reference_v * np.cos(2 * np.pi * optics.rest_frequency_hz * t),
            optics.measurement_offset_v + optics.measurement_v * np.cos(2 * np.pi * turns),
        ),
        axis=1,
    )
    assert np.abs(out - volts / optics.volts_per_count).max() < 0.55  # half a step, and 3e-7 of the amplitude


@pytest.mark.parametrize(("order", "with_reference"), [(2, True), (1, False)])
def test_counts_are_the_beats_of_all_light_and_the_edge_of_the_switch(order, with_reference):
    """Against the sum of cosines, 25 s into the stream: drifting laser, light in the wrong arm, half of it lost."""
    optics = Optics(
        bits=16, reference_snr_db=200.0, measurement_snr_db=200.0, switch_noise_v=0.0, rest_drift_hz_per_s=300.0,
        leak_m=5e-9, leak_order=order, leak_turns=0.15, with_reference=with_reference,
        drop_outs=(DropOut(25.0002, 25.0004, 0.4),),
    )  # fmt: skip
    first, samples, speed = 250_000_000, 10_000, -0.3
    node_s = node_times_s(first, samples, RATE)
    x, block = 1e-3 + speed * (node_s - 25.0), optics.switch_m + 2e-5 + speed * (node_s - 25.0005)
    out = np.empty((samples, len(optics.roles)), np.int16)
    fill(optics, Path(node_s, x, np.full_like(x, speed), block), first, RATE, 1, out)
    t = np.arange(samples) / RATE
    rest = 2.73e6 * t + 2.73e6 * 25 % 1.0 + 0.5 * 300.0 * (25.0 + t) ** 2
    path = 2 * (1e-3 + speed * t) / optics.wavelength_m
    leak = 4 * np.pi * 5e-9 / optics.wavelength_m
    lit = np.interp(t, node_s - 25.0, optics.light(node_s))
    beat = np.cos(2 * np.pi * (rest - path)) + leak * np.cos(2 * np.pi * (rest + (order - 1) * path + 0.15))
    volts = [
        optics.reference_offset_v + optics.reference_v * np.cos(2 * np.pi * rest),
        optics.measurement_offset_v + optics.measurement_v * lit * beat,
        # 10 % and 90 % of the swing lie an edge apart
        optics.switch_low_v
        + (optics.switch_high_v - optics.switch_low_v)
        * norm.cdf(-(2e-5 + speed * (t - 0.0005)) / (optics.switch_edge_m / (2 * norm.ppf(0.9)))),
    ]
    expected = np.stack(volts[0 if with_reference else 1 :], axis=1) / optics.volts_per_count
    assert np.abs(out - expected).max() < 1.0  # half a step, and what float32 leaves of 16 bits
    assert optics.light(np.array([25.0001, 25.0002, 25.0003, 25.0004])).tolist() == [1.0, 0.4, 0.4, 1.0]


def test_the_phase_of_a_beat_is_exact_after_days():
    for sample in (0, 7, 10**9, 3 * 10**13):
        turns = _turns_modulo_one(2.73e6, sample, 30e6)  # 91 turns in a thousand samples
        assert turns == pytest.approx(91 * sample % 1000 / 1000, abs=1e-15)
    assert _turns_modulo_one(0.1, 10**13, 1.0) == float(Fraction(0.1) * 10**13 % 1)  # 0.1 is no tenth


def test_amplitude_offset_and_noise_are_as_stated():
    optics = Optics()
    out, clipped = _counts(optics)
    assert clipped == (0, 0, 0)
    for column, volts, offset, snr in (
        (0, optics.reference_v, optics.reference_offset_v, optics.reference_snr_db),
        (1, optics.measurement_v, optics.measurement_offset_v, optics.measurement_snr_db),
    ):
        amplitude, _, mean, sigma = _beat(out[:, column].astype(float), optics.rest_frequency_hz)
        assert amplitude * optics.volts_per_count == pytest.approx(volts, rel=1e-3)
        assert mean * optics.volts_per_count == pytest.approx(offset, abs=1e-4)
        white = sigma**2 - 1 / 12  # rounding adds its own
        assert 10 * np.log10(amplitude**2 / 2 / white) == pytest.approx(snr, abs=0.1)


def test_noise_is_white_and_normal():
    loud = Optics(reference_v=0.5, reference_snr_db=0.0, rest_frequency_hz=1e-3, range_v=8.0)
    out, _ = _counts(loud, samples=400_000)
    noise = out[:, 0] - out[:, 0].mean()
    noise = noise / noise.std()
    n = noise.size
    for lag in (1, 2, 3, 150):
        assert abs(np.mean(noise[lag:] * noise[:-lag])) < 5 / np.sqrt(n)
    assert abs(np.mean(noise**3)) < 5 * np.sqrt(15 / n)
    assert np.mean(noise**4) == pytest.approx(3.0, abs=0.03)
    assert 4.0 < np.abs(noise).max() < 6.0


def test_the_noise_of_each_channel_is_its_own():
    loud = Optics(
        reference_v=0.5, reference_snr_db=0.0, measurement_v=0.5, measurement_snr_db=0.0, rest_frequency_hz=1e-3,
        switch_noise_v=0.3, range_v=8.0,
    )  # fmt: skip
    out, _ = _counts(loud, samples=400_000)
    noise = (out - out.mean(axis=0)) / out.std(axis=0)
    for one, other in ((0, 1), (0, 2), (1, 2)):
        for lag in (0, 1, 2):
            assert abs(np.mean(noise[lag:, one] * noise[: len(noise) - lag, other])) < 5 / np.sqrt(len(noise))


@pytest.mark.parametrize("bits", [8, 10, 12, 14])
def test_steps_and_rails_of_the_digitizer(bits):
    optics = replace(Optics(), bits=bits, reference_v=1.2)
    out, clipped = _counts(optics)
    low, high = -(2 ** (bits - 1)), 2 ** (bits - 1) - 1
    assert out[:, 0].min() == low and out[:, 0].max() == high
    assert clipped[0] > 1000 and clipped[1] == 0
    assert clipped[0] == pytest.approx(np.sum((out[:, 0] == low) | (out[:, 0] == high)), rel=0.15)
    assert optics.volts_per_count * 2**bits == pytest.approx(2 * optics.range_v)


def test_switch_fires_where_the_flag_crosses_and_opens_again():
    optics = Optics()
    speed, samples = 0.265, 300_000
    time = node_times_s(0, samples, RATE)
    x = 3e-3 - speed * time
    x = np.where(time > 0.015, x[np.searchsorted(time, 0.015)] + speed * (time - 0.015), x)
    out = np.empty((samples, 3), np.int16)
    fill(optics, Path(time, x, np.gradient(x, time), x), 0, RATE, 1, out)
    level = out[:, 2] * optics.volts_per_count
    middle = 0.5 * (optics.switch_low_v + optics.switch_high_v)
    inside = np.convolve(level, np.ones(51) / 51, "same") > middle
    edges = np.flatnonzero(np.diff(inside.astype(int)))
    expected = [(3e-3 - optics.switch_m) / speed, 0.03 - (3e-3 - optics.switch_m) / speed]
    assert edges / RATE == pytest.approx(expected, abs=1e-6)
    rising = level[edges[0] - 2000 : edges[0] + 2000]
    smooth = np.convolve(rising, np.ones(21) / 21, "same")[20:-20]
    swing = optics.switch_high_v - optics.switch_low_v
    width = np.sum((smooth > optics.switch_low_v + 0.1 * swing) & (smooth < optics.switch_low_v + 0.9 * swing)) / RATE
    assert width * speed == pytest.approx(optics.switch_edge_m, rel=0.05)


def test_the_same_counts_however_they_are_cut():
    optics = Optics(rest_drift_hz_per_s=40.0, leak_m=2e-9, leak_order=2)
    whole, _ = _counts(optics, -0.2, 4e-3, 60_000)
    for first, samples in ((0, 7), (13_350, 20_001), (59_900, 100)):
        part, _ = _counts(optics, -0.2, 4e-3, samples, first)
        assert np.abs(part.astype(int) - whole[first : first + samples]).max() <= 1  # float steps may round apart
        assert np.mean(part != whole[first : first + samples]) < 1e-3


def test_another_seed_is_another_noise():
    one, _ = _counts(Optics(), samples=1000)
    same, _ = _counts(Optics(), samples=1000)
    other, _ = _counts(Optics(), samples=1000, seed=2)
    assert np.array_equal(one, same) and not np.array_equal(one, other)


def test_a_drop_out_leaves_noise_alone():
    optics = Optics(drop_outs=(DropOut(0.005, 0.01),))
    out, _ = _counts(optics)
    assert out[60_000:90_000, 1].std() < 0.05 * out[:40_000, 1].std()


def test_channels_that_are_not_recorded_are_not_there():
    optics = Optics(with_reference=False)
    out, _ = _counts(optics)
    assert optics.roles == (Role.MEASUREMENT, Role.SWITCH) and out.shape[1] == 2
    alone, _ = _counts(replace(optics, with_switch=False))
    assert alone.shape[1] == 1


def test_the_floor_trembles_as_much_as_stated_and_as_fast_as_it_says():
    x, v = path_vibration(3e-10, 5).motion(2e-4 * np.arange(200_000))
    assert x.std() == pytest.approx(3e-10, rel=0.05)
    assert np.abs(np.gradient(x, 2e-4) - v).max() < 0.2 * np.abs(v).max()
    later, _ = path_vibration(3e-10, 5).motion(10.0 + 2e-4 * np.arange(100))
    assert later == pytest.approx(x[50_000:50_100], abs=1e-15)


def test_impossible_optics_are_refused():
    with pytest.raises(ValueError, match="8 to 16"):
        Optics(bits=24)
