# SPDX-License-Identifier: Apache-2.0
"""Print for `ares replay BAG --check`."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from ares_bringup.check import COMMAND, STATUS, TOLERANCE, Comparison, Difference, check
from ares_bringup.options import CannotStart
from ares_bringup.plain_json import print_json

EXIT_EQUAL = 0
EXIT_PARTED = 1
EXIT_CUT = 2


def check_bag(path: Path, given: Mapping[str, str], as_json: bool) -> int:
    """Compare a recorded flight with the present guidance and print the differences.

    Args:
        path: the bag.
        given: settings of guidance by name, in place of those recorded.
        as_json: print one JSON object.

    Returns:
        Exit status: 0, equal; 1, different; 2, equal as far as it could be compared.

    Raises:
        CannotStart: it cannot be checked; one line.
    """
    result = check(path, given)
    if as_json:
        print_json(_as_json(result))
    else:
        _print(result)
    if not result.equal:
        return EXIT_PARTED
    return EXIT_CUT if result.cut else EXIT_EQUAL


def parse_settings(settings: Sequence[str]) -> dict[str, str]:
    """Parse `NAME=VALUE` arguments.

    Raises:
        CannotStart: one is malformed; one line.
    """
    found = {}
    for text in settings:
        name, separator, value = text.partition("=")
        if not separator:
            raise CannotStart(f"--set is {text!r}; expected NAME=VALUE")
        found[name] = value
    return found


def _as_json(result: Comparison) -> dict[str, Any]:
    found = asdict(result)
    found["path"] = str(result.path)
    return {"equal": result.equal, "tolerance": TOLERANCE} | found


def _print(result: Comparison) -> None:
    print(f"{result.path}: mission {result.mission}, law {result.law}")
    print(f"flown by {result.recorded_by or 'a version that the bag does not name'}")
    print(f"now {result.software}")
    for note in result.notes:
        print(note)
    print(f"compared: {result.compared[COMMAND]:,} commands, {result.compared[STATUS]:,} statuses")
    _print_times("navigation states without the command that guidance gives", result.unanswered_s)
    _print_times("commands or statuses that guidance does not give", result.unexpected_s)
    if result.first is not None:
        print(f"they part at {_line(result.first)}")
    if result.largest:
        _print_largest(result.largest)
    if result.cut:
        print(f"cut short: {result.cut}")
    if result.equal:
        exactly = "" if result.largest else ", to the last bit"
        print(f"equal within {TOLERANCE:g} of each number, or of the vector it is of{exactly}")


def _print_times(what: str, times: Sequence[float]) -> None:
    if times:
        print(f"{len(times):,} {what}, the first at {times[0]:.3f} s")


def _line(found: Difference) -> str:
    return (
        f"{found.time_s:.3f} s: {found.topic} {found.field} is {found.recorded!r} in the bag, "
        f"{found.now!r} now, relative difference {found.relative:.1e}"
    )


def _print_largest(largest: Sequence[Difference]) -> None:
    print("largest difference of each field that is not the same to the last bit:")
    names = [f"{found.topic} {found.field}" for found in largest]
    width = max(map(len, names))
    for name, found in zip(names, largest, strict=True):
        print(f"  {name:<{width}}  {found.relative:.1e} at {found.time_s:.3f} s")
