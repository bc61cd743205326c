# SPDX-License-Identifier: Apache-2.0
"""Two forms of a kernel: bitcode that other kernels link, and machine code that Python calls.

numba makes both for every function, although most kernels are called only by other kernels, which
copy their code. Here machine code, with the conversion of Python's arguments, is made only for a
kernel that Python calls. This module alone uses parts of numba that are not public.
"""

import threading
from collections.abc import Callable
from contextlib import suppress
from functools import cache, cached_property, update_wrapper
from types import FunctionType
from typing import Any

import llvmlite.binding as llvm
from numba.core import types
from numba.core.caching import CompileResultCacheImpl, FunctionCache
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.registry import CPUDispatcher
from numba.core.runtime.nrt import rtsys

_lock = threading.Lock()

# numba spells out every field of every record of a named tuple in the symbol of each kernel
# that takes one, which doubles the machine code on disk
types.NamedTuple.mangling_args = property(  # type: ignore[assignment, method-assign]
    lambda self: (self.instance_class.__name__, tuple(self.types))
)


def counting(references: bool) -> dict[str, Any]:
    """Return the option of a kernel that counts references to arrays, or does not."""
    return {"_nrt": references}


class _LinkedLibrary(JITCodeLibrary):
    """Hold bitcode for linking, without machine code."""

    def _optimize_final_module(self) -> None:
        """Skip the optimisation: the caller's library optimises all linked code at once."""

    def _finalize_final_module(self) -> None:
        module = self._final_module
        for function in module.functions:
            if not function.is_declaration and function.linkage == llvm.Linkage.external:
                function.linkage = "linkonce_odr"
        self._shared_module = module
        # numba writes the environment pointer of each function, even if nothing reads it
        names = [each.name for each in module.global_variables]
        self._final_module = llvm.parse_assembly(
            "\n".join(
                f"@{name} = common global i8* null"
                for name in names
                if name.startswith("_ZN08NumbaEnv")
            )
        )
        super()._finalize_final_module()


class _ClosedLibrary(JITCodeLibrary):
    """Hold machine code that no other library links.

    Its kernels are marked internal, so that LLVM inlines them or drops unused arguments: passing
    arrays took a sixth of a flight.
    """

    def _optimize_final_module(self) -> None:
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage == llvm.Linkage.linkonce_odr:
                function.linkage = "internal"
        super()._optimize_final_module()


class _Compiler(Compiler):
    """Compile into a library of class ``kind``."""

    kind: type[JITCodeLibrary]

    def compile_extra(self, func: FunctionType) -> Any:
        library = self.kind(self.state.targetctx.codegen(), func.__qualname__)
        library.enable_object_caching()
        self.state.library = library
        return super().compile_extra(func)


class _LinkedCompiler(_Compiler):
    kind = _LinkedLibrary


class _ClosedCompiler(_Compiler):
    kind = _ClosedLibrary


class _LinkedDispatcher(CPUDispatcher):
    def enable_caching(self) -> None:
        """Keep what is compiled on disk."""
        self._cache = _Cache(self.py_func)

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """Treat a literal as a number: numba would compile the kernel again for each value."""
        named = {name: types.unliteral(kind) for name, kind in kws.items()}
        return super().get_call_template([types.unliteral(kind) for kind in args], named)


class _Cache(FunctionCache):
    """Cache compiled kernels on disk; a kernel that cannot be saved is used all the same."""

    def save_overload(self, sig: Any, data: Any) -> None:
        """Save a kernel if there is room; numba leaves no partial file."""
        with suppress(OSError):
            super().save_overload(sig, data)


@cache
def _no_bitcode() -> bytes:
    return bytes(llvm.parse_assembly("").as_bitcode())


class _CodeAlone(CompileResultCacheImpl):
    """Load machine code without the bitcode that is kept beside it, which nothing would link.

    To read it takes two thirds of the time of loading a kernel.
    """

    def rebuild(self, target_context: Any, payload: Any) -> Any:
        """Return the compiled kernel; name its functions, which numba would seek in the bitcode."""
        (name, kind, data), description, *rest = payload
        if kind == "object":
            data = (data[0], _no_bitcode())
            target_context.codegen()._engine._defined_symbols |= {
                description.llvm_func_name,
                description.llvm_cpython_wrapper_name,
            }
        return super().rebuild(target_context, ((name, kind, data), description, *rest))


class _MachineCode(_Cache):
    """Load machine code from disk without importing numba's compiler (0.3 s)."""

    _impl_class = _CodeAlone  # type: ignore[assignment]

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Load a kernel; a later compilation imports the compiler then."""
        # runtime functions that allocating kernels call, directly or indirectly
        rtsys.initialize(target_context)
        with self._guard_against_spurious_io_errors():
            return self._load_overload(sig, target_context)


class _MachineCodeDispatcher(CPUDispatcher):
    def __init__(self, function: FunctionType, options: dict[str, Any]) -> None:
        super().__init__(function, targetoptions=options, pipeline_class=_ClosedCompiler)
        self._cache = _MachineCode(function)

    def _compilation_chain_init_hook(self) -> None:
        """Skip the search for extensions of numba in all installed packages (0.02 s)."""


class Kernel:
    """Wrap a function for calls from Python; kernels that call it link :attr:`linked`.

    numba's dispatcher is made at the first call: making those of some hundred kernels, of which a
    process calls a few, takes 0.1 s.
    """

    def __init__(self, function: Callable[..., object], options: dict[str, Any]) -> None:
        update_wrapper(self, function)
        assert isinstance(function, FunctionType)
        self.py_func = function
        self._options = {**options, "nopython": True, "boundscheck": None, "no_cfunc_wrapper": True}
        self._machine_code: CPUDispatcher | None = None

    def __call__(self, *arguments: object, **named: object) -> Any:
        """Call the compiled function."""
        return (self._machine_code or self.machine_code)(*arguments, **named)

    @property
    def machine_code(self) -> CPUDispatcher:
        """Return numba's dispatcher for calls from Python."""
        with _lock:
            if self._machine_code is None:
                self._machine_code = _MachineCodeDispatcher(self.py_func, self._options)
        return self._machine_code

    @cached_property
    def linked(self) -> Any:
        """Return numba's dispatcher for calls from kernels; made only when something compiles."""
        function = self.py_func
        copy = FunctionType(
            function.__code__,
            function.__globals__,
            function.__name__,
            function.__defaults__,
            function.__closure__,
        )
        # numba derives the name of the cache file from it
        copy.__qualname__ = f"{function.__qualname__}.linked"
        dispatcher = _LinkedDispatcher(
            copy,
            targetoptions={**self._options, "no_cpython_wrapper": True},
            pipeline_class=_LinkedCompiler,
        )
        dispatcher.enable_caching()
        return dispatcher

    @property
    def _numba_type_(self) -> types.Dispatcher:
        return types.Dispatcher(self.linked)
