# SPDX-License-Identifier: Apache-2.0
"""The page on the thesis: one HTML file with everything in it."""

from collections.abc import Sequence

from ares_studies.pages.templates import make_environment, one_line, render_report
from ares_thesis.reproduce.model import Dot, Report


def _place(dot: Dot, dots: Sequence[Dot]) -> str:
    """Where a dot stands on its line, in percent, with a little room at the ends."""
    values = [other.cell.value or 0.0 for other in dots]
    low, high = min(values), max(values)
    share = ((dot.cell.value or 0.0) - low) / (high - low)
    return f"{2.0 + 96.0 * share:.2f}"


def dump(report: Report) -> str:
    """The report as JSON: no nan, no infinity."""
    return one_line(report.to_json())


def render(report: Report, data: str, json_name: str) -> str:
    """The page.

    Args:
        report: what to show.
        data: the same as JSON, which the figures are drawn from.
        json_name: name of the file that holds it beside the page.
    """
    environment = make_environment(__package__)
    environment.filters["place"] = _place
    return render_report(environment, report, data, json_name=json_name)
