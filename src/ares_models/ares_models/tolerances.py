# SPDX-License-Identifier: Apache-2.0
"""Flown to the target: an end within these of what the target asks for.

They are wider than what an undisturbed flight does, so that a limited attitude rate, a long
guidance cycle or navigation errors are not called a failure, and far narrower than any miss.
The one judge (:mod:`ares_models.judge`) uses them, for a flight, a campaign, an abort map, a page
and the proof of an optimum alike.
"""

#: Of the state at cut-off. What a target names of an orbit may be off by what these come to.
RADIUS_M = 100.0
SPEED_M_S = 0.1
FLIGHT_PATH_ANGLE_DEG = 1e-3
#: Inclination, ascending node, and the direction of perigee beside what the above come to.
ORIENTATION_DEG = 1e-2

#: Limits of an optimum that are no part of its target, as another integrator flies it.
HEATING_W_M2 = 0.2
PROPELLANT_KG = 0.1
#: Below the floor of an arc by so much, a flight still keeps it.
FLOOR_M = 10.0

#: Of an end near the target: a perigee over the equatorial radius at which an orbit lasts a day,
#: where the mission names none; and a cut-off's scatter of it.
SAFE_PERIGEE_M = 120_000.0
PERIGEE_SLACK_M = 500.0
#: Radius, or perigee of an orbit, and angles within which the target is the same, but lowered;
#: and by how much faster it may be.
SAME_RADIUS_M = 5_000.0
SAME_SPEED_M_S = 1.0
SAME_ANGLE_DEG = 0.1
