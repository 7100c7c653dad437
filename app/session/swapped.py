"""Whether PD0 and PD1 of a shot are swapped: then the block seems to be pulled away from the plate, not pushed."""

from dataclasses import replace

import numpy as np

from analysis.shot import Shot

WORDS = "the block moves the other way: are PD0 and PD1 swapped?"
FURTHER = 3.0  # times the largest push: a pull that strong is a push with its sign turned round
CLEAR = 20.0  # times the noise of the force


def told_if_swapped(shot: Shot) -> Shot:
    """Return a shot in which no impact was found with the probable reason as its problem; else as it is.

    A plate can only push the block.  A contact's force with its sign turned round pulls, while the block leaves at
    about the speed at which it came.
    """
    motion = shot.motion
    if motion is None or shot.impact is not None or shot.settings.model == "driven" or shot.problem is None:
        return shot
    force, std = motion.force_n[motion.valid], motion.force_std_n[motion.valid]
    if force.size == 0 or not np.isfinite(force).any():
        return shot
    pull, push, noise = -float(np.nanmin(force)), float(np.nanmax(force)), float(np.nanmedian(std))
    if not (pull > FURTHER * max(push, 0.0) and pull > CLEAR * noise):
        return shot
    return replace(shot, problem=WORDS)


def is_swapped(shot: Shot | None) -> bool:
    """Return whether a shot's analysis says that its PD0 and PD1 are swapped."""
    return shot is not None and shot.problem is not None and "swapped" in shot.problem
