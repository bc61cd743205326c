# SPDX-License-Identifier: Apache-2.0
"""Draws: a stream for each quantity, a place in it for each flight, and the drawn vehicles."""

import re
from importlib import resources

import numpy as np
import pytest

from ares_models.arrays import NAVIGATION, STEERING
from ares_models.kernels.environment import wind_component
from ares_models.mission import MISSION, load_mission, parse_mission
from ares_vehicle_sim.arrays import NAVIGATION_ERRORS
from ares_vehicle_sim.dispersions import (
    Dispersions,
    DispersionsError,
    NavigationErrors,
    load_dispersions,
)
from ares_vehicle_sim.draws import FIELDS, Sampler
from ares_vehicle_sim.kernels.navigation import POSITION_NOISE, corrupt, noise, philox
from ares_vehicle_sim.simulator import Simulator, SimulatorOptions, true_vehicle

NAVIGATION_DISPERSED = NavigationErrors(
    position_bias_m=50.0,
    position_noise_m=5.0,
    velocity_bias_m_s=[0.1, 0.2, {"mean": 0.3, "sigma": 0.0}],
    velocity_noise_m_s=0.1,
    sensed_delta_v_scale=1e-4,
    mass_scale=1e-3,
    heating_scale=0.05,
    heating_noise=0.02,
)
EVERYTHING = {
    "initial_position_m": 1000.0,
    "initial_velocity_m_s": 10.0,
    "thrust": 0.01,
    "specific_impulse": 0.005,
    "stage_mass": 0.01,
    "propellant": 0.001,
    "jettison_mass": 0.05,
    "jettison_limit": 0.1,
    "ballistic_coefficient": 0.2,
    "log_density": 0.3,
    "wind": {"table": [[0.0, 4.0, 4.0], [12e3, 30.0, 25.0]]},
    "gust": {
        "amplitude_m_s": 3.0,
        "altitude_m": {"low": 4e3, "high": 16e3},
        "length_m": {"low": 60.0, "high": 300.0},
        "azimuth_deg": {"low": 0.0, "high": 360.0},
    },
    "turbulence": {"table": [[0.0, 3.0, 2.0], [15e3, 1.0, 1.0]]},
    "start_delay_s": {"low": 0.0, "high": 0.5},
    "start_scale": 0.1,
    "latency_s": {"low": 0.05, "high": 0.2},
    "j2": 1.0826e-3,
    "navigation": NAVIGATION_DISPERSED,
}
MSIS = {
    "first_date": "2009-01-01",
    "last_date": "2020-01-01",
    "f107a": {"low": 70.0, "high": 220.0},
    "f107_deviation": 10.0,
    "ap": {"low": 2.0, "high": 40.0},
    "latitude_deg": 28.5,
    "longitude_deg": -60.0,
}


@pytest.fixture(scope="module")
def ares_v():
    return load_mission("ares_v")


@pytest.fixture(scope="module")
def windy():
    """Return a mission on its pad, in a wind."""
    text = MISSION.find("delta_iii_pad").read_text()
    knots = "[[0.0, 3.0, -2.0], [5000.0, 18.0, 4.0], [12000.0, 45.0, 5.0], [20000.0, 8.0, 0.0]]"
    height = "scale_height_m: 7200.0"
    return parse_mission(text.replace(height, f"{height}\n    wind_table: {knots}"), "windy.yaml")


def draw(mission, count=1, first=0, seed=0, **given):
    return Sampler(mission, Dispersions(**given), seed).draw(first, count)


@pytest.mark.parametrize("draws", ["random", "sobol"])
def test_a_flight_is_drawn_the_same_alone_and_among_many(ares_v, draws):
    given = {**EVERYTHING, "nrlmsis": MSIS, "draws": draws, "initial_frame": "local"}
    many = draw(ares_v, 300, **given)
    for k in (0, 1, 7, 299):
        alone = draw(ares_v, 1, k, **given)
        assert alone.inputs.tobytes() == many.inputs[k].tobytes()
        assert alone.variations.tobytes() == many.variations[k].tobytes()
        assert alone.atmospheres.tobytes() == many.atmospheres[k].tobytes()
    later = draw(ares_v, 100, 200, **given)
    assert later.variations.tobytes() == many.variations[200:].tobytes()


