"""The one decorator under which every compiled kernel of the project lives."""

import importlib.util
import os
import sys
import threading
from collections.abc import Callable, Iterable
from pathlib import Path
from types import ModuleType
from typing import TypeVar, cast

from ares_models.kernel_cache import PREFIX, VARIABLE, choose_folder, read_package, state_of

# numba reads it when it is imported
if not os.environ.get(VARIABLE):
    os.environ[VARIABLE] = str(choose_folder())

import numba

_lock = threading.RLock()
_copies: set[str] = set()
_Function = TypeVar("_Function", bound=Callable[..., object])


def kernel(function: _Function) -> _Function:
    """Compile ``function`` with numba, cached on disk, with IEEE arithmetic.

    Division by zero gives inf or nan as in NumPy; a kernel raises no Python
    exception and reports trouble in what it returns.
    """
    if function.__module__ in _copies:
        # numba names the file of the machine code after source file and function
        function.__qualname__ = f"{function.__module__}.{function.__qualname__}"
    compiled = numba.njit(cache=True, error_model="numpy", nogil=True)(function)
    return cast(_Function, compiled)


def specialised(module: str, suffix: str, **names: object) -> ModuleType:
    """A module of kernels once more, in which some names mean something else.

    numba compiles a call into its caller: who calls something else is another kernel, with
    machine code of its own.

    Args:
        module: full name of the module.
        suffix: what the name of the copy ends with.
        names: kernels and numbers, by the names in the module that they replace.
    """
    name = "_".join([module, suffix, *_states_of_others(names.values())])
    with _lock:
        if name not in sys.modules:
            spec = importlib.util.find_spec(module)
            assert spec is not None and spec.origin is not None
            copied = importlib.util.spec_from_file_location(name, spec.origin)
            assert copied is not None and copied.loader is not None
            copy = importlib.util.module_from_spec(copied)
            sys.modules[name] = copy
            _copies.add(name)
            copied.loader.exec_module(copy)
            vars(copy).update(names)
        return sys.modules[name]


def _states_of_others(values: Iterable[object]) -> list[str]:
    """States of the sources of kernels that the folder of the cache does not depend on."""
    packages = {value.__module__.partition(".")[0] for value in values if callable(value)}
    states = []
    for package in sorted(packages):
        spec = importlib.util.find_spec(package)
        if package.startswith(PREFIX) or spec is None or spec.origin is None:
            continue
        origin = Path(spec.origin)
        is_package = origin.name == "__init__.py"
        texts = read_package(origin.parent) if is_package else {package: origin.read_text("utf-8")}
        states.append(state_of(texts))
    return states
