"""The shots that are judged together: averaged, weighed against each other, and with what the site did to each."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from analysis.collision import Infeasible
from analysis.compiled import side_by_side
from analysis.inference.fit.begin import Begin
from analysis.inference.fit.samples import RATE_HZ, Samples, together
from analysis.inference.fit.search_vector import JointData
from analysis.inference.noise.site import Site, on_site, site_of
from analysis.inference.noise.sway import BELOW_HZ
from analysis.reading import shaking_in
from analysis.shot import Motion, Shaking

Floats = NDArray[np.float64]
_FEWEST_A_TURN = 10.0  # samples of what shakes fastest


def can_tell(motion: Motion) -> bool:
    """Return whether a motion's samples are close enough to tell the frame's motion from the optics' noise."""
    return motion.sample_rate_hz >= _FEWEST_A_TURN * BELOW_HZ


def shakings_of(
    motions: Sequence[Motion], model: str, known: Sequence[Shaking | None] | None
) -> tuple[Shaking | None, ...]:
    """Return what shook the frame of each shot, as ``known`` or as read here; nothing where ``model`` cannot tell.

    Cost of reading: some 0.1 s a shot.
    """
    if model != "paper" or not all(can_tell(motion) for motion in motions):
        return (None,) * len(motions)
    return tuple(known if known is not None else side_by_side(shaking_in, motions))


def site_under(
    motions: Sequence[Motion], shakings: Sequence[Shaking | None], least_nm: float, *, whole: bool = False
) -> Site | None:
    """Return the site that shots with these shakings tell of; arguments as ``site_of``'s."""
    return site_of(shakings, max(float(np.ptp(motion.time_s)) for motion in motions), least_nm, whole=whole)


def joint_data(motions: Sequence[Motion], begin: Begin, site: Site | None, rate_hz: float = RATE_HZ) -> JointData:
    """Return the shots as a diagnosis judges them; the site acts at the motion that ``begin`` says.

    A plate that a building swings far is no small matter: what is known of it is where the site's part begins.
    """
    base = begin.base
    plain = together(motions, rate_hz)
    if site is None:
        return JointData(plain, base)
    try:
        shots = on_site(with_plates(plain, begin.plates), site, base, begin.shared, begin.own)
        return JointData(shots, base, site=site)
    except Infeasible:  # drawn to where nothing collides: nobody can say what a frame would do there
        return JointData(plain, base)


def with_plates(shots: Sequence[Samples], plates: Sequence[tuple[float, float]]) -> tuple[Samples, ...]:
    """Return the shots with what is known of each one's plate at first touch, where there is any."""
    return tuple(replace(s, plate=plate) for s, plate in zip(shots, plates, strict=True)) if plates else tuple(shots)
