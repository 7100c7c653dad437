"""Readings from the fitted model: the kinetic COR of its contact, and the force pulse of a coarse record.

docs/physics.md: e = -(relative velocity out / in) at the first contact, with the plate at rest before.  Ratios of
bounce times depend on the plate's motion between the contacts; this ratio does not.

A camera or an encoder measures positions.  The force is their second derivative, and if its noise is as large as the
force, a peak read from it is noise.  The fit uses all positions together: its peak, width, contact time and deflection
are as certain as its parameters.
"""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from analysis.collision import Collision, Event, Infeasible, solve
from analysis.fitted.fitted_shot import PULSE, READ_FROM_MODEL
from analysis.inference import JointData, Point, Problem, averaged_shots, base_named, trials_of
from analysis.shot import AnalysisError, Fit, Floats, Impact, Motion, NotSeen, Quantity, Reading

_PERIODS = 3.0  # periods of the contact's own oscillation within which the first release is expected
DROWNED = 0.1  # ratio of force noise to the model's peak force, above which a direct reading is mostly noise
INCONSISTENT = "pulse_disagrees"  # peak and width of the direct reading do not match the impulse
IMPULSE_SHARES = (0.5, 1.3)  # peak x width over m (v_out - v_in): 0.94 of a half sine, 1 of a rectangle
HOW = "the fitted model: derivatives of this record carry too little"
_GRID = 1500


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


def with_model_readings(impact: Impact, fit: Fit, motion: Motion) -> Impact:
    """Return the impact with its pulse read from the fitted model, if the force is drowned in noise.

    Otherwise, or if the fit is unusable, the readings are unchanged, and flagged if peak times width disagrees with the
    impulse from velocities and mass.
    """
    if motion.wavelength_m is not None or not fit.converged or len(fit.shots) != 1:
        return impact
    checked = _with_impulse_check(impact, motion.moving_mass_kg)
    try:
        pulse = _pulse(fit, motion)
    except (AnalysisError, Infeasible, KeyError, ValueError, np.linalg.LinAlgError):
        return checked
    stds = motion.force_std_n[np.isfinite(motion.force_std_n)]
    noise_n = float(np.median(stds)) if stds.size else float("nan")
    if not noise_n > DROWNED * pulse["force_peak_n"].value:
        return checked
    return replace(
        checked,
        **pulse,  # type: ignore[arg-type]
        cor_impulse=NotSeen("the force before and after the turn is drowned in noise"),
        stiffness_slope_n_per_m=NotSeen("the force is drowned in noise; the fit gives the contact's stiffness"),
        flags=tuple(dict.fromkeys((*checked.flags, READ_FROM_MODEL))),
    )


def _with_impulse_check(impact: Impact, mass_kg: float) -> Impact:
    """Return the impact, flagged if peak times width disagrees with the block's change of momentum."""
    needed: tuple[Reading, ...] = (
        impact.force_peak_n, impact.force_fwhm_s, impact.velocity_in_m_per_s, impact.velocity_out_m_per_s,
    )  # fmt: skip
    known = [reading for reading in needed if isinstance(reading, Quantity)]
    if len(known) < len(needed):
        return impact
    peak, width, before, after = known
    impulse = mass_kg * (after.value - before.value)
    if not impulse > 0.0:
        return impact
    share = peak.value * width.value / impulse
    if IMPULSE_SHARES[0] <= share <= IMPULSE_SHARES[1]:
        return impact
    return replace(impact, flags=tuple(dict.fromkeys((*impact.flags, INCONSISTENT))))


