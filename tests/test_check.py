# SPDX-License-Identifier: Apache-2.0
"""`ares replay BAG --check`: the recorded navigation, given to the present guidance."""

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest
from rclpy.serialization import deserialize_message, serialize_message

from ares_bags.reader import Bag, open_bag
from ares_bags.writer import GUIDANCE_KEY, BagWriter
from ares_guidance.messages import Answers
from ares_models.mission import load_mission
from ares_msgs.msg import GuidanceStatus, ThrustCommand

REFERENCE = Path(__file__).parent.parent / "bags" / "reference"
ARES_V = ("--mission", "ares_v")
COMMAND = "/ares/thrust_command"
STATUS = "/ares/guidance_status"
NAV = "/ares/nav_state"


@pytest.fixture(scope="module")
def reference() -> Bag:
    return open_bag(REFERENCE)


def rewrite(
    bag: Bag,
    path: Path,
    change: Callable[[str, int, bytes], bytes | None] = lambda _topic, _number, data: data,
    custom_data: Mapping[str, str] | None = None,
) -> Path:
    """Copy a bag message by message: topic, number within it, and CDR; None drops it."""
    counts = dict.fromkeys(bag.topics, 0)
    with BagWriter(path, bag.custom_data if custom_data is None else custom_data) as writer:
        for topic in bag.topics.values():
            writer.add_topic(topic)
        for name, time, data in bag.raw_messages():
            changed = change(name, counts[name], data)
            counts[name] += 1
            if changed is not None:
                writer.write(name, time, changed)
    return path


def settings_of(bag: Bag) -> tuple[str, dict[str, Any]]:
    key = next(key for key in bag.custom_data if key.startswith(GUIDANCE_KEY))
    return key, json.loads(bag.custom_data[key])


def test_the_reference_flight_passes(ares):
    done = ares("replay", str(REFERENCE), "--check")
    assert (done.returncode, done.stderr) == (0, ""), done.stdout
    assert "compared: 612 commands, 612 statuses\nequal within 1e-12" in done.stdout


def test_one_command_changed_in_its_tenth_digit(ares, reference, tmp_path):
    def change(topic, number, data):
        if topic != COMMAND or number != 300:
            return data
        command = deserialize_message(data, ThrustCommand)
        assert abs(command.direction[1]) > 0.1
        # its tenth digit
        command.direction[1] += 1e-10
        return serialize_message(command)

    path = rewrite(reference, tmp_path / "changed", change)
    done = ares("replay", str(path), "--check")
    assert done.returncode == 1
    assert "they part at 455.900 s: thrust_command direction[1] is " in done.stdout
    assert "relative difference 1.0e-10" in done.stdout
    found = json.loads(ares("replay", str(path), "--check", "--json").stdout)
    assert not found["equal"]
    assert found["first"]["recorded"] - found["first"]["now"] == pytest.approx(1e-10, rel=1e-4)
    assert [(f["topic"], f["field"]) for f in found["largest"]] == [
        ("thrust_command", "direction[1]")
    ]


def test_a_command_that_is_missing(ares, reference, tmp_path):
    def change(topic, number, data):
        return None if topic == COMMAND and number == 45 else data

    done = ares("replay", str(rewrite(reference, tmp_path / "less", change)), "--check")
    assert done.returncode == 1
    assert (
        "1 navigation states without the command that guidance gives, the first at 200.900 s"
        in (done.stdout)
    )
    assert "they part" not in done.stdout


@pytest.mark.parametrize("changed", [True, False])
def test_a_second_command_for_one_state(ares, reference, tmp_path, changed):
    """Record a second command: the vehicle flies the first, which must not be hidden."""
    with BagWriter(tmp_path / "twice", reference.custom_data) as writer:
        for topic in reference.topics.values():
            writer.add_topic(topic)
        for name, time, data in reference.raw_messages():
            if name == COMMAND:
                command = deserialize_message(data, ThrustCommand)
                command.direction[1] += 0.1 * changed
                writer.write(name, time, serialize_message(command))
            writer.write(name, time, data)
    done = ares("replay", str(tmp_path / "twice"), "--check")
    assert done.returncode == changed
    assert ("commands or statuses that guidance does not give" in done.stdout) == changed


def test_states_that_are_missing(ares, reference, tmp_path):
    def change(topic, number, data):
        return None if topic == NAV and 100 <= number < 110 else data

    path = rewrite(reference, tmp_path / "gap", change)
    done = ares("replay", str(path), "--check")
    assert done.returncode == 2
    assert "compared: 100 commands" in done.stdout
    assert "cut short: navigation states 100 to 109 are missing in the bag" in done.stdout


