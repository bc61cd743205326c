# SPDX-License-Identifier: Apache-2.0
"""Fly a vehicle along the rail from which it is launched.

The rail turns with the ground and lets the vehicle move along itself alone, without friction.
"""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ares_models.geodesy import velocity_over_ground
from ares_models.kernels.aerodynamics import body_force, pressure_loss
from ares_models.kernels.environment import gravity
from ares_models.kernels.thrust_curve import flow_value, start_value
from ares_models.mission_arcs import BurnArc
from ares_models.mission_keys import fail
from ares_models.mission_start import Rail, StateOnPad

if TYPE_CHECKING:
    from ares_models.mission import Mission

Array = NDArray[np.float64]

#: Longest time on a rail, s.
LONGEST_S = 60.0
#: Step of the integration, s, and passes that find the end of the rail in the last of them.
STEP_S = 0.01
NEWTON_STEPS = 4


def leave_rail(mission: "Mission", pad: StateOnPad, rail: Rail) -> tuple[float, Array, Array]:
    """Return when a vehicle leaves its rail, and its Earth-fixed state there.

    Args:
        mission: checked, at rest at the begin of the rail.
        pad: its initial state.
        rail: on it.

    Returns:
        time from ignition, s; position, m, and velocity over the ground, m/s, shape (3,) each.

    Raises:
        PydanticCustomError: the vehicle does not leave it.
    """
    first = mission.stages[0].flight_arcs[0]
    if isinstance(first, BurnArc) and first.vertical_rise_s is not None:
        path = ("stages", 0, *mission.stages[0].arc_path(0), "vertical_rise_s")
        fail(path, first.vertical_rise_s, "none, since a rail holds the vehicle until it leaves it")
    arrays, earth = mission.arrays(), mission.earth()
    environment, arcs = arrays.environment[0], arrays.arcs
    begins = np.concatenate(([0.0], np.cumsum(arcs["duration"])))
    site = pad.place(earth)
    along = velocity_over_ground(
        pad.geodetic_latitude_deg, pad.longitude_deg, 1.0, rail.elevation_deg, rail.azimuth_deg
    )
    u = tuple(along.tolist())
    rate = earth.rotation_rate

    def motion(t: float, state: Array) -> Array:
        travelled, speed, mass = state
        k = min(int(np.searchsorted(begins, t, side="right")) - 1, len(arcs) - 1)
        arc, lit = arcs[k], t - begins[k]
        place = site + travelled * along
        r = tuple(place.tolist())
        carried = rate * np.array([-place[1], place[0], 0.0])
        v = tuple((speed * along + carried).tolist())
        force = np.array(body_force(arc, r, v, u, environment, arrays.atmosphere))
        thrust = start_value(arc, lit) * float(arc["thrust"])
        thrust -= pressure_loss(arc, r, environment, arrays.atmosphere)
        pull = np.array(gravity(r, environment)) + rate**2 * np.array([place[0], place[1], 0.0])
        gain = (thrust + float(force @ along)) / mass + float(pull @ along)
        # at its lower end it stands on the rail
        held = travelled <= 0.0 and gain < 0.0
        flow = flow_value(arc, lit) * float(arc["mass_flow"])
        return np.array([speed, 0.0 if held else gain, -flow])

    def after(t: float, state: Array, span: float) -> Array:
        # the classical Runge-Kutta method
        half = 0.5 * span
        k1 = motion(t, state)
        k2 = motion(t + half, state + half * k1)
        k3 = motion(t + half, state + half * k2)
        k4 = motion(t + span, state + span * k3)
        moved: Array = state + span / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
        return moved

    t, state = 0.0, np.array([0.0, 0.0, mission.start().mass_kg])
    while (ahead := after(t, state, STEP_S))[0] < rail.length_m:
        t, state = t + STEP_S, ahead
        if t > LONGEST_S:
            fail(
                ("initial_state", "rail", "length_m"),
                rail.length_m,
                f"a rail that the vehicle leaves within {LONGEST_S:g} s; it travels "
                f"{state[0]:,.1f} m",
            )
    span, end = STEP_S, ahead
    for _ in range(NEWTON_STEPS):
        span -= float((end[0] - rail.length_m) / end[1])
        end = after(t, state, span)
    return t + span, site + rail.length_m * along, float(end[1]) * along
