"""The measurement equations of a shot's numbers, as functions of the budget's variables."""

from collections.abc import Callable
from operator import attrgetter

import numpy as np

from analysis.reading import SLOPE_SPAN
from analysis.shot import Impact, Number, Quantity, Reading, compliance_of, corrected_slope
from analysis.uncertainty.budget_sources import ShotSources

FIT_NOISE = "beat noise, through the fit"
Instants = tuple[float, ...]


Equation = Callable[[ShotSources, Reading, str], Number | None]  # (sources, own reading, unit); None: not read
Scale = Callable[[ShotSources], Number]

clock: Scale = attrgetter("timebase")  # scales a time
length: Scale = attrgetter("length_scale")  # a displacement
mass: Scale = attrgetter("mass_scale")


def damping(sources: ShotSources) -> Number:
    """Return the scale of a damping coefficient, force / velocity, from which the length cancels."""
    return sources.mass_scale / sources.timebase


def stiffness(sources: ShotSources) -> Number:
    """Return the scale of a stiffness, mass / time^2; the length cancels, as the model is linear."""
    return sources.mass_scale / sources.timebase**2


def scaled(noise: str, scale: Scale | None = None, *, length_cancels: bool = False) -> Equation:
    """Return the equation of a reading times one scale.

    ``length_cancels`` lists the sources of length in the budget with zero sensitivity.
    """

    def equation(sources: ShotSources, reading: Reading, unit: str) -> Number | None:
        seen = sources.with_type_a(reading, noise, unit)
        if seen is None or scale is None:
            return seen
        number, extent = seen * scale(sources), length(sources)
        return number * extent / extent if length_cancels else number

    return equation


def velocity(noise: str) -> Equation:
    """Return v = lambda_air f_D / 2 / cos a (Eq. 1); an error of the rest frequency shifts both flights equally."""

    def equation(sources: ShotSources, reading: Reading, unit: str) -> Number | None:
        seen = sources.with_type_a(reading, noise, unit)
        return None if seen is None else (seen + sources.rest_velocity_m_per_s) * sources.velocity_scale

    return equation


def deflection(sources: ShotSources, reading: Reading, unit: str) -> Number | None:
    """Return the distance from touch to turnaround; an error of the rest frequency adds a velocity for that time."""
    impact, seen = sources.shot.impact, sources.with_type_a(reading, "beat noise, deflection", unit)
    if seen is None or impact is None:
        return None
    touch, turn = impact.touch_time_s, impact.turnaround_time_s
    lasts_s = turn.value - touch.value if isinstance(touch, Quantity) and isinstance(turn, Quantity) else 0.0
    return (seen - lasts_s * sources.rest_velocity_m_per_s) * sources.length_scale


def slope_of_force(sources: ShotSources, reading: Reading, unit: str) -> Number | None:
    """Return the slope dF/dy, a stiffness; an error of the rest frequency shears the deflection of its line fit."""
    impact = sources.shot.impact
    seen = sources.with_type_a(reading, "beat noise, slope", unit, without_mass=True)
    if seen is None or impact is None:
        return None
    sheared = 1.0 + _slope_error_per_velocity(impact) * sources.rest_velocity_m_per_s
    return seen * sheared * stiffness(sources) * sources.length_scale / sources.length_scale


def _slope_error_per_velocity(impact: Impact) -> float:
    """Return the relative increase of dF/dy, in s/m, per velocity error (m/s) that reduces the deflection over time.

    To first order it is (c t) / (c c) of a least-squares line over centred deflections c, here of half a sine.
    """
    lasts, deepest = impact.contact_time_s, impact.deflection_max_m
    if not isinstance(lasts, Quantity) or not isinstance(deepest, Quantity):
        return 0.0
    at = np.linspace(*SLOPE_SPAN, 200)
    depth = deepest.value * np.sin(np.pi * at)
    centred = depth - depth.mean()
    return float(centred @ (lasts.value * at) / (centred @ centred))


