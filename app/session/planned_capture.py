"""Capture settings and mass of a planned shot, from the plan and the shots so far."""

from collections.abc import Sequence
from dataclasses import replace

from analysis.planning import NextShot, as_found_kg, contact_s
from analysis.shot import Setup, Shot
from instrument.devices import CaptureSettings

_LEAST_BEFORE_SWITCH_S = 1e-3
_RATE_HZ = 10e6  # where no shot has a rate


def planned_record(shot: NextShot, shots: Sequence[Shot], rate_hz: float | None) -> CaptureSettings:
    """Return the capture settings of a planned shot; ``rate_hz`` None takes the rate of the shots so far."""
    from analysis.inference import averaged_shots  # slow to import

    rate_hz = rate_hz or next((one.sample_rate_hz for one in shots if one.sample_rate_hz), None) or _RATE_HZ
    samples = averaged_shots([one.motion for one in shots if one.motion is not None and one.fit is not None])
    whole_s = shot.before_s + contact_s(shot, samples) + shot.after_s
    before_switch_s = max(shot.before_s - _switch_m(shots) / shot.speed_m_per_s, _LEAST_BEFORE_SWITCH_S)
    return CaptureSettings(rate_hz, round(rate_hz * whole_s), round(rate_hz * before_switch_s))


def planned_setup(setup: Setup, shot: NextShot, shots: Sequence[Shot]) -> Setup:
    """Return the rig of a planned shot: the mass of the lightest shot so far plus the plan's weights.

    The mass in the settings is not used, as the operator may have added the weights to it already.
    """
    motions = [one.motion for one in shots if one.motion is not None]
    return replace(setup, moving_mass_kg=as_found_kg(motions) + shot.added_mass_kg)


def _switch_m(shots: Sequence[Shot]) -> float:
    """Return the distance from light switch to plate, the median of the shots so far; 0 where it is not known."""
    ways = []
    for shot in shots:
        if shot.fit is not None and shot.trigger_time_s is not None:
            own = shot.fit.shots[0]
            ways.append(abs(own.velocity_in_m_per_s.value) * (own.touch_time_s.value - shot.trigger_time_s))
    return max(0.0, sorted(ways)[len(ways) // 2]) if ways else 0.0
