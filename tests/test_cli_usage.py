# SPDX-License-Identifier: Apache-2.0
"""The command line: help, and one clear line for each refusal."""

import importlib.util
import json
import os
import re
import subprocess
import sys
from inspect import signature
from pathlib import Path

import pytest
import yaml

from ares_bringup import __version__, parameter_tables
from ares_bringup.commands.cli import main
from ares_bringup.parameter_tables import known, offered, tables
from ares_bringup.verbs.app import with_settings
from ares_guidance.laws import self_starting_laws
from ares_guidance.registry import law_names
from ares_node.parameters import Parameter
from ares_trials.testing.flights import short_burn
from ares_trials.testing.ros import own_words
from ares_vehicle_sim import node as simulator


def run(capfd, *argv):
    status = main(argv)
    out, err = capfd.readouterr()
    return status, out, own_words(err)


def one_line(text):
    assert text.count("\n") == 1
    assert text.endswith("\n")
    assert "Traceback" not in text
    return text


def test_help_lists_everything(capfd):
    status, out, err = run(capfd, "--help")
    assert (status, err) == (0, "")
    for verb in (
        "fly",
        "missions",
        "dispersions",
        "bag",
        "replay",
        "report",
        "export",
        "node",
        "info, verify, repair",
    ):
        assert re.search(rf"\b{verb}\b", out)
    assert "Exit status" in out
    assert max(len(line) for line in out.splitlines()) <= 80


def test_the_page_of_the_command_has_every_verb(capfd):
    page = (Path(__file__).parent.parent / "src" / "ares_bringup" / "README.md").read_text()
    _, out, _ = run(capfd, "--help")
    verbs = re.findall(r"^  ([a-z]+) ", out.partition("Commands:")[2], re.MULTILINE)
    assert [verb for verb in verbs if f"`ares {verb}" not in page] == []


@pytest.mark.parametrize(
    "verb",
    [
        ["fly"],
        ["missions"],
        ["missions", "list"],
        ["missions", "new"],
        ["missions", "schema"],
        ["dispersions"],
        ["dispersions", "list"],
        ["dispersions", "new"],
        ["dispersions", "schema"],
        ["bag"],
        ["bag", "info"],
        ["bag", "verify"],
        ["bag", "repair"],
        ["replay"],
        ["report"],
        ["export"],
        ["node"],
    ],
)
def test_every_verb_has_help(capfd, verb):
    status, out, _ = run(capfd, *verb, "--help")
    assert status == 0
    assert out.startswith(f"Usage: ares {' '.join(verb)}")


def usage_writer():
    path = Path(__file__).parent.parent / "tools" / "usage.py"
    spec = importlib.util.spec_from_file_location("usage_writer", path)
    writer = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(writer)
    return writer


def test_what_is_made_of_the_tables_of_the_nodes_and_of_the_verbs_is_current():
    for path, text in usage_writer().made():
        assert path.read_text(encoding="utf-8") == text, f"{path}: make usage writes it anew"


def test_a_parameter_of_the_simulator_is_one_row_of_its_table(monkeypatch, tmp_path):
    row = Parameter("slack_s", 2.5, "Slack of the clock.", unit="s", minimum=0.0, option="slack")
    monkeypatch.setattr(simulator, "PARAMETERS", (*simulator.PARAMETERS, row))
    writer, table = usage_writer(), tmp_path / "parameters.json"
    table.write_text(writer.as_json())
    monkeypatch.setattr(parameter_tables, "TABLES", table)
    tables.cache_clear()
    try:
        assert offered()["slack"] == row
        assert known("vehicle_sim", {"slack_s": 1.0}) == {"slack_s": 1.0}
        took = {}
        verb = with_settings()(lambda **settings: took.update(settings))
        assert signature(verb).parameters["slack"].default is None
        verb(**dict.fromkeys(signature(verb).parameters) | {"slack": 1.0})
        assert took == {"slack_s": 1.0}
    finally:
        tables.cache_clear()
    assert "    slack_s: 2.5" in writer.parameter_file()
    assert "| `slack_s` | 2.5 |" in writer.parameter_table("vehicle_sim")


