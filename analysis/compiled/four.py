"""Four neighbouring numbers at once in kernels, as one vector of the processor (SSE2, AVX, NEON).

numba vectorises loops over many numbers, but not four sums formed side by side, as of a state of few numbers with few
derivatives.  Every element is computed as the same expression of single numbers is, to the bit.
"""

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic, models, register_model

_LANES = 4
_VECTOR = ir.VectorType(ir.DoubleType(), _LANES)
_BYTES = 8  # of a number: rows begin anywhere


class _Four(types.Type):
    def __init__(self) -> None:
        super().__init__("Four")  # type: ignore[no-untyped-call]


_FOUR = _Four()


@register_model(_Four)
class _Model(models.PrimitiveModel):  # type: ignore[misc]
    def __init__(self, manager: Any, kind: _Four) -> None:
        super().__init__(manager, kind, _VECTOR)  # type: ignore[no-untyped-call]


def _place(context: Any, builder: Any, kind: Any, row: Any, at: Any) -> Any:
    """Return the address of four numbers of a row."""
    data = context.make_array(kind)(context, builder, row).data
    return builder.bitcast(builder.gep(data, [at]), _VECTOR.as_pointer())


def _spread(builder: Any, number: Any) -> Any:
    """Return a vector of four times a number."""
    one = builder.insert_element(ir.Constant(_VECTOR, ir.Undefined), number, ir.Constant(ir.IntType(32), 0))
    mask = ir.Constant(ir.VectorType(ir.IntType(32), _LANES), [0] * _LANES)
    return builder.shuffle_vector(one, one, mask)


def _four_zeros(_context: Any) -> Any:
    def generate(_context: Any, _builder: Any, _signature: Any, _arguments: Any) -> Any:
        return ir.Constant(_VECTOR, [0.0] * _LANES)

    return _FOUR(), generate


def _four_of(_context: Any, row: Any, at: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.load(_place(context, builder, signature.args[0], *arguments), align=_BYTES)

    return _FOUR(row, types.intp), generate


def _put_four(_context: Any, four: Any, row: Any, at: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        four, *to = arguments
        builder.store(four, _place(context, builder, signature.args[1], *to), align=_BYTES)
        return context.get_dummy_value()

    return types.void(_FOUR, row, types.intp), generate


def _add_product(_context: Any, total: Any, by: Any, four: Any) -> Any:
    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        total, by, four = arguments
        return builder.fadd(total, builder.fmul(_spread(builder, by), four))

    return _FOUR(_FOUR, types.float64, _FOUR), generate


def _add_products(_context: Any, total: Any, by: Any, four: Any, also_by: Any, other: Any) -> Any:
    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        total, by, four, also_by, other = arguments
        both = (builder.fmul(_spread(builder, by), four), builder.fmul(_spread(builder, also_by), other))
        return builder.fadd(total, builder.fadd(*both))

    return _FOUR(_FOUR, types.float64, _FOUR, types.float64, _FOUR), generate


four_zeros: Any = intrinsic(_four_zeros)
four_of: Any = intrinsic(_four_of)
put_four: Any = intrinsic(_put_four)
add_product: Any = intrinsic(_add_product)
add_products: Any = intrinsic(_add_products)
