# SPDX-License-Identifier: Apache-2.0
"""The verdict on a flight, from synthetic events."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ares_bringup.facts import MissionFacts, facts_of
from ares_bringup.insertion import judgement, target_state
from ares_bringup.marks import NEAR_ON_PAGES, apart, marks_of
from ares_bringup.observed import Diagnostic, Event
from ares_bringup.outcomes import Outcome
from ares_bringup.report import console, facts_of_flight, print_summary
from ares_bringup.summary import MAX_DIAGNOSTICS, FlightSummary
from ares_bringup.summary_json import to_json
from ares_models.arrays import (
    NAMES_APOGEE,
    NAMES_ARGUMENT_OF_PERIGEE,
    NAMES_INCLINATION,
    NAMES_PERIGEE,
    TARGET,
    TARGET_ELEMENTS,
    TARGET_KEPLERIAN,
    TARGET_RADIUS_SPEED_ANGLE_PLANE,
)
from ares_models.mission import load_mission
from ares_models.orbits import Elements
from ares_models.passage import AirState, Passage
from ares_trials.testing.flights import (
    INCLINATION,
    MU,
    RADIUS,
    SPEED,
    flown,
    good_flight,
    made_up_event,
    made_up_status,
)
from ares_vehicle_sim.arrays import (
    ARC_ENDED,
    CUTOFF,
    DEPLETION,
    FAILED,
    FLIGHT_COMPLETE,
    FLIGHT_STARTED,
    IGNITION,
    IMPACT,
    JETTISON_DONE,
    OVER_LIMIT,
    STAGING,
)


def test_a_good_flight(facts):
    summary = good_flight(facts)
    assert summary.outcome is Outcome.TARGET
    assert summary.exit_code == 0
    assert summary.shortcomings() == []
    assert (summary.t_plf_s, summary.t_meco_s, summary.m_f_kg) == (200.0, 400.0, 500.0)
    assert set(summary.insertion_error) == {
        "radius_m",
        "speed_m_s",
        "flight_path_angle_deg",
        "inclination_deg",
    }
    assert all(abs(error) < 1e-9 for error in summary.insertion_error.values())


def test_errors_are_flown_minus_target(facts):
    errors = good_flight(facts, radius=RADIUS + 30.0, speed=7699.5).insertion_error
    assert errors["radius_m"] == pytest.approx(30.0)
    assert errors["speed_m_s"] == pytest.approx(-0.5)


def with_safe_perigee(facts, altitude):
    target = facts.target.copy()
    target["safe_radius"] = facts.equatorial_radius + altitude
    return replace(facts, target=target)


def test_the_end_in_place_of_the_target_is_named_and_no_success(facts):
    lowered = good_flight(facts, speed=SPEED - 12.0)
    assert lowered.shortcomings()[1:] == ["target lowered by 12.0 m/s"]
    assert to_json(lowered)["end"] == "lowered"
    assert to_json(lowered)["reached"] == "target lowered by 12.0 m/s"
    near = good_flight(facts, radius=RADIUS + 800.0)
    assert to_json(near)["end"] == "lowered"
    assert to_json(near)["reached"] == near.shortcomings()[1]
    assert to_json(near)["reached"].startswith("all of the target but its radius, perigee ")
    assert lowered.exit_code == 1
    # as slow, and too low to last
    low = good_flight(with_safe_perigee(facts, 200e3), speed=SPEED - 12.0)
    assert low.shortcomings()[1].startswith("suborbital, perigee 174.2")
    assert low.shortcomings()[1].endswith("km, 12.0 m/s short")
    assert low.exit_code == 1
    circle = math.sqrt(MU / RADIUS)
    safe = good_flight(facts, speed=circle)
    assert safe.shortcomings()[-1] == "safe orbit, perigee 450.0 km"
    assert safe.exit_code == 1
    higher = with_safe_perigee(facts, 451e3)
    assert not any("safe" in line for line in good_flight(higher, speed=circle).shortcomings())


def test_a_missed_target_is_named(facts):
    summary = good_flight(facts, speed=7701.0)
    assert summary.outcome is Outcome.TARGET_MISSED
    assert summary.exit_code == 1
    assert summary.shortcomings()[0] == "target missed: speed off by 1 m/s, allowed 0.1 m/s"


def test_a_fairing_still_aboard_is_a_shortcoming(facts):
    summary = flown(facts, made_up_event(CUTOFF, 400.0), made_up_event(FLIGHT_COMPLETE, 401.0))
    assert summary.t_plf_s is None
    assert summary.shortcomings() == ["fairing was not jettisoned"]
    assert summary.exit_code == 1


def test_ends_that_are_not_the_target(facts):
    assert flown(facts, made_up_event(IMPACT, 300.0)).outcome is Outcome.IMPACT
    assert flown(facts).outcome is Outcome.INCOMPLETE
    dry = flown(facts, made_up_event(DEPLETION, 300.0), made_up_event(FLIGHT_COMPLETE, 300.0))
    assert dry.outcome is Outcome.DEPLETION
    stopped = flown(facts)
    stopped.interrupted = True
    assert stopped.exit_code == 130
    assert flown(facts, made_up_event(IMPACT, 300.0)).exit_code == 1


def test_an_engine_that_fails_has_not_run_dry(facts):
    end = made_up_event(FLIGHT_COMPLETE, 300.0)
    failed = flown(facts, made_up_event(FAILED, 300.0), end)
    assert failed.outcome is Outcome.DEPLETION
    assert failed.verdict == "Thrust ended by a failure"
    assert failed.shortcomings() == [
        "thrust ended by a failure before the cut-off",
        "on the target, perigee 213.0 km",
        "fairing was not jettisoned",
    ]
    # weaker engines burn all there is
    dry = flown(facts, made_up_event(FAILED, 200.0), made_up_event(DEPLETION, 300.0), end)
    assert dry.verdict == "Propellant ran out"
    assert dry.shortcomings()[0] == "propellant ran out before the cut-off"


def test_a_limit_that_was_passed_is_no_good_flight(facts):
    summary = good_flight(facts)
    summary.add_event(made_up_event(OVER_LIMIT, 449.5))
    assert summary.outcome is Outcome.TARGET
    assert summary.exit_code == 1
    arc = facts.arcs[0]
    assert summary.shortcomings() == [f"{arc}: acceleration over its limit from 449.5 s on"]


def test_an_interruption_after_the_end_changes_nothing(facts):
    summary = good_flight(facts)
    summary.interrupted = True
    assert summary.exit_code == 0


def test_a_problem_around_the_flight_is_exit_1(facts):
    summary = good_flight(facts)
    summary.problems.append("recorder was killed by SIGKILL in flight: the bag is incomplete")
    assert summary.outcome is Outcome.TARGET
    assert summary.exit_code == 1


def test_guidance_is_counted(facts):
    summary = FlightSummary(facts, "peg")
    summary.add_status(made_up_status(1, converged=False, iterations=60))
    summary.add_status(made_up_status(2, iterations=75))
    summary.add_status(made_up_status(5, stale=2))
    assert summary.guidance_cycles == 5
    assert summary.lost_messages == 2
    assert summary.first_convergence_iterations == 75
    assert summary.max_stale_cycles == 2


def test_the_first_convergence_is_unknown_to_who_came_late(facts):
    summary = FlightSummary(facts, "peg")
    summary.add_status(made_up_status(3))
    assert summary.lost_messages == 0
    assert summary.first_convergence_iterations is None


def test_diagnostics_are_bounded(facts):
    summary = FlightSummary(facts, "peg")
    for number in range(MAX_DIAGNOSTICS + 5):
        summary.add_diagnostic(Diagnostic(float(number), "guidance", "WARN", "again"))
    assert len(summary.diagnostics) == MAX_DIAGNOSTICS
    assert to_json(summary)["diagnostic_count"] == MAX_DIAGNOSTICS + 5


def test_what_is_dropped_comes_down():
    facts = facts_of(load_mission("ares_v"))
    summary = flown(facts)
    start = load_mission("ares_v").start()
    at = {"position": tuple(start.position), "velocity": tuple(start.velocity)}
    summary.events = [
        replace(made_up_event(kind, 155.9, index, mass), **at)
        for kind, index, mass in ((ARC_ENDED, 0, 8e5), (STAGING, 1, 5e5), (JETTISON_DONE, 0, 49e4))
    ]
    core, fairing = to_json(summary)["falls"]
    assert (core["name"], core["count"], core["separation_s"]) == ("core", 1, 155.9)
    assert (core["mass_kg"], fairing["name"]) == (3e5, "payload fairing")
    assert core["ballistic_coefficient_kg_m2"] is None
    assert core["impact"]["t_s"] > 155.9 and core["downrange_m"] > 0.0 and core["speed_m_s"] > 0.0
    told = {name.strip(): value for name, value in facts_of_flight(summary)}
    assert told["core"] == summary.falls[0].words
    # without a place of longitude zero nothing is told of places
    assert FlightSummary(replace(facts, environment=None), "peg").falls == ()


def test_json_has_every_key_and_no_nan(facts):
    for summary in (FlightSummary(facts, "peg"), flown(facts), good_flight(facts, mass=math.nan)):
        text = json.dumps(to_json(summary), allow_nan=False)
        keys = json.loads(text)
        assert {
            "mission",
            "guidance",
            "t_plf_s",
            "t_meco_s",
            "m_f_kg",
            "planned_m_f_kg",
            "insertion_error",
            "guidance_cycles",
            "longest_cycle_ms",
            "wall_s",
            "realtime_factor",
            "bag",
        } <= set(keys)
        assert set(keys["insertion_error"]) == {
            "radius_m",
            "speed_m_s",
            "flight_path_angle_deg",
            "inclination_deg",
        }
    assert keys["m_f_kg"] is None


def test_rate_comes_from_what_was_seen_live(facts):
    summary = good_flight(facts)
    assert summary.realtime_factor is None
    summary.set_rate(300.0, 2.0)
    assert summary.realtime_factor == 150.0


def test_events_have_the_names_of_the_mission(facts):
    summary = FlightSummary(facts, "peg")
    assert summary.event_name(made_up_event(IGNITION, 0.0)) == "ignition: burn"
    assert summary.event_name(made_up_event(JETTISON_DONE, 0.0)) == "jettison: fairing"
    assert summary.event_name(made_up_event(JETTISON_DONE, 0.0, index=7)) == "jettison"
    assert summary.event_name(made_up_event(77, 0.0)) == "event 77"


def test_what_was_lit_on_the_pad_is_told_as_released(facts):
    summary = FlightSummary(replace(facts, held_s=7.5), "peg")
    released = "release, 7.5 s after ignition: burn"
    assert summary.event_name(made_up_event(IGNITION, 0.0)) == released
    assert summary.event_name(made_up_event(IGNITION, 0.0, index=1)) == "ignition"
    assert facts_of(load_mission("delta_iii_pad")).held_s == 0.0


def test_a_node_is_judged_when_it_is_targeted(facts):
    target = facts.target.copy()
    target["kind"] = TARGET_RADIUS_SPEED_ANGLE_PLANE
    target["ascending_node"] = math.radians(359.9)
    velocity = made_up_event(CUTOFF, 0.0).velocity
    errors = judgement(replace(facts, target=target), (RADIUS, 0.0, 0.0), velocity).errors
    assert errors["ascending_node_deg"] == pytest.approx(0.1)


def keplerian(facts):
    target = np.zeros(1, TARGET)[0]
    target["kind"] = TARGET_KEPLERIAN
    target["semi_major_axis"] = 24_361_140.0
    target["eccentricity"] = 0.7308
    target["inclination"] = INCLINATION
    target["ascending_node"] = math.radians(269.8)
    target["argument_of_perigee"] = math.radians(130.5)
    return replace(facts, target=target)


@given(anomaly=st.floats(-2.5, 2.5))
def test_any_place_on_a_keplerian_target_is_good(anomaly):
    facts = keplerian(MissionFacts("gto", "To a transfer orbit", MU, None))
    target = facts.target
    orbit = Elements(
        float(target["semi_major_axis"]),
        float(target["eccentricity"]),
        float(target["inclination"]),
        float(target["ascending_node"]),
        float(target["argument_of_perigee"]),
        anomaly,
    )
    position, velocity = (vector.tolist() for vector in orbit.state(MU))
    errors = judgement(facts, position, velocity).errors
    assert set(errors) > {"semi_major_axis_m", "eccentricity", "argument_of_perigee_deg"}
    assert abs(errors["radius_m"]) < 1e-3
    assert abs(errors["semi_major_axis_m"]) < 1e-1
    for name in ("flight_path_angle_deg", "ascending_node_deg", "argument_of_perigee_deg"):
        assert abs(errors[name]) < 1e-6


def by_elements():
    target = np.zeros(1, TARGET)[0]
    target["kind"] = TARGET_ELEMENTS
    target["named"] = NAMES_PERIGEE | NAMES_APOGEE | NAMES_INCLINATION | NAMES_ARGUMENT_OF_PERIGEE
    target["perigee_radius"], target["apogee_radius"] = 6_563_140.0, 42_164_140.0
    target["inclination"] = INCLINATION
    target["argument_of_perigee"] = math.radians(130.5)
    return MissionFacts("gto", "To a transfer orbit", MU, target)


def transfer(perigee=6_563_140.0, apogee=42_164_140.0, argument=130.5, anomaly=0.2):
    a, e = 0.5 * (perigee + apogee), (apogee - perigee) / (apogee + perigee)
    orbit = Elements(a, e, INCLINATION, 1.0, math.radians(argument), anomaly)
    position, velocity = (tuple(vector.tolist()) for vector in orbit.state(MU))
    summary = FlightSummary(by_elements(), "peg")
    for kind in (CUTOFF, FLIGHT_COMPLETE):
        event = made_up_event(kind, 400.0)
        summary.add_event(replace(event, position=position, velocity=velocity))
    return summary


def test_a_target_by_elements_is_judged_by_what_it_names():
    summary = transfer()
    assert summary.outcome is Outcome.TARGET
    assert summary.insertion_error == pytest.approx(
        {
            "perigee_radius_m": 0.0,
            "apogee_radius_m": 0.0,
            "inclination_deg": 0.0,
            "argument_of_perigee_deg": 0.0,
        },
        abs=1e-3,
    )
    # 0.1 m/s at perigee are 6 km of apogee
    assert transfer(apogee=42_164_140.0 + 5e3).outcome is Outcome.TARGET
    high = transfer(apogee=42_164_140.0 + 2e4)
    assert high.outcome is Outcome.TARGET_MISSED
    assert high.misses() == [text for text in high.misses() if text.startswith("apogee radius ")]
    assert transfer(perigee=6_564_140.0).outcome is Outcome.TARGET_MISSED
    assert transfer(argument=130.6).outcome is Outcome.TARGET_MISSED
    told = to_json(summary)["insertion_error"]
    assert told["radius_m"] is None
    assert told["perigee_radius_m"] == pytest.approx(0.0, abs=1e-3)


def test_a_keplerian_target_is_met_at_the_nearest_place(facts):
    aimed = keplerian(facts)
    position = np.array([5.0e6, 3.0e6, -2.0e6])
    there = target_state(aimed, position.tolist())
    a, e = float(aimed.target["semi_major_axis"]), float(aimed.target["eccentricity"])
    assert a * (1 - e) <= there.radius_m <= a * (1 + e)
    assert there.speed_m_s == pytest.approx(math.sqrt(MU * (2.0 / there.radius_m - 1.0 / a)))


def test_marks_of_coasts_and_of_what_is_near():
    """Mark a flown free burn, a coast to the equator, and a burn of 4.4 s before cut-off."""
    summary = FlightSummary(facts_of(load_mission("delta_iii_coast")), "peg", None)
    for kind, index, time in (
        (FLIGHT_STARTED, 0, 261.0),
        (IGNITION, 0, 261.0),
        (ARC_ENDED, 0, 919.251),
        (ARC_ENDED, 1, 1819.251),
        (IGNITION, 2, 1819.251),
        (CUTOFF, 0, 1823.686),
        (FLIGHT_COMPLETE, 0, 1823.686),
    ):
        summary.add_event(Event(kind, index, time, (7e6, 0.0, 0.0), (0.0, 7e3, 0.0), 1e4))
    assert marks_of(summary) == [
        (919.251, "coast"),
        (1819.251, ""),
        (1823.686, "ignition, cut-off"),
    ]


def test_a_staging_is_marked_as_one_though_an_arc_ends_and_an_engine_ignites_there(facts):
    summary = FlightSummary(facts, "peg", None)
    for kind, index, time in (
        (FLIGHT_STARTED, 0, 155.9),
        (IGNITION, 0, 155.9),
        (ARC_ENDED, 0, 337.15),
        (STAGING, 1, 337.15),
        (IGNITION, 1, 337.15),
        (JETTISON_DONE, 0, 434.0),
        (CUTOFF, 0, 767.1),
        (FLIGHT_COMPLETE, 0, 767.1),
    ):
        summary.add_event(Event(kind, index, time, (7e6, 0.0, 0.0), (0.0, 7e3, 0.0), 1e5))
    assert marks_of(summary) == [(337.15, "staging"), (434.0, "jettison"), (767.1, "cut-off")]


# ---- where it falls


def fallen(facts, speed, areas=None):
    """Make a flight too slow for an orbit, over a known place."""
    mission = load_mission("ares_v")
    names = mission.area_names if areas is None else areas
    named = replace(facts, environment=mission.environment_array()[0], areas=names)
    return good_flight(named, speed=speed)


def test_a_fall_names_its_place_and_never_exits_with_success(facts):
    summary = fallen(facts, 5000.0)
    impact = summary.impact
    assert impact is not None and impact.area is None
    assert summary.shortcomings()[-1] == f"falls at {impact.place}, outside all 8 areas"
    assert summary.exit_code == 1
    said = json.loads(json.dumps(to_json(summary), allow_nan=False))["impact"]
    assert said["latitude_deg"] == pytest.approx(impact.latitude_deg)
    assert said["area"] is None and said["outside_m"] > 0.0
    # the body turns below until it is down
    assert said["t_s"] > summary.end.time


def test_a_fall_into_an_area_names_it(facts):
    before = fallen(facts, 5000.0).impact
    mission = load_mission("ares_v")
    data = mission.model_dump(exclude_unset=True)
    data["abort"]["avoid"] = [
        {
            "name": "there",
            "latitude_deg": before.latitude_deg,
            "longitude_deg": before.longitude_deg,
            "radius_m": 1e4,
        }
    ]
    named = replace(facts_of(type(mission).model_validate(data)), target=facts.target)
    summary = good_flight(named, speed=5000.0)
    assert f"falls at {before.place}, in there" in summary.shortcomings()
    assert to_json(summary)["impact"]["area"] == "there"
    assert to_json(summary)["impact"]["outside_m"] == pytest.approx(-1e4, abs=10.0)


def test_without_areas_or_longitudes_nothing_is_made_up(facts):
    assert fallen(facts, 5000.0, areas=()).shortcomings()[-1].startswith("falls at ")
    plain = good_flight(replace(facts, environment=None), speed=5000.0)
    assert plain.impact is None and to_json(plain)["impact"] is None
    assert not any("falls" in line for line in plain.shortcomings())
    assert facts_of(load_mission("delta_iii")).environment is None


def test_an_orbit_does_not_fall(facts):
    circle = math.sqrt(MU / RADIUS)
    assert fallen(facts, circle).impact is None
    assert to_json(fallen(facts, circle + 50.0))["impact"] is None


def test_what_is_found_in_states_stands_among_the_events(facts, capsys):
    summary = good_flight(facts)
    passage = Passage()
    passage.mach_1 = AirState(130.0, 6_200.0, 900.0, 2e4, 1.0)
    passage.max_q = AirState(145.0, 11_000.0, 800.0, 36_000.0, 1.6)
    summary.set_air(passage)
    for cycle, boosts in ((1, True), (2, True), (3, False), (4, False)):
        summary.add_status(replace(made_up_status(cycle), time=147.0 + cycle, boosts=boosts))
    print_summary(summary, console())
    rows = [line.split(maxsplit=2) for line in capsys.readouterr().out.splitlines()]
    told = [(*row[:2], row[2].strip()) for row in rows if row and row[0].startswith("1")]
    assert told == [
        ("100.000", "500.00", "flight started"),
        ("130.000", "900.00", "Mach 1 at 6.2 km"),
        ("145.000", "800.00", "greatest dynamic pressure: 36.00 kPa at 11.0 km"),
        ("150.000", "-", "hand-over: closed-loop guidance begins"),
    ]
    # events are what the simulator says
    said = to_json(summary)
    assert len(said["events"]) == len(summary.events)
    assert said["max_q"]["dynamic_pressure_pa"] == 36_000.0
    assert (said["mach_1"]["t_s"], said["mach_1"]["altitude_m"]) == (130.0, 6_200.0)
    assert to_json(good_flight(facts))["max_q"] is None


def test_close_marks_share_the_place_of_the_last_and_a_row_of_them_is_no_single_one():
    words = {75.0: "jettison", 150.0: "jettison", 261.0: "staging", 924.0: "cut-off"}
    assert apart(words, 924.0) == [
        (75.0, "jettison"),
        (150.0, ""),
        (261.0, "jettison, staging"),
        (924.0, "cut-off"),
    ]
    # a page has rows for them
    assert apart(words | {146.0: "staging"}, 924.0, NEAR_ON_PAGES) == [
        (75.0, "jettison"),
        (146.0, ""),
        (150.0, "staging, jettison"),
        (261.0, "staging"),
        (924.0, "cut-off"),
    ]


def test_the_end_of_a_vertical_rise_is_the_pitch_over(facts):
    summary = flown(replace(facts, rises=(0,)), made_up_event(ARC_ENDED, 110.0))
    assert marks_of(summary) == [(110.0, "pitch-over")]
