# SPDX-License-Identifier: Apache-2.0
"""Find the separations among the events of a flight, and where the pieces come down."""

from typing import Any

from numpy.typing import NDArray

from ares_models.arrays import MissionArrays, Record
from ares_models.jit import kernel
from ares_models.kernels.falling import follow_fall
from ares_models.kernels.sequence import SAME_TIME
from ares_models.kernels.vectors import load, store
from ares_vehicle_sim.arrays import JETTISON_DONE, STAGING
from ares_vehicle_sim.kernels.variation import factor


@kernel
def follow_pieces(
    events: NDArray[Any],
    count: int,
    jettisons: NDArray[Any],
    pieces: NDArray[Any],
    fractions: NDArray[Any],
    environment: Record,
    atmosphere: NDArray[Any],
    falls: NDArray[Any],
) -> None:
    """Fill the falls of what a flight has dropped.

    A stage that is dropped weighs what the mass falls by at the staging; the event before tells
    the mass until then.

    Args:
        events: dtype EVENT; the first ``count`` count.
        count: number of events.
        jettisons: dtype JETTISON.
        pieces: dtype PIECE: stages but the last, then jettisons.
        fractions: by which the ballistic coefficients are larger.
        environment: record ENVIRONMENT.
        atmosphere: as in ``kernels/environment.py``.
        falls: dtype FALL, at least one for each piece. Changed.
    """
    stages = pieces.shape[0] - jettisons.shape[0]
    for k in range(pieces.shape[0]):
        falls[k].dropped = 0
    for i in range(count):
        event, before = events[i], events[max(0, i - 1)]
        k, mass = -1, 0.0
        if event.type == STAGING and event.time - before.time <= SAME_TIME:
            if 0 < event.index <= stages:
                k, mass = event.index - 1, before.mass - event.mass
        elif event.type == JETTISON_DONE and 0 <= event.index < jettisons.shape[0]:
            k, mass = stages + event.index, jettisons[event.index].mass
        if k >= 0 and mass > 0.0:
            found = falls[k]
            found.dropped = 1
            found.time = event.time
            found.mass = mass
            store(found.position, load(event.position))
            store(found.velocity, load(event.velocity))
            follow_fall(pieces[k], factor(fractions[k]), environment, atmosphere, found)


@kernel
def follow(
    mission: MissionArrays,
    events: NDArray[Any],
    pieces: NDArray[Any],
    fractions: NDArray[Any],
    falls: NDArray[Any],
) -> None:
    """Fill the falls in a mission's own air; the entry from Python.

    Args:
        mission: its arrays.
        events: dtype EVENT.
        pieces: dtype PIECE.
        fractions: as in :func:`follow_pieces`.
        falls: dtype FALL. Changed.
    """
    follow_pieces(
        events,
        events.shape[0],
        mission.jettisons,
        pieces,
        fractions,
        mission.environment[0],
        mission.atmosphere,
        falls,
    )
