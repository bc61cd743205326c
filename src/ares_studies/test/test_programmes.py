# SPDX-License-Identifier: Apache-2.0
"""Flights by a boost programme of the mission's own: open loop, and up to the hand-over."""

import math
from importlib import resources

import numpy as np
import pytest

from ares_guidance.arrays import PHASE_BOOST
from ares_models.judge import End, judge
from ares_models.kernels.boost import boost_direction, horizon
from ares_models.kernels.environment import altitude, relative_velocity
from ares_models.mission import load_mission, parse_mission
from ares_optimizer.collocation.boost import after_boost
from ares_optimizer.solution import OptimizerError, Status, UnfitMethod
from ares_optimizer.solve import solve
from ares_studies.closed_loop import fly_compiled, fly_stepwise, ready_law
from ares_vehicle_sim.arrays import CUTOFF, JETTISON_DONE, STAGING
from ares_vehicle_sim.dispersions import Dispersions
from ares_vehicle_sim.simulator import Simulator

pytestmark = pytest.mark.long

TEXT = resources.files("ares_trials").joinpath("sweep", "programme.yaml").read_text()
TURN = TEXT[TEXT.index("programme:\n  kick") : TEXT.index("\ntarget:")]

#: Example of a gravity turn in Curtis, Orbital Mechanics for Engineering Students (Example 11.3,
#: 13.3 from the fourth edition on): mass ratio 7, 1.4 g, Isp 390 s, Cd 0.5, pitchover at 130 m.
CURTIS = f"""
name: gravity_turn
title: textbook example of a gravity turn
source: Curtis, Orbital Mechanics for Engineering Students, Example 13.3
environment:
  mu_m3_s2: {9.81 * 6378000.0**2}
  g0_m_s2: 9.81
  altitude: spherical
  earth:
    equatorial_radius_m: 6378000.0
    polar_radius_m: 6378000.0
    rotation_rate_rad_s: 0.0
    zero_longitude_deg: 0.0
  atmosphere: {{model: exponential, surface_density_kg_m3: 1.225, scale_height_m: 7500.0}}
aerodynamics: {{reference_area_m2: 19.634876, drag_table: [[0.0, 0.5]]}}
initial_state:
  time_s: 8.020042
  geodetic_latitude_deg: 0.0
  longitude_deg: 0.0
  altitude_m: 130.0
  ground_speed_m_s: 32.835320
  elevation_deg: 89.85
  ground_azimuth_deg: 90.0
stages:
  - name: only
    ignition_mass_kg: 66042.368
    thrust_n: 933913.14
    isp_s: 390.0
    burn_time_s: 230.755468
programme: {{over: time_s, table: [[0.0, 90.0, 90.0]], beyond: velocity}}
target: {{perigee_altitude_m: 200000.0, inclination_deg: 0.0}}
"""

#: First stage of SS-520-4, an example of OpenTsiolkovsky 0.52 (istellartech), as its files have it.
SS520 = """
name: ss520_first_stage
title: example of another simulator
source: OpenTsiolkovsky, examples/SS-520-4
environment:
  mu_m3_s2: 3.986004418e14
  j2: 1.0826267e-3
  earth:
    equatorial_radius_m: 6378137.0
    polar_radius_m: 6356752.3142
    rotation_rate_rad_s: 7.292115e-5
    zero_longitude_deg: 0.0
  atmosphere: {model: us76}
aerodynamics:
  reference_area_m2: 0.21237
  axial_table: [[0, 0.28], [0.4, 0.28], [0.6, 0.29], [0.8, 0.35], [1, 0.64], [1.2, 0.67],
    [1.4, 0.69], [1.6, 0.66], [1.8, 0.62], [2, 0.58], [2.5, 0.55], [3, 0.48], [3.5, 0.42],
    [4, 0.38], [4.5, 0.355], [5, 0.33]]
initial_state:
  time_s: 0.0
  geodetic_latitude_deg: 31.251808
  longitude_deg: 131.078999
  altitude_m: 267.0
stages:
  - name: first
    ignition_mass_kg: 2200.0
    thrust_table: [[0.0, 160000.0], [10.0, 100000.0], [30.0, 50000.0], [31.7, 20000.0]]
    isp_s: 190.0
    exit_area_m2: 0.1964
programme: {over: time_s, table: [[0.0, 82.0, 99.0], [31.7, 77.0, 99.0]]}
target: {perigee_altitude_m: 200000.0, inclination_deg: 60.0}
"""

