# SPDX-License-Identifier: Apache-2.0
"""Define the structured dtypes of the sparse program.

Units of the program: length equatorial radius R, time ``sqrt(R^3/mu)``, mass that at the start; mu
is 1. A flight is a chain of states; a phase of smooth thrust covers several intervals, and an
interval has one state per Radau point.
"""

import numpy as np

#: Thrust direction of a phase: none, free at each point, one for the burn, or the local vertical.
COASTING = 0
GUIDED = 1
HELD_ATTITUDE = 2
VERTICAL = 3

PHASE = np.dtype(
    [
        ("arc", np.int64),  # index into the mission's arcs
        ("in_air", np.int64),  # 1: forces of the air or a vertical rise are part of it
        ("steering", np.int64),  # COASTING, GUIDED, HELD_ATTITUDE or VERTICAL
        ("length", np.int64),  # column of its length
        ("mass", np.int64),  # column of the mass at its begin
        # 1: its begin is free and its end is known, in the time of its arc
        ("from_end", np.int64),
        ("thrust", np.float64),  # at its begin, or at its end
        ("thrust_slope", np.float64),
        ("flow", np.float64),  # mass flow there
        ("flow_slope", np.float64),
        ("fading", np.float64),  # thrust, flow and mass fall as exp(-fading t); 0: they do not
        ("acceleration", np.float64),  # of a fading phase
        ("end", np.int64),  # column of the mass at its end, before drops
        ("link", np.int64),  # row that relates the two masses
    ],
    align=True,
)

#: One Radau point.
POINT = np.dtype(
    [
        ("phase", np.int64),
        ("node", np.int64),  # state at the begin of the interval
        ("number", np.int64),  # in the interval, from 1 on
        ("width", np.float64),  # of the interval, as fraction of its phase
        ("fraction", np.float64),  # time into the phase, as fraction of the phase
        ("control", np.int64),  # column of the first of three variables; -1: none
    ],
    align=True,
)

#: Kinds of constraints on one state.
TARGET_RULE = 0
HEATING_RULE = 1
FLOOR_RULE = 2
PERIGEE_RULE = 3
DYNAMIC_PRESSURE_RULE = 4
Q_ALPHA_RULE = 5

RULE = np.dtype(
    [
        ("kind", np.int64),
        ("node", np.int64),
        ("row", np.int64),  # first row
        ("rows", np.int64),
        ("target", np.int64),  # index into the program's targets, of a TARGET_RULE
        ("control", np.int64),  # column of the first of three variables; -1: none
        # log of a heating in W/m2, altitude in m, perigee radius in m, pressure in Pa or Pa rad
        ("level", np.float64),
    ],
    align=True,
)
