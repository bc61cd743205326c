# SPDX-License-Identifier: Apache-2.0
"""Warnings on valid but doubtful missions: wrong units, an orbit inside the air.

Warnings are conservative: the shipped missions have none, and not every slip is found.
"""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ares_models.heating import free_molecular_heating
from ares_models.input_file import KeyPath, at_line, format_number, format_path, read_input
from ares_models.mission_arcs import BurnArc, CoastArc
from ares_models.mission_target import TargetOrbit, parking_orbit
from ares_models.orbits import Insertion

if TYPE_CHECKING:
    from ares_models.mission import Mission

#: Largest density of a lasting orbit, kg/m3: at 100 km on the Earth.
THICK_AIR = 5.6e-7
#: Largest density at the cut-off of an ascent, kg/m3: at 84 km.
THICKEST_AIR = 1e-5
#: Range of g0 Isp of chemical engines, m/s: 61 s is below cold gas, 500 s above any engine.
CHEMICAL = (600.0, 4_903.3)
#: Least thrust over mass of a chemical stage, m/s2; electric stages have at most a thousandth.
CHEMICAL_ACCELERATION = 0.1
#: Largest thrust over mass, m/s2; only interceptors have more.
FIERCEST = 500.0
#: Longest burn of a chemical engine, s.
LONGEST_BURN = 86_400.0
#: Largest dynamic pressure at the start, and of a planned flight, Pa: four times the 35.2 kPa of
#: AS-506 (MPR-SAT-FE-69-9). Launchers have 20 to 60 kPa, fierce solid ones more.
MOST_PRESSURE = 1.5e5
#: Least speed, m/s, of a start above an altitude, m.
SLOWEST, SLOWEST_FROM = 20.0, 1e4
#: Speed over ground, m/s, below which the plane of a start is that of the Earth's rotation.
SLOW_M_S = 1e3
#: Range of heating limits, W/m2; 1,135 is usual.
HEATING_LIMITS = (5.0, 5e4)
#: Heating in the target orbit over a limit above which the limit is surely never met.
FAR_ABOVE = 3.0
#: Time for which boosters burn before they lift a vehicle, at most, s.
LONGEST_HELD_S = 3.0
#: Least C3, m2/s2; a smaller one is probably in km2/s2.
LEAST_C3 = 300.0
#: Largest angle between the planes of initial state and target, deg; ascents turn by a third.
LARGEST_PLANE_CHANGE_DEG = 30.0
#: Largest inclination below the latitude of the pad, deg, that a second burn may well turn by.
LARGEST_DOG_LEG_DEG = 5.0
#: Largest difference of an inclination in radians from one in degrees, deg.
SAME_PLANE_DEG = 2.0
#: Least share of a stage's propellant that burns of fixed length take.
LEAST_USED = 0.5
#: The same of the thrust tables of a solid stage, which more propellant does not prolong.
LEAST_LOADED = 0.98
#: Least floor of a coast, m; a smaller one is probably in km.
LEAST_FLOOR = 1e3
#: Least altitude of the last of several knots of a wind, m; smaller ones are probably in km.
LEAST_WIND_TOP = 100.0
#: Largest wind, m/s, below an altitude, m: that of the strongest tornadoes is 130 m/s.
FIERCEST_WIND, LOW_WIND_M = 60.0, 3e3
#: Least limit of dynamic pressure, Pa; a smaller one is probably in kPa.
LEAST_PRESSURE = 1e3
#: Largest relative distance from the size of the synchronous orbit.
SYNCHRONOUS = 1e-3
#: Least dry mass over propellant; the lightest stages have three times as much.
LEAST_STRUCTURE = 0.01
#: Least payload, and least fairing, over the mass at the start; seen are 5e-4 and more.
LEAST_LOAD = 1e-4
#: Largest jettison over the mass at the start; seen is at most a tenth of it.
LARGEST_JETTISON = 1.0 / 3.0
#: Least altitude of an orbit, m; a smaller one is probably in km.
LEAST_ALTITUDE = 3e3
#: Largest thrust over mass at ignition, m/s2, of one of several boosters; seen are at most 46.
FIERCEST_BOOSTER = 60.0
#: Largest thrust over mass at lift-off, m/s2; launchers with boosters have at most 20.
FIERCEST_LIFT_OFF = 30.0
#: Least thrust over mass of what lifts off, m/s2, on the Earth.
GRAVITY = 9.8
#: Largest radius of an orbit that counts as low, over that of the body.
LOW = 1.5


