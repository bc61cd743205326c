# SPDX-License-Identifier: Apache-2.0
"""Render templates to one self-contained HTML file."""

import base64
import gzip
import json
import re
from importlib.resources import files

import plotly as plotly_package
from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

#: Colours by name and theme; each is legible on `panel` and on `ground`.
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
        "fourth": "#5a1508",
        "fifth": "#2414e0",
        "sixth": "#1d1650",
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
        "fourth": "#eef06a",
        "fifth": "#7580ff",
        "sixth": "#b4f7c6",
    },
}

_CITATION = re.compile(r"\[(E\d+(?:, E\d+)*)\]")
_INDEX = re.compile(r"(?<![A-Za-z_])([A-Za-zΑ-ωΔ]{1,2})_([A-Za-z]+\d?|\d+)")


def chosen_name(text: str) -> Markup:
    """Mark a user's name to be shown literally: f_igm has no index."""
    return escape(text)


def prose(text: str) -> Markup:
    """Format text: ``t_PLF`` gets an index, ``[E3]`` becomes a link to the erratum.

    Markup, such as of `chosen_name`, is left unchanged.
    """
    if isinstance(text, Markup):
        return text
    marked = _INDEX.sub(r"\1<sub>\2</sub>", str(escape(text)))
    return Markup(_CITATION.sub(_links, marked))


def _links(match: re.Match[str]) -> str:
    keys = match[1].split(", ")
    links = ", ".join(f'<a href="#{key}">{key}</a>' for key in keys)
    return f'<span class="cite">[{links}]</span>'


def make_environment(*packages: str) -> Environment:
    """Load the templates of this package and of others, with the filters of prose.

    Args:
        packages: with templates of the page.
    """
    loaders = [PackageLoader(name, "") for name in (__package__, *packages)]
    environment = Environment(
        loader=ChoiceLoader(loaders), autoescape=True, undefined=StrictUndefined, trim_blocks=True
    )
    environment.filters["prose"] = prose
    return environment


def one_line(data: object) -> str:
    """Write JSON for a script: on one line, without nan and infinity.

    Raises:
        ValueError: the data contain one of these.
    """
    return json.dumps(data, allow_nan=False, ensure_ascii=False, separators=(",", ":"))


def render_report(environment: Environment, report: object, data: str, **shown: object) -> str:
    """Render a report as one self-contained page.

    Args:
        environment: with the template `report.html`.
        report: shown by the template.
        data: JSON for the scripts.
        shown: further variables of the template.
    """
    template = environment.get_template("report.html")
    return template.render(
        report=report, palettes=PALETTES, data=embedded(data), plotly=plotly(), **shown
    )


def embedded(data: str) -> Markup:
    """Escape JSON for a script element."""
    return Markup(data.replace("</", "<\\/"))


#: Compression level; the highest takes half as long again and saves 0.2 % of the size.
_LEVEL = 6


def plotly() -> Markup:
    """Return the plotting library, compressed, for `page.js` to unpack.

    The file is read directly, since importing its package is slow.
    """
    script = files(plotly_package).joinpath("package_data", "plotly.min.js")
    packed = gzip.compress(script.read_bytes(), _LEVEL, mtime=0)
    return Markup(
        '<script type="text/plain" id="plotly">{}</script>\n'
        '<p id="too-old" hidden>The figures need a browser that can unpack them '
        "(DecompressionStream, in all browsers since 2023); the tables do not.</p>"
    ).format(Markup(base64.b64encode(packed).decode("ascii")))
