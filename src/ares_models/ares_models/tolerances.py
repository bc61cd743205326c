# SPDX-License-Identifier: Apache-2.0
"""Tolerances of the judge: largest errors of an end that counts as on the target.

They are wider than the errors of an undisturbed flight, so that a limited attitude rate, a long
guidance cycle or navigation errors do not count as a failure, and far narrower than any miss. The
judge (:mod:`ares_models.judge`) applies them to flights, campaigns, abort maps and pages, and to
the proof of an optimum.
"""

#: Errors of the state at cut-off. The tolerances of an orbit's elements follow from these.
RADIUS_M = 100.0
SPEED_M_S = 0.1
FLIGHT_PATH_ANGLE_DEG = 1e-3
#: Errors of inclination and ascending node; the argument of perigee gets this in addition.
ORIENTATION_DEG = 1e-2

#: Constraint violations of an optimum in its proof by another integrator.
HEATING_W_M2 = 0.2
PROPELLANT_KG = 0.1
#: The same of dynamic pressure and q alpha, relative to the limit.
PRESSURE_SHARE = 1e-3
#: Depth below the surface at which a vehicle at rest still stands on it, m: rounding.
ROUNDING_M = 1e-3
#: Tolerated depth below the floor of an arc.
FLOOR_M = 10.0
#: Factor on the tolerances of the target and of floors in a planned flight through the air: what it
#: is off at the end of the air grows along a coast.
WIDER_IN_AIR = 3.0

#: Safe perigee altitude above the equatorial radius if the mission gives none: an orbit there lasts
#: a day; and the tolerance of a flown perigee.
SAFE_PERIGEE_M = 120_000.0
PERIGEE_SLACK_M = 500.0
#: A lowered target: largest difference of radius (or perigee), of angles, and surplus of speed.
SAME_RADIUS_M = 5_000.0
SAME_SPEED_M_S = 1.0
SAME_ANGLE_DEG = 0.1
