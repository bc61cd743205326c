# SPDX-License-Identifier: Apache-2.0
"""The law alone: self-start, gates, hold, bad input."""

import math

import numpy as np
import pytest

from ares_guidance.arrays import (
    ERROR_NAVIGATION_INVALID,
    ERROR_PROPELLANT_SHORT,
    PHASE_CONVERGING,
    PHASE_HOLD,
    PHASE_TRACKING,
)
from ares_guidance.law import Law
from ares_guidance.settings import LawSettings
from ares_models.mission import list_missions, load_mission
from ares_trials.testing.laws import SELF_STARTING, first_navigation, step_anew


@pytest.fixture(scope="module")
def ares_v():
    return load_mission("ares_v")


def test_missions_without_a_plan_are_tried():
    names = [name for name in list_missions() if not load_mission(name).needs_plan]
    assert names == [*SELF_STARTING]


@pytest.mark.parametrize("name", SELF_STARTING)
def test_starts_by_itself_within_thirty_iterations(name):
    mission = load_mission(name)
    law = Law(mission.arrays())
    assert law.step(first_navigation(mission))
    assert law.state["phase"] == PHASE_TRACKING
    assert 0 < law.state["iterations"] <= 30
    assert law.state["solution"]["miss_speed"] < LawSettings().velocity_to_go_tolerance_m_s


def test_predicts_the_flight_that_follows(ares_v):
    law = Law(ares_v.arrays())
    law.step(first_navigation(ares_v))
    # flown closed loop, this flight drops its fairing at 433.8 s and cuts off at 767.1 s
    assert law.steering[0]["cutoff_time"] == pytest.approx(767.1, abs=3.0)
    assert law.steering[0]["jettison"] == 0
    assert law.steering[0]["jettison_time"] == pytest.approx(433.7, abs=5.0)


def test_the_direction_is_a_unit_vector_normal_to_its_rate(ares_v):
    law = Law(ares_v.arrays())
    law.step(first_navigation(ares_v))
    steering = law.steering[0]
    assert np.linalg.norm(steering["direction"]) == pytest.approx(1.0, abs=1e-12)
    cosine = steering["direction"] @ steering["direction_rate"]
    assert cosine == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("field", ["position", "velocity", "mass", "time", "sensed_delta_v"])
@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_a_navigation_state_that_is_not_finite_changes_nothing(ares_v, field, value):
    law = Law(ares_v.arrays())
    law.step(first_navigation(ares_v))
    before, state = law.steering.copy(), law.state.copy()
    law.step(first_navigation(ares_v, **{field: value}))
    assert law.state["error"] == ERROR_NAVIGATION_INVALID
    assert law.steering.tobytes() == before.tobytes()
    assert law.state["solution"].tobytes() == state["solution"].tobytes()


@pytest.mark.parametrize("arc", [-1, 2, 255])
def test_an_arc_that_the_mission_does_not_have(ares_v, arc):
    law = Law(ares_v.arrays())
    law.step(first_navigation(ares_v, arc=arc))
    assert law.state["error"] == ERROR_NAVIGATION_INVALID
    assert not law.steered


def test_an_unknown_heating_rate_leaves_the_on_board_model(ares_v):
    known = Law(ares_v.arrays())
    known.step(first_navigation(ares_v))
    unknown = Law(ares_v.arrays())
    unknown.step(first_navigation(ares_v, heating_rate=math.nan))
    assert math.isnan(unknown.state["density_ratio"])
    assert unknown.steering[0]["jettison_time"] == pytest.approx(
        known.steering[0]["jettison_time"], abs=1e-3
    )


def test_thicker_air_moves_the_jettison_and_too_thick_air_takes_it_off_the_plan(ares_v):
    nominal = first_navigation(ares_v)["heating_rate"]
    times = []
    for factor in (0.7, 1.0, 1.3, 3.0):
        law = Law(ares_v.arrays())
        law.step(first_navigation(ares_v, heating_rate=factor * nominal))
        assert law.state["phase"] == PHASE_TRACKING
        times.append(float(law.steering[0]["jettison_time"]))
    assert times[0] < times[1] < times[2]
    assert math.isnan(times[3])
    assert law.steering[0]["jettison"] == -1


