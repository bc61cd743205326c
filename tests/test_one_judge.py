# SPDX-License-Identifier: Apache-2.0
"""One table of ends for all judges: a flight, a campaign, an abort map, a proof."""

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest

from ares_bringup.facts import facts_of
from ares_bringup.observed import Event
from ares_bringup.outcomes import Outcome
from ares_bringup.summary import FlightSummary
from ares_bringup.summary_json import to_json
from ares_models.jit import kernel
from ares_models.judge import End
from ares_models.mission import Mission, load_mission
from ares_optimizer.obstacles import check_obstacle
from ares_optimizer.proof import checks as proof
from ares_optimizer.proof.flight import fly, steering_of
from ares_optimizer.request import Heating
from ares_optimizer.solution import Check
from ares_optimizer.solve import solve
from ares_studies.aborts.ends import Judge
from ares_studies.kernels import loop_records
from ares_studies.montecarlo.arrays import RESULT
from ares_studies.montecarlo.flights import FlightRange, Settings
from ares_studies.montecarlo.kernels import judge as judge_loop
from ares_studies.montecarlo.table import explain
from ares_vehicle_sim.arrays import CUTOFF, DEPLETION, FLIGHT_COMPLETE, IMPACT, JETTISON_DONE
from ares_vehicle_sim.dispersions import Dispersions

RADIUS = 6_628_137.0
SPEED = 7_800.0
TARGETS = {
    "state": {
        "radius_m": RADIUS,
        "speed_m_s": SPEED,
        "flight_path_angle_deg": 0.0,
        "inclination_deg": 28.5,
    },
    "transfer": {
        "perigee_radius_m": RADIUS,
        "apogee_altitude_m": 35_786e3,
        "inclination_deg": 28.5,
    },
    # as round as this, perigee may point anywhere within the tolerances of a state
    "nearly a circle": {
        "semi_major_axis_m": RADIUS,
        "eccentricity": 1e-6,
        "inclination_deg": 28.5,
        "argument_of_perigee_deg": 40.0,
    },
}


@dataclass(frozen=True)
class Ended:
    """Hold an end: level flight over the equator, and its history.

    Attributes:
        target: name in TARGETS.
        speed: m/s.
        end: expected of every judge.
        radius, tilt_deg: radius, m, and inclination of the state.
        left_on: whether the fairing is on.
        dry: whether the propellant ran out before a cut-off.
        grounded: whether the vehicle hit the ground.
    """

    target: str
    speed: float
    end: End
    radius: float = RADIUS
    tilt_deg: float = 28.5
    left_on: bool = False
    dry: bool = False
    grounded: bool = False


MU = load_mission("ares_v").environment.mu_m3_s2
CIRCLE = math.sqrt(MU / RADIUS)
AT_PERIGEE = math.sqrt(2.0 * MU * (1.0 / RADIUS - 1.0 / (RADIUS + 6_378_140.0 + 35_786e3)))
ENDED = {
    "on the target": Ended("state", SPEED, End.TARGET),
    "within what is allowed": Ended("state", SPEED + 0.09, End.TARGET, RADIUS - 90.0),
    "0.2 m/s too slow": Ended("state", SPEED - 0.2, End.LOWERED),
    "20 m/s too slow": Ended("state", SPEED - 20.0, End.LOWERED),
    "90 m/s too slow": Ended("state", SPEED - 90.0, End.SUBORBITAL),
    "too fast": Ended("state", SPEED + 30.0, End.SAFE_ORBIT),
    "in another plane": Ended("state", SPEED, End.SAFE_ORBIT, tilt_deg=29.0),
    "no number": Ended("state", math.nan, End.SUBORBITAL),
    "with the fairing on": Ended("state", SPEED, End.TARGET, left_on=True),
    "on the target, dry": Ended("state", SPEED, End.TARGET, dry=True),
    "slow and dry": Ended("state", SPEED - 20.0, End.LOWERED, dry=True, left_on=True),
    "in the ground": Ended("state", 2_000.0, End.SUBORBITAL, 6_378_100.0, grounded=True),
    "at its perigee": Ended("transfer", AT_PERIGEE, End.TARGET),
    "6 km of apogee are 0.1 m/s": Ended("transfer", AT_PERIGEE + 0.09, End.TARGET),
    "an apogee too low": Ended("transfer", AT_PERIGEE - 50.0, End.LOWERED),
    "a perigee elsewhere": Ended("nearly a circle", CIRCLE, End.TARGET),
    "a circle 2 m/s slow": Ended("nearly a circle", CIRCLE - 2.0, End.SAFE_ORBIT),
}


@pytest.fixture(scope="module")
def missions():
    content = load_mission("ares_v").model_dump(exclude_unset=True)
    return {
        name: Mission.model_validate(content | {"target": target})
        for name, target in TARGETS.items()
    }


@pytest.fixture(scope="module")
def flights(missions):
    """Fly the proof's flight of each mission, whose end is then replaced."""
    found = {}
    ares_v = load_mission("ares_v")
    solution = solve(ares_v)
    for name, mission in missions.items():
        arrays, start = mission.arrays(), mission.start().navigation()[0]
        steering = steering_of(solution.arcs)
        found[name] = fly(arrays, start, steering, [solution.t_plf_s], solution.t_meco_s)
    return found


def state_of(ended):
    tilt = math.radians(ended.tilt_deg)
    across = (0.0, ended.speed * math.cos(tilt), ended.speed * math.sin(tilt))
    return (ended.radius, 0.0, 0.0), across


