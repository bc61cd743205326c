# SPDX-License-Identifier: Apache-2.0
"""One table of causes, three ways to fly: equal exit statuses and messages.

`ros2 launch` is the real one where launch is installed; elsewhere `stand_ins/ros2` runs the
launch file, its processes are real.
"""

import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

import psutil
import pytest
import yaml

from ares_guidance.node import GuidanceNode
from ares_msgs.msg import FlightEvent
from ares_node.membership import Role
from ares_trials.testing.flights import short_burn
from ares_vehicle_sim.node import VehicleSimNode

FLY, IN_PROCESS, LAUNCH = "ares fly", "ares fly --in-process", "ros2 launch"
EVERY_WAY = (FLY, IN_PROCESS, LAUNCH)
PROCESSES = (FLY, LAUNCH)
ARES = (sys.executable, "-m", "ares_bringup")
#: Of a flight in processes of its own.
FIXTURES = ("graph", "ros2", "ros_environment")
#: A word in the command line of each node's process.
PROGRAMS = {
    "guidance": "ares_guidance",
    "vehicle_sim": "ares_vehicle_sim",
    "recorder": "ares_bags",
    "view": "ares_view",
    "judge": "ares_bringup/judge",
}
#: What the tests of the layout, of the faults and of `ares fly` hold too.
HELD_ELSEWHERE = {
    ("all is well", FLY),
    ("guidance killed", FLY),
    ("guidance killed and restarted", FLY),
    ("recorder killed", FLY),
    ("simulator killed", FLY),
    ("Ctrl-C", FLY),
    ("Ctrl-C", IN_PROCESS),
    ("guidance killed and restarted", LAUNCH),
    ("Ctrl-C", LAUNCH),
}
#: Wall time in s after which a flight counts as hanging.
PATIENCE = 120.0
SLOW = {"pace": "8", "nav_period": "0.5"}
#: Of a flight that does not come to its end: on a busy machine it is heard of late.
SLOWEST = {"pace": "2"}


@dataclass
class Flight:
    """Hold a flight under way."""

    process: psutil.Popen
    graph: object
    output: Path

    def until(self, condition):
        # one that has ended has an output that says why
        ended = self.process.poll
        self.graph.spin(lambda: condition() or ended() is not None, PATIENCE)

    def in_the_air(self):
        self.until(lambda: len(self.graph.states) > 5)

    def until_event(self, kind):
        self.until(lambda: kind in [event.type for event in self.graph.events])

    def until_said(self, text):
        self.until(lambda: text in self.output.read_text())

    def node(self, name):
        for child in self.process.children(recursive=True):
            with suppress(psutil.Error):
                if PROGRAMS[name] in " ".join(child.cmdline()):
                    return child
        return None

    def kill(self, name):
        self.in_the_air()
        self.node(name).kill()

    def kill_and_hurry(self, name, text):
        """Kill a node; when a text is said, fly the rest as fast as may be."""
        self.kill(name)
        self.until_said(text)
        self.hurry()

    def kill_guidance_for_good(self):
        self.kill("guidance")
        self.until_event(FlightEvent.GUIDANCE_LOST)
        self.until_said("not restarted")
        self.hurry()

    def kill_and_wait_for_its_successor(self):
        """Kill guidance and wait for its successor, the vehicle paused meanwhile."""
        members = self.graph.members

        def guides():
            """Return the guidances announced by simulators."""
            return {m.guidance_id for m in members if m.role == Role.VEHICLE_SIM} - {0}

        self.graph.spin(guides, PATIENCE)
        first = guides()
        self.kill("guidance")
        self.graph.set_parameter("vehicle_sim", "paused", True)
        self.graph.spin(lambda: guides() - first, PATIENCE)
        self.graph.set_parameter("vehicle_sim", "paused", False)
        self.until_event(FlightEvent.GUIDANCE_BACK)
        self.hurry()

    def hurry(self):
        self.graph.set_parameter("vehicle_sim", "pace", 0.0)

    def stop_until_it_is_missed(self, name):
        self.in_the_air()
        node = self.node(name)
        node.suspend()
        self.until_event(FlightEvent.GUIDANCE_LOST)
        node.resume()
        self.until_event(FlightEvent.GUIDANCE_BACK)
        self.hurry()

    def kill_before_the_start(self, name):
        while self.node(name) is None:
            time.sleep(0.005)
        node = self.node(name)
        node.suspend()
        # the others are past Python's own start, which no signal leaves without a traceback
        wanted = {Role.VEHICLE_SIM, Role.RECORDER, Role.JUDGE}
        self.graph.spin(lambda: wanted <= {member.role for member in self.graph.members}, PATIENCE)
        names = self.graph.observer.get_node_names
        self.graph.spin(lambda: "view" in names() or self.node("view") is None, PATIENCE)
        node.kill()

    def signal(self, number):
        self.in_the_air()
        self.process.send_signal(number)

    def join(self, kind, report):
        self.in_the_air()
        self.graph.start(kind, mission=self.graph.mission)
        self.graph.wait_for_report(report)
        self.hurry()


