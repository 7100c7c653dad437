"""Locate a collision in a displacement record and estimate its speed and touch time, as the start of a fit."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from analysis.collision import Floats
from analysis.shot import AnalysisError
from analysis.signal import white_noise


class NoCollision(AnalysisError):
    """Raised where a displacement record shows no collision; the message says why in one line."""


_FLIGHT = 4.5  # contact times of flight before the touch from which the speed is read
_FLIGHT_OF_COARSE = 2.0  # contact times of flight on either side in a half-sine fit; further away the track is curved
_COARSE = 2000.0  # contact depth over white noise below which a half-sine is fitted to all samples at once


@dataclass(frozen=True, slots=True)
class Course:
    """Timing, speed and position of one collision, read from the displacement alone; times on the motion's clock.

    ``quiet_in`` and ``quiet_out`` are the sample ranges of undisturbed flight.
    """

    touch_time_s: float
    touch_position_m: float
    velocity_in_m_per_s: float
    turnaround_time_s: float
    rate_rad_per_s: float  # of the half-sine that the contact resembles
    release_time_s: float
    noise_std_m: float  # white part, from third differences
    quiet_in: slice
    quiet_out: slice

    @property
    def own(self) -> Floats:
        """Get incoming velocity (m/s), touch time (s) and offset (m), shape (3,): the start of a fit of the shot."""
        return np.array([self.velocity_in_m_per_s, self.touch_time_s, self.touch_position_m])

    @property
    def contact_time_s(self) -> float:
        """Get the half period of the smooth contact, in s."""
        return math.pi / self.rate_rad_per_s


def read_course(time_s: Floats, displacement_m: Floats, valid: NDArray[np.bool_]) -> Course:
    """Read timing and speed of one collision; the displacement falls before the touch.  Raises NoCollision."""
    good = np.flatnonzero(valid & np.isfinite(displacement_m))
    if good.size < 50:
        raise NoCollision("fewer than 50 valid displacement samples")
    first, last = int(good[0]), int(good[-1]) + 1
    t = time_s[first:last]
    d = np.interp(t, time_s[good], displacement_m[good])
    n = t.size
    dt = (t[-1] - t[0]) / (n - 1)
    sigma = white_noise(np.diff(d, 3))
    turn = int(np.argmin(d))
    if turn < 20 or turn > n - 10:
        raise NoCollision("no turnaround inside the record: the block does not come in and leave again")
    velocity, rate = _first_look(t, d, turn, dt)
    if not velocity < 0 or (d[0] - d[turn]) < 20 * sigma:
        raise NoCollision("no block moving towards the plate before the turnaround")
    for _ in range(2):
        touch = _onset(t, d, sigma, rate, velocity, turn, dt)
        before = int(np.searchsorted(t, touch - 2 * dt))
        after = int(np.searchsorted(t, touch - _FLIGHT * math.pi / rate))
        if before - after < 8:
            raise NoCollision("the record begins in contact: no flight before the first touch")
        velocity, line = _flight(t, d, after, before)
        if not velocity < 0:
            raise NoCollision("no block moving towards the plate before the turnaround")
        position = line + velocity * touch
        depth = position - d[turn]
        rate = abs(velocity) / max(depth, 5 * sigma)
    turnaround = float(t[turn])
    if position - d[turn] < _COARSE * sigma:
        half = _half_sine(t, d, (touch, position, velocity, rate))
        if half is not None:
            touch, position, velocity, rate = half
            turnaround = touch + 0.5 * math.pi / rate
    release = min(touch + math.pi / rate, t[-1])
    margin = math.ceil(0.15 * math.pi / rate / dt) + 4
    end_in = int(np.searchsorted(t, touch)) - 3
    start_out = int(np.searchsorted(t, release)) + margin
    return Course(
        touch_time_s=float(touch),
        touch_position_m=float(position),
        velocity_in_m_per_s=float(velocity),
        turnaround_time_s=turnaround,
        rate_rad_per_s=float(rate),
        release_time_s=float(release),
        noise_std_m=sigma,
        quiet_in=slice(first, first + max(end_in, 0)),
        quiet_out=slice(min(first + start_out, last), last),
    )


def _first_look(t: Floats, d: Floats, turn: int, dt: float) -> tuple[float, float]:
    """Return incoming velocity (m/s) and rate of the half-sine contact (rad/s) while the touch is still unknown.

    A half-sine turns around (pi/2 - 1)/omega after the undisturbed flight would have reached the same depth.  For each
    of many trial contact times a flight is fitted from 0.8 to 4.5 contact times before the turnaround.  The trial
    chosen is the one closest to the contact time that its own fit implies.
    """
    best = (math.inf, 0.0, 1.0)
    for supposed in np.geomspace(2.0 * (t[turn] - t[0]), 6 * dt, 60):
        begin = max(0, int(np.searchsorted(t, t[turn] - _FLIGHT * supposed)))
        end = int(np.searchsorted(t, t[turn] - 0.8 * supposed))
        if end - begin < 8:
            continue
        velocity, line = _flight(t, d, begin, end)
        if not velocity < 0:
            continue
        late = t[turn] - (d[turn] - line) / velocity
        rate = (math.pi / 2 - 1) / max(late, 0.5 * dt)
        apart = abs(math.log(math.pi / rate / supposed))
        if apart < best[0]:
            best = (apart, velocity, rate)
        if apart < 0.1:
            break
    return best[1], best[2]


def _half_sine(
    t: Floats, d: Floats, read: tuple[float, float, float, float]
) -> tuple[float, float, float, float] | None:
    """Return (touch time, position, velocity, rate) of two flights joined by half a sine; None if none fits.

    If the noise is a noticeable part of the depth, the onset of the force and the lowest sample do not determine start
    and duration of the contact; a fit of all samples does.  Cost: about 20 ms.
    """
    touch, position, velocity, rate = read
    best: tuple[float, Floats] | None = None
    scale = np.array([0.1 / rate, 0.1 * abs(velocity) / rate, abs(velocity), 0.1, 0.1])
    for share in (1.0, 0.6, 0.35):
        z = np.array([touch, position, velocity, math.log(share * rate), 0.8])
        for _ in range(2):  # the flights included depend on the fitted contact time
            flight = _FLIGHT_OF_COARSE * math.pi / math.exp(z[3])
            near = (t > z[0] - flight) & (t < z[0] + flight + math.pi / math.exp(z[3]))
            if near.sum() < 20 or z[0] < t[0]:
                break
            try:
                found = least_squares(
                    lambda at, t=t[near], d=d[near]: (_joined(at * scale, t) - d) / scale[1], z / scale, method="lm"
                )
            except ValueError:
                break
            z = found.x * scale
            left = float(np.mean(found.fun**2))
            if best is None or left < best[0]:
                best = left, z
    if best is None or not best[1][2] < 0.0 or not t[0] < best[1][0] < t[-1]:
        return None
    touch, position, velocity, log_rate, _ = (float(value) for value in best[1])
    return touch, position, velocity, math.exp(log_rate)


def _joined(z: Floats, t: Floats) -> Floats:
    """Return the displacement at times t: flight in, half-sine of rate exp(z[3]), flight out with COR z[4]."""
    touch, position, velocity, log_rate, restitution = z
    rate = math.exp(min(log_rate, 50.0))
    u = t - touch
    inside = np.clip(u, 0.0, math.pi / rate)
    out = position + velocity * np.minimum(u, 0.0) + velocity / rate * np.sin(rate * inside)
    return np.asarray(out - restitution * velocity * np.maximum(u - math.pi / rate, 0.0))


def _flight(t: Floats, d: Floats, begin: int, end: int) -> tuple[float, float]:
    """Return slope and intercept at t = 0 of the line through the samples from ``begin`` to ``end``."""
    middle = float(np.mean(t[begin:end]))
    slope = float(np.polyfit(t[begin:end] - middle, d[begin:end], 1)[0])
    return slope, float(np.mean(d[begin:end])) - slope * middle


def _onset(t: Floats, d: Floats, sigma: float, rate: float, velocity: float, turn: int, dt: float) -> float:
    """Return the time at which the acceleration first rises above the noise.

    A vibration of 60 nm at 555 Hz causes an acceleration of a thirtieth of the plate's peak, but in both directions,
    while the plate only pushes.  The threshold is therefore set by the most negative acceleration.
    """
    peak = abs(velocity) * rate
    span = max(1, int(0.004 / rate / dt))
    # Wide enough that a twentieth of the peak acceleration is five sigma of the second difference's noise.
    while math.sqrt(6.0) * sigma / (span * dt) ** 2 > 0.01 * peak and span < turn // 4:
        span += max(1, span // 4)
    second = (d[2 * span : turn + 1] - 2 * d[span : turn + 1 - span] + d[: turn + 1 - 2 * span]) / (span * dt) ** 2
    centre = t[span : turn + 1 - span]
    late = t[turn] - 2.2 * (math.pi / 2) / rate
    mark = min(max(0.05 * peak, 1.2 * float(-second.min())), 0.4 * peak)
    loud = (second > mark) & (centre > late)
    if not loud.any():
        return float(t[turn] - 0.5 * math.pi / rate)
    index = int(np.argmax(loud))
    # The second difference responds one span before the touch and crosses the threshold within that span.
    return float(min(centre[index] + 0.6 * span * dt, t[turn]))