class Doubt(NamedTuple):
    """Hold a doubtful value.

    Attributes:
        path: key path of the value.
        text: the value and the reason for the doubt.
    """

    path: KeyPath
    text: str


def warnings(mission: "Mission") -> list[str]:
    """Return a warning for each doubtful value, one line that begins with the key."""
    return [at_line(doubt.path, doubt.text, {}) for doubt in _doubts(mission)]


def file_warnings(name_or_path: str | Path) -> list[str]:
    """Return the warnings of a mission, each with its file and line.

    Args:
        name_or_path: of a valid mission, as in :func:`ares_models.mission.load_mission`.
    """
    from ares_models.mission import MISSION, load_mission

    doubts = list(_doubts(load_mission(name_or_path)))
    if not doubts:
        return []
    path = MISSION.find(name_or_path)
    _, lines = read_input(path, MISSION)
    return [f"{path}: {at_line(doubt.path, doubt.text, lines)}" for doubt in doubts]


def pressure_warning(mission: "Mission", most_pa: float) -> str:
    """Return a warning of a planned flight's greatest dynamic pressure, one line; "": none.

    Args:
        mission: that was planned.
        most_pa: greatest dynamic pressure, Pa; nan: not known.
    """
    limited = any(stage.max_dynamic_pressure_pa for stage in mission.stages)
    if limited or not most_pa > MOST_PRESSURE:
        return ""
    return (
        f"the planned flight passes through {most_pa / 1e3:,.0f} kPa, launchers through 20 to "
        "60 kPa; max_dynamic_pressure_pa of a stage limits it"
    )


def at_its_line(text: str, name_or_path: str | Path) -> str:
    """Return a text with file and line before it if it begins with a key of a mission's file.

    Args:
        text: on a mission.
        name_or_path: of the mission, as in :func:`ares_models.mission.load_mission`.
    """
    from ares_models.mission import MISSION

    path = MISSION.find(name_or_path)
    _, lines = read_input(path, MISSION)
    key, _, _ = text.partition(" ")
    line = next((line for known, line in lines.items() if format_path(known) == key), None)
    return f"{path}: line {line}: {text}" if line else text


def _doubts(mission: "Mission") -> Iterator[Doubt]:
    yield from _start(mission)
    yield from _held(mission)
    yield from _wind(mission)
    yield from _limits(mission)
    yield from _loads(mission)
    for i in range(len(mission.stages)):
        yield from _stage(mission, i)
        yield from _boosters(mission, i)
    yield from _heating_limits(mission)
    yield from _target(mission)


def _held(mission: "Mission") -> Iterator[Doubt]:
    """Tell of boosters that burn long while the pad holds them."""
    if mission.held is None or mission.held.speed_m_s > 0.0:
        return  # a rail lets them go
    for booster, lit_s in zip(mission.stages[0].boosters, mission.held.boosters_s, strict=True):
        if lit_s > LONGEST_HELD_S:
            yield Doubt(
                ("initial_state", "hold_down_s"),
                f"lets boosters {booster.name} burn for {lit_s:g} s on the pad; if they are lit at "
                f"the release, their ignition_s is {mission.held.time_s:g}",
            )


def _wind(mission: "Mission") -> Iterator[Doubt]:
    """Tell of a wind by altitudes that are probably in km, or by speeds and directions."""
    knots = mission.environment.atmosphere.wind_table or ()
    path = ("environment", "atmosphere", "wind_table")
    if len(knots) > 1 and knots[-1][0] < LEAST_WIND_TOP:
        yield Doubt(path, f"ends at {knots[-1][0]:g} m; are its altitudes in m?")
    for altitude, *wind in knots:
        if altitude < LOW_WIND_M and math.hypot(*wind) > FIERCEST_WIND:
            asked = "are its knots [altitude, eastward, northward], not speed and direction?"
            yield Doubt(path, f"has {math.hypot(*wind):.0f} m/s at {altitude:g} m; {asked}")
            break


