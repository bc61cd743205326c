# SPDX-License-Identifier: Apache-2.0
"""Fly the undisturbed flight, to which the others are compared."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, Self

from ares_bringup.options import CannotStart
from ares_bringup.outcomes import Outcome
from ares_trials.faults.scene import Scene


@dataclass(frozen=True)
class Control:
    """Hold the key figures of the undisturbed flight.

    Attributes:
        begin_s: flight time at its begin.
        jettison_s: of its fairing.
        cutoff_s: of its engine.
        mass_kg: at its end; reproduced bit for bit by the graph.
    """

    begin_s: float
    jettison_s: float
    cutoff_s: float
    mass_kg: float

    @classmethod
    def of(cls, summary: Mapping[str, Any]) -> Self:
        """Read the figures from the output of `ares fly --json`.

        Raises:
            CannotStart: it did not reach the target; one line.
        """
        if summary.get("outcome") != Outcome.TARGET or summary["shortcomings"]:
            reasons = "; ".join(summary.get("shortcomings", ["no summary"]))
            raise CannotStart(f"the flight without a fault is not as it should be: {reasons}")
        begin = float(summary["events"][0]["t_s"])
        jettison, cutoff = float(summary["t_plf_s"]), float(summary["t_meco_s"])
        return cls(begin, jettison, cutoff, float(summary["m_f_kg"]))


@cache
def undisturbed() -> Control:
    """Fly the undisturbed flight, once per process.

    Raises:
        CannotStart: it does not reach the target; one line.
    """
    with Scene() as scene:
        return Control.of(scene.finish().summary)
