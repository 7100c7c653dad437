"""The measurement equations of a shot's results, written in the budget's variables."""

from collections.abc import Iterator
from dataclasses import dataclass

from analysis.shot.impact import Impact
from analysis.shot.plate import Number, compliance_of, corrected_slope
from analysis.shot.quantity import Quantity, Reading
from analysis.shot.shot import Shot
from analysis.uncertainty.budget_sources import ShotSources


@dataclass(frozen=True, slots=True)
class Result:
    """A result as a number that knows its sources; ``repeats``: other shots of the rig should give it again."""

    key: str
    words: str
    unit: str
    number: Number
    repeats: bool


def results(shot: Shot, sources: ShotSources) -> Iterator[Result]:
    """Give every result that the shot shows, in the order of the result file."""
    impact = shot.impact
    if impact is not None:
        yield from _restitution(impact, sources)
        yield from _force(impact, sources)
    yield from _stiffness(shot, sources)


def _restitution(impact: Impact, sources: ShotSources) -> Iterator[Result]:
    """v = lambda_air f_D / 2 / cos a (Eq. 1); the rest frequency's error adds the same velocity to both flights."""
    scale, rest = sources.velocity_scale, sources.rest_velocity_m_per_s
    into = sources.noisy(impact.velocity_in_m_per_s, "beat noise, flight in", "m/s", per_time=1)
    out = sources.noisy(impact.velocity_out_m_per_s, "beat noise, flight out", "m/s", per_time=1)
    if into is not None:
        into = (into + rest) * scale
        yield Result("velocity_in_m_per_s", "velocity before touch", "m/s", into, False)
    if out is not None:
        out = (out + rest) * scale
        yield Result("velocity_out_m_per_s", "velocity after release", "m/s", out, False)
    if into is not None and out is not None:
        yield Result("cor_quasi_static", "quasi-static COR", "1", -out / into, True)
    impulse = sources.noisy(impact.cor_impulse, "beat noise, impulses", "1")
    if impulse is not None:
        # Both impulses are m_b times a difference of velocities: whatever scales one scales the other.
        one = sources.mass_scale * scale
        yield Result("cor_impulse", "impulse ratio", "1", impulse * one / one, True)
    kinetic = impact.cor_kinetic
    on, off, top = impact.bounce_onsets_s, impact.bounce_releases_s, impact.bounce_peaks_s
    for name, reading, first, second in (
        ("force_peaks", kinetic.force_peaks, top[:2], top[1:3]),
        ("onsets", kinetic.onsets, on[:2], on[1:3]),
        ("flights", kinetic.flights, (*off[:1], *on[1:2]), (*off[1:2], *on[2:3])),
    ):
        if isinstance(reading, Quantity) and len(first) == 2 and len(second) == 2:
            number = _ratio_of_times(sources, reading, first[1] - first[0], second[1] - second[0])
            yield Result(f"cor_kinetic.{name}", f"kinetic COR, {name.replace('_', ' ')}", "1", number, True)
    contact = sources.noisy(kinetic.contact, "beat noise, through the fit", "1")
    if contact is not None:
        yield Result("cor_kinetic.contact", "kinetic COR, fitted contact", "1", contact, True)


def _ratio_of_times(sources: ShotSources, reading: Quantity, first_s: float, second_s: float) -> Number:
    """T2 / T1; the reading's own uncertainty is shared between the two as if both were read alike."""
    std = reading.std * first_s / (1.0 + reading.value**2) ** 0.5
    return sources.interval(second_s, std, "T2", reading.how) / sources.interval(first_s, std, "T1", reading.how)


def _force(impact: Impact, sources: ShotSources) -> Iterator[Result]:
    """F = m_b a: the acceleration scales with the length and the inverse square of time; times scale with the clock."""
    peak = sources.noisy(impact.force_peak_n, "beat noise, force", "N", without_mass=True, per_time=2)
    if peak is not None:
        scale = sources.mass_scale * sources.length_scale / sources.timebase**2
        number = peak * scale * sources.band_scale(impact.contact_time_s)
        yield Result("force_peak_n", "peak force", "N", number, False)
    # Both instants of a width are read on slopes that the band limit shifts alike.
    for key, words, unit, reading, scale, power in (
        ("force_fwhm_s", "pulse width", "s", impact.force_fwhm_s, sources.timebase, 1),
        ("contact_time_s", "contact time", "s", impact.contact_time_s, sources.timebase, 1),
        ("deflection_max_m", "deflection", "m", impact.deflection_max_m, sources.length_scale, 0),
    ):
        seen = sources.noisy(reading, f"beat noise, {words}", unit, per_time=power)
        if seen is not None:
            yield Result(key, words, unit, seen * scale, False)


def _stiffness(shot: Shot, sources: ShotSources) -> Iterator[Result]:
    """A stiffness is m_b over a time squared: what scales the length cancels, as the model is linear."""
    per_time = sources.mass_scale / sources.timebase**2
    fit = shot.fit if shot.fit is not None and shot.fit.converged else None
    fitted = (
        None
        if fit is None
        else sources.noisy(
            fit.parameters.get("plate_stiffness_n_per_m"), "beat noise, through the fit", "N/m", per_time=2
        )
    )
    if fitted is not None:
        fitted = fitted * per_time * sources.length_scale / sources.length_scale
        yield Result("plate_stiffness_n_per_m", "k_p, fitted", "N/m", fitted, True)
    for key, words, unit, scale, power in (
        ("plate_mass_kg", "m_p*, fitted", "kg", sources.mass_scale, 0),
        ("contact_stiffness_n_per_m", "k_N, fitted", "N/m", per_time, 2),
        ("contact_damping_n_s_per_m", "γ_N, fitted", "N s/m", sources.mass_scale / sources.timebase, 1),
    ):
        reading = fit.parameters.get(key) if fit is not None else None
        number = sources.noisy(reading, "beat noise, through the fit", unit, per_time=power)
        if number is not None:
            yield Result(key, words, unit, number * scale, True)
    slope_reading: Reading | None = shot.impact.stiffness_slope_n_per_m if shot.impact is not None else None
    slope = sources.noisy(slope_reading, "beat noise and ripple, slope", "N/m", without_mass=True, per_time=2)
    if slope is not None:
        slope = slope * per_time * sources.length_scale / sources.length_scale
        yield Result("stiffness_slope_n_per_m", "slope of F", "N/m", slope, True)
        if fit is not None and {"plate_mass_kg", "contact_stiffness_n_per_m"} <= set(fit.parameters):
            # The fit's m_p* and k_N scale with the mass as well, so their ratios to it do not know the mass.
            plate = sources.noisy(fit.parameters["plate_mass_kg"], "m_p* of the fit", "kg")
            contact = sources.noisy(fit.parameters["contact_stiffness_n_per_m"], "k_N of the fit", "N/m", per_time=2)
            if plate is not None and contact is not None:
                mass = sources.mass_kg
                number = corrected_slope(slope, plate * sources.mass_scale, contact * per_time, mass)
                yield Result("stiffness_from_slope_n_per_m", "k_p, slope corrected", "N/m", number, False)
    plate_known = shot.setup.plate if shot.setup is not None else None
    if fitted is not None and plate_known is not None:
        number = fitted * compliance_of(sources.plate(plate_known))
        yield Result("youngs_modulus_pa", "E of the plate", "Pa", number, False)
