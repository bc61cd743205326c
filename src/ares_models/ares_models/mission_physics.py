# SPDX-License-Identifier: Apache-2.0
"""Physical checks of a mission: the body, the engines, the length of the flight.

Each number has passed its own range before; these checks combine several.
"""

import math
from typing import TYPE_CHECKING, NamedTuple

from ares_models.input_file import KeyPath, format_number
from ares_models.kernels.aerodynamics import pressure_loss
from ares_models.kernels.environment import gravity
from ares_models.kernels.thrust_curve import start_value
from ares_models.mission_arcs import BurnArc
from ares_models.mission_keys import MAX_FLIGHT_S, MIN_TIME_S, fail
from ares_models.ranges import Range

if TYPE_CHECKING:
    from ares_models.mission import Mission

#: Gravity on the equator, m/s2: a moon of 500 km to twice Jupiter.
SURFACE_GRAVITY = Range(0.05, 50.0)
#: Smallest ratio of the polar to the equatorial radius; Saturn has 0.9.
LEAST_ROUNDNESS = 0.5
#: g0 Isp, m/s: from cold gas to ion engines.
EXHAUST_VELOCITY = Range(100.0, 1e5)
#: Largest thrust over mass at the start of a stage, m/s2; the fastest missiles reach a tenth.
MAX_ACCELERATION = 1e4
#: Least dry mass of the last stage, as a fraction of its ignition mass.
LEAST_DRY_SHARE = 1e-3


def check_body(mission: "Mission") -> None:
    """Check radii, gravity and rotation of the body against each other.

    Raises:
        PydanticCustomError: they contradict each other.
    """
    environment = mission.environment
    earth, mu = environment.earth, environment.mu_m3_s2
    path: KeyPath = ("environment", "earth")
    least = LEAST_ROUNDNESS * earth.equatorial_radius_m
    if earth.polar_radius_m < least:
        fail((*path, "polar_radius_m"), earth.polar_radius_m, f"at least {least:,.0f} m")
    gravity = mu / earth.equatorial_radius_m**2
    if not SURFACE_GRAVITY.low <= gravity <= SURFACE_GRAVITY.high:
        expected = f"a gravity on the equator of {SURFACE_GRAVITY} m/s2; it is {gravity:.3g} m/s2"
        fail(("environment", "mu_m3_s2"), mu, expected)
    fastest = math.sqrt(gravity / earth.equatorial_radius_m)
    if earth.rotation_rate_rad_s >= fastest:
        expected = f"less than {fastest:.3g} rad/s, at which the equator would be in orbit"
        fail((*path, "rotation_rate_rad_s"), earth.rotation_rate_rad_s, expected)


def check_engines(mission: "Mission") -> None:
    """Check exhaust velocities, accelerations and the dry mass of the last stage.

    Raises:
        PydanticCustomError: a value is out of bounds.
    """
    g0 = mission.environment.g0_m_s2
    for place in mission.walk:
        arc = place.arc
        if not isinstance(arc, BurnArc):
            continue
        exhaust = arc.exhaust_velocity(g0)
        if not EXHAUST_VELOCITY.low <= exhaust <= EXHAUST_VELOCITY.high:
            expected = f"an exhaust velocity g0 Isp of {EXHAUST_VELOCITY} m/s"
            value = getattr(arc, arc.flow_key)
            fail(place.path(arc.flow_key), value, f"{expected}; it is {exhaust:.3g} m/s")
        highest = MAX_ACCELERATION * mission.ignition_mass(place.i)
        if arc.full_thrust_n > highest:
            expected = f"at most {highest:.6g} N, {MAX_ACCELERATION:,.0f} m/s2 at ignition"
            fail(place.path(arc.thrust_key), arc.full_thrust_n, expected)
    last = mission.stages[-1]
    most = (1.0 - LEAST_DRY_SHARE) * mission.ignition_mass(len(mission.stages) - 1)
    if last.propellant_kg is not None and last.propellant_kg > most:
        path = ("stages", len(mission.stages) - 1, "propellant_kg")
        fail(path, last.propellant_kg, f"at most {most:.9g} kg of the last stage")


class LiftOff(NamedTuple):
    """Hold thrust and weight on the pad.

    Attributes:
        vacuum_n: thrust without air.
        ambient_n: what the pressure of the air takes.
        weight_n: of the whole vehicle.
    """

    vacuum_n: float
    ambient_n: float
    weight_n: float

    @property
    def ratio(self) -> float:
        """Return thrust in the air over weight; 0 if the air takes all thrust."""
        return max(0.0, self.vacuum_n - self.ambient_n) / self.weight_n


def lift_off(mission: "Mission") -> LiftOff:
    """Compute thrust and weight of a vehicle whose first arc is a burn, where it begins."""
    arrays, start = mission.arrays(), mission.start()
    first, environment = arrays.arcs[0], arrays.environment[0]
    r = tuple(start.position.tolist())
    fraction = start_value(first, 0.0) if first["tabled"] else 1.0
    return LiftOff(
        float(fraction * first["thrust"]),
        pressure_loss(first, r, environment, arrays.atmosphere),
        start.mass_kg * math.hypot(*gravity(r, environment)),
    )


