"""Whether the sample rate can be what it is said to be: against PD0 where the rest frequency is stated, and a clock.

Every speed is a number of fringes a sample times the sample rate, so a rate that is wrong by a percent makes every
speed wrong by a percent, while nothing in the samples themselves shows it.
"""

import math

from analysis.shot.quantity import Quantity
from analysis.shot.recording import Recording

FLAG = "rate_contradicted"
DELIVERED = "lmm:delivered_rate_hz"  # global key: what came by the computer's clock, where it is not the rate
STATED_U = 5e-4  # of a rest frequency stated without its uncertainty: a laser's beat holds that over months
COVERAGE = 2.0  # standard uncertainties


def rate_error(recording: Recording, rest_hz: Quantity | None) -> float:
    """Return by how much of itself the stated rate is contradicted, the greater of both ways; 0 where it is not.

    ``rest_hz`` is what PD0 shows, None where there is no PD0.
    """
    return max(_by_rest(recording, rest_hz), _by_clock(recording))


def _by_rest(recording: Recording, rest_hz: Quantity | None) -> float:
    stated = recording.setup.rest_frequency_hz
    if not stated or rest_hz is None:
        return 0.0
    std = recording.setup.rest_frequency_u_hz or 0.0
    own = COVERAGE * std if std > 0.0 else STATED_U * stated
    error = abs(rest_hz.value - stated)
    # a beat at half its frequency says that something is wrong, not that every speed is known to half of it
    return min(error / stated, 1.0) if error > math.hypot(own, COVERAGE * rest_hz.std) else 0.0


def _by_clock(recording: Recording) -> float:
    told = recording.extra.get("global", {})
    delivered = told.get(DELIVERED) if isinstance(told, dict) else None
    if isinstance(delivered, bool) or not isinstance(delivered, int | float):
        return 0.0
    try:
        error = abs(float(delivered) / recording.sample_rate_hz - 1.0)
    except OverflowError:
        return 1.0
    return min(error, 1.0) if math.isfinite(error) else 1.0
