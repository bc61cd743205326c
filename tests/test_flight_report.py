# SPDX-License-Identifier: Apache-2.0
"""`ares report`: the page of one recorded flight, and of two, in a browser."""

import re
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from rclpy.serialization import serialize_message

from ares_bags.reader import open_bag
from ares_bags.writer import BagWriter
from ares_bringup.commands.cli import main
from ares_bringup.commands.report import short_names
from ares_bringup.recorded import read_flight
from ares_trials.testing.bags import nav_state, topics, write_bag
from ares_trials.testing.pages import FIGURES
from ares_trials.testing.samples import one_in

REFERENCE = Path(__file__).parent.parent / "bags" / "reference"

#: Modules that take long to import, and that a page does without.
HEAVY = {"rclpy", "plotly.offline", "matplotlib", "scipy.interpolate", "ares_optimizer.solve"}

#: Colours of the canvas at places on the globe, looked at from above another place.
SEEN = """([places, view]) => {
  globe.view = { ...globe.view, ...view, zoom: 1 };
  globe.lines = [];
  globe.strokes = () => {};
  globe.render();
  const ratio = globe.canvas.width / globe.canvas.clientWidth;
  return places.map(([longitude, latitude]) => {
    const [x, y, depth] = globe.at(onSphere([longitude], [latitude]), 0);
    if (depth < 0.3) return null;
    const pixel = globe.pen.getImageData(Math.round(x * ratio), Math.round(y * ratio), 1, 1);
    return [...pixel.data].slice(0, 3).join();
  });
}"""
PHONE = {"has_touch": True, "is_mobile": True}
LAND = [(-105, 40), (20, 10), (0, -85), (100, 60), (135, -25), (-60, -10), (80, 25), (-45, 72)]
SEA = [(-150, 0), (-30, 25), (0, 89), (80, -20), (160, 20), (-120, -45), (-10, -30), (50, 42)]
#: Lines of cursors, in px from the left of their charts; null where hidden.
CURSORS = """() => [...document.querySelectorAll(".plot .cursor")].map((line) => (
  line.hidden ? null
  : line.getBoundingClientRect().left - line.parentElement.getBoundingClientRect().left))"""
PICTURE = "() => document.querySelector('.scene canvas').toDataURL()"
SETTLED = "() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"


def run(capfd, *words):
    capfd.readouterr()
    status = main(["report", *map(str, words)])
    return status, *capfd.readouterr()


def refused(capfd, *words):
    status, out, err = run(capfd, *words)
    assert (status, out) == (2, "")
    assert err.count("\n") == 1
    assert err.startswith("ares: ")
    return err


# ---- in a browser


@pytest.mark.trial
@pytest.mark.parametrize(("which", "count"), one_in(2, [("page_of_two", 23), ("page_of_one", 21)]))
def test_every_figure_has_all_its_lines(read_file, request, which, count):
    figures = read_file(request.getfixturevalue(which), "wide", "light").evaluate(FIGURES)
    assert len(figures) == count
    for figure in figures:
        assert figure["traces"] == len(figure["data"]), figure["key"]


def test_the_pages_are_legible_and_have_no_serious_fault(
    read_file, page_of_one, page_of_two, check_page
):
    check_page(read_file(page_of_one, "narrow", "dark", **PHONE), "narrow")
    check_page(read_file(page_of_two, "wide", "light"), "wide")


