"""The page: one HTML file with everything in it."""

import json
import re
from collections.abc import Sequence

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape
from plotly.offline import get_plotlyjs

from ares_studies.reproduce.model import Dot, Report

#: Names of colours; each pair is legible on `panel` and on `ground`.
PALETTES = {
    "light": {
        "ground": "#f6f7f8",
        "panel": "#ffffff",
        "ink": "#1a2027",
        "quiet": "#56606b",
        "edge": "#d9dee3",
        "faint": "#eceff2",
        "link": "#0a58a8",
        "here": "#0a58a8",
        "other": "#0b7a6f",
        "third": "#8d5a00",
        "thesis": "#b63d0a",
        "otis": "#6a45a8",
    },
    "dark": {
        "ground": "#12161b",
        "panel": "#191e25",
        "ink": "#e4e8ec",
        "quiet": "#a3adb8",
        "edge": "#323a44",
        "faint": "#262d36",
        "link": "#79b8f5",
        "here": "#6db1f5",
        "other": "#4cc2b0",
        "third": "#dcae4a",
        "thesis": "#f58f60",
        "otis": "#bba2f3",
    },
}

_CITATION = re.compile(r"\[(E\d+(?:, E\d+)*)\]")
_INDEX = re.compile(r"(?<![A-Za-z_])([A-Za-zΑ-ωΔ]{1,2})_([A-Za-z]+\d?|\d+)")


def prose(text: str) -> Markup:
    """Text with its marks: ``t_PLF`` gets an index, ``[E3]`` becomes a link to the erratum."""
    marked = _INDEX.sub(r"\1<sub>\2</sub>", str(escape(text)))
    return Markup(_CITATION.sub(_links, marked))


def _links(match: re.Match[str]) -> str:
    keys = match[1].split(", ")
    links = ", ".join(f'<a href="#{key}">{key}</a>' for key in keys)
    return f'<span class="cite">[{links}]</span>'


def _place(dot: Dot, dots: Sequence[Dot]) -> str:
    """Where a dot stands on its line, in percent, with a little room at the ends."""
    values = [other.cell.value or 0.0 for other in dots]
    low, high = min(values), max(values)
    share = ((dot.cell.value or 0.0) - low) / (high - low)
    return f"{2.0 + 96.0 * share:.2f}"


def dump(report: Report) -> str:
    """The report as JSON: no nan, no infinity."""
    return json.dumps(report.to_json(), allow_nan=False, ensure_ascii=False, separators=(",", ":"))


def make_environment(*packages: str) -> Environment:
    """Templates of this package and of others, with the marks of prose.

    Args:
        packages: where more templates lie.
    """
    loaders = [PackageLoader(package, "") for package in (__package__, *packages)]
    environment = Environment(
        loader=ChoiceLoader(loaders),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
    )
    environment.filters["prose"] = prose
    return environment


def embedded(data: str) -> Markup:
    """JSON as the content of a script element."""
    return Markup(data.replace("</", "<\\/"))


def plotly() -> Markup:
    """The library that draws, as the content of a script element."""
    return Markup(get_plotlyjs().replace("</script", "<\\/script"))


def render(report: Report, data: str, json_name: str) -> str:
    """The page.

    Args:
        report: what to show.
        data: the same as JSON, which the figures are drawn from.
        json_name: name of the file that holds it beside the page.
    """
    environment = make_environment()
    environment.filters["place"] = _place
    return environment.get_template("page.html").render(
        report=report,
        palettes=PALETTES,
        json_name=json_name,
        data=embedded(data),
        plotly=plotly(),
    )
