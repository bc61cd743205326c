# SPDX-License-Identifier: Apache-2.0
"""`ares fly` on the real mission with the real nodes: the flights, in both layouts."""

import json
import math
import os
import pty
import signal
import subprocess
import sys
import time
from importlib import resources
from pathlib import Path

import numpy as np
import pytest
import yaml

from ares_bags.compare import differences
from ares_bags.reader import open_bag
from ares_bringup.held import shared_memory
from ares_bringup.recorded import read_flight
from ares_models.mission import parse_mission
from ares_models.orbits import Insertion
from ares_msgs.msg import GuidanceStatus
from ares_studies.closed_loop import fly_compiled
from ares_trials.testing.bags import recorded_so_far
from ares_trials.testing.flights import short_burn
from ares_trials.testing.held import orphans
from ares_trials.testing.ros import claimed_domain, own_words
from ares_trials.testing.samples import one_in

TIMEOUT = 240.0
KEYS = {
    "mission",
    "guidance",
    "t_plf_s",
    "t_meco_s",
    "m_f_kg",
    "planned_m_f_kg",
    "insertion_error",
    "guidance_cycles",
    "wall_s",
    "realtime_factor",
    "bag",
}
SIGNALS = [
    signal.SIGINT,
    *(pytest.param(number, marks=pytest.mark.trial) for number in (signal.SIGTERM, signal.SIGHUP)),
]
LAYOUTS = {"processes": [], "one_process": ["--in-process"]}


def command(*argv):
    return [sys.executable, "-m", "ares_bringup", *argv]


def environment(domain, bags):
    return {**os.environ, "ROS_DOMAIN_ID": str(domain), "ARES_BAGS": str(bags)}


def fly(domain, bags, *argv):
    done = subprocess.run(
        command("fly", *argv),
        env=environment(domain, bags),
        capture_output=True,
        text=True,
        timeout=TIMEOUT,
        check=False,
    )
    done.stderr = own_words(done.stderr)
    return done


def children_of(pid):
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                fields = (entry / "stat").read_text().rsplit(")", maxsplit=1)[1].split()
            except OSError:
                continue
            if int(fields[1]) == pid:
                found.append(int(entry.name))
    return found


def wait_for_flight(bag):
    """Wait until messages are in the bag."""
    deadline = time.monotonic() + TIMEOUT
    while not recorded_so_far(bag).total():
        assert time.monotonic() < deadline
        time.sleep(0.05)


@pytest.fixture(scope="module")
def domain():
    with claimed_domain() as number:
        yield number


@pytest.fixture(scope="module")
def bags(tmp_path_factory):
    return tmp_path_factory.mktemp("bags")


@pytest.fixture(scope="module", params=LAYOUTS)
def flown(request, domain, bags):
    """Fly Ares V, once in each layout; return the output."""
    words = ("--mission", "ares_v", "--json", "--bag", str(bags / request.param))
    words += ("--nav-period", "0.5")
    return fly(domain, bags, *words, *LAYOUTS[request.param])


@pytest.fixture(scope="module")
def flight(flown):
    return json.loads(flown.stdout)


def test_a_flight_prints_one_object_and_nothing_else(flown, flight):
    assert flown.returncode == 0, flown.stderr
    assert flown.stderr == ""
    assert set(flight) >= KEYS
    assert flight["mission"] == "ares_v"
    assert flight["outcome"] == "target"
    assert flight["shortcomings"] == []
    assert flight["diagnostics"] == []
    assert flight["lost_messages"] == 0


def test_the_insertion_is_as_good_as_promised(flight):
    error = flight["insertion_error"]
    assert abs(error["radius_m"]) <= 1.0
    assert abs(error["speed_m_s"]) <= 0.01
    assert abs(error["flight_path_angle_deg"]) <= 1e-4
    assert abs(error["inclination_deg"]) <= 1e-3


def test_the_final_mass_is_as_good_as_promised(flight):
    # optimum with the jettison as a passive event: about 174,151 kg
    assert 174_060.0 <= flight["m_f_kg"] <= 174_151.0


