# SPDX-License-Identifier: Apache-2.0
"""Law `peg_thesis` in whole flights: other missions, dispersed flights, begun anew."""

import numpy as np
import pytest

from ares_guidance.laws import make_law
from ares_models.judge import End
from ares_models.mission import MISSION, Mission, load_mission
from ares_optimizer.solve import solve
from ares_studies.closed_loop import fly_compiled, offline_trajectory, ready_law
from ares_trials.restarts import Restarts
from ares_trials.testing.arrivals import judged
from ares_vehicle_sim.arrays import JETTISON_DONE
from ares_vehicle_sim.dispersions import STANDARD, load_dispersions
from ares_vehicle_sim.simulator import CAMPAIGN, true_vehicle

TRANSFER = {"perigee_altitude_m": 185e3, "apogee_altitude_m": 35786e3}


def aimed(**target):
    return Mission.model_validate(load_mission("ares_v").model_dump() | {"target": target})


def test_it_flies_to_elements_with_an_inclination():
    mission = aimed(**TRANSFER, inclination_deg=28.5)
    law = make_law("peg_thesis", mission.arrays(foreseen=True))
    law.start_from(offline_trajectory(solve(mission, "indirect")))
    plant = fly_compiled(mission, law=law).plant
    result = judged(mission, plant)
    assert result.end is End.TARGET, result
    with pytest.raises(ValueError, match="leaves the inclination free; law peg_thesis holds one"):
        make_law("peg_thesis", aimed(**TRANSFER).arrays(foreseen=True))


def test_it_refuses_throttled_burns(tmp_path):
    text = MISSION.find("ares_v").read_text()
    at = text.index("thrust_n", text.index("- name: core"))
    path = tmp_path / "mission.yaml"
    path.write_text(f"{text[:at]}max_acceleration_m_s2: 30.0\n    {text[at:]}")
    with pytest.raises(ValueError, match="which fly burns with max_acceleration_m_s2, as arc 0"):
        make_law("peg_thesis", load_mission(path).arrays(foreseen=True))


def test_it_refuses_free_arcs():
    arrays = load_mission("geostationary_burn").arrays(foreseen=True)
    assert np.isinf(arrays.arcs["duration"][0])
    with pytest.raises(
        ValueError, match="expected peg, igm or optimal, which fly arcs before the last"
    ):
        make_law("peg_thesis", arrays)


def test_it_drops_nothing_above_the_limit_that_it_measures():
    """It times the jettison by speed: where the air is thicker, a monitor holds it back."""
    mission, spread = load_mission("ares_v"), load_dispersions(STANDARD)
    guess = solve(mission, "analytic")
    violations, dropped = 0, []
    # the flights of a campaign, in whose loop nothing else flies this law: it takes long to compile
    for number in range(100):
        law = ready_law(mission, "peg_thesis", guess=guess)
        flight = fly_compiled(mission, CAMPAIGN, spread, flight=number, law=law)
        assert flight.guidance["navigation"]["refused"] == 0
        violations += int(flight.guidance["monitors"]["violations"])
        true, _ = true_vehicle(mission, CAMPAIGN, spread, 0, number)
        heating = flight.events["heating_rate"][flight.events["type"] == JETTISON_DONE]
        dropped += [float(heat) / float(true.jettisons["value"][0]) for heat in heating]
    assert violations > 0
    assert len(dropped) > 90
    assert max(dropped) <= 1.01


def test_it_begins_anew_from_an_analytic_plan_or_as_peg():
    restarts = Restarts(load_mission("ares_v"), "peg_thesis")
    dropped = restarts.events["time"][restarts.events["type"] == JETTISON_DONE][0]
    lost = [200.0, 345.0, float(dropped) + 1.0]
    ends = list(restarts.fly(lost, [5.0]))
    assert all(end.arrived for end in ends)
    # behind the jettison it has nothing to aim at
    assert [len(end.reasons) for end in ends] == [0, 0, 1]