def _limits(mission: "Mission") -> Iterator[Doubt]:
    """Tell of limits that are probably in kPa or km."""
    safe = mission.abort.safe_perigee_altitude_m if mission.abort else None
    if safe is not None and 0.0 < safe < LEAST_FLOOR and _density(mission, safe) > THICK_AIR:
        text = f"is {safe:g} m, inside the air; is it in m?"
        yield Doubt(("abort", "safe_perigee_altitude_m"), text)
    for i, stage in enumerate(mission.stages):
        limit = stage.max_dynamic_pressure_pa
        if limit is not None and limit < LEAST_PRESSURE:
            text = f"is {limit:g} Pa; launchers pass through 20,000 to 60,000 Pa; is it in Pa?"
            yield Doubt(("stages", i, "max_dynamic_pressure_pa"), text)


def _density(mission: "Mission", altitude: float) -> float:
    """Return the density at an altitude, m, kg/m3."""
    factor: float = mission.environment.atmosphere.density_factor
    return factor * mission.atmosphere().density(altitude)


def _over_equator(mission: "Mission", radius: float) -> float:
    """Return the density at a radius, m, above the equator, kg/m3."""
    return _density(mission, radius - mission.environment.earth.equatorial_radius_m)


def _start(mission: "Mission") -> Iterator[Doubt]:
    form, start, earth = mission.initial_state, mission.start(), mission.earth()
    radius, speed = math.hypot(*start.position), math.hypot(*start.velocity)
    surface = earth.equatorial_radius
    if mission.environment.altitude == "ellipsoid":
        surface = earth.surface_radius(earth.latitude_longitude(start.position, 0.0)[0])
    altitude = radius - surface
    relative = start.velocity - np.cross([0.0, 0.0, earth.rotation_rate], start.position)
    pressure = 0.5 * _density(mission, altitude) * float(relative @ relative)
    dragless = "" if mission.aerodynamics else " There is no drag here"
    if pressure > MOST_PRESSURE:
        text = f"makes a dynamic pressure of {pressure:,.0f} Pa; is it in m?{dragless}"
        yield Doubt(("initial_state", form.PLACE), text)
    if speed < SLOWEST and altitude > SLOWEST_FROM:
        yield Doubt(("initial_state", form.MOTION), f"makes {speed:.3g} m/s; is it in m/s?")


def _loads(mission: "Mission") -> Iterator[Doubt]:
    """Tell of a payload or a jettison that is too light or too heavy by orders of magnitude."""
    whole = mission.ignition_mass(0)
    payload = mission.payload_kg
    if payload is not None and 0.0 < payload < LEAST_LOAD * whole:
        text = f"is {payload:g} kg of {whole:,.6g} kg at the start; is it in kg?"
        yield Doubt(("payload_kg",), text)
    by_item = [stage.dry_mass_kg for stage in mission.stages if stage.dry_mass_kg is not None]
    for k, jettison in enumerate(mission.jettisons):
        path, mass = ("jettisons", k, "mass_kg"), jettison.mass_kg
        fairing = jettison.heating_limit_w_m2 is not None
        if fairing and by_item and mass > sum(by_item):
            yield Doubt(
                path,
                f"is {mass:,.6g} kg, all empty stages together {sum(by_item):,.6g} kg; "
                "is it in kg?",
            )
        elif mass > LARGEST_JETTISON * whole or (fairing and mass < LEAST_LOAD * whole):
            yield Doubt(path, f"is {mass:,.6g} kg of {whole:,.6g} kg at the start; is it in kg?")


def _thrust_at_begin(arc: BurnArc) -> float:
    """Return the largest thrust in the first second of a burn, N; that of a table may come late."""
    if arc.thrust_table is None:
        return arc.full_thrust_n
    times, thrusts = zip(*arc.thrust_table, strict=True)
    return float(np.interp(np.linspace(0.0, 1.0, 11), times, thrusts).max())


