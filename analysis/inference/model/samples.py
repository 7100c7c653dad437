"""Block averages of a shot's displacement: the samples that are fitted, and the model averaged in the same way."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from analysis.collision import averaged
from analysis.inference.model.course import Course, read_course
from analysis.shot import Floats, Motion, plate_numbers

if TYPE_CHECKING:
    from analysis.inference.noise.floor import Floor
    from analysis.inference.noise.sway import Sway

Mask = NDArray[np.bool_]
_FITTED_CONTACT_TIMES = 5.0  # contact times of flight fitted on either side: beyond, the track's shape matters more
RATE_HZ = 20e3  # catalogue effects act on the displacement below half of this rate, except the ripple of a fringe
FINE_RATE_HZ = 100e3  # the rate for that ripple


@dataclass(frozen=True, slots=True)
class Samples:
    """One shot, averaged over blocks of ``factor`` samples.

    ``time_s`` and ``used``, shape (n,), are on the motion's own grid.  All other arrays are averaged samples, shape
    (n // factor,), centred at ``centre_s``.  Block means keep white noise white and lose no sample at the ends.
    """

    time_s: Floats
    used: Mask
    factor: int
    centre_s: Floats
    displacement_m: Floats
    valid: Mask
    spacing_s: float
    moving_mass_kg: float
    wavelength_m: float | None
    course: Course
    white_m: float  # white noise of one averaged sample, as the motion states it
    weight: float = 1.0  # ``white_m`` over the rms of that of all shots in the fit
    sway: "Sway | None" = None  # frame motion as a covariance term
    plate: tuple[float, float] = (0.0, 0.0)  # m, m/s: the plate's likeliest state at first touch on a moving frame
    plate_number: int = 0  # index of the shot's plate in the set

    def whitened(self, floor: "Floor", columns: Floats) -> Floats:
        """Return ``columns``, shape (n, k), whitened so that this noise becomes unit white noise; shape (m, k).

        The result has one row for each of the m valid samples.
        """
        rows = floor.whiten(columns, self.valid, self.weight)
        if self.sway is None or not floor.site:
            return rows
        return self.sway.whiten(rows, floor)

    def left_m(self, displacement_m: Floats) -> Floats:
        """Return measured minus model displacement, averaged, shape (n,).

        The plate's motion before the touch is part of the frame's covariance term.  If the model starts from the
        plate's likeliest state, the contribution of that state is added back, so that its variance penalises a large
        swing.
        """
        left = self.displacement_m - displacement_m
        return left if self.sway is None or not any(self.plate) else left + self.sway.plate_displacement_m(self.plate)

    def averaged(self, columns: Floats) -> Floats:
        """Return ``columns``, shape (n,) or (n, k) on the motion's grid, averaged like the data."""
        return averaged(columns, self.factor)

    def without_frame_motion(self, floor: "Floor", left_m: Floats) -> Floats:
        """Return a residual, shape (n,), minus the likeliest contribution of the frame's motion."""
        if self.sway is None or not floor.site:
            return left_m
        out = left_m.copy()
        out[self.valid] -= self.sway.likely(left_m, floor)
        return out

    @property
    def length_s(self) -> float:
        """Get the duration of all valid samples in s."""
        return float(self.valid.sum()) * self.spacing_s


def averaged_shot(motion: Motion, rate_hz: float = RATE_HZ) -> Samples:
    """Return the averaged samples of a motion; NoCollision (an AnalysisError) if it shows no collision."""
    valid = np.asarray(motion.valid & np.isfinite(motion.displacement_m))
    course = read_course(motion.time_s, motion.displacement_m, valid)
    around = _FITTED_CONTACT_TIMES * course.contact_time_s
    valid &= (motion.time_s > course.touch_time_s - around) & (motion.time_s < course.release_time_s + around)
    factor = max(1, round(motion.sample_rate_hz / rate_hz))
    count = valid.size // factor
    good = np.asarray(valid[: count * factor].reshape(count, factor).all(axis=1))
    std = motion.displacement_std_m[valid]
    white = float(np.sqrt(np.mean(std**2))) if std.size and np.all(np.isfinite(std)) else float("nan")
    filled = np.where(valid, motion.displacement_m, 0.0)[: count * factor].reshape(count, factor).mean(axis=1)
    return Samples(
        time_s=motion.time_s,
        used=valid,
        factor=factor,
        centre_s=motion.time_s[: count * factor].reshape(count, factor).mean(axis=1),
        displacement_m=np.where(good, filled, 0.0),
        valid=good,
        spacing_s=factor / motion.sample_rate_hz,
        moving_mass_kg=motion.moving_mass_kg,
        wavelength_m=motion.wavelength_m,
        course=course,
        white_m=white / math.sqrt(factor),
    )


def averaged_shots(motions: Sequence[Motion], rate_hz: float = RATE_HZ) -> tuple[Samples, ...]:
    """Return the averaged samples of several motions, each with its weight and the number of its plate.

    Raises ValueError if their spacing differs by more than 1 %.
    """
    numbers = plate_numbers(motions)
    shots = [
        replace(averaged_shot(motion, rate_hz), plate_number=k) for motion, k in zip(motions, numbers, strict=True)
    ]
    if any(abs(shot.spacing_s / shots[0].spacing_s - 1) > 0.01 for shot in shots):
        raise ValueError("the shots were sampled at different rates: diagnose them apart")
    white = np.array([shot.white_m for shot in shots])
    if not np.all(np.isfinite(white) & (white > 0)):
        return tuple(shots)
    mean = float(np.sqrt(np.mean(white**2)))
    return tuple(replace(shot, weight=float(w / mean)) for shot, w in zip(shots, white, strict=True))
