"""The motion of the frame during a set of shots: one common spectrum, as sines in bands of one strength each."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.collision import Acts, Effect
from analysis.shot import Floats, Motion, VibrationSpectrum

BELOW_HZ = 1000.0  # frame motion at higher frequencies is part of the beat's noise
_APART = 0.45  # spacing of the sines that represent random motion, in units of one over a shot's length
_SAME_LINE = 0.3  # the same unit: lines of different shots closer than this are one line
_IN_AN_OCTAVE = 3  # bands
_WANDER = 3.0  # density times f^2, over its least value in the fastest octave, up to which motion is path wander


@dataclass(frozen=True)
class Site:
    """The frame's motion, pooled over the shots: sines (``vibration``) and the band index of each, shape (f,).

    The first ``random_bands`` are third-octaves of random motion, slowest first; each further band is one line.
    """

    vibration: VibrationSpectrum
    band: NDArray[np.int64]
    random_bands: int

    @property
    def bands(self) -> int:
        """Get the number of bands; each has one strength."""
        return int(self.band.max(initial=-1)) + 1

    @property
    def moves(self) -> bool:
        """Get whether the frame moves at all."""
        return self.band.size > 0

    def resembles(self, row: Effect) -> bool:
        """Return whether an effect looks like this motion: a sine in the whole shot, or a plate moving at the touch."""
        return self.moves and (row.wave is not None or row.acts is Acts.AT_START)


_NONE = np.empty(0)
STILL_FRAME = Site(VibrationSpectrum(_NONE, _NONE, np.empty(0, dtype=np.bool_)), np.empty(0, dtype=np.int64), 0)


def site_under(
    motions: Sequence[Motion], vibrations: Sequence[VibrationSpectrum | None], least_nm: float, *, whole: bool = False
) -> Site:
    """Return the frame's motion in shots with these spectra; STILL_FRAME if its random part is below ``least_nm`` rms.

    The random spectrum is the mean over the shots.  Lines at one frequency in several shots are one line.  With
    ``whole`` all motion counts as the frame's, else only frequencies at which it exceeds possible path wander.
    """
    known = [vibration.below(BELOW_HZ) for vibration in vibrations if vibration is not None]
    if not known:
        return STILL_FRAME
    length_s = max(float(np.ptp(motion.time_s)) for motion in motions)
    share = 1.0 / len(vibrations)
    apart_hz = _APART / length_s
    frequency = np.arange(0.25 * apart_hz, max(float(one.frequency_hz[-1]) for one in known), apart_hz)
    density = sum(share * one.densities_m2_per_hz(frequency) for one in known)
    power = np.asarray(density * apart_hz)
    quick = frequency.size if whole else _of_the_frame(frequency, power)
    frequency, power = frequency[:quick], power[:quick]
    if quick < 2 or 1e9 * float(np.sqrt(power.sum())) < least_nm:  # optical-path wander only
        return STILL_FRAME
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
    return Site(
        VibrationSpectrum(np.concatenate([frequency, at]), np.concatenate([power, size]), random), band, random_bands
    )


def _of_the_frame(frequency_hz: Floats, power: Floats) -> int:
    """Return how many of the sines, slowest first, are frame motion.

    The motion of a building falls steeply with frequency; the density of optical-path wander falls only with f^2.
    Where the spectrum has fallen to the level of path wander, the motion is not the frame's.
    """
    level = power * frequency_hz**2
    above = np.flatnonzero(level > _WANDER * level[frequency_hz >= 0.5 * frequency_hz[-1]].min())
    return int(above[-1]) + 1 if above.size else 1