def _boosters(mission: "Mission", i: int) -> Iterator[Doubt]:
    """Tell of boosters whose thrust looks like that of all of them, or whose Isp is none."""
    stage, g0 = mission.stages[i], mission.environment.g0_m_s2
    mass = mission.ignition_mass(i)
    lit = [booster for booster in stage.boosters if booster.ignition_s == 0.0]
    first = stage.flight_arcs[0]
    thrust = _thrust_at_begin(first) if isinstance(first, BurnArc) else 0.0
    thrust += sum(float(booster.thrust(g0)[1].max()) for booster in lit)
    for k, booster in enumerate(stage.boosters):
        path, count = ("stages", i, "boosters", k), booster.count
        all_of_them = float(booster.thrust(g0)[1].max())
        one = all_of_them / count / (booster.dry_mass_kg + booster.propellant_kg)
        # the whole, too, if each had an Nth of the thrust
        shared = (thrust - all_of_them * (1.0 - 1.0 / count)) / mass
        lift_off = booster in lit and thrust / mass > FIERCEST_LIFT_OFF and shared > GRAVITY
        asked = f"is it of one booster, not of all {count}?" if count > 1 else "is it in N?"
        key = "thrust_n" if booster.thrust_table is None else "thrust_table"
        exhaust = 1.0 / booster.flow_per_thrust(g0)
        chemical = CHEMICAL[0] <= exhaust <= CHEMICAL[1]
        if not chemical and booster.isp_s is not None:
            yield Doubt((*path, "isp_s"), _no_isp(exhaust, g0))
        elif not chemical:
            yield Doubt((*path, key), f"makes an Isp of {exhaust / g0:.4g} s; {asked}")
        elif count > 1 and one > FIERCEST_BOOSTER:
            yield Doubt((*path, key), f"gives one booster {one:.0f} m/s2 at ignition; {asked}")
        elif count > 1 and lift_off:
            together = f"makes {thrust / mass:.0f} m/s2 at lift-off, all engines together"
            yield Doubt((*path, key), f"{together}; {asked}")


def _no_isp(exhaust: float, g0: float) -> str:
    """Describe an exhaust velocity, m/s, that no chemical engine has, as an Isp; g0 in m/s2."""
    low, high = (speed / g0 for speed in CHEMICAL)
    speed = CHEMICAL[0] <= exhaust / g0 <= CHEMICAL[1]
    meant = f"; an exhaust velocity of {exhaust / g0:g} m/s" if speed else ""
    meant += f" is {exhaust / g0**2:.1f} s" if speed else ""
    return f"is {exhaust / g0:g} s; chemical engines have {low:.0f} to {high:.0f} s{meant}"


def _stage(mission: "Mission", i: int) -> Iterator[Doubt]:
    stage, g0 = mission.stages[i], mission.environment.g0_m_s2
    mass = mission.ignition_mass(i)
    for place in mission.walk:
        burn = place.arc
        if place.i != i:
            continue
        if not isinstance(burn, BurnArc):
            yield from _floors(mission, place.path(), burn)
            orbit = parking_orbit(burn)
            if orbit is not None:
                yield from _orbit(mission, place.path(), orbit)
            continue
        acceleration = burn.full_thrust_n / mass
        exhaust = burn.exhaust_velocity(g0)
        chemical = CHEMICAL[0] <= exhaust <= CHEMICAL[1]
        if not chemical and acceleration > CHEMICAL_ACCELERATION:
            yield Doubt(place.path(burn.flow_key), _no_isp(exhaust, g0))
        if acceleration > FIERCEST:
            text = f"makes {acceleration:,.0f} m/s2 at ignition; is it in N, the mass in kg?"
            yield Doubt(place.path(burn.thrust_key), text)
        most = burn.max_acceleration_m_s2
        if most is not None and most < min(acceleration, g0):
            text = f"is {most:g} m/s2, at ignition there are {acceleration:.3g}; is it in m/s2?"
            yield Doubt(place.path("max_acceleration_m_s2"), text)
        burning = mission.propellant(i) / burn.mass_flow(g0)
        if chemical and burn.free and burning > LONGEST_BURN:
            text = f"burns the stage's propellant in {burning / 86_400.0:,.1f} days; is it in N?"
            yield Doubt(place.path(burn.thrust_key), text)
    dry, propellant = stage.dry_mass_kg, stage.propellant_kg
    used = mission.fixed_propellant(i)
    fixed = not any(burn.free for burn in stage.burns)
    solid = all(burn.thrust_table is not None for burn in stage.burns)
    own = used - stage.booster_propellant_kg
    if propellant is not None and fixed and used < LEAST_USED * propellant and not solid:
        text = f"is {propellant:,.6g} kg, its burns take {used:,.4g} kg; is the thrust in N?"
        yield Doubt(("stages", i, "propellant_kg"), text)
    if propellant is not None and solid and own < LEAST_LOADED * propellant:
        text = (
            f"is {propellant:,.6g} kg, the thrust_table takes {own:,.6g} kg; the rest stays aboard"
        )
        yield Doubt(("stages", i, "propellant_kg"), text)
    if dry is not None and propellant is not None and dry < LEAST_STRUCTURE * propellant:
        text = f"is {dry:g} kg for {propellant:,g} kg of propellant; is it in kg?"
        yield Doubt(("stages", i, "dry_mass_kg"), text)


