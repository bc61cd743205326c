# SPDX-License-Identifier: Apache-2.0
"""PEG as flown in the thesis, step by step: its plan, its modes, refused inputs."""

import dataclasses
import math
import re

import numpy as np
import pytest

from ares_guidance.arrays import LAW_PEG, PHASE_CONVERGING, PHASE_HOLD
from ares_guidance.law import Law
from ares_guidance.laws import make_law
from ares_guidance.registry import law_names
from ares_guidance.settings import LawSettings
from ares_guidance.trajectory import OfflineTrajectory
from ares_models.arrays import NAVIGATION
from ares_models.mission import load_mission
from ares_thesis.peg.arrays import LAW_PEG_THESIS
from ares_thesis.peg.law import Pins, ThesisPeg
from ares_thesis.peg.plan import JettisonPlan
from ares_trials.testing.laws import step_anew

#: The optimum of the default mission.
PLAN = JettisonPlan(
    radius_m=6_497_751.5,
    speed_m_s=5912.0,
    flight_path_angle_rad=math.radians(2.7333),
    jettison_time_s=416.64,
    cutoff_time_s=766.91,
    delta_v_m_s=(4076.4, 351.1, 2059.6),
)


@pytest.fixture(scope="module")
def ares_v():
    return load_mission("ares_v")


def navigation(mission, **changes):
    start = mission.start()
    nav = np.zeros(1, NAVIGATION)
    nav["time"] = nav["arc_start_time"] = start.time_s
    nav["position"], nav["velocity"], nav["mass"] = start.position, start.velocity, start.mass_kg
    nav["heating_rate"] = math.nan
    for name, value in changes.items():
        nav[name] = value
    return nav[0]


def planned(mission, settings=None, plan=PLAN, **pins):
    law = ThesisPeg(mission.arrays(), settings, Pins(**pins))
    law.follow(plan)
    return law


def after_staging(mission, **changes):
    """Near the optimum of the default mission at its staging."""
    start = mission.start()
    up = start.position / np.linalg.norm(start.position)
    along = start.velocity - (start.velocity @ up) * up
    along /= np.linalg.norm(along)
    gamma = math.radians(5.28)
    values = {
        "time": 337.2,
        "arc": 1,
        "arc_start_time": 337.15,
        "mass": 307_822.0,
        "position": 6_467_400.0 * up,
        "velocity": 5621.0 * (math.sin(gamma) * up + math.cos(gamma) * along),
        "sensed_delta_v": 4076.4 * along,
    }
    return navigation(mission, **{**values, **changes})


# ---- the plan


@pytest.mark.parametrize(
    ("field", "value", "words"),
    [
        ("radius_m", math.nan, "radius_m is nan; expected finite"),
        ("speed_m_s", -1.0, "speed_m_s is -1.0; expected more than 0"),
        ("cutoff_time_s", 400.0, "cutoff_time_s is 400.0; expected more than jettison_time_s"),
        ("delta_v_m_s", (0.0, 0.0, 1.0), "delta_v_m_s is (0.0, 0.0, 1.0); expected a burn"),
    ],
)
def test_a_plan_that_is_none_is_named(field, value, words):
    with pytest.raises(ValueError, match=re.escape(words)):
        dataclasses.replace(PLAN, **{field: value})


def trajectory(**changes):
    """Two burns of the first stage, one of the second cut by a jettison, a coast between."""
    east = np.array([1.0, 0.0, 0.0])
    values = {
        "jettison_time": 40.0,
        "cutoff_time": 90.0,
        "arc_start_time": np.array([0.0, 10.0, 20.0, 25.0, 40.0]),
        "arc_end_time": np.array([10.0, 20.0, 25.0, 40.0, 90.0]),
        "arc_start_mass": np.array([100.0, 90.0, 30.0, 30.0, 20.0]),
        "arc_end_mass": np.array([90.0, 80.0, 30.0, 25.0, 10.0]),
        "arc_delta_v": np.array([1.0, 2.0, 0.0, 4.0, 8.0]),
        "steering_reference_time": np.array([0.0, 10.0, math.nan, 25.0, 40.0]),
        "steering_direction": np.array([east, east, [math.nan] * 3, east, east]),
        "steering_direction_rate": np.zeros((5, 3)),
        "primer_rate": np.full((5, 3), math.nan),
        "sample_time": np.array([0.0, 40.0, 40.0, 90.0]),
        "sample_position": np.array([[7e6, 0.0, 0.0]] * 4),
        "sample_velocity": np.array([[0.0, 7e3, 0.0], [1e3, 7e3, 0.0], [1e3, 7e3, 0.0], 3 * [0.0]]),
        "sample_mass": np.array([100.0, 25.0, 20.0, 10.0]),
        "sample_direction": np.array([east] * 4),
        "flown_arc": np.array([0, 1, 2]),
        "flown_start_time": np.array([0.0, 20.0, 25.0]),
        "flown_end_time": np.array([20.0, 25.0, 90.0]),
    }
    return OfflineTrajectory(**{**values, **changes})


