# SPDX-License-Identifier: Apache-2.0
"""`ares aborts` from the command line, and its page in a browser."""

import json
import re

import pytest

from ares_trials.testing.pages import PLACE


def test_the_page_is_legible(read_file, page_of_map, check_page):
    check_page(read_file(page_of_map, "wide", "light"), "wide")


def test_the_map_says_its_ends_in_words(read_file, page_of_map):
    page = read_file(page_of_map, "wide", "light")
    strips = page.locator(".strip")
    told = strips.first.get_attribute("aria-label")
    assert told == "one engine lost, optimizer that knew: target 160 to 320 s"
    assert strips.first.locator("i").count() == 1
    assert page.locator(".swatches li").all_inner_texts() == [
        "target",
        "target lowered",
        "safe orbit",
        "suborbital",
    ]


def test_the_page_shows_where_it_falls(read_file, page_of_map):
    page = read_file(page_of_map, "wide", "light")
    part = page.locator("#falls")
    assert part.locator("h2").inner_text() == "Where it falls"
    assert "Outside all 8 areas of the mission fall" in part.inner_text()
    key = part.locator(".key.ways li").all_inner_texts()
    assert re.fullmatch(r"falls outside the areas \(\d+\)", key[0])
    assert key[-2:] == ["the flight in which nothing fails", "areas (8)"]
    assert page.locator(".plot").count() == page.locator(".item.figure").count()
    assert "Impact points" not in page.locator("h3").all_inner_texts()


def test_a_place_that_is_pointed_at_tells_its_failure(read_file, page_of_map):
    page = read_file(page_of_map, "wide", "light")
    told = page.locator(".pointed")
    assert told.inner_text() == "Point at a place to see which failure leads to it."
    page.locator(".scene canvas").scroll_into_view_if_needed()
    page.mouse.move(*page.evaluate(PLACE, "shut down early"))
    assert re.fullmatch(
        r"[a-z].* at [\d.]+ s: falls at [\d.]+° [NS], [\d.]+° [EW](, in .+)?", told.inner_text()
    )


@pytest.mark.trial
def test_one_json_object(ares):
    done = ares("aborts", "--mission", "saturn_v_as506", "--step-s", "400", "--json")
    assert done.returncode == 0, done.stderr
    said = json.loads(done.stdout)
    assert said["mission"] == "saturn_v_as506"
    assert said["points"] == sum(len(row["points"]) for row in said["rows"])
    flown = [point["flown"] for row in said["rows"] for point in row["points"]]
    fallen = [end for end in flown if "impact_deg" in end]
    assert said["outside"] == {
        "count": sum(end["area"] is None for end in fallen),
        "of": len(fallen),
    }
    assert "Africa" in said["areas"]


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (("--guidance", "no_law"), "no_law"),
        (("--guidance", "peg_thesis"), "starts by itself: one of igm"),
        (
            ("--mission", "delta_iii_coast", "--guidance", "optimal"),
            "expected only the last arc to be",
        ),
        (("--mission", "nothing"), "nothing"),
        (("--step-s", "0"), "--step-s"),
        (("--out", "no/such/folder/map.html"), "which cannot be written: No such file"),
    ],
)
def test_bad_input_is_one_line(ares, words, line):
    done = ares("aborts", *words)
    assert done.returncode == 2
    assert line in done.stderr
    assert done.stderr.count("\n") == 1
