# SPDX-License-Identifier: Apache-2.0
"""`ares missions new`, `ares dispersions new`, their schemas: the files are valid as written."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from ares_bringup.commands.cli import main
from ares_guidance.laws import make_law
from ares_guidance.plan import plan_of
from ares_models.commented import commented
from ares_models.input_file import read_input
from ares_models.json_schema import json_schema
from ares_models.mission import MISSION, TEMPLATE, Mission, list_missions, load_mission
from ares_optimizer.solve import solve
from ares_studies.closed_loop import fly_stepwise, offline_trajectory
from ares_studies.montecarlo.flights import FlightRange, Settings
from ares_trials.testing.samples import one_in
from ares_vehicle_sim.dispersions import Dispersions, load_dispersions
from ares_vehicle_sim.proposal import propose


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(capfd, *words):
    capfd.readouterr()
    status = main(words)
    return status, *capfd.readouterr()


def proposed(mission):
    return Dispersions.model_validate({part.key: part.value for part in propose(mission)})


def test_a_new_mission_says_where_it_is_and_what_to_try(capfd, here):
    status, out, err = run(capfd, "missions", "new", "My_Rocket")
    assert (status, err) == (0, "")
    assert out.splitlines() == [
        "mission.schema.json",
        "My_Rocket.yaml",
        "try  ./ares missions My_Rocket.yaml",
        "then ./ares fly --mission My_Rocket.yaml",
    ]
    assert sorted(path.name for path in here.iterdir()) == ["My_Rocket.yaml", "mission.schema.json"]
    assert load_mission("My_Rocket.yaml").name == "my_rocket"
    first = Path("My_Rocket.yaml").read_text().splitlines()[0]
    assert first == "# yaml-language-server: $schema=mission.schema.json"
    assert Path("mission.schema.json").read_text() == json_schema(Mission, "Ares mission file")


def test_it_is_the_template_and_arrives():
    mission = load_mission(TEMPLATE)
    optimum = solve(mission, "auto")
    assert optimum.converged
    arrays = mission.arrays(foreseen=True)
    plan = plan_of(offline_trajectory(optimum), arrays)
    target = arrays.target[0]
    for name in ("peg", "optimal", "igm"):
        law = make_law(name, arrays)
        law.follow_arcs(plan)
        end = fly_stepwise(mission, law=law).plant
        assert np.linalg.norm(end["position"]) == pytest.approx(target["radius"], abs=1.0)
        assert np.linalg.norm(end["velocity"]) == pytest.approx(target["speed"], abs=0.01)
        assert end["mass"] > 0.999 * optimum.m_f_kg


@pytest.mark.parametrize("name", list_missions())
def test_like_another_mission_is_that_mission(capfd, name):
    assert run(capfd, "missions", "new", "mine", "--like", name)[0] == 0
    mine = load_mission("mine.yaml")
    assert mine.model_copy(update={"name": name}) == load_mission(name)


def test_every_key_is_explained_once(capfd):
    """Check that keys omitted in the template are there too, commented out."""
    run(capfd, "missions", "new", "mine")
    text = Path("mine.yaml").read_text()
    schema = json.loads(json_schema(Mission, "x"))
    for part in [schema, *schema["$defs"].values()]:
        for key, told in part["properties"].items():
            assert re.search(rf"\b{key}:.*# {re.escape(told['description'])}", text), key
    assert "  # full thrust of all engines, vacuum; 0.001 to 1e10 N" in text
    assert text.count("full thrust of all engines, vacuum;") == 1


def test_what_is_commented_out_with_a_default_may_be_put_in(capfd):
    run(capfd, "missions", "new", "mine")
    text = Path("mine.yaml").read_text()
    for key in ("g0_m_s2: 9.80665", "j2: 0.0", "altitude: ellipsoid", "density_factor: 1.0"):
        assert f"# {key}" in text
        text = text.replace(f"# {key}", key)
    Path("mine.yaml").write_text(text.replace("# attitude: guided", "attitude: guided"))
    template = load_mission(TEMPLATE)
    assert load_mission("mine.yaml") == template.model_copy(update={"name": "mine"})


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["new", "a b"], "NAME is 'a b'; expected at most 64 letters, digits and underscores"),
        (["new", "x" * 65], "NAME is 'xxx"),
        (["new", "../x"], "NAME is '../x'; expected at most 64"),
        (["new", "x", "--like", "ares_5"], "mission 'ares_5': no such mission; shipped are"),
        (["new", "x", "--out", "none/x.yaml"], "--out is 'none/x.yaml'; its folder does not exist"),
        (["schema", "--out", "there"], "--out is 'there', which exists; expected a new file"),
        (["new", "x", "--out", "there"], "--out is 'there', which exists; expected a new file"),
        (["new"], "Missing argument 'NAME'"),
        (["--no-such"], "No such option: --no-such"),
    ],
)
def test_what_is_wrong_is_one_line_and_nothing_is_written(capfd, here, words, said):
    Path("there").write_text("mine")
    status, out, err = run(capfd, "missions", *words)
    assert (status, out) == (2, "")
    assert err.count("\n") == 1
    assert said in err
    assert [path.name for path in here.iterdir()] == ["there"]
    assert Path("there").read_text() == "mine"


def test_files_whose_names_are_words_of_the_verb(capfd):
    text = TEMPLATE.read_text()
    for name in ("new", "schema", "list"):
        Path(name).write_text(text)
        status, out, err = run(capfd, "missions", f"./{name}")
        assert (status, err) == (0, "")
        assert out.startswith("template  valid")


def test_a_mission_is_shown_with_the_figures_of_its_stages(capfd):
    status, out, _ = run(capfd, "missions", "delta_iii_pad", "electron_sso_pad")
    assert status == 0
    lines = [line.split() for line in out.splitlines()]
    assert ["6", "six", "solids", "75.2", "283.3"] in lines
    # kg, thrust to weight, s, s, m/s
    assert ["kick", "stage", "230", "0.05", "1,046.0", "320.0", "600"] in lines


def test_missions_may_be_named_after_the_word_list(capfd):
    _, listed, _ = run(capfd, "missions", "delta_iii")
    assert run(capfd, "missions", "list", "delta_iii") == (0, listed, "")


def test_dispersions_are_listed_and_checked(capfd):
    status, out, err = run(capfd, "dispersions")
    assert (status, err) == (0, "")
    assert re.search(r"^standard\s+valid\s+initial_position_m", out, re.MULTILINE)
    Path("wrong.yaml").write_text("thrust: 3")
    status, out, err = run(capfd, "dispersions", "wrong.yaml", "wide_start")
    assert status == 2
    assert err == "ares: wrong.yaml: line 1: thrust is 3; expected a number of 0 to 0.2\n"
    assert "wide_start" in out


def test_new_dispersions_name_the_reason_of_each_value(capfd):
    run(capfd, "missions", "new", "mine")
    status, out, err = run(capfd, "dispersions", "new", "--mission", "mine.yaml")
    assert (status, err) == (0, "")
    assert out.splitlines() == [
        "dispersions.schema.json",
        "mine_dispersions.yaml",
        "try  ./ares montecarlo --mission mine.yaml --dispersions mine_dispersions.yaml -n 1000",
    ]
    mission = load_mission("mine.yaml")
    assert load_dispersions("mine_dispersions.yaml") == proposed(mission)
    text = Path("mine_dispersions.yaml").read_text()
    assert all(f"  # {part.reason}" in text for part in propose(mission))
    assert "# latency_s: 0.0  # from a navigation state until" in text


@pytest.mark.parametrize("name", one_in(12, list_missions()))
def test_what_is_proposed_is_drawn(name):
    mission = load_mission(name)
    assert not FlightRange(Settings(mission, proposed(mission), law="optimal")).fly(0, 1).errors


def test_the_proposal_grows_with_the_way_to_the_start():
    start = {}
    for name in list_missions():
        dispersions = proposed(load_mission(name))
        (position,), (velocity,) = (
            dispersions.initial_position_m,
            dispersions.initial_velocity_m_s,
        )
        start[name] = (position.size, velocity.size)
    # 16 s after lift-off; a booster; an upper stage; an orbit flown by guidance
    assert start["apollo11_ascent"] == (1.8, 0.12)
    assert start["ares_v"] == (420.0, 7.5)
    assert start["delta_iii"] == (1300.0, 24.0)
    assert start["saturn_v_tli"] == (660.0, 0.78)
    # a pad is surveyed
    assert start["delta_iii_pad"] == start["falcon9_leo_pad"] == (0.0, 0.0)


@pytest.mark.parametrize(
    ("name", "sigma"), [("ares_v", 0.3), ("delta_iii_pad", 0.03), ("falcon9_leo_pad", 0.03)]
)
def test_the_air_is_known_better_near_the_ground(name, sigma):
    (density,) = proposed(load_mission(name)).log_density
    assert density.size == sigma


@pytest.mark.parametrize("name", ["apollo11_ascent", "ares_v", TEMPLATE])
def test_dispersed_as_proposed_all_arrive(name):
    mission = load_mission(name)
    flown = FlightRange(Settings(mission, proposed(mission))).fly(0, 200)
    assert not flown.errors
    assert flown.results["terminal_accuracy"].all()
    assert flown.results["fairing_off"].all()


def test_nothing_of_a_file_is_lost_by_its_comments():
    data, _ = read_input(MISSION.find("saturn_v_as506"), MISSION)
    path = Path("again.yaml")
    path.write_text(commented(Mission, data))
    assert read_input(path, MISSION)[0] == data