def test_a_sampler_may_go_back_and_ahead(ares_v):
    sampler = Sampler(ares_v, Dispersions(thrust=0.01, draws="sobol"), 0)
    late = sampler.draw(1000, 5).inputs
    early = sampler.draw(3, 2).inputs
    assert sampler.draw(1000, 5).inputs == pytest.approx(late, abs=0.0)
    assert Sampler(ares_v, Dispersions(thrust=0.01, draws="sobol"), 0).draw(
        4, 1
    ).inputs == pytest.approx(early[1:], abs=0.0)


@pytest.mark.parametrize("draws", ["random", "sobol"])
def test_each_quantity_has_a_stream_of_its_own(ares_v, draws):
    together = Sampler(ares_v, Dispersions(**EVERYTHING, draws=draws), 3)
    inputs = together.draw(0, 20).inputs
    for key in ("thrust", "log_density", "latency_s"):
        alone = Sampler(ares_v, Dispersions(**{key: EVERYTHING[key], "draws": draws}), 3)
        columns = [together.columns.index(column) for column in alone.columns]
        assert alone.draw(0, 20).inputs == pytest.approx(inputs[:, columns], abs=0.0)


@pytest.mark.trial
def test_seeds_and_columns_are_independent(ares_v):
    one, two, even = (
        draw(ares_v, 2000, seed=seed, **EVERYTHING, draws=draws).inputs
        for seed, draws in ((1, "random"), (2, "random"), (1, "sobol"))
    )
    # one bias has no spread
    free = np.flatnonzero(np.ptp(one, axis=0) > 0.0)
    assert len(free) == one.shape[1] - 1
    for columns in (np.concatenate([one[:, free], two[:, free]], axis=1), even[:, free]):
        found = np.corrcoef(columns.T)
        assert np.max(np.abs(found - np.eye(len(found)))) < 0.12


def test_values_have_their_distributions(ares_v):
    from scipy.stats import kstest

    sampler = Sampler(ares_v, Dispersions(**EVERYTHING), 0)
    inputs = dict(zip(sampler.columns, sampler.draw(0, 5000).inputs.T, strict=True))
    assert kstest(inputs["initial_position_m.y"] / 1000.0, "norm").pvalue > 1e-3
    assert kstest(inputs["thrust.upper_stage"] / 0.01, "norm").pvalue > 1e-3
    assert kstest(inputs["latency_s"], "uniform", (0.05, 0.15)).pvalue > 1e-3
    assert np.all(inputs["navigation.velocity_bias_m_s.z"] == 0.3)


def test_sobol_points_are_more_even(ares_v):
    from scipy.stats import qmc

    given = {"thrust": {"low": 0.0, "high": 1.0}, "log_density": {"low": 0.0, "high": 1.0}}
    for seed in range(3):
        even = draw(ares_v, 512, seed=seed, **given, draws="sobol").inputs
        chance = draw(ares_v, 512, seed=seed, **given).inputs
        assert qmc.discrepancy(even) < 0.2 * qmc.discrepancy(chance)


def test_every_quantity_of_the_file_has_its_place(ares_v):
    sampler = Sampler(ares_v, Dispersions(**EVERYTHING, nrlmsis=MSIS), 0)
    assert [n for n in FIELDS if not any(c.startswith(n) for c in sampler.columns)] == []


def test_lists_must_fit_the_mission(ares_v):
    with pytest.raises(
        DispersionsError,
        match="dispersions: thrust is a list of 3; expected 2: core, upper_stage",
    ):
        draw(ares_v, thrust=[0.01, 0.01, 0.01])


# ---- the initial state


def test_local_axes(ares_v):
    given = {"initial_position_m": [100.0, 0.0, 0.0], "initial_velocity_m_s": [0.0, 0.0, 1.0]}
    start = ares_v.start()
    draws = draw(ares_v, 50, initial_frame="local", **given)
    up = start.position / np.linalg.norm(start.position)
    across = np.cross(start.position, start.velocity)
    offsets = draws.variations["position"] @ up
    assert offsets == pytest.approx(draws.inputs[:, 0], abs=1e-9)
    assert np.linalg.norm(draws.variations["position"], axis=1) == pytest.approx(np.abs(offsets))
    along = draws.variations["velocity"] @ across / np.linalg.norm(across)
    assert along == pytest.approx(draws.inputs[:, 5], abs=1e-12)