def test_one_cursor_goes_over_all_charts_and_moves_the_vehicle(read_file, page_of_one):
    page = read_file(page_of_one, "wide", "light")
    before = page.evaluate(PICTURE)
    chart = page.locator(".plot").nth(2)
    chart.scroll_into_view_if_needed()
    box = chart.bounding_box()
    page.mouse.move(box["x"] + 0.6 * box["width"], box["y"] + 0.5 * box["height"])
    page.evaluate(SETTLED)
    cursors = page.evaluate(CURSORS)
    assert None not in cursors
    assert page.locator(".plot .dot").count() == 2
    assert page.locator(".plot .dot").first.is_visible()
    assert cursors[2] == pytest.approx(0.6 * box["width"], abs=1.5)
    time = page.evaluate("now")
    shown = page.evaluate("timed.map((plot) => plot._fullLayout.xaxis.range)")
    assert len({tuple(ends) for ends in shown}) == 1
    text = page.locator("#figure-1 .legend output").inner_text()
    flight = read_flight(REFERENCE)
    truth = flight.columns["vehicle_state"]
    altitude = truth["altitude"][abs(truth["time"] - time).argmin()] / 1e3
    assert float(text.removesuffix(" km")) == pytest.approx(altitude, abs=0.5)
    assert page.evaluate(PICTURE) != before
    assert f"{time:.2f} s" in page.locator(".transport .now").inner_text()


def test_a_zoom_of_one_chart_is_a_zoom_of_all(read_file, page_of_one):
    page = read_file(page_of_one, "wide", "light")
    ranges = "timed.map((plot) => String(plot._fullLayout.xaxis.range))"
    before = page.evaluate(ranges)
    page.evaluate("Plotly.relayout(plots[3], { 'xaxis.range': [300, 400] })")
    page.wait_for_function(
        "timed.every((plot) => String(plot._fullLayout.xaxis.range) === '300,400')"
    )
    page.evaluate("setTime(500)")
    page.evaluate(SETTLED)
    assert set(page.evaluate(CURSORS)) == {None}
    page.evaluate("Plotly.relayout(plots[3], { 'xaxis.autorange': true })")
    page.wait_for_function(f"(before) => String({ranges}) === String(before)", arg=before)


@pytest.mark.trial
def test_charts_in_the_air_have_a_time_of_their_own(open_file, from_the_pad, tmp_path, capfd):
    out = tmp_path / "page.html"
    assert run(capfd, from_the_pad / "bag", "--out", out)[0] == 0
    page = open_file(out, "wide", "light")
    assert page.evaluate(FIGURES)
    ranges = "timed.map((plot) => plot._fullLayout.xaxis.range.map(Math.round).join())"
    before = page.evaluate(ranges)
    whole, in_air = dict.fromkeys(before)
    assert before.count(in_air) == 5
    assert float(in_air.split(",")[1]) < 0.3 * float(whole.split(",")[1])
    marks = "plots.map((plot) => plot.layout.annotations.map(({ text }) => text).join())"
    assert sum("max q" in words for words in page.evaluate(marks)) == 5
    page.evaluate("Plotly.relayout(plots[3], { 'xaxis.range': [50, 60] })")
    page.wait_for_function(
        "timed.every((plot) => String(plot._fullLayout.xaxis.range) === '50,60')"
    )
    page.evaluate("Plotly.relayout(plots[3], { 'xaxis.autorange': true })")
    page.wait_for_function(f"String({ranges}) === '{','.join(before)}'")
    page.locator(".timeline li", has_text="greatest dynamic").locator("button").click()
    page.evaluate(SETTLED)
    text = page.locator(".item", has_text="Dynamic pressure").locator("output").first.inner_text()
    assert 50.0 < float(text.removesuffix(" kPa")) < 70.0


def test_an_event_and_the_slider_set_the_time(read_file, page_of_one):
    page = read_file(page_of_one, "wide", "light")
    page.locator(".timeline button", has_text="337.150").first.click()
    assert page.evaluate("now") == 337.15
    page.locator(".transport .time").fill("0.5")
    assert page.evaluate("now") == pytest.approx(0.5 * (155.9 + 767.127), abs=0.01)


def test_the_globe_turns_zooms_and_plays(read_file, page_of_one):
    page = read_file(page_of_one, "wide", "light")
    canvas = page.locator(".scene canvas")
    canvas.scroll_into_view_if_needed()
    box = canvas.bounding_box()
    x, y = box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"]

    def picture():
        page.evaluate(SETTLED)
        return page.evaluate(PICTURE)

    first = picture()
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 80, y + 30, steps=4)
    page.mouse.up()
    turned = picture()
    page.mouse.wheel(0, -300)
    page.wait_for_function("globe.view.zoom > 1")
    nearer = picture()
    canvas.press("ArrowLeft")
    assert len({first, turned, nearer, picture()}) == 4
    page.locator(".zoom button").last.click()
    assert picture() == first
    page.locator(".play").click()
    page.wait_for_function("now > FIRST && now < LAST")
    page.locator(".play").click()
    assert page.evaluate("playing") == 0