#: Another example of it, kept at one attitude up to 43 deg off the velocity.
SAMPLE = (
    SS520[: SS520.index("aerodynamics:")]
    + """
aerodynamics:
  reference_area_m2: 0.1963495
  axial_table: [[0.0, 0.2]]
initial_state:
  time_s: 0.0
  geodetic_latitude_deg: 42.506129
  longitude_deg: 143.456482
  altitude_m: 15.0
stages:
  - name: first
    ignition_mass_kg: 1000.0
    propellant_kg: 920.0
    thrust_n: 15000.0
    isp_s: 200.0
    exit_area_m2: 0.0392699
    burn_time_s: 120.0
programme: {over: time_s, table: [[0.0, 83.0, 113.0], [1000.0, 83.0, 113.0]]}
target: {perigee_altitude_m: 200000.0, inclination_deg: 60.0}
"""
)


#: The last burn of a mission that its programme flies whole.
WHOLE_S = ("burn_time_s: free", "burn_time_s: 300.0")


def mission(programme=TURN, **edits):
    text = TEXT.replace(TURN, programme)
    for old, new in edits.values():
        assert old in text
        text = text.replace(old, new)
    return parse_mission(text, "x.yaml")


def over_ground(plant, environment):
    """Return altitude m, speed over ground m/s and its elevation deg."""
    r, v = tuple(plant["position"]), tuple(plant["velocity"])
    w = np.array(relative_velocity(r, v, environment))
    speed = float(np.linalg.norm(w))
    up = np.array(horizon(r, environment)[2])
    return altitude(r, environment), speed, math.degrees(math.asin(w @ up / speed))


def test_a_gravity_turn_ends_as_the_textbook_integrates_it():
    made = parse_mission(CURTIS, "curtis.yaml")
    plant = fly_stepwise(made).plant
    height, speed, elevation = over_ground(plant, made.arrays().environment[0])
    # its equations in polar coordinates, integrated to 1e-12
    assert speed == pytest.approx(5736.558, rel=1e-4)
    assert height == pytest.approx(110_384.3, rel=1e-3)
    assert elevation == pytest.approx(9.1652, abs=0.01)
    x, y, _ = plant["position"]
    assert 6378000.0 * math.atan2(y, x) == pytest.approx(318_332.6, rel=1e-3)
    assert plant["mass"] == pytest.approx(68_000.083 / 7.0, rel=1e-5)


@pytest.mark.parametrize(
    ("text", "end_s", "altitude_m", "speed_m_s", "elevation_deg", "mass_kg"),
    [
        (SS520, 31.7, 22_292.2, 1_390.60, 77.37, 665.33),
        (SAMPLE, 120.0, 77_458.4, 3_258.47, 80.6925, 82.255),
    ],
)
def test_a_flight_by_attitude_ends_as_in_another_simulator(
    text, end_s, altitude_m, speed_m_s, elevation_deg, mass_kg
):
    made = parse_mission(text, "example.yaml")
    plant = fly_stepwise(made).plant
    height, speed, elevation = over_ground(plant, made.arrays().environment[0])
    assert plant["time"] == pytest.approx(end_s)
    # its run without a normal force; its air takes geometric for geopotential altitude
    assert height == pytest.approx(altitude_m, rel=1e-3)
    assert speed == pytest.approx(speed_m_s, rel=1e-3)
    assert elevation == pytest.approx(elevation_deg, abs=0.02)
    assert plant["mass"] == pytest.approx(mass_kg, rel=1.5e-4)


