# SPDX-License-Identifier: Apache-2.0
"""Masses by item: each once, ignition masses follow; both forms of a vehicle are equal."""

import pytest
import yaml

from ares_models.input_file import read_input
from ares_models.mission import MISSION, TEMPLATE, MissionError, load_mission

STAGES = {
    "first stage": {"dry_mass_kg": 950.0, "propellant_kg": 10800.0},
    "second stage": {"dry_mass_kg": 235.0, "propellant_kg": 2150.0, "residuals_kg": 15.0},
}


def changed(tmp_path, change):
    """Load the template, whose masses are by item, with changes."""
    data, _ = read_input(TEMPLATE, MISSION)
    change(data)
    path = tmp_path / "changed.yaml"
    path.write_text(yaml.safe_dump(data))
    return load_mission(path)


def put(place, **values):
    def change(data):
        at = data if place is None else data["stages"][place]
        at.update(values)
        for key in [key for key, value in at.items() if value is None]:
            del at[key]

    return change


def by_whole_masses(data):
    """Add up a stage and all above it."""
    del data["payload_kg"]
    for stage, mass in zip(data["stages"], (14400.0, 2650.0), strict=True):
        for key in ("dry_mass_kg", "residuals_kg"):
            stage.pop(key, None)
        stage["ignition_mass_kg"] = mass


def test_what_is_ignited_is_what_stands_above():
    mission = load_mission(TEMPLATE)
    assert {stage.name for stage in mission.stages} == set(STAGES)
    above = 200.0
    for i, items in reversed(list(enumerate(STAGES.values()))):
        # the fairing belongs to the second stage; the stages below carry it too
        above += sum(items.values()) + (50.0 if i == 1 else 0.0)
        assert mission.ignition_mass(i) == pytest.approx(above, rel=1e-15)
    assert mission.start().mass_kg == above == 14400.0
    assert mission.propellant(1) == 2150.0


def test_both_forms_of_one_vehicle_fly_alike(tmp_path):
    items, whole = load_mission(TEMPLATE).arrays(), changed(tmp_path, by_whole_masses).arrays()
    for one, other in zip(items, whole, strict=True):
        assert one.tobytes() == other.tobytes()


def test_a_rounded_propellant_does_not_end_a_fixed_burn(tmp_path):
    """Load 216.0 kg where the burn takes 216.04; much less is an error."""
    base = load_mission(TEMPLATE)
    assert base.stages[0].burns[0].duration_s == 146.0
    takes = base.fixed_propellant(0)
    rounded = changed(tmp_path, put(0, propellant_kg=takes * (1.0 - 4e-4)))
    assert rounded.propellant(0) == takes
    with pytest.raises(MissionError, match="expected burns that take at most"):
        changed(tmp_path, put(0, propellant_kg=takes * (1.0 - 6e-4)))


def test_the_payload_is_one_line_to_change(tmp_path):
    before = load_mission(TEMPLATE)
    after = changed(tmp_path, put(None, payload_kg=230.0, adapter_kg=12.0))
    for i in range(2):
        assert after.ignition_mass(i) == before.ignition_mass(i) + 42.0
    assert changed(tmp_path, put(None, payload_kg=0)).ignition_mass(1) == 2450.0


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            put(1, ignition_mass_kg=2650.0),
            "payload_kg is 200.0; expected no such key beside stages[1].ignition_mass_kg",
        ),
        (
            lambda data: (by_whole_masses(data), put(1, dry_mass_kg=235.0)(data)),
            (
                "stages[1].dry_mass_kg is 235.0; expected no such key beside "
                "stages[0].ignition_mass_kg"
            ),
        ),
        (
            lambda data: (by_whole_masses(data), put(1, ignition_mass_kg=None)(data)),
            "stages[1].ignition_mass_kg is missing; expected a number in kg",
        ),
        (
            put(None, payload_kg=None),
            (
                "payload_kg is missing; expected a number in kg, because no stage has an "
                "ignition_mass_kg"
            ),
        ),
        (
            put(0, propellant_kg=None),
            (
                "stages[0].propellant_kg is missing; expected a number in kg, because masses are "
                "by item"
            ),
        ),
        (
            lambda data: (
                by_whole_masses(data),
                [put(i, ignition_mass_kg=None)(data) for i in range(2)],
            ),
            (
                "stages[0].ignition_mass_kg is missing; expected a number in kg, or masses by "
                "item: dry_mass_kg and propellant_kg of each stage, payload_kg"
            ),
        ),
        (
            put(0, propellant_kg=2000.0),
            "stages[0].burn_time_s is 146.0; expected burns that take at most 2,000 kg",
        ),
    ],
)
def test_masses_that_are_not_all_there_or_are_there_twice(tmp_path, change, said):
    with pytest.raises(MissionError) as caught:
        changed(tmp_path, change)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


