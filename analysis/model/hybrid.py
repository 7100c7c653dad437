"""The general integrator: base model plus effects, phase by phase, with every switch located.

Cooper and Verner's Runge-Kutta method of order eight at a step well inside the fastest period of the phase.  A step
that would pass a switch (touch, release, the block's turn, the edge of a force's range) is refused and the switch
approached in ever shorter steps, then met by a secant search; after it the steps grow again.  A law that is not smooth
where the overlap begins (an exponent) then still comes out to 1e-10, smooth ones to 1e-12 of the displacement.  The
derivatives by the parameters go through the very same steps, and jump at a switch by (f_before - f_after) dt/dtheta.
Between steps the displacement is the quintic through position, velocity and acceleration at both ends.
"""

import math

import numpy as np
from numba import njit, types

from analysis.model.effects import kernel
from analysis.model.phases import CONTACT, FREE, MAX_EVENTS
from analysis.model.rates import (
    INSIDE,
    MOVES,
    NEAR_0,
    PLATE,
    RANGE_AT,
    RIDES,
    SIGN,
    SLOT_PARAMETERS,
    cooper_verner,
    derivative_rates,
    inlined,
    state_rates,
    tight,
)
from analysis.model.switches import (
    CUBE,
    INTEGERS,
    MATRIX,
    VECTOR,
    WATCHED,
    after_touch,
    expect,
    gone,
    rates,
    set_phase,
    switch,
)

DIP = 100
_SHRINK, _SMALLEST = 0.25, 1e-4


@inlined
def _combine(flat, slopes, table, scaled, begin, end, stride, n, out):  # type: ignore[no-untyped-def]
    """Write ``flat`` plus the weighted slopes of some stages; four numbers at a time, which the processor does at once.

    ``n`` is a multiple of four.
    """
    for e in range(0, n, 4):
        t0, t1, t2, t3 = flat[e], flat[e + 1], flat[e + 2], flat[e + 3]
        for j in range(begin, end):
            weight, at = scaled[j], table[j] * stride + e
            t0 += weight * slopes[at]
            t1 += weight * slopes[at + 1]
            t2 += weight * slopes[at + 2]
            t3 += weight * slopes[at + 3]
        out[e], out[e + 1], out[e + 2], out[e + 3] = t0, t1, t2, t3


@tight
def _reach(  # type: ignore[no-untyped-def]
    h, z, k, out, f_end, trial, table, begins, weights, scaled,
    rows, which, p, slots, flags, real, carrying, s, values, effect, cs, c_values, c_effect, told,
):  # fmt: skip
    """Write the state one step ``h`` ahead and the rates there, told in ``told``; ``k[0]`` holds the rates at ``z``."""
    n = rows * z.shape[1]
    slopes_row = z.size
    flat, ahead, staged = z.reshape(z.size), out.reshape(z.size), trial.reshape(z.size)
    slopes = k.reshape(11 * slopes_row)
    for j in range(weights.size):
        scaled[j] = h * weights[j]
    for stage in range(1, 12):
        last = stage == 11
        here, there, stage_state = (f_end, ahead, out) if last else (k[stage], staged, trial)
        _combine(flat, slopes, table, scaled, begins[stage - 1], begins[stage], slopes_row, n, there)
        mass = state_rates(stage_state, here, p, slots, flags, real, s, values, effect, told)
        if rows > 1:
            derivative_rates(
                stage_state, here, rows, which, p, slots, flags, carrying, cs, c_values, c_effect, told, mass
            )


@tight
def _value(item, z, told, p, slots):  # type: ignore[no-untyped-def]
    """Return a watched quantity at a state whose rates were just told."""
    if item < 3:
        return told[0, item]
    if item == 3:
        return z[0, 1]
    slot = item - 4
    return -told[0, 0] - p[SLOT_PARAMETERS + 3 * slot + int(slots[slot, RANGE_AT])]


@tight
def _crossed(z, z_end, f, f_end, told, told_end, h, expected, p, slots):  # type: ignore[no-untyped-def]
    """Return the first watched quantity found on its wrong side after a step, or -1.

    One that may have gone there and come back within the step is returned with DIP added.
    """
    for item in range(expected.size):
        sign = expected[item]
        if sign != 0.0 and _value(item, z_end, told_end, p, slots) * sign < 0.0:
            return item
    for item in range(3):
        sign = expected[item]
        if sign == 0.0:
            continue
        start, end = sign * _slope(item, f, told, p, slots), sign * _slope(item, f_end, told_end, p, slots)
        if start * h < 0.0 < end * h and told[0, item] * sign + 0.5 * start * start * h / (start - end) < 0.0:
            return DIP + item  # its lowest point, on a parabola
    return -1


