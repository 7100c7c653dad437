"""Simulate laser, photodiodes and light switch: the counts of each channel for a given path of the block.

The measurement beat is the rest beat shifted in phase by 4 pi x / lambda; inward motion (v < 0) raises its frequency.
"""

import math
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from analysis.shot import DEFAULT_WAVELENGTH_AIR_M, Channel, Role
from instrument.bench import counts
from instrument.bench.counts import Floats

FLIGHT_NODES_S, HELD_NODES_S = 5e-6, 40e-6  # spacing of the path's nodes; motion of hand and floor is slow


@dataclass(frozen=True, slots=True)
class DropOut:
    """An interval in which the measurement beat has only the fraction ``light`` of its amplitude."""

    start_s: float
    end_s: float
    light: float = 0.0


@dataclass(frozen=True, slots=True)
class Optics:
    """Light, electronics and digitizer; SNR is A^2 / (2 sigma^2) for white noise over the whole digitizer band."""

    wavelength_m: float = DEFAULT_WAVELENGTH_AIR_M  # in air
    rest_frequency_hz: float = 2.73e6
    rest_drift_hz_per_s: float = 0.0
    reference_v: float = 0.7324
    measurement_v: float = 0.5859
    reference_offset_v: float = 0.0015
    measurement_offset_v: float = -0.0039
    reference_snr_db: float = 37.0
    measurement_snr_db: float = 35.0
    leak_m: float = 0.0  # amplitude of the cyclic error
    leak_order: int = 1
    leak_turns: float = 0.0
    drop_outs: tuple[DropOut, ...] = ()
    switch_low_v: float = 0.0488
    switch_high_v: float = 0.8789
    switch_noise_v: float = 0.003
    switch_m: float = 0.7e-3  # block position at which its flag crosses the light
    switch_edge_m: float = 9.25e-6  # width of the edge, 10 to 90 %
    range_v: float = 1.0  # rails at -range and +range
    bits: int = 12
    with_reference: bool = True
    with_switch: bool = True

    def __post_init__(self) -> None:
        if not 8 <= self.bits <= 16:
            raise ValueError(f"a digitizer of {self.bits} bits: 8 to 16 can be simulated")
        if not self.rest_frequency_hz > 0 or not self.wavelength_m > 0:
            raise ValueError("rest frequency and wavelength must be above zero")

    @property
    def volts_per_count(self) -> float:
        """Get the digitizer's step in V."""
        return 2.0 * self.range_v / float(2**self.bits)

    @property
    def roles(self) -> tuple[Role, ...]:
        """Get the roles of the columns, in order."""
        wanted = ((Role.REFERENCE, self.with_reference), (Role.MEASUREMENT, True), (Role.SWITCH, self.with_switch))
        return tuple(role for role, there in wanted if there)

    @property
    def channels(self) -> tuple[Channel, ...]:
        return tuple(Channel(role, self.volts_per_count) for role in self.roles)

    def light(self, time_s: Floats) -> Floats:
        """Return the measurement beat's amplitude at ``time_s``, relative to that without drop-outs."""
        result = np.ones_like(time_s)
        for gap in self.drop_outs:
            result[(time_s >= gap.start_s) & (time_s < gap.end_s)] = gap.light
        return result


@dataclass(frozen=True, slots=True)
class Path:
    """Position of the corner cube (optics) and of the block (light switch) at the nodes ``time_s``; shape (n,).

    ``optical_m`` includes disturbances of the optical measurement alone: frame vibration and drift.
    """

    time_s: Floats
    optical_m: Floats
    optical_m_per_s: Floats
    block_m: Floats


def node_times_s(first_sample: int, samples: int, sample_rate_hz: float, spacing_s: float = FLIGHT_NODES_S) -> Floats:
    """Return the times of the path's nodes for these samples, a whole number of samples apart."""
    step = max(1, round(sample_rate_hz * spacing_s))
    nodes = -(-samples // step) + 1
    return (first_sample + step * np.arange(nodes)) / sample_rate_hz


def fill(
    optics: Optics, path: Path, first_sample: int, sample_rate_hz: float, seed: int, out: NDArray[np.int16]
) -> tuple[int, ...]:
    """Fill ``out`` (n, channels) with counts from ``first_sample`` on; return the clipped samples per channel.

    The path's times must be ``node_times_s`` of these samples; sample 0 is at time zero.
    """
    time_s = path.time_s
    step = round(float(time_s[1] - time_s[0]) * sample_rate_hz)
    per_count = optics.volts_per_count
    segment_s = step / sample_rate_hz
    p = np.zeros(counts.PARAMETERS)
    p[counts.TURNS_PER_SAMPLE] = optics.rest_frequency_hz / sample_rate_hz
    p[counts.START_TURNS] = _turns_modulo_one(optics.rest_frequency_hz, first_sample, sample_rate_hz)
    p[counts.REFERENCE_A] = optics.reference_v / per_count
    p[counts.REFERENCE_OFFSET] = optics.reference_offset_v / per_count
    p[counts.REFERENCE_SIGMA] = optics.reference_v / per_count * 10 ** (-optics.reference_snr_db / 20) / math.sqrt(2)
    p[counts.MEASUREMENT_A] = optics.measurement_v / per_count
    p[counts.MEASUREMENT_OFFSET] = optics.measurement_offset_v / per_count
    sigma = optics.measurement_v / per_count * 10 ** (-optics.measurement_snr_db / 20) / math.sqrt(2)
    p[counts.MEASUREMENT_SIGMA] = sigma
    p[counts.LEAK] = optics.leak_m * 4 * math.pi / optics.wavelength_m
    p[counts.LEAK_ORDER] = optics.leak_order
    p[counts.LEAK_TURNS] = optics.leak_turns
    p[counts.SWITCH_LOW] = optics.switch_low_v / per_count
    p[counts.SWITCH_HIGH] = optics.switch_high_v / per_count
    p[counts.SWITCH_SIGMA] = optics.switch_noise_v / per_count
    p[counts.SWITCH_X] = optics.switch_m
    p[counts.SWITCH_WIDTH] = optics.switch_edge_m / 1.8124  # erfc(e) / 2 is 0.9 and 0.1 at e = -+0.9062
    p[counts.LOWEST], p[counts.HIGHEST] = -(2 ** (optics.bits - 1)), 2 ** (optics.bits - 1) - 1
    column = {role: index for index, role in enumerate(optics.roles)}
    clipped = np.zeros(len(column), np.int64)
    nodes = np.empty((5, time_s.size))
    nodes[0] = path.optical_m * (2 / optics.wavelength_m)
    nodes[1] = path.optical_m_per_s * (2 * segment_s / optics.wavelength_m)
    nodes[2] = 0.5 * optics.rest_drift_hz_per_s * time_s**2
    nodes[3] = optics.light(time_s)
    nodes[4] = path.block_m
    columns = column.get(Role.REFERENCE, -1), column[Role.MEASUREMENT], column.get(Role.SWITCH, -1)
    noise = seed & (2**63 - 1), counts.GAUSS
    counts.fill_counts(first_sample, step, nodes, p, noise, columns, out, clipped)
    return tuple(int(c) for c in clipped)


def _turns_modulo_one(frequency_hz: float, sample: int, sample_rate_hz: float) -> float:
    """Return the rest beat's phase at a sample in turns, exact even after hours, unlike a product of floats."""
    turns = Fraction(frequency_hz) / Fraction(sample_rate_hz) * sample
    return float(turns - math.floor(turns))
