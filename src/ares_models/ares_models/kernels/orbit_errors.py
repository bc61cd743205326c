# SPDX-License-Identifier: Apache-2.0
"""Size, shape and place of an orbit, and their tolerances from those of a state.

The tolerances of radius, speed and flight-path angle together move an apogee far, a perigee little,
and the perigee of a circle to any place. They are propagated through the eccentricity vector, which
is smooth; the elements have a cusp at a circular orbit.
"""

import math

from ares_models.jit import kernel
from ares_models.tolerances import FLIGHT_PATH_ANGLE_DEG, RADIUS_M, SPEED_M_S

#: Perigee radius m, apogee radius m, semi-major axis m, eccentricity, C3 m2/s2, true anomaly rad.
Figures = tuple[float, float, float, float, float, float]
#: Eccentricity vector along the radius and ahead of it, and parameter, m; or their changes.
Move = tuple[float, float, float]

_ANGLE = math.radians(FLIGHT_PATH_ANGLE_DEG)
#: Eccentricity of a round orbit, as a multiple of the change by the tolerances.
_ROUND = 3.0


@kernel
def shape(radius: float, speed: float, angle: float, mu: float) -> Move:
    """Return the eccentricity vector along a state's radius and ahead, and the parameter, m.

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
    """Return size, shape and place of a state's orbit; the apogee of an escape is inf."""
    towards, ahead, parameter = shape(radius, speed, angle, mu)
    c3 = speed * speed - 2.0 * mu / radius
    e = math.hypot(towards, ahead)
    apogee = parameter / (1.0 - e) if e < 1.0 else math.inf
    return parameter / (1.0 + e), apogee, -mu / c3, e, c3, math.atan2(ahead, towards)


@kernel
def _moves(radius: float, speed: float, angle: float, mu: float) -> tuple[Move, Move, Move]:
    """Return the changes of the shape by the tolerances of radius, speed and angle, one each."""
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
    """Return the tolerances of the figures of :func:`orbit_figures`.

    They are the sum of the first-order changes by the tolerances of the state. In a round orbit
    the perigee may lie anywhere: there each change counts with its largest value over the orbit.
    The apogee may be off by what the tolerances change it from the perigee, too, since a burn that
    ends elsewhere, at the apogee itself for one, does not set it.

    Args:
        radius: m.
        speed: m/s.
        angle: flight-path angle, rad.
        mu: m3/s2.
        wanted: eccentricity of the target; inf: undetermined.

    Returns:
        figures; nan for the apogee of an escape.
    """
    towards, ahead, parameter = shape(radius, speed, angle, mu)
    e = math.hypot(towards, ahead)
    cos, sin = (towards / e, ahead / e) if e > 0.0 else (1.0, 0.0)
    moves = _moves(radius, speed, angle, mu)
    longer = turned = largest = 0.0
    for move in moves:
        longer += abs(cos * move[0] + sin * move[1])
        turned += abs(cos * move[1] - sin * move[0])
        largest += math.hypot(move[0], move[1])
    least = min(e, wanted)
    is_round = least < _ROUND * largest
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
    if e < 1.0 and not is_round:
        from_perigee = 0.0
        for move in _moves(near, math.sqrt(mu * parameter) / near, 0.0, mu):
            from_perigee += abs(move[2] + far * move[0])
        apogee = max(apogee, from_perigee)
    c3 = 2.0 * (mu / (radius * radius) * RADIUS_M + speed * SPEED_M_S)
    energy = speed * speed - 2.0 * mu / radius
    return (
        perigee / (1.0 + e),
        apogee / (1.0 - e),
        mu / (energy * energy) * c3,
        math.hypot(e + longer, turned) - e if not is_round else largest,
        c3,
        math.atan2(turned, least - longer) if least > largest else math.pi,
    )
