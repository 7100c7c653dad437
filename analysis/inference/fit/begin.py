"""Where a search begins: parameters of the base model, and each shot's own."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.inference.fit.base import Base, base_of
from analysis.shot.fit import Fit
from analysis.shot.motion import Motion

Floats = NDArray[np.float64]
Plates = tuple[tuple[float, float], ...]
TRUSTED = 1.5  # chi^2 per sample, up to which likeliest plates are believed: above, they absorb missing effects


@dataclass(frozen=True, slots=True)
class Begin:
    """The start of a search: base model, its parameters (b,), and v_i, touch time and offset of each shot (shots, 3).

    ``plates`` are the plates' states at first touch (m, m/s), if known; ``left`` is chi^2 per sample there.
    """

    base: Base
    shared: Floats
    own: Floats
    plates: Plates = ()
    left: float = 1.0


def begin_of(fit: Fit, motions: Sequence[Motion]) -> Begin:
    """Return the end of a fit of ``motions``, without its effects, as the start of a search."""
    base = base_of(fit.model, motions)
    own = [[s.velocity_in_m_per_s.value, s.touch_time_s.value, s.offset_m.value] for s in fit.shots]
    shared = np.array([fit.parameters[name].value for name in base.names])
    return Begin(base, shared, np.array(own), left=fit.reduced_chi2)
