# SPDX-License-Identifier: Apache-2.0
"""Hold-down on the pad and rails: what is burnt before the release."""

import math

import numpy as np
import pytest
import yaml

from ares_models.input_file import read_input
from ares_models.mission import MISSION, MissionError, load_mission, parse_mission
from ares_models.mission_warnings import file_warnings

G0 = 9.80665


def held(name, hold_s, change=None):
    """Return a shipped mission, changed and held down on its pad."""
    data, _ = read_input(MISSION.find(name), MISSION)
    if change is not None:
        change(data)
    data["initial_state"]["hold_down_s"] = hold_s
    return parse_mission(yaml.safe_dump(data), "held.yaml")


def test_what_is_burnt_on_the_pad_is_off_mass_propellant_and_time():
    free, release = load_mission("falcon9_leo_pad"), held("falcon9_leo_pad", 3.0)
    burn = free.stages[0].burns[0]
    burnt = 3.0 * burn.thrust_n / (G0 * burn.isp_s)
    assert burnt > 5000.0
    assert release.start().mass_kg == pytest.approx(free.start().mass_kg - burnt, rel=1e-12)
    assert release.ignition_mass(1) == free.ignition_mass(1)
    assert release.stages[0].burns[0].duration_s == pytest.approx(burn.duration_s - 3.0)
    assert release.start().time_s == free.start().time_s
    assert release.start().position.tolist() == free.start().position.tolist()


def test_boosters_that_are_lit_at_the_release_are_whole():
    def lit_later(data):
        for booster in data["stages"][0]["boosters"]:
            booster["ignition_s"] = 7.05

    free, release = load_mission("ariane5_eca_pad"), held("ariane5_eca_pad", 7.05, lit_later)
    assert release.stages[0].boosters == free.stages[0].boosters
    core = free.stages[0].burns[0]
    burnt = 7.05 * core.mass_flow(G0)
    assert release.start().mass_kg == pytest.approx(free.start().mass_kg - burnt, rel=1e-12)


@pytest.mark.parametrize("form", ["burn_time_s", "isp_s", "thrust_table"])
def test_boosters_that_are_lit_on_the_pad_have_less_to_burn(form):
    thrust = {"thrust_n": 500e3, form: 75.0 if form == "burn_time_s" else 275.0}
    if form == "thrust_table":
        thrust = {"thrust_table": [[0.0, 0.0], [2.0, 500e3], [70.0, 500e3], [75.0, 0.0]]}

    def one_kind(data):
        solids = {"name": "solids", "count": 4, "dry_mass_kg": 2e3, "propellant_kg": 15e3}
        data["stages"][0]["boosters"] = [{**solids, **thrust}]

    free, release = load_mission("soyuz_sso_pad"), held("soyuz_sso_pad", 2.0, one_kind)
    after = release.stages[0].boosters[0]
    length = {"burn_time_s": 75.0, "thrust_table": 75.0}.get(form, 15e3 * 275.0 * G0 / 500e3)
    share = {"burn_time_s": 2.0 / 75.0, "thrust_table": 0.5 * 2.0 / 71.5}.get(
        form, 2.0 * 500e3 / (275.0 * G0 * 15e3)
    )
    assert after.propellant_kg == pytest.approx(15e3 * (1.0 - share), rel=1e-9)
    assert after.burn_s(G0) == pytest.approx(length - 2.0)
    core = 2.0 * free.stages[0].burns[0].mass_flow(G0)
    solids = 4 * (2e3 + 15e3 * (1.0 - share))
    shipped = sum(
        one.count * (one.dry_mass_kg + one.propellant_kg) for one in free.stages[0].boosters
    )
    whole = free.start().mass_kg - shipped - core + solids
    assert release.start().mass_kg == pytest.approx(whole, rel=1e-12)
    if form == "thrust_table":
        assert after.thrust_table == ((0.0, 500e3), (68.0, 500e3), (73.0, 0.0))


def test_a_solid_motor_is_released_when_its_thrust_is_there():
    table = [[0.0, 0.0], [1.0, 600e3], [100.0, 700e3], [110.0, 0.0]]

    def solid(data):
        data["payload_kg"] = 100.0
        stage = data["stages"][0]
        for key in list(stage):
            if key not in ("name", "dry_mass_kg", "exit_area_m2"):
                del stage[key]
        stage |= {"thrust_table": table, "isp_s": 270.0, "propellant_kg": 27e3}
        data["stages"][1:] = [
            {
                "name": "second",
                "dry_mass_kg": 500.0,
                "propellant_kg": 5e3,
                "thrust_n": 6e4,
                "isp_s": 320.0,
                "burn_time_s": "free",
            }
        ]
        data["jettisons"] = []

    data, _ = read_input(MISSION.find("electron_sso_pad"), MISSION)
    solid(data)
    with pytest.raises(MissionError, match="hold_down_s of the initial_state holds the vehicle"):
        parse_mission(yaml.safe_dump(data), "solid.yaml")
    data["initial_state"]["hold_down_s"] = 1.0
    release = parse_mission(yaml.safe_dump(data), "solid.yaml")
    burn = release.stages[0].burns[0]
    assert burn.thrust_table == ((0.0, 600e3), (99.0, 700e3), (109.0, 0.0))
    burnt = 0.5 * 600e3 / (270.0 * G0)
    assert release.stages[0].propellant_kg == pytest.approx(27e3 - burnt)


