"""The two bodies alone, from sample to sample: their propagator kept in registers (njit)."""

from analysis.model.guards import VELOCITY
from analysis.model.matrices import BIT
from analysis.model.modes import may_be_gone
from analysis.model.system import tight


@tight
def glide(z, form, motion, active, record, ahead, t):  # type: ignore[no-untyped-def]
    """Follow block and plate while the grid is even and no guard function (at most two) comes near zero.

    Returns (next sample, time reached); ``z`` is the state, shape (5, 1).  The same arithmetic as ``step_alone``, about
    15 ns a sample.
    """
    e, h, states, times = form.e, form.steps[BIT], record.states, record.times
    e00, e01, e02, e03, e04 = e[0, 0], e[0, 1], e[0, 2], e[0, 3], e[0, 4]
    e10, e11, e12, e13, e14 = e[1, 0], e[1, 1], e[1, 2], e[1, 3], e[1, 4]
    e20, e21, e22, e23, e24 = e[2, 0], e[2, 1], e[2, 2], e[2, 3], e[2, 4]
    e30, e31, e32, e33, e34 = e[3, 0], e[3, 1], e[3, 2], e[3, 3], e[3, 4]
    a0 = a1 = a2 = a3 = a4 = r0 = r1 = r2 = r3 = r4 = 0.0
    b0 = b1 = b2 = b3 = b4 = s0 = s1 = s2 = s3 = s4 = 0.0
    if active[0] > 0:
        item, sign = active[1], motion.signs[active[1]]
        g = form.guard[item]
        a0, a1, a2, a3, a4 = sign * g[0], sign * g[1], sign * g[2], sign * g[3], sign * g[4]
        if item != VELOCITY:
            g, sign = form.guard_rate[item], sign * h
            r0, r1, r2, r3, r4 = sign * g[0], sign * g[1], sign * g[2], sign * g[3], sign * g[4]
    if active[0] > 1:
        item, sign = active[2], motion.signs[active[2]]
        g = form.guard[item]
        b0, b1, b2, b3, b4 = sign * g[0], sign * g[1], sign * g[2], sign * g[3], sign * g[4]
        if item != VELOCITY:
            g, sign = form.guard_rate[item], sign * h
            s0, s1, s2, s3, s4 = sign * g[0], sign * g[1], sign * g[2], sign * g[3], sign * g[4]
    x, v, y, u = z[0, 0], z[1, 0], z[2, 0], z[3, 0]
    falls = r0 * x + r1 * v + r2 * y + r3 * u + r4 < 0.0
    sinks = s0 * x + s1 * v + s2 * y + s3 * u + s4 < 0.0
    i, way = ahead.i, 1 if ahead.forward else -1
    while 0 <= i < times.size and abs(times[i] - t - h) < 2e-15:
        xn = e00 * x + e01 * v + e02 * y + e03 * u + e04
        vn = e10 * x + e11 * v + e12 * y + e13 * u + e14
        yn = e20 * x + e21 * v + e22 * y + e23 * u + e24
        un = e30 * x + e31 * v + e32 * y + e33 * u + e34
        fell, sank = falls, sinks
        falls = r0 * xn + r1 * vn + r2 * yn + r3 * un + r4 < 0.0
        sinks = s0 * xn + s1 * vn + s2 * yn + s3 * un + s4 < 0.0
        if a0 * xn + a1 * vn + a2 * yn + a3 * un + a4 < 0.0 or (fell and not falls):
            break
        if b0 * xn + b1 * vn + b2 * yn + b3 * un + b4 < 0.0 or (sank and not sinks):
            break
        if ahead.forward and may_be_gone(x, y, motion.mode):
            break
        x, v, y, u = xn, vn, yn, un
        states[i, 0], states[i, 1], states[i, 2], states[i, 3], states[i, 4] = x, v, y, u, y
        t += h
        i += way
    z[0, 0], z[1, 0], z[2, 0], z[3, 0] = x, v, y, u
    return i, t