def test_guidance_starts_from_the_navigation_state_alone(flight):
    assert flight["first_convergence_iterations"] <= 30
    assert flight["max_stale_cycles"] == 0
    assert flight["guidance_cycles"] >= 600


def test_the_bag_holds_the_flight(flight):
    bag = open_bag(flight["bag"])
    counts = {name: topic.count for name, topic in bag.topics.items()}
    assert counts["/ares/vehicle_state"] == counts["/ares/nav_state"] + 1
    assert counts["/ares/thrust_command"] == counts["/ares/nav_state"]
    assert counts["/ares/guidance_status"] == flight["guidance_cycles"]
    assert counts["/ares/flight_event"] == len(flight["events"])
    assert bag.custom_data["mission"] == "ares_v"
    assert bag.end_ns == round(flight["events"][-1]["t_s"] * 1e9)


@pytest.mark.usefixtures("flight")
def test_both_layouts_fly_the_same_flight(bags):
    paths = [bags / name for name in LAYOUTS]
    if all(path.exists() for path in paths):  # after the second of the two flights
        one, other = (open_bag(path) for path in paths)
        assert differences(one, other) == []


def test_where_no_mission_is_named_the_climb_begins_on_the_pad(from_the_pad):
    printed = (from_the_pad / "printed").read_text()
    assert "Delta III from the pad" in printed
    summary = read_flight(from_the_pad / "bag").summary
    told = [moment.text for moment in summary.timeline]
    # the simulator tells them while it flies, the bag holds the states that they are found in
    lines = [line.split(maxsplit=2)[2:] for line in printed.splitlines() if line.strip()]
    shown = [line[0].strip() for line in lines if line]
    assert [text for text in shown if text in told] == told
    names = [text.partition(":")[0].partition(" at ")[0] for text in told]
    order = ("Mach 1", "greatest dynamic pressure", "jettison", "hand-over", "staging")
    assert sorted(order, key=names.index) == list(order)


def test_in_the_boost_programme_guidance_tells_no_solution(from_the_pad):
    said = open_bag(from_the_pad / "bag").columns("/ares/guidance_status")
    boosts = said["phase"] == GuidanceStatus.PHASE_BOOST
    assert 100 < np.sum(boosts) < 300
    assert not np.any(said["converged"][boosts])
    assert np.all(said["converged"][~boosts])
    for name in ("time_to_go", "velocity_to_go", "predicted_position", "predicted_velocity"):
        assert np.all(np.isnan(said[name][boosts])), name
        assert np.all(np.isfinite(said[name][~boosts])), name


def test_the_table_of_a_keplerian_mission(ares, bags, monkeypatch):
    monkeypatch.setenv("ARES_BAGS", str(bags))
    # seldom, since the numbers do not matter
    done = ares("fly", "--mission", "delta_iii", "--in-process", "--nav-period", "1")
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    assert max(len(line) for line in done.stdout.splitlines() if "bag " not in line) <= 80
    assert "\x1b" not in done.stdout
    for word in ("target", "predicted", "flown", "error", "node", "semi-major axis", "wall time"):
        assert word in done.stdout
    assert len([path for path in bags.iterdir() if path.name.startswith("delta_iii_")]) == 1


def test_a_flight_that_misses_is_exit_1(ares, tmp_path):
    weak = tmp_path / "weak.yaml"
    weak.write_text("thrust: {mean: -0.5}\n")
    argv = ("--mission", "ares_v", "--json", "--no-record", "--in-process", "--nav-period", "1")
    done = ares("fly", *argv, "--dispersions", str(weak))
    assert done.returncode == 1, done.stderr
    flight = json.loads(done.stdout)
    assert flight["outcome"] in ("impact", "depletion", "target_missed")
    assert flight["shortcomings"]
    assert flight["bag"] is None