@pytest.mark.parametrize(
    ("hold_s", "expected"),
    [
        (
            1e4,
            "initial_state.hold_down_s is 10000.0; expected a release before the first burn ends",
        ),
        (-1.0, "initial_state.hold_down_s is -1.0; expected a number from 0 to 864000 in s"),
    ],
)
def test_a_hold_that_leaves_no_burn_is_refused(hold_s, expected):
    with pytest.raises(MissionError, match=expected) as caught:
        held("falcon9_leo_pad", hold_s)
    assert "\n" not in str(caught.value)


def test_a_flight_that_does_not_begin_on_the_pad_is_not_held():
    expected = (
        "initial_state.hold_down_s is 1.0; expected no such key here: it belongs to a start at "
        "rest on the ground, which is by geodetic_latitude_deg, longitude_deg and altitude_m alone"
    )
    for name in ("ares_v", "apollo11_ascent", "geostationary_burn"):
        with pytest.raises(MissionError, match=expected):
            held(name, 1.0)
    data, _ = read_input(MISSION.find("ares_v"), MISSION)
    data["initial_state"]["rail"] = {"length_m": 10.0, "elevation_deg": 80.0, "azimuth_deg": 90.0}
    with pytest.raises(MissionError, match=r"initial_state\.rail is .*; expected no such key here"):
        parse_mission(yaml.safe_dump(data), "rail.yaml")
    assert load_mission("delta_iii_pad").held is None


def test_boosters_that_burn_long_on_the_pad_are_warned_of(tmp_path):
    data, _ = read_input(MISSION.find("ariane5_eca_pad"), MISSION)
    data["initial_state"]["hold_down_s"] = 7.0
    path = tmp_path / "held.yaml"
    path.write_text(yaml.safe_dump(data))
    (line,) = [line for line in file_warnings(path) if "hold_down_s" in line]
    assert "hold_down_s lets boosters" in line
    assert line.endswith(
        "burn for 7 s on the pad; if they are lit at the release, their ignition_s is 7"
    )
    mission = load_mission(path)
    whole = load_mission("ariane5_eca_pad").start().mass_kg
    assert mission.held.burnt_kg == pytest.approx(whole - mission.start().mass_kg)


def test_boosters_that_are_lit_later_ask_for_a_hold_down():
    data, _ = read_input(MISSION.find("ariane5_eca_pad"), MISSION)
    data["stages"][0]["boosters"][0]["ignition_s"] = 7.0
    with pytest.raises(MissionError, match="are lit 7 s later: hold_down_s of the initial_state"):
        parse_mission(yaml.safe_dump(data), "late.yaml")


def on_rail(length_m=30.0, elevation_deg=85.0, change=None):
    """Return a small launcher on a rail to the east."""
    data, _ = read_input(MISSION.find("electron_sso_pad"), MISSION)
    del data["stages"][0]["vertical_rise_s"]
    rail = {"length_m": length_m, "elevation_deg": elevation_deg, "azimuth_deg": 90.0}
    data["initial_state"]["rail"] = rail
    if change is not None:
        change(data)
    return parse_mission(yaml.safe_dump(data), "rail.yaml")


def test_a_vehicle_leaves_its_rail_as_newton_has_it():
    mission, free = on_rail(), load_mission("electron_sso_pad")
    burn = free.stages[0].burns[0]
    burnt = burn.mass_flow(G0) * mission.held.time_s
    # 100,129 Pa at 100 m of altitude; two thirds are burnt in the mean over the way
    net = burn.full_thrust_n - burn.exit_area_m2 * 100129.0
    weight = 9.80 * math.sin(math.radians(85.0))
    gain = net / (free.start().mass_kg - 2.0 / 3.0 * burnt) - weight
    assert mission.held.speed_m_s == pytest.approx(math.sqrt(2.0 * gain * 30.0), rel=1e-3)
    slower = net / (free.start().mass_kg - burnt / 3.0) - weight
    assert mission.held.time_s == pytest.approx(math.sqrt(2.0 * 30.0 / slower), rel=1e-3)
    assert mission.held.burnt_kg == pytest.approx(burnt, rel=1e-9)
    assert mission.start().mass_kg == pytest.approx(free.start().mass_kg - burnt, rel=1e-9)


