# SPDX-License-Identifier: Apache-2.0
"""Fairings that wait for the heating, beside what drops later by the clock."""

from pathlib import Path

import pytest

from ares_models.input_file import read_input
from ares_models.judge import End
from ares_models.mission import MISSION, TEMPLATE, Mission, load_mission
from ares_optimizer.solve import solve
from ares_studies.closed_loop import fly_compiled, offline_trajectory, ready_law
from ares_trials.testing.arrivals import judged
from ares_vehicle_sim.arrays import JETTISON_DONE

PADS = Path(__file__).parents[3] / "benchmarks" / "pads"


def test_guidance_is_told_when_the_fairing_goes_and_not_the_last_drop():
    data = read_input(TEMPLATE, MISSION)[0]
    battery = {"name": "battery", "mass_kg": 10.0, "stage": "second stage"}
    data["jettisons"].append(battery | {"time_after_ignition_s": 200.0})
    found = solve(Mission.model_validate(data), "auto")
    fairing_s, battery_s = found.jettison_times_s
    assert fairing_s < 200.0 < battery_s == found.t_plf_s
    assert found.heating_jettison_s == fairing_s
    assert offline_trajectory(found).jettison_time == fairing_s


@pytest.mark.trial
@pytest.mark.parametrize("law", ["peg", "igm", "optimal"])
def test_a_fairing_goes_in_the_boost_before_what_drops_later(law):
    # it went 78 s late, with the aft section, and took 2.7 % of the final mass
    mission = load_mission(PADS / "soyuz21b_fregat_gto.yaml")
    plan = solve(mission, "auto")
    flight = fly_compiled(mission, law=ready_law(mission, law))
    drops = {one["index"]: one["time"] for one in flight.events if one["type"] == JETTISON_DONE}
    assert drops[0] == pytest.approx(plan.jettison_times_s[0], abs=1.0)
    assert judged(mission, flight.plant).end is End.TARGET
    assert float(flight.plant["mass"]) > 0.997 * plan.m_f_kg
