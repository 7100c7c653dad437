"""What is fitted: the base model by its name, and a shot with its flights read and its noise known."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from analysis.collision.parameters import Variant
from analysis.inference.fit import starts
from analysis.inference.fit.base import Base
from analysis.inference.fit.response import DEFAULT_WAVELENGTH_M, ShotData
from analysis.inference.noise import noise as noise_model
from analysis.inference.noise.sway import BELOW_HZ
from analysis.shot.disturbance import Shaking
from analysis.shot.motion import Motion
from analysis.shot.plates_of_set import plate_count, plate_numbers

MODELS = ("paper", "clamped", "no_tension", "contact")
FITTED_CONTACT_TIMES = 5.0  # of flight on either side that take part in the fit


def base_named(model: str) -> Base:
    """Return the base model of that name; ValueError names those there are."""
    if model == "contact":
        return Base(Variant.PAPER, one_body=True)
    if model not in MODELS:
        raise ValueError(f"no base model {model!r}; there are {', '.join(MODELS)}")
    return Base(Variant.named(model), one_body=False)


def base_of(model: str, motions: Sequence[Motion]) -> Base:
    """Return the base model of that name for a set of shots, with a plate for each that they were taken on."""
    base = base_named(model)
    return base if base.one_body else replace(base, plates=plate_count(motions))


def prepare_set(motions: Sequence[Motion], shakings: Sequence[Shaking | None] = ()) -> list[ShotData]:
    """Read the shots of a set as ``prepare`` does, each with the plate that it was taken on."""
    known = shakings or (None,) * len(motions)
    each = zip(motions, known, plate_numbers(motions), strict=True)
    return [replace(prepare(motion, shaking), plate_number=number) for motion, shaking, number in each]


def prepare(motion: Motion, shaking: Shaking | None = None) -> ShotData:
    """Read a motion's flights and the beat's noise, ``shaking`` apart; NoCollision says why there is nothing to fit."""
    valid = np.asarray(motion.valid & np.isfinite(motion.displacement_m))
    course = starts.read(motion.time_s, motion.displacement_m, valid)
    quiet_in, quiet_out = starts.quiet_stretches(course, motion.displacement_m, valid)
    above_hz = 0.0 if shaking is None else BELOW_HZ
    noise = noise_model.estimate(quiet_in, quiet_out, 1 / motion.sample_rate_hz, above_hz=above_hz)
    # Flights of seconds around a contact of milliseconds tell more of the track than of the collision.
    around = FITTED_CONTACT_TIMES * course.contact_time_s
    near = (motion.time_s > course.touch_time_s - around) & (motion.time_s < course.release_time_s + around)
    return ShotData(
        motion.time_s,
        motion.displacement_m,
        valid & near,
        motion.moving_mass_kg,
        course,
        noise,
        motion.wavelength_m or DEFAULT_WAVELENGTH_M,
        motion.sample_rate_hz,
    )