def test_the_plan_of_a_trajectory():
    plan = JettisonPlan.from_trajectory(trajectory())
    assert plan.radius_m == pytest.approx(7e6)
    assert plan.speed_m_s == pytest.approx(math.hypot(1e3, 7e3))
    assert plan.flight_path_angle_rad == pytest.approx(math.atan(1 / 7))
    assert (plan.jettison_time_s, plan.cutoff_time_s) == (40.0, 90.0)
    assert plan.delta_v_m_s == (3.0, 4.0, 8.0)
    assert trajectory().velocity_to_go() == pytest.approx([15.0, 0.0, 0.0])


def test_the_plan_of_a_trajectory_from_after_staging():
    late = {
        name: getattr(trajectory(), name)[3:]
        for name in ("arc_start_time", "arc_end_time", "arc_start_mass", "arc_end_mass")
        + ("arc_delta_v", "steering_reference_time")
        + ("steering_direction", "steering_direction_rate", "primer_rate")
    }
    assert JettisonPlan.from_trajectory(trajectory(**late)).delta_v_m_s == (0.0, 4.0, 8.0)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"jettison_time": math.nan}, "jettison_time is nan"),
        ({"jettison_time": 41.0}, "no sample at the jettison: the nearest to 41.000 s"),
        ({"arc_delta_v": np.ones(3)}, "arcs: expected lists of one length"),
        ({"sample_time": np.ones(3)}, "samples: expected lists of one length"),
    ],
)
def test_a_trajectory_without_a_jettison_or_with_odd_lists_is_named(changes, words):
    with pytest.raises(ValueError, match=words):
        JettisonPlan.from_trajectory(trajectory(**changes))


@pytest.mark.parametrize("name", ["delta_iii", "saturn_v_as506"])
def test_a_mission_of_another_kind_is_refused(name):
    with pytest.raises(
        ValueError, match="flies two stages with one jettison by heating_limit_w_m2"
    ) as caught:
        make_law("peg_thesis", load_mission(name).arrays())
    assert "\n" not in str(caught.value)


def test_pins_that_do_not_exist_are_named():
    with pytest.raises(ValueError, match="plane is 'none'; expected one of mode, flight, free"):
        Pins(plane="none")


def test_every_law_can_be_told_of_a_trajectory(ares_v):
    arrays = ares_v.arrays()
    for name in law_names():
        law = make_law(name, arrays)
        law.start_from(trajectory())
        told = law.memory["planned"] if name == "peg_thesis" else law.state["seeded"]
        assert told == 1


# ---- modes


def test_without_a_plan_it_is_plain_peg(ares_v):
    plain, thesis = Law(ares_v.arrays()), make_law("peg_thesis", ares_v.arrays())
    for law in (plain, thesis):
        assert law.step(navigation(ares_v))
    assert thesis.steering.tobytes() == plain.steering.tobytes()
    assert thesis.state["law"] == LAW_PEG


def test_the_first_pass_starts_from_the_scalar_along_the_velocity(ares_v):
    law = planned(ares_v)
    nav = navigation(ares_v)
    law.step(nav)
    course = nav["velocity"] / np.linalg.norm(nav["velocity"])
    assert law.state["law"] == LAW_PEG_THESIS
    assert law.state["iterations"] == 1
    assert law.steering[0]["direction"] == pytest.approx(course)
    # Eq. 6.1: the burn of 4076.4 + 351.1 m/s, so the planned jettison
    assert law.steering[0]["jettison"] == 0
    assert law.steering[0]["jettison_time"] == pytest.approx(416.64, abs=0.1)
    assert law.steering[0]["cutoff_time"] == pytest.approx(766.91, abs=0.1)
    # one pass is no solution, but it is flown, and it is no error either
    assert law.state["phase"] == PHASE_CONVERGING
    assert not law.converged
    assert law.state["error"] == 0


def test_it_settles_in_about_ten_passes(ares_v):
    """The thesis: a transient of approximately the first ten passes."""
    once = planned(ares_v, LawSettings(passes_per_cycle=100, settled_below_m_s=0.1))
    once.step(navigation(ares_v))
    assert once.converged
    assert 8 <= once.state["iterations"] <= 16


def test_a_cycle_is_still_a_cycle(ares_v):
    law = planned(ares_v)
    start = ares_v.start().time_s
    due = [step_anew(law, navigation(ares_v, time=start + t)) for t in (0.0, 0.5, 1.0, 1.5)]
    assert due == [True, False, True, False]
    assert law.state["cycle"] == 2
    step_anew(law, after_staging(ares_v))
    assert law.state["cycle"] == 3


