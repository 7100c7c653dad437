"""Kernels of the exact solver: linear phases in closed form, the instants between them by root finding.

A phase is linear, s' = A s with s = (x_b, v_b, x_p, v_p), so its propagator is exp(A h), summed here as its Taylor
series to the last bit (h is kept short against the fastest period, where the series converges at once and, unlike
eigenvectors, knows no degenerate case).  The derivatives of the state by the parameters obey S' = A S + (dA/dtheta) s
and travel in the same series; where the phase changes at a time that itself depends on the parameters they jump by
(f_before - f_after) dt/dtheta (the saltation of a hybrid system; Leine & Nijmeijer, "Dynamics and Bifurcations of
Non-Smooth Mechanical Systems", ch. 7).

Rows of ``w``, shape (8, 4): the state, then its derivatives by k_p, m_p*, k_N, gamma_N, v_i, and by the plate's
displacement and velocity at first touch.
"""

import math

import numpy as np
from numba import njit

COLUMNS = 7
FREE, CONTACT, PARTING, OVERLAPPED = 0, 1, 2, 3
MAX_EVENTS = 400
_STEP = 0.7  # longest step times the phase's fastest rate: nine steps a period, so no bounce is stepped over
_TERMS = 22  # 0.7^22 / 22! = 3e-25


@njit(cache=True, nogil=True, error_model="numpy")
def rates(w, out, rows, p, spring, dash):  # type: ignore[no-untyped-def]
    """Write d/dt of the state and of ``rows - 1`` derivatives; about 10 flops a row."""
    k_p, m_p, k_n, g_n, m_b = p[0], p[1], p[2], p[3], p[7]
    k = k_n * spring
    g = g_n * dash
    xi = w[0, 2] - w[0, 0]
    xi_rate = w[0, 3] - w[0, 1]
    force = k * xi + g * xi_rate
    out[0, 0] = w[0, 1]
    out[0, 1] = force / m_b
    out[0, 2] = w[0, 3]
    out[0, 3] = -(k_p * w[0, 2] + force) / m_p
    for j in range(1, rows):
        d_force = k * (w[j, 2] - w[j, 0]) + g * (w[j, 3] - w[j, 1])
        d_plate = k_p * w[j, 2]
        if j == 1:
            d_plate += w[0, 2]
        elif j == 2:
            d_plate += out[0, 3]
        elif j == 3:
            d_force += spring * xi
        elif j == 4:
            d_force += dash * xi_rate
        out[j, 0] = w[j, 1]
        out[j, 1] = d_force / m_b
        out[j, 2] = w[j, 3]
        out[j, 3] = -(d_plate + d_force) / m_p


@njit(cache=True, nogil=True, error_model="numpy")
def advance(w, rows, p, spring, dash, fastest, dt):  # type: ignore[no-untyped-def]
    """Propagate ``w`` in place by ``dt`` (either sign) within one phase; about 0.2 us a row and step."""
    pieces = max(1, math.ceil(abs(dt) * fastest / _STEP))
    h = dt / pieces
    term = np.empty((COLUMNS + 1, 4))
    rate = np.empty((COLUMNS + 1, 4))
    for _ in range(pieces):
        for j in range(rows):
            for i in range(4):
                term[j, i] = w[j, i]
        for n in range(1, _TERMS):
            rates(term, rate, rows, p, spring, dash)
            scale = h / n
            for j in range(rows):
                for i in range(4):
                    term[j, i] = rate[j, i] * scale
                    w[j, i] += term[j, i]


@njit(cache=True, nogil=True, error_model="numpy")
def propagator(p, spring, dash, fastest, dt, e, de):  # type: ignore[no-untyped-def]
    """Write exp(A dt), shape (4, 4), and its derivatives by k_p, m_p*, k_N, gamma_N, shape (4, 4, 4); about 5 us."""
    w = np.empty((COLUMNS + 1, 4))
    for column in range(4):
        w[:] = 0.0
        w[0, column] = 1.0
        advance(w, 5, p, spring, dash, fastest, dt)
        for i in range(4):
            e[i, column] = w[0, i]
            for j in range(4):
                de[j, i, column] = w[j + 1, i]


