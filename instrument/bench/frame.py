"""The motion of the frame that carries optics, plate and light switch; the block floats free of the frame.

The optics measure the block's position minus the frame's.  In flight the frame does not drive the block, so the record
contains the whole frame motion.  In contact the plate's clamp moves with the frame and drives both bodies.  In the
frame's coordinates, used by the equations of motion, minus the frame's acceleration acts on every mass.
"""

from dataclasses import dataclass, replace

import numpy as np

from instrument.bench.sines import Floats, Sines, interpolate_with_slope
from instrument.bench.site import Knock, Site

LOWEST_HZ, HIGHEST_HZ = 1.0, 250.0
BAND_HZ = (8.0, 80.0)  # range in which the criterion curves are constant
PLATE_QUALITY = 200.0  # of the plate's resonance in air, which the frame excites before the block arrives
_PER_THIRD_OCTAVE = 12  # sines per third-octave, unless they are farther apart than ...
_LARGEST_SPACING_HZ = 0.15  # ... this, as a record of a few seconds must not resolve them
_PHASE_STEP = 0.1  # rad of the fastest sine between computed times; error of cubic interpolation: 3e-7
_KNOCKED_WITHIN_S = 0.055  # latest random time of a knock after the release of the block


@dataclass(frozen=True, slots=True)
class _Ringing:
    """A knock: Im A sum_k c_k exp(s_k t) from ``start_s`` on; it and its first three derivatives start at 0."""

    start_s: float
    amplitude: tuple[complex, ...]
    rate: tuple[complex, ...]

    def add(self, time_s: Floats, order: int, out: Floats) -> None:
        """Add the derivative of this order, at ascending times, to ``out``."""
        a = int(np.searchsorted(time_s, self.start_s))
        for amplitude, rate in zip(self.amplitude, self.rate, strict=True):
            out[a:] += (amplitude * rate**order * np.exp(rate * (time_s[a:] - self.start_s))).imag


def _ringing(knock: Knock, start_s: float, sign: float) -> _Ringing:
    omega, rise_s = 2 * np.pi * knock.frequency_hz, 0.1 / knock.frequency_hz
    ring = complex(-1 / knock.decay_s, omega)
    rates = tuple(ring - k / rise_s for k in range(4))
    shape = (1.0, -3.0, 3.0, -1.0)  # (1 - exp(-t / rise))^3
    time_s = np.linspace(0.0, 2 / knock.frequency_hz, 400)
    peak = np.abs(sum(c * np.exp(r * time_s) for c, r in zip(shape, rates, strict=True)).imag).max()
    return _Ringing(start_s, tuple(sign * knock.amplitude_m / peak * c for c in shape), rates)


@dataclass(frozen=True, slots=True)
class Frame:
    """The frame's displacement along the beam, right positive, at any time."""

    site: Site
    seed: int
    sines: Sines
    ringing: tuple[_Ringing, ...] = ()

    @property
    def _spacing_s(self) -> float:
        """Get the spacing of the times at which motion is computed."""
        knocks = max((abs(rate) for one in self.ringing for rate in one.rate), default=0.0)
        return _PHASE_STEP / max(float(self.sines.omega.max(initial=2 * np.pi * HIGHEST_HZ)), knocks)

    def motion(self, time_s: Floats) -> tuple[Floats, Floats]:
        """Return displacement (m) and velocity (m/s) at ascending times, shape (n,)."""
        x, v = self.sines.motion(time_s)
        if self.ringing and time_s[-1] > min(one.start_s for one in self.ringing):
            spacing_s = self._spacing_s
            nodes = int((time_s[-1] - time_s[0]) / spacing_s) + 2
            node_s: Floats = time_s[0] + np.arange(nodes) * spacing_s
            rung_x, rung_v = np.zeros(nodes), np.zeros(nodes)
            for one in self.ringing:
                one.add(node_s, 0, rung_x)
                one.add(node_s, 1, rung_v)
            more_x, more_v = interpolate_with_slope(node_s, rung_x, rung_v, time_s)
            x, v = x + more_x, v + more_v
        return x, v

    def from_time(self, start_s: float) -> "Frame":
        """Return the frame with time zero moved to ``start_s``."""
        turned = replace(self.sines, phase=self.sines.phase + self.sines.omega * start_s)
        ringing = tuple(replace(one, start_s=one.start_s - start_s) for one in self.ringing)
        return replace(self, sines=turned, ringing=ringing)

    def acceleration(self, duration_s: float) -> tuple[float, Floats, Floats]:
        """Return spacing (s), acceleration (m/s2) and jerk (m/s3) at nodes from time zero on."""
        spacing_s = self._spacing_s
        nodes = int(np.ceil(duration_s / spacing_s)) + 2
        a, jerk = self.sines.acceleration(spacing_s, nodes)
        node_s: Floats = np.arange(nodes) * spacing_s  # type: ignore[assignment]
        for one in self.ringing:
            one.add(node_s, 2, a)
            one.add(node_s, 3, jerk)
        return spacing_s, a, jerk

    def plate_response(self, omega: float) -> tuple[float, float]:
        """Return displacement and velocity, relative to the frame, at time zero of a plate of resonance ``omega``."""
        w = self.sines.omega
        answer = w**2 / (omega**2 - w**2 + 1j * w * omega / PLATE_QUALITY)
        turning = self.sines.amplitude_m * answer * np.exp(1j * self.sines.phase)
        return float(turning.imag.sum()), float((w * turning).real.sum())

    def with_knocks(self, release_s: float, shot: int) -> "Frame":
        """Return the frame with the knocks of shot number ``shot``, whose block is released at ``release_s``."""
        random = np.random.default_rng((self.seed, shot, 0x6B))
        ringing = []
        for knock in self.site.knocks:
            happens, at_s = random.random() < knock.share, random.uniform(0.0, _KNOCKED_WITHIN_S)
            sign = float(random.choice((-1.0, 1.0)))
            if happens:
                ringing.append(_ringing(knock, release_s + (at_s if knock.at_s is None else knock.at_s), sign))
        return replace(self, ringing=tuple(ringing))


