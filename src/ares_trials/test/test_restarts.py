# SPDX-License-Identifier: Apache-2.0
"""Guidance lost in flight and restarted from the navigation state alone: the target is reached."""

from dataclasses import replace

import numpy as np
import pytest

from ares_guidance.laws import make_law
from ares_models.mission import load_mission
from ares_studies.closed_loop import arc_plan
from ares_trials.restarts import Restarts
from ares_vehicle_sim.arrays import ARC_ENDED, IGNITION
from ares_vehicle_sim.simulator import Simulator

#: s that must be left.
ENOUGH = 30.0


def arrive(restarts, times, away_s):
    """Assert that flights with enough time arrive, no state refused; return their number."""
    due = [end for end in restarts.fly(times, away_s) if end.left_s >= ENOUGH]
    assert [end for end in due if not end.arrived or end.refused] == []
    return len(due)


@pytest.mark.parametrize(
    ("mission", "law"),
    [
        ("space_shuttle_sts121", "peg"),
        ("saturn_v_as506", "igm"),
        ("ares_v_transients", "peg"),
        ("apollo11_ascent", "optimal"),
    ],
)
def test_a_flight_arrives_whenever_its_guidance_begins_anew(mission, law):
    restarts = Restarts(load_mission(mission), law)
    assert restarts.arrives
    # over the whole flight, and behind starts, ends of arcs and jettisons
    assert arrive(restarts, restarts.times(10), [0.1, 20.0]) >= 20


def test_a_plan_is_asked_for_again_in_a_coast_and_in_the_burn_behind_it():
    restarts = Restarts(load_mission("geostationary_burn"), "peg")
    begin, lit = restarts.events["time"][[0, -3]]
    assert restarts.events["type"][-3] in (ARC_ENDED, IGNITION)
    lost = [float(begin) + 0.5 * float(lit - begin), float(lit), float(lit) + 2.0]
    ends = list(restarts.fly(lost, [5.0]))
    assert [end.arc for end in ends] == [0, 1, 1]
    assert all(end.arrived and end.reasons == () for end in ends)


def test_a_plan_of_the_arcs_left_serves_its_flight_alone():
    mission = load_mission("geostationary_burn")
    restarts = Restarts(mission, "peg")
    simulator = Simulator(mission)
    first = np.array([simulator.navigation])
    law = make_law("peg", mission.arrays(foreseen=True))
    whole = arc_plan(mission, law.kind, first)
    assert whole.first_arc == 0
    left = replace(whole, lengths_s={1: whole.lengths_s[1]}, first_arc=1, resumes=True)
    with pytest.raises(ValueError, match="length of arc 0 is nan; expected 0 s or more"):
        law.follow_arcs(replace(left, first_arc=0))
    law.follow_arcs(whole)
    law.reset()
    assert not law.lacks_plan
    law.follow_arcs(left)
    assert not law.lacks_plan
    law.reset()
    assert law.lacks_plan
    assert restarts.arrives


def test_guidance_that_comes_back_after_the_end_changes_nothing():
    restarts = Restarts(load_mission("ares_v"), "peg")
    (end,) = restarts.fly([restarts.cutoff_s - 5.0], [20.0])
    assert np.isnan(end.begun_s)
    assert end.arrived
