"""The contract of all mechanical effects: the inputs of an effect's function, and the outputs to which it adds.

An effect is ``def name(s, p, out)``: ``s`` is the state with the indices below, ``p`` holds up to three parameters, and
the function adds to ``out``.  It is compiled twice: with real numbers for the motion and for the searches of the
diagnosis, and with complex numbers, whose imaginary parts carry one derivative (the complex step, exact to rounding).
The function must therefore be analytic within a mode: it uses ``s[SIGN_V].real`` as the sign of the velocity, compares
real parts only, and takes ``sine`` and ``power`` from here (numpy's ``exp`` and ``log`` work for both).  A new effect
requires no change of the solver.
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

# Inputs: positions and velocities of block and plate from the undeflected rest, SI units.
X, V, Y, U = 0, 1, 2, 3
XI, XI_RATE = 4, 5  # overlap of contact point and block, and its rate; negative overlap: a gap
FORCE = 6  # total contact force on the block; 0 for effects between the bodies, which contribute to it
Q, W = 7, 8  # the effect's own hidden state
SIGN_V = 9  # +1 or -1, which changes exactly when the block's velocity changes its sign
NEAR = 10  # 1 while the gap is smaller than the effect's range; it changes exactly at the range
TOUCHING = 11  # 1 in contact
PLATE_STIFFNESS, CONTACT_STIFFNESS, BLOCK_MASS = 12, 13, 14
STATES = 15

# Outputs.
ON_BLOCK = 0  # force on the block in N
ON_PLATE = 1  # force on the plate in N
PAIR = 2  # force on the block, with its reaction on the plate, in N
Q_RATE, W_RATE = 3, 4  # d/dt of the hidden state
MASS = 5  # added to the block's inertia in kg
OUTPUTS = 6

GENERATED = "law"  # file name of generated functions; their names are digests of their text

Kernel = Callable[[Any, Any, Any], None]


_compiling = Lock()


def _compiled(function: Kernel, number: Any) -> Any:
    # two threads that both miss the cache would compile twice, and free an address that is in use
    with _compiling:
        return _compiled_once(function, number)


@cache
def _compiled_once(function: Kernel, number: Any) -> Any:
    pointer = types.CPointer(number)  # type: ignore[no-untyped-call]
    # a function defined at a prompt has no file, and cannot be cached
    source = function.__code__.co_filename
    options: Any = {"cache": source == GENERATED or Path(source).is_file(), "error_model": "numpy"}
    return cfunc(types.void(pointer, pointer, pointer), **options)(function)


def address(function: Kernel) -> int:
    """Return the address of the effect compiled for real numbers; compilation takes 0.2 s and is cached."""
    return int(_compiled(function, types.float64).address)


def complex_address(function: Kernel) -> int:
    """Return the address of the effect compiled for complex numbers, which carry its derivatives."""
    return int(_compiled(function, types.complex128).address)


def _call_within(_context: Any, at: Any, s: Any, p: Any, first: Any) -> Any:
    """Call the effect at an address (for kernels): parameters start at ``p[first]``, outputs follow inputs in ``s``."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        state, values = (
            context.make_array(kind)(context, builder, value).data
            for kind, value in zip(signature.args[1:3], arguments[1:3], strict=True)
        )
        out = builder.gep(state, [ir.Constant(ir.IntType(64), STATES)])
        pointers = [state, builder.gep(values, [arguments[3]]), out]
        function = ir.FunctionType(ir.VoidType(), [pointer.type for pointer in pointers])
        builder.call(builder.inttoptr(arguments[0], function.as_pointer()), pointers)
        return context.get_dummy_value()

    return types.void(types.int64, s, p, types.int64), generate


call_within: Any = intrinsic(_call_within)


def kernel_function(name: str, of_reals: Callable[..., Any], carrying: Callable[..., Any] | None = None) -> Any:
    """Return a function that only kernels can call: ``of_reals``, or ``carrying`` if an argument is complex.

    The imaginary parts carry a derivative, which ``carrying`` multiplies by the function's slope.  This is faster than
    the library's complex functions, and correct where their definition differs.  By default ``of_reals`` serves both.
    """

    def function(*_: Any) -> Any:
        raise NotImplementedError(f"{name} is for compiled kernels only")

    def chosen(*kinds: Any) -> Any:
        return carrying if carrying is not None and any(isinstance(kind, types.Complex) for kind in kinds) else of_reals

    function.__name__ = name
    overload(function, strict=False)(chosen)
    return function


def _sine_carrying(x: Any) -> Any:
    return complex(math.sin(x.real), math.cos(x.real) * x.imag)


def _power(x: Any, y: Any) -> Any:
    return math.exp(y * math.log(x))


def _power_carrying(x: Any, y: Any) -> Any:
    log = math.log(x.real)
    size = math.exp(y.real * log)
    return complex(size, size * (y.imag * log + y.real * x.imag / x.real))


sine = kernel_function("sine", lambda x: math.sin(x), _sine_carrying)
power = kernel_function("power", _power, _power_carrying)  # x^y of a positive x
