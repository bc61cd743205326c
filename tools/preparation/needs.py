# SPDX-License-Identifier: Apache-2.0
"""Tell which requirements and kernels a call needs."""

import re
from collections.abc import Sequence

#: Additional requirements of some verbs, each list with its own stamp.
EVERYTHING = ("solve.txt", "live.txt", "pages.txt", "dev.txt")
#: Requirements of campaigns, pages and plots.
PAGES = ("solve.txt", "live.txt", "pages.txt")
ALSO = {
    "aborts": PAGES,
    "env": EVERYTHING,
    "exec": EVERYTHING,
    "export": PAGES,
    "live": ("live.txt",),
    "montecarlo": PAGES,
    "node": ("solve.txt",),
    "optimize": ("solve.txt",),
    "plot": PAGES,
    "prepare": EVERYTHING,
    "report": PAGES,
    "reproduce": PAGES,
    "test": EVERYTHING,
}
#: Options of a flight with a Foxglove server.
SHOWN_BY = re.compile(r"--foxglove(-port)?(=.*)?")
#: Kernels needed by a verb: all, none, or those of a flight by a law, given by its name.
ALL_KERNELS = "all"
NO_KERNELS = ""
FEW_KERNELS = (
    *("bag", "dispersions", "env", "export", "live", "missions", "plot", "replay", "report"),
)
#: Law whose kernels are compiled while the messages are built, since it needs no registry.
FIRST_LAW = "peg"


def kernels_for(arguments: Sequence[str]) -> str:
    """Return the kernels that a call needs: ALL_KERNELS, NO_KERNELS or the name of a law."""
    verb = arguments[0] if arguments else ""
    # a check flies the law of its bag, most likely FIRST_LAW
    checks = verb == "replay" and "--check" in arguments
    if verb in FEW_KERNELS and not checks:
        return NO_KERNELS
    if verb != "fly" and not checks:
        return ALL_KERNELS
    named = re.search(r"\0--guidance[=\0]([a-z][a-z0-9_]*)\0", "\0".join(["", *arguments, ""]))
    return named[1] if named else FIRST_LAW


def additions_for(arguments: Sequence[str]) -> tuple[str, ...]:
    """Return the lists of requirements that a call needs in addition to those of a plain flight."""
    verb = arguments[0] if arguments else ""
    if verb == "fly":
        if any(map(SHOWN_BY.fullmatch, arguments)):
            return PAGES
        # the default mission is planned before it is flown
        return ("solve.txt",) + ("live.txt",) * ("--live" in arguments)
    if verb == "replay" and "--live" in arguments:
        return ("live.txt",)
    return ALSO.get(verb, ())
