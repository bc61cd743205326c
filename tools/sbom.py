# SPDX-License-Identifier: Apache-2.0
"""Write the bill of materials of the pinned packages: requirements/sbom.json, CycloneDX.

`make sbom` lists the prepared environment with the tool cyclonedx-py and passes that list here. The
pins of requirements/locked are kept, with version and licence: that of the package's metadata, else
of its ROS package.xml, else of LICENCES, which were read in the packages.
"""

import json
import re
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
LOCKED = ROOT / "requirements" / "locked"
OUT = ROOT / "requirements" / "sbom.json"
#: Lists of the prepared environment; the others are of separate tools.
LISTS = ("uv", "ros-jazzy", "build", "fly", "solve", "live", "pages", "dev")

#: Licences of packages whose metadata hold only its text or a link.
LICENCES = {
    "axe-playwright-python": "MIT",
    "empy": "LGPL-2.1-or-later",
    "partd": "BSD-3-Clause",
    "ros-fastcdr": "Apache-2.0",
    "ros-fastrtps": "Apache-2.0",
    "setuptools": "MIT",
}
#: SPDX names of the licences in ROS package.xml files.
_SPDX = {
    "Apache License 2.0": "Apache-2.0",
    "Apache 2.0": "Apache-2.0",
    "BSD": "BSD-3-Clause",
    "zlib License": "Zlib",
}
_PIN = re.compile(r"^([A-Za-z0-9._-]+)==([^\s\\;]+)", re.MULTILINE)
_LICENCE = re.compile(r"<license[^>]*>([^<]+)</license>")


def plain(name: str) -> str:
    """Normalize a package's name."""
    return re.sub(r"[-_.]+", "-", name).lower()


def pins(names: tuple[str, ...] = LISTS) -> dict[str, str]:
    """Return the pinned versions by normalized name."""
    found: dict[str, str] = {}
    for name in names:
        text = (LOCKED / f"{name}.txt").read_text(encoding="utf-8")
        found |= {plain(package): version for package, version in _PIN.findall(text)}
    return found


def ros_licence(name: str, share: Path) -> str:
    """Return the licence in a wheel's package.xml; "" without one."""
    package = re.sub(r"^ros-(jazzy-)?", "", name).replace("-", "_")
    try:
        text = (share / package / "package.xml").read_text(encoding="utf-8")
    except FileNotFoundError:
        return ""
    found = {_SPDX.get(one.strip(), one.strip()) for one in _LICENCE.findall(text)}
    return " AND ".join(sorted(found))


def licences(component: dict[str, Any], share: Path) -> list[dict[str, Any]]:
    """Return the licences of a component in CycloneDX; empty if unknown."""
    if component.get("licenses"):
        return list(component["licenses"])
    name = plain(component["name"])
    # a metapackage of the ROS 2 distribution
    listed = "Apache-2.0" if name.startswith("ros-jazzy-") else ""
    known = LICENCES.get(name) or ros_licence(name, share) or listed
    return [{"expression": known}] if known else []


def bill(raw: dict[str, Any], share: Path) -> dict[str, Any]:
    """Reduce the tool's list to the pins.

    Args:
        raw: output of the tool.
        share: folder of ROS package.xml files.
    """
    wanted = pins()
    components = []
    for component in raw["components"]:
        if wanted.get(plain(component["name"])) != component["version"]:
            continue
        kept = {key: component[key] for key in ("type", "name", "version", "purl", "bom-ref")}
        components.append({**kept, "licenses": licences(component, share)})
    references = {component["bom-ref"] for component in components}
    dependencies = [
        {
            "ref": entry["ref"],
            "dependsOn": [ref for ref in entry.get("dependsOn", ()) if ref in references],
        }
        for entry in raw["dependencies"]
        if entry["ref"] in references
    ]
    return {
        "$schema": raw["$schema"],
        "bomFormat": raw["bomFormat"],
        "specVersion": raw["specVersion"],
        "version": 1,
        "metadata": {"component": {"type": "application", "name": "ares", "bom-ref": "ares"}},
        "components": sorted(components, key=lambda component: plain(component["name"])),
        "dependencies": sorted(dependencies, key=lambda entry: str(entry["ref"])),
    }


def main() -> int:
    """Write the bill; return 0 if each pin has its licence in it."""
    raw = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    found = bill(raw, ROOT / ".venv" / "share")
    OUT.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    listed = {plain(one["name"]): one["licenses"] for one in found["components"]}
    lacking = sorted(name for name in pins() if not listed.get(name))
    for name in lacking:
        print(f"sbom: {name} is not installed, or its licence is not known", file=sys.stderr)
    print(f"{OUT.relative_to(ROOT)}: {len(listed)} packages")
    return 1 if lacking else 0


if __name__ == "__main__":
    sys.exit(main())
