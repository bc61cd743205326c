# SPDX-License-Identifier: Apache-2.0
"""Run one trial: a fault of a row, drawn by a seed, and its judgement."""

from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any
from zlib import crc32

import numpy as np

from ares_trials.faults.control import Control, undisturbed
from ares_trials.faults.rows import ROWS, FaultKind
from ares_trials.faults.scene import FlightResult, Scene

#: Outcomes of a flight that has diverged or not ended.
DIVERGED = ("impact", "incomplete", "interrupted", "time_limit")


class Class(StrEnum):
    """Name the classes of results."""

    SURVIVED = "survived"
    DEGRADED = "degraded"
    WRONG = "wrong"


@dataclass(frozen=True)
class Trial:
    """Hold one trial and its result.

    Attributes:
        row: name of the row.
        seed: of the campaign.
        number: of the trial in its row.
        result: value of `Class`.
        why: reason, one line; "" if it survived.
    """

    row: str
    seed: int
    number: int
    result: str
    why: str = ""

    def to_json(self) -> dict[str, Any]:
        """Return the trial as a JSON object."""
        return asdict(self)


def run(name: str, seed: int, number: int, control: Control | None = None) -> Trial:
    """Run one trial.

    Args:
        name: of a row.
        seed: of the campaign.
        number: of the trial in its row.
        control: the undisturbed flight; None: fly it first.
    """
    row = next(row for row in ROWS if row.name == name)
    # seeded by the row's name, so that a new row changes no other
    rng = np.random.default_rng([seed, crc32(name.encode()), number])
    if row.alone is not None:
        why = row.alone(rng)
        return Trial(name, seed, number, (Class.WRONG if why else Class.SURVIVED).value, why)
    arguments = {name: list(words) for name, words in row.arguments.items()}
    if row.drawn:
        arguments[row.drawn] += ["-p", f"seed:={rng.integers(2**31)}"]
    control = control or undisturbed()
    with Scene(row.options, arguments, row.modules, row.program) as scene:
        row.act(scene, control, rng)
        flown = scene.finish()
        result, why = judge(row, flown, control)
        if result is not Class.WRONG and (complaint := row.after(scene, flown)):
            result, why = Class.WRONG, complaint
    return Trial(name, seed, number, result.value, why)


def judge(row: FaultKind, flown: FlightResult, control: Control) -> tuple[Class, str]:
    """Classify a flight with the reason, independent of the machine's speed."""
    wrong = _unclean(flown) or _unsaid(row, flown, control)
    if wrong:
        return Class.WRONG, wrong
    summary = flown.summary
    outcome = summary["outcome"]
    if outcome == "target":
        return Class.SURVIVED, ""
    why = f"{outcome}: {'; '.join(summary['shortcomings'])}"
    if flown.facts.get("must_reach", True) or outcome in DIVERGED:
        return Class.WRONG, why
    return Class.DEGRADED, why


def _unclean(flown: FlightResult) -> str:
    """Return the violated invariant of every flight, or ""."""
    if flown.status is None:
        return "hung"
    if "Traceback" in flown.said:
        return "a traceback: " + flown.said.strip().splitlines()[-1]
    if flown.left:
        return "left behind: " + "; ".join(flown.left)
    if not flown.summary:
        return f"no summary, exit status {flown.status}: {flown.said.strip()}"
    return ""


def _unsaid(row: FaultKind, flown: FlightResult, control: Control) -> str:
    """Return the missing report of the fault, or the wrong status or mass; "" if all is right."""
    summary = flown.summary
    on_target = summary["outcome"] == "target"
    came_about = flown.touched or not row.by_relay
    exact = not came_about or flown.facts.get("unaffected", row.unaffected)
    if exact and summary["m_f_kg"] != control.mass_kg:
        return f"final mass {summary['m_f_kg']} kg, undisturbed {control.mass_kg} kg"
    allowed = row.statuses if came_about else (0,)
    if not on_target:
        allowed = (1,)
    if flown.status not in allowed:
        return f"exit status {flown.status}"
    if not came_about or not flown.facts.get("can_be_told", True):
        return ""
    told = [f"{line['node']}: {line['message']}" for line in summary["diagnostics"]]
    words = "\n".join([*told, *summary["shortcomings"], flown.said])
    missing = [text for text in flown.facts.get("says", row.says) if text not in words]
    return f"not said: {missing[0]}" if missing else ""
