# SPDX-License-Identifier: Apache-2.0
"""Compose the pages of the site in Markdown: docs/, and pages generated from the sources.

Messages are read from their definitions, parameters from the nodes' tables, help from the command
line, measurements from benchmark results; the front page and the packages' pages are READMEs.
"""

import json
import posixpath
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent

#: Files outside of docs/ that are pages, with their names on the site.
PAGES = {
    "README.md": "index.md",
    "CONTRIBUTING.md": "contributing.md",
    "QUALITY_DECLARATION.md": "quality_declaration.md",
    "benchmarks/README.md": "benchmarks.md",
} | {
    f"src/{path.parent.name}/README.md": f"packages/{path.parent.name}.md"
    for path in sorted(ROOT.glob("src/*/README.md"))
}
PAGES |= {f"docs/{path.name}": path.name for path in sorted(ROOT.glob("docs/*.md"))}

#: The side bar: names of pages by chapter.
CHAPTERS = {
    "How to": (
        "install",
        "your_rocket",
        "missions",
        "your_law",
        "your_node",
        "hardware_in_the_loop",
        "live",
        "report",
        "replay",
        "security",
        "tools",
        "montecarlo",
        "aborts",
        "aborts_map",
        "launchers",
        "optimization",
        "contributing",
        "quality_declaration",
    ),
    "Theory": ("guidance", "optimal_guidance", "igm", "peg_thesis", "analytic", "reproduction"),
    "Inside": (
        "architecture",
        "reliability",
        "fuzzing",
        *(page.removesuffix(".md") for page in PAGES.values() if page.startswith("packages/")),
    ),
    "Reference": (
        "reference/messages",
        "reference/parameters",
        "reference/keys",
        "reference/command_line",
        "glossary",
        "benchmarks",
        "comparison",
    ),
}
INTERFACES = "src/ares_msgs"

VERSION = "src/ares_bringup/ares_bringup/__init__.py"

_HEADING = re.compile(r"^#+ (.+)$", re.MULTILINE)
_FENCED = re.compile(r"^```.*?^```", re.MULTILINE | re.DOTALL)
_NO_SLUG = re.compile(r"[^\w -]")
_LINK = re.compile(r"(!?)\[([^\]]*)\]\(([^)#\s]+)(#[^)\s]*)?\)")


class SiteError(ValueError):
    """Report in one line that a page cannot be made."""


def pages() -> dict[str, str]:
    """Return every page by its name on the site."""
    made = {page: moved(source, page) for source, page in PAGES.items()}
    made["index.md"] += contents()
    made["reference/messages.md"] = messages()
    made["reference/parameters.md"] = parameters()
    made["reference/keys.md"] = keys()
    made["reference/command_line.md"] = command_line()
    made["benchmarks.md"] = benchmarks()
    return made


def contents() -> str:
    """Write the side bar."""
    return "".join(
        f"\n```{{toctree}}\n:hidden:\n:caption: {caption}\n\n{chr(10).join(names)}\n```\n"
        for caption, names in CHAPTERS.items()
    )


def moved(source: str, page: str) -> str:
    """Return a file of the project as a page."""
    return relinked((ROOT / source).read_text(), source, page)


def relinked(text: str, source: str, page: str) -> str:
    """Convert a file's text to a page of the site.

    Args:
        text: Markdown.
        source: path of the file in the project, base of its links.
        page: its name on the site.

    Raises:
        SiteError: a link is broken.
    """

    def link(found: re.Match[str]) -> str:
        picture, words, target, anchor = found.groups()
        if "://" in target or target.startswith("mailto:"):
            return found.group()
        there = posixpath.normpath(posixpath.join(posixpath.dirname(source), target))
        on_site = PAGES.get(there) or (there[5:] if there.startswith("docs/images/") else None)
        if not (ROOT / there).exists():
            raise SiteError(f"{source}: link to {target}, which is not there")
        if on_site is None:
            # a source file is not on the site: name it only
            return f"{words} (`{there}`)" if words.strip("`") != there else f"`{there}`"
        relative = posixpath.relpath(on_site, posixpath.dirname(page) or ".")
        if words.strip("`") in (there, target, posixpath.basename(target)):
            words = title(ROOT / there, anchor or "")
        return f"{picture}[{words}]({relative}{anchor or ''})"

    return _LINK.sub(link, text)


def title(page: Path, anchor: str) -> str:
    """Return the heading of a page that an anchor names; the first heading without an anchor."""
    headings = _HEADING.findall(_FENCED.sub("", page.read_text()))
    named = {f"#{_NO_SLUG.sub('', text.lower()).replace(' ', '-')}": text for text in headings}
    return named.get(anchor, headings[0])


def version() -> str:
    """Return the version of the project."""
    found = re.search(r'__version__ = "(.+)"', (ROOT / VERSION).read_text())
    if found is None:
        raise SiteError(f"{VERSION} names no version")
    return found[1]


def cell(text: str) -> str:
    """Escape a text for a table cell."""
    return " ".join(text.split()).replace("|", "\\|")


