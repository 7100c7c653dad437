"""Propagators of a linear phase and of its derivatives.

The state is augmented by a constant 1, which carries what drives it: s' = A s.  Columns of ``z``, shape (n + 1, rows),
are the state and its derivatives by the parameters, S' = A S + (dA/dtheta) s.
"""

from analysis.model.rates import PLATE, tight
from analysis.model.switches import rates

_SAME = 1e-11  # of the terms, where two states must agree on A
_MOST_TERMS = 60


@tight
def form(  # type: ignore[no-untyped-def]
    n, rows, total, every, z, f, told, p, slots, flags, real, carrying, s, values, effect, cs, c_values, c_effect,
    a, by, seen,
):  # fmt: skip
    """Write A, shape (n + 1, n + 1), its derivatives, and what is watched, shape (3, n + 1); False if there is no A.

    ``every`` holds n times "by none", then the parameters.  n + 3 evaluations of the rates with ``total`` rows.
    """
    for j in range(total):
        for c in range(n):
            z[j, c] = 1.0 if c == j - 1 else 0.0
    rates(z, f, total, every, p, slots, flags, real, carrying, s, values, effect, cs, c_values, c_effect, told)
    for j in range(n + 1):
        row = (j + 1) % (n + 1)  # the state's own last: b
        for i in range(n):
            a[i, j] = f[row, i]
        a[n, j] = 0.0
        for i in range(3):
            seen[i, j] = told[row, i]
    for k in range(rows - 1):
        for i in range(n):
            by[k, i, n] = f[1 + n + k, i]
        for j in range(n + 1):
            by[k, n, j] = 0.0
    for j in range(n):
        z[0, j] = 1.0
        rates(z, f, total, every, p, slots, flags, real, carrying, s, values, effect, cs, c_values, c_effect, told)
        for k in range(rows - 1):
            for i in range(n):
                by[k, i, j] = f[1 + n + k, i] - by[k, i, n]
        z[0, j] = 0.0
    for trial in range(2):
        side = 1.0 if trial == 0 else -1.5  # overlapping, and apart
        for j in range(n):
            z[0, j] = side * (1e-4 * (3 + j) if j % 2 == 0 else 0.1 * (j - 4))
        rates(z, f, total, every, p, slots, flags, real, carrying, s, values, effect, cs, c_values, c_effect, told)
        for i in range(n):
            for j in range(n):
                if not abs(f[1 + j, i] - a[i, j]) <= _SAME * abs(a[i, j]):
                    return False
            for k in range(-1, rows - 1):
                total_of, size = (a[i, n], abs(a[i, n])) if k < 0 else (by[k, i, n], abs(by[k, i, n]))
                for j in range(n):
                    term = (a[i, j] if k < 0 else by[k, i, j]) * z[0, j]
                    total_of += term
                    size += abs(term)
                if not abs((f[0, i] if k < 0 else f[1 + n + k, i]) - total_of) <= _SAME * size:
                    return False
    if flags[PLATE] < 0.5:  # left to itself, or not yet met: it rings freely
        a[2, 3], a[3, 2] = 1.0, -p[0] / p[1]
    return True


@tight
def propagate(a, by, rows, h, e, d, term, new, d_term, d_new):  # type: ignore[no-untyped-def]
    """Write exp(A h) and its derivatives, shape (n + 1, n + 1, rows), and return how many terms that took.

    About 1 us, and 4 us for each parameter that A knows.
    """
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


@tight
def along(functional, item, z):  # type: ignore[no-untyped-def]
    """Return one row of ``functional`` on the state."""
    total = 0.0
    for c in range(z.shape[0]):
        total += functional[item, c] * z[c, 0]
    return total


@tight
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


@tight
def step_alone(z, e, out):  # type: ignore[no-untyped-def]
    """Write the state a step ahead."""
    for i in range(e.shape[0] - 1):
        out[i, 0] = along(e, i, z)


@tight
def repeat(e, d, rows, times, shown, e_all, d_all, mean, d_mean, e_work, d_work):  # type: ignore[no-untyped-def]
    """Write ``times`` steps as one, and what is ``shown``, shape (5, n + 1), on the mean after each of them.

    ``mean`` has shape (5, n + 1), ``d_mean``, shape (n + 1, rows), is for the first of the five.
    """
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
            for i in range(5):
                so_far = 0.0 if trial == 0 else mean[i, j]
                for c in range(n):
                    so_far += share * shown[i, c] * e_all[c, j]
                mean[i, j] = so_far
            for k in range(d.shape[2]):
                d_mean[j, k] = (0.0 if trial == 0 else d_mean[j, k]) + share * d_all[0, j, k]


@tight
def show(z, rows, mean, d_mean, states, d_x):  # type: ignore[no-untyped-def]
    """Add the mean of what is shown over some steps ahead, and of the derivatives of the block's position, to rows."""
    n = z.shape[0]
    for i in range(5):
        states[i] += along(mean, i, z)
    for k in range(1, rows):
        total = 0.0
        for c in range(n):
            total += mean[0, c] * z[c, k] + d_mean[c, k] * z[c, 0]
        d_x[k - 1] += total


@tight
def advance(z, rows, a, by, h, terms, out, term, new):  # type: ignore[no-untyped-def]
    """Write the first ``rows`` columns after a time of any length, by their Taylor series."""
    n = a.shape[0]
    for i in range(n):
        for k in range(rows):
            out[i, k] = term[i, k] = z[i, k]
    for m in range(1, terms + 1):
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
