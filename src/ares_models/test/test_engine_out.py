# SPDX-License-Identifier: Apache-2.0
"""Engines lost during a burn: the others burn its propellant, and guidance does not foresee it."""

from importlib import resources

import numpy as np
import pytest

from ares_models.mission import MissionError, load_mission

CORE = "    burn_time_s: 181.25           #"


@pytest.fixture
def mission_file(tmp_path):
    """Write ares_v with some text after the core's burn time."""

    def write(text):
        shipped = resources.files("ares_models").joinpath("missions", "ares_v.yaml").read_text()
        assert CORE in shipped
        path = tmp_path / "mission.yaml"
        path.write_text(shipped.replace(CORE, f"    {text}\n{CORE}"))
        return path

    return write


def failing(mission_file, at=100.0, engines=5, lost=1):
    text = f"{{time_after_ignition_s: {at}, engines: {engines}, lost: {lost}}}"
    return mission_file(f"engine_out: {text}")


def test_the_burn_is_cut_in_two_and_takes_the_same_propellant(mission_file):
    mission = load_mission(failing(mission_file))
    assert mission.arc_names == ("core", "core, engine out", "upper stage")
    whole = load_mission("ares_v").arrays().arcs
    arcs = mission.arrays().arcs
    assert arcs["duration"][0] == 100.0
    assert arcs["duration"][1] == pytest.approx(81.25 * 5 / 4)
    assert arcs["thrust"][1] == pytest.approx(0.8 * whole["thrust"][0])
    assert arcs["exhaust_velocity"][1] == whole["exhaust_velocity"][0]
    assert np.sum(arcs["duration"][:2] * arcs["mass_flow"][:2]) == pytest.approx(
        whole["propellant"][0]
    )
    assert list(arcs["begins_stage"]) == [1, 0, 1]


def test_guidance_does_not_foresee_it(mission_file):
    arcs = load_mission(failing(mission_file)).arrays(foreseen=True).arcs
    assert list(arcs["duration"]) == [181.25, 0.0, np.inf]


@pytest.mark.parametrize(
    ("keys", "line"),
    [
        ({"at": 181.25}, "time_after_ignition_s is 181.25; expected a time from 0 s to the end"),
        ({"at": -1.0}, "time_after_ignition_s is -1.0; expected a number from 0.001 to 864000"),
        ({"lost": 5}, "lost is 5; expected fewer than the 5 engines"),
        ({"lost": 0}, "lost is 0; expected an integer from 1 to 99"),
        ({"engines": 1}, "engines is 1; expected an integer from 2 to 100"),
        ({"engines": 2.5}, "engines is 2.5; expected"),
    ],
)
def test_what_cannot_be(mission_file, keys, line):
    with pytest.raises(MissionError) as caught:
        load_mission(failing(mission_file, **keys))
    assert f"stages[0].engine_out.{line}" in str(caught.value)


def test_not_in_a_free_burn(mission_file):
    path = mission_file("")
    text = path.read_text().replace(
        "burn_time_s: free",
        "burn_time_s: free\n    engine_out: {time_after_ignition_s: 9.0, engines: 2}",
    )
    path.write_text(text)
    with pytest.raises(MissionError, match="no engine_out in a burn with burn_time_s: free"):
        load_mission(path)
