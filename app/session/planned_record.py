"""The record and the mass that a planned shot asks for, from what the shots so far show of the rig."""

from collections.abc import Sequence
from dataclasses import replace

from analysis.planning.next_shot import NextShot, as_found_kg, contact_s
from analysis.shot.recording import Setup
from analysis.shot.shot import Shot
from instrument.devices.digitizer import CaptureSettings

_LEAST_BEFORE_SWITCH_S = 1e-3
_RATE_HZ = 10e6  # where no shot tells


def planned_record(shot: NextShot, shots: Sequence[Shot], rate_hz: float | None) -> CaptureSettings:
    """Return the capture of a planned shot: so much flight before the touch and after the contact.

    ``rate_hz`` None takes the rate of the shots so far.
    """
    from analysis.inference.fit.samples import together  # with all of the fit: not at every start

    rate_hz = rate_hz or next((one.sample_rate_hz for one in shots if one.sample_rate_hz), None) or _RATE_HZ
    samples = together([one.motion for one in shots if one.motion is not None and one.fit is not None])
    whole_s = shot.before_s + contact_s(shot, samples) + shot.after_s
    before_switch_s = max(shot.before_s - _switch_m(shots) / shot.speed_m_per_s, _LEAST_BEFORE_SWITCH_S)
    return CaptureSettings(rate_hz, round(rate_hz * whole_s), round(rate_hz * before_switch_s))


def planned_setup(setup: Setup, shot: NextShot, shots: Sequence[Shot]) -> Setup:
    """Return the rig of a planned shot: the block as the lightest of the shots so far had it, and the plan's weights.

    One rule for the window and ``--resolve``: what the settings state at that moment does not count, so that weights
    put on as the plan says and typed into the settings as well are not counted twice.
    """
    motions = [one.motion for one in shots if one.motion is not None]
    return replace(setup, moving_mass_kg=as_found_kg(motions) + shot.added_mass_kg)


def _switch_m(shots: Sequence[Shot]) -> float:
    """Return how far before the plate the light switch stands, as the shots so far show it; 0 where none does."""
    ways = []
    for shot in shots:
        if shot.fit is not None and shot.trigger_time_s is not None:
            own = shot.fit.shots[0]
            ways.append(abs(own.velocity_in_m_per_s.value) * (own.touch_time_s.value - shot.trigger_time_s))
    return max(0.0, sorted(ways)[len(ways) // 2]) if ways else 0.0
