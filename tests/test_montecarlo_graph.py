# SPDX-License-Identifier: Apache-2.0
"""Flight k of a campaign, repeated alone: through the graph it is the same flight."""

import json

import numpy as np
import pytest
import yaml

from ares_bringup.commands.cli import main
from ares_guidance.node import GuidanceNode
from ares_models.mission import load_mission
from ares_msgs.msg import FlightEvent
from ares_studies.montecarlo.flights import FlightRange, Settings
from ares_vehicle_sim.dispersions import STANDARD, load_dispersions
from ares_vehicle_sim.node import VehicleSimNode
from ares_vehicle_sim.simulator import CAMPAIGN

SEED = 11
FLIGHTS = {STANDARD: 4321, "everything": 17, "sobol": 70_000}

EVERYTHING = {
    "initial_frame": "local",
    "initial_covariance": (np.diag([1e6] * 3 + [100.0] * 3) + 20.0).tolist(),
    "thrust": [0.01, {"low": -0.02, "high": 0.02}],
    "specific_impulse": 0.005,
    "stage_mass": 0.002,
    "propellant": 0.001,
    "jettison_mass": 0.02,
    "jettison_limit": 0.05,
    "log_density": 0.2,
    "wind": {"table": [[0.0, 5.0, 5.0], [60e3, 40.0, 40.0]]},
    "gust": {"amplitude_m_s": 5.0, "altitude_m": {"mean": 50e3}, "length_m": {"mean": 300.0}},
    "nrlmsis": {
        "first_date": "2009-01-01",
        "last_date": "2020-01-01",
        "f107a": {"low": 70, "high": 220},
        "ap": 4.0,
        "latitude_deg": 28.5,
        "longitude_deg": -60.0,
    },
    "start_delay_s": {"low": 0.0, "high": 1.0},
    "start_scale": 0.1,
    "latency_s": {"low": 0.02, "high": 0.2},
    "j2": 1.0826e-3,
    "navigation": {
        "position_bias_m": 20.0,
        "position_noise_m": 5.0,
        "velocity_bias_m_s": 0.05,
        "velocity_noise_m_s": 0.05,
        "sensed_delta_v_scale": 1e-4,
        "mass_scale": 1e-4,
        "heating_scale": 0.02,
        "heating_noise": 0.01,
    },
}


@pytest.fixture
def files(tmp_path):
    """Return dispersions by content: a shipped name, and paths."""
    even = {"draws": "sobol", "initial_position_m": 1000.0, "thrust": 0.01, "log_density": 0.3}
    paths = {STANDARD: STANDARD}
    for name, content in (("everything", EVERYTHING), ("sobol", even)):
        path = tmp_path / f"{name}.yaml"
        path.write_text(yaml.safe_dump(content))
        paths[name] = str(path)
    return paths


@pytest.mark.parametrize(
    ("name", "law"),
    # each of the dispersions, each of the laws
    [
        *((name, "peg") for name in FLIGHTS if name != STANDARD),
        *((STANDARD, law) for law in ("optimal", "igm")),
        pytest.param(STANDARD, "peg", marks=pytest.mark.trial),
    ],
)
def test_flight_k_of_a_campaign_is_flight_k_of_the_graph(graph, files, name, law):
    mission = load_mission("ares_v")
    flight = FLIGHTS[name]
    flyer = FlightRange(Settings(mission, load_dispersions(files[name]), SEED, law))
    result = flyer.fly(flight, 1).results[0]
    graph.start(
        VehicleSimNode,
        seed=SEED,
        flight=flight,
        dispersions=files[name],
        navigation_period_s=CAMPAIGN.navigation_period_s,
        integration_step_s=CAMPAIGN.integration_step_s,
        command_timeout_s=60.0,
    )
    graph.start(GuidanceNode, law=law)
    graph.spin(lambda: any(e.type == FlightEvent.FLIGHT_COMPLETE for e in graph.events))
    flown = {event.type: event for event in graph.events}
    end, drop = flown[FlightEvent.FLIGHT_COMPLETE], flown[FlightEvent.JETTISON]
    assert end.time == pytest.approx(result["end_time"], rel=1e-9)
    assert end.mass == pytest.approx(result["mass"], rel=1e-9)
    assert drop.time == pytest.approx(result["jettison_time"], rel=1e-9)
    assert drop.heating_rate == pytest.approx(result["jettison_heating"], rel=1e-9)
    target = mission.arrays().target[0]
    radius, speed = np.linalg.norm(end.position), np.linalg.norm(end.velocity)
    assert radius == pytest.approx(target["radius"] + result["radius_error"], rel=1e-9)
    assert speed == pytest.approx(target["speed"] + result["speed_error"], rel=1e-9)
    # and it is this flight, not its neighbour
    assert end.mass != pytest.approx(flyer.fly(flight + 1, 1).results["mass"][0], rel=1e-9)


def test_the_commands_that_fly_it_again(files, ros_domain, capfd):
    given = ["--dispersions", files["everything"], "--seed", str(SEED), "--json"]
    assert main(["montecarlo", "--only", "17", *given]) == 0
    alone = json.loads(capfd.readouterr().out)["flights"][0]
    argv = ["fly", "--mission", "ares_v", "--flight", "17", "--in-process", "--no-record"]
    argv += ["--domain-id", str(ros_domain)]
    main([*argv, *given])
    flown = json.loads(capfd.readouterr().out)
    for key in ("m_f_kg", "t_plf_s", "t_meco_s"):
        assert flown[key] == pytest.approx(alone[key], rel=1e-9), key


def test_a_wrong_place_on_the_pad_leaves_the_plan_as_it_is(tmp_path, ros_domain, capfd):
    path = tmp_path / "low.yaml"
    low = {"navigation": {"position_bias_m": {"mean": -300.0}}, "thrust": 0.002}
    path.write_text(yaml.safe_dump(low))
    mission = load_mission("delta_iii_pad")
    result = FlightRange(Settings(mission, load_dispersions(str(path), mission))).fly(3, 1).results
    argv = ["fly", "--mission", "delta_iii_pad", "--dispersions", str(path), "--flight", "3"]
    main([*argv, "--in-process", "--no-record", "--json", "--domain-id", str(ros_domain)])
    flown = json.loads(capfd.readouterr().out)
    assert flown["m_f_kg"] == pytest.approx(result["mass"][0], rel=1e-6)
    assert flown["planned_m_f_kg"] == pytest.approx(7529.712, abs=0.001)