def density_m2_per_hz(site: Site, frequency_hz: Floats) -> Floats:
    """Return the one-sided density of the random displacement, without lines, at ``frequency_hz`` (n,)."""
    low, high = BAND_HZ
    shape = np.minimum(1.0, frequency_hz / low) * np.minimum(1.0, (high / frequency_hz) ** 2)
    third = np.log(2.0) / 3 * frequency_hz  # width of a third-octave
    inside = (frequency_hz >= LOWEST_HZ) & (frequency_hz <= HIGHEST_HZ)
    velocity = np.where(inside, (site.third_octave_m_per_s * shape) ** 2 / third, 0.0)
    if site.spectrum:
        known_hz, density = np.array(site.spectrum).T
        measured = np.exp(np.interp(np.log(frequency_hz), np.log(known_hz), np.log(density)))
        within = (frequency_hz >= known_hz[0]) & (frequency_hz <= known_hz[-1])
        velocity = velocity + np.where(within, (measured / (2 * np.pi * frequency_hz)) ** 2, 0.0)
    result: Floats = velocity / (2 * np.pi * frequency_hz) ** 2
    return result


def _edges_hz(lowest: float, highest: float) -> Floats:
    """Return the edges of the frequency bands that hold one sine each of the random part."""
    ratio = 2 ** (1 / (3 * _PER_THIRD_OCTAVE))
    bend = min(max(_LARGEST_SPACING_HZ / (ratio - 1), lowest), highest)
    low = np.geomspace(lowest, bend, max(1, round(np.log(bend / lowest) / np.log(ratio))) + 1)
    high = np.linspace(bend, highest, max(1, round((highest - bend) / _LARGEST_SPACING_HZ)) + 1)
    return np.concatenate((low[:-1], high))


def frame_of(site: Site, seed: int) -> Frame:
    """Return the frame of a site; the same seed gives the same motion."""
    random = np.random.default_rng((seed, 0x51))
    known_hz = [frequency for frequency, _ in site.spectrum]
    lowest, highest = min([LOWEST_HZ, *known_hz]), max([HIGHEST_HZ, *known_hz])
    edges = _edges_hz(lowest, highest)
    frequency_hz = random.uniform(edges[:-1], edges[1:])
    rms_m = np.sqrt(density_m2_per_hz(site, frequency_hz) * np.diff(edges))
    amplitude = np.concatenate((rms_m * random.rayleigh(1.0, rms_m.size), [line.amplitude_m for line in site.lines]))
    frequency_hz = np.concatenate((frequency_hz, [line.frequency_hz for line in site.lines]))
    there = amplitude > 0.0
    phase = random.uniform(0, 2 * np.pi, amplitude.size)
    return Frame(site, seed, Sines(2 * np.pi * frequency_hz[there], amplitude[there], phase[there]))
