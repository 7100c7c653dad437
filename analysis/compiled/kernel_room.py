"""Work arrays of a kernel, cut from one array that Python passes in, because each allocation compiles for 0.25 s.

``array, at = cut(room, at, shape)`` is the part of ``room`` (float64, one-dimensional) that begins at ``at``, and the
position after it; ``cut_integers`` gives int64.  Nothing is set to zero, and the size of ``room`` is not checked.
"""

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic
from numba.np.arrayobj import populate_array

_unpacked: Any = cgutils.unpack_tuple
_populated: Any = populate_array
_BYTES = 8  # of a number


def _cutting(kind: Any) -> Any:
    def cut(_context: Any, room: Any, at: Any, shape: Any) -> Any:
        array = types.Array(kind, len(shape), "C")  # type: ignore[no-untyped-call]

        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            given, begin, extents = arguments
            extents = [
                context.cast(builder, extent, of, types.intp)
                for extent, of in zip(_unpacked(builder, extents), shape, strict=True)
            ]
            strides: list[Any] = []
            size = ir.Constant(ir.IntType(64), 1)
            for extent in reversed(extents):
                strides.insert(0, builder.mul(size, ir.Constant(ir.IntType(64), _BYTES)))
                size = builder.mul(size, extent)
            data = builder.gep(context.make_array(room)(context, builder, given).data, [begin])
            out = context.make_array(array)(context, builder)
            _populated(
                out,
                data=builder.bitcast(data, context.get_value_type(kind).as_pointer()),
                shape=extents,
                strides=strides,
                itemsize=context.get_constant(types.intp, _BYTES),
                meminfo=None,
            )
            both = (out._getvalue(), builder.add(begin, size))
            return context.make_tuple(builder, signature.return_type, both)

        both: Any = types.Tuple((array, types.intp))  # type: ignore[no-untyped-call]
        return both(room, types.intp, shape), generate

    return cut


cut: Any = intrinsic(_cutting(types.float64))
cut_integers: Any = intrinsic(_cutting(types.int64))
