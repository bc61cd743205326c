# SPDX-License-Identifier: Apache-2.0
"""Hold-down on the pad: what is burnt before the release."""

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
        (1e4, "initial_state.hold_down_s is 10000.0; expected less than the .* s to the end of"),
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
    assert load_mission("delta_iii_pad").initial_state.held_s == 0.0


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
