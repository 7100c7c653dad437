"""Parts of kernels: compiled into the kernels that call them, and into nothing else.

numba makes every function that a kernel calls a whole program: it optimises it together with all that it calls, turns
that into machine code, lays wrappers about it by which Python could call it, and then does the same for its caller,
with all of it once more.  A kernel of thirty functions, eight calls deep, so takes a minute.  A part is only typed and
turned into LLVM's language; the kernel at the top is linked, optimised and turned into machine code once: a third of
that.
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

# Neither makes arrays, so nothing is counted, which costs more than an inner kernel's sums.
_PLAIN: dict[str, Any] = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True, "_nrt": False}
_PART: dict[str, Any] = _PLAIN | {"nopython": True, "boundscheck": None, "no_cpython_wrapper": True}


def kernel(function: Any) -> Any:
    """Compile as a function that Python calls, kept on disk; it makes no arrays."""
    return njit(cache=True, **_PLAIN)(function)


def part(function: Any) -> Any:
    """Compile as a part of kernels; it makes no arrays and raises nothing."""
    return _Part(function, targetoptions=dict(_PART), pipeline_class=_Compiler)


def inlined(function: Any) -> Any:
    """Compile as ``part`` does, into its callers' own code."""
    return _Part(function, targetoptions=_PART | {"forceinline": True}, pipeline_class=_Compiler)


class _Part(CPUDispatcher):  # type: ignore[misc]
    """A function that kernels call; Python cannot."""

    def __call__(self, *_: Any) -> Any:
        """Refuse."""
        raise TypeError(f"{self.py_func.__name__} is a part of kernels: a kernel calls it, Python cannot")


class _Compiler(CompilerBase):  # type: ignore[misc]
    """numba's way without the passes for what a part does not have: closures, exceptions, array expressions."""

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
    """A function's code, not optimised and not turned into machine code: that is done with its callers'."""

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
    """Where numba lays what a function that Python calls needs of Python; a part needs nothing."""

    def set_env(self, name: str, environment: Any) -> None:
        pass


_NO_ENVIRONMENT = _NoEnvironment()
