# SPDX-License-Identifier: Apache-2.0
"""The page of a campaign in a browser: globe with its flights, histograms."""

import json

import pytest

from ares_trials.testing.pages import PLACE


@pytest.mark.trial
def test_flights_that_failed_stand_apart(read_file, page_of_many):
    assert page_of_many.stat().st_size < 4_000_000
    page = read_file(page_of_many, "wide", "light")
    report = json.loads(page.locator("#report").text_content())
    roles = [flight["role"] for flight in report["globe"]["flights"]]
    assert roles[0] == "other"
    failed = roles.count("thesis")
    assert failed
    assert failed < 120
    assert roles.count("here") == 20
    key = page.locator(".key.ways li").all_inner_texts()
    pieces = "where pieces come down, 99 % ellipse (2)"
    assert key == ["arrived (20)", f"failed ({failed})", "the nominal flight", pieces]
    bars = page.locator("#figure-1 .legend button").all_inner_texts()
    assert bars == ["success", "failure", "each failure"]


@pytest.mark.trial
def test_a_flight_that_is_pointed_at_is_named(read_file, page_of_many):
    page = read_file(page_of_many, "wide", "light")
    told = page.locator(".pointed")
    assert told.inner_text() == "Point at a track to see whose it is."
    page.locator(".scene canvas").scroll_into_view_if_needed()
    names = page.evaluate("globe.flights.map((flight) => flight.name)")
    name = next(name for name in names if ":" in name)
    page.mouse.move(*page.evaluate(PLACE, name))
    assert told.inner_text() in names
    assert told.inner_text().startswith("flight ")
    page.mouse.move(2, 2)
    canvas = page.locator(".scene canvas").bounding_box()
    page.mouse.move(canvas["x"] + 5, canvas["y"] + canvas["height"] - 5)
    assert told.inner_text() == "Point at a track to see whose it is."


def test_a_failure_that_is_pressed_has_its_command_copied(read_file, page_of_many):
    page = read_file(page_of_many, "wide", "light")
    page.evaluate("navigator.clipboard.writeText = async (text) => { window.copiedText = text; }")
    plot = page.locator("#figure-2 .plot")
    plot.scroll_into_view_if_needed()
    mark = plot.locator(".points path").last
    box = mark.bounding_box()
    page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"])
    page.wait_for_function("document.querySelector('#figure-2 .hoverlayer').textContent.length > 0")
    assert "flight " in plot.locator(".hoverlayer").text_content()
    page.mouse.down()
    page.mouse.up()
    page.wait_for_function("window.copiedText")
    copied = page.evaluate("window.copiedText")
    command = page.evaluate("report.command")
    flight = copied.removeprefix(f"{command} --flight ")
    assert flight.isdigit()
    failed = page.evaluate("globe.flights.filter((f) => f.role === 'thesis').map((f) => f.name)")
    assert any(name.startswith(f"flight {flight}:") for name in failed)
    assert page.locator(".copied").inner_text() == f"Copied: {copied}"
    # the same beside the command itself
    page.locator(".case button").first.click()
    page.wait_for_function("(before) => window.copiedText !== before", arg=copied)
    assert page.evaluate("window.copiedText") == page.locator(".case code").first.inner_text()


def test_perigee_and_apogee_have_a_figure(read_file, page_of_many):
    page = read_file(page_of_many, "wide", "light")
    assert "Perigee and apogee" in page.locator(".item.figure h3").all_inner_texts()
