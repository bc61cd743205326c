# SPDX-License-Identifier: Apache-2.0
"""Fixtures of the tests that cross packages."""

import fcntl
import os
import shutil
import socket
import sys
from collections.abc import Callable
from contextlib import ExitStack, contextmanager, redirect_stdout
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.srv import SetParameters
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter

import preparation.browser
from ares_bringup import progress
from ares_bringup.commands.cli import main
from ares_bringup.discovery import discovery_settings
from ares_msgs.msg import FlightEvent, FlightMember, NavState
from ares_node.heartbeat import is_heartbeat
from ares_node.node import FlightNode
from ares_node.qos import EVENTS, FLIGHT, FLIGHT_MEMBER, MEMBERS, reliable
from ares_thesis.commands.reproduce import PAGE
from ares_trials.testing.pages import FIGURES, SIZES, illegible
from ares_trials.testing.ros import own_words, ros_context, ros_domain, ros_environment, spin_until

__all__ = ["graph", "ros_context", "ros_domain", "ros_environment"]

DIAGNOSTICS = reliable(1000)

ROOT = Path(__file__).parent.parent
REFERENCE = ROOT / "bags" / "reference"
BROWSER_FLAGS = [
    *("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
]


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the long ones."""
    items.sort(key=lambda item: item.get_closest_marker("long") is None)


class Graph:
    """Hold nodes of one test on one executor, and an observer of their messages."""

    def __init__(self, context, stack):
        self.context = context
        self.executor = EventsExecutor(context=context)
        self._stack = stack
        stack.callback(self.executor.shutdown)
        self.observer = self.add(Node("observer", namespace="ares", context=context))
        self.reports: list[str] = []
        self.heartbeats: list[str] = []
        self.events: list[FlightEvent] = []
        self.states: list[NavState] = []
        self.members: list[FlightMember] = []
        self.observer.create_subscription(
            DiagnosticArray, "/diagnostics", self._on_report, DIAGNOSTICS
        )
        self.observer.create_subscription(FlightEvent, "flight_event", self.events.append, EVENTS)
        self.observer.create_subscription(NavState, "nav_state", self.states.append, FLIGHT)
        self.observer.create_subscription(FlightMember, FLIGHT_MEMBER, self.members.append, MEMBERS)

    def _on_report(self, message):
        for status in message.status:
            line = f"{status.name}: {status.message}"
            (self.heartbeats if is_heartbeat(status) else self.reports).append(line)

    def add(self, node):
        self._stack.callback(node.destroy_node)
        if isinstance(node, FlightNode):
            self._stack.callback(node.stop)
        self.executor.add_node(node)
        return node

    def start(self, kind: type[FlightNode], **parameters):
        overrides = [Parameter(name, value=value) for name, value in parameters.items()]
        node = self.add(kind(context=self.context, parameter_overrides=overrides))
        assert node.start(), node.failure
        return node

    def spin(self, condition: Callable[[], bool], timeout=240.0):
        assert spin_until(self.executor, condition, timeout), self.reports

    def reported(self, text: str) -> bool:
        return any(text in report for report in self.reports)

    def wait_for_report(self, text: str):
        self.spin(lambda: self.reported(text))

    def set_parameter(self, node: str, key: str, value: object):
        """Set a parameter of a node in another process."""
        client = self.observer.create_client(SetParameters, f"/ares/{node}/set_parameters")
        self.spin(client.service_is_ready)
        parameter = Parameter(key, value=value).to_parameter_msg()
        answer = client.call_async(SetParameters.Request(parameters=[parameter]))
        self.spin(answer.done)
        assert answer.result().results[0].successful


class Done(NamedTuple):
    """Hold the result of a command, as `subprocess.run` returns it."""

    returncode: int
    stdout: str
    stderr: str


@pytest.fixture(autouse=True)
def no_progress_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    """Keep the lines of searches that take long on a busy machine from standard error."""
    monkeypatch.setattr(progress, "FIRST_LINE_S", 3600.0)


@pytest.fixture
def ares(
    ros_domain: int, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> Callable[..., Done]:
    """Run `ares WORD ...` in this process, on the domain of the test.

    For verbs of a single process, whose start would take longer than their work.
    """
    monkeypatch.setenv("ROS_DOMAIN_ID", str(ros_domain))
    for name, value in discovery_settings().items():
        # the command sets them, which would affect later tests
        monkeypatch.setenv(name, value)

    def run(*words: str) -> Done:
        capfd.readouterr()
        status = main(words)
        out, err = capfd.readouterr()
        return Done(status, out, own_words(err))

    return run


@pytest.fixture(scope="session")
def ros2() -> list[str]:
    """Return the `ros2` command, or the stand-in for its verb `launch`."""
    found = shutil.which("ros2")
    stand_in = Path(__file__).parent / "stand_ins" / "ros2"
    return [found] if found else [sys.executable, str(stand_in)]


@pytest.fixture
def graph(ros_context):
    with ExitStack() as stack:
        yield Graph(ros_context, stack)


@pytest.fixture
def free_port() -> int:
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return int(listener.getsockname()[1])


def find_browser() -> str:
    found = preparation.browser.find_browser(os.environ)
    assert found, preparation.browser.NO_BROWSER
    return found


@pytest.fixture(scope="module")
def browser():
    from playwright.sync_api import sync_playwright

    with sync_playwright() as play:
        opened = play.chromium.launch(executable_path=find_browser(), args=BROWSER_FLAGS)
        yield opened
        opened.close()


@pytest.fixture(scope="session")
def serious_faults() -> Callable[[Any], list[str]]:
    """Return a function that lists the serious faults axe-core finds on a page."""
    from axe_playwright_python.sync_playwright import Axe

    def find(page: Any) -> list[str]:
        return [
            f"{fault['id']}: {fault['nodes'][0]['html']}"
            for fault in Axe().run(page).response["violations"]
            if fault["impact"] in {"serious", "critical"}
        ]

    return find


@pytest.fixture(scope="session")
def check_page(serious_faults) -> Callable[[Any, str], None]:
    """Return a function that asserts that a page is legible and has no serious fault."""

    def check(page: Any, size: str) -> None:
        assert illegible(page, size) == []
        figures = page.evaluate(FIGURES)
        assert figures
        assert all(figure["height"] > 250 for figure in figures)
        if size == "narrow":
            assert serious_faults(page) == []

    return check


#: What a browser says of its own affairs: a driver without a graphics card how long it took, the
#: plotting library that room for the ticks and number of ticks have not settled at once.
HARMLESS = ("[.WebGL-", "WARN: Too many auto-margin redraws")


def _note(complaints: list[str], text: str) -> None:
    if not text.startswith(HARMLESS):
        complaints.append(text)


@contextmanager
def opening(browser):
    """Yield a function that opens a page without network; then assert that nothing went wrong."""
    complaints = []
    contexts = []

    def opener(path: Path, size: str, theme: str, **settings):
        width, height = SIZES[size]
        context = browser.new_context(
            viewport={"width": width, "height": height},
            color_scheme=theme,
            offline=True,
            **settings,
        )
        contexts.append(context)
        page = context.new_page()
        page.on("console", lambda message: _note(complaints, message.text))
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on(
            "request",
            lambda request: request.url.startswith("file://") or complaints.append(request.url),
        )
        page.goto(path.as_uri())
        page.wait_for_function("document.documentElement.dataset.drawn", timeout=240_000)
        return page

    yield opener
    for context in contexts:
        context.close()
    assert not complaints


@pytest.fixture
def open_file(browser):
    """Open a page that the test may change."""
    with opening(browser) as opener:
        yield opener


@pytest.fixture(scope="module")
def read_file(browser):
    """Open a page once for all tests of a module that leave it as the others need it."""
    with opening(browser) as opener:
        yield cache(opener)


# ---- pages, each made once for all workers


@pytest.fixture(scope="session")
def once(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str, Callable[[Path], None]], Path]:
    """Return a function that fills a folder of a name, unless another worker has filled it."""
    top = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        top = top.parent

    def fill(name: str, make: Callable[[Path], None]) -> Path:
        folder, done = top / f"shared-{name}", top / f"shared-{name}.done"
        with (top / f"shared-{name}.lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not done.exists():
                shutil.rmtree(folder, ignore_errors=True)
                folder.mkdir()
                make(folder)
                done.touch()
        return folder

    return fill


@pytest.fixture(scope="session")
def page_of_one(once) -> Path:
    """Run `ares report` on the reference flight."""

    def make(folder: Path) -> None:
        assert main(["report", str(REFERENCE), "--out", str(folder / "flight.html")]) == 0

    return once("one", make) / "flight.html"


@pytest.fixture(scope="session")
def from_the_pad(once) -> Path:
    """Fly what `ares fly` flies by default; return a folder with the bag and what is printed."""

    def make(folder: Path) -> None:
        words = ["fly", "--in-process", "--nav-period", "0.5", "--bag", str(folder / "bag")]
        with (folder / "printed").open("w") as out, redirect_stdout(out):
            assert main(words) == 0

    return once("from the pad", make)


@pytest.fixture(scope="session")
def dispersed(once) -> Path:
    """Fly with navigation errors; return the bag."""

    def make(folder: Path) -> None:
        errors = folder / "errors.yaml"
        errors.write_text("thrust: 0.01\nnavigation:\n  position_bias_m: 30.0\n")
        words = [
            "fly",
            "--mission",
            "ares_v",
            "--in-process",
            "--nav-period",
            "1",
            "--dispersions",
            str(errors),
        ]
        assert main([*words, "--seed", "3", "--bag", str(folder / "dispersed")]) in (0, 1)

    return once("flown", make) / "dispersed"


@pytest.fixture(scope="session")
def page_of_two(once, dispersed: Path) -> Path:
    """Run `ares report` on both flights."""

    def make(folder: Path) -> None:
        out = str(folder / "flights.html")
        assert main(["report", str(REFERENCE), str(dispersed), "--out", out]) == 0

    return once("two", make) / "flights.html"


@pytest.fixture(scope="session")
def page_of_many(once) -> Path:
    """Fly a campaign of 120 flights, some of which fail: the fairing stays on, or they run dry."""

    def make(folder: Path) -> None:
        dispersions = folder / "weak.yaml"
        dispersions.write_text("thrust: 0.03\nlog_density: {mean: 0.0, sigma: 1.5}\n")
        words = ("-n", "120", "--dispersions", str(dispersions), "--out", str(folder / "c"))
        assert main(("montecarlo", "--json", *words)) == 0

    return once("campaign", make) / "c" / "report.html"


@pytest.fixture(scope="session")
def page_of_map(once) -> Path:
    """Make an abort map."""

    def make(folder: Path) -> None:
        words = ("--mission", "ares_v", "--step-s", "160", "--out", str(folder / "map.html"))
        assert main(("aborts", *words)) == 0

    return once("aborts", make) / "map.html"


@pytest.fixture(scope="session")
def reproduction(once) -> Path:
    """Run `ares reproduce`; return its folder."""

    def make(folder: Path) -> None:
        assert main(["reproduce", "--out", str(folder)]) == 0

    return once("reproduction", make)


@pytest.fixture(scope="session")
def page_of_thesis(reproduction: Path) -> Path:
    """Return the page in that folder."""
    return reproduction / PAGE
