# SPDX-License-Identifier: Apache-2.0
"""Write the usage of all verbs, which `./ares` needs before anything is installed: `make usage`."""

import json
from pathlib import Path
from typing import Any

from typer.main import get_command

from ares_bringup import usage
from ares_bringup.verbs.app import app

#: Width of the help, columns.
WIDTH = 80


def describe(command: Any, name: str, above: Any = None) -> dict[str, Any]:
    """Describe a command and its subcommands.

    Args:
        command: of the command-line library.
        name: full name.
        above: context of the parent command.

    Returns:
        `help`: its text. `options`: number of values of each. `commands`: subcommands by name;
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
    if command.context_settings.get("ignore_unknown_options"):
        found["passes_on"] = True
    below = getattr(command, "commands", None)
    if below is not None:
        found["commands"] = {word: describe(below[word], word, context) for word in below}
        if default := getattr(command, "default", ""):
            found["default"] = default
    return found


def text() -> str:
    """Describe the whole command line as JSON."""
    import ares_bringup.commands.cli  # noqa: F401  registers the verbs

    return json.dumps(describe(get_command(app), "ares"), indent=1, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    Path(usage.__file__).with_name("usage.json").write_text(text(), encoding="utf-8")
