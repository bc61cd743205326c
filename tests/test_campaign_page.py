# SPDX-License-Identifier: Apache-2.0
"""The page of a campaign, as a browser shows it: the globe with its flights, the histograms."""

import json

#: Middle of a flight's way, in pixels of the page.
PLACE = """(name) => {
  const flight = globe.flights.find((one) => one.name.startsWith(name));
  const box = globe.canvas.getBoundingClientRect();
  const last = flight.height.length - 1;
  const [x, y] = globe.at(flight.ground, last, 1 + flight.height[last]);
  return [box.left + x, box.top + y];
}"""


def test_flights_that_failed_stand_apart(open_file, page_of_many):
    assert page_of_many.stat().st_size < 4_000_000
    page = open_file(page_of_many, "wide", "light")
    report = json.loads(page.locator("#report").text_content())
    roles = [flight["role"] for flight in report["globe"]["flights"]]
    assert roles[0] == "other"
    failed = roles.count("thesis")
    assert failed
    assert failed < 120
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
