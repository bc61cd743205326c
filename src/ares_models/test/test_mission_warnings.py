# SPDX-License-Identifier: Apache-2.0
"""Warnings name doubtful values by line and key; sound missions have none."""

import math

import pytest
import yaml

from ares_models.input_file import read_input
from ares_models.mission import MISSION, TEMPLATE, list_missions, load_mission
from ares_models.mission_warnings import file_warnings, pressure_warning, warnings


@pytest.mark.parametrize("name", [*list_missions(), TEMPLATE])
def test_of_a_shipped_mission_nothing_is_said(name):
    assert warnings(load_mission(name)) == []
    assert file_warnings(name) == []


def test_a_plan_through_thick_air_is_doubtful_where_no_stage_has_a_limit():
    free, limited = load_mission("delta_iii_pad"), load_mission(TEMPLATE)
    assert pressure_warning(free, 273e3).startswith("the planned flight passes through 273 kPa, ")
    for mission, most in ((free, 149e3), (free, math.nan), (limited, 273e3)):
        assert pressure_warning(mission, most) == ""


#: Stands for a key that is left out.
ABSENT = object()


def changed(tmp_path, changes, base=TEMPLATE):
    """Write a mission with changed values, by key path, to a file."""
    data, _ = read_input(MISSION.find(base), MISSION)
    for path, value in changes.items():
        *way, last = (int(key) if key.isdigit() else key for key in path.split("."))
        at = data
        for key in way:
            at = at[key]
        if value is ABSENT:
            del at[last]
        else:
            at[last] = value
    file = tmp_path / "doubtful.yaml"
    file.write_text(yaml.safe_dump(data))
    return file


