# SPDX-License-Identifier: Apache-2.0
"""The page of `ares reproduce` in a browser: legible, complete, and without network."""

import json
import math
from functools import partial

import pytest

from ares_thesis.commands.reproduce import DATA, PAGE
from ares_trials.testing.pages import FIGURES, LEAST_CONTRAST, SIZES, TEXTS

LEAST_TAP_PX = 44.0

TABLES = """() => Object.fromEntries(
  [...document.querySelectorAll(".item.table table")].map((table) => [
    table.closest(".item").id,
    [...table.querySelectorAll("tbody tr:not(.note)")].map((row) => ({
      label: row.querySelector("th").textContent,
      cells: [...row.querySelectorAll("td")].map((cell) => cell.textContent),
      note: row.nextElementSibling && row.nextElementSibling.className === "note"
        ? row.nextElementSibling.textContent : "",
    })),
  ]))"""


@pytest.fixture(scope="module")
def report(reproduction):
    return json.loads((reproduction / DATA).read_text(encoding="utf-8"))


@pytest.fixture
def read_page(read_file, reproduction):
    return partial(read_file, reproduction / PAGE)


def read_on_a_phone(read_page):
    return read_page("narrow", "light", has_touch=True, is_mobile=True)


@pytest.mark.trial
@pytest.mark.parametrize("size", SIZES)
def test_the_figures_show_what_the_file_holds(read_page, report, size):
    page = read_page(size, "light") if size == "wide" else read_on_a_phone(read_page)
    figures = page.evaluate(FIGURES)
    expected = {
        item["key"]: item["content"]
        for chapter in report["chapters"]
        for item in chapter["items"]
        if item["kind"] == "figure"
    }
    assert [figure["key"] for figure in figures] == list(expected)
    for figure in figures:
        series = expected[figure["key"]]["series"]
        assert figure["traces"] == len(series), figure["key"]
        assert figure["words"] > 5, figure["key"]
        assert figure["data"] == [[one["x"], one["y"]] for one in series], figure["key"]
    assert sum(text["chart"] for text in page.evaluate(TEXTS)) > 5 * len(figures)


@pytest.mark.trial
def test_the_page_is_legible_and_has_no_serious_fault(read_page, check_page):
    check_page(read_on_a_phone(read_page), "narrow")


@pytest.mark.trial
def test_the_page_shows_what_the_file_holds_and_answers(read_page, report):
    page = read_page("wide", "light")
    check_tables(page, report)
    check_links(page, report)
    check_legend(page)


def check_tables(page, report):
    shown = page.evaluate(TABLES)
    tables = {
        item["key"]: item["content"]
        for chapter in report["chapters"]
        for item in chapter["items"]
        if item["kind"] == "table"
    } | {"headline": report["headline"]}
    assert set(shown) == set(tables)
    for key, table in tables.items():
        rows = [[cell["text"] for cell in row["cells"]] for row in table["rows"]]
        assert [row["cells"] for row in shown[key]] == rows
        for row, found in zip(table["rows"], shown[key], strict=True):
            assert plain(found["label"]) == plain(row["label"])
            assert plain(found["note"]) == plain(row["note"])


def plain(text):
    """Remove the marks that the page turns into indices and links."""
    return text.replace("_", "")


def check_legend(page):
    visible = "document.querySelector('.plot').querySelectorAll('.trace.scatter').length"
    before = page.evaluate(visible)
    page.click(".legend button >> nth=0")
    assert page.evaluate(visible) == before - 1
    page.click(".legend button >> nth=0")
    assert page.evaluate(visible) == before


def check_links(page, report):
    items = [item["key"] for chapter in report["chapters"] for item in chapter["items"]]
    links = page.evaluate("[...document.links].map((link) => link.getAttribute('href'))")
    assert all(link.startswith("#") for link in links)
    targets = {link[1:] for link in links}
    assert set(items) <= targets
    known = page.evaluate("[...document.querySelectorAll('[id]')].map((e) => e.id)")
    assert targets <= set(known)


@pytest.mark.trial
def test_the_button_changes_the_theme_of_page_and_plots(read_page):
    page = read_page("wide", "light")
    colours = """() => [
      getComputedStyle(document.body).backgroundColor,
      document.querySelector(".plot .xtick text").style.fill,
      document.querySelector(".plot .trace.scatter path").style.stroke,
    ]"""
    before = page.evaluate(colours)
    page.evaluate("delete document.documentElement.dataset.drawn")
    page.click(".theme")
    page.wait_for_function("document.documentElement.dataset.drawn", timeout=240_000)
    after = page.evaluate(colours)
    assert all(one != other for one, other in zip(before, after, strict=True))
    assert not [text for text in page.evaluate(TEXTS) if text["contrast"] < LEAST_CONTRAST]


@pytest.mark.trial
def test_the_contents_can_be_tapped(read_page):
    page = read_on_a_phone(read_page)
    assert page.evaluate("!document.querySelector('.toc details').open")
    boxes = """() => [...document.querySelectorAll(".toc summary, .toc a")].map((e) => {
      const box = e.getBoundingClientRect();
      return [e.textContent, box.width, box.height];
    })"""
    page.tap(".toc summary")
    for name, width, height in page.evaluate(boxes):
        assert min(width, height) >= LEAST_TAP_PX, name
    page.tap(".toc a[href='#errata']")
    assert page.evaluate("!document.querySelector('.toc details').open")
    page.wait_for_function(
        "document.getElementById('errata').getBoundingClientRect().top < innerHeight"
    )


def test_the_numbers_of_the_file_are_finite(reproduction):
    def refuse(text):
        raise AssertionError(text)

    def walk(value):
        if isinstance(value, dict):
            for inner in value.values():
                walk(inner)
        elif isinstance(value, list):
            for inner in value:
                walk(inner)
        elif isinstance(value, float):
            assert math.isfinite(value)

    walk(json.loads((reproduction / DATA).read_text(encoding="utf-8"), parse_constant=refuse))
