"""Step two bodies without hidden states by samples or by means, with the propagator in registers (kernels)."""

from analysis.collision.solver.matrices import STEP_S
from analysis.collision.solver.modes import OVERLAP, VELOCITY, may_have_left_for_good
from analysis.compiled import inlined, part


@inlined
def _along(g, sign):  # type: ignore[no-untyped-def]
    """Return the coefficients of a row times ``sign``, with that of the constant last."""
    return sign * g[0], sign * g[1], sign * g[2], sign * g[3], sign * g[4]


@part
def step_two_bodies(z, form, motion, active, record, ahead, t):  # type: ignore[no-untyped-def]
    """Step block and plate, in blocks if means are recorded, while the grid is even and no guard may pass zero.

    At most two guard functions are monitored; two zeros within a block are detected only by the sign of the rate.
    Returns (next sample, time reached); ``z`` is the state, shape (5, 1).  Uses the arithmetic of
    ``step_without_derivatives``; takes about 10 ns per sample, 30 ns per mean.
    """
    block, bit, states, times, signs = record.block, form.steps[STEP_S], record.states, record.times, motion.signs
    h, e, mean = block * bit, form.whole if block > 1 else form.e, form.mean
    e00, e01, e02, e03, e04 = _along(e[0], 1.0)
    e10, e11, e12, e13, e14 = _along(e[1], 1.0)
    e20, e21, e22, e23, e24 = _along(e[2], 1.0)
    e30, e31, e32, e33, e34 = _along(e[3], 1.0)
    watched, one = active[0], active[1] if active[0] > 0 else OVERLAP
    two = active[2] if watched > 1 else one
    a0, a1, a2, a3, a4 = _along(form.guard[one], signs[one])
    b0, b1, b2, b3, b4 = _along(form.guard[two], signs[two])
    # two zeros of the velocity within one step are ignored, because their effect is negligible
    r0, r1, r2, r3, r4 = _along(form.guard_rate[one], 0.0 if one == VELOCITY else signs[one] * h)
    s0, s1, s2, s3, s4 = _along(form.guard_rate[two], 0.0 if two == VELOCITY else signs[two] * h)
    x, v, y, u = z[0, 0], z[1, 0], z[2, 0], z[3, 0]
    falls = r0 * x + r1 * v + r2 * y + r3 * u + r4 < 0.0
    sinks = s0 * x + s1 * v + s2 * y + s3 * u + s4 < 0.0
    i, way = ahead.i, 1 if ahead.forward else -1
    first, end = (0, ahead.last - block + 1) if ahead.forward else (block - 1, 0)
    parts = ahead.forward and may_have_left_for_good(1.0, 0.0, motion.mode)
    whole = i % block == first
    while whole and (i <= end if ahead.forward else i >= end) and abs(times[i] - t - bit) < 2e-15:
        if parts and may_have_left_for_good(x, y, motion.mode):
            break
        xn = e00 * x + e01 * v + e02 * y + e03 * u + e04
        vn = e10 * x + e11 * v + e12 * y + e13 * u + e14
        yn = e20 * x + e21 * v + e22 * y + e23 * u + e24
        un = e30 * x + e31 * v + e32 * y + e33 * u + e34
        if watched > 0:
            fell = falls
            falls = r0 * xn + r1 * vn + r2 * yn + r3 * un + r4 < 0.0
            if a0 * xn + a1 * vn + a2 * yn + a3 * un + a4 < 0.0 or (fell and not falls):
                break
            if watched > 1:
                sank = sinks
                sinks = s0 * xn + s1 * vn + s2 * yn + s3 * un + s4 < 0.0
                if b0 * xn + b1 * vn + b2 * yn + b3 * un + b4 < 0.0 or (sank and not sinks):
                    break
        if block == 1:
            states[i, 0], states[i, 1], states[i, 2], states[i, 3], states[i, 4] = xn, vn, yn, un, yn
        else:
            row = states[i // block]
            for j in range(row.size):
                row[j] = mean[j, 0] * x + mean[j, 1] * v + mean[j, 2] * y + mean[j, 3] * u + mean[j, 4]
        x, v, y, u = xn, vn, yn, un
        t += h
        i += way * block
    z[0, 0], z[1, 0], z[2, 0], z[3, 0] = x, v, y, u
    return i, t
