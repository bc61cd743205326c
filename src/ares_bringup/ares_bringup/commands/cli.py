# SPDX-License-Identifier: Apache-2.0
"""Run the `ares` command line and return its exit status."""

import os
import re
import sys
from collections.abc import Sequence
from contextlib import suppress
from typing import Any

from ares_bringup.commands.interrupts import Interrupts, report_interrupt
from ares_bringup.options import CannotStart
from ares_bringup.usage import answer

# registered in the order of the help
from ares_bringup.verbs import bags, files, flights, graph, studies  # noqa: F401
from ares_bringup.verbs.app import VERBS, BadInput, add_registered_verbs, app, one_line
from ares_models.registry import registered
from ares_node.entry import OutputError

__all__ = ["app", "main"]

EXIT_NOT_WRITTEN = 1
EXIT_BAD_INPUT = 2
EXIT_INTERRUPTED = 130

#: Expected value of an option, by error type of the command-line library's validation.
_EXPECTED = {
    "float_parsing": "a number",
    "int_parsing": "a whole number",
    "greater_than_equal": "at least {ge}",
    "less_than_equal": "at most {le}",
}
_CHOICE = " is not one of "

add_registered_verbs()


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line.

    Args:
        argv: without the program's name; default: that of this process.

    Returns:
        The exit status.
    """
    status = EXIT_INTERRUPTED
    interrupts = Interrupts()
    with suppress(KeyboardInterrupt), interrupts:
        status = _run(argv)
    if interrupts.came:
        report_interrupt()
    return interrupts.status(status)


def _run(argv: Sequence[str] | None) -> int:
    words = list(sys.argv[1:] if argv is None else argv)
    try:
        # help comes from the library, since it lists the installed laws
        if (said := answer(words, tuple(registered(VERBS)))) and said.refusal:
            print(f"ares: {one_line(said.refusal)}", file=sys.stderr)
            return said.status
        status = app(args=words, prog_name="ares", standalone_mode=False)
        # an error of the last output must be found here
        sys.stdout.flush()
        return status if isinstance(status, int) else 0
    except (BadInput, CannotStart) as error:
        if str(error):
            print(f"ares: {one_line(str(error))}", file=sys.stderr)
        return EXIT_BAD_INPUT
    except (BrokenPipeError, OutputError) as error:
        if not isinstance(error, BrokenPipeError):
            # EPIPE means that the reader has gone; any other error is reported
            print(f"ares: standard output cannot be written: {error}", file=sys.stderr)
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return EXIT_NOT_WRITTEN
    except Exception as error:
        # usage errors of the command-line library, which prints three lines for each
        if not hasattr(error, "format_message"):
            raise
        message = _refusal(error) or _meant(error) or error.format_message().rstrip(".")
        help_hint = getattr(getattr(error, "ctx", None), "command_path", "ares")
        print(f"ares: {one_line(message)} (see `{help_hint} --help`)", file=sys.stderr)
        return EXIT_BAD_INPUT


def _refusal(error: Exception) -> str:
    """Format a rejected option value like other bad input; "" if the error is another one."""
    parameter, errors = getattr(error, "param", None), getattr(error.__cause__, "errors", None)
    if parameter is None or errors is None:
        return ""
    item = errors()[0]
    if _CHOICE in item["msg"]:
        choices = item["msg"].partition(_CHOICE)[2]
        expected = "one of " + choices.replace("'", "").rstrip(".")
    elif item["type"] in _EXPECTED:
        bounds = item.get("ctx", {}).items()
        plain = {key: f"{at:g}" if isinstance(at, float) else at for key, at in bounds}
        expected = _EXPECTED[item["type"]].format(**plain)
    else:
        return ""
    name = max(parameter.opts, key=len)
    return f"{name} is {item['input']!r}; expected {expected}"


def _meant(error: Any) -> str:
    """Ask for `--mission` where a word stands alone behind a verb that takes one; else empty."""
    message: str = error.format_message().rstrip(".")
    alone = re.fullmatch(r"Got unexpected extra argument(?:s|\(s\))? \((\S+)\)", message)
    context = getattr(error, "ctx", None)
    options = {name for param in context.command.params for name in param.opts} if context else ()
    if not alone or "--mission" not in options:
        return ""
    return f"{message}; did you mean --mission {alone[1]}?"


if __name__ == "__main__":
    sys.exit(main())