#: Flown by AS-506 (MPR-SAT-FE-69-9, SP-4029): time s, altitude m, inertial speed m/s, flight-path
#: angle deg at centre engine cut-off, outboard engine cut-off and separation.
AS506 = [
    (135.20, 44_005.0, 1979.0, 22.96),
    (161.63, 66_118.0, 2764.1, 19.11),
    (162.30, 66_710.0, 2773.9, 19.02),
]


def test_apollo_11_climbs_by_its_tilt_programme_as_it_flew():
    made = load_mission("saturn_v_as506_flown")
    law = ready_law(made, "igm")
    simulator = Simulator(made)
    greatest, states = (0.0, 0.0), []
    while not simulator.complete:
        law.step(simulator.navigation)
        simulator.command(law.steering)
        simulator.advance()
        truth, now = simulator.truth(), float(simulator.plant["time"])
        if now < 163.0:
            greatest = max(greatest, (float(truth["dynamic_pressure"]), now))
            speed = float(np.linalg.norm(simulator.plant["velocity"]))
            angle = math.degrees(truth["flight_path_angle"])
            states.append((now, float(truth["altitude"]), speed, angle))
    times, heights, speeds, angles = np.array(states).T
    for time, height, speed, angle in AS506:
        assert np.interp(time, times, heights) == pytest.approx(height, rel=0.01)
        assert np.interp(time, times, speeds) == pytest.approx(speed, rel=0.01)
        assert np.interp(time, times, angles) == pytest.approx(angle, abs=0.2)
    # flown: 35.2 kPa at 83.0 s
    assert greatest[0] == pytest.approx(35_200.0, rel=0.01)
    assert greatest[1] == pytest.approx(83.0, abs=3.0)
    # flown: 699.34 s
    cut = next(float(e["time"]) for e in simulator.new_events() if e["type"] == CUTOFF)
    assert cut == pytest.approx(699.34, rel=0.01)


@pytest.fixture(scope="module")
def optimum():
    return solve(mission(), "auto")


def test_the_optimum_is_that_of_what_the_programme_leaves(optimum):
    assert optimum.converged
    start = after_boost(mission().arrays(), mission().start().navigation())[0]
    assert optimum.flown[0].arc == 1
    assert optimum.trajectory.time_s[0] == pytest.approx(152.9)
    assert start["mass"][0] == pytest.approx(optimum.trajectory.mass[0])
    free = solve(mission(""), "auto")
    assert free.converged
    assert optimum.m_f_kg < free.m_f_kg


def test_what_drops_as_the_programme_ends_is_off_in_the_plan():
    fairing = (
        "\njettisons:\n  - {name: fairing, mass_kg: 200.0, stage: first, time_s: 100.0}\ntarget:"
    )
    ends = [
        after_boost(made.arrays(), made.start().navigation())[0]
        for until in (99.9, 100.0, 100.1)
        for made in [
            mission(
                end=("until: {end_of: first}", f"until: {{time_s: {until}}}"),
                drop=("\ntarget:", fairing),
            )
        ]
    ]
    before, at, after = (float(end["mass"][0]) for end in ends)
    # the programme ends within a step of 0.025 s
    flow, step = 40000.0 / 152.9, 7.0
    assert before - after == pytest.approx(200.0 + 0.2 * flow, abs=step)
    # the part is off and its mass too, or neither is
    on = ends[1]["jettisoned"][0] == 0
    assert at - after == pytest.approx(0.1 * flow + 200.0 * on, abs=step)
    assert ends[2]["jettisoned"][0] == 1