def test_modes_follow_staging_and_jettison(ares_v):
    law = planned(ares_v)
    assert law.memory["mode"] == 0
    law.step(navigation(ares_v))
    assert law.memory["mode"] == 1
    step_anew(law, after_staging(ares_v))
    assert law.memory["mode"] == 2
    assert law.steering[0]["jettison_time"] == pytest.approx(416.64, abs=0.3)
    step_anew(law, after_staging(ares_v, time=416.7, mass=278_367.0, jettisoned=1))
    assert law.memory["mode"] == 3
    assert law.steering[0]["jettison"] == -1
    assert math.isnan(law.steering[0]["jettison_time"])
    # from 416.7 s on 2,059.6 m/s along the velocity
    assert law.steering[0]["cutoff_time"] == pytest.approx(766.9, abs=0.3)
    assert law.state["predicted_position"] != pytest.approx(np.zeros(3))


def test_mode_one_can_go_on_through_staging(ares_v):
    law = planned(ares_v, split_at_staging=False)
    law.step(navigation(ares_v))
    step_anew(law, after_staging(ares_v))
    assert law.memory["mode"] == 1


@pytest.mark.parametrize(("plane", "moved"), [("mode", True), ("flight", False), ("free", False)])
def test_the_plane_is_that_of_the_state_in_which_the_mode_begins(ares_v, plane, moved):
    law = planned(ares_v, plane=plane)
    law.step(navigation(ares_v))
    target = law.memory["target"]
    first = float(target["ascending_node"])
    step_anew(
        law, after_staging(ares_v, velocity=after_staging(ares_v)["velocity"] + [0.0, 0.0, 50.0])
    )
    assert (float(target["ascending_node"]) != pytest.approx(first, abs=1e-5)) == moved
    assert float(target["inclination"]) == pytest.approx(math.radians(28.5))


def test_what_has_not_settled_drops_nothing(ares_v):
    law = planned(ares_v, plan=dataclasses.replace(PLAN, delta_v_m_s=(4076.4, 20.0, 2059.6)))
    step_anew(law, after_staging(ares_v))
    assert not law.converged
    assert law.steering[0]["jettison_time"] == pytest.approx(337.2 + 50.0)


def test_a_mode_two_that_would_only_hold_keeps_what_mode_one_found(ares_v):
    settings = LawSettings(passes_per_cycle=100, settled_below_m_s=0.1, jettison_hold_time_s=85.0)
    law = planned(ares_v, settings)
    law.step(navigation(ares_v))
    assert law.converged
    before = law.steering.copy()
    step_anew(law, after_staging(ares_v))
    assert law.memory["mode"] == 2
    assert law.state["phase"] == PHASE_HOLD
    assert law.steering[0]["direction"] == pytest.approx(before[0]["direction"], abs=0.0)
    assert law.steering[0]["jettison_time"] == pytest.approx(
        float(before[0]["jettison_time"]), abs=15.0
    )


def test_a_mode_two_that_finds_the_second_solution_is_not_flown(ares_v):
    """Table 6.6 has 562 m/s for a piece that needs 351: from there it climbs for a minute."""
    printed = dataclasses.replace(PLAN, delta_v_m_s=(4076.3, 562.0, 1970.7))
    settings = LawSettings(passes_per_cycle=100, settled_below_m_s=0.1)
    alone = planned(ares_v, settings, printed)
    step_anew(alone, after_staging(ares_v))
    assert alone.converged
    assert alone.steering[0]["jettison_time"] > 440.0
    gated = planned(ares_v, settings, printed)
    gated.step(navigation(ares_v))
    before = gated.steering.copy()
    step_anew(gated, after_staging(ares_v))
    assert gated.state["phase"] == PHASE_HOLD
    assert gated.steering[0]["direction"] == pytest.approx(before[0]["direction"], abs=0.0)


# ---- bad input


@pytest.mark.parametrize("field", ["position", "velocity", "mass", "time", "sensed_delta_v"])
def test_a_navigation_state_that_is_not_finite_changes_nothing(ares_v, field):
    law = planned(ares_v)
    law.step(navigation(ares_v))
    before = law.steering.copy()
    assert not law.step(navigation(ares_v, **{field: math.nan}))
    assert law.steering.tobytes() == before.tobytes()
    assert law.state["error"] == 2


@pytest.mark.parametrize("arc", [-1, 2, 255])
def test_an_arc_that_the_mission_does_not_have(ares_v, arc):
    law = planned(ares_v)
    law.step(navigation(ares_v, arc=arc))
    assert law.state["error"] == 2
    assert not law.steered


def test_a_reset_forgets_the_flight_and_keeps_the_plan(ares_v):
    law = planned(ares_v)
    law.step(navigation(ares_v))
    first = law.steering.copy()
    step_anew(law, after_staging(ares_v))
    law.reset()
    law.step(navigation(ares_v))
    assert law.steering.tobytes() == first.tobytes()


@pytest.mark.parametrize(
    ("setting", "value"),
    [("jettison_hold_time_s", -1.0), ("passes_per_cycle", 0), ("settled_below_m_s", 0.0)],
)
def test_a_setting_out_of_range_is_named(setting, value):
    with pytest.raises(ValueError, match=f"{setting} is .*; expected"):
        LawSettings(**{setting: value})
