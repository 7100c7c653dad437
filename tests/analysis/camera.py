"""A collision as a camera sees it, integrated here in the plainest way: no line of it is the model's."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.shot.motion import Motion
from analysis.signal.record import motion_from_displacement

Floats = NDArray[np.float64]
MASS_KG, REST_M = 0.0912, 0.054
_STEP_S, _STEPS_A_FRAME = 2e-5, 100


@dataclass(frozen=True)
class Camera:
    """One body on spring and dashpot (``growing`` with the overlap), filmed at 500 frames a second.

    ``bends`` are accelerations of this shot alone, in m/s^2 on the way in and out; ``drag`` one of all shots, in 1/s.
    """

    speed: float = 0.17
    stiffness: float = 190.0
    dashpot: float = 0.7
    growing: float = 0.0
    bends: tuple[float, float] = (0.0, 0.0)
    drag: float = 0.0
    seconds: float = 1.5

    def course(self) -> tuple[Floats, Floats, Floats]:
        """Return time, place and force of the contact, by steps of 20 us of the mid-point rule."""
        count = round(self.seconds / _STEP_S)
        place, force = np.empty(count), np.empty(count)
        x, v = REST_M + 0.4 * self.seconds * self.speed, -self.speed
        for i in range(count):
            place[i], force[i] = x, self._push(x, v)
            bend = self.bends[0] if v < 0.0 else self.bends[1]
            middle = v + 0.5 * _STEP_S * (force[i] / MASS_KG + bend - self.drag * v)
            half = x + 0.5 * _STEP_S * v
            x, v = x + _STEP_S * middle, v + _STEP_S * (self._push(half, middle) / MASS_KG + bend - self.drag * middle)
        return _STEP_S * np.arange(count), place, force

    def _push(self, x: float, v: float) -> float:
        if x >= REST_M:
            return 0.0
        return -self.stiffness * (x - REST_M) - (self.dashpot + self.growing * (REST_M - x)) * v

    def motion(self, noise_m: float, seed: int = 1) -> Motion:
        """Return what the camera shows, with white noise of ``noise_m``."""
        time, place, _ = self.course()
        time, place = time[::_STEPS_A_FRAME], place[::_STEPS_A_FRAME]
        seen = place + np.random.default_rng(seed).normal(0.0, noise_m, time.size)
        return motion_from_displacement(time, seen, None, None, MASS_KG, 1e-4)
