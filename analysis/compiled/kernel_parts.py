"""Extensions of numba for the solver's kernels: parts compiled with their callers, arrays by address, work arrays.

numba optimises every function that a kernel calls, together with all its callees, and turns it into machine code with
wrappers for Python.  It then repeats all of this for the caller.  A kernel of thirty functions, eight calls deep, takes
a minute.  A part is only typed and translated to LLVM's intermediate code.  The kernel is linked, optimised and
translated to machine code once, which is three times faster.

numba passes a NamedTuple by value, and every array in it as seven values or more.  A call with four bundles of the
solver has five hundred arguments, which take longer to compile and to pass than the work of the call.
``by_address(bundle)`` has the same fields.  A field is read from memory at every access, so loops copy their arrays
into local variables first.

Each allocation adds 0.25 s of compilation, so a kernel's work arrays are cut from one array that Python passes in.
``array, at = cut(room, at, shape)`` returns the part of ``room`` (float64, one-dimensional) that begins at ``at``, and
the position after it; ``cut_integers`` returns int64.  Nothing is set to zero; the size of ``room`` is not checked.
"""

import hashlib
from typing import Any

from llvmlite import ir
from numba import njit, types
from numba.core import cgutils
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase
from numba.core.compiler_machinery import PassManager
from numba.core.imputils import impl_ret_borrowed, lower_getattr_generic
from numba.core.registry import CPUDispatcher
from numba.core.typed_passes import (
    AnnotateTypes,
    IRLegalization,
    NativeLowering,
    NoPythonBackend,
    NopythonTypeInference,
    PreLowerStripPhis,
)
from numba.core.typing.templates import AttributeTemplate, infer_getattr
from numba.core.untyped_passes import FixupArgs, IRProcessing, ReconstructSSA, TranslateByteCode
from numba.extending import intrinsic, models, register_model
from numba.np.arrayobj import populate_array

_unpacked: Any = cgutils.unpack_tuple
_populated: Any = populate_array
_BYTES = 8  # size of a number
# Neither allocates arrays, so reference counting is off; it would cost more than the arithmetic of an inner kernel.
_PLAIN: dict[str, Any] = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True, "_nrt": False}
_PART: dict[str, Any] = _PLAIN | {"nopython": True, "boundscheck": None, "no_cpython_wrapper": True}


def kernel(function: Any) -> Any:
    """Compile a function that Python calls, cached on disk; it must not allocate arrays."""
    return njit(cache=True, **_PLAIN)(function)


def part(function: Any) -> Any:
    """Compile as a part of kernels; it must not allocate arrays nor raise."""
    return _Part(function, targetoptions=dict(_PART), pipeline_class=_Compiler)


def inlined(function: Any) -> Any:
    """Compile as ``part`` does, and inline the function."""
    return _Part(function, targetoptions=_PART | {"forceinline": True}, pipeline_class=_Compiler)


class _Part(CPUDispatcher):  # type: ignore[misc]
    """A function that only kernels can call."""

    def __call__(self, *_: Any) -> Any:
        raise TypeError(f"{self.py_func.__name__} is a part of kernels: a kernel calls it, Python cannot")


class _Compiler(CompilerBase):  # type: ignore[misc]
    """numba's pipeline without passes that a part does not need: closures, exceptions, array expressions."""

    def define_pipelines(self) -> Any:
        if self.state.library is None:
            codegen, name = self.state.targetctx.codegen(), self.state.func_id.func_qualname
            self.state.library = _Unfinished(codegen, name)  # type: ignore[no-untyped-call]
        passes = PassManager("part")  # type: ignore[no-untyped-call]
        for one in (
            TranslateByteCode, FixupArgs, IRProcessing, ReconstructSSA, NopythonTypeInference, PreLowerStripPhis,
            IRLegalization, AnnotateTypes, NativeLowering, NoPythonBackend,
        ):  # fmt: skip
            passes.add_pass(one, one.__name__)  # type: ignore[no-untyped-call]
        passes.finalize()  # type: ignore[no-untyped-call]
        return [passes]


class _Unfinished(JITCodeLibrary):  # type: ignore[misc]
    """A function's intermediate code, which is optimised and translated to machine code together with its callers."""

    @property
    def codegen(self) -> Any:
        return _NO_ENVIRONMENT

    def get_pointer_to_function(self, name: str) -> int:
        return 0

    def _optimize_functions(self, ll_module: Any) -> None:
        ll_module.data_layout = self._codegen._data_layout

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalized = True


class _NoEnvironment:
    """Replaces the environment that numba gives to functions called from Python; a part needs none."""

    def set_env(self, name: str, environment: Any) -> None:
        pass


_NO_ENVIRONMENT = _NoEnvironment()


class BundleAddress(types.Type):
    """The type of the address of a NamedTuple; a field that is a NamedTuple is also an address."""

    def __init__(self, bundle: Any) -> None:
        self.bundle = bundle  # its name becomes a digest, because type names are part of all compiled code
        digest = hashlib.sha256(bundle.name.encode()).hexdigest()[:12]
        super().__init__(f"{bundle.instance_class.__name__}_{digest}")  # type: ignore[no-untyped-call]

    def field(self, name: str) -> Any:
        """Return the type of a field, or None if there is no field of that name."""
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
