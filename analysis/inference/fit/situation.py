"""One shot of the model from named parameters: its collision, the effects that act, the sensor, limits of speed."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from analysis.collision import (
    Active,
    Acts,
    Collision,
    Effect,
    Infeasible,
    Sensed,
    active_effects,
    fastest_rates,
    sensors,
)
from analysis.shot import Floats

Values = Mapping[Effect, Mapping[str, float]]
_MOST_RADIANS = 60.0  # of the fastest oscillation between two averaged samples: a trajectory follows no faster one
_AT_REST = {"displacement_m": 0.0, "velocity_m_per_s": 0.0}


@dataclass(frozen=True, slots=True)
class Optics:
    """Input of the sensor's effects: wavelength in m (None: no optics) and sample rate of the record in Hz."""

    wavelength_m: float | None
    sample_rate_hz: float


def too_fast(base: Floats, own: Floats, values: Values, mass_kg: float, spacing_s: float, factor: int) -> bool:
    """Return whether something oscillates faster than samples ``spacing_s / factor`` apart can resolve.

    Or faster than a trajectory follows at samples ``spacing_s`` apart.
    """
    collision, active = situation(base, own, values, mass_kg)
    rates = fastest_rates(collision, active)
    return max(rates.contact, rates.every) > fastest_shown(spacing_s, factor)


def fastest_shown(spacing_s: float, factor: int) -> float:
    """Return the fastest oscillation in rad/s that ``too_fast`` allows."""
    return min(math.pi * factor, _MOST_RADIANS) / spacing_s


def situation(base: Floats, own: Floats, values: Values, mass_kg: float) -> tuple[Collision, list[Active]]:
    """Return a shot's collision and the effects that act on its motion, those with hidden states first.

    Raises Infeasible where the parameters give no collision.
    """
    start = next((given for effect, given in values.items() if effect.acts is Acts.AT_START), _AT_REST)
    try:
        k_p, m_p, k_n, gamma_n = (float(value) for value in base)
        y_0, u_0 = start["displacement_m"], start["velocity_m_per_s"]
        if own.size > 3:
            y_0, u_0 = y_0 + float(own[3]), u_0 + float(own[4])
        collision = Collision(mass_kg, float(own[0]), k_p, m_p, k_n, gamma_n, y_0, u_0)
    except ValueError as why:
        raise Infeasible(str(why)) from why
    active = active_effects(list(values), values, collision, float(own[1]))
    if any(math.isnan(value) for one in active for value in one.values):
        raise Infeasible("a parameter is not a number")
    return collision, sorted(active, key=lambda one: one.effect.hidden == 0)


def shown_by_optics(x: Any, v: Floats, time_s: Floats, values: Values, optics: Optics) -> Any:
    """Return what the optics show of motions ``x``, shape (n,) or (n, k), after all effects of the sensor.

    ``v``, shape (n,), is the velocity about which ``x`` is taken.  The imaginary part of a complex ``x`` carries a
    derivative.
    """
    wavelength = optics.wavelength_m
    sensed = Sensed(time_s, v, math.nan if wavelength is None else wavelength, optics.sample_rate_hz)
    out = x.reshape(x.shape[0], math.prod(x.shape[1:]))
    for row in sensors(values):
        assert row.sensor is not None
        given = values[row]
        if (row.optical and wavelength is None) or given[row.amplitude] == 0.0:
            continue
        p = np.zeros((max(3, len(row.parameters)), out.shape[1]), dtype=out.dtype)
        for place, parameter in enumerate(row.parameters):
            p[place] = given[parameter.name]
        out = row.sensor(sensed, out, p)
    return np.asarray(out).reshape(x.shape)
