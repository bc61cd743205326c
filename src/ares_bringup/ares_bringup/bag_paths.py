# SPDX-License-Identifier: Apache-2.0
"""Choose folder and name of a new bag."""

import os
from datetime import UTC, datetime
from pathlib import Path

from ares_bringup.options import CannotStart
from ares_models.writable import check_folder

#: Environment variable that names the folder of new bags.
BAGS_VARIABLE = "ARES_BAGS"


def workspace_root() -> Path | None:
    """Find the workspace that holds this package or its sources; None outside of one."""
    for start in (Path(__file__), Path(__file__).resolve()):
        for folder in start.parents:
            if (folder / "src" / "ares_bringup" / "package.xml").is_file():
                return folder
    return None


def bags_folder() -> Path:
    """Return the folder of new bags: $ARES_BAGS, else `bags` of the workspace, else `./bags`."""
    named = os.environ.get(BAGS_VARIABLE)
    if named:
        return Path(named)
    return (workspace_root() or Path.cwd()) / "bags"


def check_new_bag(bag: Path) -> None:
    """Check, before the flight, that a bag can be made; leave nothing.

    Raises:
        CannotStart: it cannot; one line.
    """
    try:
        check_folder(bag.parent)
    except OSError as error:
        raise CannotStart(f"bag {bag} cannot be created: {error.strerror}") from error


def new_bag(mission: str, folder: Path | None = None, now: datetime | None = None) -> Path:
    """Return an unused path `<mission>_<date>T<time>Z`, in UTC, so that names sort by time.

    Args:
        mission: name of the mission.
        folder: parent folder; default: `bags_folder()`.
        now: time of the flight; default: the present.
    """
    folder = folder or bags_folder()
    stem = f"{mission}_{now or datetime.now(UTC):%Y%m%dT%H%M%SZ}"
    path = folder / stem
    count = 2
    while os.path.lexists(path):
        path = folder / f"{stem}_{count:02}"
        count += 1
    return path
