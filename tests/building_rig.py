"""A rig in a building that knows nothing of the analysis: two bodies on a frame that moves as any record says.

It shares no code with ``instrument.bench`` nor with the model: bodies, plate and frame are integrated step by step
(Runge-Kutta of fourth order, contact begun and ended by bisection) in the frame's coordinates, where every mass feels
minus the frame's acceleration.  The frame carries optics and plate; the plate begins at rest on it, or swinging, and
swings from then on.  The optics add white noise, a path that wanders with one pole, drifts, steps, and lines of their
own.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numba import njit
from numpy.typing import NDArray

from analysis.shot.motion import Motion
from analysis.signal.record import motion_from_displacement

Floats = NDArray[np.float64]
CURVES_M_PER_S = {  # rms velocity in a third-octave from 8 Hz on (Gordon, SPIE 1619, 1991)
    "VC-A": 50e-6, "VC-B": 25e-6, "VC-C": 12.5e-6, "VC-D": 6.25e-6, "VC-E": 3.12e-6, "VC-F": 1.56e-6, "VC-G": 0.78e-6,
}  # fmt: skip
_RATE_HZ = 100e3
_STEPS = 4  # of the integration in a sample
_LINES = ((24.7, 0.3), (99.6, 0.2))  # Hz, of the curve
_IN_A_BAND = 12


@dataclass(frozen=True, slots=True)
class Bodies:
    """Block, plate and contact, and what the paper's model lacks of them; SI units."""

    block_kg: float = 17.85e-3
    plate_kg: float = 1.984e-4
    plate_n_per_m: float = 221.4
    contact_n_per_m: float = 1e4
    contact_n_s_per_m: float = 0.4
    friction_n: float = 0.0
    drag_n_s_per_m: float = 0.0
    quadratic_n_s2_per_m2: float = 0.0
    plate_damping_n_s_per_m: float = 0.0
    cubic_n_per_m3: float = 0.0
    magnet_n: float = 0.0  # pushes the block away, less by e every ``magnet_m``
    magnet_m: float = 2e-3

    @property
    def numbers(self) -> tuple[float, ...]:
        """Get them in the integration's order."""
        return (
            self.block_kg, self.plate_kg, self.plate_n_per_m, self.contact_n_per_m, self.contact_n_s_per_m,
            self.friction_n, self.drag_n_s_per_m, self.quadratic_n_s2_per_m2, self.plate_damping_n_s_per_m,
            self.cubic_n_per_m3, self.magnet_n, self.magnet_m,
        )  # fmt: skip


@dataclass(frozen=True, slots=True)
class Path:
    """What the optics add: white noise of a sample, wander of ``wander_m`` rms and a corner, drift, steps, lines."""

    white_m: float = 0.08e-9
    wander_m: float = 0.4e-9
    corner_hz: float = 40.0
    drift_m_per_s: float = 0.0
    steps: tuple[tuple[float, float], ...] = ()  # s, m
    lines: tuple[tuple[float, float], ...] = ()  # Hz, m


@dataclass(frozen=True, slots=True)
class Rig:
    """Bodies in a building ("" for none) at ``share`` of its curve, and the optics."""

    site: str = "VC-D"
    bodies: Bodies = field(default_factory=Bodies)
    path: Path = field(default_factory=Path)
    length_s: float = 0.12
    approach_s: float = 0.025
    plate_swings: bool = False  # as the frame has swung it long since; else it is at rest on the frame at the start
    ring_m: float = 0.0  # of the plate, left over from the shot before, with any phase

    def shots(self, seed: int, speeds_m_per_s: Sequence[float] = (0.20, 0.265, 0.33)) -> list[Motion]:
        """Return one shot a speed, all on the same frame that goes on moving between them."""
        return [self._shot(seed, index, speed) for index, speed in enumerate(speeds_m_per_s)]

    def with_bodies(self, **changes: float) -> "Rig":
        """Return the rig with other bodies."""
        return replace(self, bodies=replace(self.bodies, **changes))

    def _shot(self, seed: int, index: int, speed: float) -> Motion:
        random = np.random.default_rng((seed, index))
        count = round(self.length_s * _RATE_HZ)
        time_s = np.arange(count) / _RATE_HZ
        half = np.arange(2 * _STEPS * count + 1) / (2 * _STEPS * _RATE_HZ)
        acceleration = self._acceleration(half, np.random.default_rng(seed), random.uniform(0.0, 2 * np.pi, 2000))
        place = np.empty(count)
        start = (self.approach_s * speed, -speed, *self._plate(random))
        _integrate(np.array(self.bodies.numbers), acceleration, 1 / (_STEPS * _RATE_HZ), _STEPS, start, place)
        seen = place + self._added(time_s, random)
        motion = motion_from_displacement(time_s, seen, None, None, self.bodies.block_kg, 1e-6, 10e3)
        return replace(motion, wavelength_m=632.8e-9, displacement_std_m=np.full(count, self.path.white_m))

    def _plate(self, random: np.random.Generator) -> tuple[float, float]:
        rate = float(np.sqrt(self.bodies.plate_n_per_m / self.bodies.plate_kg))
        if self.ring_m:
            phase = random.uniform(0.0, 2 * np.pi)
            return float(self.ring_m * np.sin(phase)), float(self.ring_m * rate * np.cos(phase))
        if not self.plate_swings or not self.site:
            return 0.0, 0.0
        level = CURVES_M_PER_S[self.site]
        speed = 5.0 * level * random.standard_normal()
        return float(5.0 * level * random.standard_normal() / rate), float(speed)

    def _acceleration(self, time_s: Floats, of_site: np.random.Generator, phases: Floats) -> Floats:
        """Return the frame's acceleration in m/s^2: third-octaves of a dozen sines each at 0.4 to 1 of the curve."""
        out = np.zeros(time_s.size)
        if not self.site:
            return out
        level = CURVES_M_PER_S[self.site]
        sines = []
        for centre in 10 ** (np.arange(3, 26) / 10.0):
            size = level * of_site.uniform(0.4, 1.0) * min(1.0, centre / 8.0)
            at = centre * 10 ** of_site.uniform(-0.05, 0.05, _IN_A_BAND)
            weight = of_site.uniform(0.5, 1.5, _IN_A_BAND)
            weight *= size * np.sqrt(2.0) / np.sqrt(np.sum(weight**2))
            sines += list(zip(at, weight, strict=True))
        sines += [(frequency, share * level * np.sqrt(2.0)) for frequency, share in _LINES]
        for (frequency, speed), phase in zip(sines, phases, strict=False):
            omega = 2 * np.pi * frequency
            out += omega * speed * np.cos(omega * time_s + phase)
        return out

    def _added(self, time_s: Floats, random: np.random.Generator) -> Floats:
        path, step_s = self.path, float(time_s[1] - time_s[0])
        out = path.white_m * random.standard_normal(time_s.size) + path.drift_m_per_s * time_s
        memory = np.exp(-2 * np.pi * path.corner_hz * step_s)
        kicks = path.wander_m * np.sqrt(1 - memory**2) * random.standard_normal(time_s.size)
        wander = path.wander_m * random.standard_normal()
        for i in range(time_s.size):
            out[i] += wander
            wander = memory * wander + kicks[i]
        for at_s, size_m in path.steps:
            out += size_m * (time_s >= at_s)
        for frequency, size_m in path.lines:
            out += size_m * np.sin(2 * np.pi * frequency * time_s + random.uniform(0.0, 2 * np.pi))
        return out