def _floors(mission: "Mission", path: KeyPath, coast: CoastArc) -> Iterator[Doubt]:
    for key in ("min_altitude_m", "min_perigee_altitude_m"):
        floor = getattr(coast, key)
        if floor is not None and 0.0 < floor < LEAST_FLOOR and _density(mission, floor) > THICK_AIR:
            yield Doubt((*path, key), f"is {floor:g} m, inside the air; is it in m?")


def _heating_limits(mission: "Mission") -> Iterator[Doubt]:
    least, most = HEATING_LIMITS
    mu = mission.environment.mu_m3_s2
    for k, jettison in enumerate(mission.jettisons):
        limit = jettison.heating_limit_w_m2
        if limit is None:
            continue
        path = ("jettisons", k, "heating_limit_w_m2")
        if not least <= limit <= most:
            yield Doubt(path, f"is {format_number(limit)} W/m2; 1,135 W/m2 is usual")
            continue
        circle = _highest(mission)
        if circle is None or _over_equator(mission, circle) > THICK_AIR:
            continue
        relative = math.sqrt(mu / circle) - mission.environment.earth.rotation_rate_rad_s * circle
        there = free_molecular_heating(_over_equator(mission, circle), relative)
        if there > FAR_ABOVE * limit:
            yield Doubt(path, f"may never be met: in the target's orbit it is {there:,.0f} W/m2")


def _highest(mission: "Mission") -> float | None:
    """Return the greatest radius of the target's orbit, m; None if it is not determined."""
    target = mission.target
    if isinstance(target, TargetOrbit):
        return target.conic(mission).apogee if target.circular(mission) else None
    return target.radius_m


def _plane(mission: "Mission") -> Iterator[Doubt]:
    start, target = mission.start(), mission.target
    rate = mission.environment.earth.rotation_rate_rad_s
    over_ground = np.subtract(start.velocity, np.cross((0.0, 0.0, rate), start.position))
    if mission.initial_state.is_launch or np.linalg.norm(over_ground) < SLOW_M_S:
        # its plane in space is that of the rotation of the Earth
        yield from _plane_from_pad(mission)
        return
    before = Insertion.from_state(start.position, start.velocity)
    key, angle = "inclination_deg", 0.0
    if target.inclination_deg is not None:
        angle = abs(math.radians(target.inclination_deg) - before.inclination)
    node = target.node_deg(mission)
    if node is not None:
        turned = _turned(before, math.radians(node), target.inclination_deg)
        if turned > angle:
            key, angle = target.node_key or "rla_deg", turned
    asked, plane = target.inclination_deg, math.degrees(before.inclination)
    if asked is not None and abs(math.degrees(asked) - plane) < SAME_PLANE_DEG < abs(asked - plane):
        text = f"is {asked:g} deg, that of the initial state {plane:.3f} deg; is it in degrees?"
        yield Doubt(("target", "inclination_deg"), text)
        return
    if math.degrees(angle) > LARGEST_PLANE_CHANGE_DEG:
        yield Doubt(
            ("target", key),
            f"is {getattr(target, key):g}, a plane {math.degrees(angle):.1f} deg from the initial "
            f"state's, whose inclination is {math.degrees(before.inclination):.3f} deg and node "
            f"{math.degrees(before.ascending_node):.3f} deg from the inertial x axis",
        )


def _plane_from_pad(mission: "Mission") -> Iterator[Doubt]:
    """Tell of a plane that no azimuth reaches: tilted too little, or of another time of launch."""
    target = mission.target
    if target.inclination_deg is None:
        return
    x, y, z = mission.start().position
    radius, tilt = math.hypot(x, y, z), math.radians(target.inclination_deg)
    latitude = abs(math.degrees(math.asin(z / radius)))
    least = latitude - min(target.inclination_deg, 180.0 - target.inclination_deg)
    node = target.node_deg(mission)
    meant = math.degrees(target.inclination_deg)
    radians = latitude <= meant <= 180.0 - latitude and least > 0.0
    highest = _highest(mission)
    low = highest is not None and highest < LOW * mission.environment.earth.equatorial_radius_m
    if (least > LARGEST_DOG_LEG_DEG and not _turns_high_up(mission)) or (
        radians and low and least > SAME_PLANE_DEG
    ):
        yield Doubt(
            ("target", "inclination_deg"),
            f"is {target.inclination_deg:g}, a plane that does not reach the pad's latitude, "
            f"{latitude:.1f} deg: the flight has to turn by {least:.1f} deg or more, a dog leg"
            + (f"; or is it in radians, {meant:.2f} deg?" if radians else ""),
        )
    elif node is not None:
        turn = math.radians(node)
        across = math.sin(tilt) * (x * math.sin(turn) - y * math.cos(turn)) + z * math.cos(tilt)
        off = abs(math.degrees(math.asin(across / radius)))
        if off > LARGEST_PLANE_CHANGE_DEG:
            key = target.node_key or "rla_deg"
            yield Doubt(
                ("target", key),
                f"is {getattr(target, key):g}, a plane that is {off:.1f} deg off the pad at the "
                "start; another time of launch brings the pad into it",
            )


