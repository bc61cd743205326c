# SPDX-License-Identifier: Apache-2.0
"""The live page in a browser, beside flights of `ares fly --live`."""

import json
import os
import pty
import re
import signal
import subprocess
import sys
import threading
import time
from contextlib import ExitStack, contextmanager, suppress

import psutil
import pytest
import yaml

from ares_bags.compare import differences
from ares_bags.reader import open_bag
from ares_bringup.recorded import read_flight
from ares_trials.testing.flights import short_burn
from ares_trials.testing.pages import FIGURES, SIZES, THEMES, illegible
from ares_view.live.address import listen

#: A flight of minutes, which a slow browser sees; the tests hurry it in the end.
SLOWLY = ("--pace", "1", "--nav-period", "0.25")
#: Wall time in ms for a page to do what is awaited, on a busy machine too.
PATIENCE_MS = 150_000
#: What the page calls what it sees.
STATE = "document.documentElement.dataset.state"
#: Charts whose drawing has come to the last state.
DRAWN = """() => plots.filter((plot) => plot.checkVisibility()).every((plot) => plot.data
  && plot.data[0].x.at(-1) >= (live.states.last("time_s") - 5))"""
SEEN_PLOTS = "plots.filter((plot) => plot.checkVisibility())"
#: Charts that are drawn without a line: those of a series of fewer than two points.
BARE = """() => plots.filter((plot) => plot.data
  && plot.data.every(({ y }) => y.filter((one) => one !== null).length < 2)).length"""
#: Names of the gauges that are seen.
GAUGES = "gauges.filter((one) => one.checkVisibility()).map((one) => one.dataset.key)"
#: Names of controls, figures and landmarks that a reader of screens is told.
NAMELESS = """() => [...document.querySelectorAll(
    "button, input, canvas, section, [role=img], [role=group]")]
  .filter((e) => !(e.getAttribute("aria-label") || e.textContent.trim()
    || e.labels && e.labels.length
    || document.getElementById(e.getAttribute("aria-labelledby"))))
  .map((e) => e.outerHTML.slice(0, 80))"""


class Command:
    """Run `ares fly --live` as a process; its page is served when the constructor returns."""

    def __init__(self, environment, *words, terminal=None):
        self.process = subprocess.Popen(
            [sys.executable, "-P", "-m", "ares_bringup", *words],
            stdout=subprocess.PIPE,
            stderr=terminal or subprocess.PIPE,
            text=True,
            env=environment,
        )
        self.lines = []
        if terminal is None:
            self.reading = threading.Thread(target=self._read, daemon=True)
            self.reading.start()

    def _read(self):
        for line in self.process.stderr:
            self.lines.append(line)

    def wait_for(self, text):
        until = time.monotonic() + 120.0
        while not (found := [line for line in self.lines if text in line]):
            assert time.monotonic() < until, self.lines
            assert self.process.poll() is None, self.lines
            time.sleep(0.01)
        return found[0]

    @property
    def url(self):
        return re.search(r"live: (\S+)", self.wait_for("live: "))[1]

    def node(self, program):
        for child in psutil.Process(self.process.pid).children():
            with suppress(psutil.Error):
                if program in child.cmdline():
                    return child
        raise AssertionError(f"no process runs {program}: {self.lines}")

    def live_process(self):
        return self.node("ares_view.live").pid

    def end(self):
        """Return the exit status and the printed object."""
        out, _ = self.process.communicate(timeout=120)
        self.reading.join()
        return self.process.returncode, json.loads(out)


TOO_HOT = """(idle) => {
  live.about.limits.heating_w_m2 = 1e-12;
  live.about.idle = idle;
  showGauges();
  const gauge = gauges.find((one) => one.dataset.key === "heating_w_m2");
  return gauge.classList.contains("beyond");
}"""


@contextmanager
def started(environment, *words):
    """Run a command that does not outlive the block."""
    command = Command(environment, *words)
    try:
        yield command
    finally:
        command.process.kill()
        command.process.wait()


@pytest.fixture
def flown(tmp_path, ros_environment):
    """Start commands on a short mission; none outlives the test."""
    path = tmp_path / "short_burn.yaml"
    path.write_text(yaml.safe_dump(short_burn(450.0)))
    with ExitStack() as stack:

        def start(*words, live=("--live",)):
            given = ("fly", *live, "--json", "--mission", str(path), *words)
            return stack.enter_context(started(ros_environment, *given))

        yield start


