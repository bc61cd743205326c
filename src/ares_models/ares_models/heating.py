# SPDX-License-Identifier: Apache-2.0
"""Free molecular heating of the fairing (Eqs. 2.2 and 2.3)."""


def free_molecular_heating(density: float, relative_speed: float) -> float:
    """Compute the free molecular heating 0.5 rho V_rel^3, W/m2.

    Args:
        density: kg/m3.
        relative_speed: relative to the air, m/s.
    """
    return 0.5 * density * relative_speed**3