def _pulse(fit: Fit, motion: Motion) -> dict[str, Quantity]:
    """Return the readings ``PULSE`` of the model's first contact; stds from numerical derivatives of a solved shot."""
    shot = fit.shots[0]
    data = JointData(averaged_shots([motion]), base_named(fit.model))
    own = np.array([q.value for q in (shot.velocity_in_m_per_s, shot.touch_time_s, shot.offset_m)])
    names = list(fit.parameters)
    at = np.array([fit.parameters[name].value for name in names])
    mine = {name: quantity.value for name, quantity in shot.own_parameters.items()}
    fine = np.linspace(*_first_contact_span(shot.touch_time_s.value, fit, motion), _GRID)
    fine_shot = replace(data.shots[0], time_s=fine, used=np.ones(_GRID, dtype=np.bool_))
    problem = Problem(replace(data, shots=(fine_shot,)), trials_of(fit.effects), data.stated_noise)

    def pulse(parameters: Floats, speed: float) -> Floats:
        known = dict(zip(names, parameters, strict=True))
        every = {**mine, **known}
        values = {
            effect: {p.name: float(every[f"{effect.key}.{p.name}"]) for p in effect.parameters}
            for effect in fit.effects
        }
        base = np.array([known[name] for name in data.base.names])
        point = Point(base, np.array([[speed, *own[1:]]]), (values,))
        run = problem.run(0, point)
        changes_s = tuple(e.time_s + own[1] for e in run.log.events if e.kind in ("touch", "release"))
        return _read(fine, run.velocity_m_per_s, run.displacement_m, changes_s, motion.moving_mass_kg)

    here = pulse(at, own[0])
    columns = _derivatives(
        lambda z: pulse(z[:-1], float(z[-1])), np.array([*at, own[0]]), fit, shot.velocity_in_m_per_s.std
    )
    covariance = np.zeros((at.size + 1,) * 2)
    covariance[:-1, :-1] = fit.covariance[: at.size, : at.size]
    covariance[-1, -1] = shot.velocity_in_m_per_s.std**2
    variance = np.diag(max(1.0, fit.reduced_chi2) * columns @ covariance @ columns.T)
    stds = np.sqrt(np.maximum(variance, 0.0))
    return {name: Quantity(float(v), float(s), HOW) for name, v, s in zip(PULSE, here, stds, strict=True)}


def _derivatives(function: Callable[[Floats], Floats], at: Floats, fit: Fit, speed_std: float) -> Floats:
    zero = np.zeros(len(PULSE))
    steps = np.array([*(0.3 * np.sqrt(np.maximum(np.diag(fit.covariance)[: at.size - 1], 0.0))), 0.3 * speed_std])
    moved = zip(steps, steps[:, None] * np.eye(at.size), strict=True)
    columns = [(function(at + by) - function(at - by)) / (2.0 * step) if step > 0.0 else zero for step, by in moved]
    return np.stack(columns, axis=1)


def _first_contact_span(touch_s: float, fit: Fit, motion: Motion) -> tuple[float, float]:
    """Return the time span of the first contact in s, with a margin on both sides."""
    released = [time for kind, time in fit.shots[0].overlay.events_s if kind == "release" and time > touch_s]
    end = released[0] if released else float(motion.time_s[-1])
    return touch_s - 0.25 * (end - touch_s), end + 0.5 * (end - touch_s)


def _read(time_s: Floats, velocity: Floats, displacement: Floats, changes: tuple[float, ...], mass_kg: float) -> Floats:
    """Return peak force, full width at half maximum, contact time and depth of a contact, shape (4,)."""
    force = mass_kg * np.gradient(velocity, time_s)
    top = int(np.argmax(force))
    above = force > 0.5 * force[top]
    first, last = int(np.argmax(above)), int(above.size - 1 - np.argmax(above[::-1]))
    if first == 0 or last == above.size - 1 or len(changes) < 2:
        raise ValueError("the contact is not whole")

    def crossing(a: int, b: int) -> float:
        share = (0.5 * force[top] - force[a]) / (force[b] - force[a])
        return float(time_s[a] + share * (time_s[b] - time_s[a]))

    touch, release = changes[0], changes[1]
    at_touch = float(np.interp(touch, time_s, displacement))
    inside = (time_s >= touch) & (time_s <= release)
    return np.array(
        [
            force[top],
            crossing(last + 1, last) - crossing(first - 1, first),
            release - touch,
            at_touch - float(displacement[inside].min()),
        ]
    )
