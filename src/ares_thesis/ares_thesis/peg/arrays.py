# SPDX-License-Identifier: Apache-2.0
"""Numbers of law `peg_thesis`."""

#: `law` of GuidanceStatus.
LAW_PEG_THESIS = 2

#: The plane that modes 1 and 2 hold: that in which each begins, that of the start, none.
PLANE_OF_MODE = 0
PLANE_OF_FLIGHT = 1
PLANE_FREE = 2
