# SPDX-License-Identifier: Apache-2.0
"""Find the mission of a recorded flight: by the text in its bag, else by its name. No ROS."""

import json
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ares_bags.writer import GUIDANCE_KEY, SIMULATOR_KEY
from ares_bringup.options import CannotStart
from ares_models.mission import (
    MISSION_TEXT,
    Mission,
    MissionError,
    load_mission,
    parse_mission,
    read_mission,
)
from ares_node.identity import MISSION_DIGEST


@dataclass(frozen=True)
class FlownMission:
    """Hold the mission of a recorded flight.

    Attributes:
        mission: checked.
        text: of its file.
        note: known change since the flight, one line; "": none.
    """

    mission: Mission
    text: str
    note: str

    @contextmanager
    def file(self) -> Iterator[str]:
        """Write the text to a temporary mission file and yield its path."""
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"{self.mission.name}.yaml"
            path.write_text(self.text, encoding="utf-8")
            yield str(path)


def flown_mission(path: Path, custom: Mapping[str, str], given: str | None = None) -> FlownMission:
    """Find the mission of a recorded flight.

    Args:
        path: the bag.
        custom: its custom data.
        given: name or path of the mission to use instead; None: that of the flight.

    Raises:
        CannotStart: the bag does not name its mission, or the mission cannot be read; one line.
    """
    name = custom.get("mission", "")
    if given:
        mission, text = _read(path, given)
        flown = ""
        with suppress(CannotStart):
            flown = _flown_digest(path, custom)
        differs = bool(flown) and flown != mission.digest
        note = f"mission {given} was given, another one was flown" if differs else ""
        return FlownMission(mission, text, note)
    text = _text_in(path, custom)
    if text:
        mission = _parsed(path, text)
        edited = bool(name) and _differs(name, mission)
        note = f"mission {name} has changed since; that in the bag counts" if edited else ""
        return FlownMission(mission, text, note)
    if not name:
        raise CannotStart(f"bag {path} does not say which mission was flown; --mission does")
    mission, text = _read(path, name)
    differs = _flown_digest(path, custom) not in ("", mission.digest)
    note = f"mission {name} has other numbers now than it had then" if differs else ""
    return FlownMission(mission, text, note)


def told_of(path: Path, custom: Mapping[str, str], key: str) -> dict[str, Any]:
    """Return the recorded settings of a member of the flight; empty if there are none.

    Args:
        path: the bag.
        custom: its custom data.
        key: of the member.

    Raises:
        CannotStart: they are not a JSON object; one line.
    """
    try:
        told = json.loads(custom.get(key, "{}"))
    except (ValueError, RecursionError):
        told = None
    if not isinstance(told, dict):
        raise CannotStart(f"bag {path}: what it says of {key} is no JSON object")
    return told


def _text_in(path: Path, custom: Mapping[str, str]) -> str:
    text = told_of(path, custom, SIMULATOR_KEY).get(MISSION_TEXT, "")
    if not isinstance(text, str):
        raise CannotStart(f"bag {path}: its {MISSION_TEXT} is {text!r:.40}; expected a text")
    return text


def _flown_digest(path: Path, custom: Mapping[str, str]) -> str:
    """Return the digest of the flown mission; "": unknown."""
    if text := _text_in(path, custom):
        return _parsed(path, text).digest
    told = (told_of(path, custom, key) for key in custom if key.startswith(GUIDANCE_KEY))
    return next((str(one[MISSION_DIGEST]) for one in told if MISSION_DIGEST in one), "")


def _parsed(path: Path, text: str) -> Mission:
    try:
        return parse_mission(text, f"bag {path}")
    except MissionError as error:
        raise CannotStart(f"the mission in it cannot be read: {error}") from error


def _read(path: Path, name: str) -> tuple[Mission, str]:
    try:
        return read_mission(name)
    except MissionError as error:
        raise CannotStart(f"bag {path} is of a mission that cannot be read: {error}") from error


def _differs(name: str, flown: Mission) -> bool:
    """Tell whether the mission of this name has changed since; False if there is none."""
    try:
        return load_mission(name).digest != flown.digest
    except MissionError:
        return Path(name).is_file()
