# SPDX-License-Identifier: Apache-2.0
"""`ares optimize --out`: the optimum as a page, alone and beside a flight."""

import json
import re
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from ares_bringup.commands.cli import main
from ares_models.mission import read_mission
from ares_studies.flight_page.optimum import _passed
from ares_trials.testing.pages import illegible

REFERENCE = Path(__file__).parent.parent / "bags" / "reference"
OPTIMALITY = [
    "Primer vector, size",
    "Primer vector, direction",
    "Switching function",
    "Hamiltonian",
]


@pytest.fixture(scope="module")
def beside(tmp_path_factory):
    """Make the page of the reference mission's optimum, with the flight overlaid."""
    out = tmp_path_factory.mktemp("optimum") / "beside.html"
    assert main(["optimize", "--json", "--out", str(out), "--beside", str(REFERENCE)]) == 0
    return out


@pytest.fixture(scope="module")
def transfer(tmp_path_factory):
    """Make the page of the optimum of two burns and a free coast."""
    out = tmp_path_factory.mktemp("optimum") / "transfer.html"
    words = ["optimize", "--json", "--mission", "geostationary_transfer", "--out", str(out)]
    assert main(words) == 0
    return out


def data(path):
    text = path.read_text(encoding="utf-8").split('id="report">', 1)[1].split("</script>", 1)[0]
    return json.loads(text.replace("<\\/", "</"))


def figure(path, title):
    items = [item for chapter in data(path)["chapters"] for item in chapter["items"]]
    return next(item["content"] for item in items if item["title"] == title)


def test_the_optimum_has_the_parts_of_a_flight_and_its_proof(transfer):
    titles = [item["title"] for chapter in data(transfer)["chapters"] for item in chapter["items"]]
    assert {"Altitude", "Pitch of the thrust", "Ground track", "Propellant"} <= set(titles)
    assert [title for title in titles if title in OPTIMALITY] == OPTIMALITY
    text = transfer.read_text(encoding="utf-8")
    assert '<p class="verdict">Optimal</p>' in text
    assert "Constraints and their prices" in text
    assert re.search(r"<code>ares optimize</code>", text)
    facts = dict(re.findall(r"<dt>([^<]+)</dt><dd>([^<]+)</dd>", text))
    assert facts["proof"].startswith("flown again by another integrator: within ")
    assert facts["Hamiltonian"].startswith("constant on each arc within ")
    assert re.fullmatch(r"\d+ iterations(, \d+ restarts)?, [\d.]+ ms", facts["search"])
    # burns where it is above zero, coasts where it is below
    (line,) = figure(transfer, "Switching function")["series"]
    points = zip(line["x"], line["y"], strict=True)
    coast = [y for x, y in points if 470.0 < x < 1320.0]
    assert coast
    assert max(coast) < 0.0
    assert [guide["text"] for guide in figure(transfer, "Altitude")["instants"]] == [
        "coast",
        "ignition",
        "cut-off",
    ]


def test_a_flight_lies_over_it_with_the_differences(beside):
    names = [line["name"] for line in figure(beside, "Altitude")["series"]]
    assert names == ["optimum", "flown, peg"]
    text = beside.read_text(encoding="utf-8")
    assert "Optimum, method indirect, beside a flight by peg" in text
    row = re.search(r"final mass, kg</th>(.*?)</tr>", text, re.DOTALL)[1]
    cells = re.findall(r"[\d,]+\.\d\d", row)
    optimum, flown, away = (float(cell.replace(",", "")) for cell in cells)
    assert flown == 174_117.62
    assert optimum - flown == pytest.approx(away, abs=0.011)
    # guidance has charts, the optimum none of them
    assert [line["name"] for line in figure(beside, "Time to go")["series"]] == ["flown, peg"]


@pytest.mark.trial
@pytest.mark.parametrize(
    ("which", "size", "theme"),
    list(product(("transfer", "beside"), ("wide", "narrow"), ("light", "dark"))),
)
def test_it_can_be_read(open_file, request, which, size, theme):
    page = open_file(request.getfixturevalue(which), size, theme)
    assert not illegible(page, size)


def test_an_event_with_several_rows_is_passed_once():
    # an event of the program and one of its timetable, a rounding apart
    time = np.array([0.0, 1.0, 1.0, 1.0 + 1e-14, 1.0 + 1e-14, 2.0])
    expected = [False, False, True, True, True, True]
    assert _passed(time, [1.0])[:, 0].tolist() == expected
    assert _passed(np.array([0.0, 1.0]), [1.0])[:, 0].tolist() == [False, False]
    assert _passed(np.array([0.0, 1.0, 2.0]), [1.0])[:, 0].tolist() == [False, True, True]


@pytest.mark.trial
def test_the_words_of_marks_that_lie_close_are_all_there_and_apart(open_file, tmp_path):
    out = tmp_path / "falcon.html"
    assert main(["optimize", "--json", "--mission", "falcon9_gto", "--out", str(out)]) == 0
    words = [guide["text"] for guide in figure(out, "Altitude")["instants"]]
    # 300 s of 1,500 s lie between two of them
    assert words == ["ignition", "jettison", "coast", "ignition", "cut-off"]
    for size in ("wide", "narrow"):
        page = open_file(out, size, "light")
        assert not illegible(page, size)
        shown = page.locator(".plot").first.locator(".annotation-text").all_text_contents()
        assert shown == [word for word in words if word]


def test_a_flight_with_other_numbers_is_told(tmp_path, capfd):
    edited = tmp_path / "edited.yaml"
    edited.write_text(read_mission("ares_v")[1].replace("1227734.0", "1227733.0"))
    words = ("--mission", str(edited), "--out", str(tmp_path / "p.html"))
    capfd.readouterr()
    assert main(["optimize", "--json", *words, "--beside", str(REFERENCE)]) == 0
    assert capfd.readouterr().err.endswith(
        f"ares: {REFERENCE}: ares_v has other numbers now than it was flown with\n"
    )


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--out", "page.pdf"), "expected a file ending in .html"),
        (("--beside", str(REFERENCE)), "--beside goes with --out only"),
        (("--out", "p.html", "--method", "analytic"), "--out does not go with --method analytic"),
        (("--out", "p.html", "--maximize", "payload"), "--out does not go with --maximize"),
        (("--out", "p.html", "--beside", "nowhere"), "does not exist"),
        (("--out", "no/such/p.html"), "cannot be written"),
        (
            ("--out", "p.html", "--mission", "delta_iii", "--beside", str(REFERENCE)),
            "flight of 'ares_v'; expected one of 'delta_iii'",
        ),
    ],
)
def test_bad_input_is_one_line(tmp_path, monkeypatch, capfd, words, said):
    monkeypatch.chdir(tmp_path)
    capfd.readouterr()
    assert main(["optimize", "--json", *words]) == 2
    err = capfd.readouterr().err
    assert said in err
    assert err.count("\n") == 1
    assert not list(tmp_path.iterdir())
