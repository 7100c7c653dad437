"""Prepare shots that are fitted together: averaged, weighted, and with the contribution of the frame's motion."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from analysis.collision import Infeasible
from analysis.compiled import side_by_side
from analysis.inference.fit.base import SearchStart
from analysis.inference.fit.samples import RATE_HZ, Samples, averaged_shots
from analysis.inference.fit.search_vector import JointData
from analysis.inference.noise.site import Site, on_site, site_of
from analysis.inference.noise.sway import BELOW_HZ
from analysis.reading import shaking_in
from analysis.shot import Motion, Shaking

_FEWEST_A_TURN = 10.0  # samples per period of the fastest motion of a frame


def can_tell(motion: Motion) -> bool:
    """Return whether a motion is sampled fast enough to separate the frame's motion from the optics' noise."""
    return motion.sample_rate_hz >= _FEWEST_A_TURN * BELOW_HZ


def shakings_of(
    motions: Sequence[Motion], model: str, known: Sequence[Shaking | None] | None
) -> tuple[Shaking | None, ...]:
    """Return the frame's motion of each shot, as ``known`` or read from its flights; None where ``model`` has no plate.

    Cost of reading: some 0.1 s per shot.
    """
    if model != "paper" or not all(can_tell(motion) for motion in motions):
        return (None,) * len(motions)
    return tuple(known if known is not None else side_by_side(shaking_in, motions))


def site_under(
    motions: Sequence[Motion], shakings: Sequence[Shaking | None], least_nm: float, *, whole: bool = False
) -> Site | None:
    """Return the common motion of the frame for shots with these shakings; arguments as ``site_of``'s."""
    return site_of(shakings, max(float(np.ptp(motion.time_s)) for motion in motions), least_nm, whole=whole)


def joint_data(motions: Sequence[Motion], begin: SearchStart, site: Site | None, rate_hz: float = RATE_HZ) -> JointData:
    """Return averaged shots for a joint fit, the frame's contribution computed for the motion of ``begin``.

    Where a plate swings far, its likeliest state in ``begin`` is the one about which that contribution is linear.
    """
    base = begin.base
    plain = averaged_shots(motions, rate_hz)
    if site is None:
        return JointData(plain, base)
    try:
        shots = on_site(with_plates(plain, begin.plates), site, base, begin.shared, begin.own)
        return JointData(shots, base, site=site)
    except Infeasible:  # ``begin`` has no collision, so there is no frame contribution to compute
        return JointData(plain, base)


def with_plates(shots: Sequence[Samples], plates: Sequence[tuple[float, float]]) -> tuple[Samples, ...]:
    """Return the shots with each plate's state at first touch (m, m/s), if ``plates`` is not empty."""
    return tuple(replace(s, plate=plate) for s, plate in zip(shots, plates, strict=True)) if plates else tuple(shots)