@njit(cache=False)
def _slope(of, state, pushed, touching):  # type: ignore[no-untyped-def]
    """Return the derivatives of block, its velocity, plate, its velocity, all against the frame."""
    x, v, y, u = state
    contact = 0.0
    if touching:
        contact = of[3] * (y - x) + of[4] * (u - v)
    along = 1.0 if v > 0 else -1.0
    force = contact - of[5] * along - of[6] * v - of[7] * v * abs(v) + of[10] * np.exp(-x / of[11])
    plate = -of[2] * y - of[9] * y**3 - of[8] * u - contact
    return (v, force / of[0] - pushed, u, plate / of[1] - pushed)


@njit(cache=False)
def _step(of, state, first, middle, last, h, touching):  # type: ignore[no-untyped-def]
    a = _slope(of, state, first, touching)
    s = (state[0] + 0.5 * h * a[0], state[1] + 0.5 * h * a[1], state[2] + 0.5 * h * a[2], state[3] + 0.5 * h * a[3])
    b = _slope(of, s, middle, touching)
    s = (state[0] + 0.5 * h * b[0], state[1] + 0.5 * h * b[1], state[2] + 0.5 * h * b[2], state[3] + 0.5 * h * b[3])
    c = _slope(of, s, middle, touching)
    s = (state[0] + h * c[0], state[1] + h * c[1], state[2] + h * c[2], state[3] + h * c[3])
    d = _slope(of, s, last, touching)
    return (
        state[0] + h / 6 * (a[0] + 2 * b[0] + 2 * c[0] + d[0]),
        state[1] + h / 6 * (a[1] + 2 * b[1] + 2 * c[1] + d[1]),
        state[2] + h / 6 * (a[2] + 2 * b[2] + 2 * c[2] + d[2]),
        state[3] + h / 6 * (a[3] + 2 * b[3] + 2 * c[3] + d[3]),
    )


@njit(cache=False)
def _integrate(of, acceleration, h, steps, start, out):  # type: ignore[no-untyped-def]
    """Write the block's place against the frame at every sample, shape (n,); ``acceleration`` is every half step's."""
    state = (start[0], start[1], start[2], start[3])
    touching = False
    for i in range(out.size):
        out[i] = state[0]
        for k in range(steps):
            at = 2 * (i * steps + k)
            first, middle, last = acceleration[at], acceleration[at + 1], acceleration[at + 2]
            done = 0.0
            while done < h:
                left = h - done
                f = first + (last - first) * done / h
                m = f + (last - f) * 0.5 if done > 0.0 else middle
                there = _step(of, state, f, m, last, left, touching)
                apart = there[0] - there[2]
                if (apart > 0.0) == (not touching):
                    state = there
                    break
                low, high = 0.0, left
                for _ in range(60):
                    half = 0.5 * (low + high)
                    trial = _step(of, state, f, m, f + (last - f) * half / left, half, touching)
                    if (trial[0] - trial[2] > 0.0) == (not touching):
                        low = half
                    else:
                        high = half
                state = _step(of, state, f, m, f + (last - f) * high / left, high, touching)
                touching = not touching
                done += high
