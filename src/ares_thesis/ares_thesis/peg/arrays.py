# SPDX-License-Identifier: Apache-2.0
"""Define the constants and the memory of law `peg_thesis`."""

import numpy as np

from ares_guidance.arrays import GUIDANCE_SETTINGS, MAX_SEGMENTS
from ares_models.arrays import ARC, TARGET

#: `law` of GuidanceStatus.
LAW_PEG_THESIS = 2

#: Plane constraint of modes 1 and 2: the plane at the start of each mode, that of the flight, none.
PLANE_OF_MODE = 0
PLANE_OF_FLIGHT = 1
PLANE_FREE = 2

THESIS_MEMORY = np.dtype(
    [
        # the plan: the state at the jettison, and the burns up to it
        ("planned", np.int64),  # 0: no plan, the law is plain PEG
        ("target", TARGET),  # state at the jettison; its plane is set when a mode begins
        ("part_two", np.float64),  # s from the jettison to cut-off
        # m/s: start to staging, staging to jettison, jettison to cut-off
        ("delta_v", np.float64, (3,)),
        ("plane", np.int64),  # PLANE_*: plane constraint of modes 1 and 2
        ("split_at_staging", np.int64),  # 0: mode 1 lasts to the jettison
        ("early_rules", GUIDANCE_SETTINGS),  # settings of modes 1 and 2
        ("late_rules", GUIDANCE_SETTINGS),  # settings of mode 3
        ("early_arcs", ARC, (MAX_SEGMENTS,)),  # the mission's, without the last tail-off
        # the flight
        ("mode", np.int64),  # 1, 2, 3; 0: not begun
        ("jettison_time", np.float64),  # predicted; nan: not yet
        # last solution of the previous mode, flown on when the new mode finds none
        ("fallback", np.int64),  # 1: valid
        ("fallback_jettison_time", np.float64),
        ("fallback_reference_time", np.float64),
        ("fallback_direction", np.float64, (3,)),
        ("fallback_direction_rate", np.float64, (3,)),
    ],
    align=True,
)
