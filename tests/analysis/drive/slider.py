"""A simulated drive of known truth for the tests, written independently of the model."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from analysis.shot.motion import Motion
from analysis.signal.record import motion_from_displacement

Floats = NDArray[np.float64]
MASS, VISCOUS, OFFSET = 95.0, 200.0, -3.0
RATE_HZ = 200.0


@dataclass(frozen=True)
class Drive:
    """A slider on a smooth path under the force its laws ask for; ``extra(x, v)`` in N."""

    extra: Callable[[Floats, Floats], Floats] = lambda x, v: 0.0 * x
    late_s: float = 0.0  # the motion answers the force that much later
    noise_n: float = 0.3
    encoder_m: float = 2.7e-8
    seconds: float = 14.0
    seed: int = 1
    mass_kg: float | None = None  # stated
    steady_m_per_s: float = 0.0
    waves: tuple[tuple[float, float], ...] = field(default=((0.08, 0.31), (0.03, 0.97), (0.008, 2.3)))

    def motion(self) -> Motion:
        """Return what is recorded of it; between samples everything is known in closed form."""
        time = np.arange(0.0, self.seconds, 1.0 / RATE_HZ)
        x, _, _ = self._path(time)
        force = self._force(time + self.late_s)
        random = np.random.default_rng(self.seed)
        return motion_from_displacement(
            time,
            x + random.normal(0.0, self.encoder_m, time.size),
            None,
            force + random.normal(0.0, self.noise_n, time.size),
            moving_mass_kg=self.mass_kg,
        )

    def _path(self, time: Floats) -> tuple[Floats, Floats, Floats]:
        phases = np.random.default_rng(7).uniform(0.0, 2.0 * np.pi, len(self.waves))
        x, v, a = self.steady_m_per_s * time, np.full(time.size, self.steady_m_per_s), np.zeros(time.size)
        for (size, hertz), phase in zip(self.waves, phases, strict=True):
            w = 2.0 * np.pi * hertz
            x += size * np.sin(w * time + phase)
            v += size * w * np.cos(w * time + phase)
            a -= size * w**2 * np.sin(w * time + phase)
        return x, v, a

    def _force(self, time: Floats) -> Floats:
        x, v, a = self._path(time)
        return MASS * a + VISCOUS * v + OFFSET + self.extra(x, v)