def test_a_drop_counts_from_the_ignition_and_not_from_where_the_plan_begins():
    fairing = (
        "\njettisons:\n  - {name: fairing, mass_kg: 200.0, stage: first, "
        "time_after_ignition_s: 130.0}\ntarget:"
    )
    until = ("until: {end_of: first}", "until: {time_s: 140.0}")
    made = mission(drop=("\ntarget:", fairing), ends=until)
    simulator = Simulator(made)
    law = ready_law(mission(whole=("  until: {end_of: first}\n", ""), fixed=WHOLE_S))
    while simulator.navigation["time"] < 60.0:
        law.step(simulator.navigation)
        simulator.command(law.steering)
        simulator.advance()
    whole, rest = (
        after_boost(made.arrays(), start)[0]
        for start in (made.start().navigation(), np.array([simulator.navigation]))
    )
    assert rest["jettisoned"][0] == whole["jettisoned"][0] == 1
    assert rest["mass"][0] == pytest.approx(whole["mass"][0], abs=1e-3)


def test_a_limit_that_the_programme_passes_is_told(optimum):
    edit = ("    exit_area_m2: 0.9", "    exit_area_m2: 0.9\n    max_dynamic_pressure_pa: {}")
    low, high = (
        solve(mission(limit=(edit[0], edit[1].format(limit))), "auto") for limit in (5e3, 2e5)
    )
    assert high.converged
    assert high.m_f_kg == pytest.approx(optimum.m_f_kg, rel=1e-6)
    row = next(c for c in high.constraints if c.name == "dynamic pressure of stage 0")
    assert row.satisfied
    assert 5e3 < row.value < 2e5
    assert low.status is Status.FEASIBLE
    assert low.reason.startswith("the programme of the file passes a limit: dynamic pressure")
    same = next(c for c in low.constraints if c.name == "dynamic pressure of stage 0")
    assert not same.satisfied
    assert same.value == pytest.approx(row.value)


@pytest.mark.parametrize("law", ["peg", "igm", "optimal"])
def test_a_law_takes_over_where_the_programme_ends(optimum, law):
    made = mission()
    ready = ready_law(made, law)
    flown = fly_stepwise(made, law=ready)
    planned = after_boost(made.arrays(), made.start().navigation())[0]
    staged = next(event for event in flown.events if event["type"] == STAGING)
    assert staged["time"] == pytest.approx(float(planned["time"][0]), abs=1e-6)
    assert np.linalg.norm(staged["position"] - planned["position"][0]) < 50.0
    assert np.linalg.norm(staged["velocity"] - planned["velocity"][0]) < 1.0
    plant = flown.plant
    arrays = made.arrays()
    environment = arrays.environment[0]
    judged = judge(
        plant["position"],
        plant["velocity"],
        arrays.target[0],
        float(environment["mu"]),
        float(environment["equatorial_radius"]),
    )
    assert judged.end is End.TARGET
    assert plant["mass"] > optimum.m_f_kg * 0.995
    assert flown.guidance["programme"]["cycle"] == pytest.approx(153, abs=1)


def test_a_law_that_flies_again_keeps_its_plan():
    made = mission()
    law = ready_law(made)
    first = fly_stepwise(made, law=law).plant
    law.reset()
    again = fly_stepwise(made, law=law).plant
    assert again["mass"] == first["mass"]


def test_what_is_left_may_begin_in_thick_air():
    made = mission(ends=("until: {end_of: first}", "until: {time_s: 20.0}"))
    found = solve(made, "auto")
    assert found.converged
    law = ready_law(made, guess=found)
    simulator = Simulator(made)
    boosting = []
    while not simulator.complete:
        law.step(simulator.navigation)
        boosting += [float(simulator.navigation["time"])] * (law.phase == PHASE_BOOST)
        simulator.command(law.steering)
        simulator.advance()
    # from there by the planned programme, until the air is thin
    assert max(boosting) > 100.0
    assert simulator.plant["mass"] == pytest.approx(found.m_f_kg, rel=5e-3)


WHOLE = """programme:
  over: {over}
  table: {table}
"""


def flown_whole(programme, length=300.0):
    fixed = ("burn_time_s: free", f"burn_time_s: {length}")
    return mission(programme, fixed=fixed)


