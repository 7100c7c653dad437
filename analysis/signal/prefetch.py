"""Asking for memory before it is needed, so that it comes while the processor is busy with what it has."""

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

LINE_BYTES = 64  # fetched at once
_READ, _SECOND_CACHE, _DATA = 0, 2, 1  # into the first cache it would displace what is being worked on


def _prefetch(typing_context, array, index):  # type: ignore[no-untyped-def]
    """Start fetching the line that ``array[index]`` lies in; an index out of bounds does nothing."""
    del typing_context

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
        address = builder.bitcast(builder.gep(data, [arguments[1]]), ir.IntType(8).as_pointer())
        number = ir.IntType(32)
        kind = ir.FunctionType(ir.VoidType(), [address.type, number, number, number])
        fetch = builder.module.declare_intrinsic("llvm.prefetch", [address.type], kind)
        builder.call(fetch, [address, number(_READ), number(_SECOND_CACHE), number(_DATA)])
        return context.get_dummy_value()

    return types.void(array, types.intp), generate


prefetch: Any = intrinsic(_prefetch)
