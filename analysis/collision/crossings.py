"""When does a guard function pass zero first in a step of any stepper?  (njit)

``reach`` is the stepper's: it writes the state some time after the beginning of the step to ``there``.
"""

from analysis.collision.guards import VELOCITY, guard, guard_rate, may_touch
from analysis.collision.rates import rates
from analysis.compiled.kernel_parts import part


@part
def _root(reach, stepper, system, motion, item, low, high):  # type: ignore[no-untyped-def]
    """Return when a guard function passes zero between two times after ``here``, which it does.

    Newton's method in a bracket that each trial tightens; to the last bit of the time.
    """
    one = item - item + 1
    sign = motion.signs[item]
    at = 0.5 * (low + high)
    for _ in range(90):
        reach(stepper, system, motion, at, one)
        value, rate = guard(item, motion.there, system), guard_rate(item, motion.there, system)
        if value * sign >= 0.0:
            low = at
        else:
            high = at
        new = at - value / rate
        if not low < new < high:
            new = 0.5 * (low + high)
        if abs(new - at) <= 1e-17 + 2e-16 * abs(new):
            return new
        at = new
    return at


@part
def _lowest(reach, stepper, system, motion, item, h, up):  # type: ignore[no-untyped-def]
    """Return when a guard function, falling at ``here`` and rising by ``up`` after ``h``, is lowest.

    Or some time when it is past zero.  Chords and halves in turn.
    """
    one = item - item + 1
    sign = motion.signs[item]
    low, high, down, at = 0.0, h, guard_rate(item, motion.here, system) * sign, 0.0
    for trial in range(60):
        new = low - down * (high - low) / (up - down) if trial % 2 == 0 else 0.5 * (low + high)
        if abs(new - at) <= 1e-15 * abs(new):
            break
        at = new
        reach(stepper, system, motion, at, one)
        if guard(item, motion.there, system) * sign < 0.0:
            break
        rate = guard_rate(item, motion.there, system) * sign
        if rate < 0.0:
            low, down = at, rate
        else:
            high, up = at, rate
    return at


@part
def first_crossing(reach, stepper, system, motion, h):  # type: ignore[no-untyped-def]
    """Return (guard function, time) of the first to pass zero in a step; -1 where none does.

    The velocity is not asked whether it turned and turned back: what it turns does little in a step.
    """
    signs, ends = motion.signs, motion.ends
    first, found = h, -1
    one = found - found + 1  # of the type of other numbers of rows, so that one compiled kernel serves
    rates(motion.here, one, system.which, system, motion.mode)
    reach(stepper, system, motion, h, one)
    for item in range(signs.size):
        if signs[item] != 0.0:
            ends[item, 0] = guard(item, motion.there, system) * signs[item]
            ends[item, 1] = guard_rate(item, motion.there, system) * signs[item]
    for item in range(signs.size):
        sign = signs[item]
        if sign == 0.0:
            continue
        when = h
        if not ends[item, 0] < 0.0:
            value, rate = guard(item, motion.here, system) * sign, guard_rate(item, motion.here, system) * sign
            if item >= VELOCITY or not may_touch(value, rate, ends[item, 1], h):
                continue
            when = _lowest(reach, stepper, system, motion, item, h, ends[item, 1])
            reach(stepper, system, motion, when, one)
            if not guard(item, motion.there, system) * sign < 0.0:
                continue
        when = _root(reach, stepper, system, motion, item, 0.0, when)
        if found < 0 or when < first:
            found, first = item, when
    return found, first
