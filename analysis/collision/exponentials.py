"""Matrix exponentials of a linear mode, their action on a state, and means over a block of steps (kernels)."""

from analysis.collision.matrices import TERMS
from analysis.compiled import part

_MOST_TERMS = 60


@part
def exponential(form, room, rows, h):  # type: ignore[no-untyped-def]
    """Write exp(A h) and its derivatives, and return the number of terms of the series.

    About 1 us, and 4 us for each parameter on which A depends.
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
    """Write state and derivatives one step ahead, four columns at a time, which vectorises."""
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
    """Write the state one step ahead, without derivatives."""
    for i in range(e.shape[0] - 1):
        out[i, 0] = along(e, i, z)


@part
def repeat(form, room, rows, times):  # type: ignore[no-untyped-def]
    """Write the propagator of ``times`` steps and the matrix of the mean over them; derivatives of its first row."""
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
    """Add the mean over the next block of steps to the outputs, and that of the derivatives of the block's position."""
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