@pytest.mark.trial
def test_the_wheel_scrolls_the_page_until_the_pointer_comes_to_the_globe(read_file, page_of_two):
    page = read_file(page_of_two, "wide", "light")
    assert page.evaluate(
        """() => document.querySelector(".scene canvas")
          .dispatchEvent(new WheelEvent("wheel", { deltaY: 100, cancelable: true }))"""
    )
    assert page.evaluate("globe.view.zoom === globe.home.zoom")


@pytest.mark.trial
def test_land_is_land_from_wherever_it_is_seen(browser, page_of_one):
    # not by `open_file`: the browser remarks that a canvas is read so often
    page = browser.new_page(color_scheme="light")
    page.goto(page_of_one.as_uri())
    # without the flight and what it drops over it
    page.evaluate("globe.flights = []; globe.falls = []")
    colours = page.evaluate("[globe.colours.edge, globe.colours.ground]")
    land, sea = (",".join(str(int(c[i : i + 2], 16)) for i in (1, 3, 5)) for c in colours)
    checked = 0
    for longitude in range(-180, 180, 20):
        for latitude in (-80, -35, 0, 20, 55, 90):
            view = {"longitude": longitude, "latitude": latitude}
            seen = page.evaluate(SEEN, [LAND + SEA, view])
            for place, colour, expected in zip(
                LAND + SEA, seen, [land] * len(LAND) + [sea] * len(SEA), strict=True
            ):
                assert colour in (None, expected), (place, view)
                checked += colour is not None
    page.close()
    assert checked > 500


