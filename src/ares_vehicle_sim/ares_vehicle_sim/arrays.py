"""Structured dtypes of the plant."""

import numpy as np

from ares_models.arrays import STEERING

MAX_EVENTS = 64

FLIGHT_STARTED = 1
IGNITION = 2
ARC_ENDED = 3
STAGING = 4
JETTISON_DONE = 5
CUTOFF = 6
DEPLETION = 7
FLIGHT_COMPLETE = 8
IMPACT = 9

EVENT = np.dtype(
    [
        ("type", np.int64),
        ("index", np.int64),  # arc, stage or jettison, by type
        ("time", np.float64),
        ("position", np.float64, (3,)),
        ("velocity", np.float64, (3,)),
        ("mass", np.float64),  # after the event
        ("heating_rate", np.float64),
    ],
    align=True,
)

OPTIONS = np.dtype(
    [
        ("max_step", np.float64),  # s, of the integrator
        ("attitude_rate_limit", np.float64),  # rad/s; inf: the thrust follows at once
    ],
    align=True,
)

PLANT = np.dtype(
    [
        ("time", np.float64),
        ("position", np.float64, (3,)),
        ("velocity", np.float64, (3,)),
        ("mass", np.float64),
        ("sensed_delta_v", np.float64, (3,)),
        ("arc", np.int64),
        ("arc_start_time", np.float64),
        ("ignited_stage", np.int64),  # last stage that was lit; -1: none
        ("ignition_time", np.float64),  # of that stage
        ("propellant_used", np.float64),  # kg, by the present stage
        ("tail_arc", np.int64),  # arc whose thrust is dying away; -1: none
        ("tail_start_time", np.float64),
        ("jettisoned", np.int64),  # bit k: jettison k is done
        ("jettison_time", np.float64, (8,)),  # commanded; nan: not yet
        ("complete", np.int64),
        ("inserted", np.int64),  # cut off by command, not by depletion
        ("direction", np.float64, (3,)),  # of the thrust, unit
        ("command", STEERING),
        ("peak_heating_after_jettison", np.float64),
        ("event_count", np.int64),
        ("events", EVENT, (MAX_EVENTS,)),
    ],
    align=True,
)

_TRUTH_FIELDS = [
    ("position", np.float64, (3,)),
    ("velocity", np.float64, (3,)),
    ("mass", np.float64),
    ("thrust_direction", np.float64, (3,)),
    ("thrust", np.float64),
    ("mass_flow", np.float64),
    ("altitude", np.float64),
    ("relative_speed", np.float64),
    ("flight_path_angle", np.float64),
    ("inclination", np.float64),
    ("ascending_node", np.float64),
    ("density", np.float64),
    ("heating_rate", np.float64),
    ("arc", np.int64),
    ("jettisoned", np.int64),
]

TRUTH = np.dtype(_TRUTH_FIELDS, align=True)

#: Names of the fields, in order; those of the message VehicleState.
TRUTH_FIELDS = tuple(str(field[0]) for field in _TRUTH_FIELDS)
