# SPDX-License-Identifier: Apache-2.0
"""Missions: content of the shipped ones, and their arrays."""

import math
import pickle
import sys

import numpy as np
import pytest
import yaml

from ares_models import arrays as layout
from ares_models.input_file import read_input
from ares_models.mission import MISSION, Mission, MissionError, list_missions, load_mission
from ares_models.orbits import Insertion


def shipped_text(name):
    from importlib import resources

    return resources.files("ares_models").joinpath("missions", f"{name}.yaml").read_text()


def variant(tmp_path, change, name="ares_v"):
    """Write a shipped mission with changed plain data as a file."""
    source = tmp_path / "source.yaml"
    source.write_text(shipped_text(name))
    data, _ = read_input(source, MISSION)
    change(data)
    path = tmp_path / "changed.yaml"
    path.write_text(yaml.safe_dump(data))
    return path


def test_shipped_missions():
    assert list_missions() == (
        "apollo11_ascent",
        "ares_v",
        "ares_v_transients",
        "ariane5_eca",
        "ariane5_eca_pad",
        "delta_iii",
        "delta_iii_coast",
        "delta_iii_pad",
        "electron_sso",
        "electron_sso_pad",
        "falcon9_gto",
        "falcon9_gto_pad",
        "falcon9_iss_pad",
        "falcon9_leo_pad",
        "geostationary_burn",
        "geostationary_transfer",
        "saturn_v_as506",
        "saturn_v_as506_flown",
        "saturn_v_as506_pad",
        "saturn_v_tli",
        "soyuz_fregat",
        "soyuz_sso_pad",
        "space_shuttle_sts121",
        "vulcan_gto",
    )
    for name in list_missions():
        mission = load_mission(name)
        assert mission.name == name
        row = mission.describe()
        assert row["name"] == name
        assert row["stages"].count(" kg") == len(mission.stages)
        assert all(row[key] for key in ("title", "stages", "jettisons", "target", "source"))
        assert not any("\n" in text for text in row.values())


def test_ares_v_arrays():
    arrays = load_mission("ares_v").arrays()
    environment = arrays.environment[0]
    assert environment["mu"] == 3.986e14
    assert environment["g0"] == 9.80665
    assert environment["equatorial_radius"] == 6378140.0
    assert environment["polar_radius"] == 6356750.0
    assert environment["rotation_rate"] == 7.2921159e-5
    assert environment["j2"] == 0.0
    assert environment["density_factor"] == 1.0
    assert environment["altitude_model"] == layout.ALTITUDE_ELLIPSOID

    core, upper = arrays.arcs
    assert core["kind"] == upper["kind"] == layout.BURN
    assert (core["stage"], upper["stage"]) == (0, 1)
    assert core["begins_stage"] == upper["begins_stage"] == 1
    assert core["mass_flow"] == pytest.approx(4287.64, abs=5e-3)
    assert upper["mass_flow"] == pytest.approx(297.417, abs=5e-4)
    assert core["exhaust_velocity"] == pytest.approx(9.80665 * 414.7, rel=1e-15)
    assert core["duration"] == 181.25
    assert math.isinf(upper["duration"])
    assert core["stack_mass"] == 1227734.0
    assert upper["stack_mass"] == 307837.0
    burnout = core["stack_mass"] - core["mass_flow"] * core["duration"]
    assert burnout == pytest.approx(450600.0, abs=1.0)
    assert core["propellant"] == pytest.approx(core["stack_mass"] - burnout, rel=1e-12)
    assert upper["propellant"] == pytest.approx(0.95 * (307837.0 - 5837.0))
    # mass of the dropped core, and the thesis' final mass after 432.30 s
    assert burnout - 307837.0 == pytest.approx(142763.0, abs=1.0)
    assert 307837.0 - 5837.0 - upper["mass_flow"] * 432.30 == pytest.approx(173427.0, abs=1.0)
    for key in ("start_knots", "tail_knots", "start_loss", "tail_gain"):
        assert not np.any(arrays.arcs[key])

    (fairing,) = arrays.jettisons
    assert fairing["mass"] == 5837.0
    assert fairing["criterion"] == layout.HEATING_LIMIT
    assert fairing["value"] == 1135.0
    assert fairing["stage"] == 1

    target = arrays.target[0]
    assert target["kind"] == layout.TARGET_RADIUS_SPEED_ANGLE_INCLINATION
    assert target["radius"] == 6518889.0
    assert target["speed"] == 7840.675
    assert math.degrees(target["flight_path_angle"]) == pytest.approx(1.0064, rel=1e-14)
    assert math.degrees(target["inclination"]) == pytest.approx(28.5, rel=1e-14)
    assert arrays.atmosphere.shape[1] == 9


