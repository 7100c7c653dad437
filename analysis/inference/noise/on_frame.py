"""Shots on frames that sway: what a fit is to weigh, and how far the plate may swing before it is touched."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from analysis.collision.parameters import Collision, Floats
from analysis.inference.fit.base import Base
from analysis.inference.fit.response import ShotData
from analysis.inference.noise.noise import Noise
from analysis.inference.noise.sway import BELOW_HZ, Grid, Swayed, plate_swing_std
from analysis.inference.noise.sway_knots import knots_of
from analysis.shot.disturbance import Shaking
from analysis.shot.motion import Motion

_APART = 0.45  # of 1 / the time that is fitted: the sines that stand for a floor
_FEWEST_A_TURN = 10.0  # samples of what shakes fastest
_ROUGHLY = 1.0  # of the noise of a sample: what splines may miss of the sway while a fit looks for its minimum
_MATTERS = 0.05  # of the beat's noise


def can_tell(motion: Motion) -> bool:
    """Return whether a motion's samples are close enough to tell the frame's motion from the beat's noise."""
    return motion.sample_rate_hz >= _FEWEST_A_TURN * BELOW_HZ


def on_frames(
    shots: Sequence[ShotData], shakings: Sequence[Shaking | None], base: Base, shared: Floats, own: Sequence[Floats]
) -> list[ShotData]:
    """Return the shots with the noise that their frames make of theirs, if they went as these parameters say."""
    return [
        shot if shaking is None else _on_frame(shot, shaking, base, shared, mine)
        for shot, shaking, mine in zip(shots, shakings, own, strict=True)
    ]


def _on_frame(shot: ShotData, shaking: Shaking, base: Base, shared: Floats, own: Floats) -> ShotData:
    collision = base.collision(shared, own[0], shot.block_mass_kg, plate_number=shot.plate_number)
    touch_s = float(own[1])
    seen_s = shot.time_s[shot.valid]
    slow = shaking.below(BELOW_HZ).closer(_APART / float(seen_s[-1] - seen_s[0]))
    if isinstance(shot.noise, Swayed):
        beat, grid = shot.noise.beat, shot.noise.grid
    else:
        knots_s = knots_of(seen_s, collision, touch_s, slow, _ROUGHLY * shot.noise.white_std_m)
        beat, grid = shot.noise, Grid.of(shot.noise, knots_s, shot.time_s, shot.valid)
    return sways_as(shot, beat, grid, slow.less(beat.psd), collision, touch_s)


def sways_as(
    shot: ShotData, beat: Noise, grid: Grid, shaking: Shaking, collision: Collision, touch_time_s: float
) -> ShotData:
    """Return a shot with the noise that a frame makes of it which sways so, and with what its plate may have done."""
    noise = Swayed.of(beat, grid, shaking, collision, touch_time_s)
    return replace(shot, noise=noise, plate_std=plate_swing_std(shaking, collision))


def elsewhere(shots: Sequence[ShotData], shakings: Sequence[Shaking | None], before: Floats, now: Floats) -> bool:
    """Return whether parameters moved so far that the frames' noise is another one."""
    moved = float(np.max(np.abs(now / before - 1.0))) if np.all(before != 0.0) else np.inf
    return any(
        shaking is not None and moved * shaking.rms_m > _MATTERS * shot.noise.std_m
        for shot, shaking in zip(shots, shakings, strict=True)
    )
