# SPDX-License-Identifier: Apache-2.0
"""Define the structured dtype of a judged flight."""

import numpy as np

from ares_models.arrays import FALL, MAX_PIECES
from ares_models.kernels.judging import JUDGED

RESULT = np.dtype(
    [
        ("end_time", np.float64),  # mission elapsed time, s
        ("mass", np.float64),  # kg at the end, with whatever is still on
        ("propellant_used", np.float64),  # kg, by the last stage flown
        ("cutoff_time", np.float64),  # s, of the command; nan: none came
        # the part dropped by the heating; nan: it was not
        ("jettison_time", np.float64),  # s
        ("jettison_heating", np.float64),  # W/m2, true
        ("jettison_limit", np.float64),  # W/m2, true
        ("peak_heating_after", np.float64),  # W/m2, from the jettison on
        # greatest of a flight in the air, and as fractions of the limits; nan: no air, no limit
        ("most_dynamic_pressure", np.float64),  # Pa
        ("most_q_alpha", np.float64),  # Pa, q times the sine of the angle of attack
        ("dynamic_pressure_share", np.float64),
        ("q_alpha_share", np.float64),
        # flown minus target, at the end, and what it comes to
        *JUDGED,
        ("ended", np.int64),  # CUTOFF, DEPLETION, IMPACT or TIME_LIMIT
        ("converged", np.int64),  # 1: guidance had a solution, or flew a programme to the end
        ("iterations", np.int64),
        ("by_peg", np.int64),  # navigation states answered by peg's solution, whatever the law
        ("navigation_refused", np.int64),  # states that guidance took for faults
        ("violations", np.int64),  # answers that its monitors held back
        ("on_board", np.int64),  # bit k: jettison k was not done before the cut-off
        ("struck", np.int64),  # of the failure, if there is one: as of FAILURE
        # what guidance found failed, first of all
        ("found", np.int64),  # FOUND_*
        ("found_time", np.float64),  # s
        # the three that make a success
        ("terminal_accuracy", np.int64),
        ("fairing_off", np.int64),
        ("heating_kept", np.int64),
        ("falls", FALL, (MAX_PIECES,)),  # of what was dropped
    ],
    align=True,
)
