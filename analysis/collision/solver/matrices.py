"""The matrices of a linear mode and their derivatives (kernels).

The state is augmented by a constant 1 for the constant forces: s' = A s.  The columns of ``z``, shape (n + 1, rows),
are the state and its derivatives with respect to the parameters, S' = A S + (dA/dtheta) s.
"""

from typing import NamedTuple

from analysis.collision.parameters import Floats
from analysis.collision.solver.modes import OVERLAP, PLATE, RANGE_0, VELOCITY, range_at
from analysis.collision.solver.rates import rates
from analysis.collision.solver.system import RANGE_AT
from analysis.compiled import cut, inlined, part

_SAME = 1e-11  # relative tolerance within which test states must give the same A
# Indices into ``steps``: length in s, number per sample, terms of the series, 1 if no oscillation is fast in a block.
STEP_S, STEPS_PER_SAMPLE, TERMS, SLOW = 0, 1, 2, 3


class ModeMatrices(NamedTuple):
    """The matrices of a mode: A, shape (n + 1, n + 1), its derivatives, and guard functions and their rates as rows.

    Then exp(A h) of a step and its derivatives, those of a block of steps, the output matrix, shape (m, n + 1), and
    that of the mean over a block; ``steps`` has the indices above.  Derivatives have shape (n + 1, n + 1, rows).
    Those of several modes are stored along a first axis in addition.
    """

    a: Floats
    by: Floats
    guard: Floats
    guard_rate: Floats
    e: Floats
    d: Floats
    whole: Floats
    d_whole: Floats
    shown: Floats
    mean: Floats
    d_mean: Floats
    steps: Floats


class Room(NamedTuple):
    """Work arrays: three with all columns, two with one column, three square ones, and two of derivatives."""

    columns: Floats
    single: Floats
    square: Floats
    d_term: Floats
    d_work: Floats


@inlined
def columns(rows):  # type: ignore[no-untyped-def]
    """Return the number of columns of a state with derivatives: a multiple of four; 1 without derivatives."""
    return 4 * ((rows + 3) // 4) if rows > 1 else 1


@part
def forms_of(modes, n, count, guards, shown, room, at):  # type: ignore[no-untyped-def]
    """Return the forms of ``modes`` modes, cut from ``room``, and the position after them."""
    m, wide = n + 1, columns(count + 1)
    a, at = cut(room, at, (modes, m, m))
    by, at = cut(room, at, (modes, m, m, wide))
    guard, at = cut(room, at, (modes, guards, m))
    guard_rate, at = cut(room, at, (modes, guards, m))
    e, at = cut(room, at, (modes, m, m))
    d, at = cut(room, at, (modes, m, m, wide))
    whole, at = cut(room, at, (modes, m, m))
    d_whole, at = cut(room, at, (modes, m, m, wide))
    what, at = cut(room, at, (modes, shown, m))
    mean, at = cut(room, at, (modes, shown, m))
    d_mean, at = cut(room, at, (modes, m, wide))
    steps, at = cut(room, at, (modes, 4))
    return ModeMatrices(a, by, guard, guard_rate, e, d, whole, d_whole, what, mean, d_mean, steps), at


@part
def room_of(n, count, room, at):  # type: ignore[no-untyped-def]
    """Return the work arrays, cut from ``room``, and the position after them."""
    m, wide = n + 1, columns(count + 1)
    some, at = cut(room, at, (3, m, wide))
    single, at = cut(room, at, (2, m, 1))
    square, at = cut(room, at, (3, m, m))
    d_term, at = cut(room, at, (m, m, wide))
    d_work, at = cut(room, at, (m, m, wide))
    return Room(some, single, square, d_term, d_work), at


@inlined
def form_at(stored, at):  # type: ignore[no-untyped-def]
    """Return one of the stored forms."""
    return ModeMatrices(
        stored.a[at], stored.by[at], stored.guard[at], stored.guard_rate[at], stored.e[at], stored.d[at],
        stored.whole[at], stored.d_whole[at], stored.shown[at], stored.mean[at], stored.d_mean[at], stored.steps[at],
    )  # fmt: skip


@part
def linearise(form, plain, every, system, mode):  # type: ignore[no-untyped-def]
    """Write A, its derivatives and the guard functions of a mode; return False if the mode is not linear.

    ``every`` holds n times -1 (no parameter), then the parameters; ``plain`` is a state with as many derivatives.
    Takes up to n + 3 evaluations of the rates.
    """
    a, by, z, f = form.a, form.by, plain.z, plain.f
    n = a.shape[0] - 1
    count = every.size - n
    total = n + 1 + count
    for j in range(total):
        for c in range(n):
            z[j, c] = 1.0 if c == j - 1 else 0.0
    rates(plain, total, every, system, mode)
    for j in range(n + 1):
        row = (j + 1) % (n + 1)  # row 0, the state itself, comes last: the constant forces
        for i in range(n):
            a[i, j] = f[row, i]
        a[n, j] = 0.0
        for i in range(3):
            form.guard[i, j] = plain.contact[row, i]
    for k in range(count):
        for i in range(n):
            by[i, n, 1 + k] = f[1 + n + k, i]
        for j in range(n + 1):
            by[n, j, 1 + k] = 0.0
    for j in range(n if count > 0 else 0):
        z[0, j] = 1.0
        rates(plain, total, every, system, mode)
        for k in range(count):
            for i in range(n):
                by[i, j, 1 + k] = f[1 + n + k, i] - by[i, n, 1 + k]
        z[0, j] = 0.0
    for trial in range(2 if system.slots.shape[0] > 0 else 0):  # the two bodies alone are linear
        side = 1.0 if trial == 0 else -1.5  # bodies overlapping, then apart
        for j in range(n):
            z[0, j] = side * (1e-4 * (3 + j) if j % 2 == 0 else 0.1 * (j - 4))
        rates(plain, total, every, system, mode)
        for i in range(n):
            for j in range(n):
                if not abs(f[1 + j, i] - a[i, j]) <= _SAME * abs(a[i, j]):
                    return False
            for k in range(-1, count):
                total_of, size = (a[i, n], abs(a[i, n])) if k < 0 else (by[i, n, 1 + k], abs(by[i, n, 1 + k]))
                for j in range(n):
                    term = (a[i, j] if k < 0 else by[i, j, 1 + k]) * z[0, j]
                    total_of += term
                    size += abs(term)
                if not abs((f[0, i] if k < 0 else f[1 + n + k, i]) - total_of) <= _SAME * size:
                    return False
    if mode[PLATE] == 0.0:  # the plate oscillates freely
        a[2, 3], a[3, 2] = 1.0, -system.p[0] / system.p[1]
    _guards(form, system)
    return True


@part
def _guards(form, system):  # type: ignore[no-untyped-def]
    """Write the guard functions of velocity and ranges, and the rates of all."""
    guard, n = form.guard, form.a.shape[0] - 1
    for c in range(n + 1):
        guard[VELOCITY, c] = 1.0 if c == 1 else 0.0
        for slot in range(system.slots.shape[0]):
            guard[RANGE_0 + slot, c] = guard[OVERLAP, c]
            if c == n and system.slots[slot, RANGE_AT] >= 0.0:
                guard[RANGE_0 + slot, c] += system.p[range_at(slot, system.slots)]
    for item in range(guard.shape[0]):
        for c in range(n + 1):
            form.guard_rate[item, c] = 0.0
            for j in range(n):
                form.guard_rate[item, c] += guard[item, j] * form.a[j, c]
