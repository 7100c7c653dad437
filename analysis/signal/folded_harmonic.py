"""Detect harmonics that fold onto the beat itself, by the ripple of its amplitude.

Near a third of the sample rate the second harmonic of a distorted beat folds onto the beat, near a quarter the third.
It disturbs the phase there and has the beat's frequency, but its phase is known: it turns ``order + 1`` times as fast
as the beat, in the opposite direction.
"""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
_NEAREST_SHARE = 0.03  # of the motion rate: a slower ripple looks like a change of light
_FARTHEST_SHARE = 0.3  # a faster one is averaged away
_FEWEST = 100  # motion samples
_SIGMA = 5.0


def folded_harmonic(
    phase_cycles: Floats, amplitude_counts: Floats, time_s: Floats, sample_rate_hz: float, rate_hz: float
) -> float:
    """Return the amplitude of a 2nd or 3rd harmonic folded onto the beat, relative to the beat; 0 where none is seen.

    ``phase_cycles`` (n,) is the beat's true phase at ``time_s``, samples of the motion at ``rate_hz``; NaN where not
    known.  Second differences of the amplitude are fitted with those of the ripple, so that slow changes of light do
    not count.
    """
    middle = amplitude_counts[1:-1]
    bend = amplitude_counts[2:] - 2 * middle + amplitude_counts[:-2]
    strongest = 0.0
    for order in (2, 3):
        ripple_hz = np.abs((order + 1) * np.gradient(phase_cycles)[1:-1] * rate_hz - sample_rate_hz)
        use = (ripple_hz > _NEAREST_SHARE * rate_hz) & (ripple_hz < _FARTHEST_SHARE * rate_hz)
        use &= np.isfinite(bend)
        if np.count_nonzero(use) < _FEWEST:
            continue
        wave = np.exp(2j * np.pi * ((order + 1) * phase_cycles - sample_rate_hz * time_s))
        shape = (wave[2:] - 2 * wave[1:-1] + wave[:-2])[use]
        size = float(np.sum(np.abs(shape) ** 2))
        level = float(np.median(middle[use]))
        found = 2 * abs(complex(np.sum(bend[use] * shape.conj()))) / (size * level)
        chance = 2 * float(np.std(bend[use])) / (np.sqrt(size) * level)
        if found > _SIGMA * chance:
            strongest = max(strongest, found)
    return strongest
