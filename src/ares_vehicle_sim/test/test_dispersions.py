"""Dispersions: off by default, seeded, one stream per quantity, clear about a bad file."""

import numpy as np
import pytest

from ares_models.arrays import NAVIGATION
from ares_models.mission import load_mission
from ares_vehicle_sim.dispersions import (
    Dispersions,
    DispersionsError,
    NavigationErrorModel,
    NavigationErrors,
    disperse,
    load_dispersions,
)
from ares_vehicle_sim.simulator import Simulator

EVERYTHING = Dispersions(
    initial_position_m=1000.0,
    initial_velocity_m_s=10.0,
    thrust=0.01,
    specific_impulse=0.005,
    stage_mass=0.01,
    jettison_mass=0.05,
    log_density=0.3,
    j2=1.0826e-3,
)


@pytest.fixture(scope="module")
def ares_v():
    return load_mission("ares_v")


def draw(mission, dispersions, seed=0):
    start = mission.start()
    return disperse(mission.arrays(), start.position, start.velocity, dispersions, seed)


def test_nothing_differs_by_default(ares_v):
    vehicle = draw(ares_v, Dispersions(), seed=5)
    nominal = ares_v.arrays()
    for name in ("environment", "arcs", "jettisons", "target"):
        assert getattr(vehicle.arrays, name).tobytes() == getattr(nominal, name).tobytes()
    assert vehicle.position == pytest.approx(ares_v.start().position, abs=0.0)


def test_the_same_seed_draws_the_same_vehicle(ares_v):
    one, two = draw(ares_v, EVERYTHING, 11), draw(ares_v, EVERYTHING, 11)
    other = draw(ares_v, EVERYTHING, 12)
    assert one.arrays.arcs.tobytes() == two.arrays.arcs.tobytes()
    assert one.position == pytest.approx(two.position, abs=0.0)
    assert one.arrays.arcs.tobytes() != other.arrays.arcs.tobytes()


def test_each_quantity_has_a_stream_of_its_own(ares_v):
    alone = draw(ares_v, Dispersions(thrust=0.01), 3)
    together = draw(ares_v, EVERYTHING, 3)
    assert alone.arrays.arcs["thrust"] == pytest.approx(together.arrays.arcs["thrust"], abs=0.0)
    assert alone.position == pytest.approx(ares_v.start().position, abs=0.0)


def test_engines_keep_thrust_flow_and_exhaust_velocity_consistent(ares_v):
    arcs = draw(ares_v, EVERYTHING, 4).arrays.arcs
    assert arcs["thrust"] == pytest.approx(arcs["mass_flow"] * arcs["exhaust_velocity"])


def test_sizes_are_one_sigma(ares_v):
    nominal = ares_v.arrays()
    vehicles = [draw(ares_v, EVERYTHING, seed) for seed in range(400)]

    def spread(values):
        return np.std(np.array(values), axis=0)

    thrust = spread([v.arrays.arcs["thrust"] / nominal.arcs["thrust"] for v in vehicles])
    assert thrust == pytest.approx([0.01, 0.01], rel=0.12)
    density = spread([np.log(v.arrays.environment["density_factor"]) for v in vehicles])
    assert density == pytest.approx([0.3], rel=0.12)
    position = spread([v.position for v in vehicles])
    assert position == pytest.approx([1000.0] * 3, rel=0.12)
    # the upper stack: 1 % of what it weighs without the fairing
    stack = spread([v.arrays.arcs["stack_mass"][1] for v in vehicles])
    assert stack == pytest.approx(0.01 * (307_837.0 - 5_837.0), rel=0.12)


def test_stage_masses_add_up_to_the_stack(ares_v):
    nominal = ares_v.arrays().arcs["stack_mass"]
    excess = draw(ares_v, Dispersions(stage_mass=0.01), 2).arrays.arcs["stack_mass"] - nominal
    core, upper = float(excess[0]), float(excess[1])
    assert upper != 0.0
    assert core != pytest.approx(upper)
    assert abs(core - upper) < 0.05 * (nominal[0] - nominal[1])


def test_navigation_errors_leave_the_truth_alone(ares_v):
    errors = NavigationErrors(position_bias_m=100.0, velocity_noise_m_s=1.0, heating_scale=0.1)
    clean = Simulator(ares_v)
    dirty = Simulator(ares_v, dispersions=Dispersions(navigation=errors), seed=1)
    assert dirty.plant["position"] == pytest.approx(clean.plant["position"], abs=0.0)
    assert dirty.navigation["position"] != pytest.approx(clean.navigation["position"], abs=1.0)
    bias = dirty.navigation["position"] - clean.navigation["position"]
    for simulator in (clean, dirty):
        simulator.advance()
    later = dirty.navigation["position"] - clean.navigation["position"]
    assert later == pytest.approx(bias, abs=1e-6)
    assert dirty.navigation["heating_rate"] != clean.navigation["heating_rate"]


def test_noise_has_its_size():
    model = NavigationErrorModel(NavigationErrors(velocity_noise_m_s=2.0), seed=0)
    drawn = []
    for _ in range(2000):
        nav = np.zeros(1, NAVIGATION)
        model.corrupt(nav)
        drawn.append(nav["velocity"][0].copy())
    assert np.std(drawn) == pytest.approx(2.0, rel=0.05)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("thrusts: 0.01", "thrusts: unknown key; expected one of initial_position_m,"),
        ("thrust: -0.01", "thrust: -0.01; input should be greater than or equal to 0"),
        ("thrust: .nan", "thrust: nan; input should be a finite number"),
        ("thrust: fast", "thrust: 'fast'; input should be a valid number"),
        ("thrust: 3", "thrust: 3; input should be less than or equal to 0.2"),
        ("navigation: {bias: 1}", "navigation.bias: unknown key; expected one of position_bias_m"),
        ("- thrust", "expected keys and values, found ['thrust']"),
        ("thrust: [", "line 2: not valid YAML"),
    ],
)
def test_a_wrong_file_is_told_in_one_line(tmp_path, text, complaint):
    file = tmp_path / "d.yaml"
    file.write_text(text + "\n")
    with pytest.raises(DispersionsError) as caught:
        load_dispersions(file)
    assert complaint in str(caught.value)
    assert str(file) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_missing_or_binary_file(tmp_path):
    with pytest.raises(DispersionsError, match="No such file"):
        load_dispersions(tmp_path / "none.yaml")
    (tmp_path / "b.yaml").write_bytes(bytes(range(128, 256)))
    with pytest.raises(DispersionsError, match="not a text file"):
        load_dispersions(tmp_path / "b.yaml")


def test_an_empty_file_disperses_nothing(tmp_path):
    (tmp_path / "e.yaml").write_text("# nothing\n")
    assert load_dispersions(tmp_path / "e.yaml") == Dispersions()
