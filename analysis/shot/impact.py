"""The numbers of one collision, read from the motion without a model (docs/physics.md, "the numbers of a shot")."""

from dataclasses import dataclass, field

from analysis.shot.disturbance import Disturbance
from analysis.shot.quantity import NotSeen, Reading


def _not_read() -> Reading:
    return NotSeen("not read")


@dataclass(frozen=True, slots=True)
class KineticCor:
    """T2 / T1 of the first bounces between three kinds of instants; ``contact`` is of the fitted contact."""

    force_peaks: Reading = field(default_factory=_not_read)
    onsets: Reading = field(default_factory=_not_read)
    flights: Reading = field(default_factory=_not_read)
    contact: Reading = field(default_factory=_not_read)


@dataclass(frozen=True, slots=True)
class Impact:
    """One collision as read from the motion; times count from the recording's first sample."""

    touch_time_s: Reading
    release_time_s: Reading
    turnaround_time_s: Reading
    velocity_in_m_per_s: Reading
    velocity_out_m_per_s: Reading
    cor_quasi_static: Reading
    cor_impulse: Reading
    cor_kinetic: KineticCor
    force_peak_n: Reading
    force_fwhm_s: Reading
    contact_time_s: Reading
    deflection_max_m: Reading
    stiffness_slope_n_per_m: Reading
    bounce_onsets_s: tuple[float, ...] = ()
    bounce_peaks_s: tuple[float, ...] = ()
    bounce_releases_s: tuple[float, ...] = ()
    flags: tuple[str, ...] = ()
    disturbance: Disturbance | None = None