def test_ares_v_start():
    start = load_mission("ares_v").start()
    assert start.time_s == 155.9
    assert start.mass_kg == 1227734.0
    state = Insertion.from_state(start.position, start.velocity)
    assert state.radius == pytest.approx(6415383.7, abs=0.05)
    assert state.speed == pytest.approx(1896.4405, abs=1e-4)


def test_arrays_are_fresh():
    mission = load_mission("ares_v")
    first = mission.arrays()
    first.atmosphere[:] = 0.0
    first.arcs["thrust"] = 0.0
    second = mission.arrays()
    assert np.all(second.atmosphere[1:, 0] > 0.0)
    assert np.all(second.arcs["thrust"] > 0.0)


def test_delta_iii_closes():
    mission = load_mission("delta_iii")
    (arc,) = mission.arrays().arcs
    assert arc["mass_flow"] * 700.0 == pytest.approx(16820.0, rel=1e-4)
    # the published optimum: time and mass agree
    assert 23464.0 - arc["mass_flow"] * (924.139 - 261.0) == pytest.approx(7529.712, abs=0.02)
    target = mission.arrays().target[0]
    assert target["kind"] == layout.TARGET_KEPLERIAN
    assert target["semi_major_axis"] == 24361140.0
    assert math.degrees(target["argument_of_perigee"]) == pytest.approx(130.5)


def test_saturn_v_closes():
    mission = load_mission("saturn_v_as506")
    arcs = mission.arrays().arcs
    assert list(arcs["kind"]) == [0, 1, 1, 1, 0, 0, 1]
    assert list(arcs["stage"]) == [0, 0, 0, 0, 0, 1, 1]
    assert list(arcs["begins_stage"]) == [1, 0, 0, 0, 0, 1, 0]
    # flown: cut-off at 548.22 s, separation at 549.0 s, ignition at 549.2 s
    ends = 162.30 + np.cumsum(arcs["duration"])
    assert ends[:5] == pytest.approx([163.0, 460.62, 498.0, 548.22, 549.0], abs=1e-9)
    assert mission.ignition_times() == pytest.approx((163.0, 549.2))
    # flown: about 439,000 kg
    assert mission.propellant(0) == pytest.approx(439000.0, rel=2e-3)
    assert arcs["start_loss"] == pytest.approx([0.0, 2.7, 0.0, 0.0, 0.0, 0.0, 4.8])
    assert arcs["tail_gain"] == pytest.approx([0.0, 0.0, 0.0, 0.255, 0.0, 0.0, 0.2555])
    parts = (479964, 3982, 609, 3663, 119119, 1939, 49735)
    assert mission.start().mass_kg == sum(parts)
    assert arcs["stack_mass"][-1] == 119119 + 1939 + 49735 - 4042
    assert [j["criterion"] for j in mission.arrays().jettisons] == [layout.MISSION_TIME] * 3
    assert mission.arrays().target[0]["kind"] == layout.TARGET_RADIUS_SPEED_ANGLE_PLANE
    # the plane of the target passes near the place of separation
    start = mission.start()
    normal = np.array(
        [
            math.sin(math.radians(32.531)) * math.sin(math.radians(303.1)),
            -math.sin(math.radians(32.531)) * math.cos(math.radians(303.1)),
            math.cos(math.radians(32.531)),
        ]
    )
    assert abs(start.position @ normal) < 20e3


def test_names_follow_the_arcs():
    mission = load_mission("saturn_v_as506")
    assert len(mission.arc_names) == len(mission.arrays().arcs)
    assert mission.arc_names[1] == "five engines"
    assert load_mission("ares_v").arc_names == ("core", "upper stage")
    assert mission.jettison_names[2] == "launch escape system"


def test_jettison_after_ignition(tmp_path):
    def change(data):
        data["jettisons"][0] = {
            "name": "ring",
            "mass_kg": 10.0,
            "stage": "core",
            "time_after_ignition_s": 30,
        }

    (ring,) = load_mission(variant(tmp_path, change)).arrays().jettisons
    assert ring["criterion"] == layout.TIME_AFTER_IGNITION
    assert ring["value"] == 30.0
    assert ring["stage"] == 0


