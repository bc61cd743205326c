# SPDX-License-Identifier: Apache-2.0
"""Measure the time to a plan of transfers in two burns: `auto` from the file alone, and CasADi.

CasADi has the same collocation: variables, rows, intervals, and the flown guesses of as many starts
as `auto` tries at least; its derivatives are its own, by SX, and IPOPT comes with its wheel. The
time of building its functions is listed separately, since a graph could be kept. It stops at the
best of its starts: no finer intervals and no exact root, which are in the time of `auto`. All times
are CPU times in a warm process.
"""

import argparse
import importlib.util
import math
import time
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from figures import Figures, keep_option

from ares_models.floors import floors_of
from ares_models.mission import Mission, load_mission
from ares_optimizer.collocation.guess import trials
from ares_optimizer.collocation.search import floors_on, sweep_of_trial
from ares_optimizer.collocation.transcription import CollocationProgram
from ares_optimizer.collocation.variables import guess_of
from ares_optimizer.request import arrays_and_state
from ares_optimizer.solve import solve

FILES = Path(__file__).parent / "launchers"
MISSIONS = (
    "falcon9_gto",
    "vulcan_gto",
    "ariane64_gto",
    "atlas401_gto",
    "atlas551_gto",
    "cz3b_gto",
    "cz7a_gto",
    "delta4m_gto",
    "fh_gto",
    "h3_gto",
    "zenit3sl_gto",
)
#: Starts are tried until at least so many.
STARTS = 5


def mission_of(name: str) -> Mission:
    """Load a mission of the launchers, or a shipped one."""
    own = FILES / f"{name}.yaml"
    return load_mission(own if own.exists() else name)


def ours(mission: Mission, verify: bool) -> tuple[float, float, str]:
    """Return the CPU time of a plan by ``auto``, s, its mass, kg, and its status."""
    begun = time.process_time()
    found = solve(mission, "auto", verify=verify)
    return time.process_time() - begun, found.m_f_kg, str(found.status)


def theirs(mission: Mission) -> tuple[float, float, float]:
    """Return CasADi's CPU times of guesses and solutions, and of building, s; its best mass, kg."""
    from casadi_collocation import CasadiCollocation

    arrays, start = arrays_and_state(mission, None)
    floors = floors_of(arrays, start)
    best, built, begun = math.nan, 0.0, time.process_time()
    for trial in islice(trials(arrays, start, floors), STARTS):
        kept, sweep = floors_on(floors, 0.0, trial), sweep_of_trial(trial, arrays)
        program = CollocationProgram(arrays, start, trial.times, kept, sweep=sweep)
        guess = guess_of(program, trial)
        peer = CasadiCollocation(program)
        built += peer.build_s
        best = np.fmax(best, peer.solve(guess))
    return time.process_time() - begun - built, built, float(best)


def main() -> None:
    """Print a row per mission, and the medians."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", default=MISSIONS, help="missions; default: all")
    keep_option(parser)
    options = parser.parse_args()
    peer = importlib.util.find_spec("casadi") is not None
    if not peer:
        print("not installed, left out: casadi (requirements/bench.txt)")
    ours(mission_of("falcon9_gto"), verify=True)
    figures = Figures(__file__, "CPU time to a plan of transfers in two burns, warm process.")
    columns: dict[str, list[float]] = {}
    for name in options.names:
        mission = mission_of(name)
        planned, mass, status = ours(mission, verify=False)
        proven, _, _ = ours(mission, verify=True)
        row: dict[str, Any] = {"auto": planned, "auto, proven": proven}
        line = f"{name:16s} auto {planned:.2f} s, proven {proven:.2f} s, {mass:,.2f} kg {status}"
        if peer:
            solved, built, other = theirs(mission)
            row |= {"CasADi": solved, "CasADi, with building": solved + built}
            line += f"; CasADi {solved:.2f} s and {built:.2f} s of building, {other:,.2f} kg"
        print(line, flush=True)
        for column, seconds in row.items():
            columns.setdefault(column, []).append(seconds)
    for column, seconds in columns.items():
        figures.add(f"{column}, median", float(np.median(seconds)), "s")
        figures.add(f"{column}, worst", max(seconds), "s")
    if options.keep:
        figures.keep()


if __name__ == "__main__":
    main()
