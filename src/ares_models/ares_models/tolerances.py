"""Flown to the target: an insertion within these of what the target asks for.

They are wider than what an undisturbed flight does, so that a limited attitude rate, a long
guidance cycle or navigation errors are not called a failure, and far narrower than any miss.
Every judge uses them: of a flight, of a campaign, of a page.
"""

RADIUS_M = 100.0
SPEED_M_S = 0.1
FLIGHT_PATH_ANGLE_DEG = 1e-3
#: Inclination, ascending node, argument of perigee.
ORIENTATION_DEG = 1e-2