def test_a_full_covariance(ares_v):
    rng = np.random.default_rng(0)
    mixing = rng.normal(size=(6, 6)) * np.array([300.0] * 3 + [3.0] * 3)[:, None]
    covariance = mixing @ mixing.T
    inputs = draw(ares_v, 20_000, initial_covariance=covariance.tolist()).inputs
    scale = np.sqrt(np.diag(covariance))
    found = np.cov(inputs.T) / np.outer(scale, scale)
    assert found == pytest.approx(covariance / np.outer(scale, scale), abs=0.03)


# ---- the true vehicle


def truth(mission, flight=0, **given):
    return true_vehicle(mission, SimulatorOptions(), Dispersions(**given), 4, flight)


def true_mission(mission, flight=0, **given):
    return truth(mission, flight, **given)[0]


def test_nothing_differs_by_default(ares_v):
    true, vehicle = truth(ares_v, 5)
    nominal = ares_v.arrays()
    for name in ("environment", "arcs", "jettisons", "target"):
        assert getattr(true, name).tobytes() == getattr(nominal, name).tobytes()
    assert vehicle.plant["position"][0] == pytest.approx(ares_v.start().position, abs=0.0)


def test_engines_keep_thrust_flow_and_exhaust_velocity_consistent(ares_v):
    arcs = true_mission(ares_v, **EVERYTHING).arcs
    nominal = ares_v.arrays().arcs
    assert arcs["thrust"] == pytest.approx(arcs["mass_flow"] * arcs["exhaust_velocity"])
    low = true_mission(ares_v, thrust=[0.0, {"mean": -0.15, "sigma": 0.0}]).arcs
    assert low["thrust"] == pytest.approx(nominal["thrust"] * [1.0, 0.85])


def test_a_drawn_wind_is_added_to_that_of_the_mission(windy):
    given = {"wind": {"table": EVERYTHING["wind"]["table"], "factor": [1.0, {"mean": 0.5}]}}
    sampler = Sampler(windy, Dispersions(**given), 4)
    east, north = sampler.draw(7, 1).inputs[0]
    assert sampler.columns == ("wind.factor.east", "wind.factor.north")
    assert abs(east) < 5.0
    assert north == 0.5
    own, true = windy.arrays().environment[0], true_mission(windy, 7, **given).environment[0]
    for height, one_sigma in ((0.0, (4.0, 4.0)), (12e3, (30.0, 25.0)), (60e3, (0.0, 0.0))):
        for axis, factor in ((0, east), (1, north)):
            mean, _ = wind_component(height, own["wind"], axis)
            found, _ = wind_component(height, true["wind"], axis)
            assert found == pytest.approx(mean + factor * one_sigma[axis], abs=1e-9)
    # what guidance believes is the mission's
    assert windy.arrays(foreseen=True).environment.tobytes() == own.tobytes()


def test_a_drawn_gust_blows_where_its_azimuth_says(windy):
    gust = {"amplitude_m_s": {"mean": 9.0}, "altitude_m": {"mean": 11e3}, "length_m": 1.0}
    given = {"gust": gust | {"azimuth_deg": {"mean": 150.0}}}
    own, true = windy.arrays().environment[0], true_mission(windy, 2, **given).environment[0]
    assert true["wind"]["gust_length"] >= 10.0
    for axis, share in ((0, 0.5), (1, -np.sqrt(0.75))):
        for away, part in ((0.0, 1.0), (1e3, 0.0)):
            mean, _ = wind_component(11e3 + away, own["wind"], axis)
            found, _ = wind_component(11e3 + away, true["wind"], axis)
            assert found - mean == pytest.approx(9.0 * share * part, abs=1e-9)


