"""Where a search begins: parameters of the base model, and each shot's own."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.inference.fit.base import Base, base_of
from analysis.shot import Fit, Motion

Floats = NDArray[np.float64]
Plates = tuple[tuple[float, float], ...]
TRUSTED = 1.5  # chi^2 a sample, up to which plates are a site's doing: they take up what is missing, too


@dataclass(frozen=True, slots=True)
class Begin:
    """Where a search begins: the base model, its parameters (b,), each shot's v_i, touch and offset (shots, 3).

    ``plates`` is each shot's plate at first touch (m, m/s) where that is known; ``left`` is chi^2 a sample there.
    """

    base: Base
    shared: Floats
    own: Floats
    plates: Plates = ()
    left: float = 1.0


def begin_of(fit: Fit, motions: Sequence[Motion]) -> Begin:
    """Return where a fit of ``motions`` ended, effects apart."""
    base = base_of(fit.model, motions)
    own = [[s.velocity_in_m_per_s.value, s.touch_time_s.value, s.offset_m.value] for s in fit.shots]
    shared = np.array([fit.parameters[name].value for name in base.names])
    return Begin(base, shared, np.array(own), left=fit.reduced_chi2)
