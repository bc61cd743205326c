# SPDX-License-Identifier: Apache-2.0
"""The report: its numbers are correct, complete, and explained."""

import json
import math
import re

import numpy as np
import pytest

from ares_studies.pages.parts import (
    BLANK,
    MINUS,
    line,
    number,
    power,
    small,
    thin,
    word,
)
from ares_studies.pages.templates import PALETTES, prose
from ares_thesis.reproduce import printed
from ares_thesis.reproduce.model import beside
from ares_thesis.reproduce.page import dump, render
from ares_thesis.reproduce.report import make_report, parts


@pytest.fixture(scope="module")
def progress():
    return []


@pytest.fixture(scope="module")
def report(progress):
    return make_report(progress.append)


@pytest.fixture(scope="module")
def items(report):
    return {item.key: item for chapter in report.chapters for item in chapter.items}


def tables(report):
    for chapter in report.chapters:
        for item in chapter.items:
            if item.kind == "table":
                yield item.key, item.content
    yield "headline", report.headline


TIMES = "\N{NO-BREAK SPACE}\N{MULTIPLICATION SIGN}\N{NO-BREAK SPACE}10"
RAISED = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")


def value_of(text):
    """Parse a number as shown."""
    text = text.replace(MINUS, "-").replace(",", "")
    if TIMES in text:
        mantissa, exponent = text.split(TIMES)
        return float(mantissa) * 10.0 ** int(exponent.translate(RAISED))
    return float(text)


def test_a_number_is_rounded_to_what_is_shown():
    assert number(174183.083, 1).text == "174,183.1"
    assert number(174183.083, 1).value == 174183.1
    assert number(-24.378, 2, signed=True).text == f"{MINUS}24.38"
    assert number(753.08, 1, signed=True).text == "+753.1"
    assert number(-0.0004, 3, signed=True).text == "0.000"
    assert number(math.nan, 3).value is None
    assert power(-6.62e-8).text == f"{MINUS}6.62{TIMES}⁻⁸"
    assert power(1.46e-8).value == 1.46e-8
    assert word("free").value is None
    assert [small(x).text for x in (5.5, 0.0066, -1e-11)] == ["+5.5", "+0.0066", "< 10⁻⁹"]


def test_a_row_has_its_difference():
    row = beside("Mass, kg", 173430, 174183.08, 1, 0)
    assert [cell.text for cell in row.cells] == ["173,430", "174,183.1", "+753.1"]
    assert [cell.text for cell in beside("Mass, kg", math.nan, 1.0, 1).cells] == [
        BLANK,
        "1.0",
        BLANK,
    ]


def test_thinning_keeps_ends_corners_steps_and_gaps():
    x = np.linspace(0.0, 10.0, 5001)
    y = np.where(x < 5.0, x, 10.0 - x)
    y[2000:2100] = np.nan
    y[4000:] += 3.0
    kept = thin(x, y)
    assert len(kept) < 400
    assert {0, 2500, 3999, 4000, 5000} <= set(kept.tolist())
    assert np.isnan(y[kept]).any()
    solid = np.isfinite(y)
    drawn = np.interp(x[solid], x[kept][np.isfinite(y[kept])], y[kept][np.isfinite(y[kept])])
    assert np.max(np.abs(drawn - y[solid])) < 2e-3 * np.ptp(y[solid])


def test_a_line_with_a_gap_has_none_there():
    drawn = line("a", "here", [0.0, 1.0, 2.0], [1.0, math.nan, 3.0], 1)
    assert drawn.y == (1.0, None, 3.0)


def test_marks_in_a_text():
    assert prose("t_PLF < 3") == "t<sub>PLF</sub> &lt; 3"
    assert prose("see [E3, E4]") == (
        'see <span class="cite">[<a href="#E3">E3</a>, <a href="#E4">E4</a>]</span>'
    )
    assert prose("ares_v and peg_thesis") == "ares_v and peg_thesis"


def test_both_themes_name_the_same_colours():
    assert set(PALETTES["light"]) == set(PALETTES["dark"])


@pytest.mark.trial
def test_progress_names_every_part(report, progress):
    assert report.chapters
    assert progress == parts()


@pytest.mark.trial
def test_texts_and_values_agree(report):
    for key, table in tables(report):
        for row in table.rows:
            assert len(row.cells) == len(table.columns), key
            for cell in row.cells:
                if cell.value is not None:
                    assert value_of(cell.text) == pytest.approx(cell.value, rel=1e-12), key


def test_differences_are_differences(report):
    seen = 0
    for key, table in tables(report):
        for i, column in enumerate(table.columns):
            if column.title not in ("difference", f"here {MINUS} thesis"):
                continue
            assert [column.role for column in table.columns[i - 2 : i]] == ["thesis", "here"], key
            for row in table.rows:
                thesis, here, difference = row.cells[i - 2 : i + 1]
                if difference.value is None:
                    continue
                seen += 1
                decimals = len(difference.text.partition(".")[2])
                assert difference.value == pytest.approx(
                    (here.value or 0.0) - thesis.value, abs=1.01 * 10.0**-decimals
                ), f"{key}: {row.label}"
    assert seen > 40


def test_a_sentence_stands_where_a_table_differs(report):
    for key, table in tables(report):
        for row in table.rows:
            for column, found in zip(table.columns, row.cells, strict=True):
                if column.title == "difference" and found.value:
                    assert row.note or table.finding, f"{key}: {row.label}"


def test_errata_are_cited_by_their_names(report):
    known = [erratum.key for erratum in report.errata]
    assert known == [f"E{i + 1}" for i in range(len(known))]
    cited = set(re.findall(r"\bE\d+\b", " ".join(re.findall(r"\[[^]]*\]", dump(report)))))
    assert cited <= set(known)
    assert len(cited) > 5


