# SPDX-License-Identifier: Apache-2.0
"""The flight without any fault, by which the others are drawn and judged."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, Self

from ares_bringup.options import CannotStart
from ares_bringup.summary import Outcome
from ares_trials.faults.scene import Scene


@dataclass(frozen=True)
class Control:
    """What is known of it.

    Attributes:
        begin_s: flight time at its begin.
        jettison_s: of its fairing.
        cutoff_s: of its engine.
        mass_kg: at its end; the graph flies it to the last bit.
    """

    begin_s: float
    jettison_s: float
    cutoff_s: float
    mass_kg: float

    @classmethod
    def of(cls, summary: Mapping[str, Any]) -> Self:
        """Of what `ares fly --json` prints.

        Raises:
            CannotStart: it is no flight to the target; one line.
        """
        if summary.get("outcome") != Outcome.TARGET or summary["shortcomings"]:
            reasons = "; ".join(summary.get("shortcomings", ["no summary"]))
            raise CannotStart(f"the flight without a fault is not as it should be: {reasons}")
        begin = float(summary["events"][0]["t_s"])
        jettison, cutoff = float(summary["t_plf_s"]), float(summary["t_meco_s"])
        return cls(begin, jettison, cutoff, float(summary["m_f_kg"]))


@cache
def undisturbed() -> Control:
    """Fly it, once in a process.

    Raises:
        CannotStart: it does not reach the target; one line.
    """
    with Scene() as scene:
        return Control.of(scene.finish().summary)