def test_heating_limit_of_the_jettison_or_from_it_on(tmp_path):
    def change(data):
        data["jettisons"][0]["heating_limit_holds"] = "from_jettison"

    assert load_mission("ares_v").heating_limit_holds == "at_jettison"
    assert load_mission("delta_iii").heating_limit_holds == "at_jettison"
    held = load_mission(variant(tmp_path, change))
    assert held.heating_limit_holds == "from_jettison"
    # the kernels of guidance and plant know nothing of it
    assert np.array_equal(held.arrays().jettisons, load_mission("ares_v").arrays().jettisons)


def test_curves_and_their_areas(tmp_path):
    def change(data):
        data["stages"][1]["start"] = [[0, 0], [1.0, 0], [3.2, 1]]
        data["stages"][1]["tail_off"] = [[0, 1], [0.25, 0.174], [1.5, 0]]

    upper = load_mission(variant(tmp_path, change)).arrays().arcs[1]
    assert upper["start_knots"] == 3
    assert list(upper["start_time"][:3]) == [0.0, 1.0, 3.2]
    assert list(upper["start_fraction"][:3]) == [0.0, 0.0, 1.0]
    assert upper["start_loss"] == pytest.approx(2.1)
    assert upper["tail_gain"] == pytest.approx(0.2555)


def test_a_table_and_what_follows_from_it(tmp_path):
    thrust = [[0, 0], [0.5, 1.4e7], [60, 1.6e7], [60, 1.2e7], [150, 2e6], [160, 0]]
    flow = [[0, 0], [2.0, 5200], [60, 5600], [160, 0]]

    def change(data):
        for key in ("thrust_n", "isp_s", "engines", "burn_time_s"):
            del data["stages"][0][key]
        data["stages"][0] |= {"thrust_table": thrust, "mass_flow_table": flow}

    mission = load_mission(variant(tmp_path, change))
    core = mission.arrays().arcs[0]
    knots = core["start_knots"]
    assert (core["tabled"], core["duration"], knots) == (1, 160.0, 7)
    assert core["thrust"] == 1.6e7
    # the area of each table by itself, against the tables on their common knots
    impulse = np.trapezoid([f for _, f in thrust], [t for t, _ in thrust])
    taken = np.trapezoid([f for _, f in flow], [t for t, _ in flow])
    times = core["start_time"][:knots]
    area = np.trapezoid(core["start_fraction"][:knots], times)
    assert core["thrust"] * area == pytest.approx(impulse, rel=1e-14)
    burnt = core["mass_flow"] * np.trapezoid(core["start_flow"][:knots], times)
    assert burnt == pytest.approx(taken, rel=1e-14)
    assert core["exhaust_velocity"] == pytest.approx(impulse / taken, rel=1e-14)
    assert core["propellant"] == mission.fixed_propellant(0) == pytest.approx(taken, rel=1e-14)


def test_nrlmsis_mission(tmp_path, monkeypatch):
    def change(data):
        data["epoch"] = "2010-06-21T12:00:00+02:00"
        data["environment"]["atmosphere"] = {
            "model": "nrlmsis",
            "f107": 150,
            "f107a": 150,
            "ap": 4,
            "latitude_deg": 28.5,
            "longitude_deg": -80.6,
            "density_factor": 1.1,
        }

    mission = load_mission(variant(tmp_path, change))
    assert mission.epoch.hour == 10
    assert mission.arrays().environment[0]["density_factor"] == 1.1
    assert math.exp(mission.arrays().atmosphere[120, 1]) == pytest.approx(1.5e-8, rel=0.2)

    from ares_models import atmosphere

    atmosphere.nrlmsis.cache_clear()
    monkeypatch.setitem(sys.modules, "pymsis", None)
    with pytest.raises(MissionError, match=r"mission ares_v: .* pymsis, which is not installed"):
        mission.arrays()


def test_a_mission_from_plain_data_is_checked_too():
    with pytest.raises(ValueError, match="title"):
        Mission.model_validate({"name": "x"})


def test_mission_error_survives_a_process_border():
    error = MissionError("x.yaml", ["first", "second"])
    again = pickle.loads(pickle.dumps(error))
    assert str(again) == "x.yaml: first; also second"
    assert again.problems == ("first", "second")
