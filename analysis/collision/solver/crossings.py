"""Find the first zero of a guard function within a step, for any stepper (kernels).

``step_to`` is a function of the stepper: it writes the state at a given time after the start of the step to ``there``.
"""

from analysis.collision.solver.modes import VELOCITY, guard, guard_rate, may_touch
from analysis.collision.solver.rates import rates
from analysis.compiled import part


@part
def _root(step_to, stepper, system, motion, item, low, high):  # type: ignore[no-untyped-def]
    """Return the time after ``here``, between ``low`` and ``high``, at which a guard function passes zero.

    Newton's method within a bracket, converged to the last bit of the time.
    """
    one = motion.nothing.size
    sign = motion.signs[item]
    at = 0.5 * (low + high)
    for _ in range(90):
        step_to(stepper, system, motion, at, one)
        value, rate = guard(item, motion.there, system), guard_rate(item, motion.there, system)
        if value * sign >= 0.0:
            low = at
        else:
            high = at
        new = at - value / rate
        settled = 1e-17 + 2e-16 * at
        if not low < new < high and not abs(new - at) <= settled:  # an exact zero is an end of the bracket
            new = 0.5 * (low + high)
        if abs(new - at) <= settled:
            return new
        at = new
    return at


@part
def _lowest(step_to, stepper, system, motion, item, h, up):  # type: ignore[no-untyped-def]
    """Return the time of the minimum of a guard function that falls at ``here`` and rises at rate ``up`` after ``h``.

    Stops early at any time at which the function is negative.  Secant steps and bisections alternate.
    """
    one = motion.nothing.size
    sign = motion.signs[item]
    low, high, down, at = 0.0, h, guard_rate(item, motion.here, system) * sign, 0.0
    for trial in range(60):
        new = low - down * (high - low) / (up - down) if trial % 2 == 0 else 0.5 * (low + high)
        if abs(new - at) <= 1e-15 * abs(new):
            break
        at = new
        step_to(stepper, system, motion, at, one)
        if guard(item, motion.there, system) * sign < 0.0:
            break
        rate = guard_rate(item, motion.there, system) * sign
        if rate < 0.0:
            low, down = at, rate
        else:
            high, up = at, rate
    return at


@part
def first_crossing(step_to, stepper, system, motion, h):  # type: ignore[no-untyped-def]
    """Return (guard function, time) of the first zero within a step; the guard function is -1 if there is none.

    Two zeros of the velocity within one step are ignored, because their effect is negligible.
    """
    signs, ends = motion.signs, motion.ends
    first, found = h, -1
    one = motion.nothing.size
    rates(motion.here, one, system.which, system, motion.mode)
    step_to(stepper, system, motion, h, one)
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
            if item == VELOCITY or not may_touch(value, rate, ends[item, 1], h):
                continue
            when = _lowest(step_to, stepper, system, motion, item, h, ends[item, 1])
            step_to(stepper, system, motion, when, one)
            if not guard(item, motion.there, system) * sign < 0.0:
                continue
        when = _root(step_to, stepper, system, motion, item, 0.0, when)
        if found < 0 or when < first:
            found, first = item, when
    return found, first
