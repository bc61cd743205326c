# SPDX-License-Identifier: Apache-2.0
"""Decorators of all compiled kernels of the project.

With ``ARES_PLAIN_NUMBA=1`` kernels are compiled by numba's public ``njit(cache=True)`` alone, which
takes several times as long and gives the same numbers: it flies on where a new numba has changed
the parts that :mod:`.linked` builds on.
"""

import importlib.util
import os
import sys
import threading
from collections.abc import Callable, Iterable
from pathlib import Path
from types import ModuleType
from typing import Any, TypeVar, cast

from ares_models.kernel_cache import (
    PREFIX,
    VARIABLE,
    cache_folder,
    is_plain,
    read_package,
    state_of,
)

# numba reads the variable at its import
os.environ[VARIABLE] = str(cache_folder())

import numba

#: Leave numba's private parts out.
PLAIN = is_plain()
if not PLAIN:
    from ares_models.linked import Kernel, counting

IEEE = {"error_model": "numpy"}
_lock = threading.RLock()
#: Specialised copies by name, with the source states of kernels from other projects in them.
_copies: dict[str, set[str]] = {}
_Function = TypeVar("_Function", bound=Callable[..., object])


def kernel(function: _Function) -> _Function:
    """Compile ``function`` with numba, cached on disk, with IEEE arithmetic.

    Division by zero gives inf or nan as in NumPy; a kernel raises no Python exception and
    reports errors in its return value. It works on arrays of its caller and counts no references
    to them; a kernel that makes arrays needs :func:`allocating`.
    """
    return _compiled(function, counts_references=False)


def allocating(function: _Function) -> _Function:
    """Compile a kernel that makes arrays of its own."""
    return _compiled(function, counts_references=True)


def _compiled(function: _Function, counts_references: bool) -> _Function:
    if function.__module__ in _copies:
        # numba derives the name of the cache file from source file and function name
        function.__qualname__ = f"{function.__module__}.{function.__qualname__}"
    options: dict[str, Any] = {**IEEE, "nogil": True}
    if PLAIN:
        return cast(_Function, numba.njit(cache=True, **options)(function))
    return cast(_Function, Kernel(function, options | counting(counts_references)))


def inlined(function: _Function) -> _Function:
    """Compile a kernel by inlining it in each caller.

    Needed for a function that builds a tuple of records: numba can pass such a tuple to a
    function, but not return it from one.
    """
    options = IEEE if PLAIN else IEEE | counting(False)
    return cast(_Function, numba.njit(inline="always", **options)(function))


def specialised(module: str, suffix: str, **names: object) -> ModuleType:
    """Import a copy of a module of kernels with some of its names replaced.

    numba compiles a call into its caller: a caller of another kernel needs machine code of its
    own.

    Args:
        module: full name of the module.
        suffix: end of the copy's name.
        names: replacements, kernels and numbers, by name in the module.
    """
    states = _states_of_others(names.values())
    name = "_".join([module, suffix, *sorted(states)])
    with _lock:
        if name not in sys.modules:
            spec = importlib.util.find_spec(module)
            assert spec is not None and spec.origin is not None
            copied = importlib.util.spec_from_file_location(name, spec.origin)
            assert copied is not None and copied.loader is not None
            copy = importlib.util.module_from_spec(copied)
            sys.modules[name] = copy
            _copies[name] = states
            copied.loader.exec_module(copy)
            vars(copy).update(names)
        return sys.modules[name]


def _states_of_others(values: Iterable[object]) -> set[str]:
    """Return the source states of kernels that the name of the cache folder does not cover."""
    states: set[str] = set()
    for module in {value.__module__ for value in values if callable(value)}:
        package = module.partition(".")[0]
        if module in _copies:
            states |= _copies[module]
        elif not package.startswith(PREFIX):
            spec = importlib.util.find_spec(package)
            if spec is not None and spec.origin is not None:
                states.add(_state_of_package(Path(spec.origin), package))
    return states


def _state_of_package(origin: Path, name: str) -> str:
    """Return the source state of a package or of a single-file module."""
    if origin.name == "__init__.py":
        return state_of(read_package(origin.parent))
    return state_of({name: origin.read_text("utf-8")})
