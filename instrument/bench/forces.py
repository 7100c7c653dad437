"""The forces between block, plate, clamp and bearing in the frame's coordinates, and indices of their parameters.

A coefficient of zero switches a force off.  Right is positive, the plate at rest is at x = 0, and the block comes from
the right.  SI units.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]

GRAVITY_M_PER_S2 = 9.80665

# state: positions and velocities, then internal variables
BLOCK_X, BLOCK_V, PLATE_X, PLATE_V = 0, 1, 2, 3
HIDDEN_X, HIDDEN_V = 4, 5  # internal mass of the block
ARM_F = 6  # force of the Maxwell arm
MODE_Q, MODE_V = 7, 8  # second plate mode, at the contact point
CLAMP_X, CLAMP_V = 9, 10  # elastic displacement of the clamp
BRISTLE_Z = 11  # bristle deflection
SLIP_X = 12  # slip of the clamp
STATES = 13

# parameters
M_BLOCK, M_PLATE, K_PLATE, K_CONTACT, C_CONTACT = 0, 1, 2, 3, 4
F_COULOMB, C_VISCOUS, C_QUADRATIC, TILT_RAD, K_BEARING = 5, 6, 7, 8, 9
M_HIDDEN, W_HIDDEN, Z_HIDDEN = 10, 11, 12
K_CUBIC, C_PLATE = 13, 14
K_ARM, TAU_ARM = 15, 16
M_MODE, W_MODE, Z_MODE = 17, 18, 19
CLAMP_COMPLIANCE, W_CLAMP = 20, 21
CONTACT_DELTA, CONTACT_XI0 = 22, 23
C_OVERLAP = 24
F_ADHESION, D_ADHESION = 25, 26
# not in the catalogue of the analysis
F_BRISTLE, F_BRISTLE_STATIC, V_BRISTLE, K_BRISTLE = 27, 28, 29, 30
AREA_GAIN, AREA_XI = 31, 32
JUMP_MASS, JUMP_X = 33, 34
C_ASYMMETRIC = 35
F_MAGNET, D_MAGNET = 36, 37
F_SLIP, SLIP_MOBILITY = 38, 39
PARAMETERS = 40

# flags that change at an event and are constant during a step
IN_CONTACT, MOVING_RIGHT, WITHIN_REACH, JUMPED = 0, 1, 2, 3
SWITCHES = 4


@njit(cache=True, nogil=True, error_model="numpy")
def gap_m(y: Floats) -> float:
    """Return the gap in m between block and plate (negative: overlap)."""
    return float(y[BLOCK_X] - y[PLATE_X] - y[MODE_Q])


@njit(cache=True, nogil=True, error_model="numpy")
def pair_force_n(y: Floats, p: Floats, on: NDArray[np.int64]) -> float:
    """Return the force in N of the plate on the block (paper Eq. 9 and the effects in the contact).

    k_N xi (xi/xi_0)^delta (1 + a (1 - exp(-xi/xi_a))) + (gamma_N + c xi) xi' - F_a [0 <= gap < d] + F_m exp(-gap/l)
    """
    gap = gap_m(y)
    force = 0.0
    if on[IN_CONTACT] == 1:
        xi = -gap
        rate = y[PLATE_V] + y[MODE_V] - y[BLOCK_V]
        spring = p[K_CONTACT] * xi
        if p[CONTACT_DELTA]:
            spring *= (xi / p[CONTACT_XI0]) ** p[CONTACT_DELTA] if xi > 0.0 else 0.0
        if p[AREA_GAIN]:
            spring *= 1.0 + p[AREA_GAIN] * (1.0 - math.exp(-max(xi, 0.0) / p[AREA_XI]))
        force += spring + (p[C_CONTACT] + p[C_OVERLAP] * max(xi, 0.0)) * rate
    if on[WITHIN_REACH] == 1:
        force -= p[F_ADHESION]
    if p[F_MAGNET]:
        force += p[F_MAGNET] * math.exp(-max(gap, 0.0) / p[D_MAGNET])
    return force


@njit(cache=True, nogil=True, error_model="numpy")
def rates(y: Floats, p: Floats, on: NDArray[np.int64], frame: float, dy: Floats) -> None:
    """Write dy/dt of the 13 states into ``dy``; the frame's acceleration ``frame`` (m/s2) acts negatively on each mass.

    Cost: about 50 ns.
    """
    for i in range(STATES):
        dy[i] = 0.0
    v = y[BLOCK_V]
    pair = pair_force_n(y, p, on)

    # bearing and air on the block
    drag = p[C_VISCOUS] * v + p[C_QUADRATIC] * v * abs(v) + p[C_ASYMMETRIC] * abs(v)
    drag += p[F_COULOMB] if on[MOVING_RIGHT] == 1 else -p[F_COULOMB]
    if p[F_BRISTLE]:  # LuGre with a Stribeck curve
        steady = p[F_BRISTLE] + (p[F_BRISTLE_STATIC] - p[F_BRISTLE]) * math.exp(-((v / p[V_BRISTLE]) ** 2))
        dy[BRISTLE_Z] = v - p[K_BRISTLE] * abs(v) / steady * y[BRISTLE_Z]
        drag += p[K_BRISTLE] * y[BRISTLE_Z]
    carried = p[M_BLOCK] - p[M_HIDDEN]
    if on[JUMPED] == 1:
        carried += p[JUMP_MASS]
    slope = GRAVITY_M_PER_S2 * math.sin(p[TILT_RAD]) - frame
    inner = 0.0
    dy[HIDDEN_X] = y[HIDDEN_V]
    if p[M_HIDDEN]:
        w = p[W_HIDDEN]
        inner = p[M_HIDDEN] * (w * w * (y[HIDDEN_X] - y[BLOCK_X]) + 2.0 * p[Z_HIDDEN] * w * (y[HIDDEN_V] - v))
        dy[HIDDEN_V] = slope - inner / p[M_HIDDEN]
    dy[BLOCK_X] = v
    dy[BLOCK_V] = slope + (pair - drag + inner - p[K_BEARING] * y[BLOCK_X]) / carried

    # plate against its clamp
    bend = y[PLATE_X] - y[CLAMP_X] - y[SLIP_X]
    bend_rate = y[PLATE_V] - y[CLAMP_V]
    hold = p[K_PLATE] * bend + p[K_CUBIC] * bend * bend * bend + p[C_PLATE] * bend_rate + y[ARM_F]
    dy[PLATE_X] = y[PLATE_V]
    dy[PLATE_V] = -(hold + pair) / p[M_PLATE] - frame
    if p[K_ARM]:
        dy[ARM_F] = p[K_ARM] * bend_rate - y[ARM_F] / p[TAU_ARM]
    dy[MODE_Q] = y[MODE_V]
    if p[M_MODE]:
        w = p[W_MODE]
        dy[MODE_V] = -pair / p[M_MODE] - 2.0 * p[Z_MODE] * w * y[MODE_V] - w * w * y[MODE_Q]
    dy[CLAMP_X] = y[CLAMP_V]
    if p[CLAMP_COMPLIANCE]:  # a mass 1 / (C w^2) on a spring 1 / C
        w = p[W_CLAMP]
        dy[CLAMP_V] = w * w * (hold * p[CLAMP_COMPLIANCE] - y[CLAMP_X]) - frame
    if abs(hold) > p[F_SLIP]:
        dy[SLIP_X] = p[SLIP_MOBILITY] * (hold - math.copysign(p[F_SLIP], hold))
