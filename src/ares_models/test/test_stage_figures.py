# SPDX-License-Identifier: Apache-2.0
"""Figures of stages: by the rocket equation, and equal for one motor in three forms."""

import math

import pytest
import yaml

from ares_models.input_file import read_input
from ares_models.mission import MISSION, TEMPLATE, load_mission
from ares_models.stage_figures import stage_figures

G0 = 9.80665
#: Pressure of the U.S. Standard Atmosphere 1976 at 100 m, Pa, as printed.
AT_100_M = 100129.4


def figures(tmp_path, **first):
    """Return the figures of the template, with other keys in its first stage."""
    data, _ = read_input(TEMPLATE, MISSION)
    stage = data["stages"][0] | first
    data["stages"][0] = {key: value for key, value in stage.items() if value is not None}
    path = tmp_path / "changed.yaml"
    path.write_text(yaml.safe_dump(data))
    return stage_figures(load_mission(path))


def test_stages_of_engines_obey_the_rocket_equation(tmp_path):
    first, second = figures(tmp_path)
    burnt = 225e3 * 146.0 / (G0 * 311.0)
    assert first.delta_v_m_s == pytest.approx(G0 * 311.0 * math.log(14400.0 / (14400.0 - burnt)))
    assert first.burn_time_s == pytest.approx(146.0)
    weight = 14400.0 * 3.986004418e14 / 6369660.0**2
    assert first.thrust_to_weight == pytest.approx((225e3 - 0.3 * AT_100_M) / weight, rel=2e-3)
    # the fairing of 50 kg is gone; 15 kg of residuals stay
    assert second.delta_v_m_s == pytest.approx(G0 * 343.0 * math.log(2600.0 / 450.0), rel=1e-6)
    assert second.burn_time_s == pytest.approx(2150.0 * G0 * 343.0 / 25800.0)
    assert second.thrust_to_weight == pytest.approx(25800.0 / (2650.0 * G0))
    assert second.isp_s == pytest.approx((343.0,))


@pytest.mark.parametrize(
    "motor",
    [
        {"thrust_n": 50e3, "burn_time_s": 60.0},
        {"thrust_n": 50e3, "isp_s": 250.0},
        {"thrust_table": [[0.0, 50e3], [60.0, 50e3]]},
    ],
)
def test_boosters_in_three_forms_have_the_same_figures(tmp_path, motor):
    burnt = 50e3 * 60.0 / (G0 * 250.0)
    booster = {"name": "motor", "count": 2, "dry_mass_kg": 150.0, "propellant_kg": burnt}
    first = figures(tmp_path, boosters=[booster | motor], max_q_alpha_pa_rad=9000.0)[0]
    ((count, name, burn_s, isp_s),) = first.boosters
    assert (count, name) == (2, "motor")
    assert (burn_s, isp_s) == pytest.approx((60.0, 250.0))
    # both thrusts act on one mass until the motors are empty, then the core burns on alone
    core, motors = 225e3 / (G0 * 311.0), 100e3 / (G0 * 250.0)
    whole = 14400.0 + 2.0 * (150.0 + burnt)
    empty = whole - 60.0 * (core + motors)
    rest = empty - 300.0
    expected = 325e3 / (core + motors) * math.log(whole / empty)
    expected += G0 * 311.0 * math.log(rest / (rest - 86.0 * core))
    assert first.delta_v_m_s == pytest.approx(expected, rel=1e-5)


def test_a_motor_by_a_table_has_its_impulse(tmp_path):
    # 5 s to full thrust, 10 s to nothing: 135 s of full thrust
    table = [[0.0, 200e3], [130.0, 240e3], [140.0, 0.0]]
    area = 130.0 * 220e3 + 10.0 * 120e3
    first = figures(
        tmp_path, thrust_n=None, burn_time_s=None, thrust_table=table, propellant_kg=10800.0
    )[0]
    assert first.burn_time_s == pytest.approx(140.0)
    assert first.isp_s == pytest.approx((311.0,))
    exhaust, burnt = G0 * 311.0, area / (G0 * 311.0)
    assert first.delta_v_m_s == pytest.approx(exhaust * math.log(14400.0 / (14400.0 - burnt)))


def test_lists_keep_masses_whole_and_names_with_commas_apart(tmp_path):
    data, _ = read_input(TEMPLATE, MISSION)
    data["stages"][0] |= {"dry_mass_kg": 1234567.0, "propellant_kg": 2e6, "thrust_n": 4e7}
    data["jettisons"][0]["name"] = "fairing, 3 m"
    data["jettisons"].append(data["jettisons"][0] | {"name": "adapter"})
    path = tmp_path / "heavy.yaml"
    path.write_text(yaml.safe_dump(data))
    texts = load_mission(path).describe()
    assert texts["stages"].startswith("first stage 3,237,267 kg, ")
    assert texts["jettisons"] == "fairing, 3 m; adapter"