def test_turbulence_has_the_correlation_of_dryden(windy):
    """The horizontal wind along a climb: exp(-x / L) (1 - x / 2L)."""
    turbulence = {"table": [[0.0, 3.0, 2.0], [20e3, 3.0, 2.0]], "scale_m": 500.0}
    wind = draw(windy, 1500, turbulence=turbulence).variations["wind"]
    mean = windy.arrays().environment[0]["wind"]
    heights = (5e3, 5.25e3, 5.5e3, 6.5e3, 30e3)
    for axis, sigma in ((0, 3.0), (1, 2.0)):
        calm = [wind_component(h, mean, axis)[0] for h in heights]
        stirred = np.array([[wind_component(h, w, axis)[0] for h in heights] for w in wind]) - calm
        assert stirred[:, :4].std(axis=0) == pytest.approx(sigma, rel=0.08)
        found = np.corrcoef(stirred[:, :4].T)[0, 1:]
        x = np.array([0.5, 1.0, 3.0])
        assert found == pytest.approx(np.exp(-x) * (1.0 - 0.5 * x), abs=0.08)
        # it fades above the table
        assert 0.0 < stirred[:, 4].std() < 0.8 * sigma
    both = [[wind_component(5e3, w, axis)[0] for w in wind] for axis in (0, 1)]
    assert abs(np.corrcoef(both)[0, 1]) < 0.1


@pytest.mark.parametrize(
    "given",
    [
        # passed within a quarter of a second
        {
            "gust": {
                "amplitude_m_s": {"mean": 60.0},
                "altitude_m": {"mean": 8e3},
                "length_m": {"mean": 80.0},
            }
        },
        {"turbulence": {"table": [[0.0, 9.0, 9.0], [10e3, 9.0, 9.0]]}},
    ],
)
def test_the_greatest_loads_are_seen_by_long_steps_too(windy, given):
    given = Dispersions(**given)
    most = []
    for step, dispersions in ((1.0, given), (0.01, given), (1.0, None)):
        simulator = Simulator(windy, SimulatorOptions(1.0, step), dispersions)
        steering = np.zeros(1, STEERING)
        steering["cutoff_time"] = np.nan
        steering["arc_end_times"] = np.nan
        steering["jettison"] = -1
        up = simulator.plant["position"] / np.linalg.norm(simulator.plant["position"])
        steering["direction"] = up
        while simulator.plant["altitude"] < 12e3:
            simulator.command(steering)
            simulator.advance()
        most.append(float(simulator.plant["most_q_alpha"]))
    assert most[0] == pytest.approx(most[1], rel=0.02)
    assert most[0] > 1.1 * most[2]


def test_masses_add_up_to_the_stack(ares_v):
    nominal = ares_v.arrays()
    given = {"stage_mass": 0.01, "jettison_mass": 0.05, "propellant": 0.002}
    sampler = Sampler(ares_v, Dispersions(**given), 4)
    for flight in range(3):
        inputs = dict(zip(sampler.columns, sampler.draw(flight, 1).inputs[0], strict=True))
        arrays = true_mission(ares_v, flight, **given)
        fairing = inputs["jettison_mass.payload_fairing"] * nominal.jettisons["mass"][0]
        assert arrays.jettisons["mass"][0] - nominal.jettisons["mass"][0] == pytest.approx(fairing)
        propellant = arrays.arcs["propellant"] - nominal.arcs["propellant"]
        stacks = nominal.arcs["stack_mass"]
        upper = inputs["stage_mass.upper_stage"] * (stacks[1] - nominal.jettisons["mass"][0])
        upper += fairing + propellant[1]
        core = inputs["stage_mass.core"] * (stacks[0] - stacks[1]) + propellant[0]
        excess = arrays.arcs["stack_mass"] - stacks
        assert excess == pytest.approx([core + upper, upper], rel=1e-9)


