# SPDX-License-Identifier: Apache-2.0
"""All targets."""

from pathlib import Path

from hostile.bags import BagCommands, DamagedBags, ForgedBags
from hostile.files import DispersionFiles, MissionFiles, Names, ParameterFiles
from hostile.nodes import (
    Forwarding,
    GuidanceCallbacks,
    Judging,
    LivePage,
    OnTerminal,
    Recording,
    SimulatorCallbacks,
    Viewing,
)
from hostile.pages import Commands, Sockets
from hostile.settings import FailureTexts, Parameters
from hostile.solving import OptimizerAnswers, Requests
from hostile.target import Target
from hostile.words import CommandLines


def all_targets(bag: Path) -> list[Target]:
    """Make one of each target.

    Args:
        bag: a small bag of a flight.
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
        OnTerminal(),
        Viewing(),
        Forwarding(),
        LivePage(),
        Requests(),
        OptimizerAnswers(),
        Parameters(),
        FailureTexts(),
        Commands(),
        Sockets(),
        CommandLines(),
    ]
