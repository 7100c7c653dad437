"""Linear coefficients of an effect's function in the state and in its hidden state, if it is linear (kernels).

The linearity is checked at several points along a trajectory.  A linear hidden state is propagated exactly.
"""

from analysis.collision.effects.kernel import OUTPUTS, Q_RATE, STATES, W_RATE, Q, W
from analysis.collision.solver.rates import call_effect
from analysis.compiled import kernel, part

SEEN = 9  # the first inputs of an effect: positions, velocities, overlap, its rate, force and the hidden state
_LINEAR_TOLERANCE = 1e-9
_TERMS = 14  # of the exponential series, enough for the longest step of ``first_order``


@kernel
def coefficients(where, inputs, parameters, linear, s):  # type: ignore[no-untyped-def]
    """Write the outputs at rest and their derivatives by the first inputs, shape (6, 10, k); return False if they vary.

    Ten calls per start, plus two per start and point.  ``s``, the inputs and outputs of a call, is workspace.
    """
    for c in range(parameters.shape[0]):
        for trial in range(-1 - SEEN, 2 * inputs.shape[0]):
            for i in range(STATES):
                s[i] = inputs[max(trial, 0) // 2, i]
            s[Q], s[W] = (0.0, 0.0) if trial % 2 == 0 else (0.4, -0.7)
            if trial < 0:
                for i in range(SEEN):
                    s[i] = 1.0 if i == SEEN + trial else 0.0  # at rest first
            call_effect(where, s, parameters[c], 0)
            for i in range(OUTPUTS):
                if trial < 0:
                    column = SEEN + trial
                    linear[i, column, c] = s[STATES + i] - (linear[i, SEEN, c] if column >= 0 else 0.0)
                    continue
                total, size = linear[i, SEEN, c], abs(linear[i, SEEN, c])
                for j in range(SEEN):
                    total += linear[i, j, c] * s[j]
                    size += abs(linear[i, j, c] * s[j])
                if not abs(s[STATES + i] - total) <= _LINEAR_TOLERANCE * size:
                    return False
    return True


@part
def hidden_steps(linear, h, out, power, series):  # type: ignore[no-untyped-def]
    """Write the propagators of the hidden states over ``h`` to ``out``, shape (2, 4, 2, 2, k).

    For the middle and for the end of the step: the factor of the state, then the factors of the drive at start, middle
    and end (phi functions of a parabola; Hochbruck and Ostermann, Acta Numerica 19 (2010) 209).
    """
    count = linear.shape[2]
    for end in range(2):
        t = 0.5 * h if end == 0 else h
        for i in range(2):
            for j in range(2):
                for c in range(count):
                    power[i, j, c] = 1.0 if i == j else 0.0
                    for m in range(4):
                        series[m, i, j, c] = 0.0
        # series[j] is phi_j, the sum of (G t)^m / (m + j)! over m; power holds (G t)^m / m!
        for m in range(_TERMS):
            one = 1.0 / (m + 1.0)
            two = one / (m + 2.0)
            three = two / (m + 3.0)
            for i in range(2):
                for j in range(2):
                    for c in range(count):
                        series[0, i, j, c] += power[i, j, c]
                        series[1, i, j, c] += one * power[i, j, c]
                        series[2, i, j, c] += two * power[i, j, c]
                        series[3, i, j, c] += three * power[i, j, c]
            by = t * one
            for j in range(2):
                for c in range(count):
                    top, low = power[0, j, c], power[1, j, c]
                    power[0, j, c] = by * (linear[Q_RATE, Q, c] * top + linear[Q_RATE, W, c] * low)
                    power[1, j, c] = by * (linear[W_RATE, Q, c] * top + linear[W_RATE, W, c] * low)
        for i in range(2):
            for j in range(2):
                for c in range(count):
                    one, two, three = series[1, i, j, c], series[2, i, j, c], series[3, i, j, c]
                    out[end, 0, i, j, c] = series[0, i, j, c]
                    if end == 0:
                        out[end, 1, i, j, c] = t * (one - 1.5 * two + three)
                        out[end, 2, i, j, c] = t * (2.0 * two - 2.0 * three)
                        out[end, 3, i, j, c] = t * (three - 0.5 * two)
                    else:
                        out[end, 1, i, j, c] = t * (one - 3.0 * two + 4.0 * three)
                        out[end, 2, i, j, c] = t * (4.0 * two - 8.0 * three)
                        out[end, 3, i, j, c] = t * (4.0 * three - two)