@pytest.fixture
def opened(browser):
    """Open pages; assert that nothing is loaded from elsewhere and nothing goes wrong."""
    complaints, contexts = [], []

    def opener(url, size="wide", theme="light"):
        width, height = SIZES[size]
        view = {"width": width, "height": height}
        context = browser.new_context(viewport=view, color_scheme=theme)
        context.set_default_timeout(PATIENCE_MS)
        contexts.append(context)
        page = context.new_page()
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on(
            "console",
            # a server that is gone cannot be called
            lambda said: "WebSocket" in said.text or complaints.append(said.text),
        )
        page.on("request", lambda asked: asked.url.startswith(url) or complaints.append(asked.url))
        page.goto(url)
        return page

    yield opener
    for context in contexts:
        context.close()
    assert not complaints


def wait_for_state(page, text):
    page.wait_for_function(f"text => {STATE} && {STATE}.startsWith(text)", arg=text)


def seen_time(page):
    return page.evaluate("live.states.last('time_s')")


def check_legible(page, size):
    page.set_viewport_size({"width": SIZES[size][0], "height": 6000})
    page.wait_for_function(DRAWN)
    assert illegible(page, size, widest=380) == []
    figures = page.evaluate(FIGURES)
    assert len(figures) == 6
    for figure in figures:
        assert figure["traces"] == len(figure["data"]), figure["key"]
    axes = page.locator(".axis:visible").all_inner_texts()
    assert len(axes) == 12
    assert all(re.fullmatch(r"[a-z -]+, \S+", text) for text in axes), axes
    assert page.evaluate(NAMELESS) == []


@pytest.mark.long
@pytest.mark.parametrize(
    "themes", [THEMES, pytest.param(tuple(reversed(THEMES)), marks=pytest.mark.trial)]
)
def test_a_flight_from_its_begin_to_its_verdict(
    flown, opened, serious_faults, themes, tmp_path, ares
):
    flight = flown("--pace", "2", "--bag", str(tmp_path / "seen"))
    looks = zip(SIZES, themes, strict=True)
    pages = [(size, opened(flight.url, size, theme)) for size, theme in looks]
    page = pages[0][1]
    # no axes before there is a line
    assert page.evaluate(BARE) == 0
    wait_for_state(page, "Live")
    page.locator(".play").click()
    wait_for_state(page, "Paused")
    # the page is told the last states before the pause
    page.wait_for_timeout(300)
    held = seen_time(page)
    # a page that comes late has all that was
    late = opened(flight.url)
    wait_for_state(late, "Paused")
    assert seen_time(late) == held
    assert late.evaluate("live.states.rows.length") == page.evaluate("live.states.rows.length")
    assert late.evaluate("live.events[0].text") == "flight started"
    # one that goes is missed by nobody
    late.close()
    page.locator("[data-pace='50']").click()
    page.wait_for_function("() => live.about.pace === 50")
    assert page.locator("[data-pace='50']").get_attribute("aria-pressed") == "true"
    assert serious_faults(page) == []
    page.locator(".play").click()
    for _, one in pages:
        wait_for_state(one, "Flight over: Flown to the target")
        assert seen_time(one) == pytest.approx(1150.0, abs=10.0)
    status, told = flight.end()
    assert (status, told["shortcomings"]) == (0, [])
    end = told["events"][-1]["t_s"]
    for size, one in pages:
        one.wait_for_function("() => live.over")
        assert seen_time(one) == pytest.approx(end, abs=0.11)
        assert one.locator(".play").is_disabled()
        assert len(one.locator("#timeline li").all()) == len(told["events"])
        # all of it works without the server
        check_legible(one, size)
        assert serious_faults(one) == []
        # the server is gone, and the page says what makes the report
        said = one.locator("#no-report").inner_text()
        assert said == f"Its report: ./ares report {tmp_path / 'seen'}"
        assert one.locator("#to-report").is_hidden()
    page.locator(".theme").click()
    page.wait_for_function(f"() => {SEEN_PLOTS}.every((plot) => plot._fullLayout)")
    # the pages leave no trace in the bag
    words = ("fly", "--in-process", "--mission", str(tmp_path / "short_burn.yaml"))
    assert ares(*words, "--bag", str(tmp_path / "unseen")).returncode == 0
    seen, unseen = (open_bag(tmp_path / name) for name in ("seen", "unseen"))
    topics = [topic for topic in unseen.topics if topic != "/diagnostics"]
    assert differences(seen, unseen, topics) == []
    # late on a busy machine is all that there may be to report
    reports = seen.messages("/diagnostics") if "/diagnostics" in seen.topics else ()
    assert all(one.name == "ares/vehicle_sim" for _, said in reports for one in said.status)


