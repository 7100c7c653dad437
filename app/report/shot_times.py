"""Which instant the plots of a shot count from, and which stretch its views show."""

import math

from analysis.shot.quantity import Quantity
from analysis.shot.shot import Shot


def time_zero(shot: Shot) -> tuple[float, str]:
    """Return the time in s that the plots count from, and its name: first touch, else the trigger, else the start."""
    touch = shot.impact.touch_time_s if shot.impact is not None else None
    if isinstance(touch, Quantity) and math.isfinite(touch.value):
        return touch.value, "time from first touch (ms)"
    if shot.trigger_time_s is not None:
        return shot.trigger_time_s, "time from the light switch (ms)"
    return 0.0, "time from the first sample (ms)"


def contact_span_ms(shot: Shot) -> tuple[float, float]:
    """Return the stretch of the first bounces in ms from ``time_zero``, with room around it."""
    zero, _ = time_zero(shot)
    if shot.impact is None or not shot.impact.bounce_peaks_s:
        return -1.0, 8.0
    peaks = [1e3 * (t - zero) for t in shot.impact.bounce_peaks_s[:3]]
    reach = max(2.0, 2.4 * max(peaks))
    return -0.12 * reach, reach
