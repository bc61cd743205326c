# SPDX-License-Identifier: Apache-2.0
"""A target beyond the propellant: reported, and the best end within reach is flown."""

import math

import numpy as np
import pytest

from ares_guidance.arrays import ERROR_PROPELLANT_SHORT
from ares_guidance.laws import make_law
from ares_models.mission import load_mission
from ares_optimizer.solve import solve
from ares_vehicle_sim.simulator import Simulator, SimulatorOptions


def with_propellant(name, propellant_kg):
    """Reduce the propellant of a shipped mission's last stage, and remove its areas."""
    mission = load_mission(name)
    *below, last = mission.stages
    last = last.model_copy(update={"propellant_kg": propellant_kg})
    abort = mission.abort and mission.abort.model_copy(update={"avoid": ()})
    return mission.model_copy(update={"stages": (*below, last), "abort": abort})


def fly(mission, name):
    """Fly; return the plant at the end, and every error reported by the law."""
    simulator = Simulator(
        mission, SimulatorOptions(navigation_period_s=1.0, integration_step_s=1.0)
    )
    law = make_law(name, mission.arrays())
    errors = set()
    while not simulator.complete:
        law.step(simulator.navigation)
        simulator.command(law.steering)
        simulator.advance()
        errors.add(int(law.state["error"]))
    return simulator.plant, errors


@pytest.mark.parametrize("law", ["peg", "igm", "optimal"])
@pytest.mark.parametrize("propellant_kg", [25_000.0, 15_000.0])
def test_radius_and_angle_are_kept_and_the_speed_is_what_remains(law, propellant_kg):
    mission = with_propellant("saturn_v_as506", propellant_kg)
    plant, errors = fly(mission, law)
    assert errors == {ERROR_PROPELLANT_SHORT}
    r, v = plant["position"], plant["velocity"]
    target = mission.arrays().target[0]
    assert np.linalg.norm(r) == pytest.approx(target["radius"], abs=50.0)
    sine = r @ v / (np.linalg.norm(r) * np.linalg.norm(v))
    assert math.degrees(math.asin(sine)) == pytest.approx(0.0, abs=0.01)
    assert np.linalg.norm(v) < target["speed"] - 100.0
    left = plant["mass"] - (mission.stages[-1].ignition_mass_kg - propellant_kg)
    assert abs(left) < 20.0


def test_no_flight_to_that_radius_and_angle_ends_faster():
    mission = with_propellant("saturn_v_as506", 25_000.0)
    plant, _ = fly(mission, "optimal")
    reached = mission.target.model_copy(
        update={"speed_m_s": float(np.linalg.norm(plant["velocity"]))}
    )
    best = solve(mission.model_copy(update={"target": reached}), "indirect", verify=False)
    assert best.converged
    assert plant["mass"] == pytest.approx(best.m_f_kg, abs=2.0)


def test_an_orbit_keeps_its_perigee():
    mission = with_propellant("delta_iii", 15_500.0)
    plant, errors = fly(mission, "optimal")
    assert errors == {ERROR_PROPELLANT_SHORT}
    r, v = plant["position"], plant["velocity"]
    mu = mission.environment.mu_m3_s2
    a = 1.0 / (2.0 / np.linalg.norm(r) - v @ v / mu)
    e = np.linalg.norm(np.cross(v, np.cross(r, v)) / mu - r / np.linalg.norm(r))
    target = mission.arrays().target[0]
    perigee = target["semi_major_axis"] * (1.0 - target["eccentricity"])
    assert a * (1.0 - e) == pytest.approx(perigee, rel=2e-4)
    assert 0.6 * target["semi_major_axis"] < a < 0.95 * target["semi_major_axis"]