def test_a_damaged_bag(ares, reference, tmp_path):
    path = rewrite(reference, tmp_path / "hurt")
    file = open_bag(path).file
    data = bytearray(file.read_bytes())
    data[len(data) // 2] ^= 1
    file.write_bytes(data)
    done = ares("replay", str(path), "--check")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(f"ares: bag {path} is damaged")
    assert done.stderr.count("\n") == 1


def test_a_bag_that_does_not_say_what_guidance_flew_by(ares, reference, tmp_path):
    old = {"mission": "ares_v", "law": "peg", "seed": "0"}
    path = rewrite(reference, tmp_path / "old", custom_data=old)
    done = ares("replay", str(path), "--check")
    assert done.returncode == 0
    assert "flown by a version that the bag does not name" in done.stdout
    assert (
        "assumed, since the bag does not say (--set gives another): heating_source" in done.stdout
    )

    path = rewrite(reference, tmp_path / "bare", custom_data={})
    done = ares("replay", str(path), "--check")
    assert (done.returncode, done.stdout) == (2, "")
    assert "does not say which mission was flown; --mission does" in done.stderr
    done = ares("replay", str(path), "--check", "--mission", "ares_v")
    assert done.returncode == 0
    assert "does not say which law steered: peg, by its guidance_status" in done.stdout


def test_what_is_not_as_it_was_is_said(ares, reference, tmp_path):
    key, settings = settings_of(reference)
    told = settings | {"software": "0.0.1, kernels 0", "mission_digest": "0"}
    custom = reference.custom_data | {key: json.dumps(told)}
    # a bag that does not hold its mission
    for name, text in custom.items():
        if "mission_text" in text:
            kept = {k: v for k, v in json.loads(text).items() if k != "mission_text"}
            custom[name] = json.dumps(kept)
    path = rewrite(reference, tmp_path / "other", custom_data=custom)
    done = ares("replay", str(path), "--check", "--set", "cycle_period_s=2")
    assert done.returncode == 1
    assert "flown by 0.0.1, kernels 0\n" in done.stdout
    assert "cycle_period_s was 1.0 in the flight, given is 2.0\n" in done.stdout
    assert "mission ares_v has other numbers now than it had then\n" in done.stdout
    assert "flown by another version: last digits and the law itself may differ" in done.stdout
    # guidance has answered only every second state with a cycle
    assert "306 commands or statuses that guidance does not give" in done.stdout


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["--set", "period=2"], "setting is 'period'; expected one of mission, law"),
        (["--set", "hold_time_s"], "--set is 'hold_time_s'; expected NAME=VALUE"),
        (["--set", "hold_time_s=x"], "hold_time_s is 'x'; expected a number"),
        (["--set", "hold_time_s=-1"], "hold_time_s is -1.0; expected 0 to 120"),
        (["--set", "heating_source=x"], "heating_source is 'x'; expected one of measured"),
        (["--guidance", "pegg"], "law is 'pegg'; expected one of"),
        (["--mission", "nowhere"], "of a mission that cannot be read"),
        (["--pace", "2"], "--check publishes nothing"),
        (["--loop"], "--check publishes nothing"),
    ],
)
def test_what_cannot_be_checked(ares, words, text):
    done = ares("replay", str(REFERENCE), "--check", *words)
    assert (done.returncode, done.stdout) == (2, "")
    assert text in done.stderr
    assert done.stderr.count("\n") == 1


def test_options_of_the_check_alone(ares):
    done = ares("replay", str(REFERENCE), "--guidance", "peg")
    assert done.returncode == 2
    assert "go with --check only" in done.stderr


def test_another_guidance_took_over(ares, reference, tmp_path):
    """Let a second guidance, without history, answer from one state on."""
    _, settings = settings_of(reference)
    values = {k: v for k, v in settings.items() if k not in ("software", "mission_digest")}
    second = Answers(load_mission("ares_v"), values)
    second.identity = (7, 8)
    commands: dict[int, ThrustCommand] = {}
    statuses: dict[int, GuidanceStatus] = {}
    for number, (_, _, data) in enumerate(reference.raw_messages([NAV])):
        if number >= 400:
            now, _, _, measured = second.read(data)
            assert second.step(now, measured)
            commands[number], statuses[number] = second.command(), second.status()

    def change(topic, number, data):
        other = {COMMAND: commands, STATUS: statuses}.get(topic, {}).get(number)
        return data if other is None else serialize_message(other)

    path = rewrite(reference, tmp_path / "two", change)
    done = ares("replay", str(path), "--check")
    assert done.returncode == 0, done.stdout
    assert "compared: 612 commands, 612 statuses\n" in done.stdout


@pytest.mark.parametrize(
    ("words", "note"),
    [
        ([*ARES_V, "--dispersions", "standard", "--seed", "3", "--guidance", "igm"], ""),
        ([*ARES_V, "--guidance", "peg_thesis"], "found again, by its method analytic"),
        # with states a second apart in its coast
        (["--mission", "geostationary_transfer"], "found again, by its method auto"),
        (
            [*ARES_V, *("--guidance", "optimal", "--cycle-period", "4")]
            + ["--initial-guess", "optimizer"],
            "found",
        ),
    ],
    ids=["dispersed", "with a trajectory", "with a plan", "optimal"],
)
def test_flights_of_today(ares, tmp_path, words, note):
    path = tmp_path / "flight"
    flown = ares("fly", "--in-process", "--nav-period", "0.5", "--bag", str(path), *words)
    assert flown.returncode == 0, flown.stderr
    done = ares("replay", str(path), "--check")
    assert done.returncode == 0, done.stdout + done.stderr
    assert note in done.stdout
    assert "assumed" not in done.stdout
    assert done.stdout.endswith("to the last bit\n")