@njit(cache=True, nogil=True, error_model="numpy")
def step(w, out, rows, e, de):  # type: ignore[no-untyped-def]
    """Apply a propagator to state and derivatives; 32 flops a row."""
    for i in range(4):
        out[0, i] = e[i, 0] * w[0, 0] + e[i, 1] * w[0, 1] + e[i, 2] * w[0, 2] + e[i, 3] * w[0, 3]
    for j in range(1, rows):
        for i in range(4):
            out[j, i] = e[i, 0] * w[j, 0] + e[i, 1] * w[j, 1] + e[i, 2] * w[j, 2] + e[i, 3] * w[j, 3]
        if j < 5:
            d = de[j - 1]
            for i in range(4):
                out[j, i] += d[i, 0] * w[0, 0] + d[i, 1] * w[0, 1] + d[i, 2] * w[0, 2] + d[i, 3] * w[0, 3]


@njit(cache=True, nogil=True, error_model="numpy")
def phase_of(phase, p):  # type: ignore[no-untyped-def]
    """Return (spring on, dashpot on, fastest rate in rad/s) of a phase."""
    k_p, m_p, k_n, g_n, m_b = p[0], p[1], p[2], p[3], p[7]
    if phase in (FREE, OVERLAPPED):
        return 0.0, 0.0, math.sqrt(k_p / m_p)
    inverse = 1.0 / m_b + 1.0 / m_p
    dash = 1.0 if phase == CONTACT else 0.0
    return 1.0, dash, max(math.sqrt(k_n * inverse + k_p / m_p), dash * g_n * inverse)


@njit(cache=True, nogil=True, error_model="numpy")
def watch(phase, which, variant, p):  # type: ignore[no-untyped-def]
    """Return one watched functional a xi + b xi' of a phase: (a, b, direction of its crossing, next phase).

    Direction 0 means: nothing more to watch.
    """
    if phase == FREE:
        if which == 0:
            return 1.0, 0.0, 1, CONTACT
    elif phase == CONTACT:
        if which == 0:
            if variant == 0:
                return 1.0, 0.0, -1, FREE
            if variant == 1:
                return 0.0, 1.0, -1, PARTING
            return p[2], p[3], -1, OVERLAPPED
    elif phase == PARTING:
        if which == 0:
            return 1.0, 0.0, -1, FREE
        if which == 1:
            return 0.0, 1.0, 1, CONTACT
    else:
        if which == 0:
            return 1.0, 0.0, -1, FREE
        if which == 1:
            return p[2], p[3], 1, CONTACT
    return 0.0, 0.0, 0, phase


@njit(cache=True, nogil=True, error_model="numpy")
def _watched(w, rate, p, spring, dash, a, b):  # type: ignore[no-untyped-def]
    """Return the functional and its time derivative at a state."""
    rates(w, rate, 1, p, spring, dash)
    value = a * (w[0, 2] - w[0, 0]) + b * (w[0, 3] - w[0, 1])
    return value, a * (w[0, 3] - w[0, 1]) + b * (rate[0, 3] - rate[0, 1])


@njit(cache=True, nogil=True, error_model="numpy")
def _root(w, p, spring, dash, fastest, a, b, lo, hi, of_slope, direction):  # type: ignore[no-untyped-def]
    """Return the time in [lo, hi] after ``w`` at which the functional (or its slope) crosses zero.

    Newton's method inside a bracket that each trial tightens; to the last bit of the time within about five trials.
    A bracket that was entered a rounding beyond the crossing closes on its beginning.
    """
    probe = np.empty((COLUMNS + 1, 4))
    rate = np.empty((COLUMNS + 1, 4))
    at = 0.5 * (lo + hi)
    for _ in range(90):
        for i in range(4):
            probe[0, i] = w[0, i]
        advance(probe, 1, p, spring, dash, fastest, at)
        value, slope = _watched(probe, rate, p, spring, dash, a, b)
        if of_slope:
            if value * direction >= 0.0:  # already across: the crossing lies before the extremum
                return at
            if slope * direction > 0.0:
                lo = at
            else:
                hi = at
            new = 0.5 * (lo + hi)
        else:
            if value * direction < 0.0:
                lo = at
            else:
                hi = at
            new = at - value / slope
            if not (lo < new < hi):
                new = 0.5 * (lo + hi)
        if abs(new - at) <= 1e-17 + 2e-16 * abs(new):
            return new
        at = new
    return at


@njit(cache=True, nogil=True, error_model="numpy")
def _slope(w, p, spring, dash, a, b):  # type: ignore[no-untyped-def]
    """Return d/dt of a functional at a state; the long way of ``_watched`` is kept off the samples' loop."""
    xi_rate = w[0, 3] - w[0, 1]
    if b == 0.0:
        return a * xi_rate
    force = p[2] * spring * (w[0, 2] - w[0, 0]) + p[3] * dash * xi_rate
    return a * xi_rate - b * ((p[0] * w[0, 2] + force) / p[1] + force / p[7])


