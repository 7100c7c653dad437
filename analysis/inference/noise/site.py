"""The motion of the frame under a set of shots: one spectrum for all, as sines in bands of one strength each."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.collision import Acts, Effect
from analysis.shot import Floats, Shaking

BELOW_HZ = 1000.0  # faster motion of the frame is part of the noise of the beat
_APART = 0.45  # spacing, times one over a shot's length, of the sines that stand for random motion
_SAME_LINE = 0.3  # the same unit: lines of different shots closer than that are one line
_IN_AN_OCTAVE = 3  # bands
_WANDER = 3.0  # times the least density in the fastest octave, both times f^2: below, the optical path wanders


@dataclass(frozen=True)
class Site:
    """The frame's motion, pooled over the shots: sines (``shaking``) and the band of each, shape (f,).

    The first ``random_bands`` are third-octaves of random motion, slowest first; each further band is one line.
    """

    shaking: Shaking
    band: NDArray[np.int64]
    random_bands: int

    @property
    def bands(self) -> int:
        """Get the number of bands, each with a strength."""
        return int(self.band.max(initial=-1)) + 1


def resembles_frame_motion(row: Effect) -> bool:
    """Return whether a moving frame has the same effect: a sine all along the shot, or a plate that swings at first."""
    return row.wave is not None or row.acts is Acts.AT_START


def site_of(
    shakings: Sequence[Shaking | None], length_s: float, least_nm: float, *, whole: bool = False
) -> Site | None:
    """Return the frame's motion shown by shots of ``length_s``; None where random motion is below ``least_nm`` rms.

    The random spectrum is the mean over the shots; lines at one frequency in several shots are one line.  With
    ``whole`` all motion counts as the frame's, otherwise only up to where it falls to what an optical path may wander.
    """
    known = [shaking.below(BELOW_HZ) for shaking in shakings if shaking is not None]
    if not known:
        return None
    share = 1.0 / len(shakings)
    apart_hz = _APART / length_s
    frequency = np.arange(0.25 * apart_hz, max(float(one.frequency_hz[-1]) for one in known), apart_hz)
    density = sum(share * one.densities_m2_per_hz(frequency) for one in known)
    power = np.asarray(density * apart_hz)
    quick = frequency.size if whole else _of_the_frame(frequency, power)
    frequency, power = frequency[:quick], power[:quick]
    if quick < 2 or 1e9 * float(np.sqrt(power.sum())) < least_nm:  # only the optical path wanders
        return None
    third = np.floor(_IN_AN_OCTAVE * np.log2(np.maximum(frequency / frequency[1], 1.0)))
    band = np.unique(third, return_inverse=True)[1]
    at = np.concatenate([one.frequency_hz[~one.random] for one in known])
    size = share * np.concatenate([one.power_m2[~one.random] for one in known])
    order = np.argsort(at)
    at, size = at[order], size[order]
    apart = np.diff(at, prepend=-np.inf) > _SAME_LINE / length_s
    random_bands = int(band.max()) + 1
    band = np.concatenate([band, random_bands - 1 + np.cumsum(apart)]).astype(np.int64)
    random = np.arange(band.size) < frequency.size
    return Site(Shaking(np.concatenate([frequency, at]), np.concatenate([power, size]), random), band, random_bands)


def _of_the_frame(frequency_hz: Floats, power: Floats) -> int:
    """Return how many of the sines, slowest first, are motion of the frame.

    The motion of a building falls steeply with frequency; the density of a wandering optical path falls only with f^2.
    Where the spectrum is no higher than the latter, the motion is not the frame's.
    """
    level = power * frequency_hz**2
    above = np.flatnonzero(level > _WANDER * level[frequency_hz >= 0.5 * frequency_hz[-1]].min())
    return int(above[-1]) + 1 if above.size else 1