@pytest.mark.trial
def test_updates_come_and_no_more_than_twenty_a_second(flown, opened):
    """Limit the rate of updates; benchmarks/live_flight.py measures the rate on an idle machine."""
    flight = flown("--pace", "5", "--no-record")
    page = opened(flight.url)
    wait_for_state(page, "Live")
    before = page.evaluate("[live.updates, performance.now()]")
    page.wait_for_function("(seen) => live.updates > seen + 20", arg=before[0])
    page.wait_for_timeout(1000)
    after = page.evaluate("[live.updates, performance.now()]")
    # those of a second may have waited in a busy browser
    assert after[0] - before[0] <= 20.0 * (1e-3 * (after[1] - before[1]) + 1.0)
    page.locator("[data-pace='0']").click()
    assert flight.end()[0] == 0


@pytest.mark.trial
def test_what_befalls_a_page_disturbs_no_flight(flown, opened, tmp_path, graph):
    flight = flown(*SLOWLY, "--bag", str(tmp_path / "bag"))
    page = opened(flight.url)
    wait_for_state(page, "Live")
    # what is no command
    page.evaluate("""live.socket.send('{"command": "pace", "value": -3}')""")
    page.wait_for_function("() => document.getElementById('answer').textContent")
    assert page.locator("#answer").inner_text() == "pace is -3; expected 0, or 0.001 to 1e+06"
    wait_for_state(page, "Live")
    # a flight that stops is not shown as live
    simulator = flight.node("ares_vehicle_sim")
    simulator.suspend()
    wait_for_state(page, "No data for")
    simulator.resume()
    wait_for_state(page, "Live")
    # a server that is killed is missed by nobody
    os.kill(flight.live_process(), signal.SIGKILL)
    wait_for_state(page, "Connection lost")
    flight.wait_for("goes on without its page")
    assert page.locator(".play").is_disabled()
    held = seen_time(page)
    graph.set_parameter("vehicle_sim", "pace", 0.0)
    status, told = flight.end()
    assert (status, told["shortcomings"]) == (0, [])
    assert page.locator("#after").is_hidden()
    assert told["events"][-1]["t_s"] > held
    assert page.evaluate(STATE).startswith("Connection lost")
    check_legible(page, "wide")


@pytest.mark.trial
def test_a_server_that_stands_still_holds_nobody_up(flown, opened):
    flight = flown("--pace", "10", "--no-record")
    page = opened(flight.url)
    wait_for_state(page, "Live")
    live = flight.live_process()
    os.kill(live, signal.SIGSTOP)
    page.wait_for_timeout(1500)
    assert page.evaluate(STATE).startswith("No word from the server")
    status, told = flight.end()
    assert (status, told["shortcomings"]) == (0, [])
    assert not psutil.pid_exists(live)


@pytest.mark.trial
def test_a_flight_in_one_process_tells_what_was_missed_and_why_there_is_no_report(
    tmp_path, ros_environment, opened
):
    data = short_burn(450.0)
    data["target"]["speed_m_s"] += 2000.0
    path = tmp_path / "short.yaml"
    path.write_text(yaml.safe_dump(data))
    words = ("fly", "--live", "--json", "--in-process", "--no-record", "--mission", str(path))
    with started(ros_environment, *words, *SLOWLY) as flight:
        page = opened(flight.url)
        wait_for_state(page, "Live")
        page.locator("[data-pace='0']").click()
        wait_for_state(page, "Flight over: Propellant ran out")
        page.wait_for_function("() => live.over")
        status, told = flight.end()
        assert status == 1
        assert page.locator("#missed li").all_inner_texts() == told["shortcomings"]
        shown = page.locator("#exit").inner_text()
        assert shown == "Exit status 1, flown, but something went wrong."
        assert page.locator("#no-report").inner_text() == (
            "There is no report: the flight was flown without a bag."
        )
        assert page.locator("#to-report").is_hidden()


@pytest.mark.trial
def test_an_interrupted_flight_says_so(flown, opened):
    flight = flown(*SLOWLY, "--no-record")
    page = opened(flight.url)
    wait_for_state(page, "Live")
    flight.process.send_signal(signal.SIGINT)
    wait_for_state(page, "Interrupted")
    assert flight.end()[0] == 130


