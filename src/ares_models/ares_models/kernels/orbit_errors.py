"""By how much a state misses the size and shape that a target names, and how much it may.

What may be missed is what the errors that are allowed to a state come to: radius, speed and
flight-path angle off by their tolerance each move an apogee far and a perigee little.
"""

import math

from ares_models.arrays import (
    NAMES_APOGEE,
    NAMES_C3,
    NAMES_ECCENTRICITY,
    NAMES_PERIGEE,
    NAMES_SEMI_MAJOR_AXIS,
    NAMES_TRUE_ANOMALY,
    Record,
)
from ares_models.jit import kernel
from ares_models.kernels.targets import names
from ares_models.tolerances import FLIGHT_PATH_ANGLE_DEG, RADIUS_M, SPEED_M_S

#: Perigee radius m, apogee radius m, semi-major axis m, eccentricity, C3 m2/s2, true anomaly rad.
Figures = tuple[float, float, float, float, float, float]

_ANGLE = math.radians(FLIGHT_PATH_ANGLE_DEG)


@kernel
def orbit_figures(radius: float, speed: float, angle: float, mu: float) -> Figures:
    """Size, shape and place of the orbit of a state; an escape's apogee is inf."""
    c3 = speed * speed - 2.0 * mu / radius
    momentum = radius * speed * math.cos(angle)
    parameter = momentum * momentum / mu
    towards = parameter / radius - 1.0
    ahead = momentum * speed * math.sin(angle) / mu
    e = math.hypot(towards, ahead)
    apogee = parameter / (1.0 - e) if e < 1.0 else math.inf
    return parameter / (1.0 + e), apogee, -mu / c3, e, c3, math.atan2(ahead, towards)


@kernel
def _moved(now: Figures, then: Figures) -> Figures:
    """How far each figure moves."""
    turn = then[5] - now[5]
    return (
        abs(then[0] - now[0]),
        abs(then[1] - now[1]),
        abs(then[2] - now[2]),
        abs(then[3] - now[3]),
        abs(then[4] - now[4]),
        abs(math.atan2(math.sin(turn), math.cos(turn))),
    )


@kernel
def _off(target: Record, element: int, found: float, wanted: float) -> float:
    """Flown minus target; nan where the element is free."""
    return found - wanted if names(target, element) else math.nan


@kernel
def orbit_errors(
    target: Record, mu: float, radius: float, speed: float, angle: float
) -> tuple[Figures, Figures]:
    """Errors of what a target of kind TARGET_ELEMENTS names, nan for the rest, and limits.

    Args:
        target: record TARGET.
        mu: m3/s2.
        radius: m, flown.
        speed: m/s, flown.
        angle: flight-path angle, rad, flown.

    Returns:
        flown minus target, and how much of it is allowed.
    """
    found = orbit_figures(radius, speed, angle, mu)
    a = _moved(found, orbit_figures(radius + RADIUS_M, speed, angle, mu))
    b = _moved(found, orbit_figures(radius, speed + SPEED_M_S, angle, mu))
    c = _moved(found, orbit_figures(radius, speed, angle + _ANGLE, mu))
    turn = found[5] - target.true_anomaly
    turn = math.atan2(math.sin(turn), math.cos(turn))
    errors = (
        _off(target, NAMES_PERIGEE, found[0], target.perigee_radius),
        _off(target, NAMES_APOGEE, found[1], target.apogee_radius),
        _off(target, NAMES_SEMI_MAJOR_AXIS, found[2], target.semi_major_axis),
        _off(target, NAMES_ECCENTRICITY, found[3], target.eccentricity),
        _off(target, NAMES_C3, found[4], target.c3),
        _off(target, NAMES_TRUE_ANOMALY, turn, 0.0),
    )
    allowed = (
        a[0] + b[0] + c[0],
        a[1] + b[1] + c[1],
        a[2] + b[2] + c[2],
        a[3] + b[3] + c[3],
        a[4] + b[4] + c[4],
        a[5] + b[5] + c[5],
    )
    return errors, allowed