def test_a_late_and_slow_start(ares_v):
    given = {"start_delay_s": {"mean": 0.7, "sigma": 0.0}, "start_scale": {"mean": 0.5}}
    upper = true_mission(ares_v, **given).arcs[1]
    # no thrust for 0.7 s, then all of it; the core burns from before the flight
    assert true_mission(ares_v, **given).arcs["start_knots"][0] == 0
    assert upper["start_knots"] == 2
    assert upper["start_time"][:2] == pytest.approx([0.7, 0.7])
    assert upper["start_fraction"][:2] == pytest.approx([0.0, 1.0])
    saturn = load_mission("saturn_v_as506")
    nominal = saturn.arrays().arcs
    late = true_mission(saturn, **given).arcs
    k = int(np.flatnonzero(nominal["start_knots"])[-1])
    knots = int(nominal["start_knots"][k])
    assert nominal["start_fraction"][k, 0] == 0.0
    assert late["start_time"][k, :knots] == pytest.approx(
        0.7 + 1.5 * nominal["start_time"][k, :knots]
    )


def test_a_solid_motor_that_burns_late_and_slowly(tmp_path):
    text = ares_v_text().replace("engines: 5 ", "#").replace("burn_time_s: 181.25", "#")
    table = "thrust_table: [[0, 0], [1, 1.7e7], [100, 1.2e7], [180, 0]]  #"
    path = tmp_path / "solid.yaml"
    path.write_text(text.replace("thrust_n: 17437041.0", table))
    mission = load_mission(path)
    given = {"start_delay_s": {"mean": 0.7, "sigma": 0.0}, "start_scale": {"mean": 0.25}}
    nominal, late = mission.arrays().arcs[0], true_mission(mission, **given).arcs[0]
    assert late["duration"] == pytest.approx(0.7 + 1.25 * 180.0)
    assert late["start_time"][:4] == pytest.approx(0.7 + 1.25 * nominal["start_time"][:4])
    # less thrust for longer: the impulse and the propellant stay
    for size, curve in (("thrust", "start_fraction"), ("mass_flow", "start_flow")):
        areas = [
            arc[size] * np.trapezoid(arc[curve][:4], arc["start_time"][:4])
            for arc in (nominal, late)
        ]
        assert areas[1] == pytest.approx(areas[0], rel=1e-12)


def ares_v_text():
    return resources.files("ares_models").joinpath("missions", "ares_v.yaml").read_text()


def test_the_true_limit_and_atmosphere(ares_v):
    arrays = true_mission(
        ares_v, jettison_limit={"mean": -0.1, "sigma": 0.0}, log_density={"mean": 0.5}
    )
    assert arrays.jettisons["value"][0] == pytest.approx(0.9 * 1135.0)
    assert arrays.environment["density_factor"][0] == pytest.approx(np.exp(0.5))
    assert np.ptp([true_mission(ares_v, k, nrlmsis=MSIS).atmosphere[60, 1] for k in range(4)]) > 0


# ---- navigation


def test_noise_is_that_of_numpy():
    key, counter = (12345, int(POSITION_NOISE)), (99, 7, 0, 0)
    # NumPy counts up before it answers
    words = np.random.Philox(key=np.array(key, np.uint64), counter=[98, 7, 0, 0]).random_raw(4)
    found = philox(*(np.uint64(x) for x in key), tuple(np.uint64(x) for x in counter))
    assert list(found) == words.tolist()


def test_noise_is_normal_and_new_at_every_state():
    from scipy.stats import kstest

    errors = np.zeros(1, NAVIGATION_ERRORS)
    drawn = []
    for flight in range(2):
        errors["flight"] = flight
        drawn += [noise(errors[0], POSITION_NOISE, np.uint64(k)) for k in range(2000)]
    numbers = np.array(drawn)
    assert kstest(numbers.ravel(), "norm").pvalue > 1e-3
    halves = [numbers[:2000].ravel(), numbers[2000:].ravel()]
    assert abs(np.corrcoef(*halves)[0, 1]) < 0.05
    assert np.abs(np.corrcoef(numbers.T) - np.eye(3)).max() < 0.05


