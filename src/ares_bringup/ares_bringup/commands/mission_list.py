"""Listing and checking of missions for `ares missions`. No ROS."""

import sys
from collections.abc import Sequence

from rich.table import Table
from rich.text import Text

from ares_bringup.report import console
from ares_models.mission import Mission, list_missions, load_mission


def load(name: str) -> Mission:
    """A mission that can be flown as far as its file can tell.

    Raises:
        ValueError: one line that says what is wrong.
    """
    mission = load_mission(name)
    mission.arrays()
    return mission


def show_missions(names: Sequence[str] = ()) -> int:
    """Print a table of missions; what is wrong with one is one line on standard error.

    Args:
        names: names or paths; empty for all shipped missions.

    Returns:
        0, or 2 if one of them is wrong.
    """
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), show_header=False)
    table.add_column(no_wrap=True)
    status = 0
    count = 0
    for name in names or list_missions():
        try:
            mission = load(name)
        except ValueError as error:
            print(f"ares: {' '.join(str(error).split())}", file=sys.stderr)
            status = 2
            continue
        texts = mission.describe()
        table.add_row(Text(mission.name, style="bold"), "valid", Text(mission.title))
        for key in ("stages", "jettisons", "target"):
            table.add_row("", key, Text(texts[key]))
        count += 1
    if count:
        console().print(table)
    return status