SLIPS = {
    "wind by direction": (
        {"environment.atmosphere.wind_table": [[0.0, 5.0, 180.0], [9000.0, 40.0, 190.0]]},
        ["environment.atmosphere.wind_table has 180 m/s at 0 m; are its knots [altitude, eastw"],
    ),
    "pressure in kPa": (
        {"stages.0.max_dynamic_pressure_pa": 45.0},
        ["stages[0].max_dynamic_pressure_pa is 45 Pa; launchers pass through 20,000 to 60,000"],
    ),
    "wind by km": (
        {"environment.atmosphere.wind_table": [[0.0, 3.0, 1.0], [5.0, 18.0, 4.0], [20.0, 8.0, 0]]},
        ["environment.atmosphere.wind_table ends at 20 m; are its altitudes in m?"],
    ),
    "circle in km": (
        {"target.perigee_altitude_m": 300.0, "target.apogee_altitude_m": 300.0},
        [
            (
                "target.perigee_altitude_m is inside the air, 1.2e+00 kg/m3: "
                "no orbit lasts there; is it in m?"
            )
        ],
    ),
    "orbit too low": (
        {"target.perigee_altitude_m": 95e3},
        ["target.perigee_altitude_m is inside the air, 1.4e-06 kg/m3: no orbit lasts there"],
    ),
    "Isp times ten": (
        {"stages.1.arcs.1.isp_s": 3430.0},
        ["stages[1].arcs[1].isp_s is 3430 s; chemical engines have 61 to 500 s; an exhaust vel"],
    ),
    "Isp by ten": (
        {"stages.1.arcs.1.isp_s": 34.3},
        ["stages[1].arcs[1].isp_s is 34.3 s; chemical engines have 61 to 500 s"],
    ),
    "thrust in kN": (
        {"stages.1.arcs.1.thrust_n": 25.8},
        ["stages[1].arcs[1].thrust_n burns the stage's propellant in 3.2 days; is it in N?"],
    ),
    "thrust in mN": (
        {"stages.1.arcs.1.thrust_n": 25.8e6, "stages.1.arcs.1.isp_s": 343.0},
        ["stages[1].arcs[1].thrust_n makes 9,736 m/s2 at ignition; is it in N, the mass in kg?"],
    ),
    "dry mass in t": (
        {"stages.1.dry_mass_kg": 0.235},
        ["stages[1].dry_mass_kg is 0.235 kg for 2,150 kg of propellant; is it in kg?"],
    ),
    "limit in kW/m2": (
        {"jettisons.0.heating_limit_w_m2": 1.135},
        ["jettisons[0].heating_limit_w_m2 is 1.135 W/m2; 1,135 W/m2 is usual"],
    ),
    "limit in mW/m2": (
        {"jettisons.0.heating_limit_w_m2": 1.135e6},
        ["jettisons[0].heating_limit_w_m2 is 1.135e6 W/m2; 1,135 W/m2 is usual"],
    ),
    "limit that no part of the orbit meets": (
        {"target.perigee_altitude_m": 118e3, "target.apogee_altitude_m": 118e3},
        ["jettisons[0].heating_limit_w_m2 may never be met: in the target's orbit it is 5,"],
    ),
    "payload in t": (
        {"payload_kg": 0.2},
        ["payload_kg is 0.2 kg of 14,200.2 kg at the start; is it in kg?"],
    ),
    "fairing times a hundred": (
        {"jettisons.0.mass_kg": 2500.0},
        ["jettisons[0].mass_kg is 2,500 kg, all empty stages together 1,185 kg; is it in kg?"],
    ),
    "fairing in t": (
        {"jettisons.0.mass_kg": 0.05},
        ["jettisons[0].mass_kg is 0.05 kg of 14,350 kg at the start; is it in kg?"],
    ),
    "inclination from the pad in radians": (
        {"target.inclination_deg": 0.785},
        [
            (
                "target.inclination_deg is 0.785, a plane that does not reach the pad's latitude, "
                "39.1 deg: the flight has to turn by 38.3 deg or more, a dog leg; or is it in "
                "radians, 44.98 deg?"
            )
        ],
    ),
    "plane over both poles in radians, from near the equator": (
        {"initial_state.geodetic_latitude_deg": 5.24, "target.inclination_deg": 1.7},
        ["target.inclination_deg is 1.7, a plane that does not reach the pad's latitude, 5.2 deg"],
    ),
    "inclination below the pad's latitude": (
        {"target.inclination_deg": 20.0},
        ["target.inclination_deg is 20, a plane that does not reach the pad's latitude, 39.1 deg"],
    ),
    "node of another time of launch": (
        {"target.ascending_node_deg": 40.0},
        ["target.ascending_node_deg is 40, a plane that is "],
    ),
    "acceleration in g": (
        {"stages.1.arcs.1.max_acceleration_m_s2": 4.5},
        ["stages[1].arcs[1].max_acceleration_m_s2 is 4.5 m/s2, at ignition there are 9.7"],
    ),
    "burn in minutes": (
        {"stages.0.burn_time_s": 2.5, "stages.0.vertical_rise_s": 1.0},
        ["stages[0].propellant_kg is 10,800 kg, its burns take 184.4 kg; is the thrust in N?"],
    ),
    "radius for an altitude": (
        {"target.apogee_altitude_m": 42_164e3},
        ["target.apogee_altitude_m is 42,164,000 m, the radius of the synchronous orbit, not its"],
    ),
}
#: Slips where a flight begins above the air, with the changed mission.
ABOVE_THE_AIR = {
    "node of another day": (
        {"target.ascending_node_deg": 300.0},
        ["target.ascending_node_deg is 300, a plane "],
    ),
    "inclination in radians": (
        {"target.inclination_deg": 1.698},
        ["target.inclination_deg is 1.698 deg, that of the initial state "],
    ),
    "start in km": (
        {"initial_state.radius_m": 6_370_000.0},
        ["initial_state.radius_m makes a dynamic pressure of"],
    ),
    "speed in km/s": (
        {"initial_state.speed_m_s": 3.024},
        ["initial_state.speed_m_s makes 3.02 m/s; is it in m/s?"],
    ),
    "a safe perigee in km": (
        {"abort": {"safe_perigee_altitude_m": 150.0}},
        ["abort.safe_perigee_altitude_m is 150 m, inside the air; is it in m?"],
    ),
}


