"""All targets."""

from pathlib import Path

from ares_bringup.fuzz.bags import BagCommands, DamagedBags, ForgedBags
from ares_bringup.fuzz.files import DispersionFiles, MissionFiles, Names, ParameterFiles
from ares_bringup.fuzz.nodes import (
    GuidanceCallbacks,
    Judging,
    LivePage,
    Recording,
    Requests,
    SimulatorCallbacks,
    Viewing,
)
from ares_bringup.fuzz.pages import Commands, Sockets
from ares_bringup.fuzz.target import Target
from ares_bringup.fuzz.words import CommandLines


def all_targets(bag: Path) -> list[Target]:
    """One of each.

    Args:
        bag: a small one, of a flight.
    """
    return [
        MissionFiles(),
        DispersionFiles(),
        ParameterFiles(),
        Names(),
        DamagedBags(),
        ForgedBags(),
        BagCommands(bag),
        SimulatorCallbacks(),
        GuidanceCallbacks(),
        Recording(),
        Judging(),
        Viewing(),
        LivePage(),
        Requests(),
        Commands(),
        Sockets(),
        CommandLines(),
    ]