def test_the_file_is_plain_json_and_the_page_carries_it(report):
    data = dump(report)
    assert "NaN" not in data and "Infinity" not in data
    page = render(report, data, "numbers.json")
    inside = re.search(r'<script type="application/json" id="report">(.*?)</script>', page, re.S)
    assert json.loads(inside[1]) == json.loads(data)
    assert "{{" not in page.split("<script>")[0]


def cell(items, key, label, column):
    table = items[key].content
    (row,) = [row for row in table.rows if row.label.startswith(label)]
    place = [i for i, head in enumerate(table.columns) if head.title == column]
    return row.cells[place[0]].value


def test_chapters_two_to_four(items):
    assert cell(items, "table-2.1", "Initial flight-path", "here") == pytest.approx(10.4436)
    assert cell(items, "table-2.2", "Flow of the upper", "here") == pytest.approx(297.417)
    assert cell(items, "table-2.2", "Stays behind", "here") == pytest.approx(142_763, abs=1.0)
    assert cell(items, "table-4.1", "Final mass m_f", "here") == pytest.approx(174_183.1, abs=0.1)
    assert cell(items, "table-4.1", "Jettison", "here") == pytest.approx(416.64, abs=0.05)
    held = cell(items, "table-4.1", "Final mass, jettison held", "here")
    assert held == pytest.approx(174_088.9, abs=0.1)


def test_the_analytic_solutions(items):
    assert cell(items, "table-6.2", "T_go", "here") == pytest.approx(84.9, abs=0.1)
    assert cell(items, "table-6.2", "Iterations", "here") <= 10
    assert cell(items, "table-6.2", "T_go", "improved") == pytest.approx(79.49, abs=1.0)
    assert cell(items, "table-6.4", "T_go", "here") == pytest.approx(350.26, abs=1.0)
    times = [row.cells[3].value for row in items["table-6.3"].content.rows]
    assert len(times) == 8
    assert max(times) - min(times) < 0.1
    assert cell(items, "table-6.6", "Start to staging", "here") == pytest.approx(4.0764, abs=1e-4)


def test_what_transients_explain_of_the_row_of_otis(items):
    otis = items["table-4.1-otis"].content
    bound = otis.rows[-2].cells
    assert (bound[1].value, bound[5].value) == (784.0, 2469.0)


TABLES = ("2.1", "2.2", "3.1", "4.1", "5.1", "5.2", *(f"6.{i}" for i in range(1, 9)))
FIGURES = (
    *(f"4.{i}" for i in (*range(1, 8), *range(9, 15))),
    *("5.3", "5.4"),
    *(f"6.{i}" for i in (*range(1, 7), *range(8, 18))),
)


def test_every_table_and_figure_is_there(items):
    assert {f"table-{number}" for number in TABLES} <= set(items)
    assert {f"figure-{number}" for number in FIGURES} == {
        key for key in items if key.startswith("figure")
    }
    for key, item in items.items():
        assert item.title and item.see, key
        if item.kind == "table":
            assert all(len(row.cells) == len(item.content.columns) for row in item.content.rows)
        else:
            lines = [series for series in item.content.series if series.shape != "marks"]
            assert lines, key
            assert all(len(series.x) > 50 for series in lines), key


def test_what_peg_flies(items):
    assert abs(cell(items, "table-6.7", "Radius error", "PEG of the thesis")) < 10.0
    assert cell(items, "table-6.7", "Speed error", "PEG of the thesis") is None  # below 1e-9
    assert abs(cell(items, "table-6.7", "Flight-path", "PEG of the thesis")) < 1e-3
    optimum = cell(items, "table-6.8", "Final mass", "optimum")
    assert optimum == 173_430
    lost = {
        column: 174_183.1 - cell(items, "table-6.8", "Final mass", column)
        for column in ("PEG of the thesis", "multi-stage PEG")
    }
    assert 0.0 < lost["multi-stage PEG"] < lost["PEG of the thesis"] < 300.0


def test_the_prediction_of_the_thesis_jumps_at_staging(items):
    printed_peg, ours, _ = items["figure-6.14"].content.series
    spread = []
    for series in (printed_peg, ours):
        near = [
            y for x, y in zip(series.x, series.y, strict=True) if y is not None and 330 < x < 360
        ]
        spread.append(max(near) - min(near))
    assert spread[0] > 5.0 > 2.0 > spread[1]


def test_the_linear_column_of_table_3_1_is_the_literal_equation():
    """Compute (mu/r^3)^2 r in km/s2, at the radii of the inverse-square column."""
    table = printed.values("table-3.1")
    for square, linear in zip(table["inverse_square"], table["linear"], strict=True):
        radius = math.sqrt(3.986e14 / square)
        assert (3.986e14 / radius**3) ** 2 * radius / 1e3 == pytest.approx(linear, rel=4e-3)


def test_figures_mark_printed_points_where_there_are_any(items):
    heating = items["figure-4.6"].content
    at = {series.role: series.x for series in heating.series if series.shape == "marks"}
    assert at == {"thesis": (441.02,), "otis": (422.20,)}
    (limit,) = heating.levels
    assert limit.at == pytest.approx(1.135)
    curve = heating.series[0]
    jettison = heating.instants[1].at
    finite = [(x, y) for x, y in zip(curve.x, curve.y, strict=True) if y is not None]
    x, y = np.array(finite).T
    assert np.interp(jettison, x, y) == pytest.approx(limit.at, rel=0.01)
