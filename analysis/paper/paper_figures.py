"""The curves of the paper's figures 4 to 7, measured and simulated."""

from dataclasses import dataclass

import numpy as np

from analysis.collision import Collision, solve
from analysis.shot import Floats, Quantity, Shot

_STEP_S = 2e-6
MARGIN_S = 3e-3
FIRST_CONTACT_MS = (-0.2, 4.5)  # time span of Fig. 5: touch, bounces, until the force has settled
LABELS = {
    "time_ms": "time after touch (ms)",
    "velocity_m_per_s": "velocity (m/s)",
    "force_n": "force (N)",
    "deflection_mm": "deflection (mm)",
    "gap_um": "gap (µm)",
}


@dataclass(frozen=True, slots=True)
class Curve:
    """One curve in the units of its axes; arrays of shape (n,)."""

    x: Floats
    y: Floats


@dataclass(frozen=True, slots=True)
class Row:
    """A pair of plots with the same axes; ``measured`` is None if nothing was measured, and ``missing`` says why."""

    x_label: str
    y_label: str
    measured: Curve | None
    simulated: Curve
    missing: str = ""


@dataclass(frozen=True, slots=True)
class Figure:
    number: int
    title: str
    rows: tuple[Row, ...]


def plate_from_force(time_s: Floats, force_n: Floats, plate_stiffness_n_per_m: float, plate_mass_kg: float) -> Floats:
    """Return the displacement in m, (n,), of a plate initially at rest, from the force between block and plate.

    m_p* x_p'' = -k_p x_p - F (Eq. 4), with the force linear between samples.  The optics do not see the plate.
    """
    from scipy.signal import lsim  # slow import (all of scipy.stats): not at every start

    system = (
        np.array([[0.0, 1.0], [-plate_stiffness_n_per_m / plate_mass_kg, 0.0]]),
        np.array([[0.0], [-1.0 / plate_mass_kg]]),
        np.array([[1.0, 0.0]]),
        np.zeros((1, 1)),
    )
    _, displacement, _ = lsim(system, force_n, time_s - time_s[0])
    return np.asarray(displacement, dtype=np.float64)


def figures(collision: Collision, shot: Shot | None = None) -> tuple[Figure, ...]:
    """Return figures 4 to 7: ``collision`` simulated, and ``shot`` if it shows an impact.

    The simulation uses the shot's velocity, so that both columns show the same collision.
    """
    seen = None if shot is None else _measured(shot, collision)
    why = "" if seen is not None else "no recording" if shot is None else shot.problem or "no impact in this shot"
    if seen is not None:
        collision = collision.at_speed(seen.velocity_in_m_per_s)
    model = _simulated(collision)

    def row(x: str, y: str, span_ms: tuple[float, float] | None = None) -> Row:
        measured = None if seen is None else seen.curve(x, y, span_ms)
        return Row(LABELS[x], LABELS[y], measured, model.curve(x, y, span_ms), why)

    return (
        Figure(4, "velocity and force", (row("time_ms", "velocity_m_per_s"), row("time_ms", "force_n"))),
        Figure(5, "force at the first contact", (row("time_ms", "force_n", FIRST_CONTACT_MS),)),
        Figure(6, "force against deflection", (row("deflection_mm", "force_n"),)),
        Figure(7, "gap between the bodies", (row("time_ms", "gap_um", FIRST_CONTACT_MS),)),
    )


@dataclass(frozen=True, slots=True)
class _Course:
    """A collision from just before the touch to just after the release; arrays of shape (n,)."""

    time_ms: Floats
    velocity_m_per_s: Floats
    force_n: Floats
    deflection_mm: Floats
    gap_um: Floats
    velocity_in_m_per_s: float

    def curve(self, x: str, y: str, span_ms: tuple[float, float] | None) -> Curve:
        low, high = span_ms or (self.time_ms[0], self.time_ms[-1])
        inside = (self.time_ms >= low) & (self.time_ms <= high)
        return Curve(getattr(self, x)[inside], getattr(self, y)[inside])


def _simulated(collision: Collision) -> _Course:
    time = np.arange(-MARGIN_S, 1.03 * collision.contact_time_estimate_s + MARGIN_S, _STEP_S)
    run = solve(collision, (), time)
    return _Course(
        time_ms=time * 1e3,
        velocity_m_per_s=run.velocity_m_per_s,
        force_n=run.force_n,
        deflection_mm=-run.displacement_m * 1e3,
        gap_um=run.gap_m * 1e6,
        velocity_in_m_per_s=collision.velocity_in_m_per_s,
    )


def _measured(shot: Shot, collision: Collision) -> _Course | None:
    motion, impact = shot.motion, shot.impact
    if motion is None or impact is None:
        return None
    touch, into, release = impact.touch_time_s, impact.velocity_in_m_per_s, impact.release_time_s
    if not isinstance(touch, Quantity) or not isinstance(into, Quantity) or not isinstance(release, Quantity):
        return None
    inside = (motion.time_s >= touch.value - MARGIN_S) & (motion.time_s <= release.value + MARGIN_S)
    if inside.sum() < 16 or not np.isfinite(motion.force_n[inside]).all():
        return None
    time = motion.time_s[inside] - touch.value
    k_p, m_p = collision.plate_stiffness_n_per_m, collision.plate_mass_kg
    if shot.fit is not None and shot.fit.converged and "plate_mass_kg" in shot.fit.parameters:
        k_p = shot.fit.parameters["plate_stiffness_n_per_m"].value
        m_p = shot.fit.parameters["plate_mass_kg"].value
    force = motion.force_n[inside]
    plate = plate_from_force(time, force, k_p, m_p)
    # the touch lies between two samples; its displacement is extrapolated from the flight
    flying = time < -0.2 * MARGIN_S
    displacement = motion.displacement_m[inside]
    displacement = displacement - float(np.mean(displacement[flying] - into.value * time[flying]))
    return _Course(
        time_ms=time * 1e3,
        velocity_m_per_s=motion.velocity_m_per_s[inside],
        force_n=force,
        deflection_mm=-displacement * 1e3,
        gap_um=(displacement - plate) * 1e6,
        velocity_in_m_per_s=into.value,
    )