@tight
def _slope(item, f, told, p, slots):  # type: ignore[no-untyped-def]
    """Return d/dt of xi, xi' or (as far as spring and dashpot make it) F: what the look for dips needs."""
    if item == 0:
        return told[0, 1]
    second = f[0, 3] - f[0, 1]
    for slot in range(slots.shape[0]):
        if slots[slot, MOVES] != 0.0:
            second += slots[slot, MOVES] * f[0, 5 + 2 * slot]
    return second if item == 1 else p[2] * told[0, 1] + p[3] * second


@tight
def _quintic(x0, v0, a0, x1, v1, a1, h, at):  # type: ignore[no-untyped-def]
    """Return (x, v) at ``at`` in [0, h] of the quintic through both ends' position, velocity and acceleration."""
    u = at / h
    d = x1 - x0 - h * (v0 + 0.5 * h * a0)
    e = h * (v1 - v0 - h * a0)
    g = h * h * (a1 - a0)
    c3 = 10.0 * d - 4.0 * e + 0.5 * g
    c4 = -15.0 * d + 7.0 * e - g
    c5 = 6.0 * d - 3.0 * e + 0.5 * g
    x = x0 + at * (v0 + 0.5 * at * a0) + u * u * u * (c3 + u * (c4 + u * c5))
    v = v0 + at * a0 + u * u * (3.0 * c3 + u * (4.0 * c4 + u * 5.0 * c5)) / h
    return x, v


@tight
def _emit(i, at, h, z, f, z_end, f_end, rows, slots, states, d_x):  # type: ignore[no-untyped-def]
    """Write sample ``i``, ``at`` into a step: (x_b, v_b, x_p, v_p, contact point) and the derivatives of x_b."""
    x, v = _quintic(z[0, 0], z[0, 1], f[0, 1], z_end[0, 0], z_end[0, 1], f_end[0, 1], h, at)
    y, u = _quintic(z[0, 2], z[0, 3], f[0, 3], z_end[0, 2], z_end[0, 3], f_end[0, 3], h, at)
    point = y
    for slot in range(slots.shape[0]):
        if slots[slot, MOVES] != 0.0:
            q = 4 + 2 * slot
            more, _ = _quintic(z[0, q], z[0, q + 1], f[0, q + 1], z_end[0, q], z_end[0, q + 1], f_end[0, q + 1], h, at)
            point += slots[slot, MOVES] * more
    states[i, 0], states[i, 1], states[i, 2], states[i, 3], states[i, 4] = x, v, y, u, point
    for j in range(1, rows):
        d, _ = _quintic(z[j, 0], z[j, 1], f[j, 1], z_end[j, 0], z_end[j, 1], f_end[j, 1], h, at)
        d_x[i, j - 1] = d


