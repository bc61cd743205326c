# SPDX-License-Identifier: Apache-2.0
"""A kernel has two forms: what other kernels link, and what Python calls.

numba makes of every function both at once, and machine code of its own for each, though most
kernels are called by kernels alone, with their code copied into the caller's. Here machine code,
and what converts Python's arguments, is made only for a kernel that Python calls.
"""

import threading
from collections.abc import Callable
from contextlib import suppress
from functools import cached_property, update_wrapper
from types import FunctionType
from typing import Any

import llvmlite.binding as llvm
from numba.core import types
from numba.core.caching import FunctionCache
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.registry import CPUDispatcher
from numba.core.runtime.nrt import rtsys

_lock = threading.Lock()


class _LinkedLibrary(JITCodeLibrary):
    """Bitcode for those who link it, and no machine code."""

    def _optimize_final_module(self) -> None:
        """Leave it to what Python calls, where all is optimised as one."""

    def _finalize_final_module(self) -> None:
        module = self._final_module
        for function in module.functions:
            if not function.is_declaration and function.linkage == llvm.Linkage.external:
                function.linkage = "linkonce_odr"
        self._shared_module = module
        # where numba keeps the environments of functions: it sets them, read or not
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
    """Machine code that nobody links: nobody else calls the kernels in it.

    Said so, they are copied into their callers, or get only the arguments that they read: a
    sixth of a flight was handing over arrays.
    """

    def _optimize_final_module(self) -> None:
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage == llvm.Linkage.linkonce_odr:
                function.linkage = "internal"
        super()._optimize_final_module()


class _Compiler(Compiler):
    """Compiles into a library of another kind."""

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
        """Take a literal for a number: numba would compile the kernel anew for each."""
        named = {name: types.unliteral(kind) for name, kind in kws.items()}
        return super().get_call_template([types.unliteral(kind) for kind in args], named)


class _Cache(FunctionCache):
    """Compiled kernels on disk; one that finds no room there is used all the same."""

    def save_overload(self, sig: Any, data: Any) -> None:
        """See the base class; numba leaves no part of a file behind."""
        with suppress(OSError):
            super().save_overload(sig, data)


class _MachineCode(_Cache):
    """What is on disk, loaded without all that numba compiles with: 0.3 s of imports."""

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """See the base class; whoever compiles after all imports the rest then."""
        # what kernels that make arrays call, and those that call them in turn
        rtsys.initialize(target_context)
        with self._guard_against_spurious_io_errors():
            return self._load_overload(sig, target_context)


class _MachineCodeDispatcher(CPUDispatcher):
    def __init__(self, function: FunctionType, options: dict[str, Any]) -> None:
        super().__init__(function, targetoptions=options, pipeline_class=_ClosedCompiler)
        self._cache = _MachineCode(function)

    def _compilation_chain_init_hook(self) -> None:
        """Look for no extensions of numba in all that is installed: 0.02 s."""


class Kernel:
    """What Python calls; kernels that call it link :attr:`linked`.

    It becomes one of numba's functions when it is called: to make that of each of some hundred
    kernels, of which a process calls a few, takes 0.1 s.
    """

    def __init__(self, function: Callable[..., object], options: dict[str, Any]) -> None:
        update_wrapper(self, function)
        assert isinstance(function, FunctionType)
        self.py_func = function
        self._options = {**options, "nopython": True, "boundscheck": None, "no_cfunc_wrapper": True}
        self._machine_code: CPUDispatcher | None = None

    def __call__(self, *arguments: object, **named: object) -> Any:
        """As the function that it was made of."""
        return (self._machine_code or self.machine_code)(*arguments, **named)

    @property
    def machine_code(self) -> CPUDispatcher:
        """numba's function."""
        with _lock:
            if self._machine_code is None:
                self._machine_code = _MachineCodeDispatcher(self.py_func, self._options)
        return self._machine_code

    @cached_property
    def linked(self) -> Any:
        """The other form; most processes compile nothing."""
        function = self.py_func
        copy = FunctionType(
            function.__code__,
            function.__globals__,
            function.__name__,
            function.__defaults__,
            function.__closure__,
        )
        # numba names the file of what it caches after it
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
