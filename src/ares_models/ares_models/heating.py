# SPDX-License-Identifier: Apache-2.0
"""Free molecular heating of the fairing (Eqs. 2.2 and 2.3)."""

#: BTU per ft lbf, 1 / 777.65. The thesis' "empirical constant" c of Eq. 2.2.
BTU_PER_FOOT_POUND = 0.00128593

#: W/m2 in one BTU/ft2/s.
WATT_PER_M2_PER_BTU_PER_FT2_S = 11356.5

#: Usual heating limit of a fairing, W/m2: 0.1 BTU/ft2/s. Eq. 3.2 prints 1.135e3 J/ft2/s, a wrong
#: unit.
USUAL_FAIRING_LIMIT = 1135.0


def free_molecular_heating(density: float, relative_speed: float) -> float:
    """Compute the free molecular heating 0.5 rho V_rel^3, W/m2.

    Args:
        density: kg/m3.
        relative_speed: relative to the air, m/s.
    """
    return 0.5 * density * relative_speed**3
