"""The page of `ares reproduce` in a browser: legible, complete, and without a network."""

import importlib.util
import json
import math
import os
import sys
from pathlib import Path

import pytest
from playwright.sync_api import sync_playwright

from ares_bringup.commands.cli import main
from ares_bringup.commands.reproduce import DATA, PAGE

ROOT = Path(__file__).parent.parent
THEMES = ("light", "dark")
SIZES = {"wide": (1280, 900), "narrow": (390, 844)}
FLAGS = [
    *("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
]
LEAST_CONTRAST = 4.5
LEAST_FONT_PX = 12.0
LEAST_TAP_PX = 44.0

#: Every piece of text that is shown: what it is, its size, its contrast, where it is.
TEXTS = """() => {
  const canvas = new OffscreenCanvas(1, 1).getContext("2d", { willReadFrequently: true });
  const paint = (colour) => {
    canvas.clearRect(0, 0, 1, 1);
    canvas.fillStyle = colour;
    canvas.fillRect(0, 0, 1, 1);
    return [...canvas.getImageData(0, 0, 1, 1).data];
  };
  const light = ([r, g, b]) => {
    const [x, y, z] = [r, g, b].map((c) => {
      const s = c / 255;
      return s <= 0.04045 ? s / 12.92 : ((s + 0.055) / 1.055) ** 2.4;
    });
    return 0.2126 * x + 0.7152 * y + 0.0722 * z;
  };
  const behind = (element) => {
    for (let e = element; e; e = e.parentElement) {
      const colour = paint(getComputedStyle(e).backgroundColor);
      if (colour[3] === 255) return colour;
    }
    return [255, 255, 255, 255];
  };
  const found = [];
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walker.nextNode()) {
    const node = walker.currentNode;
    const element = node.parentElement;
    if (!node.textContent.trim() || element.closest("script, style, noscript")) continue;
    const range = document.createRange();
    range.selectNodeContents(node);
    const box = range.getBoundingClientRect();
    if (box.width === 0 || !element.checkVisibility()) continue;
    const style = getComputedStyle(element);
    const svg = element.closest("svg");
    const ink = light(paint(svg ? style.fill : style.color));
    const ground = light(behind(svg ? svg.parentElement : element));
    found.push({
      text: node.textContent.trim().slice(0, 40), size: parseFloat(style.fontSize),
      contrast: (Math.max(ink, ground) + 0.05) / (Math.min(ink, ground) + 0.05),
      chart: svg !== null,
    });
  }
  return found;
}"""

#: Per figure: size of its drawing, its traces, its words that overlap or stick out.
FIGURES = """() => [...document.querySelectorAll(".plot")].map((plot) => {
  const frame = plot.getBoundingClientRect();
  const words = [...plot.querySelectorAll("svg text")]
    .map((text) => [text.textContent, text.getBoundingClientRect()])
    .filter(([text, box]) => text && box.width > 0);
  const cropped = words.filter(([, box]) => box.left < frame.left - 1 || box.right > frame.right + 1
    || box.top < frame.top - 1 || box.bottom > frame.bottom + 1);
  const overlapping = [];
  words.forEach(([one, a], i) => words.slice(i + 1).forEach(([other, b]) => {
    const across = Math.min(a.right, b.right) - Math.max(a.left, b.left);
    const down = Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top);
    if (across > 1 && down > 2) overlapping.push(`${one} | ${other}`);
  }));
  const drawn = [...plot.querySelectorAll(".trace.scatter")].filter((trace) =>
    [...trace.querySelectorAll("path")].some((path) => {
      const box = path.getBoundingClientRect();
      return box.width + box.height > 0;
    }));
  const svg = plot.querySelector("svg").getBoundingClientRect();
  return {
    key: plot.dataset.key, width: svg.width, height: svg.height, traces: drawn.length,
    cropped: cropped.map(([text]) => text), overlapping, words: words.length,
    data: plot.data.map(({ x, y }) => [x, y]),
  };
})"""

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


def find_browser():
    spec = importlib.util.spec_from_file_location("workspace", ROOT / "tools" / "workspace.py")
    workspace = importlib.util.module_from_spec(spec)
    sys.modules["workspace"] = workspace
    spec.loader.exec_module(workspace)
    found = workspace.find_browser(os.environ)
    assert found, workspace.NO_BROWSER
    return found


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    out = tmp_path_factory.mktemp("reproduction")
    assert main(["reproduce", "--out", str(out)]) == 0
    return out


@pytest.fixture(scope="module")
def report(folder):
    return json.loads((folder / DATA).read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def browser():
    with sync_playwright() as play:
        opened = play.chromium.launch(executable_path=find_browser(), args=FLAGS)
        yield opened
        opened.close()


@pytest.fixture
def open_page(browser, folder):
    """Opens the page as a reader would, network off; afterwards nothing may have gone wrong."""
    complaints = []
    contexts = []

    def opener(size, theme, **settings):
        width, height = SIZES[size]
        context = browser.new_context(
            viewport={"width": width, "height": height},
            color_scheme=theme,
            offline=True,
            **settings,
        )
        contexts.append(context)
        page = context.new_page()
        page.on("console", lambda message: complaints.append(message.text))
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on(
            "request",
            lambda request: request.url.startswith("file://") or complaints.append(request.url),
        )
        page.goto((folder / PAGE).as_uri())
        page.wait_for_function("document.documentElement.dataset.drawn", timeout=240_000)
        return page

    yield opener
    for context in contexts:
        context.close()
    assert not complaints


@pytest.mark.parametrize("theme", THEMES)
@pytest.mark.parametrize("size", SIZES)
def test_the_page_is_legible(open_page, report, size, theme):
    page = open_page(size, theme)
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")

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
        assert figure["width"] > 0.75 * min(SIZES[size][0], 480), figure["key"]
        assert figure["height"] > 250, figure["key"]
        assert figure["traces"] == len(series), figure["key"]
        assert figure["words"] > 5, figure["key"]
        assert not figure["cropped"], figure["key"]
        assert not figure["overlapping"], figure["key"]
        assert figure["data"] == [[one["x"], one["y"]] for one in series], figure["key"]

    texts = page.evaluate(TEXTS)
    assert sum(text["chart"] for text in texts) > 5 * len(figures)
    assert not [text for text in texts if text["contrast"] < LEAST_CONTRAST]
    assert not [text for text in texts if text["size"] < LEAST_FONT_PX]


def test_the_page_shows_what_the_file_holds_and_answers(open_page, report):
    page = open_page("wide", "light")
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
    """Text without the marks that the page turns into indices and links."""
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


def test_the_button_changes_the_theme_of_page_and_plots(open_page):
    page = open_page("wide", "dark")
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


def test_the_contents_can_be_tapped(open_page):
    page = open_page("narrow", "light", has_touch=True, is_mobile=True)
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


def test_the_numbers_of_the_file_are_finite(folder):
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

    walk(json.loads((folder / DATA).read_text(encoding="utf-8"), parse_constant=refuse))
