"""The fitted model of a shot: what the fit returns, whoever computed it."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from analysis.shot.quantity import Quantity

Floats = NDArray[np.float64]
_FURTHER = re.compile(r"plate_(\d+)_(.+)")  # a further plate's stiffness or mass


def plates_named(names: Iterable[str]) -> int:
    """Return how many plates a fit's ``names`` tell of."""
    return 1 + len({match[1] for name in names if (match := _FURTHER.match(name))})


def names_on_plate(names: Iterable[str], plate_number: int) -> dict[str, str]:
    """Return what of a fit's ``names`` says of one of its plates, by the name that it has where there is but one."""
    called, further = {}, {}
    for name in names:
        if (match := _FURTHER.match(name)) is None:
            called[name] = name
        elif int(match[1]) == plate_number + 1:
            further[f"plate_{match[2]}"] = name
    return called | further


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
    plate_number: int = 0  # on which of the set's plates it was taken


@dataclass(frozen=True, slots=True)
class Fit:
    """A model fitted to one shot or to several at once (shared plate and contact, own start a shot).

    ``parameters`` maps the names of the result file ("plate_stiffness_n_per_m", ...; of a second plate
    "plate_2_stiffness_n_per_m", ...; effects as "effect.parameter") to quantities, ``covariance`` is over them in that
    order.  ``converged`` False makes every number a guess: callers show the flag, not the number.
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

    @property
    def correlations(self) -> Floats:
        """Get the correlations of ``parameters``, shape (n, n); NaN with a parameter that has no variance."""
        variance = np.diag(self.covariance)
        with np.errstate(invalid="ignore"):
            std = np.sqrt(np.where((variance > 0.0) & np.isfinite(variance), variance, np.nan))
        return np.asarray(self.covariance / np.outer(std, std), np.float64)

    def of_shot(self, index: int) -> "Fit":
        """Return the fit as one shot's own: the shared parameters as all shots give them, the part of this one."""
        part = self.shots[index]
        return replace(self.on_plate(part.plate_number), shots=(part,), reduced_chi2=part.reduced_chi2)

    def on_plate(self, plate_number: int) -> "Fit":
        """Return the fit as one of its plates has it, whose stiffness and mass then have the plain names."""
        called = names_on_plate(self.parameters, plate_number)
        if len(called) == len(self.parameters):
            return self
        places = [list(self.parameters).index(name) for name in called.values()]
        return replace(
            self,
            parameters={plain: self.parameters[name] for plain, name in called.items()},
            covariance=self.covariance[np.ix_(places, places)],
        )