def test_a_programme_flies_a_mission_whole_to_its_target(ares, tmp_path):
    text = resources.files("ares_trials").joinpath("sweep", "programme.yaml").read_text()
    text = text.replace("  until: {end_of: first}\n", "").replace("_s: free", "_s: 300.0")
    plant = fly_compiled(parse_mission(text, "whole.yaml")).plant
    end = Insertion.from_state(plant["position"], plant["velocity"])
    angles = (math.degrees(end.flight_path_angle), math.degrees(end.inclination))
    keys = ("radius_m", "speed_m_s", "flight_path_angle_deg", "inclination_deg")
    there = dict(zip(keys, (end.radius, end.speed, *angles), strict=True))
    path = tmp_path / "whole.yaml"
    path.write_text(text[: text.index("target:")] + yaml.safe_dump({"target": there}))
    done = ares("fly", "--mission", str(path), "--json", "--no-record", "--in-process")
    assert done.returncode == 0, done.stderr
    flight = json.loads(done.stdout)
    assert flight["outcome"] == "target"
    assert flight["shortcomings"] == []


REFUSED = [
    (["--mission", "ares_v", "--dispersions", "/nowhere.yaml"], "vehicle_sim: /nowhere.yaml"),
    (
        ["--mission", "ares_v", "--pace", "1e-9"],
        "vehicle_sim: parameter pace is 1e-09; expected 0, or 0.001 up",
    ),
    (
        ["--mission", "ares_v", "--bag", "/proc/nothing/here"],
        "bag /proc/nothing/here cannot be created",
    ),
]


@pytest.mark.trial
@pytest.mark.parametrize("layout", LAYOUTS.values(), ids=LAYOUTS)
def test_a_failure_that_does_not_happen_is_said_without_a_recorder_too(ares, tmp_path, layout):
    (tmp_path / "m.yaml").write_text(yaml.safe_dump(short_burn()))
    failure = "engine_out:time=1e6,thrust_ratio=0.5"
    done = ares(
        "fly", *layout, "--no-record", "--mission", str(tmp_path / "m.yaml"), "--failure", failure
    )
    assert done.returncode == 0, done.stderr
    said = "WARN  vehicle_sim: failure engine_out: its time did not come, nothing failed"
    assert done.stderr.count(said) == 1


@pytest.mark.parametrize(("argv", "words"), REFUSED)
def test_what_a_node_refuses_is_one_line_and_exit_2(ares, argv, words):
    check_refusal(ares("fly", "--in-process", *argv), words)


# one of each node: a parameter that is refused is the same for all
@pytest.mark.parametrize(
    ("argv", "words"),
    [REFUSED[1], *(pytest.param(*REFUSED[k], marks=pytest.mark.trial) for k in (0, 2))],
)
def test_what_a_node_of_its_own_refuses_is_one_line_and_exit_2(domain, bags, argv, words):
    check_refusal(fly(domain, bags, *argv), words)


def check_refusal(done, words):
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1
    assert words in done.stderr


def test_a_second_flight_on_the_same_graph_has_no_effect(ares, ros_domain, bags, tmp_path):
    bag = tmp_path / "bag"
    long, short = tmp_path / "long.yaml", tmp_path / "short.yaml"
    long.write_text(yaml.safe_dump(short_burn(330.0)))
    short.write_text(yaml.safe_dump(short_burn(180.0)))
    here = ("fly", "--json", "--no-record", "--in-process", "--mission")
    alone = ares(*here, str(long))
    argv = ("--in-process", "--json", "--pace", "20", "--mission", str(long), "--bag", str(bag))
    first = subprocess.Popen(
        command("fly", *argv),
        env=environment(ros_domain, bags),
        stdout=subprocess.PIPE,
        text=True,
        stderr=subprocess.DEVNULL,
    )
    wait_for_flight(bag)
    second = ares(*here, str(short))
    out, _ = first.communicate(timeout=TIMEOUT)
    flights = json.loads(out), json.loads(second.stdout)
    assert [flight["outcome"] for flight in flights] == ["target", "target"]
    assert flights[0]["m_f_kg"] == json.loads(alone.stdout)["m_f_kg"]
    assert [flight["domain_id"] for flight in flights] == [ros_domain, ros_domain]