#: Slips of launchers with boosters: key, value, the changed mission, and the warning.
BOOSTERS = "stages.0.boosters.0"
WITH_BOOSTERS = {
    "thrust of all with a burn time": (
        "soyuz_sso_pad",
        {"thrust_n": 4.0 * 1_021_300.0},
        "thrust_n makes an Isp of 1275 s; is it of one booster, not of all 4?",
    ),
    "thrust of all with an Isp": (
        "soyuz_sso_pad",
        {"thrust_n": 4.0 * 1_021_300.0, "isp_s": 319.0, "burn_time_s": ABSENT},
        "thrust_n gives one booster 92 m/s2 at ignition; is it of one booster, not of all 4?",
    ),
    "thrust of both with an Isp": (
        "ariane5_eca_pad",
        {"thrust_n": 1.4e7, "isp_s": 274.5, "thrust_table": ABSENT},
        "thrust_n makes 38 m/s2 at lift-off, all engines together; is it of one booster, not of",
    ),
    "table of both": (
        "ariane5_eca_pad",
        {"thrust_table": [[0.0, 1.4e7], [100.0, 1e7], [127.0, 2e6]]},
        "thrust_table makes an Isp of 578.7 s; is it of one booster, not of all 2?",
    ),
    "Isp times ten": (
        "soyuz_sso_pad",
        {"thrust_n": 1.1e7, "isp_s": 3_190.0, "burn_time_s": ABSENT},
        "isp_s is 3190 s; chemical engines have 61 to 500 s",
    ),
}


@pytest.mark.parametrize("slip", WITH_BOOSTERS)
def test_a_slip_at_boosters_is_named(tmp_path, slip):
    base, changes, text = WITH_BOOSTERS[slip]
    file = changed(tmp_path, {f"{BOOSTERS}.{key}": at for key, at in changes.items()}, base)
    (line,) = warnings(load_mission(file))
    assert line.startswith(f"stages[0].boosters[0].{text}"), line


@pytest.mark.parametrize("slip", [*SLIPS, *ABOVE_THE_AIR])
def test_a_slip_is_named_with_its_line(tmp_path, slip):
    changes, expected = (SLIPS | ABOVE_THE_AIR)[slip]
    file = changed(tmp_path, changes, TEMPLATE if slip in SLIPS else "electron_sso")
    said = warnings(load_mission(file))
    assert len(said) == len(expected), said
    for line, text in zip(said, expected, strict=True):
        assert line.startswith(text)
        assert "\n" not in line
    # the same with file and line, which is that of the key
    rows = file.read_text().splitlines()
    for line, text in zip(file_warnings(file), said, strict=True):
        where = line.removeprefix(f"{file}: line ").partition(":")[0]
        assert line.endswith(f": {text}")
        key = text.split()[0].rpartition(".")[2]
        assert rows[int(where) - 1].strip("- ").startswith(f"{key}:")


@pytest.mark.parametrize("inclination", [35.0, 98.0, 144.0])
def test_of_a_plane_through_the_pad_nothing_is_said(tmp_path, inclination):
    file = changed(tmp_path, {"target.inclination_deg": inclination})
    assert warnings(load_mission(file)) == []


def test_of_the_plane_of_an_air_launch_nothing_is_said(tmp_path):
    """The plane of a slow start in space is that of the Earth's rotation."""
    state = {"time_s": 0.0, "geodetic_latitude_deg": 32.9, "longitude_deg": -121.5}
    state |= {"altitude_m": 11700.0, "ground_speed_m_s": 235.0}
    state |= {"elevation_deg": 25.0, "ground_azimuth_deg": 180.0}
    changes = {"initial_state": state, "target.inclination_deg": 98.0}
    changes["stages.0.vertical_rise_s"] = ABSENT
    assert warnings(load_mission(changed(tmp_path, changes))) == []


def test_of_a_plane_that_is_turned_at_a_high_apogee_nothing_is_said(tmp_path):
    file = changed(tmp_path, {"target.inclination_deg": 3.0}, base="falcon9_gto_pad")
    assert warnings(load_mission(file)) == []


