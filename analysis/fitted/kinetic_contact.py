"""The kinetic COR of the fitted contact: relative velocity out over relative velocity in, at the first contact.

docs/physics.md: e = -(relative velocity out / in) at the first contact, with the plate at rest before.  Ratios of
bounce times depend on the plate's motion between the contacts; this ratio does not.
"""

import math

import numpy as np

from analysis.collision import Collision, Event, Infeasible, solve
from analysis.inference import base_named
from analysis.shot import Fit, NotSeen, Quantity, Reading
from levimass import is_drive

_PERIODS = 3.0  # periods of the contact's own oscillation within which the first release is expected


def contact_cor(collision: Collision) -> float:
    """Return e = -(v_b - v_p)_out / (v_b - v_p)_in of the first contact; NaN if it never releases."""
    out = _first_release(collision, derivatives=False)
    return math.nan if out is None else _ratio(collision, out)


def fitted_contact_cor(fit: Fit, block_mass_kg: float) -> Reading:
    """Return e of the fitted contact with its standard uncertainty from the fit's covariance.

    The model is linear within a contact, and its plate is at rest before.  Therefore e does not depend on the velocity,
    nor on the mass, which scales every parameter alike.
    """
    if not fit.converged:
        return NotSeen("the fit did not converge")
    if is_drive(fit.model):
        return NotSeen("a driven slider has no contact")
    foreign = sorted(effect.name for effect in fit.effects if effect.changes_contact)
    if foreign:
        return NotSeen(f"with {', '.join(foreign)} the first contact has no single COR of its own")
    values = {name: quantity.value for name, quantity in fit.parameters.items()}
    try:
        base = base_named(fit.model)
        shared = np.array([values[name] for name in base.names])
        collision = base.collision(shared, -1.0, values.get("moving_mass_kg", block_mass_kg))
    except (KeyError, ValueError, Infeasible) as why:
        return NotSeen(f"the fitted model has no contact: {why}")
    try:
        release = _first_release(collision, derivatives=True)
    except ArithmeticError:  # time scales of contact and plate too different for one solution
        return NotSeen("the fitted contact cannot be followed to its end")
    if release is None:
        return NotSeen("the fitted contact never lets go")
    slope = -(release.state_derivatives[:4, 1] - release.state_derivatives[:4, 3]) / collision.velocity_in_m_per_s
    column, names = base.columns(0), list(fit.parameters)
    gradient = np.array([slope[column[name]] if name in column else 0.0 for name in names])
    variance = float(gradient @ fit.covariance[: len(names), : len(names)] @ gradient)
    if not math.isfinite(variance) or variance < 0.0:
        return NotSeen("the fit does not determine its contact")
    return Quantity(_ratio(collision, release), math.sqrt(variance), "-(v_b - v_p) out / in of the fitted contact")


def _first_release(collision: Collision, *, derivatives: bool) -> Event | None:
    """Return the end of the first contact: the overlap is zero or, in the no-tension variant, the force is."""
    reduced = 1.0 / (1.0 / collision.block_mass_kg + 1.0 / collision.plate_mass_kg)
    period = 2.0 * math.pi * math.sqrt(reduced / collision.contact_stiffness_n_per_m)
    relaxation = collision.contact_damping_n_s_per_m / collision.contact_stiffness_n_per_m
    # a bounce on the contact's spring, if it occurs, ends long before the swing on the plate's spring
    bounce = _PERIODS * (period + 5.0 * relaxation)
    for reach in (bounce, 1.1 * collision.contact_time_estimate_s):
        run = solve(collision, (), np.array([0.0, reach]), directions=range(7) if derivatives else ())
        release = next((event for event in run.events if event.kind == "release"), None)
        if release is not None or bounce > 1.1 * collision.contact_time_estimate_s:
            return release
    return None


def _ratio(collision: Collision, release: Event) -> float:
    incoming = collision.velocity_in_m_per_s - collision.plate_velocity_m_per_s
    return float(-(release.state[1] - release.state[3]) / incoming)
