"""A quick integrator for searches: base model and any effects at once, right to some picometres, 0.2 to 1 ms a shot.

The classical Runge-Kutta method from sample to sample over the model's own equations (``model.rates``) and the
catalogue's own functions; a switch (touch, release, turn, reach of an attraction) is met by bisection, so that the
answer is smooth in the parameters.  Positions count from the plate's rest.
"""

import numpy as np
from numba import njit

from analysis.model.effects import kernel
from analysis.model.rates import (
    DASH,
    HIDDEN,
    INSIDE,
    MOVES,
    NEAR_0,
    PLATE,
    RANGE_AT,
    RIDES,
    SIGN,
    SLOT_PARAMETERS,
    SPRING,
    inlined,
    state_rates,
    tight,
)

MOST_SWITCHES = 400
_BISECTIONS = 46
OVERLAP, VELOCITY, REACH_0 = 0, 1, 2  # what is watched; REACH_0 + slot


@tight
def step(z, h, p, slots, flags, functions, k, work, out, s, values, effect, told):  # type: ignore[no-untyped-def]
    """Write the state one step of ``h`` ahead; four evaluations of the rates."""
    size = z.shape[1]
    state_rates(z, k[0], p, slots, flags, functions, s, values, effect, told)
    for i in range(size):
        work[0, i] = z[0, i] + 0.5 * h * k[0, 0, i]
    state_rates(work, k[1], p, slots, flags, functions, s, values, effect, told)
    for i in range(size):
        work[0, i] = z[0, i] + 0.5 * h * k[1, 0, i]
    state_rates(work, k[2], p, slots, flags, functions, s, values, effect, told)
    for i in range(size):
        work[0, i] = z[0, i] + h * k[2, 0, i]
    state_rates(work, k[3], p, slots, flags, functions, s, values, effect, told)
    for i in range(size):
        out[0, i] = z[0, i] + h / 6.0 * (k[0, 0, i] + 2.0 * k[1, 0, i] + 2.0 * k[2, 0, i] + k[3, 0, i])


@inlined
def _point(z, slots):  # type: ignore[no-untyped-def]
    """Return where the contact point is."""
    at = z[0, 2]
    for slot in range(slots.shape[0]):
        if slots[slot, MOVES] != 0.0:
            at += slots[slot, MOVES] * z[0, 4 + 2 * slot]
    return at


@inlined
def _reach(slot, p, slots):  # type: ignore[no-untyped-def]
    return p[SLOT_PARAMETERS + 3 * slot + int(slots[slot, RANGE_AT])]


@inlined
def _watched(z, p, slots, which):  # type: ignore[no-untyped-def]
    """Return what is positive while a switch is on: overlap, velocity, how far inside an attraction's reach."""
    if which == VELOCITY:
        return z[0, 1]
    overlap = _point(z, slots) - z[0, 0]
    return overlap if which == OVERLAP else overlap + _reach(which - REACH_0, p, slots)


@inlined
def set_flags(on, slots, flags):  # type: ignore[no-untyped-def]
    """Write the flags that go with the switches; what attracts does so while the bodies are apart."""
    touching = 1.0 if on[OVERLAP] else 0.0
    flags[SPRING], flags[DASH] = touching, touching
    flags[SIGN] = 1.0 if on[VELOCITY] else -1.0
    for slot in range(slots.shape[0]):
        flags[NEAR_0 + slot] = 1.0 if on[REACH_0 + slot] and not on[OVERLAP] else 0.0


@tight
def first_switch(z, new, h, p, slots, flags, functions, on, used, k, work, s, values, effect, told):  # type: ignore[no-untyped-def]
    """Return (time, which) of the first switch within a step that ended in ``new``, or (h, -1)."""
    best, found = h, -1
    for which in range(on.size):
        if not used[which] or (_watched(new, p, slots, which) > 0.0) == on[which]:
            continue
        low, high = 0.0, h
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low + high)
            step(z, middle, p, slots, flags, functions, k, work, new, s, values, effect, told)
            if (_watched(new, p, slots, which) > 0.0) == on[which]:
                low = middle
            else:
                high = middle
        if found < 0 or high < best:
            best, found = high, which
        step(z, h, p, slots, flags, functions, k, work, new, s, values, effect, told)
    return best, found