def drain(terminal):
    """Read what is written to a terminal, which would else be full."""
    with suppress(OSError):
        while os.read(terminal, 4096):
            pass


@pytest.mark.trial
@pytest.mark.long
def test_a_person_gets_the_page_opened_and_finds_the_report_there_in_the_end(tmp_path, browser):
    """Fly at a terminal with a display; the browser is a script that records the address."""
    noted = tmp_path / "noted"
    script = tmp_path / "browser"
    script.write_text(f'#!/bin/sh\nsleep 2\necho "$1" > {noted}.new\nmv {noted}.new {noted}\n')
    script.chmod(0o755)
    ours, theirs = pty.openpty()
    environment = {**os.environ, "DISPLAY": ":7", "BROWSER": f"{script} %s"}
    mission = tmp_path / "short_burn.yaml"
    mission.write_text(yaml.safe_dump(short_burn()))
    bag = tmp_path / "bag"
    words = ["fly", "--live", "--pace", "1", "--bag", str(bag), "--mission", str(mission)]
    command = Command(environment, *words, terminal=theirs)
    os.close(theirs)
    threading.Thread(target=drain, args=(ours,), daemon=True).start()
    try:
        context = browser.new_context()
        context.set_default_timeout(PATIENCE_MS)
        complaints = []
        context.on("weberror", lambda error: complaints.append(str(error.error)))
        context.on("console", lambda said: complaints.append(said.text))
        page = context.new_page()
        until = time.monotonic() + 60.0
        while not noted.exists():
            assert time.monotonic() < until
            time.sleep(0.02)
        opened_at = time.monotonic()
        page.goto(noted.read_text().strip())
        wait_for_state(page, "Live")
        # it has waited for the two seconds; no state is asked for twice, so that the first ones
        # may be missed
        first = page.evaluate("live.states.rows[0][1][0]")
        assert first - 1000.0 < time.monotonic() - opened_at
        page.locator("[data-pace='0']").click()
        wait_for_state(page, "Flight over: Flown to the target")
        page.locator("#to-report").wait_for()
        assert page.locator("#exit").inner_text() == "Exit status 0, flown to the target."
        # the page of `ares report`, made from the bag
        with context.expect_page() as opened:
            page.locator("#to-report").click()
        report = opened.value
        report.wait_for_function("() => document.querySelectorAll('.plot .trace').length")
        assert report.locator(".verdict").inner_text() == "Flown to the target"
        # the path may be relative to where the command was called
        assert f"{bag.parent.name}/{bag.name}" in report.locator(".facts").first.inner_text()
        assert not (bag / "report.html").exists()
        assert complaints == []
        # it stays as long as a page is open
        assert command.process.poll() is None
        context.close()
        assert command.process.wait(timeout=60) == 0
    finally:
        command.process.kill()
        command.process.wait()
        os.close(ours)


