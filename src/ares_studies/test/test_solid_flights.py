# SPDX-License-Identifier: Apache-2.0
"""A solid motor defined by tables, planned and flown: laws, optimizer and plant compared."""

from importlib import resources

import numpy as np
import pytest

from ares_models.mission import load_mission
from ares_optimizer.solve import solve
from ares_studies.closed_loop import fly_stepwise
from ares_vehicle_sim import arrays as names


@pytest.fixture(scope="module")
def mission():
    with resources.as_file(resources.files("ares_trials") / "sweep" / "solids.yaml") as path:
        return load_mission(path)


@pytest.fixture(scope="module")
def optimum(mission):
    return solve(mission, "auto")


def test_every_method_finds_the_same(mission, optimum):
    assert optimum.converged
    collocation = solve(mission, "collocation")
    assert collocation.converged
    assert collocation.m_f_kg == pytest.approx(optimum.m_f_kg, rel=1e-5)


@pytest.mark.parametrize("law", ["peg", "igm", "optimal"])
def test_laws_fly_it_to_the_target(mission, optimum, law):
    flight = fly_stepwise(mission, law=law)
    plant = flight.plant
    assert plant["inserted"] == 1
    assert np.linalg.norm(plant["position"]) == pytest.approx(6628137.0, abs=10.0)
    assert np.linalg.norm(plant["velocity"]) == pytest.approx(7754.866, abs=0.05)
    assert optimum.m_f_kg * (1.0 - 3e-3) < plant["mass"] < optimum.m_f_kg * (1.0 + 1e-6)
    # both motors burn out by their tables, and nothing is taken for a failure
    ended = flight.events[flight.events["type"] == names.ARC_ENDED]
    assert ended["time"] == pytest.approx([75.0, 80.0], abs=1e-9)
    assert flight.guidance["left"]["count"] == 0
