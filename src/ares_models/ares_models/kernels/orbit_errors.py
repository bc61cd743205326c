# SPDX-License-Identifier: Apache-2.0
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
#: An orbit is round whose eccentricity is less than so much of what the tolerances come to.
_ROUND = 3.0


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
def allowed_figures(radius: float, speed: float, angle: float, mu: float, wanted: float) -> Figures:
    """Return how much the figures of :func:`orbit_figures` may be off.

    To first order what the tolerances come to. Of an orbit that they make a circle, or nearly,
    perigee may be anywhere: there each moves perigee and apogee by as much as it ever does.

    Args:
        radius: m.
        speed: m/s.
        angle: flight-path angle, rad.
        mu: m3/s2.
        wanted: eccentricity of the target; inf: it has none of its own.

    Returns:
        nan: an apogee of an escape.
    """
    towards, ahead, parameter = shape(radius, speed, angle, mu)
    e = math.hypot(towards, ahead)
    cos, sin = (towards / e, ahead / e) if e > 0.0 else (1.0, 0.0)
    moves = _moves(radius, speed, angle, mu)
    longer = turned = anyhow = 0.0
    for move in moves:
        longer += abs(cos * move[0] + sin * move[1])
        turned += abs(cos * move[1] - sin * move[0])
        anyhow += math.hypot(move[0], move[1])
    least = min(e, wanted)
    is_round = least < _ROUND * anyhow
    near = parameter / (1.0 + e)
    far = parameter / (1.0 - e) if e < 1.0 else math.nan
    perigee = apogee = 0.0
    for move in moves:
        stretch = cos * move[0] + sin * move[1]
        most = math.hypot(move[0], move[1])
        if is_round:
            perigee += abs(move[2]) + near * most
            apogee += abs(move[2]) + far * most
        else:
            perigee += abs(move[2] - near * stretch)
            apogee += abs(move[2] + far * stretch)
    c3 = 2.0 * (mu / (radius * radius) * RADIUS_M + speed * SPEED_M_S)
    energy = speed * speed - 2.0 * mu / radius
    return (
        perigee / (1.0 + e),
        apogee / (1.0 - e),
        mu / (energy * energy) * c3,
        math.hypot(e + longer, turned) - e if not is_round else anyhow,
        c3,
        math.atan2(turned, least - longer) if least > anyhow else math.pi,
    )