@dataclass(frozen=True)
class Cause:
    """Hold the cause of a flight's end.

    Attributes:
        status: exit status.
        says: texts required in the output.
        options: by the names of launch arguments; `--name-with-dashes` for `ares fly`.
        mission: content of the mission file.
        act: acts on the flight; None: nothing.
        ways: applicable ways to fly.
        bag: whether a bag is left.
        alike: another cause ends in the same way: `make trials` flies it in every way, `make test`
            in the cheapest.
    """

    status: int
    says: tuple[str, ...] = ()
    options: dict[str, str] = field(default_factory=dict)
    mission: dict = field(default_factory=short_burn)
    act: Callable[[Flight], None] | None = None
    ways: tuple[str, ...] = EVERY_WAY
    bag: bool = True
    alike: bool = False

    @property
    def cheapest(self):
        return IN_PROCESS if IN_PROCESS in self.ways else self.ways[0]


def refused(says, *, alike=True, **options):
    return Cause(2, (says,), options, bag=False, alike=alike)


def two_burns(**changes):
    """Divide the short burn into two, with a free coast between."""
    mission = short_burn(**changes)
    stage = mission["stages"][0]
    burn = {name: stage.pop(name) for name in ("thrust_n", "isp_s", "burn_time_s")}
    stage["arcs"] = [burn, {"coast_s": "free", "max_s": 600.0}, dict(burn)]
    return mission


