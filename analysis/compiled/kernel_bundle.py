"""A bundle of arrays that kernels hand on by its address: ``held(bundle)``, with the fields of the NamedTuple.

numba hands a NamedTuple on by value, and every array in it as seven values and more: a call with four bundles of a
solver is five hundred of them, which take longer to compile, and to push, than what the call is for.  A field of a
held bundle is read when it is asked for; loops take theirs into a variable before they begin.
"""

import hashlib
from typing import Any

from numba import types
from numba.core import cgutils
from numba.core.imputils import impl_ret_borrowed, lower_getattr_generic
from numba.core.typing.templates import AttributeTemplate, infer_getattr
from numba.extending import intrinsic, models, register_model


class Held(types.Type):
    """The address of a NamedTuple; a field that is one itself is held in it."""

    def __init__(self, bundle: Any) -> None:
        """Name it shortly: the names stand in all that is compiled."""
        self.bundle = bundle
        digest = hashlib.sha256(bundle.name.encode()).hexdigest()[:12]
        super().__init__(f"{bundle.instance_class.__name__}_{digest}")  # type: ignore[no-untyped-call]

    def field(self, name: str) -> Any:
        """Return the type of a field, None where there is none of that name."""
        if name not in self.bundle.fields:
            return None
        kind = self.bundle.types[self.bundle.fields.index(name)]
        return Held(kind) if isinstance(kind, types.BaseNamedTuple) else kind


@register_model(Held)
class _Model(models.PrimitiveModel):  # type: ignore[misc]
    def __init__(self, manager: Any, held: Held) -> None:
        super().__init__(manager, held, manager.lookup(held.bundle).get_value_type().as_pointer())  # type: ignore[no-untyped-call]


@infer_getattr
class _Fields(AttributeTemplate):  # type: ignore[misc]
    key = Held

    def generic_resolve(self, held: Held, name: str) -> Any:  # type: ignore[override]
        return held.field(name)


@lower_getattr_generic(Held)  # type: ignore[no-untyped-call]
def _field(context: Any, builder: Any, held: Held, address: Any, name: str) -> Any:
    kind = held.field(name)
    at = cgutils.gep_inbounds(builder, address, 0, held.bundle.fields.index(name))  # type: ignore[no-untyped-call]
    if isinstance(kind, Held):
        return at
    return impl_ret_borrowed(context, builder, kind, builder.load(at))  # type: ignore[no-untyped-call]


def _held(_context: Any, bundle: Any) -> Any:
    """Lay a bundle where its address stays good until this function returns (for kernels)."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return cgutils.alloca_once_value(builder, arguments[0])  # type: ignore[no-untyped-call]

    return Held(bundle)(bundle), generate


held: Any = intrinsic(_held)
