# SPDX-License-Identifier: Apache-2.0
"""Write what is made of the parameter tables of the nodes and of the verbs: `make usage`.

The tables as JSON for whoever must not import a node, the parameter file, the tables in the
READMEs, and the usage of all verbs, which `./ares` needs before anything is installed.
"""

import json
import re
import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import fields
from importlib import import_module
from pathlib import Path
from typing import Any

from ares_bringup import usage
from ares_bringup.parameter_tables import LAUNCH, TABLES, offered, tables
from ares_node.node import AUTOSTART
from ares_node.parameters import Parameter

SOURCES = Path(__file__).resolve().parent.parent / "src"
#: Nodes and the modules with their parameter tables.
NODES = {
    "vehicle_sim": "ares_vehicle_sim.node",
    "guidance": "ares_guidance.node",
    "optimizer": "ares_optimizer.node",
    "recorder": "ares_bags.recorder",
    "judge": "ares_bringup.judge",
    "view": "ares_view.standard.node",
    "live": "ares_view.live.node",
}
PARAMS_FILE = SOURCES / "ares_bringup" / "params" / "flight.yaml"
#: Width of the help, columns; of the parameter file.
WIDTH = 80
WIDE = 100


# ---- parameters


def table_of(node: str) -> tuple[Parameter, ...]:
    """Return the whole table of a node."""
    return (*import_module(NODES[node]).PARAMETERS, AUTOSTART)


def as_json() -> str:
    """Write the tables of all nodes as JSON, a row a line: what differs from the defaults."""
    defaults = {item.name: item.default for item in fields(Parameter)}

    def row(item: Parameter) -> str:
        values = {name: getattr(item, name) for name in defaults}
        if item.registered:
            del values["choices"]
        said = {name: value for name, value in values.items() if value != defaults[name]}
        return json.dumps(said, ensure_ascii=False, allow_nan=False)

    rows = {node: ",\n".join(map(row, table_of(node))) for node in NODES}
    return "{" + ",\n".join(f'"{node}": [\n{text}\n]' for node, text in rows.items()) + "}\n"


def parameter_file() -> str:
    """Write the parameter file, with all defaults."""
    lines = [
        "# Parameters of the nodes of a flight, with the values that the nodes take by themselves;",
        "# `make usage` writes it. The wildcards make the file fit any namespace. Arguments of",
        "# flight.launch.py win over it.",
    ]
    for node in NODES:
        lines += ["", f"/**/{node}:", "  ros__parameters:"]
        for row in table_of(node):
            words = f"{row.description} Expected: {row.expected}."
            lines += textwrap.wrap(words, WIDE, initial_indent="    # ", subsequent_indent="    # ")
            lines.append(f"    {row.name}: {json.dumps(row.default)}")
    return "\n".join(lines) + "\n"


def _shown(row: Parameter) -> str:
    value = row.default
    if isinstance(value, tuple):
        return ", ".join(value)
    return "" if value == "" else json.dumps(value).strip('"')


def markdown(head: Sequence[str], rows: Iterator[Sequence[str]]) -> str:
    """Format a table."""
    body = [[cell.replace("|", "\\|") for cell in row] for row in rows]
    lines = (" | ".join(row) for row in (head, ["---"] * len(head), *body))
    return "".join(f"| {line} |\n" for line in lines)


def parameter_table(node: str) -> str:
    """Return the parameters of a node as a table."""
    return markdown(
        ("parameter", "default", "expected", "meaning"),
        ((f"`{row.name}`", _shown(row), row.expected, row.description) for row in table_of(node)),
    )


def launch_table(_: str) -> str:
    """Return the arguments of the launch file as a table."""
    rows = [(row.name, row, _shown(row)) for row in LAUNCH]
    rows += [(name, row, "") for name, row in offered().items()]
    return markdown(
        ("argument", "default", "meaning"),
        ((f"`{name}`", default, row.text) for name, row, default in rows),
    )


def option_table(verb: str) -> str:
    """Return the options of a verb as a table."""
    options = (option for option in command_line().commands[verb].params if option.help)
    return markdown(("option", "meaning"), ((f"`{', '.join(x.opts)}`", x.help) for x in options))


#: What is written between `<!-- made: KIND NAME -->` and `<!-- end -->`.
MADE = {"parameters": parameter_table, "launch": launch_table, "options": option_table}
_PLACE = re.compile(r"(<!-- made: (\w+) (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)


def page(text: str) -> str:
    """Write the tables of a page anew."""
    return _PLACE.sub(lambda found: found[1] + MADE[found[2]](found[3]) + found[4], text)


# ---- the command line


def command_line() -> Any:
    """Return the command line, with the verbs of all packages."""
    from typer.main import get_command

    from ares_bringup.commands.cli import app

    return get_command(app)


def describe(command: Any, name: str, above: Any = None) -> dict[str, Any]:
    """Describe a command and its subcommands.

    Args:
        command: of the command-line library.
        name: full name.
        above: context of the parent command.

    Returns:
        `help`: its text. `options`: number of values of each. `needed`: the arguments and options
        without which it is refused, as a refusal names them. `commands`: subcommands by name;
        `default`: the one for words that name none. `passes_on`: true if the words after its first
        are for another program.
    """
    settings = {"terminal_width": WIDTH - 2, "max_content_width": WIDTH}
    context = command.context_class(
        command, info_name=name, parent=above, **settings, **command.context_settings
    )
    found: dict[str, Any] = {
        "help": command.get_help(context).rstrip() + "\n",
        "options": {
            word: 0 if parameter.is_flag else parameter.nargs
            for parameter in command.params
            if parameter.param_type_name == "option"
            for word in (*parameter.opts, *parameter.secondary_opts)
        },
    }
    needed = {
        kind: [
            parameter.get_error_hint().strip("'")
            for parameter in command.params
            if parameter.required and parameter.param_type_name == kind
        ]
        for kind in ("argument", "option")
    }
    if any(needed.values()):
        found["needed"] = needed
    if command.context_settings.get("ignore_unknown_options"):
        found["passes_on"] = True
    below = getattr(command, "commands", None)
    if below is not None:
        found["commands"] = {word: describe(below[word], word, context) for word in below}
        if default := getattr(command, "default", ""):
            found["default"] = default
    return found


def made() -> Iterator[tuple[Path, str]]:
    """Yield each file with its text, the tables first, which the others are made of."""
    yield TABLES, as_json()
    tables.cache_clear()
    yield PARAMS_FILE, parameter_file()
    described = json.dumps(describe(command_line(), "ares"), indent=1, ensure_ascii=False)
    yield Path(usage.__file__).with_name("usage.json"), described + "\n"
    for path in sorted(SOURCES.glob("*/README.md")):
        yield path, page(path.read_text(encoding="utf-8"))


if __name__ == "__main__":
    for path, text in made():
        path.write_text(text, encoding="utf-8")
