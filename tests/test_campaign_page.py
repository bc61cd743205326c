"""The page of a campaign, as a browser shows it: the globe with its flights, the histograms."""

import json

import pytest

from ares_bringup.commands.cli import main
from ares_studies.pages.testing import FIGURES, SIZES, TEXTS, THEMES

#: Some of its flights fail: their fairing stays on, or they run dry.
DISPERSIONS = "thrust: 0.03\nlog_density: {mean: 0.0, sigma: 1.5}\n"
FLIGHTS = 120

#: Middle of a flight's way, in pixels of the page.
PLACE = """(name) => {
  const flight = globe.flights.find((one) => one.name.startsWith(name));
  const box = globe.canvas.getBoundingClientRect();
  const last = flight.height.length - 1;
  const [x, y] = globe.at(flight.ground, last, 1 + flight.height[last]);
  return [box.left + x, box.top + y];
}"""


@pytest.fixture(scope="module")
def page_of_many(tmp_path_factory):
    folder = tmp_path_factory.mktemp("campaign")
    dispersions = folder / "weak.yaml"
    dispersions.write_text(DISPERSIONS)
    words = ("-n", str(FLIGHTS), "--dispersions", str(dispersions), "--out", str(folder / "c"))
    assert main(("montecarlo", "--json", *words)) == 0
    return folder / "c" / "report.html"


@pytest.mark.parametrize("theme", THEMES)
@pytest.mark.parametrize("size", SIZES)
def test_the_page_is_legible(open_file, page_of_many, size, theme):
    page = open_file(page_of_many, size, theme)
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    for figure in page.evaluate(FIGURES):
        assert figure["width"] > 0.75 * min(SIZES[size][0], 480), figure["key"]
        assert figure["height"] > 250, figure["key"]
        assert not figure["cropped"], figure["key"]
        assert not figure["overlapping"], figure["key"]
    texts = page.evaluate(TEXTS)
    assert not [text for text in texts if text["contrast"] < 4.5]
    assert not [text for text in texts if text["size"] < 12]
    assert all(text for text in page.locator(".axis").all_inner_texts())
    assert page_of_many.stat().st_size < 4_000_000


def test_the_page_has_no_serious_fault(open_file, serious_faults, page_of_many):
    assert serious_faults(open_file(page_of_many, "narrow", "light")) == []


def test_flights_that_failed_stand_apart(open_file, page_of_many):
    page = open_file(page_of_many, "wide", "light")
    report = json.loads(page.locator("#report").text_content())
    roles = [flight["role"] for flight in report["globe"]["flights"]]
    assert roles[0] == "other"
    failed = roles.count("thesis")
    assert failed
    assert failed < FLIGHTS
    assert roles.count("here") == 20
    key = page.locator(".key.ways li").all_inner_texts()
    assert key == ["arrived (20)", f"failed ({failed})", "the nominal flight"]
    bars = page.locator("#figure-1 .legend button").all_inner_texts()
    assert bars == ["success", "failure"]


def test_a_flight_that_is_pointed_at_is_named(open_file, page_of_many):
    page = open_file(page_of_many, "wide", "dark")
    told = page.locator(".pointed")
    assert told.inner_text() == "Point at a way to see whose it is."
    page.locator(".scene canvas").scroll_into_view_if_needed()
    names = page.evaluate("globe.flights.map((flight) => flight.name)")
    name = next(name for name in names if ":" in name)
    page.mouse.move(*page.evaluate(PLACE, name))
    assert told.inner_text() in names
    assert told.inner_text().startswith("flight ")
    page.mouse.move(2, 2)
    canvas = page.locator(".scene canvas").bounding_box()
    page.mouse.move(canvas["x"] + 5, canvas["y"] + canvas["height"] - 5)
    assert told.inner_text() == "Point at a way to see whose it is."
