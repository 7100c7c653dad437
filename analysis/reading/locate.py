"""Locate the first collision in a motion: the turn, then the samples of touch and release, and the flights.

The block flies at centimetres per second, and a building vibrates at a tenth of a millimetre per second at most.  The
turn is therefore by far the deepest minimum of the displacement.  The contact's duration follows from the time that the
velocity takes to reverse.  The force, smoothed over a tenth of that duration, shows where the contact begins and ends,
and where another force acts.
"""

from dataclasses import dataclass

import numpy as np

from analysis.shot import Floats, Motion
from analysis.signal import first_run

TRAVEL_FRACTION = 0.02  # least fall before a turn and rise after it, as a fraction of the record's whole range
TRAVEL_SIGMAS = 30.0  # the same in noise of a sample
SPEED_QUANTILE = 0.85  # quantile of the speeds on one side of the turn that is the flight's, however long the contact
SLOWED = 0.7  # fraction of the flight's speed below which the block is in contact
SLOWED_SHARE = 0.494  # fraction of a half-sine contact that is below that speed
SLOWER = 0.9  # last speed over the usual one, below which a record ends in the contact
SMOOTHED_SHARE = 0.1  # least smoothing width of the force, as a fraction of the contact
SMOOTHED_MOST = 0.4  # largest smoothing width, likewise
FORCE_FRACTION = 0.03  # force over the peak that is significant
FORCE_SIGMAS = 6.0  # force over its noise that is significant
FADED = 0.15  # force over the peak down to which it is followed, unless it reaches its noise before
FADED_MOST = 0.3  # upper limit of that level, however large the noise
EXTRAPOLATION_STD = 0.05  # relative, of the extrapolation from there by a half-sine
SMOOTHED_ERROR = 0.01  # error of the end of a smoothed force, in smoothing widths
HALF_SINE_ENDS = 0.2  # deviation from a half-sine's end, in smoothing widths, above which another force acts
FREE_SHARE = 0.1  # fraction of the contact for which the force must stay small before the block counts as free
MIN_SAMPLES = 32


@dataclass(frozen=True, slots=True)
class CollisionSpan:
    """Sample indices of one collision: touch and release, read from the force, are close to ``first`` and ``last``.

    ``last_std_s`` is the uncertainty of the release, before which the force fades into its noise.
    The flights lie between ``flight_first`` and ``first``, and between ``last`` and ``flight_last``;
    ``disturbed_before`` and ``disturbed_after``: another force acts beyond them.  ``finished`` False: the record ends
    in the contact.
    """

    first: int
    turn: int
    last: int
    last_std_s: float
    flight_first: int
    flight_last: int
    disturbed_before: bool
    disturbed_after: bool
    finished: bool


def find_collision(motion: Motion) -> CollisionSpan | None:
    """Return the first collision after the trigger, or the record's first if none follows; None without any."""
    x = _filled(motion)
    if x is None:
        return None
    turns = _turns(motion, x)
    if not turns:
        return None
    trigger = -np.inf if motion.trigger_time_s is None else motion.trigger_time_s
    after = [turn for turn in turns if motion.time_s[turn.at] >= trigger]
    return _span(motion, x, (after or turns)[0])


@dataclass(frozen=True, slots=True)
class _Turn:
    begin: int  # the highest point before
    at: int
    end: int  # the highest point after, or the record's end
    rises: bool


def _filled(motion: Motion) -> Floats | None:
    """Return the displacement with holes interpolated and ends extended; None if too few samples are valid."""
    good = motion.valid & np.isfinite(motion.displacement_m)
    if good.sum() < MIN_SAMPLES:
        return None
    if good.all():
        return motion.displacement_m
    index = np.arange(good.size)
    return np.interp(index, index[good], motion.displacement_m[good])