@inlined
def entry(time_s, z, p, slots, flags, on, used):  # type: ignore[no-untyped-def]
    """Return where the block is at time zero, whether something attracts, and the first sample not before it.

    Writes the state and the flags from which the flight is followed backwards; marks the reaches as watched.
    """
    start, attracts = p[5], False
    for slot in range(slots.shape[0]):
        if slots[slot, RANGE_AT] >= 0.0:
            used[REACH_0 + slot] = attracts = True
            start = max(start, _reach(slot, p, slots))
    first = 0
    while first < time_s.size and time_s[first] < 0.0:
        first += 1
    set_flags(on, slots, flags)
    z[0, 0], z[0, 1] = start, p[4]
    return start, attracts, first


@inlined
def meet(z, start, attracts, p, slots, flags, on, used):  # type: ignore[no-untyped-def]
    """Write the state at time zero, from which plate and hidden parts take part, and its switches and flags."""
    flags[PLATE] = flags[INSIDE] = 1.0
    z[0, 0], z[0, 1], z[0, 2], z[0, 3] = start, p[4], p[5], p[6]
    for i in range(4, z.shape[1]):
        z[0, i] = 0.0
    on[OVERLAP] = not attracts
    used[OVERLAP], used[VELOCITY] = True, slots.shape[0] > 0
    for slot in range(slots.shape[0]):
        if slots[slot, RIDES] > 0.5 and slots[slot, HIDDEN] > 0.5:
            z[0, 4 + 2 * slot], z[0, 5 + 2 * slot] = start, p[4]
        on[REACH_0 + slot] = used[REACH_0 + slot] and _reach(slot, p, slots) >= start
    set_flags(on, slots, flags)


@njit(cache=True, nogil=True, error_model="numpy")
def integrate(time_s, p, slots, functions, size, pieces, apart, x, v, plate, changes):  # type: ignore[no-untyped-def]
    """Write position and velocity of the block and position of the contact point at ``time_s`` (ascending).

    ``p``, ``slots`` and ``functions`` are those of ``model.rates``, ``size`` the length of the state.  Time zero is the
    first touch (or the entry into an attraction's reach), where the block has its velocity; before it only what acts
    on the block takes part, and what rides inside it has come to rest.  ``pieces`` steps a sample in contact,
    ``apart`` out of it.  Writes the times of touch and release to ``changes`` and returns their number, -1 when there
    are too many switches, -2 where the hidden parts outweigh the block.
    """
    k, work, new, z = np.zeros((4, 1, size)), np.zeros((1, size)), np.zeros((1, size)), np.zeros((1, size))
    s, values, effect, told = np.zeros(kernel.STATES), np.zeros(3), np.zeros(kernel.OUTPUTS), np.zeros((1, 3))
    count = slots.shape[0]
    flags = np.zeros(NEAR_0 + count)
    on, used = np.zeros(2 + count, dtype=np.bool_), np.zeros(2 + count, dtype=np.bool_)
    start, attracts, first = entry(time_s, z, p, slots, flags, on, used)
    t = 0.0
    for i in range(first - 1, -1, -1):
        step(z, time_s[i] - t, p, slots, flags, functions, k, work, new, s, values, effect, told)
        z[0, 0], z[0, 1] = new[0, 0], new[0, 1]
        t = time_s[i]
        x[i], v[i], plate[i] = z[0, 0], z[0, 1], 0.0
    meet(z, start, attracts, p, slots, flags, on, used)
    if not state_rates(z, k[0], p, slots, flags, functions, s, values, effect, told) > 0.0:
        return -2
    t = 0.0
    switches, changed = 0, 0
    for i in range(first, time_s.size):
        end = time_s[i]
        piece = (end - t) / (pieces if on[OVERLAP] else apart)
        while t < end - 1e-15:
            h = min(piece, end - t)
            step(z, h, p, slots, flags, functions, k, work, new, s, values, effect, told)
            at, which = first_switch(z, new, h, p, slots, flags, functions, on, used, k, work, s, values, effect, told)
            if which >= 0:
                step(z, at, p, slots, flags, functions, k, work, new, s, values, effect, told)
                on[which] = not on[which]
                set_flags(on, slots, flags)
                switches += 1
                if which == OVERLAP and changed < changes.size:
                    changes[changed] = t + at
                    changed += 1
                if switches > MOST_SWITCHES:
                    return -1
            for j in range(size):
                z[0, j] = new[0, j]
            t += at
        t = end
        x[i], v[i], plate[i] = z[0, 0], z[0, 1], _point(z, slots)
    return changed
