"""The integrator of effects that are linear: phase by phase in closed form, as ``phases`` does without effects.

Most of the catalogue is linear in the state within a phase: s' = A s + b, with A and b from the one place where the
equations stand (``rates``), asked at unit states.  Then every step is exp(A h), summed as its Taylor series, and so
are the derivatives by the parameters, S' = A S + (dA/dtheta) s + db/dtheta: exact to rounding at any length of step,
where a Runge-Kutta method needs a dozen evaluations every quarter of a radian.  Whether that form is true is asked at
other states in every phase that is met; where it is not, ``hybrid`` integrates.
"""

import math

import numpy as np
from numba import njit, types

from analysis.model.crossings import lowest, may_switch, may_touch, root
from analysis.model.effects import kernel
from analysis.model.phases import CONTACT, FREE, MAX_EVENTS
from analysis.model.propagators import advance, along, form, propagate, repeat, show, step, step_alone
from analysis.model.rates import INSIDE, NEAR_0, PLATE, RIDES, SIGN
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

NOT_LINEAR = -3
_STEP = 0.7  # longest step times the fastest rate: nine steps a period, so that no touch is stepped over
_LONGEST_S = 1e-3
_PHASES = 16  # phase of the contact (4), who takes part (2), direction of motion (2)


@njit(cache=True, nogil=True, error_model="numpy")
def _march(  # type: ignore[no-untyped-def]
    forward, times, first, last, block, p, which, variant, slots, n, swings, real, carrying,
    states, d_x, event_time, event_kind, event_state, event_d_time, event_d_state,
):  # fmt: skip
    """March from first touch to the last (or back to the first) sample; return the number of events, or why not.

    Steps go from sample to sample, or over a block of them where nothing happens in it.
    """
    rows, count = which.size + 1, which.size
    total = rows + n
    wide = 4 * ((rows + 3) // 4) if rows > 1 else 1
    every = np.full(n + count, -1, dtype=np.int64)
    for k in range(count):
        every[n + k] = which[k]
    s, values, effect = np.zeros(kernel.STATES), np.zeros(3), np.zeros(kernel.OUTPUTS)
    cs = np.zeros(kernel.STATES, dtype=np.complex128)
    c_values = np.zeros(3, dtype=np.complex128)
    c_effect = np.zeros(kernel.OUTPUTS, dtype=np.complex128)
    nothing = np.full(1, -1, dtype=np.int64)
    single, couple = rows - rows + 1, rows - rows + 2  # of the type of ``rows``, so that one compiled kernel serves
    plain, plain_f, plain_told = np.zeros((total, n)), np.zeros((total, n)), np.zeros((total, 3))
    f_after, told_any = np.zeros((rows, n)), np.zeros((max(rows, 2), 3))
    pair, pair_rate = np.zeros((2, n)), np.zeros((2, n))
    a_of, by_of = np.empty((_PHASES, n + 1, n + 1)), np.empty((_PHASES, count, n + 1, n + 1))
    value_of, slope_of = np.empty((_PHASES, WATCHED, n + 1)), np.empty((_PHASES, WATCHED, n + 1))
    e_of, d_of = np.empty((_PHASES, n + 1, n + 1)), np.empty((_PHASES, n + 1, n + 1, wide))
    whole_of, d_whole_of = np.empty((_PHASES, n + 1, n + 1)), np.empty((_PHASES, n + 1, n + 1, wide))
    mean_of, d_mean_of = np.empty((_PHASES, 5, n + 1)), np.empty((_PHASES, n + 1, wide))
    shown_of, slow_of = np.empty((_PHASES, 5, n + 1)), np.zeros(_PHASES, dtype=np.bool_)
    d_work = np.empty((n + 1, n + 1, wide))
    bit_of, pieces_of = np.empty(_PHASES), np.zeros(_PHASES, dtype=np.int64)
    terms_of = np.zeros(_PHASES, dtype=np.int64)
    square, other = np.empty((n + 1, n + 1)), np.empty((n + 1, n + 1))
    d_term, d_new = np.empty((count, n + 1, n + 1)), np.empty((n + 1, n + 1))
    z, z_end = np.zeros((n + 1, wide)), np.zeros((n + 1, wide))
    near, further = np.zeros((n + 1, 1)), np.zeros((n + 1, 1))
    probe, term, new = np.zeros((n + 1, wide)), np.zeros((n + 1, wide)), np.zeros((n + 1, wide))
    flags, expected = np.zeros(NEAR_0 + slots.shape[0]), np.zeros(WATCHED + slots.shape[0])
    z[0, 0], z[1, 0], z[2, 0], z[3, 0], z[n, 0] = p[5], p[4], p[5], p[6], 1.0
    z_end[n, 0] = 1.0
    for k in range(count):
        by = which[k]
        z[0, 1 + k] = 1.0 if by == 5 else 0.0
        z[1, 1 + k] = 1.0 if by == 4 else 0.0
        z[2, 1 + k] = 1.0 if by == 5 else 0.0
        z[3, 1 + k] = 1.0 if by == 6 else 0.0
    for slot in range(slots.shape[0]):
        if slots[slot, RIDES] > 0.5:
            for k in range(rows):
                z[4 + 2 * slot, k] = z[0, k]
                z[5 + 2 * slot, k] = z[1, k]
    direction = 1.0 if forward else -1.0
    phase = CONTACT if forward else FREE
    flags[SIGN] = -1.0
    if forward:
        flags[PLATE] = flags[INSIDE] = 1.0
        set_phase(phase, flags)
    expect(phase, variant, flags, slots, not forward, expected)
    spacing = _LONGEST_S
    if first != last:
        spacing = abs(times[first + int(direction)] - times[first])
        mean = abs(times[last] - times[first]) / abs(last - first)
        spacing = mean if abs(mean - spacing) < 1e-9 * spacing else max(spacing, 1e-9)
    omega = math.sqrt(p[0] / p[1])
    events = 0
    if forward:
        event_time[0] = 0.0
        event_kind[0] = 10 * FREE + CONTACT
        for c in range(n):
            event_state[0, c] = z[c, 0]
            for k in range(count):
                event_d_state[0, k, c] = z[c, 1 + k]
        for k in range(count):
            event_d_time[0, k] = 0.0
        events = 1
    t, i, left, share = 0.0, first, 0, 1.0 / block
    careful = -1  # the first sample of a block in which something happens
    at = -1  # where what is known of this phase is kept
    while (i <= last) if forward else (i >= last):
        if at < 0:
            at = 4 * phase + (2 if flags[PLATE] > 0.5 else 0) + (1 if flags[SIGN] > 0.0 else 0)
            a, by_each, value, slope = a_of[at], by_of[at], value_of[at], slope_of[at]
            if pieces_of[at] == 0:
                fine = form(
                    n, rows, total, every, plain, plain_f, plain_told, p, slots, flags, real, carrying,
                    s, values, effect, cs, c_values, c_effect, a, by_each, value,
                )  # fmt: skip
                if not fine:
                    return NOT_LINEAR
                for c in range(n + 1):
                    value[3, c] = 1.0 if c == 1 else 0.0
                for item in range(WATCHED):
                    for c in range(n + 1):
                        slope[item, c] = 0.0
                        for j in range(n):
                            slope[item, c] += value[item, j] * a[j, c]
                swing = swings[3] if not forward else swings[0 if phase != FREE else (1 if flags[PLATE] > 0.5 else 2)]
                pieces_of[at] = max(1, math.ceil(spacing / min(_STEP / max(swing, 1e-9), _LONGEST_S) - 1e-9))
                bit_of[at] = direction * spacing / pieces_of[at]
                terms_of[at] = propagate(
                    a, by_each, rows, bit_of[at], e_of[at], d_of[at], square, other, d_term, d_new
                )  # fmt: skip
                there = flags[PLATE] > 0.5
                for c in range(n + 1):
                    for j in range(4):
                        shown_of[at, j, c] = 1.0 if c == j else 0.0
                    # The overlap and the block's position make the contact point; left to itself, it is the plate.
                    shown_of[at, 4, c] = (value[0, c] if there else 0.0) if c != 0 and c != 2 else 0.0
                shown_of[at, 4, 2] = 1.0
                slow_of[at] = not (there and swing * spacing * block > _STEP)
                if block > 1 and pieces_of[at] == 1:
                    repeat(
                        e_of[at], d_of[at], rows, block, shown_of[at], whole_of[at], d_whole_of[at],
                        mean_of[at], d_mean_of[at], square, d_work,
                    )  # fmt: skip
            e, d, bit, pieces, terms = e_of[at], d_of[at], bit_of[at], pieces_of[at], terms_of[at]
            slow = slow_of[at]
        remaining = times[i] - t
        crossed, h, jumped = -1, 0.0, 1
        if left > 0 or abs(remaining) > 1e-15:
            even = left > 0 or abs(remaining - direction * spacing) < 2e-15
            whole = i % block == 0 and i + block - 1 <= last if forward else i % block == block - 1
            if whole and even and block > 1 and pieces == 1 and i != careful:
                # Where something swings fast the state alone is looked at on every sample first.
                looks = 1 if slow else block
                apart = block * bit / looks
                if may_switch(value, slope, expected, z, whole_of[at] if slow else e, apart, looks, near, further):
                    careful = i
                    continue
                jumped, h = block, block * bit
                ahead_e, ahead_d = whole_of[at], d_whole_of[at]
            else:
                ahead_e, ahead_d = e, d
                h = bit
                if even:
                    left = (pieces if left == 0 else left) - 1
                elif abs(remaining) <= abs(bit):
                    h = remaining
            if not even:
                advance(z, rows, a, by_each, h, terms, z_end, term, new)
            elif rows > 1:
                step(z, ahead_e, ahead_d, z_end)
            else:
                step_alone(z, ahead_e, z_end)
            best = h
            for item in range(WATCHED if jumped == 1 else 0):
                sign = expected[item]
                if sign == 0.0:
                    continue
                if along(value, item, z_end) * sign < 0.0:
                    when = root(value, slope, item, sign, z, a, by_each, single, terms, 0.0, h, probe, term, new)
                elif may_touch(value, slope, item, sign, z, z_end, h):
                    turn = lowest(value, slope, item, sign, z, a, by_each, single, terms, h, probe, term, new)
                    advance(z, single, a, by_each, turn, terms, probe, term, new)
                    if along(value, item, probe) * sign >= 0.0:
                        continue
                    when = root(value, slope, item, sign, z, a, by_each, single, terms, 0.0, turn, probe, term, new)
                else:
                    continue
                if crossed < 0 or when < best:
                    crossed, best = item, when
            if crossed >= 0:
                h, left = best, 0
                advance(z, rows, a, by_each, h, terms, z_end, term, new)
            if not math.isfinite(z_end[0, 0] + z_end[1, 0] + z_end[3, 0]):
                return -2
            if jumped > 1:
                show(z, rows, mean_of[at], d_mean_of[at], states[i // block], d_x[i // block])
            z, z_end = z_end, z
            t += h
        if jumped > 1:
            i += jumped if forward else -jumped
        elif crossed < 0 and left == 0 and abs(times[i] - t) < 1e-14:
            row = i // block
            for j in range(4):
                states[row, j] += share * z[j, 0]
            states[row, 4] += share * along(shown_of[at], 4, z)
            for k in range(count):
                d_x[row, k] += share * z[0, 1 + k]
            i += 1 if forward else -1
        if crossed >= 0:
            if events >= MAX_EVENTS:
                return -1
            for k in range(rows):
                for c in range(n):
                    plain[k, c] = z[c, k]
            rates(
                plain, plain_f, rows, which, p, slots, flags, real, carrying,
                s, values, effect, cs, c_values, c_effect, plain_told,
            )  # fmt: skip
            phase = switch(
                crossed, phase, t, forward, plain, plain_f, f_after, plain_told, pair, pair_rate, told_any,
                nothing, couple, rows, which, p, slots, flags, real, carrying,
                s, values, effect, cs, c_values, c_effect,
                events, event_time, event_kind, event_state, event_d_time, event_d_state,
            )  # fmt: skip
            events += 1
            for k in range(1, rows):
                for c in range(n):
                    z[c, k] = plain[k, c]
        if forward and phase == FREE and flags[PLATE] > 0.5:
            for c in range(n - 4):
                pair[0, c] = z[4 + c, 0]
            if gone(z[0, 0], z[1, 0], z[2, 0], z[3, 0], pair[0], slots, flags, omega):
                flags[PLATE] = 0.0
                crossed = 0
        if crossed >= 0:
            expect(phase, variant, flags, slots, not forward, expected)
            at, left = -1, 0
    return events


@njit(
    types.int64(
        VECTOR, types.int64, VECTOR, INTEGERS, types.int64, MATRIX, types.int64, VECTOR, INTEGERS, INTEGERS,
        MATRIX, MATRIX, VECTOR, INTEGERS, MATRIX, MATRIX, CUBE,
    ),
    cache=True, nogil=True, error_model="numpy",
)  # fmt: skip
def integrate(  # type: ignore[no-untyped-def]
    times, block, p, which, variant, slots, n, swings, real, carrying,
    states, d_x, event_time, event_kind, event_state, event_d_time, event_d_state,
):  # fmt: skip
    """Solve base model and effects at ``times`` as ``hybrid.integrate`` does, in steps of any length.

    ``states``, shape (m, 5), and ``d_x``, shape (m, k), are means over blocks of ``block`` samples, an incomplete one
    left out.  ``n`` numbers in a state; ``swings``: the fastest rates in rad/s in contact, apart, gone and before the
    touch.  Returns the number of events; -1 when more than MAX_EVENTS happen, -2 when the state runs away, NOT_LINEAR
    where the effects have not the form.  For 60 ms at 100 kS/s 0.3 to 0.5 ms, with derivatives 1 to 2.5 ms; in blocks
    of five 0.2 ms and 0.4 to 0.8 ms.
    """
    samples = block * (times.size // block)
    states[:], d_x[:] = 0.0, 0.0
    split = after_touch(times, samples)
    if split > 0:
        done = _march(
            split < 0, times, split - 1, samples - samples, block, p, which, variant, slots, n, swings, real, carrying,
            states, d_x, event_time, event_kind, event_state, event_d_time, event_d_state,
        )  # fmt: skip
        if done < 0:
            return done
    return _march(
        split >= 0, times, split, samples - 1, block, p, which, variant, slots, n, swings, real, carrying,
        states, d_x, event_time, event_kind, event_state, event_d_time, event_d_state,
    )  # fmt: skip