def test_fingers_move_the_cursor_and_may_tap_what_they_need(read_file, page_of_one):
    page = read_file(page_of_one, "narrow", "dark", **PHONE)
    for name in (".play", ".zoom button", ".transport .time"):
        for box in [one.bounding_box() for one in page.locator(name).all()]:
            assert box["height"] >= 44
    chart = page.locator(".plot").first
    chart.scroll_into_view_if_needed()
    box = chart.bounding_box()
    page.touchscreen.tap(box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"])
    page.evaluate(SETTLED)
    assert page.evaluate(CURSORS)[0] == pytest.approx(0.5 * box["width"], abs=1.5)


def test_a_browser_that_cannot_unpack_is_told(browser, page_of_one):
    page = browser.new_page()
    page.add_init_script("delete window.DecompressionStream")
    page.goto(page_of_one.as_uri())
    assert page.locator("#too-old").is_visible()
    assert "Flown to the target" in page.locator(".verdict").inner_text()
    page.close()


def test_the_numbers_of_the_page(read_file, page_of_one, page_of_two):
    page = read_file(page_of_one, "wide", "light")
    assert page.locator(".tiles dd").all_inner_texts() == [
        "174,117.62 kg",
        "767.127 s",
        "434.027 s",
    ]
    rows = page.locator("#flight-1 tbody tr").all_inner_texts()
    assert [row.split("\t")[0] for row in rows] == [
        "radius, m",
        "speed, m/s",
        "flight-path angle, deg",
        "inclination, deg",
    ]
    assert rows[0].split("\t")[1:] == ["+0.0053", "100", "6,518,889.01", "6,518,889.00"]
    page = read_file(page_of_two, "wide", "light")
    head = page.locator("#comparison thead th").all_inner_texts()
    assert head[1:] == ["peg, reference", "peg, dispersed"]
    mass = page.locator("#comparison tbody tr", has_text="final mass").inner_text()
    one, other, difference = (
        float(cell.replace(",", "").replace("\N{MINUS SIGN}", "-")) for cell in mass.split()[-3:]
    )
    assert one == 174_117.62
    assert difference == pytest.approx(other - one, abs=0.011)
    assert page.locator("#globe .ways li").all_inner_texts()[:2] == [
        "peg, reference",
        "peg, dispersed",
    ]


def test_where_stages_come_down_is_told_and_drawn(read_file, page_of_one, page_of_two):
    page = read_file(page_of_one, "wide", "light")
    rows = page.locator("article", has_text="Where stages come down").locator("tbody tr")
    core, fairing = (row.split("\t") for row in rows.all_inner_texts()[::2])
    assert core[0].startswith("core") and fairing[0].startswith("payload fairing")
    assert "without drag" in rows.all_inner_texts()[1]
    assert float(core[3].replace(",", "")) > 300.0
    # a place stays on one line
    assert core[4].count("\u00a0") == 3 and " " not in core[4]
    assert page.evaluate("globe.falls.map((fall) => fall.name)") == ["core", "payload fairing"]
    assert "falls of what is dropped" in page.locator("#globe .ways").inner_text()
    several = read_file(page_of_two, "wide", "light")
    assert several.evaluate("globe.falls.length") == 4


def test_several_flights_are_seen_at_once(read_file, page_of_two):
    page = read_file(page_of_two, "wide", "light")
    height = page.evaluate("innerHeight")
    for place in ("#comparison", "#figure-1 .plot", "#figure-2 .plot"):
        box = page.locator(place).bounding_box()
        assert box["y"] + box["height"] <= height, place
    # what does not fit into the table is scrolled to in itself
    table = page.locator("#comparison .scroll")
    assert table.evaluate("(box) => box.scrollHeight > box.clientHeight")
    table.evaluate("(box) => box.scrollTo(0, box.scrollHeight)")
    assert table.evaluate("(box) => box.scrollTop") > 0
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    rows = page.locator("#comparison tbody th").all_inner_texts()
    assert {"delta-V, ideal, m/s", "delta-V, gravity, m/s", "error of radius, m"} <= set(rows)


def test_error_and_tolerance_are_seen_first_on_a_phone(read_file, page_of_one):
    page = read_file(page_of_one, "narrow", "dark", **PHONE)
    head = page.locator("#flight-1 thead th")
    assert head.all_inner_texts()[1:] == ["error", "tolerance", "flown", "target"]
    for k in (1, 2):
        box = head.nth(k).bounding_box()
        assert box["x"] + box["width"] <= 390


def test_the_contents_name_every_figure(read_file, page_of_one):
    page = read_file(page_of_one, "wide", "light")
    titles = page.locator(".item.figure h3").all_inner_texts()
    assert page.locator(".toc .places a").all_inner_texts() == titles
    assert {"Perigee", "Apogee", "Propellant", "Ground track"} <= set(titles)


def test_a_pointer_on_the_map_sets_the_time(read_file, page_of_one):
    page = read_file(page_of_one, "wide", "light")
    track = page.locator(".item.wide .plot").first
    track.scroll_into_view_if_needed()
    box = track.bounding_box()
    page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"])
    page.evaluate(SETTLED)
    time = page.evaluate("now")
    assert 160.0 < time < 766.0
    dot = page.locator(".item.wide .plot .dot").bounding_box()
    assert abs(dot["x"] + 6.0 - box["x"] - 0.5 * box["width"]) < 60.0


def test_the_budget_and_who_made_the_flight_are_told(read_file, page_of_one, page_of_two):
    page = read_file(page_of_one, "wide", "light")
    cells = page.locator("article", has_text="Delta-V budget").locator("tbody tr")
    budget = dict(row.split("\t") for row in cells.all_inner_texts())
    numbers = [float(value.replace(",", "")) for value in budget.values()]
    ideal, *losses, gained, left = numbers
    assert ideal - sum(losses) == pytest.approx(gained, abs=0.03)
    assert left > 0.0
    facts = page.locator("#flight-1 .facts").inner_text()
    assert "software" in facts
    assert "mission digest" in facts
    # one that is recorded now also says when and where
    facts = read_file(page_of_two, "wide", "light").locator("#flight-2 .facts").inner_text()
    assert re.search(r"date\s+20\d\d-\d\d-\d\dT", facts)
    assert re.search(r"machine\s+\w+ \w+, \d+ cores", facts)


# ---- the command


def test_the_page_lies_in_the_bag(tmp_path, capfd):
    bag, other = tmp_path / "one", tmp_path / "two"
    for copy in (bag, other):
        shutil.copytree(REFERENCE, copy)
    status, out, err = run(capfd, bag)
    assert (status, out, err) == (0, f"{bag / 'report.html'}\n", "")
    assert (bag / "report.html").stat().st_size < 4e6
    status, out, _ = run(capfd, bag / "reference_0.mcap", other)
    assert (status, out) == (0, f"{bag / 'comparison.html'}\n")
    # nothing is added to it; a person may have put pages beside the reference flight
    there = {path.name for path in REFERENCE.iterdir()}
    assert {path.name for path in other.iterdir()} == there


def test_what_cannot_be_shown_is_one_line(tmp_path, capfd):
    assert "does not exist" in refused(capfd, tmp_path / "nothing")
    (tmp_path / "text").write_text("no bag")
    assert "not a bag" in refused(capfd, tmp_path / "text")
    states = write_bag(tmp_path / "made_up")
    assert "holds no flight" in refused(capfd, states)
    assert "5 at most" in refused(capfd, *[REFERENCE] * 6)
    for out in (tmp_path, tmp_path / "no" / "page.html"):
        assert "cannot be written" in refused(capfd, REFERENCE, "--out", out)
    assert not [path for path in tmp_path.iterdir() if path.name.startswith(".")]


def test_states_of_another_kind_are_one_line(tmp_path, capfd):
    topic = replace(topics()[0], name="/ares/vehicle_state")
    with BagWriter(tmp_path / "other", {"mission": "ares_v"}) as writer:
        writer.add_topic(topic)
        writer.write(topic.name, 0, serialize_message(nav_state(0)))
    assert "another kind of vehicle_state" in refused(capfd, tmp_path / "other")


def test_a_mission_that_is_gone_is_one_line(tmp_path, capfd):
    bag = tmp_path / "flight"
    shutil.copytree(REFERENCE, bag)
    file, page = bag / "reference_0.mcap", bag / "metadata.yaml"
    # the bag does not hold its mission either
    for path in (file, page):
        data = path.read_bytes().replace(b"ares_v", b"ares_w")
        path.write_bytes(data.replace(b"mission_text", b"mission_none"))
    assert "ares_w" in refused(capfd, bag)


@pytest.mark.trial
@pytest.mark.parametrize(
    ("kept", "verdict"),
    [
        (0.4, "Incomplete: no end in this bag"),
        # the end of the flight is in it, the end of the bag is not
        (0.95, "Flown to the target, with shortcomings"),
    ],
)
def test_a_cut_bag_is_shown_and_said_to_be_incomplete(tmp_path, capfd, kept, verdict):
    bag = tmp_path / "cut"
    shutil.copytree(REFERENCE, bag)
    file = bag / "reference_0.mcap"
    file.write_bytes(file.read_bytes()[: int(kept * file.stat().st_size)])
    status, _, err = run(capfd, bag)
    assert (status, err) == (0, "")
    text = (bag / "report.html").read_text()
    assert f'<p class="verdict bad">{verdict}</p>' in text
    assert re.search(r'<ul class="problems">.*?has no end.*?lost', text, re.DOTALL)
    whole = read_flight(REFERENCE).columns["vehicle_state"]["time"]
    part = read_flight(bag).columns["vehicle_state"]["time"]
    assert part.tolist() == whole[: len(part)].tolist()


def test_a_damaged_bag_is_no_success(tmp_path, capfd):
    bag = tmp_path / "damaged"
    shutil.copytree(REFERENCE, bag)
    file = bag / "reference_0.mcap"
    data = bytearray(file.read_bytes())
    with file.open("rb") as stream:
        chunks = make_reader(stream).get_summary().chunk_indexes
    damaged = chunks[len(chunks) // 3]
    data[damaged.chunk_start_offset + damaged.chunk_length // 2] ^= 0xFF
    file.write_bytes(data)
    status, _, _ = run(capfd, bag)
    assert status == 0
    flight = read_flight(bag)
    assert flight.summary.shortcomings()
    text = (bag / "report.html").read_text()
    assert 'class="verdict bad"' in text
    assert 'class="problems"' in text
    # the picture shows the same, and says the same
    capfd.readouterr()
    assert main(["plot", str(bag)]) == 1
    out, err = capfd.readouterr()
    assert out == f"{bag / 'flight.png'}\n"
    assert (bag / "flight.png").stat().st_size > 10_000
    assert err == f"ares: {' '.join(flight.missing.split())}\n"


@pytest.mark.trial
def test_a_bag_by_the_wall_clock_of_another_namespace(tmp_path, capfd):
    """Report on a bag of `ros2 bag record`, which does not name its mission."""
    ours = open_bag(REFERENCE)
    path = tmp_path / "theirs"
    with BagWriter(path) as writer:
        for topic in ours.topics.values():
            writer.add_topic(replace(topic, name=topic.name.replace("/ares/", "/one/two/")))
        for k, (name, _, data) in enumerate(ours.raw_messages()):
            writer.write(name.replace("/ares/", "/one/two/"), 1_790_000_000 * 10**9 + k, data)
    assert "does not say which mission was flown; --mission does" in refused(capfd, path)
    status, _, err = run(capfd, path, "--mission", "ares_v")
    assert (status, err) == (0, "")
    flown, known = read_flight(path, "ares_v"), read_flight(REFERENCE)
    assert flown.summary.m_f_kg == known.summary.m_f_kg
    for topic, columns in known.columns.items():
        for name, values in columns.items():
            assert np.array_equal(flown.columns[topic][name], values, equal_nan=True)
    assert main(["plot", str(path), "--mission", "ares_v"]) == 0


def test_names_differ():
    flight = read_flight(REFERENCE)
    assert short_names([flight]) == ["peg"]
    assert short_names([flight, flight]) == ["1: peg, reference", "2: peg, reference"]


def test_the_verdict_is_that_of_the_flight():
    summary = read_flight(REFERENCE).summary
    assert summary.exit_code == 0
    assert summary.m_f_kg == pytest.approx(174_117.62, abs=0.01)
    assert summary.first_convergence_iterations == 7
    assert not summary.lost_messages


@pytest.mark.trial
def test_a_page_is_made_without_what_takes_long_to_import(tmp_path):
    code = (
        "import sys; from ares_bringup.commands.cli import main; "
        f"status = main(['report', {str(REFERENCE)!r}, '--out', {str(tmp_path / 'p.html')!r}]); "
        f"print(status, sorted({HEAVY!r} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "0 []"


@pytest.mark.trial
def test_names_of_four_flights_stand_as_they_are_and_their_table_scrolls_in_itself(
    tmp_path, open_file
):
    names = ["f_igm", "f_peg", "t_1", "<i>"]
    for name in names:
        shutil.copytree(REFERENCE, tmp_path / name)
    out = tmp_path / "flights.html"
    assert main(["report", *(str(tmp_path / name) for name in names), "--out", str(out)]) == 0
    page = open_file(out, "wide", "light")
    heads = page.locator("#comparison thead th").all_inner_texts()
    assert [name for name in names if f"peg, {name}" not in heads] == []
    assert page.locator("#comparison sub").count() == 0
    # all of it can be reached, and the page itself is no wider than the screen
    right = page.locator("#comparison thead th").last
    right.scroll_into_view_if_needed()
    beyond = "(cell) => cell.getBoundingClientRect().right - document.documentElement.clientWidth"
    assert right.evaluate(beyond) <= 0
    wide = "document.documentElement.scrollWidth - document.documentElement.clientWidth"
    assert page.evaluate(wide) <= 0
