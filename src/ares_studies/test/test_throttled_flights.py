# SPDX-License-Identifier: Apache-2.0
"""Throttled burns and burns in held attitude, flown closed loop to the target."""

import math

import numpy as np
import pytest
import yaml

from ares_guidance.laws import check_law
from ares_guidance.plan import plan_of
from ares_models.input_file import read_input
from ares_models.mission import MISSION, TEMPLATE, load_mission, parse_mission
from ares_optimizer.solution import Check, Status
from ares_optimizer.solve import solve
from ares_studies.closed_loop import fly_compiled, offline_trajectory, ready_law
from ares_vehicle_sim.dispersions import Dispersions

TEXT = MISSION.find("ares_v").read_text()


def mission_with(tmp_path, stage, keys):
    """Add keys to a stage's burn of Ares V."""
    at = TEXT.index("thrust_n", TEXT.index(f"- name: {stage}"))
    path = tmp_path / "mission.yaml"
    path.write_text(TEXT[:at] + keys + "\n    " + TEXT[at:])
    return load_mission(path)


def missed(mission, plant):
    """Compute the errors in radius m, speed m/s, flight-path angle rad."""
    target = mission.arrays().target[0]
    r, v = plant["position"], plant["velocity"]
    radius, speed = np.linalg.norm(r), np.linalg.norm(v)
    angle = math.asin(r @ v / (radius * speed))
    return (
        radius - target["radius"],
        speed - target["speed"],
        angle - target["flight_path_angle"],
    )


#: Upper stage: 4.2 m/s2 at ignition, 7.5 at cut-off; core: 22 to 58.
THROTTLED = {
    "upper stage": "max_acceleration_m_s2: 6.0",
    "upper stage, little": "max_acceleration_m_s2: 6.0\n    min_throttle: 0.9",
    "upper stage, at once": "max_acceleration_m_s2: 4.1",
    "core": "max_acceleration_m_s2: 30.0",
}


@pytest.mark.parametrize("law", ["peg", "igm"])
@pytest.mark.parametrize("case", THROTTLED)
def test_a_throttled_burn_comes_to_the_target(tmp_path, case, law):
    mission = mission_with(tmp_path, case.partition(",")[0], THROTTLED[case])
    flight = fly_compiled(mission, law=law)
    assert flight.plant["inserted"] == 1
    radius, speed, angle = missed(mission, flight.plant)
    assert abs(radius) < 5.0
    assert abs(speed) < 0.05
    assert abs(angle) < 1e-5
    # well planned from the first solution on
    assert flight.guidance["stale_cycles"] == 0


def test_a_throttled_burn_with_another_engine(tmp_path):
    mission = mission_with(tmp_path, "upper stage", THROTTLED["upper stage, little"])
    for thrust in (-0.02, 0.02):
        strong = Dispersions(thrust={"mean": thrust}, specific_impulse={"mean": -0.5 * thrust})
        flight = fly_compiled(mission, dispersions=strong)
        radius, speed, _ = missed(mission, flight.plant)
        assert flight.plant["inserted"] == 1
        assert abs(radius) < 20.0
        assert abs(speed) < 0.1


@pytest.mark.parametrize("law", ["peg", "igm", "optimal"])
def test_a_held_first_burn_is_aimed_at_once(tmp_path, law):
    """Hold the direction of the ignition: the free burn after it corrects the rest."""
    mission = mission_with(tmp_path, "core", "attitude: held")
    flight = fly_compiled(mission, law=law)
    assert flight.plant["inserted"] == 1
    radius, speed, angle = missed(mission, flight.plant)
    assert abs(radius) < 5.0
    assert abs(speed) < 0.05
    assert abs(angle) < 1e-5
    # turning with the flight is worth something, but not much
    plain = fly_compiled(load_mission("ares_v")).plant["mass"]
    assert 0.0 < plain - flight.plant["mass"] < 3000.0


def test_who_cannot_fly_it_is_refused_by_name(tmp_path):
    held = mission_with(tmp_path, "core", "attitude: held")
    start = held.start().navigation()
    with pytest.raises(ValueError, match="expected peg, which flies burns with attitude: held"):
        check_law("peg_thesis", held.arrays(foreseen=True), start)


#: Arcs of the first stage of `data/template.yaml`, throttled where the dynamic pressure is highest.
BUCKET = """
    arcs:
      - {name: rise, thrust_n: 225000.0, isp_s: 311.0, burn_time_s: 20.0, exit_area_m2: 0.3,
         vertical_rise_s: 10.0}
      - {name: full, thrust_n: 225000.0, isp_s: 311.0, burn_time_s: 25.0, exit_area_m2: 0.3}
      - {name: throttled, thrust_n: 180000.0, isp_s: 311.0, burn_time_s: 25.0, exit_area_m2: 0.3}
      - {name: full again, thrust_n: 225000.0, isp_s: 311.0, burn_time_s: free, exit_area_m2: 0.3}
"""


@pytest.mark.trial
def test_a_launcher_is_throttled_through_the_high_pressure():
    data, _ = read_input(TEMPLATE, MISSION)
    stage = data["stages"][0]
    for key in ("thrust_n", "isp_s", "burn_time_s", "exit_area_m2", "vertical_rise_s"):
        del stage[key]
    stage |= yaml.safe_load(BUCKET)
    # no ascent at full thrust keeps below this
    stage["max_dynamic_pressure_pa"] = 30000.0
    mission = parse_mission(yaml.safe_dump(data), "throttled.yaml")
    solution = solve(mission, "auto")
    assert solution.status is Status.CONVERGED
    pressure = next(c for c in solution.constraints if c.key is Check.DYNAMIC_PRESSURE)
    assert pressure.value < 1.001 * 30000.0
    plan = plan_of(offline_trajectory(solution), mission.arrays(foreseen=True))
    flight = fly_compiled(mission, law=ready_law(mission, "peg", plan=plan))
    assert flight.plant["inserted"] == 1
    assert flight.plant["mass"] == pytest.approx(solution.m_f_kg, rel=5e-3)