def test_laws_are_offered_where_they_can_start(capfd):
    for verb, laws in (
        ("fly", law_names()),
        ("montecarlo", self_starting_laws()),
        ("aborts", self_starting_laws()),
    ):
        _, out, _ = run(capfd, verb, "--help")
        offered = re.search(r"Guidance law: ([a-z_, ]+), or one", " ".join(out.split()))[1]
        assert offered.split(", ") == laws


def test_fly_documents_its_exit_statuses(capfd):
    _, out, _ = run(capfd, "fly", "--help")
    for status in ("  0  ", "  1  ", "  2  ", "  130  "):
        assert status in out


def test_version(capfd):
    assert run(capfd, "--version") == (0, f"ares {__version__}\n", "")


@pytest.mark.parametrize(
    ("argv", "words"),
    [
        ([], "Missing command"),
        (["fli"], "'fli'"),
        (["fly", "--sed", "3"], "--sed"),
        (["fly", "--seed", "x"], "--seed"),
        (["fly", "--seed", "-1"], "--seed"),
        (["fly", "--pace", "-1"], "--pace"),
        (["fly", "--guidance", "thrust_only"], "thrust_only"),
        (["fly", "--domain-id", "300"], "--domain-id"),
        (["fly", "--seed", str(2**63)], "--seed"),
        (["fly", "--flight", str(10**8)], "--flight"),
        (["fly", "--nav-period", "1e-320"], "--nav-period is '1e-320'; expected at least 0.001"),
        (["fly", "--hold-time", "1e308"], "--hold-time is '1e308'; expected at most 120"),
        (["fly", "--pace", "1e-320"], "parameter pace is 1e-320; expected 0, or 0.001 up"),
        (["fly", "--pace", "1e308"], "--pace is '1e308'; expected at most 1e+06"),
        (["montecarlo", "--seed", str(2**64)], "--seed"),
        (["montecarlo", "-n", str(10**23)], "--flights"),
        (["montecarlo", "--only", str(10**23)], "--only"),
        (["montecarlo", "--hold-time", "nan"], "--hold-time is 'nan'; expected at most 120"),
        (["optimize", "--hold-jettison", "payload fairing=1e308"], "expected a time of the flight"),
        (["optimize", "--hold-jettison", "payload fairing=nan"], "155.9 to 1301.79 s"),
        (["optimize", "--mission", "/dev/zero"], "/dev/zero: is a device or a pipe"),
        (["missions", "x" * 5000], "no such mission"),
        (["missions", "x/" * 5000], "cannot be read: File name too long"),
        (["fly", "extra"], "extra"),
        (["fly", "--bag", "b", "--no-record"], "--bag and --no-record"),
        (["fly", "--bag", "/", "--in-process"], "--bag is '/', which exists"),
        (["fly", "--mission", "nowhere"], "nowhere"),
        (["fly", "--mission", "/nowhere.yaml"], "/nowhere.yaml"),
        (["missions", "nowhere"], "nowhere"),
        (["bag"], "Missing command"),
        (["bag", "info", "/nowhere"], "bag /nowhere does not exist"),
        (["bag", "verify", "/nowhere"], "bag /nowhere does not exist"),
        (["bag", "repair", "/nowhere"], "bag /nowhere does not exist"),
        (["replay", "/nowhere"], "bag /nowhere does not exist"),
        (["node", "rocket"], "rocket"),
    ],
)
def test_bad_input_is_one_line_and_status_2(capfd, argv, words):
    if argv[:1] == ["fly"] and "--bag" not in argv:
        # a node that refuses its parameters says so in this process
        argv = [*argv, "--in-process", "--no-record"]
    status, out, err = run(capfd, *argv)
    assert status == 2
    assert out == ""
    assert words in one_line(err)


def test_a_bad_domain_in_the_environment(capfd, monkeypatch):
    monkeypatch.setenv("ROS_DOMAIN_ID", "many")
    status, _, err = run(capfd, "fly")
    assert status == 2
    assert "ROS_DOMAIN_ID is 'many'" in one_line(err)


def test_missions_are_listed_and_valid(capfd):
    status, out, err = run(capfd, "missions")
    assert (status, err) == (0, "")
    for name in ("ares_v", "ares_v_transients", "delta_iii", "saturn_v_as506"):
        assert re.search(rf"^{name}\s+valid", out, re.MULTILINE)
    assert max(len(line) for line in out.splitlines()) <= 80


