# SPDX-License-Identifier: Apache-2.0
"""Try an input: read it, fly it by each law, solve it by each method, run a campaign."""

import io
import json
import os
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import NoReturn

import numpy as np

from ares_bringup.commands.cli import EXIT_BAD_INPUT, main
from ares_bringup.options import PEG
from ares_guidance.laws import self_starting_laws
from ares_guidance.registry import law_names
from ares_models.input_file import InputError
from ares_models.mission import load_mission
from ares_models.mission_physics import longest_flight
from ares_optimizer.registry import method_names
from ares_optimizer.solution import OptimizerError
from ares_studies.closed_loop import fly_compiled, ready_law
from ares_vehicle_sim.dispersions import load_dispersions
from ares_vehicle_sim.simulator import SimulatorOptions

MISSION = "mission"
DISPERSIONS = "dispersions"

#: Mission for the dispersions tried.
DISPERSED_MISSION = "ares_v"

#: Arguments that bound a search, s.
TIME_LIMIT = ("--time-limit", "3")
#: Time limit of a plan, s.
PLAN_LIMIT_S = 3.0

#: Navigation period of a flight, s; most navigation states.
NAVIGATION_PERIOD_S = 0.1
MOST_STATES = 50_000

#: Beginning of a line on standard error that is a warning only.
WARNING = "ares: warning: "

REFUSED = "refused"
DONE = "done"
BROKEN = "broken"


class Broken(Exception):
    """Report in one line a result that no input may cause."""


def _one_line(text: str) -> str:
    """Return the text of a refusal, checked.

    Raises:
        Broken: it is not one readable line.
    """
    bare = text.removesuffix("\n")
    if not bare or not bare.isprintable() or "Traceback" in bare or "pydantic" in bare:
        raise Broken(f"not one clear line: {bare!r}")
    return bare


def read(kind: str, path: Path) -> str:
    """Read a file; return its refusal, if any, in one line."""
    try:
        (load_mission if kind == MISSION else load_dispersions)(path)
    except InputError as error:
        return f"{REFUSED}: {_one_line(str(error))}"
    return DONE


def fly(law_name: str, path: Path) -> str:
    """Fly a mission in one compiled loop."""
    mission = load_mission(path)
    try:
        law = ready_law(mission, law_name, time_limit_s=PLAN_LIMIT_S)
    except (InputError, OptimizerError, ValueError) as error:
        return f"{REFUSED}: {_one_line(str(error))}"
    # rarely in a flight of days, which is only tested to end
    seldom = max(NAVIGATION_PERIOD_S, longest_flight(mission) / MOST_STATES)
    plant = fly_compiled(mission, SimulatorOptions(seldom, seldom), law=law).plant
    for name in ("time", "position", "velocity", "mass"):
        if not np.all(np.isfinite(plant[name])):
            raise Broken(f"{name} at the end is {plant[name]}")
    if not plant["complete"]:
        raise Broken("the flight has no end")
    return DONE


def command(*argv: str) -> str:
    """Run an `ares` command that prints one JSON object."""
    out, err = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(err):
        status = main([*argv, "--json"])
    lines = err.getvalue().splitlines(keepends=True)
    said = "".join(line for line in lines if not line.startswith(WARNING))
    if status == EXIT_BAD_INPUT:
        return f"{REFUSED}: {_one_line(said)}"
    if said or status not in (0, 1, 3, 4):
        raise Broken(f"exit status {status}: {said!r}")
    json.loads(out.getvalue(), parse_constant=_no_number)
    return DONE


def _no_number(name: str) -> NoReturn:
    raise Broken(f"{name} is printed")


def optimize(method: str, path: Path) -> str:
    """Solve a mission."""
    return command("optimize", "--mission", str(path), "--method", method, *TIME_LIMIT)


def campaign(law: str, path: Path) -> str:
    """Fly one flight of a campaign of a mission."""
    return command("montecarlo", "--mission", str(path), "--guidance", law, "--only", "0")


def disperse(law: str, path: Path) -> str:
    """Fly one dispersed flight."""
    # without a heating sensor, a law derives its margin from the dispersions
    source = () if law == PEG else ("--heating-source", "model")
    argv = ("montecarlo", "--mission", DISPERSED_MISSION, "--dispersions", str(path))
    return command(*argv, "--guidance", law, "--only", "3", *source)


_CAMPAIGN_LAWS = self_starting_laws()
#: Actions on a valid file of a kind.
ACTIONS = {
    MISSION: (
        *(f"fly {law}" for law in law_names()),
        *(f"optimize {method}" for method in method_names()),
        *(f"campaign {law}" for law in _CAMPAIGN_LAWS),
    ),
    DISPERSIONS: tuple(f"disperse {law}" for law in _CAMPAIGN_LAWS),
}

_VERBS: dict[str, Callable[[str, Path], str]] = {
    "read": read,
    "fly": fly,
    "optimize": optimize,
    "campaign": campaign,
    "disperse": disperse,
}


def attempt(action: str, path: Path) -> str:
    """Run one action on a file.

    Args:
        action: of ACTIONS, or ``read mission`` or ``read dispersions``.
        path: the file.

    Returns:
        The outcome; begins with REFUSED, DONE or BROKEN.
    """
    verb, how = action.split()
    try:
        return _VERBS[verb](how, path)
    except Broken as error:
        return f"{BROKEN}: {error}"
    except Exception as error:
        trace = error.__traceback__
        while trace and trace.tb_next:
            trace = trace.tb_next
        where = trace.tb_frame.f_code if trace else None
        place = f"{os.path.basename(where.co_filename)}:{where.co_name}" if where else ""  # noqa: PTH119
        return f"{BROKEN}: {type(error).__name__} in {place}: {' '.join(str(error).split())}"