def _turns_high_up(mission: "Mission") -> bool:
    """Return true if a burn after a free coast can turn the plane at a high apogee, for little."""
    target = mission.target
    coasts = [arc for *_, arc in mission.walk if isinstance(arc, CoastArc)]
    if not any(coast.free for coast in coasts) or not isinstance(target, TargetOrbit):
        return False
    high = LOW * mission.environment.earth.equatorial_radius_m
    return target.conic(mission).apogee >= high


def _turned(before: Insertion, node: float, inclination_deg: float | None) -> float:
    """Return the angle, rad, to a plane by its node, rad, and inclination, or to the nearest."""
    turn = node - before.ascending_node
    if inclination_deg is None:
        sine = abs(math.sin(before.inclination) * math.sin(turn))
        return math.asin(sine) if math.cos(turn) > 0.0 else math.pi - math.asin(sine)
    inclination = math.radians(inclination_deg)
    along = math.cos(inclination) * math.cos(before.inclination)
    across = math.sin(inclination) * math.sin(before.inclination)
    return math.acos(min(max(along + across * math.cos(turn), -1.0), 1.0))


def _target(mission: "Mission") -> Iterator[Doubt]:
    yield from _plane(mission)
    target = mission.target
    if not isinstance(target, TargetOrbit):
        thick = _over_equator(mission, target.radius_m)
        if thick > THICKEST_AIR:
            yield Doubt(("target", "radius_m"), _inside(thick))
        return
    c3 = target.c3_m2_s2
    if c3 is not None and 0.0 < abs(c3) < LEAST_C3:
        yield Doubt(("target", "c3_m2_s2"), f"is {c3:g} m2/s2; is the number in km2/s2?")
    yield from _synchronous(mission, target)
    yield from _orbit(mission, ("target",), target)


def _synchronous(mission: "Mission", target: TargetOrbit) -> Iterator[Doubt]:
    """Tell of an apogee whose altitude is the radius of the synchronous orbit, or the reverse."""
    environment = mission.environment
    rate = environment.earth.rotation_rate_rad_s
    if rate == 0.0:
        return
    radius = math.cbrt(environment.mu_m3_s2 / rate**2)
    altitude = radius - environment.earth.equatorial_radius_m
    for key, named, what, other in (
        ("apogee_altitude_m", radius, "radius", "altitude"),
        ("apogee_radius_m", altitude, "altitude", "radius"),
    ):
        value = getattr(target, key)
        if value is not None and abs(value - named) < SYNCHRONOUS * named:
            text = f"is {value:,.0f} m, the {what} of the synchronous orbit, not its {other}"
            yield Doubt(("target", key), text)


def _orbit(mission: "Mission", path: KeyPath, target: TargetOrbit) -> Iterator[Doubt]:
    for apsis in ("perigee", "apogee"):
        radius = target.sizes(mission).get(f"{apsis}_radius")
        if radius is None:
            continue
        thick = _over_equator(mission, radius)
        height = radius - mission.environment.earth.equatorial_radius_m
        asked = "; is it in m?" if 0.0 < height < LEAST_ALTITUDE else ""
        if thick > THICK_AIR:
            yield Doubt((*path, target.key_of(apsis)), f"{_inside(thick)}{asked}")
            return
        if asked:
            yield Doubt((*path, target.key_of(apsis)), f"is at {height:,.6g} m{asked}")
            return


def _inside(thick: float) -> str:
    return f"is inside the air, {thick:.1e} kg/m3: no orbit lasts there"