def check_lift_off(mission: "Mission") -> None:
    """Check that a vehicle at rest on its pad leaves it: thrust in its air against weight.

    Raises:
        PydanticCustomError: it does not.
    """
    if not mission.initial_state.AT_REST or mission.initial_state.waits:
        return
    arc = mission.stages[0].flight_arcs[0]
    path: KeyPath = ("stages", 0, *mission.stages[0].arc_path(0))
    if not isinstance(arc, BurnArc):
        fail((*path, "coast_s"), arc.coast_s, "a burn, from the pad")
    vacuum, ambient, weight = forces = lift_off(mission)
    if forces.ratio > 1.0:
        return
    expected = (
        f"more thrust than weight at lift-off: {max(0.0, vacuum - ambient):,.0f} N at the air "
        f"pressure of the pad ({vacuum:,.0f} N in vacuum, {ambient:,.0f} N less by exit_area_m2), "
        f"weight {weight:,.0f} N, ratio {forces.ratio:.2f}"
    )
    late = [one for one in mission.stages[0].boosters if one.ignition_s > 0.0]
    if late:
        expected += f"; its boosters ({late[0].name}) are lit {late[0].ignition_s:g} s later"
        expected += ": hold_down_s of the initial_state holds the vehicle until then"
    tables = [(path, arc.thrust_table)]
    for i, one in enumerate(mission.stages[0].boosters):
        if one.ignition_s == 0.0:
            tables.append((("stages", 0, "boosters", i), one.thrust_table))
    for where, table in tables:
        # at a jump the later value holds
        knot = sum(t == 0.0 for t, _ in table or ()) - 1
        if table and table[knot][1] < max(force for _, force in table):
            expected += "; the thrust rises: hold_down_s of the initial_state holds the vehicle"
            fail((*where, "thrust_table", knot, 1), table[knot][1], f"{expected} until then")
    remedy = "" if late else "; raise the thrust or lower the mass"
    fail((*path, arc.thrust_key), arc.full_thrust_n, expected + remedy)


def longest_flight(mission: "Mission") -> float:
    """Compute the length of the flight without a cut-off by guidance, s.

    Raises:
        PydanticCustomError: it is too long, or ends during the start of a free burn.
    """
    now = 0.0
    for place in mission.walk:
        i, stage, k, arc = place
        if isinstance(arc, BurnArc) and arc.free:
            # the burns of a stage share its propellant: the last free one burns the rest
            later = stage.flight_arcs[k + 1 :]
            if not any(isinstance(other, BurnArc) and other.free for other in later):
                now += _longest_free_burn(mission, i, arc, place.path(), now)
            continue
        if isinstance(arc, BurnArc):
            now += _longest(arc)
        else:
            now += (arc.max_s or 0.0) if arc.free else arc.duration_s
        if now > MAX_FLIGHT_S:
            expected = f"a flight of at most {MAX_FLIGHT_S:,.0f} s; it is {now:,.6g} s by then"
            fail(place.path(arc.LENGTH), arc.duration_s, expected)
    return now


def _longest(burn: BurnArc) -> float:
    """Return the length of a burn of fixed length, s, extended by an engine loss."""
    failure = burn.engine_out
    if failure is None:
        return burn.duration_s
    at = failure.time_after_ignition_s
    return at + (burn.duration_s - at) / failure.left


def _longest_free_burn(
    mission: "Mission", stage: int, burn: BurnArc, path: KeyPath, begin: float
) -> float:
    """Return the length of a free burn until depletion, s.

    Args:
        mission: the mission.
        stage: index of the stage.
        burn: the free burn.
        path: key path of the burn.
        begin: start of the burn, s after the initial state.
    """
    g0 = mission.environment.g0_m_s2
    left = mission.propellant(stage) - mission.fixed_propellant(stage)
    full_thrust = left / burn.mass_flow(g0)
    # depletion during the start: the burn never reaches full thrust
    started = 0.0 if burn.start is None else burn.start[-1][0]
    if burn.start is not None and full_thrust + burn.start_loss_s < started + MIN_TIME_S:
        gone = f"the {max(left, 0.0):,.6g} kg of propellant are gone"
        fail((*path, "start"), burn.start, f"a start that is over before {gone}")
    length = full_thrust + burn.start_loss_s + burn.tail_s
    if begin + length > MAX_FLIGHT_S:
        least = left * burn.exhaust_velocity(g0) / (MAX_FLIGHT_S - begin - length + full_thrust)
        expected = (
            f"its {left:,.6g} kg of propellant to burn within {MAX_FLIGHT_S:,.0f} s of flight"
        )
        if least > 0.0:
            expected = f"at least {least:.4g} N, {expected}"
        fail((*path, "thrust_n"), burn.thrust_n, expected)
    return length


def check_flight_time(mission: "Mission") -> None:
    """Check that the flight ends, and that timed jettisons come before its end.

    Raises:
        PydanticCustomError: it is too long, or a jettison comes later.
    """
    ignition = mission.ignition_times()
    end = mission.initial_state.time_s + longest_flight(mission)
    for k, jettison in enumerate(mission.jettisons):
        if jettison.time_s is not None and jettison.time_s > end:
            expected = f"at most {format_number(end)} s, when all propellant is gone"
            fail(("jettisons", k, "time_s"), jettison.time_s, expected)
        after = jettison.time_after_ignition_s
        room = end - ignition[mission.stage_names.index(jettison.stage)]
        if after is not None and after > room:
            expected = f"at most {format_number(room)} s, when all propellant is gone"
            fail(("jettisons", k, "time_after_ignition_s"), after, expected)