@njit(cache=True, nogil=True, error_model="numpy")
def _first_crossing(w, w_end, p, variant, phase, spring, dash, fastest, dt):  # type: ignore[no-untyped-def]
    """Return (time, functional index) of the first watched crossing between ``w`` and ``w_end``, or (dt, -1).

    A functional that grazes zero and returns within the step is found through the sign change of its slope.
    """
    best = dt
    found = -1
    for which in range(2):
        a, b, direction, _ = watch(phase, which, variant, p)
        if direction == 0:
            break
        end = a * (w_end[0, 2] - w_end[0, 0]) + b * (w_end[0, 3] - w_end[0, 1])
        if end * direction >= 0.0:
            at = _root(w, p, spring, dash, fastest, a, b, 0.0, dt, False, direction)
        else:
            if _slope(w, p, spring, dash, a, b) * direction <= 0.0:
                continue
            if _slope(w_end, p, spring, dash, a, b) * direction >= 0.0:
                continue
            top = _root(w, p, spring, dash, fastest, a, b, 0.0, dt, True, direction)
            probe = w[:1].copy()
            advance(probe, 1, p, spring, dash, fastest, top)
            if (a * (probe[0, 2] - probe[0, 0]) + b * (probe[0, 3] - probe[0, 1])) * direction < 0.0:
                continue
            at = _root(w, p, spring, dash, fastest, a, b, 0.0, top, False, direction)
        if found < 0 or at < best:
            best = at
            found = which
    return best, found


@njit(cache=True, nogil=True, error_model="numpy")
def _cross(w, p, phase, which, variant, rows, d_time):  # type: ignore[no-untyped-def]
    """Change phase at a crossing: write dt/dtheta to ``d_time``, let the derivatives jump, return the next phase."""
    a, b, _, after = watch(phase, which, variant, p)
    spring, dash, _ = phase_of(phase, p)
    before_rate = np.empty((COLUMNS + 1, 4))
    after_rate = np.empty((COLUMNS + 1, 4))
    _, slope = _watched(w, before_rate, p, spring, dash, a, b)
    spring, dash, _ = phase_of(after, p)
    rates(w, after_rate, 1, p, spring, dash)
    by_force = variant == 2 and ((phase == CONTACT) or (phase == OVERLAPPED and which == 1))
    for j in range(1, rows):
        d_value = a * (w[j, 2] - w[j, 0]) + b * (w[j, 3] - w[j, 1])
        if by_force and j == 3:
            d_value += w[0, 2] - w[0, 0]
        if by_force and j == 4:
            d_value += w[0, 3] - w[0, 1]
        d_time[j - 1] = -d_value / slope
        for i in range(4):
            w[j, i] += (before_rate[0, i] - after_rate[0, i]) * d_time[j - 1]
    return after


@njit(cache=True, nogil=True, error_model="numpy")
def _watchlist(phase, variant, p, out):  # type: ignore[no-untyped-def]
    for which in range(2):
        a, b, direction, _ = watch(phase, which, variant, p)
        if direction == 0:
            return which
        out[which, 0] = a
        out[which, 1] = b
        out[which, 2] = direction
    return 2