def table(titles: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Format a Markdown table."""
    lines = [titles, ["---"] * len(titles), *([cell(item) for item in row] for row in rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


# ---- messages


def messages() -> str:
    """Describe every message, service and action with its fields."""
    from rosidl_adapter import parser

    parts = ["# Messages\n\nMade of the definitions in `src/ares_msgs`."]
    for path in sorted((ROOT / INTERFACES / "msg").glob("*.msg")):
        message = parser.parse_message_file("ares_msgs", path)
        parts += [f"## {path.stem}", *described(message)]
    for path in sorted((ROOT / INTERFACES / "srv").glob("*.srv")):
        service = parser.parse_service_file("ares_msgs", path)
        parts += [f"## {path.stem}", *described(service.request)]
        parts += ["### Answer", *described(service.response)]
    for path in sorted((ROOT / INTERFACES / "action").glob("*.action")):
        action = parser.parse_action_file("ares_msgs", path)
        parts += [f"## {path.stem}", *described(action.goal)]
        parts += ["### Result", *described(action.result)]
        parts += ["### Feedback", *described(action.feedback)]
    return "\n\n".join(parts)


def described(message: Any) -> Iterator[str]:
    """Yield text, constants and fields of a parsed message."""
    if text := message.annotations.get("comment"):
        yield "\n".join(text)
    if message.constants:
        yield table(
            ("constant", "type", "value", "what"),
            [
                (f"`{item.name}`", item.type, str(item.value), comment(item, message))
                for item in message.constants
            ],
        )
    if message.fields:
        yield table(
            ("field", "type", "what"),
            [
                (f"`{item.name}`", f"`{item.type}`", comment(item, message))
                for item in message.fields
            ],
        )


def comment(item: Any, message: Any) -> str:
    """Return the comment of a field or constant, with the unit that the parser has removed."""
    lines = item.annotations.get("comment", [])
    if lines and lines[0] in {field.name for field in message.fields}:
        # the name of the field to which the constants below belong
        lines = lines[1:]
    text = " ".join(lines)
    unit = item.annotations.get("unit")
    return f"{text} [{unit}]" if unit else text


# ---- parameters


def parameters() -> str:
    """Describe the parameters of each node."""
    from ares_bringup.parameter_tables import tables

    parts = ["# Parameters\n\nMade of the tables that the nodes declare their parameters from."]
    for node, table_rows in tables().items():
        rows = [
            (
                f"`{row.name}`",
                f"`{row.default!r}`" if row.default != "" else "",
                row.unit,
                row.expected,
                row.description,
            )
            for row in table_rows
        ]
        parts += [f"## {node}", table(("parameter", "default", "unit", "expected", "what"), rows)]
    return "\n\n".join(parts)


# ---- keys of files


def keys() -> str:
    """Describe every key of mission and dispersions files."""
    from ares_models.mission import Mission
    from ares_vehicle_sim.dispersions import Dispersions

    about = (
        "Made of the models that check the files; `ares missions schema` and `ares dispersions "
        "schema` print the same for editors. What keys must be together stands in "
        "[missions](../missions.md) and [campaigns](../montecarlo.md)."
    )
    parts = ["# Keys of mission and dispersions files", about]
    for title, model in (("Mission", Mission), ("Dispersions", Dispersions)):
        schema = model.model_json_schema()
        parts += [f"## {title}", key_table(schema)]
        for name, part in schema.get("$defs", {}).items():
            if "properties" in part:
                parts += [f"### {name}", part.get("description", ""), key_table(part)]
    return "\n\n".join(parts)


def key_table(part: Mapping[str, Any]) -> str:
    """Tabulate the keys of one mapping."""
    needed = part.get("required", ())
    return table(
        ("key", "value", "default", "what"),
        [
            (
                f"`{name}`",
                value_words(about),
                "needed" if name in needed else default_words(about.get("default")),
                about.get("description", ""),
            )
            for name, about in part["properties"].items()
        ],
    )


def default_words(value: Any) -> str:
    """Format a default; "" if the key may simply be omitted."""
    return "" if value in (None, [], {}) else f"`{value}`"


def value_words(about: Mapping[str, Any]) -> str:
    """Describe the valid values of a key from its JSON Schema."""
    for forms in ("anyOf", "oneOf"):
        if forms in about:
            words = [value_words(form) for form in about[forms] if form.get("type") != "null"]
            return " or ".join(dict.fromkeys(words))
    if "$ref" in about:
        return about["$ref"].rpartition("/")[2]
    if "const" in about:
        return f"`{about['const']}`"
    if "enum" in about:
        return ", ".join(f"`{choice}`" for choice in about["enum"])
    if "minimum" in about:
        return f"{about['minimum']:g} to {about['maximum']:g}"
    if about.get("type") == "array":
        inner = about.get("items") or about.get("prefixItems", [{}])[0]
        return f"list of {value_words(inner)}" if inner else "list"
    kinds = {"string": "text", "object": "mapping", "boolean": "true or false"}
    return kinds.get(about.get("type", ""), about.get("type", ""))


# ---- command line


def command_line() -> str:
    """Collect the help of every verb."""
    import typer

    from ares_bringup.commands.cli import app

    command = typer.main.get_command(app)
    parts = ["# Command line\n\nWhat `--help` says of each verb."]
    parts += [f"## {name}\n\n```text\n{text}\n```" for name, text in helps(command, "ares")]
    return "\n\n".join(parts)


def helps(command: Any, name: str) -> Iterator[tuple[str, str]]:
    """Yield full name and help of a command and its subcommands."""
    context = command.make_context(name, [], resilient_parsing=True)
    yield name, command.get_help(context)
    for below, child in getattr(command, "commands", {}).items():
        yield from helps(child, f"{name} {below}")


# ---- benchmarks


def benchmarks() -> str:
    """Describe the kept benchmark results, then the method."""
    parts = []
    for path in sorted((ROOT / "benchmarks" / "results").glob("*.json")):
        result = json.loads(path.read_text())
        rows = [(item["what"], f"{item['value']:.4g}", item["unit"]) for item in result["figures"]]
        parts += [
            f"### {path.stem}.py",
            f"{result['about']} {result['measured']}, {result['machine']}.",
            table(("what", "value", "unit"), rows),
        ]
    how = moved("benchmarks/README.md", "benchmarks.md").removeprefix("# Benchmarks\n")
    return "\n\n".join(["# Benchmarks", "## Measured", *parts, "## How", how])
