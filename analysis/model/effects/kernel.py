"""What an effect's function is given and what it may add to: the one contract of all mechanical effects.

An effect is ``def name(s, p, out)``: ``s`` holds the state under the indices below, ``p`` its up to three parameters,
and it adds to ``out``.  All three are complex: the value travels in the real part, one derivative in the imaginary
part (the complex step, exact to rounding), so a function must be analytic within a phase: it asks ``s[SIGN_V].real``
instead of the sign of the velocity, and compares real parts only.  The integrator never changes for a new effect.
"""

from collections.abc import Callable
from functools import cache
from typing import Any

from numba import njit, types

# State: of the block and the plate from the undeflected rest, SI units.
X, V, Y, U = 0, 1, 2, 3
XI, XI_RATE = 4, 5  # overlap of contact point and block, and its rate; negative overlap: they are apart
FORCE = 6  # on the block from contact, complete; not yet known to a "pair" effect
Q, W = 7, 8  # the effect's own hidden state
SIGN_V = 9  # +1 or -1, switched exactly where the block's velocity changes its sign
NEAR = 10  # 1 where the bodies are apart by less than the effect's range, switched exactly there
TOUCHING = 11  # 1 in contact
PLATE_STIFFNESS, CONTACT_STIFFNESS, BLOCK_MASS = 12, 13, 14
STATES = 15

# What an effect may add to.
ON_BLOCK = 0  # force on the block in N
ON_PLATE = 1  # force on the plate in N
PAIR = 2  # force on the block that the plate feels reversed, in N ("pair" effects)
Q_RATE, W_RATE = 3, 4  # d/dt of the hidden state
MASS = 5  # added to the block's inertia in kg
OUTPUTS = 6

_ARRAY = types.Array(types.complex128, 1, "C")
SIGNATURE = types.void(_ARRAY, _ARRAY, _ARRAY)
FUNCTION = types.FunctionType(SIGNATURE)
Kernel = Callable[[Any, Any, Any], None]


@cache
def compiled(function: Kernel) -> Any:
    """Return the compiled effect; about 0.3 s the first time ever, milliseconds from the cache."""
    return njit(SIGNATURE, cache=True, nogil=True, error_model="numpy")(function)


def nothing(s: Any, p: Any, out: Any) -> None:
    """Fill an empty slot of the integrator."""