def test_reported_state_has_the_errors_of_its_flight():
    errors = np.zeros(1, NAVIGATION_ERRORS)
    errors["position_bias"] = [1.0, 2.0, 3.0]
    errors["sensed_delta_v_scale"] = [0.1, 0.0, -0.1]
    errors["mass_scale"] = 0.01
    errors["heating_scale"] = -0.5
    nav = np.zeros(1, NAVIGATION)
    nav["sensed_delta_v"] = 10.0
    nav["mass"] = 100.0
    nav["heating_rate"] = 1000.0
    corrupt(errors[0], np.uint64(0), nav[0])
    assert nav["position"][0] == pytest.approx([1.0, 2.0, 3.0])
    assert nav["velocity"][0] == pytest.approx([0.0] * 3, abs=0.0)
    assert nav["sensed_delta_v"][0] == pytest.approx([11.0, 10.0, 9.0])
    assert (nav["mass"][0], nav["heating_rate"][0]) == pytest.approx((101.0, 500.0))


def test_navigation_errors_leave_the_truth_alone(ares_v):
    clean = Simulator(ares_v)
    dirty = Simulator(
        ares_v,
        dispersions=Dispersions(
            navigation={"position_bias_m": 100.0, "velocity_noise_m_s": 1.0, "heating_scale": 0.1}
        ),
        seed=1,
    )
    assert dirty.plant["position"] == pytest.approx(clean.plant["position"], abs=0.0)
    bias = dirty.navigation["position"] - clean.navigation["position"]
    assert np.all(np.abs(bias) > 0.1)
    for simulator in (clean, dirty):
        simulator.advance()
    later = dirty.navigation["position"] - clean.navigation["position"]
    assert later == pytest.approx(bias, abs=1e-6)
    assert dirty.navigation["heating_rate"] != clean.navigation["heating_rate"]


def test_the_standard_file_draws_what_it_says(ares_v):
    sampler = Sampler(ares_v, load_dispersions("standard"), 0)
    spread = dict(zip(sampler.columns, np.std(sampler.draw(0, 4000).inputs, axis=0), strict=True))
    assert spread == pytest.approx(
        {
            **{f"initial_position_m.{axis}": 1000.0 for axis in "xyz"},
            **{f"initial_velocity_m_s.{axis}": 10.0 for axis in "xyz"},
            "log_density": 0.3,
            **{f"thrust.{stage}": 0.01 for stage in ("core", "upper_stage")},
            **{f"specific_impulse.{stage}": 0.005 for stage in ("core", "upper_stage")},
        },
        rel=0.05,
    )


def test_without_scipy_nothing_is_drawn_and_a_plain_flight_is_flown(monkeypatch):
    monkeypatch.setattr("ares_vehicle_sim.draws.find_spec", lambda _name: None)
    mission = load_mission("ares_v")
    assert Sampler(mission, Dispersions(), seed=1).columns == ()
    with pytest.raises(DispersionsError, match="need the Python package scipy, which is not"):
        Sampler(mission, Dispersions(thrust=0.01), seed=1)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"initial_position_m": 1.0}, "initial_position_m is given; expected none"),
        ({"initial_velocity_m_s": [0, 0, 1]}, "initial_velocity_m_s is given; expected none"),
        ({"initial_covariance": np.eye(6).tolist()}, "initial_covariance is given; expected none"),
    ],
)
def test_what_moves_a_vehicle_on_its_pad_is_refused(given, said):
    dispersions = Dispersions.model_validate(given)
    with pytest.raises(DispersionsError, match=f"{said}, the mission starts at rest on the pad"):
        Sampler(load_mission("delta_iii_pad"), dispersions, 0)
    Sampler(load_mission("delta_iii"), dispersions, 0)


def test_a_first_ignition_on_the_pad_is_not_delayed(tmp_path):
    text = MISSION.find("falcon9_leo_pad").read_text().replace("    vertical_rise_s: 8.0\n", "")
    curve = "thrust_n: 8227000.0\n    start: [[0.0, 0.9], [1.0, 1.0]]"
    path = tmp_path / "started.yaml"
    path.write_text(re.sub(r"thrust_n: \S+", curve, text, count=1))
    mission = load_mission(path)
    with pytest.raises(DispersionsError, match=r"start_delay_s is 0\.1 for .*; expected 0, the"):
        Sampler(mission, Dispersions(start_delay_s=0.1), 0)
    Sampler(mission, Dispersions(start_delay_s=[0.0, 0.1]), 0)