def test_a_mission_is_flown_whole_without_a_law():
    made = flown_whole(TURN.replace("  until: {end_of: first}\n", ""))
    law = ready_law(made)
    simulator = Simulator(made)
    environment = made.arrays().environment[0]
    off = []
    while not simulator.complete:
        law.step(simulator.navigation)
        assert law.phase == PHASE_BOOST
        nav = simulator.navigation
        wanted = boost_direction(
            float(nav["time"]), tuple(nav["position"]), tuple(nav["velocity"]), environment
        )
        if np.linalg.norm(law.steering["direction"][0] - wanted) > 1e-9:
            off.append(float(nav["time"]))
        simulator.command(law.steering)
        simulator.advance()
    # the kick is shared out over the step that it is in, and so is its end
    assert len(off) == 2
    assert off[1] < 30.0
    assert simulator.ended_well
    assert simulator.plant["time"] == pytest.approx(152.9 + 4.0 + 300.0)
    compiled = fly_compiled(made, law=ready_law(made, "igm")).plant
    assert compiled["position"] == pytest.approx(simulator.plant["position"], abs=1e-3)


def test_nothing_is_left_to_optimize_where_the_programme_flies_all():
    with pytest.raises(UnfitMethod, match="it flies the whole mission, and nothing is left"):
        solve(flown_whole(TURN.replace("  until: {end_of: first}\n", "")), "auto")


@pytest.mark.parametrize(
    ("end", "text"),
    [
        (
            "until: {altitude_m: 1e7}",
            r"programme\.until\.altitude_m is 1e\+07; expected .*, at [\d.]+ s: at most [\d,.]+$",
        ),
        ("until: {time_s: 3.0}", r"programme\.until is met at 3\.0 s, before the kick"),
        ("kick_deg: 40", r"programme meets the ground at \d+\.\d s, before it ends$"),
    ],
)
def test_a_programme_that_comes_to_no_good_end_is_refused(end, text):
    old = "until: {end_of: first}" if end.startswith("until") else "kick_deg: 4.0"
    made = mission(ends=(old, end))
    with pytest.raises(OptimizerError, match=text):
        solve(made, "auto")


@pytest.mark.parametrize(
    ("over", "moves"), [("time_s", False), ("speed_m_s", True), ("altitude_m", True)]
)
def test_a_weak_engine_is_late_on_a_table_over_speed_and_not_on_one_over_time(over, moves):
    last = {"time_s": 100.0, "speed_m_s": 900.0, "altitude_m": 30_000.0}[over]
    table = f"[[0, 90, 60], [{0.1 * last}, 90, 60], [{last}, 45, 60]]"
    made = flown_whole(WHOLE.format(over=over, table=table))
    pitches = []
    for thrust in (0.0, -0.05):
        simulator = Simulator(made, dispersions=Dispersions(thrust={"mean": thrust}))
        law = ready_law(made)
        while simulator.navigation["time"] < 60.0:
            law.step(simulator.navigation)
            simulator.command(law.steering)
            simulator.advance()
        up = np.array(horizon(tuple(simulator.plant["position"]), made.arrays().environment[0])[2])
        pitches.append(math.degrees(math.asin(law.steering["direction"][0] @ up)))
    assert (pitches[1] > pitches[0] + 0.5) == moves
    assert moves or pitches[1] == pytest.approx(pitches[0], abs=0.01)


def test_a_fairing_drops_after_the_peak_of_the_heating_in_the_programme():
    nose = "{name: nose, mass_kg: 99.0, stage: first, heating_limit_w_m2: 1e6}"
    made = mission(fairing=("\nprogramme:", f"\njettisons: [{nose}]\nprogramme:"))
    drops = []
    for flown in (fly_stepwise(made), fly_stepwise(made, law="igm")):
        events = [event for event in flown.events if event["type"] == JETTISON_DONE]
        assert len(events) == 1
        assert events[0]["heating_rate"] < 1e6
        drops.append(float(events[0]["time"]))
    assert 60.0 < drops[0] < 152.9
    assert drops[1] == drops[0]
    start = after_boost(made.arrays(), made.start().navigation())[0]
    assert start["jettisoned"][0] == 1
