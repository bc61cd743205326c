# SPDX-License-Identifier: Apache-2.0
"""Both planes of an inclination over a pad: the better one, or the one that the file asks for."""

import re

import numpy as np
import pytest

from ares_models.input_file import read_input
from ares_models.mission import MISSION, TEMPLATE, Mission
from ares_optimizer.collocation.pilot import is_reversed
from ares_optimizer.solution import Status
from ares_optimizer.solve import solve


def to_sun_synchronous(payload_kg, heading=None):
    """Return the template from Vandenberg to a sun-synchronous orbit at 550 km."""
    data = read_input(TEMPLATE, MISSION)[0]
    data["payload_kg"] = payload_kg
    for key in ("max_dynamic_pressure_pa", "max_q_alpha_pa_rad"):
        del data["stages"][0][key]
    del data["environment"]
    data["initial_state"] |= {"geodetic_latitude_deg": 34.75, "longitude_deg": -120.6}
    data["target"] = {
        "perigee_altitude_m": 550e3,
        "apogee_altitude_m": 550e3,
        "inclination_deg": "sun_synchronous",
    }
    if heading is not None:
        data["target"]["launch_heading"] = heading
    return Mission.model_validate(data)


def leads_north(mission, solution):
    """Return whether the orbit at the end passes over the pad to the north."""
    end = solution.trajectory
    normal = np.cross(end.position[-1], end.velocity[-1])
    return bool(np.cross(normal, mission.start().position)[2] > 0.0)


@pytest.fixture(scope="module")
def planned():
    missions = {heading: to_sun_synchronous(60.0, heading) for heading in ("north", "south", None)}
    return {heading: (mission, solve(mission, "auto")) for heading, mission in missions.items()}


@pytest.mark.parametrize("heading", ["north", "south"])
def test_a_launch_leads_where_the_file_asks(planned, heading):
    mission, found = planned[heading]
    assert found.status == Status.CONVERGED
    assert leads_north(mission, found) == (heading == "north")


def test_without_a_heading_the_better_plane_is_flown(planned):
    masses = [found.m_f_kg for _, found in planned.values()]
    assert masses[2] == pytest.approx(max(masses[:2]), rel=1e-5)
    assert abs(masses[0] - masses[1]) > 1e-3 * masses[0]


def test_what_lacks_propellant_in_one_plane_alone_is_flown_in_the_other():
    # the plane to the north carries 108.0 kg, the other one 109.3 kg
    northward = solve(to_sun_synchronous(108.7, "north"), "auto")
    assert northward.status == Status.INFEASIBLE
    assert re.search(r"last stage: 0\.\d\d kg short", northward.reason)
    assert solve(to_sun_synchronous(108.7), "auto").status == Status.CONVERGED


def test_in_flight_the_heading_of_the_launch_no_longer_counts(planned):
    mission, found = planned["south"]
    track, arrays = found.trajectory, mission.arrays()
    state = mission.start().navigation()
    end = np.concatenate((track.position[-1], track.velocity[-1]))
    assert not is_reversed(arrays, state, end)
    assert is_reversed(arrays, state, end * [1, 1, -1, 1, 1, -1])
    # beyond its southernmost point the same orbit leads to the north
    state["position"], state["velocity"] = -track.position[-1], -track.velocity[-1]
    assert not is_reversed(arrays, state, end)
