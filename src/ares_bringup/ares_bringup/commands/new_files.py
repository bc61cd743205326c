# SPDX-License-Identifier: Apache-2.0
"""Write new files for `ares missions new`, `ares dispersions new` and their `schema`. No ROS."""

import os
import re
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from shlex import quote
from typing import Any

from pydantic import BaseModel

from ares_bringup.commands.interrupts import note_written
from ares_bringup.options import CannotStart, refusals
from ares_models.commented import commented
from ares_models.input_file import InputKind, KeyPath, read_input
from ares_models.json_schema import json_schema
from ares_models.mission import MISSION, TEMPLATE, Mission, load_mission
from ares_vehicle_sim.dispersions import DISPERSIONS, Dispersions
from ares_vehicle_sim.proposal import propose

_NAME = re.compile(r"[A-Za-z0-9_]{1,64}")

#: Schema model of each kind of file.
_MODELS: Mapping[str, type[BaseModel]] = {
    MISSION.name: Mission,
    DISPERSIONS.name: Dispersions,
}


def write_new(path: Path, text: str) -> None:
    """Write a new file atomically.

    Raises:
        CannotStart: it exists, or cannot be written; one line.
    """
    partial = None
    try:
        with tempfile.NamedTemporaryFile(
            "w", dir=path.parent, prefix=f".{path.name}.", delete=False, encoding="utf-8"
        ) as file:
            partial = file.name
            file.write(text)
        os.chmod(partial, 0o644)  # noqa: PTH101
        # fails if the file exists, even if it was made meanwhile
        os.link(partial, path)
        note_written(str(path))
    except FileExistsError as error:
        raise CannotStart(f"--out is {str(path)!r}, which exists; expected a new file") from error
    except OSError as error:
        raise CannotStart(
            f"--out is {str(path)!r}, which cannot be written: {error.strerror}"
        ) from error
    finally:
        if partial is not None:
            Path(partial).unlink(missing_ok=True)


def show_schema(kind: InputKind, out: Path | None) -> None:
    """Print the JSON Schema of a kind of file, or write it to a file.

    Raises:
        CannotStart: it cannot be written.
    """
    text = json_schema(_MODELS[kind.name], f"Ares {kind.name} file")
    if out is None:
        print(text, end="")
        return
    write_new(out, text)
    print(out)


def _schema_line(kind: InputKind, folder: Path) -> str:
    """Return the first line of a file, which names its schema; write a missing schema."""
    name = f"{kind.name}.schema.json"
    if not os.path.lexists(folder / name):
        show_schema(kind, folder / name)
    return f"# yaml-language-server: $schema={name}\n"


def _write(kind: InputKind, out: Path, head: Sequence[str], text: str) -> None:
    """Write a file and, beside it, the schema that its first line names."""
    if os.path.lexists(out):
        raise CannotStart(f"--out is {str(out)!r}, which exists; expected a new file")
    if not out.parent.is_dir():
        raise CannotStart(f"--out is {str(out)!r}; its folder does not exist")
    first = _schema_line(kind, out.parent)
    write_new(out, first + "".join(f"# {line}\n" for line in head) + "\n" + text)
    print(out)


def new_mission(name: str, out: Path | None, like: str | None) -> None:
    """Write a mission with a comment on every key; print the next steps.

    Args:
        name: of the mission.
        out: the file; None: NAME.yaml here.
        like: mission whose numbers are copied; None: a small launcher.

    Raises:
        CannotStart: invalid name, no such mission, or the file exists; one line.
    """
    if not _NAME.fullmatch(name):
        raise CannotStart(f"NAME is {name!r}; expected at most 64 letters, digits and underscores")
    path = Path(f"{name}.yaml") if out is None else out
    data = _mission_data(like)
    data["name"] = name.lower().lstrip("_") or "mission"
    head = [
        "A mission file: change the numbers, then ask `./ares missions` whether it is right.",
        "What stands after # is a comment: what a key is, its range; keys with their defaults.",
        "More on each: docs/missions.md.",
    ]
    _write(MISSION, path, head, commented(Mission, data))
    print(f"try  ./ares missions {quote(_as_path(path))}")
    print(f"then ./ares fly --mission {quote(_as_path(path))}")


def _mission_data(like: str | None) -> dict[str, Any]:
    with refusals():
        path = TEMPLATE if like is None else MISSION.find(like)
        load_mission(path)
        return read_input(path, MISSION)[0]


def new_dispersions(mission_name: str, out: Path | None) -> None:
    """Write dispersions that fit a mission's vehicle; print the next steps.

    Args:
        mission_name: name of a shipped mission or path of a mission file.
        out: the file; None: MISSION_dispersions.yaml here.

    Raises:
        CannotStart: invalid mission, or the file exists; one line.
    """
    with refusals():
        mission = load_mission(mission_name)
    path = Path(f"{mission.name}_dispersions.yaml") if out is None else out
    data: dict[str, Any] = {}
    reasons: dict[KeyPath, str] = {}
    for proposed in propose(mission):
        data[proposed.key] = proposed.value
        reasons[(proposed.key,)] = proposed.reason
    head = [
        f"Dispersions proposed for {mission.name}: {mission.title}.",
        "Rules: docs/montecarlo.md. Put in what is known of the vehicle.",
    ]
    _write(DISPERSIONS, path, head, commented(Dispersions, data, reasons))
    words = f"--mission {quote(mission_name)} --dispersions {quote(_as_path(path))}"
    print(f"try  ./ares montecarlo {words} -n 1000")


def _as_path(path: Path) -> str:
    """Format a path so that it is not taken for a shipped name."""
    text = str(path)
    return text if text.endswith((".yaml", ".yml")) or "/" in text else f"./{text}"
