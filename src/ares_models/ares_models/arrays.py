# SPDX-License-Identifier: Apache-2.0
"""Structured dtypes: the plain data shared by kernels, nodes and campaigns.

A mission is compiled once into :class:`MissionArrays`. Python passes that to an entry kernel, which
passes :class:`MissionRecords` on; kernels read their fields by name. Everything is SI, angles in
rad, times are mission elapsed time in seconds, vectors are in the frame ``ares_eci``.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

#: One element of a structured array in a kernel: fields by attribute.
Record = Any

MAX_ARCS = 24
MAX_JETTISONS = 8
#: Largest number of pieces that a flight drops: stages but the last, jettisons.
MAX_PIECES = 15
MAX_KNOTS = 64
#: Largest number of knots of a drag table.
MAX_DRAG_KNOTS = 32
#: Largest number of knots of a wind table, and layers of turbulence.
MAX_WIND_KNOTS = 32
MAX_STIRRED_LAYERS = 200
#: Room for the knots of three wind tables with their ends, and of the layers.
WIND_ROOM = 3 * (MAX_WIND_KNOTS + 1) + MAX_STIRRED_LAYERS
#: Largest number of protected areas, and of corners of one.
MAX_AREAS = 12
MAX_VERTICES = 24
#: Largest number of knots of an attitude programme.
MAX_PROGRAMME = 256

#: Longest flight of any kernel, s: twice the limit of a mission file, so that every loop ends.
LONGEST_FLIGHT = 1_728_000.0

COAST = 0
BURN = 1

HEATING_LIMIT = 0
MISSION_TIME = 1
TIME_AFTER_IGNITION = 2

ALTITUDE_SPHERICAL = 0
ALTITUDE_ELLIPSOID = 1

TARGET_RADIUS_SPEED_ANGLE_INCLINATION = 0
TARGET_RADIUS_SPEED_ANGLE_PLANE = 1
TARGET_KEPLERIAN = 2
TARGET_ELEMENTS = 3

#: Elements that a target of kind TARGET_ELEMENTS constrains: bits of its ``named``.
NAMES_RADIUS = 1
NAMES_SPEED = 2
NAMES_FLIGHT_PATH_ANGLE = 4
NAMES_PERIGEE = 8
NAMES_APOGEE = 16
NAMES_SEMI_MAJOR_AXIS = 32
NAMES_ECCENTRICITY = 64
NAMES_C3 = 128
NAMES_INCLINATION = 256
NAMES_ASCENDING_NODE = 512
NAMES_ARGUMENT_OF_PERIGEE = 1024
NAMES_TRUE_ANOMALY = 2048
#: Beside them: the ascent from the pad leads to the north or to the south of east or west.
HEADS_NORTH = 4096
HEADS_SOUTH = 8192
HEADINGS = HEADS_NORTH | HEADS_SOUTH

AREA_CIRCLE = 0
AREA_POLYGON = 1

#: A part of the ground, by geocentric unit vectors in body-fixed axes: x through longitude zero, z
#: through the north pole.
AREA = np.dtype(
    [
        ("kind", np.int64),  # AREA_*
        ("centre", np.float64, (3,)),  # of the circle, or mean of a polygon's corners
        ("radius", np.float64),  # rad, of the circle, or to a polygon's farthest corner
        ("count", np.int64),  # number of corners
        ("vertices", np.float64, (MAX_VERTICES, 3)),  # in order, joined by great circles
    ],
    align=True,
)

OVER_TIME = 0
OVER_ALTITUDE = 1
OVER_SPEED = 2

#: The boost programme of a mission file: angles of the thrust, straight between knots, constant
#: beyond both ends.
BOOST = np.dtype(
    [
        ("knots", np.int64),  # 0: there is none
        ("over", np.int64),  # OVER_*: mission elapsed time s, altitude m, or speed in the air m/s
        ("at", np.float64, (MAX_PROGRAMME,)),  # two knots at one place are a jump
        ("pitch", np.float64, (MAX_PROGRAMME,)),  # rad, above the horizon
        ("azimuth", np.float64, (MAX_PROGRAMME,)),  # rad, from north to east
        ("fixed", np.int64),  # 1: the horizon is that of the start, and does not turn
        ("axes", np.float64, (3, 3)),  # its east, north and up, unit vectors
        # 1: from the last knot on along the velocity in the air, once that is no steeper
        ("follows", np.int64),
        ("last_arc", np.int64),  # after which it is over
        ("end_over", np.int64),  # OVER_*
        ("end", np.float64),  # where it is over, within an arc; inf: nowhere
    ],
    align=True,
)

#: Wind over the ground by altitude: east and north components, m/s.
WIND = np.dtype(
    [
        ("knots", np.int64),  # of the table, constant below and zero above it; 0: none
        ("altitude", np.float64, (WIND_ROOM,)),  # m
        # east, north: c0..c3 of the cubic in the altitude above each knot
        ("cubic", np.float64, (2, WIND_ROOM, 4)),
        # 1 - cosine gust: from 0 to its greatest and back over its length
        ("gust", np.float64, (2,)),  # m/s, east and north at its middle
        ("gust_altitude", np.float64),  # m, of its middle
        ("gust_length", np.float64),  # m of altitude; 0: none
        ("stirred_below", np.float64),  # m, greatest altitude of turbulence
        ("stirred_step", np.float64),  # m, half of the thickness of its layers; 0: none
    ],
    align=True,
)

ENVIRONMENT = np.dtype(
    [
        ("mu", np.float64),  # m3/s2
        ("g0", np.float64),  # m/s2, exhaust velocity over specific impulse
        ("equatorial_radius", np.float64),  # m
        ("polar_radius", np.float64),  # m
        ("rotation_rate", np.float64),  # rad/s
        ("j2", np.float64),  # zero: inverse-square gravity, Eq. 2.13
        ("density_factor", np.float64),  # multiplies the tabulated density
        ("altitude_model", np.int64),  # ALTITUDE_*
        ("zero_longitude", np.float64),  # rad, right ascension of longitude zero at time 0
        ("wind", WIND),
        ("area_count", np.int64),  # number of protected areas
        ("areas", AREA, (MAX_AREAS,)),
        ("boost", BOOST),
    ],
    align=True,
)

TARGET = np.dtype(
    [
        ("kind", np.int64),  # TARGET_*
        ("radius", np.float64),
        ("speed", np.float64),
        ("flight_path_angle", np.float64),
        ("inclination", np.float64),
        ("ascending_node", np.float64),  # from the ECI x axis
        ("semi_major_axis", np.float64),
        ("eccentricity", np.float64),
        ("argument_of_perigee", np.float64),
        # of TARGET_ELEMENTS only: size, shape and anomaly of the orbit aimed at; elements that
        # are not named are free
        ("named", np.int64),  # NAMES_*, HEADS_*
        ("perigee_radius", np.float64),
        ("apogee_radius", np.float64),  # inf: escape
        ("c3", np.float64),  # m2/s2, twice the energy
        ("true_anomaly", np.float64),
        ("safe_radius", np.float64),  # least perigee radius of a safe orbit; 0: not given
    ],
    align=True,
)

ARC = np.dtype(
    [
        ("kind", np.int64),  # COAST or BURN
        ("stage", np.int64),
        ("thrust", np.float64),  # N, full thrust; 0 for a coast
        ("exhaust_velocity", np.float64),  # m/s; 1 for a coast
        ("mass_flow", np.float64),  # kg/s at full thrust; 0 for a coast
        ("engines", np.int64),  # number of identical engines; 0 for a coast
        # of the stage's own engines where boosters burn beside them; 0: nothing burns beside them,
        # they are a solid motor, or they are shut down
        ("core_thrust", np.float64),  # N
        ("core_flow", np.float64),  # kg/s
        ("duration", np.float64),  # s to its end by the clock; inf: free; 0: until depletion
        ("shortest", np.float64),  # s; lower bound of a free arc
        ("longest", np.float64),  # s; upper bound of a free arc; inf: until depletion
        ("min_altitude", np.float64),  # m, all along the arc; -inf: no floor
        ("min_perigee_radius", np.float64),  # m, of a coast's orbit; 0: no bound
        ("orbit", TARGET),  # of a coast, as far as its elements are named
        ("held", np.int64),  # 1: the direction at ignition is held
        ("vertical", np.int64),  # 1: the thrust is along the local vertical
        ("continues", np.int64),  # 1: the engines of the burn before it burn on, none is lit
        # flight in the air: force on the body, and ambient pressure on the nozzles
        ("body_axes", np.int64),  # 1: coefficients of axial and normal force, not of drag and lift
        ("drag_area", np.float64),  # m2, reference area; 0: no force
        # of the coefficient of drag or axial force over Mach, constant beyond both ends
        ("drag_knots", np.int64),
        ("drag_mach", np.float64, (MAX_DRAG_KNOTS,)),
        # c0..c3 of the cubic in the Mach number above each knot
        ("drag_cubic", np.float64, (MAX_DRAG_KNOTS, 4)),
        # likewise of lift or normal force per unit of the sine of the angle of attack; 0: none
        ("across_knots", np.int64),
        ("across_mach", np.float64, (MAX_DRAG_KNOTS,)),
        ("across_cubic", np.float64, (MAX_DRAG_KNOTS, 4)),
        ("exit_area", np.float64),  # m2, of all nozzles that burn; 0: vacuum thrust everywhere
        ("max_dynamic_pressure", np.float64),  # Pa; inf: no limit
        ("max_q_alpha", np.float64),  # Pa rad, of q sin(angle of attack); inf: no limit
        ("max_acceleration", np.float64),  # m/s2, limit by the throttle; inf: not throttled
        ("min_throttle", np.float64),  # fraction of full thrust
        ("begins_stage", np.int64),  # 1: the mass is reset to stack_mass when the arc begins
        ("stack_mass", np.float64),  # kg, the stage and all above it, when the stage begins
        ("propellant", np.float64),  # kg usable by the whole stage
        # thrust-time curve: fraction of full thrust, linear between knots
        ("tabled", np.int64),  # 1: a solid motor; its start curve is the whole burn
        ("start_knots", np.int64),  # 0: full thrust at ignition
        ("start_time", np.float64, (MAX_KNOTS,)),  # s after the ignition command
        ("start_fraction", np.float64, (MAX_KNOTS,)),
        ("start_flow", np.float64, (MAX_KNOTS,)),  # fraction of the full mass flow
        ("tail_knots", np.int64),  # 0: no thrust after the cut-off command
        ("tail_time", np.float64, (MAX_KNOTS,)),  # s after the cut-off command
        ("tail_fraction", np.float64, (MAX_KNOTS,)),
        # impulses of the transients, in seconds of full thrust
        ("start_loss", np.float64),  # lost at the start
        ("tail_gain", np.float64),  # gained after the cut-off command
    ],
    align=True,
)

JETTISON = np.dtype(
    [
        ("mass", np.float64),  # kg
        ("criterion", np.int64),  # HEATING_LIMIT, MISSION_TIME or TIME_AFTER_IGNITION
        ("value", np.float64),  # W/m2, s or s
        ("stage", np.int64),  # it drops no earlier than this stage's first burn
    ],
    align=True,
)

#: What falls after a separation: a stage, boosters of one kind, a jettison.
PIECE = np.dtype(
    [
        ("coefficient", np.float64),  # kg/m2, ballistic; 0: the mass over the area
        ("area", np.float64),  # m2, drag area; 0: without drag
    ],
    align=True,
)

#: A fall from the separation to the ground.
FALL = np.dtype(
    [
        ("dropped", np.int64),  # 0: it was not, and nothing else is known
        # at the separation
        ("time", np.float64),
        ("position", np.float64, (3,)),
        ("velocity", np.float64, (3,)),
        ("mass", np.float64),  # of all of one kind
        ("coefficient", np.float64),  # kg/m2; inf: without drag
        # at the impact; nan: it does not come down
        ("down_time", np.float64),
        ("place", np.float64, (3,)),  # unit vector from the centre in body-fixed axes
        ("latitude", np.float64),  # rad, geodetic
        ("longitude", np.float64),  # rad, -pi to pi
        ("speed", np.float64),  # m/s, relative to the ground
    ],
    align=True,
)

NAVIGATION = np.dtype(
    [
        ("time", np.float64),
        ("position", np.float64, (3,)),
        ("velocity", np.float64, (3,)),
        ("mass", np.float64),
        ("sensed_delta_v", np.float64, (3,)),  # integral of thrust acceleration since the start
        ("heating_rate", np.float64),  # W/m2 measured; nan: unknown
        ("arc", np.int64),  # index into the mission's arcs
        ("arc_start_time", np.float64),
        ("jettisoned", np.int64),  # bit k: jettison k is done
    ],
    align=True,
)

#: State of a flight's sequence; these fields are part of larger records.
SEQUENCE = np.dtype(
    [
        ("time", np.float64),
        ("mass", np.float64),
        ("arc", np.int64),
        ("arc_start_time", np.float64),
        ("ignited_stage", np.int64),  # stage ignited last; -1: none
        ("ignition_time", np.float64),  # of that stage
        ("propellant_used", np.float64),  # kg, by the present stage
        ("tail_arc", np.int64),  # arc in its tail-off; -1: none
        ("tail_start_time", np.float64),
        ("jettisoned", np.int64),  # bit k: jettison k is done
        ("inserted", np.int64),  # 1: cut off by command
    ],
    align=True,
)

STEERING = np.dtype(
    [
        # direction(t) = unit(direction + direction_rate (t - reference_time))
        ("reference_time", np.float64),
        ("direction", np.float64, (3,)),  # unit vector
        ("direction_rate", np.float64, (3,)),  # 1/s
        ("cutoff_time", np.float64),  # predicted main-engine cut-off; nan: not known yet
        ("jettison", np.int64),  # index of the jettison timed by guidance; -1: none
        ("jettison_time", np.float64),  # nan: none
        # end of each free arc; nan: not free, past, or not planned
        ("arc_end_times", np.float64, (MAX_ARCS,)),
    ],
    align=True,
)


class MissionArrays(NamedTuple):
    """Hold a mission compiled for the kernels.

    Attributes:
        environment: shape (1,), dtype ENVIRONMENT.
        atmosphere: shape (n, 9): altitude m, then the coefficients c0..c3 of
            log density = c0 + c1 x + c2 x^2 + c3 x^3 with x = h - altitude, then those of the
            log pressure.
        arcs: shape (n,), dtype ARC, in flight order.
        jettisons: shape (n,), dtype JETTISON, in the order of the file; at most 8.
        target: shape (1,), dtype TARGET.
    """

    environment: NDArray[np.void]
    atmosphere: NDArray[np.float64]
    arcs: NDArray[np.void]
    jettisons: NDArray[np.void]
    target: NDArray[np.void]

    def records(self) -> "MissionRecords":
        """Return the records of the mission, as kernels pass them on."""
        return MissionRecords(
            self.environment[0], self.atmosphere, self.arcs, self.jettisons, self.target[0]
        )


class MissionRecords(NamedTuple):
    """Hold the records of a mission, as kernels pass them on: a record is a pointer.

    Attributes:
        environment: record ENVIRONMENT.
        atmosphere: shape (n, 9), as in :class:`MissionArrays`.
        arcs: dtype ARC.
        jettisons: dtype JETTISON.
        target: record TARGET.
    """

    environment: Record
    atmosphere: NDArray[Any]
    arcs: NDArray[Any]
    jettisons: NDArray[Any]
    target: Record