@pytest.mark.parametrize("number", SIGNALS)
def test_an_interrupted_flight_keeps_its_bag_and_leaves_nothing(domain, bags, tmp_path, number):
    bag = tmp_path / "bag"
    argv = ("fly", "--mission", "ares_v", "--json", "--pace", "20", "--bag", str(bag))
    parent = subprocess.Popen(
        command(*argv), env=environment(domain, bags), stdout=subprocess.PIPE, text=True
    )
    wait_for_flight(bag)
    children = children_of(parent.pid)
    assert len(children) == 3
    parent.send_signal(number)
    out, _ = parent.communicate(timeout=TIMEOUT)
    assert parent.returncode == 130
    assert json.loads(out)["outcome"] == "interrupted"
    assert not [pid for pid in children if Path(f"/proc/{pid}").exists()]
    assert open_bag(bag).message_count > 0


@pytest.mark.trial
@pytest.mark.parametrize("number", SIGNALS)
def test_an_interrupted_flight_in_one_process_does_not_fly_on(domain, bags, tmp_path, number):
    """Interrupt: the recorder writes its queue, which may take as long as the flight would."""
    bag = tmp_path / "bag"
    argv = ("fly", "--mission", "ares_v", "--json", "--in-process", "--pace", "200")
    argv = (*argv, "--bag", str(bag))
    process = subprocess.Popen(
        command(*argv), env=environment(domain, bags), stdout=subprocess.PIPE, text=True
    )
    wait_for_flight(bag)
    process.send_signal(number)
    out, _ = process.communicate(timeout=TIMEOUT)
    assert process.returncode == 130
    assert json.loads(out)["outcome"] == "interrupted"
    assert open_bag(bag).message_count > 0


@pytest.mark.parametrize("restarted", one_in(2, [True, False]))
def test_what_a_node_that_is_killed_has_in_shared_memory_goes_with_the_flight(
    domain, bags, tmp_path, restarted
):
    bag = tmp_path / "bag"
    argv = ("fly", "--mission", "ares_v", "--json", "--pace", "20", "--bag", str(bag))
    parent = subprocess.Popen(
        command(*argv),
        env=environment(domain, bags),
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
    )
    wait_for_flight(bag)
    guidance = next(
        pid
        for pid in children_of(parent.pid)
        if b"ares_guidance" in Path(f"/proc/{pid}/cmdline").read_bytes()
    )

    def segments(pid):
        names = {Path(path).name for path in shared_memory([pid])}
        return {name for name in names if name.startswith("fastrtps_") and "_port" not in name}

    # all have heard each other
    deadline = time.monotonic() + TIMEOUT
    while not (mapped := segments(guidance)) or not mapped <= segments(parent.pid):
        assert time.monotonic() < deadline
        time.sleep(0.05)
    os.kill(guidance, signal.SIGKILL)
    if restarted:
        time.sleep(1.0)
    parent.send_signal(signal.SIGINT)
    parent.communicate(timeout=TIMEOUT)
    # some may be of another process, which still has them
    assert not orphans(mapped)


@pytest.mark.parametrize("option", ["--in-process", "--json"])
def test_a_flight_shows_itself_on_a_terminal_and_nowhere_else(domain, tmp_path, option):
    """Make standard error a terminal: standard output is unchanged."""
    mission = tmp_path / "short.yaml"
    mission.write_text(yaml.safe_dump(short_burn()))
    terminal, end = pty.openpty()
    process = subprocess.Popen(
        command("fly", "--mission", str(mission), "--no-record", "--pace", "60", option),
        env={**environment(domain, tmp_path), "TERM": "xterm"},
        stdout=subprocess.PIPE,
        stderr=end,
    )
    os.close(end)
    shown = b""
    try:
        while True:
            shown += os.read(terminal, 65536)
    except OSError:
        # the other end is closed
        pass
    finally:
        os.close(terminal)
        out = process.communicate(timeout=TIMEOUT)[0].decode()
    assert process.returncode == 0, shown
    if option == "--json":
        # a busy machine may fall behind, which is said
        said = own_words(shown.decode()).splitlines()
        assert [line for line in said if "behind its pace" not in line] == []
        assert json.loads(out)["mission"] == "short_burn"
    else:
        assert b"altitude, km" in shown and b"kick stage" in shown
        assert "altitude" not in out and "\x1b" not in out
        assert "final mass" in out