@njit(cache=True, nogil=True, error_model="numpy")
def _march(  # type: ignore[no-untyped-def]
    forward, times, first, last, p, which, variant, slots, steps, real, carrying,
    states, d_x, event_time, event_kind, event_state, event_d_time, event_d_state,
):  # fmt: skip
    """March from first touch to the last (or back to the first) sample; return the number of events, or -1."""
    rows = which.size + 1
    table, begins, weights = cooper_verner()
    scaled = np.empty(weights.size)
    size = event_state.shape[1]
    z, z_end = np.zeros((rows, size)), np.zeros((rows, size))
    k, trial = np.zeros((11, rows, size)), np.zeros((rows, size))
    f_end, f_after = np.zeros((rows, size)), np.zeros((rows, size))
    told, told_end, told_any = np.zeros((rows, 3)), np.zeros((rows, 3)), np.zeros((max(rows, 2), 3))
    s, values, effect = np.zeros(kernel.STATES), np.zeros(3), np.zeros(kernel.OUTPUTS)
    cs = np.zeros(kernel.STATES, dtype=np.complex128)
    c_values = np.zeros(3, dtype=np.complex128)
    c_effect = np.zeros(kernel.OUTPUTS, dtype=np.complex128)
    nothing = np.full(1, -1, dtype=np.int64)
    single, couple = rows - rows + 1, rows - rows + 2  # of the type of ``rows``, so that one compiled kernel serves
    pair, pair_rate = np.zeros((2, size)), np.zeros((2, size))
    flags, expected = np.zeros(NEAR_0 + slots.shape[0]), np.zeros(WATCHED + slots.shape[0])
    z[0, 0], z[0, 1], z[0, 2], z[0, 3] = p[5], p[4], p[5], p[6]
    for j in range(1, rows):
        by = which[j - 1]
        z[j, 0] = 1.0 if by == 5 else 0.0
        z[j, 1] = 1.0 if by == 4 else 0.0
        z[j, 2] = 1.0 if by == 5 else 0.0
        z[j, 3] = 1.0 if by == 6 else 0.0
    for slot in range(slots.shape[0]):
        if slots[slot, RIDES] > 0.5:
            for j in range(rows):
                z[j, 4 + 2 * slot] = z[j, 0]
                z[j, 5 + 2 * slot] = z[j, 1]
    direction = 1.0 if forward else -1.0
    phase = CONTACT if forward else FREE
    flags[SIGN] = -1.0
    if forward:
        flags[PLATE] = flags[INSIDE] = 1.0
        set_phase(phase, flags)
    else:
        for slot in range(slots.shape[0]):
            if slots[slot, RANGE_AT] >= 0.0:
                flags[NEAR_0 + slot] = 1.0
    expect(phase, variant, flags, slots, not forward, expected)
    inertia = rates(
        z, k[0], rows, which, p, slots, flags, real, carrying,
        s, values, effect, cs, c_values, c_effect, told,
    )  # fmt: skip
    if not inertia > 0.0:  # what rides inside outweighs the block
        return -2
    events = 0
    if forward:
        event_time[0] = 0.0
        event_kind[0] = 10 * FREE + CONTACT
        event_state[0] = z[0]
        for j in range(1, rows):
            event_d_time[0, j - 1] = 0.0
            event_d_state[0, j - 1] = z[j]
        events = 1
    omega = math.sqrt(p[0] / p[1])
    t = 0.0
    gone_at = 0.0
    i = first
    longest = steps[0] if forward else steps[3]
    h = longest * _SMALLEST
    growth, nearing = steps[4], steps[5]
    approaching = 0  # steps still to be taken without growing, after one was refused
    while (i <= last) if forward else (i >= last):
        remaining = abs(times[last] - t)
        if remaining <= 0.0:
            remaining = longest
        h = min(h, longest)
        if nearing > 0.0 and told[0, 0] * expected[0] > 0.0 and told[0, 1] * expected[0] * direction < 0.0:
            h = min(h, max(nearing * abs(told[0, 0] / told[0, 1]), longest * _SMALLEST))
        if h > remaining:
            h = remaining
        signed = direction * h
        _reach(
            signed, z, k, z_end, f_end, trial, table, begins, weights, scaled,
            rows, which, p, slots, flags, real, carrying, s, values, effect, cs, c_values, c_effect, told_end,
        )  # fmt: skip
        item = _crossed(z, z_end, k[0], f_end, told, told_end, signed, expected, p, slots)
        if item >= 0:
            if h > longest * _SMALLEST * 1.000001:
                h = max(h * _SHRINK, longest * _SMALLEST)
                approaching = 6
                continue
            if item >= DIP:  # looked at as closely as can be, and it stays on its side
                item = -1
        if item >= 0:
            # So short a step is straight to rounding: a secant search on its length meets the switch.
            lo, at_lo = 0.0, _value(item, z, told, p, slots)
            hi, at_hi = signed, _value(item, z_end, told_end, p, slots)
            for _ in range(12):
                if at_hi == at_lo:
                    break
                new = hi - at_hi * (hi - lo) / (at_hi - at_lo)
                new = min(max(new * direction, 0.0), 2.0 * h) * direction
                if abs(new - hi) <= 1e-17 + 1e-13 * h:
                    break
                lo, at_lo = hi, at_hi
                hi = new
                _reach(
                    hi, z, k, z_end, f_end, trial, table, begins, weights, scaled,
                    single, which, p, slots, flags, real, carrying, s, values, effect, cs, c_values, c_effect, told_end,
                )  # fmt: skip
                at_hi = _value(item, z_end, told_end, p, slots)
            signed = hi
            _reach(
                signed, z, k, z_end, f_end, trial, table, begins, weights, scaled,
                rows, which, p, slots, flags, real, carrying, s, values, effect, cs, c_values, c_effect, told_end,
            )  # fmt: skip
        if not np.isfinite(z_end[0, 0] + z_end[0, 1] + z_end[0, 3]):
            return -2
        while (i <= last and times[i] <= t + signed) if forward else (i >= last and times[i] >= t + signed):
            if signed == 0.0:
                _emit(i, 0.0, longest, z, k[0], z, k[0], rows, slots, states, d_x)
            else:
                _emit(i, times[i] - t, signed, z, k[0], z_end, f_end, rows, slots, states, d_x)
            if flags[PLATE] < 0.5:  # left to itself, or still at its start: the plate rings freely
                since = times[i] - (0.0 if not forward else gone_at)
                cosine, sine = math.cos(omega * since), math.sin(omega * since)
                swing = sine / omega if omega > 0.0 else since
                states[i, 3] = z[0, 3] * cosine - z[0, 2] * omega * sine
                states[i, 2] = z[0, 2] * cosine + z[0, 3] * swing
                states[i, 4] = states[i, 2]
            i += 1 if forward else -1
        t += signed
        z, z_end = z_end, z
        told, told_end = told_end, told
        if item < 0:
            for row in range(rows):
                for c in range(size):
                    k[0, row, c] = f_end[row, c]
            if approaching > 0:
                approaching -= 1
            else:
                h *= growth
        else:
            if events >= MAX_EVENTS:
                return -1
            phase = switch(
                item, phase, t, forward, z, f_end, f_after, told, pair, pair_rate, told_any, nothing, couple,
                rows, which, p, slots, flags, real, carrying, s, values, effect, cs, c_values, c_effect,
                events, event_time, event_kind, event_state, event_d_time, event_d_state,
            )  # fmt: skip
            if forward:
                events += 1
            approaching = 0
            h = longest * _SMALLEST
        free = forward and phase == FREE and flags[PLATE] > 0.5
        if free and gone(z[0, 0], z[0, 1], z[0, 2], z[0, 3], z[0, 4:], slots, flags, omega):
            flags[PLATE] = 0.0
            gone_at = t
            approaching = 0
            item = 0
        if item >= 0:
            expect(phase, variant, flags, slots, not forward, expected)
            rates(
                z, k[0], rows, which, p, slots, flags, real, carrying,
                s, values, effect, cs, c_values, c_effect, told,
            )  # fmt: skip
            if forward:
                longest = steps[0] if phase != FREE else (steps[1] if flags[PLATE] > 0.5 else steps[2])
                h = min(h, longest)
                h = max(h, longest * _SMALLEST)
    return events


