# SPDX-License-Identifier: Apache-2.0
"""Whether a pin is known to be vulnerable, by a database of advisories on this machine.

    ./ares exec python tools/advisories.py [FOLDER]

The folder, or that of $ARES_ADVISORIES, holds advisories in the OSV format, JSON or YAML, one a
file: an unpacked export of OSV for PyPI, or a clone of pypa/advisory-database. Nothing is fetched.
Exit status: 0, no pin is known to be vulnerable, or, without a folder, nothing was checked, which
is said; 1, one is; 2, there is no such folder, or no advisory in it.
"""

import json
import os
import re
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml
from packaging.version import InvalidVersion, Version

sys.path.insert(0, str(Path(__file__).resolve().parent))
from sbom import LISTS, pins, plain

#: Every list, also of what is installed apart.
ALL_LISTS = (*LISTS, "coverage", "fuzz", "sbom")
NOT_CHECKED = (
    "advisories: not checked: no database of advisories on this machine; ARES_ADVISORIES names "
    "the folder of one"
)
_NAME = re.compile(r"""["']?name["']?\s*:\s*["']?([A-Za-z0-9._-]+)""")


@dataclass(frozen=True)
class Found:
    """A pin that an advisory is about."""

    name: str
    version: str
    advisory: str

    def __str__(self) -> str:
        """One line."""
        return f"{self.name} {self.version}: {self.advisory}"


def _parsed(version: str) -> Version | None:
    try:
        return Version(version)
    except InvalidVersion:
        return None


def _in_range(version: Version, events: list[dict[str, str]]) -> bool:
    """Whether a version lies in a range of OSV: its events, in the order of their versions."""
    inside = False
    for event in events:
        for kind, text in event.items():
            at = Version("0") if text == "0" else _parsed(text)
            if at is None:
                continue
            if kind == "introduced" and version >= at:
                inside = True
            elif (kind == "fixed" and version >= at) or (kind == "last_affected" and version > at):
                inside = False
    return inside


def _affects(entry: Mapping[str, Any], name: str, version: str) -> bool:
    package = entry.get("package") or {}
    if package.get("ecosystem") != "PyPI" or plain(str(package.get("name"))) != name:
        return False
    if version in map(str, entry.get("versions") or ()):
        return True
    exact = _parsed(version)
    ranges = [one for one in entry.get("ranges") or () if one.get("type") != "GIT"]
    return exact is not None and any(_in_range(exact, one["events"]) for one in ranges)


def _advisories(folder: Path, names: set[str]) -> Iterator[Mapping[str, Any]]:
    """Advisories that name one of some packages; most name none, and are not parsed."""
    for path in sorted([*folder.rglob("*.json"), *folder.rglob("*.yaml")]):
        text = path.read_text(encoding="utf-8", errors="replace")
        if not names.isdisjoint(map(plain, _NAME.findall(text))):
            parse = json.loads if path.suffix == ".json" else yaml.safe_load
            found = parse(text)
            if isinstance(found, dict) and "affected" in found:
                yield found


def check(folder: Path, pinned: Mapping[str, str]) -> tuple[list[Found], str]:
    """Pins that are known to be vulnerable, and the date of the newest advisory that was read."""
    found, newest = [], ""
    for advisory in _advisories(folder, set(pinned)):
        newest = max(newest, str(advisory.get("modified", ""))[:10])
        if advisory.get("withdrawn"):
            continue
        for name, version in pinned.items():
            if any(_affects(entry, name, version) for entry in advisory["affected"]):
                found.append(Found(name, version, str(advisory.get("id", "an advisory"))))
    return found, newest


def main(arguments: list[str]) -> int:
    """Print what is known."""
    place = arguments[0] if arguments else os.environ.get("ARES_ADVISORIES", "")
    if not place:
        print(NOT_CHECKED)
        return 0
    found, newest = check(Path(place), pinned := pins(ALL_LISTS))
    if not newest:
        print(f"advisories: none about any of the pins in {place!r}", file=sys.stderr)
        return 2
    for one in found:
        print(f"advisories: {one}", file=sys.stderr)
    print(
        f"advisories: {len(found)} known for {len(pinned)} pins; the newest that names one of "
        f"them is of {newest}"
    )
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