CAUSES = {
    "all is well": Cause(0, ("main-engine cut-off",)),
    "no such mission": refused("no such mission", mission="nonsense"),
    "a broken mission file": Cause(
        2, ("target",), mission=short_burn(target={}), act=None, bag=False, alike=True
    ),
    "no such law": refused("one of", alike=False, guidance="nonsense"),
    "no such dispersions": refused("no such dispersions", dispersions="nonsense"),
    "no such failure": refused("failure", failure="nonsense:time=1"),
    "a failure of what is not there": refused("jettison", failure="stuck_jettison:jettison=3"),
    "a bag that exists": refused("exists; expected a new folder", bag="{tmp}"),
    "a bag below a file": refused("cannot be created", bag="{tmp}/mission.yaml/bag"),
    "a pace that is no number": refused("pace", pace="fast"),
    "a negative pace": refused("pace", pace="-1"),
    "a negative seed": refused("seed", seed="-1"),
    "no such initial guess": refused("one of", initial_guess="nonsense"),
    "no such namespace": refused("must not have a token that starts", namespace="1bad"),
    "no such domain": refused("domain", domain_id="400"),
    "propellant short": Cause(
        1,
        ("target missed: speed off by -",),
        mission=short_burn(**{"stages.0.propellant_kg": 450.0}),
        alike=True,
    ),
    "a cover that stays on": Cause(
        1,
        ("cover was not jettisoned",),
        mission=short_burn(**{"jettisons.0.heating_limit_w_m2": 1e-6}),
        alike=True,
    ),
    "a cover that is stuck": Cause(
        1,
        ("cover was not jettisoned",),
        {"failure": "stuck_jettison:jettison=0"},
        alike=True,
    ),
    "impact": Cause(
        1,
        ("the vehicle met the ground",),
        mission=short_burn(
            **{
                # 100 m below the start
                "environment.earth.equatorial_radius_m": 6578037.0,
                "initial_state.velocity_m_s": [-40.0, 6680.0, 3626.0],
            }
        ),
        alike=True,
    ),
    "a target out of reach": Cause(
        2,
        ("finds no steering from the start of the mission to its target",),
        mission=short_burn(**{"target.radius_m": 7.4e6}),
        bag=False,
        alike=True,
    ),
    "no plan": Cause(
        2,
        (
            "no plan was found: ",
            "law peg needs one for what the mission leaves free, arc 0 (",
            "another method of `ares optimize`",
        ),
        mission=two_burns(**{"stages.0.propellant_kg": 450.0}),
        bag=False,
        alike=True,
    ),
    "no plan for a paced flight": Cause(
        2,
        ("law optimal needs one for what the mission leaves free, arc 0 (",),
        {"guidance": "optimal", "pace": "1"},
        mission=two_burns(**{"stages.0.propellant_kg": 450.0}),
        ways=PROCESSES,
        bag=False,
        alike=True,
    ),
    "a law that flies no plan": Cause(
        2,
        ("law is 'peg_thesis'; expected peg, igm or optimal, which fly arcs before the last",),
        {"guidance": "peg_thesis"},
        mission=two_burns(),
        bag=False,
        alike=True,
    ),
    "a missed target": Cause(
        1,
        ("target missed: flight-path angle off by ",),
        # a climb that takes all there is, and more
        mission=short_burn(119.4, **{"target.flight_path_angle_deg": 1.0}),
        alike=True,
    ),
    "Ctrl-C": Cause(130, ("interrupted",), SLOWEST, act=lambda f: f.signal(signal.SIGINT)),
    "SIGTERM": Cause(130, (), SLOWEST, act=lambda f: f.signal(signal.SIGTERM), alike=True),
    "a second guidance": Cause(
        0,
        ("a second guidance",),
        SLOW,
        act=lambda f: f.join(GuidanceNode, "a second guidance"),
        alike=True,
    ),
    "a second simulator": Cause(
        0,
        ("another simulator",),
        SLOW,
        act=lambda f: f.join(VehicleSimNode, "another simulator"),
        alike=True,
    ),
    "guidance killed": Cause(
        1,
        (
            "flown without an answer from guidance",
            "guidance was killed by SIGKILL in flight",
            "not restarted: 0 restarts were allowed",
        ),
        {**SLOW, "restarts": "0"},
        act=lambda f: f.kill_guidance_for_good(),
        ways=PROCESSES,
        alike=True,
    ),
    "guidance killed and restarted": Cause(
        1,
        (
            "flown without an answer from guidance",
            "guidance was killed by SIGKILL in flight",
            "restarted (1 of 3)",
            "takes over from lost guidance",
            "guidance answers again",
            "main-engine cut-off",
        ),
        SLOW,
        mission=short_burn(330.0),
        act=lambda f: f.kill_and_wait_for_its_successor(),
        ways=PROCESSES,
    ),
    "restarts that are no number": refused("restarts", restarts="many"),
    "guidance stopped for a while": Cause(
        1,
        ("flown without an answer from guidance", "guidance answers again"),
        SLOW,
        act=lambda f: f.stop_until_it_is_missed("guidance"),
        ways=PROCESSES,
        alike=True,
    ),
    "recorder killed": Cause(
        1,
        ("recorder was killed by SIGKILL in flight: the bag is incomplete",),
        SLOW,
        act=lambda f: f.kill_and_hurry("recorder", "recorder was killed"),
        ways=PROCESSES,
        alike=True,
    ),
    "view killed": Cause(
        0,
        (
            (
                "view was killed by SIGKILL: no standard messages any more (RViz, Foxglove, maps); "
                "restarted (1 of 3)"
            ),
            "main-engine cut-off",
        ),
        {**SLOW, "view": "true"},
        act=lambda f: f.kill_and_hurry("view", "restarted (1 of 3)"),
        ways=PROCESSES,
        alike=True,
    ),
    "simulator killed": Cause(
        1,
        ("vehicle_sim was killed by SIGKILL in flight", "did not come to its end"),
        SLOWEST,
        act=lambda f: f.kill("vehicle_sim"),
        ways=PROCESSES,
        alike=True,
    ),
    "judge killed": Cause(
        1,
        ("judge was killed by SIGKILL: the flight ends without its verdict",),
        SLOWEST,
        act=lambda f: f.kill("judge"),
        ways=(LAUNCH,),
    ),
    "whoever has started the nodes killed": Cause(
        -signal.SIGKILL,
        options=SLOWEST,
        act=lambda f: f.signal(signal.SIGKILL),
        ways=PROCESSES,
    ),
    "guidance killed before the start": Cause(
        2,
        ("guidance was killed by SIGKILL",),
        act=lambda f: f.kill_before_the_start("guidance"),
        ways=PROCESSES,
        bag=False,
        alike=True,
    ),
}


