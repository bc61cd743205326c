# SPDX-License-Identifier: Apache-2.0
"""The site builds without warnings, holds the sources' contents, and needs no network."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

import site_pages
from ares_models.mission import Mission
from ares_trials.testing.pages import THEMES
from ares_vehicle_sim.dispersions import Dispersions

ROOT = Path(__file__).parent.parent


#: Code that is cut: beyond the window, with nothing around it that scrolls.
CUT = """() => [...document.querySelectorAll("article code, article pre")].filter((code) => {
  const column = document.querySelector("article");
  const scrolls = (e) => /auto|scroll/.test(getComputedStyle(e).overflowX);
  let within = code;
  while (within !== column && !scrolls(within)) within = within.parentElement;
  const box = (within === column ? code : within).getBoundingClientRect();
  return box.right > innerWidth;
}).map((code) => code.textContent.slice(0, 60))"""


def build(folder: Path, *, tools: Path = ROOT / "tools") -> "subprocess.CompletedProcess[str]":
    return subprocess.run(
        [sys.executable, str(tools / "build_site.py"), str(folder)],
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site") / "html"
    done = build(folder)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == f"site: {folder / 'index.html'}\n"
    return folder


@pytest.mark.trial
def test_every_document_is_a_page(site: Path) -> None:
    documents = {path.stem for path in ROOT.glob("docs/*.md")}
    assert len(documents) > 10
    assert {path.stem for path in site.glob("*.html")} >= documents | {"index", "contributing"}


def test_the_reference_names_every_field_and_parameter(site: Path) -> None:
    messages = (site / "reference" / "messages.html").read_text()
    for path in [
        path for kind in ("msg", "srv", "action") for path in ROOT.glob(f"src/ares_msgs/{kind}/*")
    ]:
        assert f"<h2>{path.stem}<" in messages
        for line in path.read_text().splitlines():
            if found := re.match(r"[A-Za-z]\S* (\w+)\s*(=|#|$)", line):
                assert f">{found[1]}<" in messages
    parameters = (site / "reference" / "parameters.html").read_text()
    assert ">optimizer_timeout_s<" in parameters
    assert "a number from 0 to 60 s" in parameters
    # every process of a node has its table
    for path in ROOT.glob("src/*/setup.py"):
        for node in re.findall(r'"(\w+) = ares_[\w.]+\.(?:__main__|node)\b', path.read_text()):
            assert f"<h2>{node}<" in parameters or node in {"ares", "judge"}


def test_the_reference_names_every_key(site: Path) -> None:
    page = (site / "reference" / "keys.html").read_text()
    for model in (Mission, Dispersions):
        schema = model.model_json_schema()
        for part in [schema, *schema["$defs"].values()]:
            for key in part.get("properties", {}):
                assert f">{key}<" in page
    assert "0.001 to 864000 or <code" in page  # burn_time_s, or free


def test_the_command_line_shows_every_verb(site: Path, ares) -> None:
    page = (site / "reference" / "command_line.html").read_text()
    verbs = re.findall(r"^  (\w+) +\S", ares("--help").stdout.partition("Commands:")[2], re.M)
    assert "fly" in verbs
    for verb in verbs:
        if verb not in {"prepare", "exec", "env", "test"}:
            assert f"<h2>ares {verb}<" in page


def test_a_link_is_called_as_what_it_leads_to(site: Path) -> None:
    pages = {path: path.read_text() for path in site.rglob("*.html")}
    links = [
        (re.sub(r"<[^>]+>", "", words), path.name)
        for path, page in pages.items()
        for words in re.findall(r'<a class="reference internal"[^>]*>(.*?)</a>', page, re.DOTALL)
    ]
    assert len(links) > 500
    assert [link for link in links if re.search(r"\w\.md\b", link[0])] == []
    # a part of a page has the name of its heading
    text = (site / "missions.html").read_text()
    assert re.search(
        r'href="guidance.html#flights-by-a-plan-legs-py"><[^>]+>Flights by a plan', text
    )
    assert site_pages.title(ROOT / "docs" / "guidance.md", "#flights-by-a-plan-legspy") == (
        "Flights by a plan (`legs.py`)"
    )
    assert site_pages.title(ROOT / "docs" / "missions.md", "") == "Mission files"


def test_each_page_says_whose_it_is(site: Path) -> None:
    for path in site.rglob("*.html"):
        page = path.read_text()
        footer = page[page.rindex("<footer") :]
        assert (
            f"Ares {site_pages.version()}: ascent guidance on ROS 2. Licence: Apache-2.0." in footer
        )
        assert "&#169;" not in footer


def test_nothing_is_asked_of_a_network(site: Path) -> None:
    elsewhere = r"[\"'(](https?:)?//"
    for page in site.rglob("*.html"):
        for tag in re.findall(r"<(?:script|img|iframe|link)\b[^>]*>", page.read_text()):
            assert not re.search(elsewhere, tag), page
    for sheet in site.rglob("*.css"):
        assert not re.search(rf"@import|url{elsewhere}", sheet.read_text()), sheet


@pytest.mark.parametrize(
    "name",
    [
        *("index", "reference/command_line", "your_law"),
        *(
            # the longest, of the same parts as the others
            pytest.param(name, marks=pytest.mark.trial)
            for name in ("missions", "reference/messages")
        ),
    ],
)
def test_a_page_is_legible(site: Path, browser, serious_faults, name: str) -> None:
    with browser.new_context(viewport={"width": 390, "height": 844}, offline=True) as context:
        page = context.new_page()
        page.goto((site / f"{name}.html").as_uri())
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
        assert page.evaluate(CUT) == []
        for theme in THEMES:
            page.emulate_media(color_scheme=theme)
            assert serious_faults(page) == [], theme


@pytest.mark.trial
def test_a_link_that_leads_nowhere_is_an_error(tmp_path: Path) -> None:
    tree = tmp_path / "tree"
    (tree / "tools").mkdir(parents=True)
    for name in ("docs", "src", "benchmarks", "README.md", "QUALITY_DECLARATION.md"):
        (tree / name).symlink_to(ROOT / name)
    (tree / "CONTRIBUTING.md").write_text("# Contributing\n\n[b](docs/install.md#gone)\n")
    (tree / "tools" / "site").symlink_to(ROOT / "tools" / "site")
    for name in ("build_site.py", "site_pages.py"):
        (tree / "tools" / name).write_text((ROOT / "tools" / name).read_text())
    done = build(tmp_path / "html", tools=tree / "tools")
    assert done.returncode == 1
    assert "gone" in done.stderr
    assert "Traceback" not in done.stderr
    with pytest.raises(
        site_pages.SiteError, match=r"^a\.md: link to lost\.md, which is not there$"
    ):
        site_pages.relinked("[a](lost.md)", "a.md", "a.md")
