"""Passes a NamedTuple of arrays between kernels by its address: ``by_address(bundle)`` has the same fields.

numba passes a NamedTuple by value, and every array in it as seven values or more: a call with four bundles of the
solver has five hundred arguments, which take longer to compile and to pass than the work of the call.  A field is read
from memory at every access, so loops copy their arrays into local variables first.
"""

import hashlib
from typing import Any

from numba import types
from numba.core import cgutils
from numba.core.imputils import impl_ret_borrowed, lower_getattr_generic
from numba.core.typing.templates import AttributeTemplate, infer_getattr
from numba.extending import intrinsic, models, register_model


class BundleAddress(types.Type):
    """The type of the address of a NamedTuple; a field that is a NamedTuple is an address too."""

    def __init__(self, bundle: Any) -> None:
        self.bundle = bundle  # its name is replaced by a digest, as names of types are part of all compiled code
        digest = hashlib.sha256(bundle.name.encode()).hexdigest()[:12]
        super().__init__(f"{bundle.instance_class.__name__}_{digest}")  # type: ignore[no-untyped-call]

    def field(self, name: str) -> Any:
        """Return the type of a field, None if there is no field of that name."""
        if name not in self.bundle.fields:
            return None
        kind = self.bundle.types[self.bundle.fields.index(name)]
        return BundleAddress(kind) if isinstance(kind, types.BaseNamedTuple) else kind


@register_model(BundleAddress)
class _Model(models.PrimitiveModel):  # type: ignore[misc]
    def __init__(self, manager: Any, kind: BundleAddress) -> None:
        super().__init__(manager, kind, manager.lookup(kind.bundle).get_value_type().as_pointer())  # type: ignore[no-untyped-call]


@infer_getattr
class _Fields(AttributeTemplate):  # type: ignore[misc]
    key = BundleAddress

    def generic_resolve(self, kind: BundleAddress, name: str) -> Any:  # type: ignore[override]
        return kind.field(name)


@lower_getattr_generic(BundleAddress)  # type: ignore[no-untyped-call]
def _field(context: Any, builder: Any, kind: BundleAddress, address: Any, name: str) -> Any:
    field = kind.field(name)
    at = cgutils.gep_inbounds(builder, address, 0, kind.bundle.fields.index(name))  # type: ignore[no-untyped-call]
    if isinstance(field, BundleAddress):
        return at
    return impl_ret_borrowed(context, builder, field, builder.load(at))  # type: ignore[no-untyped-call]


def _by_address(_context: Any, bundle: Any) -> Any:
    """Store a bundle on the stack of the calling kernel and return its address, valid until that kernel returns."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return cgutils.alloca_once_value(builder, arguments[0])  # type: ignore[no-untyped-call]

    return BundleAddress(bundle)(bundle), generate


by_address: Any = intrinsic(_by_address)
