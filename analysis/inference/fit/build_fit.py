"""Build a ``Fit`` from the end of a search: quantities, covariance, model curves and residuals."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from analysis.collision import Effect, Floats
from analysis.inference.fit.base import OWN_NAMES
from analysis.inference.fit.response import Response
from analysis.shot import Fit, Motion, Overlay, Quantity, ShotFit, Wander
from analysis.signal import derivatives

_WINDOW = 150  # samples
_LOUD_SIGMAS = 8.0  # standard deviations that a window's chi^2 exceeds its expectation by
_MOST_LOUD = 0.4  # of all windows: where more are loud the model is wrong throughout, not for a moment


@dataclass(frozen=True, slots=True)
class Estimate:
    """Parameter values, shape (p,), at the end of a search, and their covariance, shape (p, p), NaN if unknown.

    ``shared`` maps the names of parameters shared by all shots to their indices, in the order of the model's
    derivatives.  ``chosen`` holds values that were set, not fitted; ``free`` counts the parameters that were moved;
    ``how`` names the method in reports.
    """

    model: str
    effects: tuple[Effect, ...]
    values: Floats
    covariance: Floats
    shared: Mapping[str, int]
    free: int
    converged: bool
    how: str
    chosen: Mapping[str, float] = field(default_factory=dict)
    flags: tuple[str, ...] = ()

    def quantity(self, place: int) -> Quantity:
        """Return the parameter at an index, with its uncertainty."""
        return Quantity(float(self.values[place]), float(np.sqrt(self.covariance[place, place])), self.how)


@dataclass(frozen=True, slots=True)
class Path:
    """The model's curves of one shot on the motion's own time grid, arrays of shape (n,).

    ``displacement_m`` is what the optics would show.  ``velocity_out`` is the velocity after the last release, with its
    derivatives by (shared, own) parameters; None where the record ends in contact.
    """

    displacement_m: Floats
    plate_m: Floats
    gap_m: Floats
    events_s: tuple[tuple[str, float], ...]
    velocity_out: tuple[float, Floats] | None

    @classmethod
    def of(cls, response: Response, touch_time_s: float) -> "Path":
        """Return the curves of a solved shot."""
        shown = tuple((e.kind, e.time_s + touch_time_s) for e in response.log.events if e.kind in ("touch", "release"))
        return cls(response.displacement_m, response.plate_displacement_m, response.gap_m, shown, response.velocity_out)


@dataclass(frozen=True, slots=True)
class Part:
    """One shot of a fit: indices of its own parameters (v_i, touch and offset first), model curves and residual.

    ``whitened`` is the residual of each fitted sample, of unit variance if it is noise; ``used``, shape (n,), marks the
    motion's samples that were fitted.  ``frame_m_per_s`` is the std of velocities relative to the frame minus those in
    space, before the touch and after the release; ``sway_std_m`` is the std that the frame's motion leaves in each
    sample's residual (None: no moving frame).
    """

    motion: Motion
    own: Mapping[str, int]
    path: Path
    used: NDArray[np.bool_]
    whitened: Floats
    plate_number: int = 0
    frame_m_per_s: tuple[float, float] = (0.0, 0.0)
    sway_std_m: Floats | None = None


def build_fit(
    estimate: Estimate,
    parts: Sequence[Part],
    noise_std_m: float,
    wander: Wander,
    seconds: float,
) -> Fit:
    """Return the fit; ``noise_std_m`` is that of one sample of the motion, ``wander`` as ``Fit`` has it.

    Parameters of effects that differ from shot to shot are in the shots' own parts.
    """
    places = list(estimate.shared.values())
    chi2 = float(sum(part.whitened @ part.whitened for part in parts))
    samples = sum(part.whitened.size for part in parts)
    parameters = {name: estimate.quantity(place) for name, place in estimate.shared.items()}
    parameters |= {name: Quantity(value, 0.0, "chosen") for name, value in estimate.chosen.items()}
    converged = estimate.converged and bool(np.all(np.isfinite(np.diag(estimate.covariance))))
    return Fit(
        model=estimate.model,
        parameters=parameters,
        covariance=np.pad(estimate.covariance[np.ix_(places, places)], (0, len(estimate.chosen))),
        shots=tuple(_shot_fit(estimate, part) for part in parts),
        reduced_chi2=chi2 / max(1, samples - estimate.free),
        noise_std_m=noise_std_m,
        wander=wander,
        converged=converged,
        effects=estimate.effects,
        flags=((() if converged else ("fit_not_converged",)) + estimate.flags),
        seconds=seconds,
        chi2=chi2,
        samples=samples,
        free_parameters=estimate.free,
        on_frames=any(part.frame_m_per_s[0] > 0.0 for part in parts),
    )


def _shot_fit(estimate: Estimate, part: Part) -> ShotFit:
    path, motion = part.path, part.motion
    places = [*estimate.shared.values(), *part.own.values()]
    own = {name: estimate.quantity(place) for name, place in part.own.items()}
    velocity_in, touch_time, offset = (own.pop(name) for name in OWN_NAMES)
    velocity_out = Quantity(math.nan, math.nan, "the record ends in contact")
    if path.velocity_out is not None:
        value, slope = path.velocity_out
        variance = float(slope @ estimate.covariance[np.ix_(places, places)] @ slope)
        velocity_out = Quantity(value, math.hypot(math.sqrt(max(variance, 0.0)), part.frame_m_per_s[1]), estimate.how)
    # the model's speeds are relative to the frame, the speeds read from a motion are not
    velocity_in = replace(velocity_in, std=math.hypot(velocity_in.std, part.frame_m_per_s[0]))
    return ShotFit(
        velocity_in_m_per_s=velocity_in,
        velocity_out_m_per_s=velocity_out,
        touch_time_s=touch_time,
        offset_m=offset,
        overlay=_overlay(motion, path.displacement_m, path.plate_m, path.gap_m, path.events_s),
        residual_m=np.where(part.used, motion.displacement_m - path.displacement_m, np.nan),
        reduced_chi2=float(part.whitened @ part.whitened) / max(1, part.whitened.size - len(places)),
        own_parameters=own,
        rings=_has_loud_moment(part.whitened),
        sway_std_m=part.sway_std_m,
        plate_number=part.plate_number,
    )


def _overlay(
    motion: Motion,
    displacement_m: Floats,
    plate_displacement_m: Floats,
    gap_m: Floats,
    events_s: tuple[tuple[str, float], ...],
) -> Overlay:
    """Return the overlay of a solved shot; ``displacement_m`` is the model's as the optics would see it.

    Velocity and force are its derivatives through the motion's own filters, so that model and measurement are
    smeared alike.
    """
    velocity, acceleration = derivatives(displacement_m, motion.sample_rate_hz, motion.bandwidth_hz)
    return Overlay(
        time_s=motion.time_s,
        displacement_m=displacement_m,
        velocity_m_per_s=velocity,
        force_n=motion.moving_mass_kg * acceleration,
        deflection_m=plate_displacement_m,
        gap_m=gap_m,
        events_s=events_s,
    )


def _has_loud_moment(whitened: Floats) -> bool:
    """Return whether a whitened residual, shape (n,), is too large only for a moment, as where a plate rings."""
    count = whitened.size // _WINDOW
    if count < 2:
        return False
    chi2 = (whitened[: count * _WINDOW] ** 2).reshape(count, _WINDOW).sum(axis=1)
    quiet = float(np.median(chi2)) / _WINDOW
    loud = chi2 / max(quiet, 1e-300) - _WINDOW > _LOUD_SIGMAS * math.sqrt(2.0 * _WINDOW)
    return bool(loud.any() and loud.mean() <= _MOST_LOUD)
