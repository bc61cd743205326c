"""Templates of pages: one HTML file with everything in it."""

import re

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape
from plotly.offline import get_plotlyjs

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


def make_environment(package: str) -> Environment:
    """Templates of this package and of another, with the marks of prose.

    Args:
        package: where the page's own templates lie.
    """
    loaders = [PackageLoader(name, "") for name in (__package__, package)]
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
