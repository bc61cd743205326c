# SPDX-License-Identifier: Apache-2.0
"""Compute the steering law after a heating-limited jettison: Eqs. 3.44-3.51, corrected.

The printed equations take the heating for a function of position alone. It depends on the
velocity too. With N = log heating

    lambda_r(+) = lambda_r(-) - pi N_r,    lambda_v(+) = lambda_v(-) - pi N_v,

and pi keeps H = lambda_r . V + lambda_v . g + |lambda_v| T/m the same across the mass drop
(the mass costate meets the same flow on both sides). With N in place of the rate itself,
pi here is that of Eq. 3.50 times the heating rate.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import ALTITUDE_SPHERICAL, Record
from ares_models.jit import allocating, kernel
from ares_models.kernels.vectors import quotient

# inputs of the jump: r, V, lambda_v, its rate, thrust acceleration before and after
JUMP_INPUTS = 14
JUMP_OUTPUTS = 7
_STEP = 1e-30


@kernel
def heating_slopes(x: NDArray[Any], environment: Record, atmosphere: NDArray[np.float64]) -> Any:
    """Compute the gradients of log heating for float or complex arguments.

    Args:
        x: shape (>= 6,), position m and velocity m/s, float or complex.

    Returns:
        N_r in 1/m and N_v in s/m, six numbers.
    """
    square = x[0] * x[0] + x[1] * x[1] + x[2] * x[2]
    radius = np.sqrt(square)
    up0 = x[0] / radius
    up1 = x[1] / radius
    up2 = x[2] / radius
    height = radius - environment.equatorial_radius
    if environment.altitude_model != ALTITUDE_SPHERICAL:
        ratio = environment.polar_radius / environment.equatorial_radius
        k = 1.0 - ratio * ratio
        s = up2 * up2
        base = 1.0 - k * (1.0 - s)
        root = np.sqrt(base)
        height = radius - environment.polar_radius / root
        a = environment.polar_radius * k * up2 / (base * root * radius)
        up0 = up0 - a * up2 * up0
        up1 = up1 - a * up2 * up1
        up2 = up2 - a * s + a
    low = 0
    high = atmosphere.shape[0]
    while high - low > 1:
        middle = (low + high) // 2
        if height.real >= atmosphere[middle, 0]:
            low = middle
        else:
            high = middle
    y = height - atmosphere[low, 0]
    slope = atmosphere[low, 2] + 0.0 * y
    if y.real > 0.0:
        slope = atmosphere[low, 2] + y * (2.0 * atmosphere[low, 3] + y * (3.0 * atmosphere[low, 4]))
    rate = environment.rotation_rate
    w0 = x[3] + rate * x[1]
    w1 = x[4] - rate * x[0]
    w2 = x[5]
    q = quotient(3.0 + 0.0 * w0, w0 * w0 + w1 * w1 + w2 * w2)
    return (
        slope * up0 - rate * q * w1,
        slope * up1 + rate * q * w0,
        slope * up2,
        q * w0,
        q * w1,
        q * w2,
    )


@kernel
def jump(
    x: NDArray[Any], environment: Record, atmosphere: NDArray[np.float64], y: NDArray[Any]
) -> None:
    """Compute the costates after the jettison from those before.

    Args:
        x: shape (JUMP_INPUTS,), float or complex: position m, velocity m/s, lambda_v, its
            rate -lambda_r (1/s), T/m before and after, m/s2. lambda_v at any scale.
        y: shape (JUMP_OUTPUTS,), written: lambda_v and its rate after, and pi for N = log
            heating, in the scale of lambda_v times m/s per unit of N.
    """
    n0, n1, n2, n3, n4, n5 = heating_slopes(x, environment, atmosphere)
    square = x[0] * x[0] + x[1] * x[1] + x[2] * x[2]
    k = -environment.mu / (square * np.sqrt(square))
    drift = n0 * x[3] + n1 * x[4] + n2 * x[5] + k * (n3 * x[0] + n4 * x[1] + n5 * x[2])
    size2 = x[6] * x[6] + x[7] * x[7] + x[8] * x[8]
    size = np.sqrt(size2)
    along = x[6] * n3 + x[7] * n4 + x[8] * n5
    before = x[12]
    after = x[13]
    # after^2 |lambda - pi N_v|^2 = (before |lambda| + pi drift)^2, the root near zero
    a = after * after * (n3 * n3 + n4 * n4 + n5 * n5) - drift * drift
    b = after * after * along + before * size * drift
    c = (after * after - before * before) * size2
    inside = b * b - a * c
    if inside.real < 0.0:
        inside = 0.0 * inside
    root = np.sqrt(inside)
    if b.real < 0.0:
        root = -root
    # pi = 0 without thrust
    pi = quotient(c, b + root)
    y[0] = x[6] - pi * n3
    y[1] = x[7] - pi * n4
    y[2] = x[8] - pi * n5
    y[3] = x[9] + pi * n0
    y[4] = x[10] + pi * n1
    y[5] = x[11] + pi * n2
    y[6] = pi


@allocating
def jump_jacobian(
    x: NDArray[np.float64],
    environment: Record,
    atmosphere: NDArray[np.float64],
    jacobian: NDArray[np.float64],
) -> None:
    """Differentiate :func:`jump` by complex step, exact to rounding.

    Args:
        x: shape (JUMP_INPUTS,).
        jacobian: shape (JUMP_OUTPUTS, JUMP_INPUTS), written.
    """
    z = np.empty(JUMP_INPUTS, np.complex128)
    y = np.empty(JUMP_OUTPUTS, np.complex128)
    for i in range(JUMP_INPUTS):
        z[i] = x[i]
    for i in range(JUMP_INPUTS):
        z[i] = complex(x[i], _STEP)
        jump(z, environment, atmosphere, y)
        z[i] = x[i]
        for k in range(JUMP_OUTPUTS):
            jacobian[k, i] = y[k].imag / _STEP
