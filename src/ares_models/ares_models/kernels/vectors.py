# SPDX-License-Identifier: Apache-2.0
"""Three-vectors as tuples of floats, which stay in registers."""

import math
from typing import Any, TypeVar

from numpy.typing import NDArray

from ares_models.jit import kernel

Vector = tuple[float, float, float]
#: Vector of a complex step: the imaginary part is a derivative.
ComplexVector = tuple[complex, complex, complex]
_X = TypeVar("_X", float, complex)


@kernel
def quotient(a: complex, b: complex) -> complex:
    """Divide complex numbers; return nan for a zero divisor.

    numba raises there, whatever its error model.
    """
    return a / b if b != 0.0 else a * math.nan


@kernel
def load(a: NDArray[Any]) -> Vector:
    """Return the first three elements of an array as a tuple."""
    return (a[0], a[1], a[2])


@kernel
def store(a: NDArray[Any], x: Vector) -> None:
    """Write a tuple into the first three elements of an array."""
    a[0] = x[0]
    a[1] = x[1]
    a[2] = x[2]


@kernel
def add(x: Vector, y: Vector) -> Vector:
    """Return x + y."""
    return (x[0] + y[0], x[1] + y[1], x[2] + y[2])


@kernel
def sub(x: Vector, y: Vector) -> Vector:
    """Return x - y."""
    return (x[0] - y[0], x[1] - y[1], x[2] - y[2])


@kernel
def scale(s: _X, x: tuple[_X, _X, _X]) -> tuple[_X, _X, _X]:
    """Return s x."""
    return (s * x[0], s * x[1], s * x[2])


@kernel
def axpy(s: _X, x: tuple[_X, _X, _X], y: tuple[_X, _X, _X]) -> tuple[_X, _X, _X]:
    """Return s x + y."""
    return (s * x[0] + y[0], s * x[1] + y[1], s * x[2] + y[2])


@kernel
def dot(x: tuple[_X, _X, _X], y: tuple[_X, _X, _X]) -> _X:
    """Return the dot product x . y."""
    return x[0] * y[0] + x[1] * y[1] + x[2] * y[2]


@kernel
def cross(x: tuple[_X, _X, _X], y: tuple[_X, _X, _X]) -> tuple[_X, _X, _X]:
    """Return the cross product of x and y."""
    return (
        x[1] * y[2] - x[2] * y[1],
        x[2] * y[0] - x[0] * y[2],
        x[0] * y[1] - x[1] * y[0],
    )


@kernel
def norm(x: Vector) -> float:
    """Return the length |x|."""
    return math.sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2])


@kernel
def unit(x: Vector) -> Vector:
    """Return the unit vector x / |x|; nan for the zero vector."""
    return scale(1.0 / norm(x), x)


@kernel
def angle_between(x: Vector, y: Vector) -> float:
    """Return the angle between two vectors, rad, accurate for small angles too."""
    return math.atan2(norm(cross(x, y)), dot(x, y))


@kernel
def turned_beyond(limit: float, x: Vector, y: Vector) -> bool:
    """Return whether the angle between two vectors is larger than ``limit``, rad.

    An angle is at most its tangent; the arc tangent is computed only if that is above the limit.
    """
    return not norm(cross(x, y)) <= limit * dot(x, y) and angle_between(x, y) > limit


@kernel
def is_finite(x: Vector) -> bool:
    """Return whether all components are finite."""
    return math.isfinite(x[0]) and math.isfinite(x[1]) and math.isfinite(x[2])