#: A stage of two burns with a coast between them.
TWO_BURNS = {
    "dry_mass_kg": 235.0,
    "propellant_kg": 2150.0,
    "arcs": [
        {"thrust_n": 25e3, "isp_s": 330.0, "burn_time_s": 60.0},
        {"coast_s": 30.0},
        {"thrust_n": 25e3, "isp_s": 330.0, "burn_time_s": "depletion"},
    ],
}


def test_a_burn_to_depletion_takes_what_is_there(tmp_path):
    base = load_mission(TEMPLATE)
    mission = changed(tmp_path, put(0, burn_time_s="depletion"))
    assert mission.fixed_propellant(0) == pytest.approx(10800.0, rel=1e-12)
    (burn,), (before,) = mission.stages[0].burns, base.stages[0].burns
    flow = before.mass_flow(base.environment.g0_m_s2)
    assert burn.duration_s == pytest.approx(10800.0 / flow, rel=1e-12)


def test_a_burn_to_depletion_takes_what_start_tail_off_and_pad_leave(tmp_path):
    curves = {"start": [[0.0, 0.0], [2.0, 1.0]], "tail_off": [[0.0, 1.0], [1.0, 0.0]]}

    def hold(data):
        burn = {key: data["stages"][0].pop(key) for key in ("thrust_n", "isp_s", "burn_time_s")}
        for key in ("vertical_rise_s", "exit_area_m2"):
            del data["stages"][0][key]
        arcs = [burn | curves | {"burn_time_s": "depletion"}, {"coast_s": 2.0}]
        data["stages"][0]["arcs"] = arcs
        data["initial_state"]["hold_down_s"] = 3.0

    mission = changed(tmp_path, hold)
    assert mission.fixed_propellant(0) == pytest.approx(mission.propellant(0), rel=1e-12)
    flow = mission.stages[0].burns[0].mass_flow(mission.environment.g0_m_s2)
    assert mission.propellant(0) == pytest.approx(10800.0 - 2.0 * flow, rel=1e-12)


def test_a_burn_to_depletion_takes_what_other_burns_leave(tmp_path):
    def two_burns(data):
        kept = {key: data["stages"][1][key] for key in ("name",)}
        data["stages"][1] = kept | TWO_BURNS
        data["stages"].append(kept | {"name": "third stage", "dry_mass_kg": 9.0})
        data["stages"][2] |= {"propellant_kg": 40.0, "thrust_n": 500.0, "isp_s": 300.0}
        data["stages"][2]["burn_time_s"] = "free"

    mission = changed(tmp_path, two_burns)
    assert mission.fixed_propellant(1) == pytest.approx(2150.0, rel=1e-12)


@pytest.mark.parametrize(
    ("place", "values", "said"),
    [
        (
            0,
            {"burn_time_s": "depletion", "propellant_kg": None},
            (
                "stages[0].burn_time_s is 'depletion'; expected a time in s or free: the stage has "
                "no propellant_kg"
            ),
        ),
        (
            0,
            {"burn_time_s": "depletion", "max_acceleration_m_s2": 50.0, "vertical_rise_s": None},
            (
                "stages[0].burn_time_s is 'depletion'; expected a time in s or free, in a stage "
                "with max_acceleration_m_s2"
            ),
        ),
        (
            0,
            {"burn_time_s": "empty"},
            "stages[0].burn_time_s is 'empty'; expected a time in s, or the word free or depletion",
        ),
        (
            0,
            {"burn_time_s": "depletion", "thrust_n": -1.0},
            "stages[0].thrust_n is -1.0; expected a number from 0.001 to 1e10 in N",
        ),
        (
            0,
            {"burn_time_s": None, "thrust_n": None, "isp_s": None, "vertical_rise_s": None}
            | {"arcs": [TWO_BURNS["arcs"][0] | {"thrust_n": 1e6}, TWO_BURNS["arcs"][2]]},
            "stages[0].propellant_kg is 10800.0; expected more than the 18,540.",
        ),
        (
            0,
            {"burn_time_s": None, "thrust_n": None, "isp_s": None, "vertical_rise_s": None}
            | {"arcs": [TWO_BURNS["arcs"][2], dict(TWO_BURNS["arcs"][2], engines=2)]},
            (
                "stages[0].arcs[0].burn_time_s is 'depletion'; expected a time in s or free: "
                "another burn of the stage takes what it leaves"
            ),
        ),
    ],
)
def test_a_burn_to_depletion_that_has_no_length_is_one_line(tmp_path, place, values, said):
    with pytest.raises(MissionError) as error:
        changed(tmp_path, put(place, **values))
    assert said in str(error.value)
