"""What the diagnosis looks at: displacement averaged over blocks of samples, data and model alike."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from analysis.collision import general
from analysis.inference.fit import starts
from analysis.inference.fit.response import DEFAULT_WAVELENGTH_M, ShotData
from analysis.inference.fit.starts import Course
from analysis.shot import Motion, plate_numbers

if TYPE_CHECKING:
    from analysis.inference.noise.floor import Floor
    from analysis.inference.noise.site import Sway

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]
FITTED_CONTACT_TIMES = 5.0  # of flight on either side that take part: further off it tells more of the track
RATE_HZ = 20e3  # what catalogue effects do to the displacement lies below half of it, but for a fringe's ripple
FINE_RATE_HZ = 100e3


@dataclass(frozen=True, slots=True)
class Samples:
    """One shot, block-averaged: ``time_s`` and ``used``, shape (n,), are the motion's, the rest is averaged.

    ``centre_s`` are the times of the averaged samples.
    A mean over a block keeps white noise white and loses no sample at the ends.
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
    white_m: float  # of one averaged sample, as the motion states it
    weight: float = 1.0  # ``white_m`` over that of the shots judged together
    sway: "Sway | None" = None  # what the site may have done to the shot
    plate: tuple[float, float] = (0.0, 0.0)  # m, m/s: what it made of the plate at first touch, the likeliest
    plate_number: int = 0  # on which of the set's plates it was taken

    def whitened(self, floor: "Floor", columns: Floats) -> Floats:
        """Return ``columns``, shape (n, k), as unit white noise where their noise is this floor's; shape (m, k).

        One row a valid sample.
        """
        rows = floor.whiten(columns, self.valid, self.weight)
        if self.sway is None or not floor.site:
            return rows
        return self.sway.whiten(rows, floor)

    def left_m(self, displacement_m: Floats) -> Floats:
        """Return measured minus modelled, averaged, shape (n,).

        What the plate did before the touch is one of the things that the site may have done: where the model begins
        at its likeliest state, that is given back, so that a large swing stays as unlikely as it is.
        """
        left = self.displacement_m - displacement_m
        return left if self.sway is None or not any(self.plate) else left + self.sway.of_plate_m(self.plate)

    def averaged(self, columns: Floats) -> Floats:
        """Return ``columns``, shape (n,) or (n, k) on the motion's grid, averaged like the data."""
        return general.averaged(columns, self.factor)

    def beside_the_site(self, floor: "Floor", left_m: Floats) -> Floats:
        """Return a remainder, shape (n,), without what the site has most likely done of it."""
        if self.sway is None or not floor.site:
            return left_m
        out = left_m.copy()
        out[self.valid] -= self.sway.likely(left_m, floor)
        return out

    @property
    def for_model(self) -> ShotData:
        """Get the shot as the model takes it; it is whitened here."""
        wavelength_m = self.wavelength_m or DEFAULT_WAVELENGTH_M
        rate_hz = self.factor / self.spacing_s
        return ShotData(
            self.time_s,
            self.displacement_m,
            self.valid,
            self.moving_mass_kg,
            self.course,
            wavelength_m,
            rate_hz,
            plate=self.plate,
            plate_number=self.plate_number,
        )

    @property
    def length_s(self) -> float:
        """Get the length of the part that is used in s."""
        return float(self.valid.sum()) * self.spacing_s


def take(motion: Motion, rate_hz: float = RATE_HZ) -> Samples:
    """Return the samples of a motion that shows a collision; NoCollision (an AnalysisError) says why there is none."""
    valid = np.asarray(motion.valid & np.isfinite(motion.displacement_m))
    course = starts.read(motion.time_s, motion.displacement_m, valid)
    around = FITTED_CONTACT_TIMES * course.contact_time_s
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


def spacing(shots: Sequence[Samples]) -> float:
    """Return the spacing shared by all shots in s; ValueError where they differ by more than a hundredth."""
    first = shots[0].spacing_s
    if any(abs(shot.spacing_s / first - 1) > 0.01 for shot in shots):
        raise ValueError("the shots were sampled at different rates: diagnose them apart")
    return first


def together(motions: Sequence[Motion], rate_hz: float = RATE_HZ) -> tuple[Samples, ...]:
    """Return the samples of several motions, white noises weighed against each other, with their plates."""
    numbers = plate_numbers(motions)
    shots = [replace(take(motion, rate_hz), plate_number=k) for motion, k in zip(motions, numbers, strict=True)]
    spacing(shots)
    white = np.array([shot.white_m for shot in shots])
    if not np.all(np.isfinite(white) & (white > 0)):
        return tuple(shots)
    mean = float(np.sqrt(np.mean(white**2)))
    return tuple(replace(shot, weight=float(w / mean)) for shot, w in zip(shots, white, strict=True))