def _turns(motion: Motion, x: Floats) -> list[_Turn]:
    """Return the minima between sufficient fall and rise, in order; the last may lack the rise."""
    noise = float(np.nanmedian(motion.displacement_std_m))
    least = max(TRAVEL_FRACTION * float(np.ptp(x)), TRAVEL_SIGMAS * noise)
    # at most two thousand points: a turn spans many samples
    step = max(1, x.size // 2000)
    coarse = x[::step]
    turns: list[_Turn] = []
    high, low, falling = 0, 0, False
    for k in range(coarse.size):
        if falling:
            if coarse[k] < coarse[low]:
                low = k
            elif coarse[k] > coarse[low] + least:
                turns.append(_refined_turn(x, high, low, k, step))
                falling, high = False, k
        elif coarse[k] > coarse[high]:
            high = k
        elif coarse[k] < coarse[high] - least:
            if turns:
                turns[-1] = _Turn(turns[-1].begin, turns[-1].at, high * step, True)
            falling, low = True, k
    if falling and _slows(coarse[high:]):
        turns.append(_refined_turn(x, high, low, coarse.size - 1, step))
    elif turns:
        turns[-1] = _Turn(turns[-1].begin, turns[-1].at, x.size - 1, True)
    return turns


def _slows(x: Floats) -> bool:
    """Return whether a fall slows down at its end: the record then ends in the contact, not in flight."""
    reach = max(1, x.size // 20)
    return x.size > 2 * reach and x[-1 - reach] - x[-1] < SLOWER * np.median(x[:-reach] - x[reach:])


def _refined_turn(x: Floats, high: int, low: int, end: int, step: int) -> _Turn:
    """Return the turn near the coarse point ``low``, provisionally ending at ``end`` without a rise."""
    first = max(0, (low - 1) * step)
    at = first + int(x[first : (low + 1) * step + 1].argmin())
    return _Turn(high * step, at, end * step, False)


def _span(motion: Motion, x: Floats, turn: _Turn) -> CollisionSpan | None:
    lengths = _contact_samples(motion, x, turn)
    if lengths is None:
        return None
    contact, slope = lengths
    width = _width(motion, contact, slope)
    force = _smooth_acceleration(x, width)
    peak = float(force[max(0, turn.at - round(contact)) : turn.at + round(contact) + 1].max())
    if peak <= 0.0:
        return None
    away = np.ones(x.size, dtype=np.bool_)
    away[max(0, turn.at - round(1.2 * contact)) : turn.at + round(1.2 * contact) + 1] = False
    quiet = float(1.4826 * np.median(np.abs(force[away]))) if away.sum() >= 16 else 0.0
    lost = max(FORCE_FRACTION * peak, min(FORCE_SIGMAS * quiet, FADED_MOST * peak))
    pushed = np.abs(force) > lost
    run = max(2, round(FREE_SHARE * contact))
    before, after = pushed[turn.at :: -1], pushed[turn.at :]
    into, out = first_run(~before, run), first_run(~after, run)
    first = 0 if into is None else turn.at - into
    last = x.size - 1 if out is None else turn.at + out
    earlier = None if into is None else first_run(before[into:], max(2, width // 2))
    later = None if out is None else first_run(after[out:], max(2, width // 2))
    finished = turn.rises and out is not None
    release, std = last, 0.0
    if finished:
        half, std = _extrapolated_release(force[turn.at : last + 1] / peak, lost / peak, width)
        release = min(turn.at + round(half), x.size - 1)
    return CollisionSpan(
        first=_refined_touch(motion, first, width),
        turn=turn.at,
        last=release,
        last_std_s=std / motion.sample_rate_hz,
        flight_first=0 if earlier is None else min(first, first - earlier + 2 * width),
        flight_last=x.size - 1 if later is None else max(last, last + later - 2 * width),
        disturbed_before=earlier is not None,
        disturbed_after=later is not None,
        finished=finished,
    )


def _extrapolated_release(force: Floats, lost: float, width: int) -> tuple[float, float]:
    """Return the number of samples after which a force (n,) has faded, and the uncertainty of this number.

    The force is in units of its peak, begins at the turn, is smoothed over ``width`` and ends where it falls to
    ``lost``.  It is followed down to FADED and extrapolated by a half-sine.  If the force is visible for longer or
    shorter than that half-sine, another force acts, and the contact ends near the end of the given force.
    """
    share, apart = max(FADED, lost), HALF_SINE_ENDS * width
    if not np.any(force > share):
        return force.size - apart, apart
    at = _last_above(force, share)
    half = at
    for _ in range(4):  # the smoothing's effect depends on the half-sine's length, and vice versa
        half = at / _faded_to(share, 0.5 * width / half)
    if abs(force.size - half * _faded_to(lost, 0.5 * width / half)) > 1.0 + apart:
        return force.size - apart, apart
    return half, float(np.linalg.norm((EXTRAPOLATION_STD * (half - at), SMOOTHED_ERROR * width, 0.5)))


def _faded_to(share: float, smoothed: float) -> float:
    """Return when a half-sine, smoothed over a fraction of its length, fades to a share; unsmoothed it ends at 1."""
    half = 200  # samples
    force = np.cos(0.5 * np.pi * np.minimum(np.abs(np.arange(-4 * half, 4 * half)) / half, 1.0))
    width = max(1, round(2 * half * min(smoothed, SMOOTHED_MOST)))
    smooth = _smooth_acceleration(np.cumsum(np.cumsum(force)), width)[4 * half - 1 :]
    return _last_above(smooth / smooth.max(), share) / half


def _last_above(force: Floats, share: float) -> float:
    """Return the last (interpolated) index at which a force (n,), which ends below a share, falls to that share."""
    k = int(np.flatnonzero(force > share)[-1])
    return k + float((force[k] - share) / (force[k] - force[k + 1]))


def _contact_samples(motion: Motion, x: Floats, turn: _Turn) -> tuple[float, float] | None:
    """Return roughly the duration in samples of a half-sine contact, and the flight's speed in m per sample."""
    reach = max(1, min(round(1e-3 * motion.sample_rate_hz), (turn.at - turn.begin) // 4, (turn.end - turn.at) // 4))
    into = np.diff(x[turn.begin : turn.at + 1 : reach]) / -reach
    out = np.diff(x[turn.at : turn.end + 1 : reach]) / reach
    if into.size == 0:
        return None
    speed = float(np.quantile(into, SPEED_QUANTILE))
    quick = np.flatnonzero(into > SLOWED * speed)
    loading = (into.size - 1 - float(quick[-1])) * reach
    unloading = loading
    if out.size and float(np.quantile(out, SPEED_QUANTILE)) > 0.0:
        unloading = float(np.flatnonzero(out > SLOWED * np.quantile(out, SPEED_QUANTILE))[0]) * reach
    return max(4.0, (loading + unloading) / SLOWED_SHARE), speed


def _width(motion: Motion, contact: float, speed: float) -> int:
    """Return the width in samples for the acceleration: the smallest at which its noise is low enough."""
    noise = float(np.nanmedian(motion.displacement_std_m))
    peak = np.pi * speed / contact  # of a half-sine that reverses the speed, m per sample^2
    width = 1
    for share in np.geomspace(SMOOTHED_SHARE, SMOOTHED_MOST, 6):
        width = max(1, round(share * contact))
        if 2.5 * noise / width**2 / np.sqrt(max(1, width // 2)) < 0.2 * FORCE_FRACTION * peak:
            break
    return width


def _smooth_acceleration(x: Floats, width: int) -> Floats:
    """Return the second difference over ``width`` of means half as wide, (n,); constant at the ends."""
    box = max(1, width // 2) | 1
    total = np.cumsum(np.concatenate([[0.0], np.pad(x - x[0], box // 2, mode="reflect", reflect_type="odd")]))
    mean = (total[box:] - total[:-box]) / box
    out = np.zeros(x.size)
    if x.size > 2 * width:
        out[width:-width] = (mean[2 * width :] - 2.0 * mean[width:-width] + mean[: -2 * width]) / width**2
        out[:width], out[-width:] = out[width], out[-width - 1]
    return out


def _refined_touch(motion: Motion, sample: int, width: int) -> int:
    """Return the sample near ``sample`` before the force at full bandwidth rises above its noise."""
    low, high = max(sample - width // 2, 0), min(sample + 2 * width, motion.force_n.size - 1)
    force = motion.force_n[low : high + 1]
    flight = motion.force_n[max(sample - 4 * width, 0) : max(sample - width, 0)]
    stds = motion.force_std_n[np.isfinite(motion.force_std_n)]
    stated = float(np.median(stds)) if stds.size else float("nan")
    flight = np.abs(flight[np.isfinite(flight)])
    std = max(stated, 1.4826 * float(np.median(flight))) if flight.size > 8 else stated
    with np.errstate(invalid="ignore"):
        peak = float(np.nanmax(np.abs(force), initial=0.0))
        above = np.abs(force) > max(FORCE_SIGMAS * std, FORCE_FRACTION * peak)
    start = first_run(above, 2)
    if start is None or peak < 2.0 * FORCE_SIGMAS * std:
        return min(sample + width // 2, motion.force_n.size - 1)
    return max(low + start - 1, 0)
