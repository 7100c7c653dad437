"""What an effect's function is given and what it may add to: the one contract of all mechanical effects.

An effect is ``def name(s, p, out)``: ``s`` holds the state under the indices below, ``p`` its up to three parameters,
and it adds to ``out``.  The same text is compiled twice.  Once all three are real: the motion itself, and the searches
of the diagnosis.  Once they are complex: the value travels in the real part, one derivative in the imaginary part (the
complex step, exact to rounding).  So a function must be analytic within a phase: it asks ``s[SIGN_V].real`` instead of
the sign of the velocity, compares real parts only, and takes ``sine`` and ``power`` from here (numpy's ``exp``, ``log``
and the like serve both as well).  The integrators (njit) never change for a new effect.
"""

import math
from collections.abc import Callable
from functools import cache
from pathlib import Path
from threading import Lock
from typing import Any

from llvmlite import ir
from numba import cfunc, types
from numba.extending import intrinsic, overload

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

WRITTEN = "law"  # the file, so to say, of functions that the program wrote and named by their own text

Kernel = Callable[[Any, Any, Any], None]


_compiling = Lock()


def _compiled(function: Kernel, number: Any) -> Any:
    # Two threads that both miss the cache would compile twice, and the address that one of them holds would be freed.
    with _compiling:
        return _compiled_once(function, number)


@cache
def _compiled_once(function: Kernel, number: Any) -> Any:
    pointer = types.CPointer(number)  # type: ignore[no-untyped-call]
    # What is defined at a prompt has neither a file nor a name of its own by which a kept kernel could be told.
    source = function.__code__.co_filename
    options: Any = {"cache": source == WRITTEN or Path(source).is_file(), "error_model": "numpy"}
    return cfunc(types.void(pointer, pointer, pointer), **options)(function)


def address(function: Kernel) -> int:
    """Return where the effect lies, compiled for real numbers; about 0.2 s the first time ever, then kept."""
    return int(_compiled(function, types.float64).address)


def complex_address(function: Kernel) -> int:
    """Return where the effect lies, compiled for complex numbers, which carry its derivatives; costs as ``address``."""
    return int(_compiled(function, types.complex128).address)


def _called(context: Any, builder: Any, at: Any, pointers: Any) -> Any:
    function = ir.FunctionType(ir.VoidType(), [pointer.type for pointer in pointers])
    builder.call(builder.inttoptr(at, function.as_pointer()), pointers)
    return context.get_dummy_value()


def _call(_context: Any, at: Any, s: Any, p: Any, out: Any) -> Any:
    """Call the compiled effect that lies at an address (for kernels); about 2 ns."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        arrays = zip(signature.args[1:], arguments[1:], strict=True)
        pointers = [context.make_array(kind)(context, builder, value).data for kind, value in arrays]
        return _called(context, builder, arguments[0], pointers)

    return types.void(types.int64, s, p, out), generate


def _call_within(_context: Any, at: Any, told: Any, p: Any, first: Any) -> Any:
    """Call the effect at an address (for kernels): parameters from ``p[first]`` on, answers behind the told state."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        s, values = (
            context.make_array(kind)(context, builder, value).data
            for kind, value in zip(signature.args[1:3], arguments[1:3], strict=True)
        )
        out = builder.gep(s, [ir.Constant(ir.IntType(64), STATES)])
        return _called(context, builder, arguments[0], [s, builder.gep(values, [arguments[3]]), out])

    return types.void(types.int64, told, p, types.int64), generate


call: Any = intrinsic(_call)
call_within: Any = intrinsic(_call_within)


def sine(x: Any) -> Any:
    """Return sin x of a real number or of one that carries a derivative (for kernels)."""
    raise NotImplementedError("for compiled kernels only")


def power(x: Any, y: Any) -> Any:
    """Return x^y of a positive x, real or carrying a derivative (for kernels); the library's complex one is slow."""
    raise NotImplementedError("for compiled kernels only")


@overload(sine)
def _sine(x: Any) -> Any:
    def of_real(x: Any) -> Any:
        return math.sin(x)

    def carrying(x: Any) -> Any:
        return complex(math.sin(x.real), math.cos(x.real) * x.imag)

    return carrying if isinstance(x, types.Complex) else of_real


@overload(power)
def _power(x: Any, y: Any) -> Any:
    def of_reals(x: Any, y: Any) -> Any:
        return math.exp(y * math.log(x))

    def carrying(x: Any, y: Any) -> Any:
        log = math.log(x.real)
        size = math.exp(y.real * log)
        return complex(size, size * (y.imag * log + y.real * x.imag / x.real))

    return carrying if isinstance(x, types.Complex) else of_reals
