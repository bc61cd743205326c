"""The one decorator under which every compiled kernel of the project lives."""

from collections.abc import Callable
from typing import TypeVar, cast

import numba

_Function = TypeVar("_Function", bound=Callable[..., object])


def kernel(function: _Function) -> _Function:
    """Compile ``function`` with numba, cached on disk, with IEEE arithmetic.

    Division by zero gives inf or nan as in NumPy; a kernel raises no Python
    exception and reports trouble in what it returns.
    """
    compiled = numba.njit(cache=True, error_model="numpy", nogil=True)(function)
    return cast(_Function, compiled)