def ratio_of_velocities(sources: ShotSources, reading: Reading, unit: str) -> Number | None:
    """Return the quasi-static COR -v_out / v_in; common sources cancel."""
    into, out = (sources.results.get(f"velocity_{which}_m_per_s") for which in ("in", "out"))
    return None if into is None or out is None else -out / into


def ratio_of_impulses(sources: ShotSources, reading: Reading, unit: str) -> Number | None:
    """Return the ratio of two impulses, each m_b times a difference of velocities; their scales cancel."""
    impulse = sources.with_type_a(reading, "beat noise, impulses", unit)
    one = sources.mass_scale * sources.velocity_scale
    return None if impulse is None else impulse * one / one


def between_peaks(impact: Impact) -> tuple[Instants, Instants]:
    return impact.bounce_peaks_s[:2], impact.bounce_peaks_s[1:3]


def between_onsets(impact: Impact) -> tuple[Instants, Instants]:
    return impact.bounce_onsets_s[:2], impact.bounce_onsets_s[1:3]


def first_flights(impact: Impact) -> tuple[Instants, Instants]:
    """Return (release, touch) of the first and of the second flight between bounces."""
    on, off = impact.bounce_onsets_s, impact.bounce_releases_s
    return (*off[:1], *on[1:2]), (*off[1:2], *on[2:3])


def ratio_of_times(instants: Callable[[Impact], tuple[Instants, Instants]]) -> Equation:
    """Return T2 / T1, with both ends of each from ``instants``; the reading's noise is shared equally by the two."""

    def equation(sources: ShotSources, reading: Reading, unit: str) -> Number | None:
        impact = sources.shot.impact
        first, second = instants(impact) if impact is not None else ((), ())
        if not isinstance(reading, Quantity) or len(first) != 2 or len(second) != 2:
            return None
        first_s, second_s = first[1] - first[0], second[1] - second[0]
        std = reading.std * first_s / (1.0 + reading.value**2) ** 0.5
        return sources.interval(second_s, std, "T2", reading.how) / sources.interval(first_s, std, "T1", reading.how)

    return equation


def peak_force(sources: ShotSources, reading: Reading, unit: str) -> Number | None:
    """Return the peak force m_b a; the acceleration scales with length / time^2."""
    impact = sources.shot.impact
    peak = sources.with_type_a(reading, "beat noise, force", unit, without_mass=True)
    if peak is None or impact is None:
        return None
    scale = sources.mass_scale * sources.length_scale / sources.timebase**2
    return peak * scale * sources.band_scale(impact.contact_time_s)


def stiffness_from_slope(sources: ShotSources, reading: Reading, unit: str) -> Number | None:
    """Return k_p from the slope of force against deflection, corrected for the plate's mass and the contact.

    The fit's m_p* and k_N also scale with the block's mass, so their ratios to it are independent of the mass.
    """
    slope, fit = sources.results.get("stiffness_slope_n_per_m"), sources.shot.fit
    if slope is None or fit is None or not fit.converged:
        return None
    plate = sources.with_type_a(fit.parameters.get("plate_mass_kg"), "m_p* of the fit", "kg")
    contact = sources.with_type_a(fit.parameters.get("contact_stiffness_n_per_m"), "k_N of the fit", "N/m")
    if plate is None or contact is None:
        return None
    return corrected_slope(slope, plate * sources.mass_scale, contact * stiffness(sources), sources.mass_kg)


def youngs_modulus(sources: ShotSources, reading: Reading, unit: str) -> Number | None:
    """Return Young's modulus of a plate with stated geometry, from the fitted k_p."""
    fitted, setup = sources.results.get("plate_stiffness_n_per_m"), sources.shot.setup
    if fitted is None or setup is None or setup.plate is None:
        return None
    return fitted * compliance_of(sources.plate(setup.plate))
