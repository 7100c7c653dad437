"""Propagators of a linear mode and of its derivatives (njit).

The state is augmented by a constant 1, which carries what drives it: s' = A s.  Columns of ``z``, shape (n + 1, rows),
are the state and its derivatives by the parameters, S' = A S + (dA/dtheta) s.
"""

from typing import NamedTuple

from analysis.kernel_parts import inlined, part
from analysis.kernel_room import cut
from analysis.model.guards import OVERLAP, RANGE_0, VELOCITY, range_at
from analysis.model.modes import PLATE
from analysis.model.rates import rates
from analysis.model.system import RANGE_AT, Floats

_SAME = 1e-11  # of the terms, where two states must agree on A
_MOST_TERMS = 60
BIT, PIECES, TERMS, SLOW = 0, 1, 2, 3  # of ``steps``: length in s, how many a sample, terms of the series, nothing fast


class Form(NamedTuple):
    """A mode's matrices: A, shape (n + 1, n + 1), its derivatives, and the guard functions and their rates as rows.

    Then exp(A h) of a step and its derivatives, shape (n + 1, n + 1, rows), those of a block of steps, what is shown of
    a state, shape (m, n + 1), and of the mean over a block; ``steps`` under the indices above.
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


class Kept(NamedTuple):
    """The forms of some modes, of which the first axis is one: (A, exp(A h), that of a block), ``by``, (d of the two).

    (Guard functions, their rates), (what is shown, its mean), the mean's derivatives, ``steps``.
    """

    square: Floats
    by: Floats
    d: Floats
    guard: Floats
    shown: Floats
    d_mean: Floats
    steps: Floats


class Room(NamedTuple):
    """Where matrices are worked out: three of columns, two of one column, three square ones, and derivatives."""

    columns: Floats
    single: Floats
    square: Floats
    d_term: Floats
    d_work: Floats


@inlined
def columns(rows):  # type: ignore[no-untyped-def]
    """Return how many columns a state with derivatives takes: a multiple of four, or one alone."""
    return 4 * ((rows + 3) // 4) if rows > 1 else 1


@part
def forms_of(modes, n, count, guards, shown, room, at):  # type: ignore[no-untyped-def]
    """Return the forms of so many modes, cut from ``room``, and where that goes on."""
    m, wide = n + 1, columns(count + 1)
    square, at = cut(room, at, (modes, 3, m, m))
    by, at = cut(room, at, (modes, count, m, m))
    d, at = cut(room, at, (modes, 2, m, m, wide))
    guard, at = cut(room, at, (modes, 2, guards, m))
    what, at = cut(room, at, (modes, 2, shown, m))
    d_mean, at = cut(room, at, (modes, m, wide))
    steps, at = cut(room, at, (modes, 4))
    return Kept(square, by, d, guard, what, d_mean, steps), at


@part
def room_of(n, count, room, at):  # type: ignore[no-untyped-def]
    """Return where matrices are worked out, cut from ``room``, and where that goes on."""
    m, wide = n + 1, columns(count + 1)
    some, at = cut(room, at, (3, m, wide))
    single, at = cut(room, at, (2, m, 1))
    square, at = cut(room, at, (3, m, m))
    d_term, at = cut(room, at, (count, m, m))
    d_work, at = cut(room, at, (m, m, wide))
    return Room(some, single, square, d_term, d_work), at


@inlined
def form_at(kept, at):  # type: ignore[no-untyped-def]
    """Return one of the forms that are kept."""
    square, d, guard, shown = kept.square[at], kept.d[at], kept.guard[at], kept.shown[at]
    return Form(
        square[0], kept.by[at], guard[0], guard[1], square[1], d[0], square[2], d[1], shown[0], shown[1],
        kept.d_mean[at], kept.steps[at],
    )  # fmt: skip


@part
def ask(form, plain, every, system, mode):  # type: ignore[no-untyped-def]
    """Write A, its derivatives and the guard functions of a mode; False if there is no A.

    ``every`` holds n times "by none", then the parameters; ``plain`` has room for a state with so many derivatives.
    Up to n + 3 evaluations of the rates.
    """
    a, by, z, f = form.a, form.by, plain.z, plain.f
    n, count = a.shape[0] - 1, by.shape[0]
    total = n + 1 + count
    for j in range(total):
        for c in range(n):
            z[j, c] = 1.0 if c == j - 1 else 0.0
    rates(plain, total, every, system, mode)
    for j in range(n + 1):
        row = (j + 1) % (n + 1)  # the state's own last: what drives it
        for i in range(n):
            a[i, j] = f[row, i]
        a[n, j] = 0.0
        for i in range(3):
            form.guard[i, j] = plain.told[row, i]
    for k in range(count):
        for i in range(n):
            by[k, i, n] = f[1 + n + k, i]
        for j in range(n + 1):
            by[k, n, j] = 0.0
    for j in range(n if count > 0 else 0):
        z[0, j] = 1.0
        rates(plain, total, every, system, mode)
        for k in range(count):
            for i in range(n):
                by[k, i, j] = f[1 + n + k, i] - by[k, i, n]
        z[0, j] = 0.0
    for trial in range(2 if system.slots.shape[0] > 0 else 0):  # the two bodies alone are linear
        side = 1.0 if trial == 0 else -1.5  # overlapping, and apart
        for j in range(n):
            z[0, j] = side * (1e-4 * (3 + j) if j % 2 == 0 else 0.1 * (j - 4))
        rates(plain, total, every, system, mode)
        for i in range(n):
            for j in range(n):
                if not abs(f[1 + j, i] - a[i, j]) <= _SAME * abs(a[i, j]):
                    return False
            for k in range(-1, count):
                total_of, size = (a[i, n], abs(a[i, n])) if k < 0 else (by[k, i, n], abs(by[k, i, n]))
                for j in range(n):
                    term = (a[i, j] if k < 0 else by[k, i, j]) * z[0, j]
                    total_of += term
                    size += abs(term)
                if not abs((f[0, i] if k < 0 else f[1 + n + k, i]) - total_of) <= _SAME * size:
                    return False
    if mode[PLATE] < 0.5:  # left to itself, or not yet met: it rings freely
        a[2, 3], a[3, 2] = 1.0, -system.p[0] / system.p[1]
    _guards(form, system)
    return True


@part
def _guards(form, system):  # type: ignore[no-untyped-def]
    """Write the guard functions that are not told, and the rates of all."""
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


@part
def exponential(form, room, rows, h):  # type: ignore[no-untyped-def]
    """Write exp(A h) and its derivatives, and return how many terms that took.

    About 1 us, and 4 us for each parameter that A knows.
    """
    a, by, e, d = form.a, form.by, form.e, form.d
    term, new, d_term, d_new = room.square[0], room.square[1], room.d_term, room.square[2]
    n = a.shape[0]
    for i in range(n):
        for j in range(n):
            e[i, j] = term[i, j] = 1.0 if i == j else 0.0
            for k in range(d.shape[2]):
                d[i, j, k] = 0.0
            for k in range(rows - 1):
                d_term[k, i, j] = 0.0
    terms = 0
    for m in range(1, _MOST_TERMS):
        scale = h / m
        for k in range(rows - 1):
            some = False
            for i in range(n):
                for c in range(n):
                    some = some or by[k, i, c] != 0.0
            if not some:
                continue
            for i in range(n):
                for j in range(n):
                    d_new[i, j] = 0.0
                for c in range(n):
                    one, two = a[i, c], by[k, i, c]
                    if one != 0.0:
                        for j in range(n):
                            d_new[i, j] += one * d_term[k, c, j]
                    if two != 0.0:
                        for j in range(n):
                            d_new[i, j] += two * term[c, j]
            for i in range(n):
                for j in range(n):
                    d_term[k, i, j] = scale * d_new[i, j]
                    d[i, j, 1 + k] += d_term[k, i, j]
        still = True
        for i in range(n):
            for j in range(n):
                total = 0.0
                for c in range(n):
                    total += a[i, c] * term[c, j]
                new[i, j] = scale * total
        for i in range(n):
            for j in range(n):
                term[i, j] = new[i, j]
                e[i, j] += new[i, j]
                still = still and abs(new[i, j]) <= 1e-18 * abs(e[i, j])
        terms = m
        if still and m > 3:
            break
    return terms + 2


@part
def along(functional, item, z):  # type: ignore[no-untyped-def]
    """Return one row of ``functional`` on the state."""
    total = 0.0
    for c in range(z.shape[0]):
        total += functional[item, c] * z[c, 0]
    return total


@part
def step(z, e, d, out):  # type: ignore[no-untyped-def]
    """Write state and derivatives a step ahead, four at a time, which the processor does at once."""
    n = e.shape[0]
    for i in range(n - 1):
        for k in range(0, z.shape[1], 4):
            t0 = t1 = t2 = t3 = 0.0
            for c in range(n):
                by, state = e[i, c], z[c, 0]
                t0 += by * z[c, k] + state * d[i, c, k]
                t1 += by * z[c, k + 1] + state * d[i, c, k + 1]
                t2 += by * z[c, k + 2] + state * d[i, c, k + 2]
                t3 += by * z[c, k + 3] + state * d[i, c, k + 3]
            out[i, k], out[i, k + 1], out[i, k + 2], out[i, k + 3] = t0, t1, t2, t3


@part
def step_alone(z, e, out):  # type: ignore[no-untyped-def]
    """Write the state a step ahead."""
    for i in range(e.shape[0] - 1):
        out[i, 0] = along(e, i, z)


@part
def repeat(form, room, rows, times):  # type: ignore[no-untyped-def]
    """Write ``times`` steps as one, and what is shown of the mean after each; derivatives of the first shown."""
    e, d, e_all, d_all, e_work, d_work = form.e, form.d, form.whole, form.d_whole, room.square[0], room.d_work
    n = e.shape[0]
    share = 1.0 / times
    for i in range(n):
        for j in range(n):
            e_all[i, j] = e[i, j]
            for k in range(d.shape[2]):
                d_all[i, j, k] = d[i, j, k]
    for trial in range(times):
        if trial > 0:
            for i in range(n):
                for j in range(n):
                    total = 0.0
                    for c in range(n):
                        total += e[i, c] * e_all[c, j]
                    e_work[i, j] = total
                    if rows > 1:
                        for k in range(d.shape[2]):
                            d_work[i, j, k] = 0.0
                        for c in range(n):
                            one, two = e[i, c], e_all[c, j]
                            for k in range(d.shape[2]):
                                d_work[i, j, k] += one * d_all[c, j, k] + two * d[i, c, k]
            for i in range(n):
                for j in range(n):
                    e_all[i, j] = e_work[i, j]
                    if rows > 1:
                        for k in range(d.shape[2]):
                            d_all[i, j, k] = d_work[i, j, k]
        for j in range(n):
            for i in range(form.shown.shape[0]):
                so_far = 0.0 if trial == 0 else form.mean[i, j]
                for c in range(n):
                    so_far += share * form.shown[i, c] * e_all[c, j]
                form.mean[i, j] = so_far
            for k in range(d.shape[2]):
                form.d_mean[j, k] = (0.0 if trial == 0 else form.d_mean[j, k]) + share * d_all[0, j, k]


@part
def show_mean(z, rows, form, states, d_x):  # type: ignore[no-untyped-def]
    """Add the mean of what is shown over a block ahead, and of the derivatives of the block's position, to rows."""
    n = z.shape[0]
    for i in range(states.size):
        states[i] += along(form.mean, i, z)
    for k in range(1, rows):
        total = 0.0
        for c in range(n):
            total += form.mean[0, c] * z[c, k] + form.d_mean[c, k] * z[c, 0]
        d_x[k - 1] += total


@part
def series(z, rows, form, h, out, room):  # type: ignore[no-untyped-def]
    """Write the first ``rows`` columns after a time of any length, by their Taylor series."""
    a, by, term, new = form.a, form.by, room.columns[0], room.columns[1]
    n = a.shape[0]
    for i in range(n):
        for k in range(rows):
            out[i, k] = term[i, k] = z[i, k]
    for m in range(1, int(form.steps[TERMS]) + 1):
        scale = h / m
        for i in range(n - 1):
            for k in range(rows):
                new[i, k] = 0.0
            for c in range(n):
                if a[i, c] != 0.0:
                    for k in range(rows):
                        new[i, k] += a[i, c] * term[c, k]
                for k in range(1, rows):
                    new[i, k] += by[k - 1, i, c] * term[c, 0]
        for i in range(n - 1):
            for k in range(rows):
                term[i, k] = scale * new[i, k]
                out[i, k] += term[i, k]
        for k in range(rows):
            term[n - 1, k] = 0.0