@pytest.mark.parametrize(
    ("name", "way"),
    [
        pytest.param(
            name,
            way,
            id=f"{name}-{way}".replace(" ", "-"),
            marks=[pytest.mark.trial]
            if (name, way) in HELD_ELSEWHERE or (cause.alike and way != cause.cheapest)
            else [],
        )
        for name, cause in CAUSES.items()
        for way in cause.ways
    ],
)
def test_the_verdict_is_the_same_whoever_starts_the_flight(request, tmp_path, name, way):
    cause = CAUSES[name]
    mission = tmp_path / "mission.yaml"
    mission.write_text(yaml.safe_dump(cause.mission))
    options = {"mission": str(mission), "bag": str(tmp_path / "bag")}
    options |= {key: value.format(tmp=tmp_path) for key, value in cause.options.items()}
    if cause.act is None and way != LAUNCH:
        done = request.getfixturevalue("ares")(*words(way, options))
        status, said = done.returncode, done.stdout + done.stderr
    else:
        graph, ros2, environment = map(request.getfixturevalue, FIXTURES)
        graph.mission = options["mission"]
        started = [*ros2, *words(way, options)] if way == LAUNCH else [*ARES, *words(way, options)]
        status, said = run(started, cause.act, graph, environment, tmp_path)
    assert status == cause.status, said
    for expected in cause.says:
        assert expected in said
    assert "Traceback" not in said
    assert "did not end within" not in said
    assert all_gone(tmp_path), said
    assert (tmp_path / "bag").exists() == cause.bag, said


def words(way, options):
    """Return the words of a command line after `ares` or `ros2`."""
    if way == LAUNCH:
        given = [f"{name}:={value}" for name, value in options.items()]
        return ["launch", "ares_bringup", "flight.launch.py", *given]
    given = [
        word
        for name, value in options.items()
        for word in (f"--{dashed(name)}", value)
        if word != "true"
    ]
    return ["fly", *(["--in-process"] if way == IN_PROCESS else []), *given]


def dashed(name):
    return name.replace("_", "-")


def run(command, act, graph, environment, folder):
    """Run a process and act on it; return its exit status and output."""
    with (folder / "output").open("w") as output:
        process = psutil.Popen(
            command,
            env={**environment, "ROS_LOG_DIR": str(folder / "log"), "COLUMNS": "200"},
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=output,
            cwd=folder,
        )
    try:
        if act is not None:
            act(Flight(process, graph, folder / "output"))
        status = wait(process, graph)
    finally:
        for child in [process, *process.children(recursive=True)] if process.is_running() else ():
            child.kill()
    return status, (folder / "output").read_text()


def all_gone(folder):
    """Wait until no process of the flight is left: `ros2 launch` may die before its nodes."""

    def left():
        return [one.pid for one in psutil.process_iter() if str(folder) in words_of(one)]

    deadline = time.monotonic() + PATIENCE
    while left() and time.monotonic() < deadline:
        time.sleep(0.05)
    return not left()


def words_of(process):
    with suppress(psutil.Error):
        return " ".join(process.cmdline())
    return ""


def wait(process, graph):
    """Spin nodes of the test until a process ends; return its exit status."""
    deadline = time.monotonic() + PATIENCE
    while process.poll() is None:
        assert time.monotonic() < deadline, "hangs"
        graph.executor.spin_once(timeout_sec=0.02)
    return process.returncode


def test_the_table_has_causes_enough():
    assert len(CAUSES) >= 20