def test_a_wrong_mission_file_is_named_and_the_others_are_shown(capfd, tmp_path):
    wrong = tmp_path / "wrong.yaml"
    wrong.write_text("name: wrong\nstages: []\n")
    status, out, err = run(capfd, "missions", str(wrong), "delta_iii")
    assert status == 2
    assert str(wrong) in one_line(err)
    assert "delta_iii" in out


def test_the_command_starts_fast_and_without_ros():
    program = (
        "import sys, ares_bringup.commands.cli;"
        "heavy = {'rclpy', 'numba', 'numpy', 'scipy', 'rich'} & set(sys.modules);"
        "assert not heavy, heavy"
    )
    subprocess.run([sys.executable, "-c", program], check=True)


def test_a_plain_flight_loads_no_scipy():
    # as if it were not installed, which it is not before something is solved or drawn
    program = (
        "import sys; sys.modules['scipy'] = None;"
        "from ares_studies.warm_up import fly_once; fly_once('peg'); fly_once('igm');"
        "import ares_vehicle_sim.node, ares_guidance.node, ares_bags.recorder, ares_bringup.judge"
    )
    subprocess.run([sys.executable, "-c", program], check=True)


def test_node_becomes_the_node(ros_environment):
    done = subprocess.run(
        [sys.executable, "-m", "ares_bringup", "node", "sim", "--ros-args", "-p", "pace:=fast"],
        env=ros_environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert "parameter pace is 'fast'" in one_line(own_words(done.stderr))


@pytest.mark.trial
def test_a_reader_that_goes_away_is_no_traceback():
    command = f"{sys.executable} -m ares_bringup missions | true"
    done = subprocess.run(
        command, shell=True, env=dict(os.environ), capture_output=True, text=True, check=False
    )
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("unbuffered", ["", "1"])
@pytest.mark.parametrize("verb", ["missions ares_v", "fly --help", "--version"])
def test_a_full_disk_behind_the_output_is_one_line(verb, unbuffered):
    done = in_shell(f"{verb} > /dev/full", PYTHONUNBUFFERED=unbuffered)
    assert done.returncode == 1
    said = "ares: standard output cannot be written: No space left on device\n"
    assert done.stderr == said


@pytest.mark.parametrize(
    "streams",
    ["<&- >&- 2>&-", *(pytest.param(s, marks=pytest.mark.trial) for s in (">&-", "2>&-", "<&-"))],
)
def test_closed_streams_change_nothing(streams, tmp_path):
    # a file that is opened must not get the number of a stream
    assert in_shell(f"missions schema --out {tmp_path / 'a'} {streams}").returncode == 0
    assert in_shell(f"missions ares_v {streams}").returncode == 0


@pytest.mark.parametrize(
    ("layout", "errors"),
    [
        ("--in-process", "2>&-"),
        ("--in-process", "2> /dev/full"),
        pytest.param("", "2>&-", marks=pytest.mark.trial),
        pytest.param("", "2> /dev/full", marks=pytest.mark.trial),
    ],
)
def test_a_flight_goes_on_though_nobody_reads_its_warnings(ros_domain, tmp_path, errors, layout):
    (tmp_path / "m.yaml").write_text(yaml.safe_dump(short_burn()))
    failure = "--failure engine_out:time=1e6,thrust_ratio=0.5"
    done = in_shell(
        f"fly {layout} --no-record --mission {tmp_path / 'm.yaml'} {failure} --json {errors}",
        ROS_DOMAIN_ID=str(ros_domain),
    )
    assert done.returncode == 0
    flight = json.loads(done.stdout)
    assert flight["outcome"] == "target"
    assert flight["diagnostic_count"] >= 1


def in_shell(words, **environment):
    return subprocess.run(
        f"{sys.executable} -m ares_bringup {words}",
        shell=True,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.parametrize("verb", ["fly", "optimize", "montecarlo", "aborts"])
def test_a_mission_without_its_option_is_asked_for(capfd, verb):
    status, out, err = run(capfd, verb, "my.yaml")
    assert (status, out) == (2, "")
    assert "(my.yaml); did you mean --mission my.yaml? (see" in one_line(err)


def test_of_two_words_too_many_none_is_called_a_mission(capfd):
    assert "did you mean" not in run(capfd, "fly", "a.yaml", "b.yaml")[2]