@njit(cache=True, nogil=True, error_model="numpy")
def _glide(times, i, t, h, w, e, watching, watched, p, spring, dash, states):  # type: ignore[no-untyped-def]
    """Propagate the bare state from sample to sample while the grid is even and nothing is crossed; (i, t) reached.

    The same arithmetic as ``step``, kept in registers: about 12 ns a sample.
    """
    k, g, k_p, per_plate, per_block = p[2] * spring, p[3] * dash, p[0], 1.0 / p[1], 1.0 / p[7]
    e00, e01, e02, e03 = e[0, 0], e[0, 1], e[0, 2], e[0, 3]
    e10, e11, e12, e13 = e[1, 0], e[1, 1], e[1, 2], e[1, 3]
    e20, e21, e22, e23 = e[2, 0], e[2, 1], e[2, 2], e[2, 3]
    e30, e31, e32, e33 = e[3, 0], e[3, 1], e[3, 2], e[3, 3]
    a0, b0, d0 = watching[0, 0], watching[0, 1], watching[0, 2]
    a1, b1, d1 = watching[1, 0], watching[1, 1], watching[1, 2]
    if watched < 2:
        a1, b1, d1 = 0.0, 0.0, 0.0
    bent = b0 != 0.0 or b1 != 0.0
    x, v, y, u = w[0, 0], w[0, 1], w[0, 2], w[0, 3]
    pull = k * (y - x) + g * (u - v)
    drift = -((k_p * y + pull) * per_plate + pull * per_block) if bent else 0.0
    n = times.size
    while i < n and abs(times[i] - t - h) < 2e-15:
        xn = e00 * x + e01 * v + e02 * y + e03 * u
        vn = e10 * x + e11 * v + e12 * y + e13 * u
        yn = e20 * x + e21 * v + e22 * y + e23 * u
        un = e30 * x + e31 * v + e32 * y + e33 * u
        xi, rate, before = yn - xn, un - vn, u - v
        drift_n = 0.0
        if bent:
            pull = k * xi + g * rate
            drift_n = -((k_p * yn + pull) * per_plate + pull * per_block)
        if (a0 * xi + b0 * rate) * d0 >= 0.0 or (
            (a0 * before + b0 * drift) * d0 > 0.0 and (a0 * rate + b0 * drift_n) * d0 < 0.0
        ):
            break
        if d1 != 0.0 and (
            (a1 * xi + b1 * rate) * d1 >= 0.0
            or ((a1 * before + b1 * drift) * d1 > 0.0 and (a1 * rate + b1 * drift_n) * d1 < 0.0)
        ):
            break
        x, v, y, u, drift = xn, vn, yn, un, drift_n
        states[i, 0], states[i, 1], states[i, 2], states[i, 3] = x, v, y, u
        t += h
        i += 1
    w[0, 0], w[0, 1], w[0, 2], w[0, 3] = x, v, y, u
    return i, t


@njit(cache=True, nogil=True, error_model="numpy")
def _copy(w, out, rows):  # type: ignore[no-untyped-def]
    for j in range(rows):
        for k in range(4):
            out[j, k] = w[j, k]


