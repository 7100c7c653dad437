"""When what is watched along a linear phase passes zero.

Rows of ``value`` and ``slope``, shape (m, n + 1), give what is watched and its rate at a state.
"""

from analysis.model.propagators import advance, along, step_alone
from analysis.model.rates import tight


@tight
def root(value, slope, item, sign, z, a, by, single, terms, low, high, probe, term, new):  # type: ignore[no-untyped-def]
    """Return when a watched quantity (``slope``: its rate) passes zero against ``sign`` between two times after ``z``.

    Newton's method in a bracket that each trial tightens.
    """
    at = 0.5 * (low + high)
    for _ in range(90):
        advance(z, single, a, by, at, terms, probe, term, new)
        here, rate = along(value, item, probe), along(slope, item, probe)
        if here * sign >= 0.0:
            low = at
        else:
            high = at
        there = at - here / rate
        if not low < there < high:
            there = 0.5 * (low + high)
        if abs(there - at) <= 1e-17 + 2e-16 * abs(there):
            return there
        at = there
    return at


@tight
def lowest(value, slope, item, sign, z, a, by, single, terms, high, probe, term, new):  # type: ignore[no-untyped-def]
    """Return when a watched quantity, falling at ``z`` and rising at ``high``, is lowest, or some time when it is past.

    Chords and halves in turn.
    """
    low, down, up = 0.0, along(slope, item, z) * sign, 0.0
    advance(z, single, a, by, high, terms, probe, term, new)
    up = along(slope, item, probe) * sign
    at = 0.0
    for trial in range(60):
        there = low - down * (high - low) / (up - down) if trial % 2 == 0 else 0.5 * (low + high)
        if abs(there - at) <= 1e-15 * abs(there):
            break
        at = there
        advance(z, single, a, by, at, terms, probe, term, new)
        if along(value, item, probe) * sign < 0.0:
            break
        rate = along(slope, item, probe) * sign
        if rate < 0.0:
            low, down = at, rate
        else:
            high, up = at, rate
    return at


@tight
def may_touch(value, slope, item, sign, z, z_end, h):  # type: ignore[no-untyped-def]
    """Return whether a watched quantity that turned within a step may have passed zero: twice as far as a parabola.

    The velocity, the last of them, is not asked: what it turns does little in a step.
    """
    if item > 2:
        return False
    down, up = along(slope, item, z) * sign * h, along(slope, item, z_end) * sign * h
    return down < 0.0 < up and along(value, item, z) * sign < down * down / (up - down)


@tight
def may_switch(value, slope, expected, z, e, h, times, near, further):  # type: ignore[no-untyped-def]
    """Return whether anything watched may pass zero within some steps of ``h``, whose propagator is ``e``."""
    for c in range(z.shape[0]):
        near[c, 0] = further[c, 0] = z[c, 0]
    for _ in range(times):
        step_alone(near, e, further)
        for item in range(slope.shape[0]):
            sign = expected[item]
            if sign != 0.0:
                if along(value, item, further) * sign < 0.0:
                    return True
                if may_touch(value, slope, item, sign, near, further, h):
                    return True
        for c in range(z.shape[0] - 1):
            near[c, 0] = further[c, 0]
    return False
