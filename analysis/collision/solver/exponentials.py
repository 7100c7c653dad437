"""Matrix exponentials of a linear mode, their application to a state, and means over a block of steps (kernels)."""

from analysis.collision.solver.matrices import TERMS
from analysis.compiled import add_product, add_products, four_of, four_zeros, inlined, part, put_four

_MAX_TERMS = 60


@part
def exponential(form, room, rows, h):  # type: ignore[no-untyped-def]
    """Write exp(A h) and its derivatives by Taylor series, and return the number of terms.

    Takes about 2 us, plus 2 us for each parameter on which A depends.
    """
    a, by, e, d = form.a, form.by, form.e, form.d
    term, new, depends, d_term, d_new = room.square[0], room.square[1], room.square[2], room.d_term, room.d_work
    n, wide = a.shape[0], d.shape[2] if rows > 1 else 0
    for i in range(n):
        for j in range(n):
            e[i, j] = term[i, j] = 1.0 if i == j else 0.0
            depends[i, j] = 0.0  # whether this element of A depends on any parameter
            for k in range(d.shape[2]):
                d[i, j, k] = 0.0
            for k in range(wide):
                d_term[i, j, k] = 0.0
                if by[i, j, k] != 0.0:
                    depends[i, j] = 1.0
    terms = 0
    for m in range(1, _MAX_TERMS):
        scale = h / m
        for i in range(n if wide else 0):
            for j in range(n):
                for k in range(0, wide, 4):
                    put_four(four_zeros(), d_new[i, j], k)
            for c in range(n):
                if a[i, c] != 0.0:
                    _add_to_rows(a[i, c], d_term[c], d_new[i])
                if depends[i, c] != 0.0:
                    for j in range(n):
                        for k in range(0, wide, 4):
                            moved = add_product(four_of(d_new[i, j], k), term[c, j], four_of(by[i, c], k))
                            put_four(moved, d_new[i, j], k)
        for i in range(n if wide else 0):
            for j in range(n):
                for k in range(0, wide, 4):
                    moved = add_product(four_zeros(), scale, four_of(d_new[i, j], k))
                    put_four(moved, d_term[i, j], k)
                    put_four(add_product(four_of(d[i, j], k), 1.0, moved), d[i, j], k)
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


@inlined
def _add_to_rows(factor, rows, out):  # type: ignore[no-untyped-def]
    """Add ``factor`` times some rows, shape (n, a multiple of four)."""
    for j in range(rows.shape[0]):
        for k in range(0, rows.shape[1], 4):
            put_four(add_product(four_of(out[j], k), factor, four_of(rows[j], k)), out[j], k)


@part
def row_times_state(functional, item, z):  # type: ignore[no-untyped-def]
    """Return the product of one row of ``functional`` with the state."""
    total = 0.0
    for c in range(z.shape[0]):
        total += functional[item, c] * z[c, 0]
    return total


@part
def step(z, e, d, out):  # type: ignore[no-untyped-def]
    """Write state and derivatives one step ahead, four columns at a time."""
    n = e.shape[0]
    for i in range(n - 1):
        for k in range(0, z.shape[1], 4):
            total = four_zeros()
            for c in range(n):
                total = add_products(total, e[i, c], four_of(z[c], k), z[c, 0], four_of(d[i, c], k))
            put_four(total, out[i], k)


@part
def step_without_derivatives(z, e, out):  # type: ignore[no-untyped-def]
    """Write the state one step ahead, without derivatives."""
    for i in range(e.shape[0] - 1):
        out[i, 0] = row_times_state(e, i, z)


@part
def block_matrices(form, room, rows, times):  # type: ignore[no-untyped-def]
    """Write the propagator of ``times`` steps, the matrix of the mean over them, and derivatives of its first row."""
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
                    for k in range(0, d.shape[2] if rows > 1 else 0, 4):
                        moved = four_zeros()
                        for c in range(n):
                            moved = add_products(
                                moved, e[i, c], four_of(d_all[c, j], k), e_all[c, j], four_of(d[i, c], k)
                            )
                        put_four(moved, d_work[i, j], k)
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
def add_block_mean(z, rows, form, states, d_x, means):  # type: ignore[no-untyped-def]
    """Add the mean over the next block of steps to the outputs, and that of the derivatives of the block's position.

    ``means`` is a work array of as many numbers as ``z`` has columns.
    """
    for i in range(states.size):
        states[i] += row_times_state(form.mean, i, z)
    if rows == 1:
        return
    mean, d_mean = form.mean[0], form.d_mean
    for k in range(0, z.shape[1], 4):
        total = four_zeros()
        for c in range(z.shape[0]):
            total = add_products(total, mean[c], four_of(z[c], k), z[c, 0], four_of(d_mean[c], k))
        put_four(total, means, k)
    for k in range(1, rows):
        d_x[k - 1] += means[k]


@part
def series(z, rows, form, h, out, room):  # type: ignore[no-untyped-def]
    """Write the first ``rows`` columns after a time of any length, by Taylor series."""
    a, by, term, new = form.a, form.by, room.columns[0], room.columns[1]
    n = a.shape[0]
    for i in range(n):
        for k in range(rows):
            out[i, k] = term[i, k] = z[i, k]
    for m in range(1, int(form.steps[TERMS]) + 1):
        scale = h / m
        for i in range(n - 1):
            if rows == 1:
                new[i, 0] = row_times_state(a, i, term)
            for k in range(0, new.shape[1] if rows > 1 else 0, 4):
                total = four_zeros()
                for c in range(n):
                    total = add_product(total, a[i, c], four_of(term[c], k))
                    total = add_product(total, term[c, 0], four_of(by[i, c], k))
                put_four(total, new[i], k)
        for i in range(n - 1):
            for k in range(rows):
                term[i, k] = scale * new[i, k]
                out[i, k] += term[i, k]
        for k in range(rows):
            term[n - 1, k] = 0.0
