"""The one decorator under which every compiled kernel of the project lives."""

import os
from collections.abc import Callable
from typing import TypeVar, cast

from ares_models.kernel_cache import VARIABLE, choose_folder

# numba reads it when it is imported
if not os.environ.get(VARIABLE):
    os.environ[VARIABLE] = str(choose_folder())

import numba

_Function = TypeVar("_Function", bound=Callable[..., object])


def kernel(function: _Function) -> _Function:
    """Compile ``function`` with numba, cached on disk, with IEEE arithmetic.

    Division by zero gives inf or nan as in NumPy; a kernel raises no Python
    exception and reports trouble in what it returns.
    """
    compiled = numba.njit(cache=True, error_model="numpy", nogil=True)(function)
    return cast(_Function, compiled)
