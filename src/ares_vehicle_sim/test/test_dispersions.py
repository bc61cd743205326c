# SPDX-License-Identifier: Apache-2.0
"""The dispersions file: valid content, and one clear line for wrong content."""

import math

import numpy as np
import pytest

from ares_models.mission import load_mission
from ares_vehicle_sim.dispersions import (
    DISPERSIONS,
    Dispersions,
    DispersionsError,
    NavigationErrors,
    Spread,
    load_dispersions,
)

COVARIANCE = """
initial_covariance:
  - [1.0e6, 0, 0, 0, 0, 0]
  - [0, 1.0e6, 0, 0, 0, 0]
  - [0, 0, 1.0e6, 0, 0, 0]
  - [0, 0, 0, 100.0, 0, 0]
  - [0, 0, 0, 0, 100.0, {}]
  - [0, 0, 0, 0, {}, 100.0]
"""
MSIS = (
    "nrlmsis: {{first_date: 2010-01-01, last_date: {}, f107a: {{low: 70, high: 200}}, "
    "ap: {}, latitude_deg: 28, longitude_deg: -80}}"
)


def complaint(tmp_path, text):
    file = tmp_path / "d.yaml"
    file.write_text(text + "\n")
    with pytest.raises(DispersionsError) as caught:
        load_dispersions(file)
    message = str(caught.value)
    assert message.startswith(f"{file}: ")
    assert "\n" not in message
    return message.removeprefix(f"{file}: ")


ONE_SIGMA = "one sigma, or a mapping with mean and sigma or low and high"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("thrusts: 0.01", "line 1: thrusts is not a known key (its value is 0.01); did you mean"),
        ("thrust: -0.01", "line 1: thrust is -0.01; expected a number of 0 to 0.2"),
        ("thrust: .nan", "line 1: thrust is nan; expected a number of 0 to 0.2"),
        ("thrust: fast", f"line 1: thrust is 'fast'; expected {ONE_SIGMA}"),
        ("thrust: true", f"line 1: thrust is true; expected {ONE_SIGMA}"),
        ("thrust: []", f"line 1: thrust is an empty list; expected {ONE_SIGMA}"),
        ("thrust: 3", "line 1: thrust is 3; expected a number of 0 to 0.2"),
        ("thrust:\n  - 0.01\n  - 7", "line 3: thrust[1] is 7; expected a number of 0 to 0.2"),
        ("thrust: {mean: 3}", "line 1: thrust.mean is 3; expected a number of -1 to 1"),
        ("thrust: {sigma: -1}", "line 1: thrust.sigma is -1; expected a number of 0 to 1"),
        ("thrust: {low: 0.1, high: 0}", "line 1: thrust.high is 0.0; expected at least low, 0.1"),
        ("thrust: {low: 0, hi: 1}", "line 1: thrust is 'low, hi'; expected mean and sigma, or low"),
        ("latency_s: [1, 2]", f"line 1: latency_s is a list of 2; expected {ONE_SIGMA}"),
        ("latency_s: {low: -1, high: 1}", "line 1: latency_s.low is -1; expected a number of 0 to"),
        ("initial_position_m: [1, 2]", "line 1: initial_position_m is a list of 2; expected a lis"),
        (
            "initial_position_m: -1",
            "line 1: initial_position_m is -1; expected a number of 0 to 1e6",
        ),
        ("initial_covariance: 3", "line 1: initial_covariance is 3; expected a list"),
        (COVARIANCE.format(5, 6), "line 2: initial_covariance is 'not symmetric'; expected a symm"),
        (COVARIANCE.format(200, 200), "line 2: initial_covariance is 'not positive definite'; exp"),
        (
            "initial_position_m: 3" + COVARIANCE.format(0, 0),
            "line 1: initial_position_m is 'a value'; expected no such key beside initial_covari",
        ),
        ("navigation: {bias: 1}", "line 1: navigation.bias is not a known key (its value is 1); d"),
        (
            "navigation: {heating_noise: 3}",
            "line 1: navigation.heating_noise is 3; expected a number from 0 to 0.2",
        ),
        (
            "wind: {table: [[0, 1, 1], [0, 2, 2]]}",
            "line 1: wind.table[1][0] is 0.0; expected an altitude of at least 1",
        ),
        ("wind: {factor: 1.0}", "line 1: wind.table is missing; expected a"),
        ("gust: {amplitude: 1}", "line 1: gust.amplitude is not a known key (its value is 1); did"),
        (
            "gust: {amplitude_m_s: 300, altitude_m: 1, length_m: 1}",
            "line 1: gust.amplitude_m_s is 300; expected a number of 0 to 50",
        ),
        (
            "turbulence: {table: [[0, 1, 1]], scale_m: 1}",
            "line 1: turbulence.scale_m is 1; expected a number from 10 to 10000 in m",
        ),
        ("draws: dice", "line 1: draws is 'dice'; expected one of 'random' or 'sobol'"),
        ("j2: true", "line 1: j2 is true; expected a number"),
        (MSIS.format("2009-01-01", 4), "line 1: nrlmsis.last_date is '2009-01-01 00:00:00+00:00';"),
        (MSIS.format("later", 4), "line 1: nrlmsis.last_date is 'later'; expected a date and time"),
        ("nrlmsis: {}", "line 1: nrlmsis.first_date is missing; expected a value; also line 1"),
        ("- thrust", "is a list of 1; expected a mapping with the keys of a dispersions file"),
        ("thrust: [", "line 2: not valid YAML"),
        ("j2: 0\nj2: 0", "line 2: j2 is given twice (first in line 1); expected it once"),
    ],
)
def test_a_wrong_file_is_told_in_one_line(tmp_path, text, expected):
    assert complaint(tmp_path, text).startswith(expected)