def flown(mission, ended):
    """Make the summary of `ares fly`."""
    position, velocity = state_of(ended)
    summary = FlightSummary(facts_of(mission), "peg")
    kinds = [] if ended.left_on else [JETTISON_DONE]
    if not ended.grounded:
        kinds += [DEPLETION if ended.dry else CUTOFF]
    kinds += [IMPACT if ended.grounded else FLIGHT_COMPLETE]
    for kind in kinds:
        summary.add_event(Event(kind, 0, 700.0, position, velocity, 1e5))
    return summary


@kernel
def judged_loop(arrays, result):
    judge_loop(loop_records(arrays), result)


def in_a_campaign(mission, ended):
    """Judge a plant in that state as a campaign does; return a record RESULT."""
    loop = FlightRange(Settings(mission, Dispersions()))._blank
    plant = loop.vehicle.plant[0]
    plant["position"], plant["velocity"] = state_of(ended)
    plant["inserted"] = 0 if ended.dry or ended.grounded else 1
    kinds = [] if ended.left_on else [JETTISON_DONE]
    kinds += [IMPACT] if ended.grounded else []
    plant["event_count"] = len(kinds)
    for k, kind in enumerate(kinds):
        plant["events"][k]["type"] = kind
        plant["events"][k]["index"] = 0
        plant["events"][k]["time"] = 700.0
    result = np.zeros(1, RESULT)
    judged_loop(loop, result[0])
    return result[0]


def on_the_map(mission, ended):
    position, velocity = map(np.array, state_of(ended))
    jettisoned = 0 if ended.left_on else 1
    judge = Judge(mission)
    return judge.judge(position, velocity, 1e5, 700.0, jettisoned, grounded=ended.grounded)


def proven(flight, ended):
    """Replace the end of the proof's flight."""
    final = np.concatenate((*state_of(ended), [1e5]))
    track = flight.trajectory
    if ended.grounded:
        position = track.position.copy()
        position[-1] = final[:3]
        track = replace(track, position=position)
    dropped = (None,) if ended.left_on else ((0.0, 400.0),)
    return replace(flight, final=final, trajectory=track, at_jettison=dropped)


@pytest.mark.parametrize("name", ENDED)
def test_every_judge_says_the_same_of_an_end(name, missions, flights):
    ended = ENDED[name]
    mission = missions[ended.target]
    arrays, start = mission.arrays(), mission.start().navigation()[0]
    summary = flown(mission, ended)
    result = in_a_campaign(mission, ended)
    reached = on_the_map(mission, ended)
    flight = proven(flights[ended.target], ended)
    table = proof.constraint_table(arrays, start, flight, Heating.AT_JETTISON)
    verification = proof.verification(arrays, flight, None)

    ends = [summary.judgement.end, list(End)[result["end"]], reached.end, verification.end]
    assert ends == [ended.end] * 4
    # and so of the errors, where they are numbers
    for key, error in summary.insertion_error.items():
        field = key.removesuffix("_deg").removesuffix("_m_s").removesuffix("_m") + "_error"
        mine = math.degrees(result[field]) if key.endswith("_deg") else result[field]
        assert mine == pytest.approx(error, nan_ok=True)
    assert to_json(summary)["end"] == str(ended.end)
    # a target that is missed is no success anywhere
    met = {check.key: check.satisfied for check in table}
    target_met = all(ok for key, ok in met.items() if key in TARGET_CHECKS)
    assert target_met == (ended.end is End.TARGET)
    good = ended.end is End.TARGET and not (ended.dry or ended.grounded)
    assert (summary.outcome is Outcome.TARGET) == good
    assert bool(result["terminal_accuracy"]) == good
    assert (summary.exit_code == 0) == (good and not ended.left_on)


TARGET_CHECKS = set(Check) - {
    Check.HEATING_AT_JETTISON,
    Check.JETTISON_BEFORE_CUTOFF,
    Check.HEATING_FROM_JETTISON,
    Check.LOWEST_ALTITUDE,
    Check.PROPELLANT,
    Check.ARC_LENGTH,
    Check.HELD_DIRECTION,
}


@pytest.mark.parametrize("name", [name for name, ended in ENDED.items() if ended.left_on])
def test_a_fairing_that_never_dropped_is_told_everywhere(name, missions, flights):
    ended = ENDED[name]
    mission = missions[ended.target]
    fairing = mission.jettison_names[0]
    assert f"{fairing} was not jettisoned" in flown(mission, ended).shortcomings()
    result = in_a_campaign(mission, ended)
    assert f"{fairing} on at cut-off" in explain(result, mission.jettison_names)[1]
    assert on_the_map(mission, ended).left_on == (fairing,)
    flight = proven(flights[ended.target], ended)
    arrays, start = mission.arrays(), mission.start().navigation()[0]
    table = proof.constraint_table(arrays, start, flight, Heating.AT_JETTISON)
    assert "jettison 0 is still on at the cut-off" in check_obstacle(table)


def test_the_figures_of_the_proof_are_those_of_the_judge(missions, flights):
    for name, flight in flights.items():
        arrays, start = missions[name].arrays(), missions[name].start().navigation()[0]
        errors = proof.judged_end(arrays, flight).errors
        table = proof.constraint_table(arrays, start, flight, Heating.AT_JETTISON)
        rows = {check.key: check for check in table if check.key in TARGET_CHECKS}
        assert len(rows) == len(errors)
        for key, error in errors.items():
            row = next(row for row in rows.values() if key.startswith(row.key))
            size = max(1.0, abs(row.limit))
            assert row.value - row.limit == pytest.approx(error, abs=1e-9 * size), key
