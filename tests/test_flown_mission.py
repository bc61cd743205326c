# SPDX-License-Identifier: Apache-2.0
"""The mission of a recorded flight: its text is in the bag, which can be read anywhere."""

import json
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path

import pytest
import yaml

from ares_bags.reader import open_bag
from ares_bags.writer import SIMULATOR_KEY, BagWriter
from ares_bringup.recorded import read_flight
from ares_models.mission import load_mission
from ares_trials.testing.flights import short_burn

READERS = (
    ("report",),
    ("plot",),
    ("export", "--format", "csv"),
    ("export", "--format", "kml"),
    ("replay", "--check"),
    ("bag", "verify"),
)


@pytest.fixture
def flight(ares, tmp_path) -> tuple[Path, Path]:
    """Return a mission file of the user's, and the bag of a dispersed flight of it."""
    home = tmp_path / "home"
    home.mkdir()
    mission, dispersions = home / "mine.yaml", home / "mine_dispersions.yaml"
    mission.write_text("# by hand: ä\n" + yaml.safe_dump(short_burn()), encoding="utf-8")
    dispersions.write_text("thrust: 0.001\n", encoding="utf-8")
    words = ("--mission", str(mission), "--dispersions", str(dispersions), "--seed", "7")
    # seldom, since the numbers do not matter
    words = (*words, "--in-process", "--nav-period", "1")
    done = ares("fly", *words, "--bag", str(tmp_path / "bag"))
    assert done.returncode == 0, done.stderr
    return mission, tmp_path / "bag"


def rewrite(bag: Path, into: Path, change: Callable[[dict[str, str]], None]) -> Path:
    """Copy a bag, with other custom data."""
    old = open_bag(bag)
    custom = dict(old.custom_data)
    change(custom)
    with BagWriter(into, custom) as writer:
        for topic in old.topics.values():
            writer.add_topic(topic)
        for name, time, data in old.raw_messages():
            writer.write(name, time, data)
    return into


def edit(mission: Path) -> None:
    content = short_burn(**{"target.radius_m": 6_600_000.0})
    mission.write_text(yaml.safe_dump(content), encoding="utf-8")


def simulator_of(custom: Mapping[str, str]) -> dict[str, object]:
    told = json.loads(custom[SIMULATOR_KEY])
    assert isinstance(told, dict)
    return told


@pytest.mark.trial
def test_a_bag_is_read_where_its_files_are_not(ares, flight, tmp_path):
    mission, bag = flight
    told = simulator_of(open_bag(bag).custom_data)
    assert told["mission_text"] == mission.read_text(encoding="utf-8")
    assert told["dispersions_text"] == "thrust: 0.001\n"
    assert (told["seed"], told["pace"]) == (7, 0.0)
    assert str(told["software"]).startswith("0.")
    shutil.rmtree(mission.parent)
    away = tmp_path / "away"
    shutil.move(bag, away)
    for verb, *words in READERS:
        place = [*words, str(away)] if verb == "bag" else [str(away), *words]
        done = ares(verb, *place)
        assert (done.returncode, done.stderr) == (0, ""), (verb, words)
    info = ares("bag", "info", str(away)).stdout
    assert "mission_text (" in info
    assert "by hand" not in info


def test_an_edited_file_is_told_and_changes_no_verdict(ares, flight):
    mission, bag = flight
    before = read_flight(bag).summary
    # comments and layout count for nothing
    mission.write_text(yaml.safe_dump(short_burn()), encoding="utf-8")
    assert read_flight(bag).note == ""
    edit(mission)
    line = f"mission {mission} has changed since; that in the bag counts"
    done = ares("report", str(bag))
    assert (done.returncode, done.stderr) == (0, f"ares: {bag}: {line}\n")
    assert line in (bag / "report.html").read_text(encoding="utf-8")
    for words in (("plot",), ("export", "--format", "csv")):
        assert ares(*words, str(bag)).stderr == f"ares: {bag}: {line}\n"
    done = ares("replay", str(bag), "--check")
    assert done.returncode == 0
    assert f"\n{line}\n" in done.stdout
    flight_now = read_flight(bag)
    assert flight_now.summary.outcome is before.outcome
    assert flight_now.summary.insertion_error == before.insertion_error
    mission.write_text("stages: 5\n", encoding="utf-8")
    assert read_flight(bag).note == line


def test_a_mission_that_is_given_counts(ares, flight, tmp_path):
    mission, bag = flight
    own = read_flight(bag)
    assert read_flight(bag, str(mission)).note == ""
    other = tmp_path / "other.yaml"
    edit(other)
    line = f"mission {other} was given, another one was flown"
    done = ares("report", str(bag), "--mission", str(other))
    assert (done.returncode, done.stderr) == (0, f"ares: {bag}: {line}\n")
    judged = read_flight(bag, str(other))
    assert judged.mission == load_mission(other)
    moved = judged.summary.insertion_error["radius_m"] - own.summary.insertion_error["radius_m"]
    assert moved == pytest.approx(6_578_137.0 - 6_600_000.0, abs=1.0)
    done = ares("replay", str(bag), "--check", "--mission", str(other))
    assert done.returncode == 1
    assert f"\n{line}\n" in done.stdout


@pytest.mark.trial
def test_an_old_bag_is_read_by_name_or_as_told(ares, flight, tmp_path):
    mission, bag = flight
    old = rewrite(bag, tmp_path / "old", lambda custom: custom.pop(SIMULATOR_KEY))
    for verb in ("report", "plot"):
        assert ares(verb, str(old)).stderr == ""
    moved = tmp_path / "moved.yaml"
    shutil.move(mission, moved)
    done = ares("export", str(old), "--format", "csv")
    assert (done.returncode, done.stdout) == (2, "")
    assert f"is of a mission that cannot be read: {mission}: no such file" in done.stderr
    done = ares("export", str(old), "--format", "csv", "--mission", str(moved))
    assert (done.returncode, done.stderr) == (0, "")
    edit(mission)
    line = f"ares: {old}: mission {mission} has other numbers now than it had then\n"
    assert ares("report", str(old)).stderr == line


@pytest.mark.parametrize(
    ("told", "said"),
    [
        ("{", "what it says of simulator is no JSON object"),
        pytest.param("[1]", "what it says of simulator is no JSON object", marks=pytest.mark.trial),
        ('{"mission_text": 5}', "its mission_text is 5; expected a text"),
        ('{"mission_text": "name: 5"}', "the mission in it cannot be read: "),
    ],
)
def test_a_text_that_is_wrong_is_one_line(ares, flight, tmp_path, told, said):
    mission, bag = flight

    def damage(custom: dict[str, str]) -> None:
        custom[SIMULATOR_KEY] = told

    wrong = rewrite(bag, tmp_path / "wrong", damage)
    for words in (("report",), ("replay", "--check")):
        done = ares(*words, str(wrong))
        assert (done.returncode, done.stdout) == (2, "")
        assert done.stderr.count("\n") == 1
        assert said in done.stderr
        assert str(wrong) in done.stderr
    done = ares("report", str(wrong), "--mission", str(mission))
    assert (done.returncode, done.stderr) == (0, "")
