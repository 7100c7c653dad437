"""The result of fitting a model to one or several shots."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from analysis.collision import Effect, Floats
from analysis.shot.quantity import Quantity

Wander = tuple[tuple[float, float], ...]  # Ornstein-Uhlenbeck terms of the noise: (rms in m, correlation time in s)
_FURTHER = re.compile(r"plate_(\d+)_(.+)")  # a further plate's stiffness or mass


def count_plates(names: Iterable[str]) -> int:
    """Return the number of plates to which a fit's parameter ``names`` belong."""
    return 1 + len({match[1] for name in names if (match := _FURTHER.match(name))})


def names_on_plate(names: Iterable[str], plate_number: int) -> dict[str, str]:
    """Return a fit's parameter names for one plate, keyed by the names used in a fit with a single plate."""
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

    ``displacement_m`` includes the fitted offset, so that it overlays the measured displacement.  ``gap_m`` is
    x_b - x_p (negative: overlap).
    """

    time_s: Floats
    displacement_m: Floats
    velocity_m_per_s: Floats
    force_n: Floats
    gap_m: Floats
    events_s: tuple[tuple[str, float], ...] = ()  # ("touch" | "release", time), in order


@dataclass(frozen=True, slots=True)
class ShotFit:
    """One shot's part of a fit: its own start values, its overlay and its residual."""

    velocity_in_m_per_s: Quantity
    velocity_out_m_per_s: Quantity
    touch_time_s: Quantity
    offset_m: Quantity
    overlay: Overlay
    residual_m: Floats  # measured - model displacement, NaN outside the fitted samples
    reduced_chi2: float
    own_parameters: Mapping[str, Quantity] = field(default_factory=dict)  # effect parameters fitted per shot
    rings: bool = False  # the residual briefly exceeds what model and noise allow
    sway_std_m: Floats | None = None  # standard deviation of the frame motion in the residual, shape (n,)
    plate_number: int = 0  # index of the shot's plate within the set


@dataclass(frozen=True, slots=True)
class Fit:
    """A model fitted to one shot, or jointly to several that share plate and contact but not their start values.

    ``parameters`` maps the names of the result file to quantities: "plate_stiffness_n_per_m" (on a second plate
    "plate_2_stiffness_n_per_m"); an effect's parameters carry its key as prefix.  ``covariance`` has the same order.
    If ``converged`` is False every number is a guess: callers show the flag, not the number.
    """

    model: str
    parameters: Mapping[str, Quantity]
    covariance: Floats
    shots: tuple[ShotFit, ...]
    reduced_chi2: float
    noise_std_m: float  # noise of one displacement sample, from the quiet flight
    converged: bool
    effects: tuple[Effect, ...] = ()
    flags: tuple[str, ...] = ()
    seconds: float = 0.0
    chi2: float = float("nan")  # whitened, over ``samples`` samples and ``free_parameters`` parameters
    samples: int = 0
    free_parameters: int = 0
    wander: Wander = ()
    on_frames: bool = False  # frame vibration is part of the noise, and the plates may move before the touch

    @property
    def correlations(self) -> Floats:
        """Get the correlations of ``parameters``, shape (n, n); NaN for a parameter without variance."""
        variance = np.diag(self.covariance)
        with np.errstate(invalid="ignore"):
            std = np.sqrt(np.where((variance > 0.0) & np.isfinite(variance), variance, np.nan))
        return np.asarray(self.covariance / np.outer(std, std), np.float64)

    @property
    def short_names(self) -> dict[str, str]:
        """Get the parameters' short names, keyed as in ``parameters``, by an effect's name in place of its key."""
        of_effects = {f"{e.key}.{p.name}": f"{e.name}.{p.name}" for e in self.effects for p in e.parameters}
        return {name: of_effects.get(name, name) for name in self.parameters}

    def of_shot(self, index: int) -> "Fit":
        """Return the fit reduced to one shot; the shared parameters remain those fitted to all shots."""
        part = self.shots[index]
        return replace(self.on_plate(part.plate_number), shots=(part,), reduced_chi2=part.reduced_chi2)

    def on_plate(self, plate_number: int) -> "Fit":
        """Return the fit with the parameters of one plate only, under the names of a fit with a single plate."""
        called = names_on_plate(self.parameters, plate_number)
        if len(called) == len(self.parameters):
            return self
        places = [list(self.parameters).index(name) for name in called.values()]
        return replace(
            self,
            parameters={plain: self.parameters[name] for plain, name in called.items()},
            covariance=self.covariance[np.ix_(places, places)],
        )
