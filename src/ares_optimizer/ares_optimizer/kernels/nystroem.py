# SPDX-License-Identifier: Apache-2.0
"""Define the tableau of a Runge-Kutta-Nystroem method of order 6 for r'' = f(t, r).

Source: Dormand, El-Mikkawy, Prince, "Families of Runge-Kutta-Nystrom formulae", IMA J. Numer.
Anal. 7 (1987), the 6(4) pair with six stages, first stage same as last: RKN6(4)6FM.
"""

import numpy as np

STAGES = 6
#: Times of the stages, as fractions of the step.
NODES = np.array([0.0, 1 / 10, 3 / 10, 7 / 10, 17 / 25, 1.0])
#: Weights for the positions: stage i uses the first i entries of row i.
WEIGHTS = np.array(
    [
        [0.0, 0.0, 0.0, 0.0, 0.0],
        [1 / 200, 0.0, 0.0, 0.0, 0.0],
        [-1 / 2200, 1 / 22, 0.0, 0.0, 0.0],
        [637 / 6600, -7 / 110, 7 / 33, 0.0, 0.0],
        [225437 / 1968750, -30073 / 281250, 65569 / 281250, -9367 / 984375, 0.0],
        [151 / 2142, 5 / 116, 385 / 1368, 55 / 168, -6250 / 28101],
    ]
)
#: Weights for the velocity at the end of the step.
VELOCITY_WEIGHTS = np.array([151 / 2142, 25 / 522, 275 / 684, 275 / 252, -78125 / 112404, 1 / 12])