def test_the_end_of_a_rail_is_a_start_over_the_ground():
    mission, free = on_rail(elevation_deg=80.0), load_mission("electron_sso_pad")
    earth, start, site = mission.earth(), mission.start(), free.start()
    moved = start.position - site.position
    up = site.position / np.linalg.norm(site.position)
    east = np.cross([0.0, 0.0, 1.0], up) / np.linalg.norm(np.cross([0.0, 0.0, 1.0], up))
    assert moved @ up == pytest.approx(30.0 * math.sin(math.radians(80.0)), rel=1e-3)
    assert moved @ east == pytest.approx(30.0 * math.cos(math.radians(80.0)), rel=1e-6)
    over_ground = start.velocity - np.cross([0.0, 0.0, earth.rotation_rate], start.position)
    assert over_ground / np.linalg.norm(over_ground) == pytest.approx(moved / 30.0, abs=1e-6)
    assert mission.initial_state.is_launch
    assert start.time_s == site.time_s


def test_a_motor_whose_thrust_builds_up_stands_on_its_rail():
    def slow(data):
        stage = data["stages"][0]
        full, isp = stage.pop("thrust_n"), stage["isp_s"]
        del stage["engines"]
        stage["thrust_table"] = [[0.0, 0.0], [4.0, full], [100.0, full]]
        stage["propellant_kg"] = 98.0 * full / (isp * G0) + 1.0
        stage.pop("burn_time_s", None)

    mission = on_rail(change=slow)
    whole = on_rail()
    assert mission.held.time_s > whole.held.time_s + 2.0
    table = mission.stages[0].burns[0].thrust_table
    assert table[-1][0] == pytest.approx(100.0 - mission.held.time_s)


def test_boosters_on_a_rail_are_not_held_down(tmp_path):
    def with_boosters(data):
        kind = {"name": "weak", "dry_mass_kg": 10.0, "propellant_kg": 20.0, "thrust_n": 2e3}
        data["stages"][0]["boosters"] = [{**kind, "burn_time_s": 30.0}]
        (tmp_path / "rail.yaml").write_text(yaml.safe_dump(data))

    assert on_rail(change=with_boosters).held.boosters_s[0] > 3.0
    assert not [line for line in file_warnings(tmp_path / "rail.yaml") if "hold_down_s" in line]


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"length_m": 0.0}, "rail.length_m is 0.0; expected a number from 0.1 to 1000 in m"),
        ({"elevation_deg": 5}, "rail.elevation_deg is 5; expected a number from 10 to 90 in deg"),
        ({"bearing_deg": 5}, r"rail.bearing_deg is not a known key"),
    ],
)
def test_a_rail_that_is_none_is_refused(change, expected):
    with pytest.raises(MissionError, match=expected):
        on_rail(change=lambda data: data["initial_state"]["rail"].update(change))


def test_a_rail_excludes_what_else_holds_the_vehicle():
    with pytest.raises(MissionError, match=r"hold_down_s is 1\.0; expected none, with a rail"):
        on_rail(change=lambda data: data["initial_state"].update(hold_down_s=1.0))
    with pytest.raises(MissionError, match=r"vertical_rise_s is 3\.0; expected none, since a rail"):
        on_rail(change=lambda data: data["stages"][0].update(vertical_rise_s=3.0))


@pytest.mark.trial
def test_a_vehicle_that_its_engine_does_not_lift_never_leaves_its_rail():
    def weak(data):
        data["stages"][0]["thrust_n"] *= 0.5
        data["stages"][0]["burn_time_s"] *= 2.0

    with pytest.raises(MissionError, match=r"leaves within 60 s; it travels 0\.0 m"):
        on_rail(change=weak)


def test_a_vertical_rise_is_over_before_the_burn_that_was_held_ends():
    def rising(data):
        stage = data["stages"][0]
        burn = {key: stage.pop(key) for key in ("thrust_n", "isp_s", "engines", "exit_area_m2")}
        burn_time_s, _ = stage.pop("burn_time_s"), stage.pop("vertical_rise_s")
        rise = burn | {"burn_time_s": 13.0, "vertical_rise_s": 10.0}
        stage["arcs"] = [rise, {**burn, "burn_time_s": burn_time_s - 13.0}]

    with pytest.raises(MissionError) as error:
        held("falcon9_gto_pad", 3.0, rising)
    assert str(error.value).endswith(
        "stages[0].arcs[0].vertical_rise_s is 10.0; expected less than the 10 s from the release "
        "to the end of the burn"
    )
