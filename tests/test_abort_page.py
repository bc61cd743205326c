"""`ares aborts` as one types it, and its page as a browser shows it."""

import json

import pytest


def test_the_map_says_its_ends_in_words(open_file, page_of_map):
    page = open_file(page_of_map, "wide", "light")
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


def test_one_json_object(ares):
    done = ares("aborts", "--mission", "saturn_v_as506", "--step-s", "200", "--json")
    assert done.returncode == 0, done.stderr
    said = json.loads(done.stdout)
    assert said["mission"] == "saturn_v_as506"
    assert said["points"] == sum(len(row["points"]) for row in said["rows"])


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (("--guidance", "no_law"), "no_law"),
        (("--guidance", "peg_thesis"), "laws that start by themselves"),
        (("--mission", "delta_iii_coast", "--guidance", "optimal"), "last arc alone is free"),
        (("--mission", "nothing"), "nothing"),
        (("--step-s", "0"), "--step-s"),
        (("--out", "no/such/folder/map.html"), "its folder does not exist"),
    ],
)
def test_bad_input_is_one_line(ares, words, line):
    done = ares("aborts", *words)
    assert done.returncode == 2
    assert line in done.stderr
    assert done.stderr.count("\n") == 1