@pytest.mark.parametrize("knots", [[[10.0, 5.0, 0.0]], [[0.0, 5.0, 0.0], [150.0, 9.0, 0.0]]])
def test_of_a_wind_near_the_ground_nothing_is_said(tmp_path, knots):
    file = changed(tmp_path, {"environment.atmosphere.wind_table": knots})
    assert warnings(load_mission(file)) == []


def test_an_energy_in_km2_s2(tmp_path):
    target = {"c3_m2_s2": 12.5, "perigee_altitude_m": 185e3, "inclination_deg": 28.5}
    file = changed(tmp_path, {"target": target}, base="ares_v")
    assert warnings(load_mission(file)) == [
        "target.c3_m2_s2 is 12.5 m2/s2; is the number in km2/s2?"
    ]


def test_a_parking_orbit_in_km(tmp_path):
    orbit = {"perigee_altitude_m": 185.0, "apogee_altitude_m": 185.0}
    changes = {f"stages.0.arcs.2.{key}": value for key, value in orbit.items()}
    (line,) = warnings(load_mission(changed(tmp_path, changes, base="vulcan_gto")))
    assert line.startswith("stages[0].arcs[2].perigee_altitude_m is inside the air, 1.2e+00 kg/m3")


@pytest.mark.parametrize("key", ["min_altitude_m", "min_perigee_altitude_m"])
def test_a_floor_in_km(tmp_path, key):
    file = changed(tmp_path, {f"stages.0.arcs.2.{key}": 150.0}, base="vulcan_gto")
    (line,) = warnings(load_mission(file))
    assert line == f"stages[0].arcs[2].{key} is 150 m, inside the air; is it in m?"


def test_an_altitude_for_a_radius(tmp_path):
    data, _ = read_input(MISSION.find("vulcan_gto"), MISSION)
    target = {key: value for key, value in data["target"].items() if key != "apogee_altitude_m"}
    changes = {"target": {**target, "apogee_radius_m": 35_786e3}}
    (line,) = warnings(load_mission(changed(tmp_path, changes, base="vulcan_gto")))
    assert line.endswith("35,786,000 m, the altitude of the synchronous orbit, not its radius")


def test_a_cut_off_deep_in_the_air(tmp_path):
    low = {"target.radius_m": 6_448_000.0}
    (line,) = warnings(load_mission(changed(tmp_path, low, base="ares_v")))
    assert line.startswith("target.radius_m is inside the air")
    # where there is no air an orbit may be as low as the ground allows
    assert warnings(load_mission("apollo11_ascent")) == []


def test_an_altitude_in_km_where_there_is_no_air(tmp_path):
    target = {"perigee_altitude_m": 17.0, "apogee_altitude_m": 83e3}
    (line,) = warnings(load_mission(changed(tmp_path, {"target": target}, "apollo11_ascent")))
    assert line == "target.perigee_altitude_m is at 17 m; is it in m?"


@pytest.mark.parametrize("inclination", [2.0, 6.0])
def test_of_the_plane_of_a_high_orbit_from_near_the_equator_nothing_is_said(tmp_path, inclination):
    changes = {"target.inclination_deg": inclination}
    assert warnings(load_mission(changed(tmp_path, changes, "ariane5_eca_pad"))) == []


@pytest.mark.parametrize(("propellant_kg", "lines"), [(12000.0, 1), (10400.0, 0)])
def test_a_solid_stage_that_carries_more_than_its_table_takes(tmp_path, propellant_kg, lines):
    # 140 s of 225 kN at an Isp of 311 s take 10,328 kg
    changes = {f"stages.0.{key}": ABSENT for key in ("thrust_n", "burn_time_s")}
    changes["stages.0.thrust_table"] = [[0.0, 225e3], [140.0, 225e3]]
    changes["stages.0.propellant_kg"] = propellant_kg
    expected = "stages[0].propellant_kg is 12,000 kg, the thrust_table takes 10,328.3 kg; the rest"
    found = warnings(load_mission(changed(tmp_path, changes)))
    assert [line.startswith(expected) for line in found] == [True] * lines
