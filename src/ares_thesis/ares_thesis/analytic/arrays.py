# SPDX-License-Identifier: Apache-2.0
"""Define the structured dtypes of the analytic method: burns and parts, with their choices."""

import numpy as np

#: Polynomials of sin(gamma): 5.9; 5.8; a cubic with the slope of Eq. 5.6 at both ends; the cubic
#: corrected at the nodes between.
LINEAR = 0
QUADRATIC = 1
CUBIC = 2
FITTED = 3
#: Steering: tan(theta) linear against the local horizon (5.16); against the horizon at the start of
#: the part; with the curvature of the primer vector by the gravity gradient.
LOCAL = 0
INERTIAL = 1
PRIMER = 2
#: Integral of V sin(gamma): closed form, trapezoid, quadratic V (5.25, 5.26).
EXACT = 0
TRAPEZOID = 1
QUADRATIC_SPEED = 2
MAX_NODES = 5
SINE_TERMS = MAX_NODES + 2
POWERS = MAX_NODES + SINE_TERMS
BURN = np.dtype(
    [
        ("form", np.int64),  # LINEAR, QUADRATIC, CUBIC or FITTED
        ("nodes", np.int64),  # 2, 3 or 5, equally spaced, both ends included
        ("steps", np.int64),  # of the trapezoid
        ("exhaust_velocity", np.float64),  # m/s
        ("tau", np.float64),  # s, mass over mass flow at the start of the burn, Eq. 5.7
        ("begin", np.float64),  # s after the start of the part
        ("duration", np.float64),  # s
        ("gravity", np.float64),  # m/s2, constant over the burn
        # at the nodes
        ("radius", np.float64, (MAX_NODES,)),  # m
        ("speed", np.float64, (MAX_NODES,)),  # m/s
        ("sine", np.float64, (MAX_NODES,)),  # sin(gamma)
        ("range_angle", np.float64, (MAX_NODES,)),  # rad, since the start of the part
        ("cos_theta", np.float64, (MAX_NODES,)),  # thrust against the local horizon
        ("sin_theta", np.float64, (MAX_NODES,)),
        ("moments", np.float64, (MAX_NODES, MAX_NODES)),  # log_moments up to each node
        ("moments_of", np.float64),  # duration / tau of these moments
        ("end_radius", np.float64),  # m, by the position integral of the part
        # coefficients, lowest power of x first
        ("sin_gamma", np.float64, (SINE_TERMS,)),
        ("cos_alpha", np.float64, (MAX_NODES,)),
        ("warm", np.int64),  # 1: the nodes hold an earlier solution of this burn
    ],
    align=True,
)
PART = np.dtype(
    [
        ("mu", np.float64),  # m3/s2
        ("burns", np.int64),  # 1 or 2
        ("steering", np.int64),
        ("solved", np.int64),  # 1: gamma follows from the motion; 0: assumed as printed
        ("mean_gravity", np.int64),  # 0: gravity at the start of the burn
        ("integral", np.int64),
        ("timed", np.int64),  # 1: the duration of the last burn is given
        ("step_scale", np.float64),  # alpha_s of Eq. 5.31
        ("max_iterations", np.int64),
        # start
        ("radius", np.float64),
        ("speed", np.float64),
        ("gamma", np.float64),
        # target
        ("target_radius", np.float64),
        ("target_speed", np.float64),
        ("target_gamma", np.float64),
        # mean values for PRIMER, see set_law
        ("mean_radius", np.float64),
        ("mean_speed", np.float64),
        # unknowns: thrust above the horizon at the start and at the end (LOCAL: local horizon;
        # else the horizon at the start of the part), gamma at the joint of two burns
        ("theta_start", np.float64),
        ("theta_end", np.float64),
        ("gamma_joint", np.float64),
        ("time_to_go", np.float64),  # s, duration of the last burn
        # thrust direction in powers of time (s): along and above the horizon
        ("along", np.float64, (4,)),
        ("above", np.float64, (4,)),
        # of the latest projection: desired minus projected
        ("position_error", np.float64),  # m
        ("speed_error", np.float64),  # m/s
        ("gamma_error", np.float64),  # rad
        # of the iteration
        ("iterations", np.int64),
        ("searches", np.int64),  # projections in the search for the time to go
        ("stop", np.int64),  # another thread writes 1 here to end the iteration
        ("partials", np.float64, (2,)),  # Eq. 5.32, m/rad, by the first two unknowns
    ],
    align=True,
)
