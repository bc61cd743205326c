# SPDX-License-Identifier: Apache-2.0
"""Pieces that a mission drops, and how they fall through the air."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import PIECE

if TYPE_CHECKING:
    from ares_models.mission import Mission
    from ares_models.mission_parts import Jettison, Stage


@dataclass(frozen=True)
class DroppedPiece:
    """Hold what falls: its name, how many of it, and what record PIECE holds."""

    name: str
    count: int
    coefficient: float
    area: float


def dropped_pieces(mission: "Mission") -> tuple[DroppedPiece, ...]:
    """List the stages but the last, which stays in orbit, then the drops of the mission.

    Without a ballistic coefficient of its own a piece tumbles: its drag area is the reference area
    of the aerodynamics of its stage, of each booster alike; 0 where the stage has none.
    """
    counts = [1] * len(mission.jettisons)
    counts += [booster.count for stage in mission.stages for booster in stage.boosters]
    parts: list[tuple[Stage | Jettison, str, int]]
    parts = [(stage, stage.name, 1) for stage in mission.stages[:-1]]
    parts += [(drop, drop.stage, count) for drop, count in zip(mission.drops, counts, strict=True)]
    pieces = []
    for part, name, count in parts:
        stage = mission.stages[mission.stage_names.index(name)]
        air = stage.aerodynamics or mission.aerodynamics
        area = 0.0 if air is None else count * air.reference_area_m2
        own = part.ballistic_coefficient_kg_m2 or 0.0
        pieces.append(DroppedPiece(part.name, count, own, area))
    return tuple(pieces)


def piece_array(pieces: Sequence[DroppedPiece]) -> NDArray[np.void]:
    """Compile pieces for the kernels, dtype PIECE."""
    return np.array([(piece.coefficient, piece.area) for piece in pieces], PIECE)
