# SPDX-License-Identifier: Apache-2.0
"""Render the page on the thesis as one self-contained HTML file."""

from collections.abc import Sequence

from ares_studies.pages.templates import make_environment, one_line, render_report
from ares_thesis.reproduce.model import Dot, Report


def _place(dot: Dot, dots: Sequence[Dot]) -> str:
    """Return the position of a dot on its line, in percent, with margins at the ends."""
    values = [other.cell.value or 0.0 for other in dots]
    low, high = min(values), max(values)
    share = ((dot.cell.value or 0.0) - low) / (high - low)
    return f"{2.0 + 96.0 * share:.2f}"


def dump(report: Report) -> str:
    """Write the report as JSON without nan and infinity."""
    return one_line(report.to_json())


def render(report: Report, data: str, json_name: str) -> str:
    """Render the page.

    Args:
        report: to show.
        data: the same as JSON, source of the figures.
        json_name: name of its file beside the page.
    """
    environment = make_environment(__package__)
    environment.filters["place"] = _place
    return render_report(environment, report, data, json_name=json_name)
