"""The fitted model of a shot: what the fit returns, whoever computed it."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from analysis.quantity import Quantity

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Overlay:
    """The fitted model on the motion's own time grid and through the motion's own filters; arrays of shape (n,).

    ``displacement_m`` carries the fitted offset, so that it lies over the measured one; ``gap_m`` is x_b - x_p
    (negative: overlap); ``deflection_m`` is the plate's displacement from rest.
    """

    time_s: Floats
    displacement_m: Floats
    velocity_m_per_s: Floats
    force_n: Floats
    deflection_m: Floats
    gap_m: Floats
    events_s: tuple[tuple[str, float], ...] = ()  # ("touch" | "release", time), in order


@dataclass(frozen=True, slots=True)
class ShotFit:
    """One shot's part of a fit: its own start values, its overlay and its remainder."""

    velocity_in_m_per_s: Quantity
    velocity_out_m_per_s: Quantity
    touch_time_s: Quantity
    offset_m: Quantity
    overlay: Overlay
    residual_m: Floats  # measured - model displacement, NaN outside the fitted samples
    reduced_chi2: float
    own_parameters: Mapping[str, Quantity] = field(default_factory=dict)  # of effects that differ from shot to shot
    rings: bool = False  # for a moment it moves as neither the model nor the noise would
    sway_std_m: Floats | None = None  # of what a frame that was weighed leaves in the residual, shape (n,)


@dataclass(frozen=True, slots=True)
class Fit:
    """A model fitted to one shot or to several at once (shared plate and contact, own start a shot).

    ``parameters`` maps the names of the result file ("plate_stiffness_n_per_m", ...; effects as "effect.parameter") to
    quantities, ``covariance`` is over them in that order.  ``converged`` False makes every number a guess: callers
    show the flag, not the number.
    """

    model: str
    parameters: Mapping[str, Quantity]
    covariance: Floats
    shots: tuple[ShotFit, ...]
    reduced_chi2: float
    noise_std_m: float  # of one displacement sample, from the quiet flight
    converged: bool
    effects: tuple[str, ...] = ()
    flags: tuple[str, ...] = ()
    seconds: float = 0.0
    chi2: float = float("nan")  # whitened, over ``samples`` samples and ``free_parameters`` parameters
    samples: int = 0
    free_parameters: int = 0
    on_frames: bool = False  # whether what shook the frames was weighed, and the plates were let swing

    def of_shot(self, index: int) -> "Fit":
        """Return the fit as one shot's own: the shared parameters as all shots give them, the part of this one."""
        part = self.shots[index]
        return replace(self, shots=(part,), reduced_chi2=part.reduced_chi2)