def test_the_on_board_model_can_be_trusted_instead(ares_v):
    nominal = first_navigation(ares_v)["heating_rate"]
    law = Law(ares_v.arrays(), LawSettings(heating_source="model"))
    law.step(first_navigation(ares_v, heating_rate=3.0 * nominal))
    assert law.steering[0]["jettison_time"] == pytest.approx(433.7, abs=5.0)


def test_a_target_beyond_the_propellant_is_said_and_still_steered_at(ares_v):
    arrays = ares_v.arrays()
    arrays.arcs["propellant"][1] = 120e3
    law = Law(arrays)
    law.step(first_navigation(ares_v))
    assert law.state["error"] == ERROR_PROPELLANT_SHORT
    assert law.steered


def test_a_start_that_makes_no_sense_points_along_the_velocity(ares_v):
    law = Law(ares_v.arrays(), LawSettings(max_iterations=1))
    nav = first_navigation(ares_v)
    law.step(nav)
    assert law.state["phase"] == PHASE_CONVERGING
    course = nav["velocity"] / np.linalg.norm(nav["velocity"])
    assert law.steering[0]["direction"] == pytest.approx(course)
    assert math.isnan(law.steering[0]["cutoff_time"])


def test_between_cycles_the_answer_stays(ares_v):
    law = Law(ares_v.arrays())
    law.step(first_navigation(ares_v))
    before = law.steering.copy()
    assert not law.step(first_navigation(ares_v, time=ares_v.start().time_s + 0.1))
    assert law.steering.tobytes() == before.tobytes()


def test_a_jump_in_the_state_is_gated_then_accepted(ares_v):
    law = Law(ares_v.arrays(), LawSettings(steering_jump_limit_deg=0.5, max_stale_cycles=2))
    start = ares_v.start()
    law.step(first_navigation(ares_v))
    good = law.steering.copy()
    kicked = start.velocity + np.array([300.0, -200.0, 250.0])
    for cycle in (1, 2):
        step_anew(law, first_navigation(ares_v, time=start.time_s + cycle, velocity=kicked))
        assert law.state["stale_cycles"] == cycle
        assert law.steering[0]["direction"] == pytest.approx(good[0]["direction"], abs=0.0)
    step_anew(law, first_navigation(ares_v, time=start.time_s + 3, velocity=kicked))
    step_anew(law, first_navigation(ares_v, time=start.time_s + 4, velocity=kicked))
    assert law.state["phase"] == PHASE_TRACKING
    assert law.state["stale_cycles"] == 0
    assert law.steering[0]["direction"] != pytest.approx(good[0]["direction"], abs=1e-3)


def test_the_steering_is_held_when_little_time_is_left(ares_v):
    law = Law(ares_v.arrays(), LawSettings(hold_time_s=1e4 / 100))
    arrays = ares_v.arrays()
    target = arrays.target[0]
    # 50 m/s short of the target, on its radius and angle
    gamma = float(target["flight_path_angle"])
    speed = float(target["speed"]) - 50.0
    position = float(target["radius"]) * np.array([1.0, 0.0, 0.0])
    course = np.array([0.0, math.cos(target["inclination"]), math.sin(target["inclination"])])
    velocity = speed * (math.cos(gamma) * course + math.sin(gamma) * np.array([1.0, 0.0, 0.0]))
    late = {
        "position": position,
        "velocity": velocity,
        "mass": 175e3,
        "arc": 1,
        "arc_start_time": 337.15,
        "jettisoned": 1,
    }
    law.step(first_navigation(ares_v, time=760.0, **late))
    assert law.state["phase"] == PHASE_TRACKING
    held = law.steering.copy()
    step_anew(law, first_navigation(ares_v, time=761.0, **late))
    assert law.state["phase"] == PHASE_HOLD
    assert law.steering[0]["direction"] == pytest.approx(held[0]["direction"], abs=0.0)
    assert 761.0 < law.steering[0]["cutoff_time"] < 775.0


@pytest.mark.parametrize(
    ("setting", "value"),
    [("cycle_period_s", 0.0), ("hold_time_s", -1.0), ("heating_margin", math.nan)],
)
def test_a_setting_out_of_range_is_named(setting, value):
    with pytest.raises(ValueError, match=f"{setting} is .*; expected"):
        LawSettings(**{setting: value})


def test_an_unknown_heating_source_is_named():
    with pytest.raises(ValueError, match="heating_source is 'guess'; expected measured or model"):
        LawSettings(heating_source="guess")