def test_a_missing_or_binary_file(tmp_path):
    with pytest.raises(DispersionsError, match="no such file; expected a YAML dispersions file"):
        load_dispersions(tmp_path / "none.yaml")
    (tmp_path / "b.yaml").write_bytes(bytes(range(128, 256)))
    with pytest.raises(DispersionsError, match="is not text"):
        load_dispersions(tmp_path / "b.yaml")
    with pytest.raises(DispersionsError, match="did you mean standard"):
        load_dispersions("standart")


def test_an_empty_file_disperses_nothing(tmp_path):
    (tmp_path / "e.yaml").write_text("# nothing\n")
    assert load_dispersions(tmp_path / "e.yaml") == Dispersions()


def test_the_shipped_files():
    standard, wide = load_dispersions("standard"), load_dispersions("wide_start")
    assert set(DISPERSIONS.shipped()) >= {"standard", "wide_start"}
    assert standard == Dispersions(
        initial_position_m=1000.0,
        initial_velocity_m_s=10.0,
        thrust=0.01,
        specific_impulse=0.005,
        log_density=0.3,
        j2=1.0826e-3,
    )
    assert wide.initial_position_m == (Spread(size=10_000.0),)
    assert wide.initial_velocity_m_s == (Spread(size=100.0),)
    assert wide.thrust == standard.thrust


def test_from_the_pad_standard_leaves_the_start_alone():
    pad, above = load_mission("delta_iii_pad"), load_mission("delta_iii")
    standard, there = load_dispersions("standard"), load_dispersions("standard", pad)
    assert load_dispersions("standard", above) == standard
    assert there == load_dispersions("standard_pad")
    assert (there.thrust, there.j2) == (standard.thrust, standard.j2)
    assert there.initial_position_m == there.initial_velocity_m_s == (Spread(),)
    assert there.log_density == (Spread(size=0.03),)
    assert there.wind is not None
    assert there.gust is not None
    assert standard.wind is standard.gust is None


def test_the_ways_to_say_a_spread(tmp_path):
    file = tmp_path / "d.yaml"
    file.write_text(
        "thrust: [0.01, {mean: -0.15, sigma: 0.02}]\n"
        "latency_s: {low: 0.1, high: 0.3}\n"
        "navigation: {position_noise_m: 5.0, mass_scale: {mean: 0.001}}\n"
        + MSIS.format("2020-06-01T12:00:00", 4)
    )
    read = load_dispersions(file)
    assert read.thrust == (Spread(size=0.01), Spread(-0.15, 0.02))
    assert read.latency_s[0].centre == pytest.approx(0.2)
    assert read.latency_s[0].size == pytest.approx(0.1)
    assert read.latency_s[0].even
    assert read.navigation == NavigationErrors(
        position_noise_m=5.0, mass_scale={"mean": 0.001, "sigma": 0.0}
    )
    assert read.nrlmsis.f107a == (Spread(135.0, 65.0, even=True),)


def test_a_covariance_may_leave_some_of_the_state_exact():
    covariance = np.zeros((6, 6))
    covariance[:3, :3] = [[4.0, 1.0, 0.0], [1.0, 9.0, 0.0], [0.0, 0.0, 0.0]]
    root = Dispersions(initial_covariance=covariance.tolist()).initial_root()
    assert root @ root.T == pytest.approx(covariance, abs=1e-12)
    covariance[0, 5] = covariance[5, 0] = 1.0
    with pytest.raises(ValueError, match="no covariance where the variance is 0"):
        Dispersions(initial_covariance=covariance.tolist())


@pytest.mark.parametrize(
    ("text", "margin"),
    [
        ("", 0.0),
        ("log_density: 0.3", 1.0 - math.exp(-2.7478 * 0.3)),
        ("log_density: {mean: -0.1, sigma: 0.3}", 1.0 - math.exp(0.1 - 2.7478 * 0.3)),
        ("{log_density: 0.3, jettison_limit: 0.2}", 1.0 - math.exp(-2.7478 * 0.36056)),
        ("log_density: {mean: -3.0, sigma: 0.1}", 0.0),
    ],
)
def test_a_limit_that_nobody_measures_takes_a_margin(tmp_path, text, margin):
    path = tmp_path / "some.yaml"
    path.write_text(text)
    assert load_dispersions(path).heating_margin() == pytest.approx(margin, abs=1e-4)
