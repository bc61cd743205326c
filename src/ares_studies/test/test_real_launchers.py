# SPDX-License-Identifier: Apache-2.0
"""Real launchers, planned from their files alone and flown by every law at the first attempt."""

from functools import cache

import numpy as np
import pytest

from ares_guidance.laws import find_law
from ares_models.arrays import COAST
from ares_models.floors import edge_of_air
from ares_models.input_file import read_input
from ares_models.judge import End
from ares_models.kernels.environment import altitude
from ares_models.mission import MISSION, Mission, load_mission
from ares_models.orbits import Elements
from ares_optimizer.solution import Solution
from ares_studies.closed_loop import fly_compiled, plan_solution, ready_law
from ares_trials.testing.arrivals import judged
from ares_vehicle_sim.arrays import ARC_ENDED
from ares_vehicle_sim.simulator import Simulator, SimulatorOptions

LAUNCHERS = ("ariane5_eca", "electron_sso", "falcon9_gto", "soyuz_fregat", "vulcan_gto")
LAWS = ("peg", "igm", "optimal")
ALSO = pytest.mark.trial
#: One or two by each law; `make trials` flies every launcher by each.
SOME = {
    ("ariane5_eca", "peg"),
    ("electron_sso", "igm"),
    ("falcon9_gto", "optimal"),
}
#: Of the optimum's mass.
MOST_LOST = 3e-3


@cache
def optimum(name: str) -> Solution:
    """Return the plan that every law follows; it is searched for once."""
    return plan_solution(load_mission(name), find_law("peg"))


@pytest.mark.parametrize(
    ("name", "law_name"),
    [
        pytest.param(name, law, marks=[] if (name, law) in SOME else [ALSO])
        for law in LAWS
        for name in LAUNCHERS
    ],
)
def test_a_real_launcher_arrives_with_what_its_plan_says(name: str, law_name: str) -> None:
    mission = load_mission(name)
    arrays = mission.arrays()
    environment = arrays.environment[0]
    simulator = Simulator(mission, SimulatorOptions(navigation_period_s=0.5))
    law = ready_law(mission, law_name, state=np.array([simulator.navigation]))
    lowest = np.inf
    while not simulator.complete:
        law.step(simulator.navigation)
        simulator.command(law.steering)
        simulator.advance()
        now = simulator.navigation
        arc = arrays.arcs[now["arc"]]
        if arc["kind"] == COAST and np.isinf(arc["duration"]):
            lowest = min(lowest, altitude(tuple(now["position"]), environment))
    plant = simulator.plant
    reached = judged(mission, plant)
    assert reached.end is End.TARGET, reached
    assert float(plant["mass"]) > (1.0 - MOST_LOST) * optimum(name).m_f_kg
    # the parking coast keeps above the air
    assert lowest > edge_of_air(arrays) - 1e3


@pytest.mark.parametrize("law_name", LAWS)
def test_every_law_flies_the_parking_orbit_that_a_coast_names(law_name: str) -> None:
    data, _ = read_input(MISSION.find("vulcan_gto"), MISSION)
    coast = data["stages"][0]["arcs"][2]
    coast |= {"perigee_altitude_m": 185e3, "apogee_altitude_m": 185e3}
    mission = Mission.model_validate(data)
    environment = mission.arrays().environment[0]
    mu, equator = float(environment["mu"]), float(environment["equatorial_radius"])
    plant = fly_compiled(mission, law=law_name).plant
    assert judged(mission, plant).end is End.TARGET
    burns = [e for e in plant["events"] if e["type"] == ARC_ENDED and e["index"] == 1]
    orbit = Elements.from_state(burns[0]["position"], burns[0]["velocity"], mu)
    apogee = orbit.semi_major_axis * (1.0 + orbit.eccentricity)
    assert orbit.perigee_radius - equator == pytest.approx(185e3, abs=100.0)
    assert apogee - equator == pytest.approx(185e3, abs=100.0)
