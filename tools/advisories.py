# SPDX-License-Identifier: Apache-2.0
"""Check the pins for known vulnerabilities, with a local database of advisories.

    ./ares exec python tools/advisories.py [FOLDER]

The folder, or that of $ARES_ADVISORIES, holds advisories in the OSV format, JSON or YAML, one per
file: an unpacked export of OSV for PyPI, or a clone of pypa/advisory-database. Nothing is
downloaded.

Exit status: 0, no pin is known to be vulnerable, or, without a folder, nothing was checked (with a
message); 1, one is; 2, there is no such folder, or no advisory in it.
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

#: All lists of requirements, including those installed separately.
ALL_LISTS = (*LISTS, "coverage", "fuzz", "sbom")
NOT_CHECKED = (
    "advisories: not checked: no database of advisories on this machine; ARES_ADVISORIES names "
    "the folder of one"
)
_NAME = re.compile(r"""["']?name["']?\s*:\s*["']?([A-Za-z0-9._-]+)""")


@dataclass(frozen=True)
class Found:
    """Hold a pin named by an advisory."""

    name: str
    version: str
    advisory: str

    def __str__(self) -> str:
        """Format it as one line."""
        return f"{self.name} {self.version}: {self.advisory}"


def _parsed(version: str) -> Version | None:
    try:
        return Version(version)
    except InvalidVersion:
        return None


def _in_range(version: Version, events: list[dict[str, str]]) -> bool:
    """Tell whether a version is in a range of OSV, given as events in order of version."""
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
    """Yield the advisories that name one of the packages; skip others without parsing them."""
    for path in sorted([*folder.rglob("*.json"), *folder.rglob("*.yaml")]):
        text = path.read_text(encoding="utf-8", errors="replace")
        if not names.isdisjoint(map(plain, _NAME.findall(text))):
            parse = json.loads if path.suffix == ".json" else yaml.safe_load
            found = parse(text)
            if isinstance(found, dict) and "affected" in found:
                yield found


def check(folder: Path, pinned: Mapping[str, str]) -> tuple[list[Found], str]:
    """Return the vulnerable pins, and the date of the newest advisory read."""
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
    """Print the vulnerable pins."""
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
