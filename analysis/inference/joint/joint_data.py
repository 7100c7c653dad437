"""Shots that are fitted jointly: averaged, weighted, and with the frame's motion as a covariance term."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from analysis.collision import Infeasible
from analysis.compiled import side_by_side
from analysis.inference.model.base import Base, SearchStart
from analysis.inference.model.samples import Samples
from analysis.inference.noise.flights import noise_of_flights
from analysis.inference.noise.floor import Floor, white_by_differences, white_floor
from analysis.inference.noise.site import BELOW_HZ, STILL_FRAME, Site
from analysis.inference.noise.sway import on_site
from analysis.reading import read_frame_motion
from analysis.shot import AnalysisError, Floats, Motion, VibrationSpectrum
from analysis.signal import MIN_NOISE_M
from levimass import PAPER_MODEL

_MIN_A_TURN = 10.0  # least samples per period of the fastest frame motion
_SAMPLES = 100  # fewest third differences for a noise estimate


@dataclass(frozen=True)
class JointData:
    """The shots that are fitted jointly, and the base model.

    ``site`` is the frame's motion.  ``reference_mass_kg`` is the block mass assumed in the search coordinates
    (None: the first shot's).  With it, vectors for a subset of shots have the same coordinates as vectors for the whole
    set.
    """

    shots: tuple[Samples, ...]
    base: Base
    site: Site = STILL_FRAME
    reference_mass_kg: float | None = None

    @property
    def band_hz(self) -> tuple[float, float]:
        """Get the band in Hz in which a sinusoid can be distinguished from a drift and is not aliased."""
        return 2.5 / max(shot.length_s for shot in self.shots), 0.45 / self.shots[0].spacing_s

    @property
    def count(self) -> int:
        """Get the number of shared base parameters."""
        return len(self.base.names)

    def left_m(self, displacement_m: Iterable[Floats]) -> tuple[Floats, ...]:
        """Return measured minus model displacement, averaged, one array for each shot."""
        return tuple(shot.left_m(x) for shot, x in zip(self.shots, displacement_m, strict=True))

    @cached_property
    def noise_of_flights(self) -> Floor:
        """Get the noise estimated from the quiet flights, with the frame's strengths as read from them."""
        return noise_of_flights(self.shots, self.site)[0]

    @property
    def stated_noise(self) -> Floor:
        """Get white noise with the std stated by the first motion."""
        return white_floor(self.shots[0].white_m, self.shots[0].spacing_s)

    @property
    def white_noise(self) -> Floor:
        """Get white noise with the std estimated from third differences; AnalysisError with too few samples."""
        if sum(int(np.count_nonzero(s.valid[3:] & s.valid[:-3])) for s in self.shots) < _SAMPLES:
            raise AnalysisError("too few samples for a diagnosis")
        white_m = white_by_differences([s.displacement_m for s in self.shots], [s.valid for s in self.shots])
        return white_floor(max(white_m, MIN_NOISE_M), self.shots[0].spacing_s)


def frame_motions_of(
    motions: Sequence[Motion], model: str, known: Sequence[VibrationSpectrum | None] | None
) -> tuple[VibrationSpectrum | None, ...]:
    """Return each shot's frame motion, ``known`` or read from its flights; None for all unless it can be included.

    It is included in the "paper" model only, at a sample rate that separates it from the optics' noise.  Cost of
    reading: about 0.1 s per shot.
    """
    if model != PAPER_MODEL or any(motion.sample_rate_hz < _MIN_A_TURN * BELOW_HZ for motion in motions):
        return (None,) * len(motions)
    return tuple(known if known is not None else side_by_side(read_frame_motion, motions))


def joint_data(plain: tuple[Samples, ...], begin: SearchStart, site: Site) -> JointData:
    """Return averaged shots for a joint fit, with the frame's contribution linearised about the motion of ``begin``.

    For a plate that swings far, the linearisation is about its likeliest state in ``begin``.
    """
    base = begin.base
    try:
        return JointData(on_site(plain, site, base, begin.point, begin.plates), base, site)
    except Infeasible:  # ``begin`` has no collision, so there is no frame contribution to compute
        return JointData(plain, base)