@njit(cache=True, nogil=True, error_model="numpy")
def solve(times, p, variant, rows, states, d_x, event_time, event_kind, event_state, event_d_time, event_d_state):  # type: ignore[no-untyped-def]
    """Propagate from first touch (t = 0) to every one of ``times`` (ascending; before 0: free flight).

    Writes the states, shape (n, 4), the derivatives of x_b, shape (n, 7), when ``rows`` is 8, and the changes of
    phase: time, 10 * before + after, state, dt/dtheta, d(state at that event)/dtheta.  Returns their number, or -1
    when more than MAX_EVENTS happen.  About 15 ns a sample without and 120 ns with derivatives, plus 20 us an event.
    """
    n = times.size
    k_p, m_p = p[0], p[1]
    omega = math.sqrt(k_p / m_p)
    i = 0
    while i < n and times[i] <= 0.0:
        t = times[i]
        states[i, 0] = p[5] + p[4] * t
        states[i, 1] = p[4]
        if rows > 1:
            for j in range(COLUMNS):
                d_x[i, j] = 0.0
            d_x[i, 4] = t
            d_x[i, 5] = 1.0
        i += 1
    _ring(times, 0, i, 0.0, omega, p[5], p[6], states)
    w = np.zeros((COLUMNS + 1, 4))
    w_end = np.zeros((COLUMNS + 1, 4))
    w[0, 0] = p[5]
    w[0, 1] = p[4]
    w[0, 2] = p[5]
    w[0, 3] = p[6]
    w[5, 1] = 1.0
    w[6, 0] = 1.0
    w[6, 2] = 1.0
    w[7, 3] = 1.0
    e = np.zeros((4, 4, 4))
    de = np.zeros((4, 4, 4, 4))
    e_step = np.full(4, -1.0)
    phase = CONTACT
    spring, dash, fastest = phase_of(phase, p)
    watching = np.zeros((2, 3))
    watched = _watchlist(phase, variant, p, watching)
    t = 0.0
    events = 1
    event_time[0] = 0.0
    event_kind[0] = 10 * FREE + CONTACT
    event_state[0] = w[0]
    for j in range(COLUMNS):
        event_d_time[0, j] = 0.0
        for k in range(4):
            event_d_state[0, j, k] = w[j + 1, k]
    gone = False
    rate = np.empty((COLUMNS + 1, 4))
    while i < n:
        if rows == 1 and not gone and e_step[phase] > 0.0:
            i, t = _glide(times, i, t, e_step[phase], w, e[phase], watching, watched, p, spring, dash, states)
            if i == n:
                break
        target = times[i]
        while t < target:
            if gone:
                break
            dt = target - t
            pieces = 1.0
            if dt * fastest > _STEP:
                pieces = math.ceil(dt * fastest / _STEP)
                dt = dt / pieces
            if abs(dt - e_step[phase]) > 2e-15:
                # A propagator pays only where its step comes again: on the samples' own grid.
                if i + 1 < n and abs((times[i + 1] - target) / pieces - dt) < 2e-15:
                    propagator(p, spring, dash, fastest, dt, e[phase], de[phase])
                    e_step[phase] = dt
                    step(w, w_end, rows, e[phase], de[phase])
                else:
                    _copy(w, w_end, rows)
                    advance(w_end, rows, p, spring, dash, fastest, dt)
            else:
                dt = e_step[phase]
                step(w, w_end, rows, e[phase], de[phase])
            which = -1
            at = dt
            for k in range(watched):
                a, b, direction = watching[k, 0], watching[k, 1], watching[k, 2]
                end = a * (w_end[0, 2] - w_end[0, 0]) + b * (w_end[0, 3] - w_end[0, 1])
                if end * direction >= 0.0 or (
                    _slope(w, p, spring, dash, a, b) * direction > 0.0
                    and _slope(w_end, p, spring, dash, a, b) * direction < 0.0
                ):
                    at, which = _first_crossing(w, w_end, p, variant, phase, spring, dash, fastest, dt)
                    break
            if which < 0:
                t += dt
                w, w_end = w_end, w
            else:
                if events >= MAX_EVENTS:
                    return -1
                advance(w, rows, p, spring, dash, fastest, at)
                t += at
                before = phase
                phase = _cross(w, p, phase, which, variant, rows, event_d_time[events])
                spring, dash, fastest = phase_of(phase, p)
                watched = _watchlist(phase, variant, p, watching)
                event_time[events] = t
                event_kind[events] = 10 * before + phase
                event_state[events] = w[0]
                rates(w, rate, 1, p, spring, dash)
                for j in range(rows - 1):
                    for k in range(4):
                        event_d_state[events, j, k] = w[j + 1, k] + rate[0, k] * event_d_time[events, j]
                events += 1
            if phase == FREE and w[0, 1] > 0.0:
                reach = math.inf
                if omega > 0.0:
                    reach = math.sqrt(w[0, 2] ** 2 + (w[0, 3] / omega) ** 2)
                elif w[0, 3] <= 0.0:
                    reach = w[0, 2]
                gone = w[0, 0] > reach
        if gone:
            break
        for k in range(4):
            states[i, k] = w[0, k]
        for j in range(rows - 1):
            d_x[i, j] = w[j + 1, 0]
        i += 1
    if i < n:  # gone for good: the block flies on, the plate rings on
        for j in range(i, n):
            dt = times[j] - t
            states[j, 0] = w[0, 0] + w[0, 1] * dt
            states[j, 1] = w[0, 1]
            for k in range(rows - 1):
                d_x[j, k] = w[k + 1, 0] + w[k + 1, 1] * dt
        _ring(times, i, n, t, omega, w[0, 2], w[0, 3], states)
    return events


@njit(cache=True, nogil=True, error_model="numpy")
def _ring(times, begin, end, t, omega, y, u, states):  # type: ignore[no-untyped-def]
    """Write the free plate at samples ``begin`` to ``end``; turned on from sample to sample where the grid is even."""
    step, turn_c, turn_s = -1.0, 1.0, 0.0
    cosine = sine = 0.0
    for i in range(begin, end):
        dt = times[i] - t
        if omega == 0.0:
            states[i, 2], states[i, 3] = y + u * dt, u
            continue
        if i > begin and abs(times[i] - times[i - 1] - step) < 1e-13 and (i - begin) % 256 != 0:
            cosine, sine = cosine * turn_c - sine * turn_s, sine * turn_c + cosine * turn_s
        else:
            cosine, sine = math.cos(omega * dt), math.sin(omega * dt)
            if i + 1 < end:
                step = times[i + 1] - times[i]
                turn_c, turn_s = math.cos(omega * step), math.sin(omega * step)
        states[i, 2] = y * cosine + u * sine / omega
        states[i, 3] = u * cosine - y * omega * sine
