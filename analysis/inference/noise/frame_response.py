"""The contribution of a moving frame to the displacement of a shot.

Optics and plate are fixed to the frame; the block floats free of it.  In flight the displacement contains the whole
frame motion with opposite sign.  In contact the plate's clamp drives plate and block.  Position and velocity of the
frame at the touch are left out: they only shift the shot and change its speed.
"""

from dataclasses import replace

import numpy as np

from analysis.collision import Collision, Floats, moved_by_frame
from analysis.inference.model.response import ShotModel, change_shown
from analysis.shot import VibrationSpectrum

PLATE_QUALITY = 300.0  # upper limit of the quality factor of a metal plate oscillating in air
STILL = (1e-15, 1e-12)  # m, m/s: std of a plate at rest


def plate_swing_std(vibration: VibrationSpectrum, collision: Collision) -> tuple[float, float]:
    """Return the stds of the plate's displacement (m) and velocity (m/s) relative to the frame before the touch."""
    own = float(np.sqrt(collision.plate_stiffness_n_per_m / collision.plate_mass_kg))
    omega = 2 * np.pi * vibration.frequency_hz
    answer = omega**2 / np.hypot(own**2 - omega**2, own * omega / PLATE_QUALITY)
    width = np.zeros(omega.size)
    if np.count_nonzero(vibration.random) > 1:
        width[vibration.random] = np.gradient(omega[vibration.random])
    beside = np.abs(omega - own) > 2 * width
    driven = float(np.sum((vibration.power_m2 * answer**2)[beside]))
    resonant = 0.25 * own * PLATE_QUALITY * vibration.density_m2_per_hz(own / (2 * np.pi))
    std = float(np.sqrt(driven + resonant))
    # not zero, since likely plate states are divided by this std
    return max(std, STILL[0]), max(own * std, STILL[1])


def responses(shot: ShotModel, omega: Floats) -> tuple[Floats, Floats]:
    """Return the response of a shot's averaged samples to frame motion at ``omega``, (n, 2 f), as ``moved_by_frame``.

    The second value, shape (2 f,), is the frame's contribution to the block's velocity in space after the last release.
    The frame moves slowly: the mean over a block of samples equals the value at its centre to a millionth.  Raises
    Infeasible if the parameters give no collision.  Cost: about 2 ms, 4 ms with effects.
    """
    # interferometer ripple, finer than averaged samples, is left out: the fit adds it along the measured path
    lagging = {effect: given for effect, given in shot.values.items() if effect.sensor is None or effect.has_memory}
    path = shot.path(1, for_forces=all(effect.sensor is None for effect in lagging))
    moved, after = moved_by_frame(path, shot.collision, omega, shot.samples.centre_s.size)
    return change_shown(replace(shot, values=lagging), path, moved), after
