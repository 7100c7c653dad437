"""Functions that are compiled only as parts of the kernels that call them, which compiles three times faster.

numba optimises every function that a kernel calls together with all its callees, turns it into machine code with
wrappers for Python, and then does the same for the caller with everything once more.  A kernel of thirty functions,
eight calls deep, takes a minute.  A part is only typed and turned into LLVM's intermediate code; the kernel is linked,
optimised and turned into machine code once.
"""

from typing import Any

from numba import njit
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase
from numba.core.compiler_machinery import PassManager
from numba.core.registry import CPUDispatcher
from numba.core.typed_passes import (
    AnnotateTypes,
    IRLegalization,
    NativeLowering,
    NoPythonBackend,
    NopythonTypeInference,
    PreLowerStripPhis,
)
from numba.core.untyped_passes import FixupArgs, IRProcessing, ReconstructSSA, TranslateByteCode

# Neither allocates arrays, so reference counting is off: it would cost more than the arithmetic of an inner kernel.
_PLAIN: dict[str, Any] = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True, "_nrt": False}
_PART: dict[str, Any] = _PLAIN | {"nopython": True, "boundscheck": None, "no_cpython_wrapper": True}


def kernel(function: Any) -> Any:
    """Compile a function that Python calls, cached on disk; it must not allocate arrays."""
    return njit(cache=True, **_PLAIN)(function)


def part(function: Any) -> Any:
    """Compile as a part of kernels; it must not allocate arrays nor raise."""
    return _Part(function, targetoptions=dict(_PART), pipeline_class=_Compiler)


def inlined(function: Any) -> Any:
    """Compile as ``part`` does, and inline it."""
    return _Part(function, targetoptions=_PART | {"forceinline": True}, pipeline_class=_Compiler)


class _Part(CPUDispatcher):  # type: ignore[misc]
    """A function that only kernels can call."""

    def __call__(self, *_: Any) -> Any:
        raise TypeError(f"{self.py_func.__name__} is a part of kernels: a kernel calls it, Python cannot")


class _Compiler(CompilerBase):  # type: ignore[misc]
    """numba's pipeline without the passes that a part does not need: closures, exceptions, array expressions."""

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
    """A function's intermediate code, which is optimised and turned into machine code together with its callers'."""

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
    """Replaces the environment that numba gives to functions which Python calls; a part needs none."""

    def set_env(self, name: str, environment: Any) -> None:
        pass


_NO_ENVIRONMENT = _NoEnvironment()
