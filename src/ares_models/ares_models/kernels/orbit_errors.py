"""Size, shape and place of an orbit, and how far the errors allowed to a state move them.

What may be missed is what those errors come to together: radius, speed and flight-path angle off
by their tolerance each move an apogee far, a perigee little, and the perigee of a circle to
anywhere. They move the eccentricity vector smoothly, so all is told through it: the elements
themselves have a cusp where the orbit is a circle.
"""

import math

from ares_models.jit import kernel
from ares_models.tolerances import FLIGHT_PATH_ANGLE_DEG, RADIUS_M, SPEED_M_S

#: Perigee radius m, apogee radius m, semi-major axis m, eccentricity, C3 m2/s2, true anomaly rad.
Figures = tuple[float, float, float, float, float, float]
#: A move of the eccentricity vector, towards the state and ahead of it, and of the parameter, m.
Move = tuple[float, float, float]

_ANGLE = math.radians(FLIGHT_PATH_ANGLE_DEG)


@kernel
def shape(radius: float, speed: float, angle: float, mu: float) -> Move:
    """Return the eccentricity vector, towards a state and ahead of it, and the parameter, m.

    Args:
        radius: m.
        speed: m/s.
        angle: flight-path angle, rad.
        mu: m3/s2.
    """
    ratio = radius * speed * speed / mu
    across = math.cos(angle)
    level = ratio * across * across
    return level - 1.0, ratio * math.sin(angle) * across, radius * level


@kernel
def orbit_figures(radius: float, speed: float, angle: float, mu: float) -> Figures:
    """Return size, shape and place of the orbit of a state; an escape's apogee is inf."""
    towards, ahead, parameter = shape(radius, speed, angle, mu)
    c3 = speed * speed - 2.0 * mu / radius
    e = math.hypot(towards, ahead)
    apogee = parameter / (1.0 - e) if e < 1.0 else math.inf
    return parameter / (1.0 + e), apogee, -mu / c3, e, c3, math.atan2(ahead, towards)


@kernel
def _moves(radius: float, speed: float, angle: float, mu: float) -> tuple[Move, Move, Move]:
    """Return how far the tolerances of radius, speed and angle move the shape, each by itself."""
    towards, ahead, parameter = shape(radius, speed, angle, mu)
    level = towards + 1.0
    by_radius = RADIUS_M / radius
    by_speed = 2.0 * SPEED_M_S / speed
    turned = radius * speed * speed / mu * math.cos(2.0 * angle)
    return (
        (level * by_radius, ahead * by_radius, 2.0 * parameter * by_radius),
        (level * by_speed, ahead * by_speed, parameter * by_speed),
        (-2.0 * ahead * _ANGLE, turned * _ANGLE, -2.0 * radius * ahead * _ANGLE),
    )


@kernel
def allowed_figures(radius: float, speed: float, angle: float, mu: float) -> Figures:
    """Return how much the figures of :func:`orbit_figures` may be off, to first order.

    Where the tolerances turn the eccentricity vector by as much as it is long, its length changes
    by more than to first order, and any true anomaly will do. nan: an apogee of an escape.
    """
    towards, ahead, parameter = shape(radius, speed, angle, mu)
    e = math.hypot(towards, ahead)
    cos, sin = (towards / e, ahead / e) if e > 0.0 else (1.0, 0.0)
    longer = turned = perigee = apogee = 0.0
    near = parameter / (1.0 + e)
    far = parameter / (1.0 - e) if e < 1.0 else math.nan
    for move in _moves(radius, speed, angle, mu):
        stretch = cos * move[0] + sin * move[1]
        longer += abs(stretch)
        turned += abs(cos * move[1] - sin * move[0])
        perigee += abs((move[2] - near * stretch) / (1.0 + e))
        apogee += abs((move[2] + far * stretch) / (1.0 - e))
    cusp = math.hypot(e + longer, turned) - (e + longer)
    c3 = 2.0 * (mu / (radius * radius) * RADIUS_M + speed * SPEED_M_S)
    energy = speed * speed - 2.0 * mu / radius
    return (
        perigee + near / (1.0 + e) * cusp,
        apogee + far / (1.0 - e) * cusp,
        mu / (energy * energy) * c3,
        longer + cusp,
        c3,
        math.asin(turned / e) if turned < e else math.pi,
    )
