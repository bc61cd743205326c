# SPDX-License-Identifier: Apache-2.0
"""Engines other than the mission's: guidance measures them and plans with them."""

import math

import pytest

from ares_guidance.laws import make_law
from ares_models.mission import load_mission
from ares_models.orbits import Insertion
from ares_optimizer.solve import solve
from ares_vehicle_sim.arrays import JETTISON_DONE
from ares_vehicle_sim.simulator import Simulator, SimulatorOptions


@pytest.fixture(scope="module")
def ares_v():
    return load_mission("ares_v")


def with_upper_stage(mission, thrust, specific_impulse):
    """Scale the mission's upper-stage engine."""
    core, upper = mission.stages
    arc = upper.model_copy(
        update={
            "thrust_n": thrust * upper.thrust_n,
            "isp_s": specific_impulse * upper.isp_s,
        }
    )
    return mission.model_copy(update={"stages": (core, arc)})


def fly(true, believed, name):
    """Fly one mission under a law that believes another."""
    simulator = Simulator(true, SimulatorOptions(navigation_period_s=1.0, integration_step_s=1.0))
    law = make_law(name, believed.arrays())
    while not simulator.complete:
        law.step(simulator.navigation)
        simulator.command(law.steering)
        simulator.advance()
    return simulator.plant, law.state


def known_engine(state, mission):
    """Return thrust and mass flow of guidance's last arc, as fractions of the mission's."""
    arc = nominal = mission.arrays().arcs[-1]
    if state["left"]["count"]:
        # so weak that guidance treats it as failed
        arc = state["left"]["arcs"][len(mission.arrays().arcs) - 1]
    return (
        state["thrust_ratio"] * arc["thrust"] / nominal["thrust"],
        state["flow_ratio"] * arc["mass_flow"] / nominal["mass_flow"],
    )


@pytest.mark.parametrize("name", ["peg", "igm", "optimal"])
@pytest.mark.parametrize(
    ("thrust", "specific_impulse"), [(0.85, 1.0), (0.85, 0.99), (1.1, 1.01), (0.97, 1.0)]
)
def test_another_upper_stage_engine(ares_v, name, thrust, specific_impulse):
    plant, state = fly(with_upper_stage(ares_v, thrust, specific_impulse), ares_v, name)
    flown = Insertion.from_state(plant["position"], plant["velocity"])
    target = ares_v.arrays().target[0]
    assert plant["inserted"] == 1
    assert flown.radius == pytest.approx(target["radius"], abs=10.0)
    assert flown.speed == pytest.approx(target["speed"], abs=0.05)
    assert flown.flight_path_angle == pytest.approx(
        target["flight_path_angle"], abs=math.radians(1e-3)
    )
    known = known_engine(state, ares_v)
    assert known == pytest.approx((thrust, thrust / specific_impulse), abs=1e-4)
    events = plant["events"][: plant["event_count"]]
    drop = events[events["type"] == JETTISON_DONE][0]
    assert drop["heating_rate"] <= 1135.0


def test_what_is_left_of_the_optimum_with_a_weak_engine(ares_v):
    true = with_upper_stage(ares_v, 0.85, 1.0)
    best = solve(true, "indirect", verify=False).m_f_kg
    optimal, _ = fly(true, ares_v, "optimal")
    peg, _ = fly(true, ares_v, "peg")
    # nobody knew before staging
    assert peg["mass"] + 200.0 < optimal["mass"] < best
