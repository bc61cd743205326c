# SPDX-License-Identifier: Apache-2.0
"""Navigation states and a mission for tests only."""

from typing import Any

from ares_guidance.law import Law
from ares_models.kernels.environment import heating_rate
from ares_models.kernels.vectors import load
from ares_models.mission import Mission

#: Shipped missions that a law flies without a plan.
SELF_STARTING = (
    *("apollo11_ascent", "ares_v", "ares_v_transients", "delta_iii", "saturn_v_as506"),
    "space_shuttle_sts121",
)
#: Titan II in vacuum, after MechJeb2's tests; format with ``burn`` and ``coast``. The Earth is
#: smaller than real, because the optimum dips below the real ground.
RESTART = """
name: titan
title: Titan II in vacuum
source: MechJeb2 MechJebLibTest
environment:
  mu_m3_s2: 3.986004418e14
  earth:
    {{equatorial_radius_m: 6.2e+6, polar_radius_m: 6.2e+6, rotation_rate_rad_s: 7.29211585e-5}}
  atmosphere: {{model: us76, density_factor: 1.0e-12}}
initial_state:
  time_s: 0.0
  position_m: [5593203.65707947, 0.0, 3050526.81522927]
  velocity_m_s: [0.0, 407.862893197274, 0.0]
stages:
  - name: stage 1
    ignition_mass_kg: 157355.487476332
    thrust_n: 2340000.0
    isp_s: 301.817977905273
    burn_time_s: 148.102380138703
  - name: stage 2
    ignition_mass_kg: 32758.6353093992
    propellant_kg: 27500.0
    arcs:
      - {{thrust_n: 456100.006103516, isp_s: 315.000112652779, burn_time_s: {burn}}}
      - {{coast_s: {coast}}}
      - {{thrust_n: 456100.006103516, isp_s: 315.000112652779, burn_time_s: free}}
target:
  radius_m: 6556000.0
  speed_m_s: 7797.392848568
  flight_path_angle_deg: 0.0
  inclination_deg: 28.608
"""


def first_navigation(mission: Mission, **changes: Any) -> Any:
    """Return the navigation state at the mission's start, record NAVIGATION.

    Args:
        mission: the mission.
        changes: fields to overwrite.
    """
    start = mission.start()
    arrays = mission.arrays()
    nav = start.navigation()
    nav["heating_rate"] = heating_rate(
        load(start.position), load(start.velocity), arrays.environment[0], arrays.atmosphere
    )
    for name, value in changes.items():
        nav[name] = value
    return nav[0]


def step_anew(law: Law, nav: Any) -> bool:
    """Step a law on a state that need not follow from the previous one.

    Args:
        law: the law.
        nav: record NAVIGATION.
    """
    law.state["navigation"]["accepted"] = 0
    return law.step(nav)