@pytest.mark.trial
def test_a_replay_of_a_climb_is_followed_paused_and_paced(ros_environment, opened, from_the_pad):
    bag = from_the_pad / "bag"
    flown = read_flight(bag).summary
    with started(ros_environment, "replay", str(bag), "--live", "--pace", "8") as replay:
        page = opened(replay.url)
        wait_for_state(page, "Playing")
        assert "Delta III" in page.locator("h1").inner_text()
        assert page.locator("#kind").inner_text() == "Replay"
        assert page.title().endswith(": replay")
        page.wait_for_function("() => live.about.moments.length > 0")
        page.locator(".play").click()
        wait_for_state(page, "Paused")
        page.wait_for_timeout(300)
        held = seen_time(page)
        page.wait_for_timeout(500)
        assert seen_time(page) == held
        # what the air does
        assert page.locator("#guidance").inner_text() == "boost programme"
        assert {"dynamic_pressure_kpa", "mach"} <= set(page.evaluate(GAUGES))
        assert float(page.locator("[data-key=mach] b").inner_text()) > 1.0
        page.locator("[data-pace='50']").click()
        page.wait_for_function("() => live.about.pace === 50")
        page.locator(".play").click()
        wait_for_state(page, "Playing")
        # at full pace a busy server misses the states about the hand-over
        page.wait_for_function("() => live.about.left_air_s")
        page.locator("[data-pace='0']").click()
        wait_for_state(page, "Flight over: Flown to the target")
        assert page.locator("#exit").inner_text() == (
            "Exit status 0, flown to the target, as far as the bag tells."
        )
        assert page.locator("#missed").is_hidden()
        assert seen_time(page) == pytest.approx(flown.events[-1].time, abs=1.0)
        # nothing was published before the page could hear it; of the states a busy server keeps
        # the latest only: two seconds of wall time may be missing
        assert -0.1 < page.evaluate("live.states.column('time_s')[0]") < 16.0
        assert page.evaluate("live.events[0].text") == "flight started"
        page.wait_for_function(
            "() => gauges.find((one) => one.dataset.key === 'time_to_go_s')"
            ".querySelector('b').textContent === '\\u2013'"
        )
        out, _ = replay.process.communicate(timeout=60)
        assert replay.process.returncode == 0
        assert out.startswith("published ")
        page.wait_for_function("() => live.over")
        assert page.locator("#no-report").inner_text() == f"Its report: ./ares report '{bag}'"
        assert page.locator("#guidance").inner_text() == "closed loop"
        assert not {"dynamic_pressure_kpa", "mach"} & set(page.evaluate(GAUGES))
        told = "\n".join(page.locator("#timeline li").all_inner_texts())
        order = ["Mach 1", "greatest dynamic pressure", "hand-over", "staging"]
        assert sorted(order, key=told.index) == order
        # the page has seen some states, the simulator all
        assert all(moment.text in told for moment in flown.moments)
        page.set_viewport_size({"width": 1280, "height": 6000})
        page.wait_for_function(
            "() => plots[3].layout.annotations.some(({ text }) => text === 'hand-over')"
        )
        page.wait_for_function(f"() => {SEEN_PLOTS}.every((plot) => plot.querySelector('svg'))")
        assert illegible(page, "wide", widest=380) == []
        figures = {figure["key"]: figure for figure in page.evaluate(FIGURES)}
        assert len(figures) == 9
        pressure, whole = figures["figure-4"], figures["figure-1"]
        assert 30.0 < max(filter(None, pressure["data"][0][1])) < 62.0
        axes = page.evaluate("[3, 0].map((k) => plots[k]._fullLayout.xaxis.range[1])")
        assert axes[0] < 0.3 * axes[1]
        assert pressure["traces"] == whole["traces"] == 1
        # red above the heating limit, but not with the fairing on
        assert page.evaluate("live.about.idle") == []
        assert [page.evaluate(TOO_HOT, idle) for idle in ([], ["heating_w_m2"])] == [True, False]


@pytest.mark.trial
def test_a_page_of_its_own_finds_the_flight(ros_environment, flown, opened):
    with started(ros_environment, "live", "--no-browser") as viewer:
        page = opened(viewer.url)
        wait_for_state(page, "Waiting for the flight")
        flight = flown(*SLOWLY, "--no-record", live=())
        wait_for_state(page, "Live")
        page.locator("[data-pace='0']").click()
        wait_for_state(page, "Flight over")
        assert flight.end()[0] == 0
        viewer.process.send_signal(signal.SIGINT)
        assert viewer.process.wait(timeout=20) == 0
        page.wait_for_function("() => live.over")


# ---- what cannot be


def test_an_address_that_cannot_be_had_is_one_line(ares):
    with listen("127.0.0.1", 0) as taken:
        port = str(taken.getsockname()[1])
        done = ares("fly", "--live", "--live-port", port)
        assert (done.returncode, done.stdout) == (2, "")
        assert done.stderr == (
            f"ares: --live-port is {port}, which is taken; expected a free one, or 0 for any\n"
        )
    done = ares("fly", "--live", "--live-host", "no.such.host.invalid")
    assert done.returncode == 2
    assert done.stderr == (
        "ares: --live-host is 'no.such.host.invalid'; expected an address of this machine\n"
    )
    done = ares("live", "--host", "no.such.host.invalid")
    assert done.returncode == 2
    assert done.stderr == (
        "ares: --host is 'no.such.host.invalid'; expected an address of this machine\n"
    )


@pytest.mark.parametrize("verb", [("fly",), ("replay", "bag")])
@pytest.mark.parametrize("words", [("--live-port", "8000"), ("--no-browser",)])
def test_options_of_the_page_need_the_page(ares, verb, words):
    done = ares(*verb, *words)
    assert done.returncode == 2
    assert "go with --live only" in done.stderr