@njit(
    types.int64(
        VECTOR, VECTOR, INTEGERS, types.int64, MATRIX, VECTOR, INTEGERS, INTEGERS,
        MATRIX, MATRIX, VECTOR, INTEGERS, MATRIX, MATRIX, CUBE,
    ),
    cache=True, nogil=True, error_model="numpy",
)  # fmt: skip
def integrate(  # type: ignore[no-untyped-def]
    times, p, which, variant, slots, steps, real, carrying,
    states, d_x, event_time, event_kind, event_state, event_d_time, event_d_state,
):  # fmt: skip
    """Solve base model and effects at ``times`` (ascending, 0 = first touch); as ``phases.solve``, shapes in ``rates``.

    ``real`` and ``carrying`` are the addresses of the effects in real and in complex numbers (which derivatives need).
    ``steps``: longest step in s in contact, apart, gone, and before the touch; the factor by which steps grow after a
    switch; and the share of the way to the next touch or release that a step may go (0: all of it).  Returns the
    number of events; -1 when more than MAX_EVENTS happen, -2 when the state runs away.  About 1.3 ms for 60 ms,
    and 1 ms for each derivative.
    """
    n = times.size
    split = after_touch(times, n)
    if split > 0:
        done = _march(
            split < 0, times, split - 1, n - n, p, which, variant, slots, steps, real, carrying,
            states, d_x, event_time, event_kind, event_state, event_d_time, event_d_state,
        )  # fmt: skip
        if done < 0:
            return done
    return _march(
        split >= 0, times, split, n - 1, p, which, variant, slots, steps, real, carrying,
        states, d_x, event_time, event_kind, event_state, event_d_time, event_d_state,
    )  # fmt: skip
