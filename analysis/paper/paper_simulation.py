"""Simulate a collision, and read its characteristic numbers from the solution."""

import math
from dataclasses import dataclass

import numpy as np

from analysis.collision import Collision, Trajectory, solve
from analysis.collision import simulate as gear
from analysis.fitted import contact_cor
from analysis.reading import SMOOTH_HZ
from analysis.shot import Floats

SLOPE_S = (6e-3, 28e-3)  # time span of the slope, for the paper's contact of 28.7 ms
_GRID_S = 1e-6
_PEAKS = 3


@dataclass(frozen=True, slots=True)
class Simulated:
    """The numbers of a solved collision; times in s from the first touch."""

    trajectory: Trajectory
    releases_s: tuple[float, ...]
    force_peaks_s: tuple[float, ...]
    velocity_out_m_per_s: float
    velocity_out_gear_m_per_s: float  # the paper's own integrator at its own step
    cor_quasi_static: float
    cor_force_peaks: float
    cor_onsets: float
    cor_flights: float
    cor_contact: float
    force_peak_n: float
    force_peak_at_s: float
    deflection_max_m: float
    fwhm_smooth_s: float
    fwhm_smooth_range_s: tuple[float, float]
    fwhm_outermost_s: float
    slope_n_per_m: float

    @property
    def contact_time_s(self) -> float:
        """Get the time from first touch to last release."""
        return self.releases_s[-1]


def simulate(collision: Collision) -> Simulated:
    """Solve a collision exactly and read it.  Raises ValueError if the block does not leave within two contact times.

    Kinetic ratios are NaN if there are fewer than three contacts.
    """
    span = collision.contact_time_estimate_s
    time = np.arange(0.0, 2.0 * span, _GRID_S)
    run = solve(collision, (), time)
    if run.released is None:
        raise ValueError("the simulated block does not leave the plate again")
    on = tuple(e.time_s for e in run.events if e.kind == "touch")
    off = tuple(e.time_s for e in run.events if e.kind == "release")
    force = run.force_n
    peaks = _first_peaks(time, force, on, off)
    late = int(np.searchsorted(time, SLOPE_S[0] / 28.7e-3 * off[-1]))
    top = late + int(np.argmax(force[late:]))
    peak_at, peak = _vertex(time, force, top)
    turn = int(np.argmin(run.displacement_m))
    out = float(run.released.state[1])
    widths = [_smooth_width(collision, off[-1], cutoff) for cutoff in SMOOTH_HZ]
    return Simulated(
        trajectory=run,
        releases_s=off,
        force_peaks_s=peaks,
        velocity_out_m_per_s=out,
        velocity_out_gear_m_per_s=float(gear(collision, 1.05 * off[-1])[-1, 1]),
        cor_quasi_static=abs(out / collision.velocity_in_m_per_s),
        cor_force_peaks=_ratio(peaks),
        cor_onsets=_ratio(on),
        cor_flights=(on[2] - off[1]) / (on[1] - off[0]) if len(on) > 2 else math.nan,
        cor_contact=contact_cor(collision),
        force_peak_n=peak,
        force_peak_at_s=peak_at,
        deflection_max_m=-_vertex(time, run.displacement_m, turn)[1],
        fwhm_smooth_s=widths[1],
        fwhm_smooth_range_s=(min(widths), max(widths)),
        fwhm_outermost_s=_outermost_width(time, force, peak / 2.0),
        slope_n_per_m=_slope(run, *SLOPE_S),
    )


def half_sine_time_s(stiffness_n_per_m: float, mass_kg: float) -> float:
    """Return pi sqrt(m / k), the contact time of a mass that runs into a spring."""
    return math.pi * math.sqrt(mass_kg / stiffness_n_per_m)


def _ratio(times: tuple[float, ...]) -> float:
    return (times[2] - times[1]) / (times[1] - times[0]) if len(times) > 2 else math.nan


def _first_peaks(time: Floats, force: Floats, on: tuple[float, ...], off: tuple[float, ...]) -> tuple[float, ...]:
    """Return the first force maximum after each of the first contact onsets, refined between samples."""
    found = []
    for start, end in list(zip(on, off, strict=False))[:_PEAKS]:
        low, high = (int(np.searchsorted(time, t)) for t in (start, end))
        inside = force[low:high]
        tops = np.flatnonzero((inside[1:-1] > inside[:-2]) & (inside[1:-1] >= inside[2:])) + 1
        if tops.size == 0:
            break
        found.append(_vertex(time, force, low + int(tops[0]))[0])
    return tuple(found)


def _vertex(time: Floats, values: Floats, at: int) -> tuple[float, float]:
    """Return time and value of the extremum of the parabola through a sample and its neighbours."""
    below, here, above = values[at - 1 : at + 2]
    curve = below - 2.0 * here + above
    shift = 0.5 * (below - above) / curve
    return float(time[at] + shift * (time[1] - time[0])), float(here - 0.25 * (below - above) * shift)


def _smooth_width(collision: Collision, contact_s: float, cutoff_hz: float) -> float:
    """Return the full width at half maximum of the force after a zero-phase low-pass."""
    from scipy.signal import butter, sosfiltfilt  # slow import (all of scipy.stats): not at every start

    rate = 1e5
    time = np.arange(-2.0 * contact_s, 3.0 * contact_s, 1.0 / rate)
    force = solve(collision, (), time).force_n
    smooth = np.asarray(sosfiltfilt(butter(2, cutoff_hz, fs=rate, output="sos"), force))
    return _outermost_width(time, smooth, float(smooth.max()) / 2.0)


def _outermost_width(time: Floats, force: Floats, level: float) -> float:
    above = np.flatnonzero(force >= level)
    first, last = int(above[0]), int(above[-1])
    begin = np.interp(level, force[first - 1 : first + 1], time[first - 1 : first + 1])
    finish = np.interp(level, force[last : last + 2][::-1], time[last : last + 2][::-1])
    return float(finish - begin)


def _slope(run: Trajectory, begin_s: float, finish_s: float) -> float:
    inside = (run.time_s >= begin_s) & (run.time_s <= finish_s)
    return float(np.polyfit(-run.displacement_m[inside], run.force_n[inside], 1)[0])
