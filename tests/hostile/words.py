# SPDX-License-Identifier: Apache-2.0
"""Command lines: verbs with hostile options and arguments, parsed and checked in this process."""

import contextlib
import json
import os
import shutil
import tempfile
from collections.abc import Iterator
from enum import EnumType
from pathlib import Path
from random import Random
from typing import Any, NoReturn
from unittest.mock import patch

import typer.main

from ares_bringup.commands.cli import app
from ares_bringup.options import CannotStart
from ares_guidance.laws import check_law, find_law
from ares_guidance.registry import law_names
from ares_models.mission import load_mission
from hostile.bags import commanded
from hostile.mutate import TEXTS, number, text
from hostile.target import Target, check

#: What would fly, solve, serve or write for long once its words are found good.
_WORK = (
    "ares_bringup.fly.fly_in_process",
    "ares_bringup.fly.fly_in_processes",
    "ares_bringup.commands.optimize.solve",
    "ares_thesis.commands.analytic.solve_analytic",
    "ares_bringup.commands.montecarlo.choose",
    "ares_bringup.commands.montecarlo._fly_alone",
    "ares_bringup.commands.aborts.MapMaker",
    "ares_trials.faults.campaign.fly_all",
    "ares_bringup.audience.follow",
    "os.execv",
)


class _Good(CannotStart):
    """Report that the words were accepted."""


def _taken(*_words: Any, **_more: Any) -> NoReturn:
    raise _Good("taken")


class CommandLines(Target):
    """Try command lines: every refusal is one line and exit status 2."""

    name = "command lines"
    share = 0.1

    def __init__(self) -> None:
        self._folder = Path()
        self._held = contextlib.ExitStack()

    def begin(self) -> None:
        self.end()
        self._folder = Path(tempfile.mkdtemp(prefix="ares-fuzz-"))
        self._held.callback(shutil.rmtree, self._folder, True)
        self._held.enter_context(contextlib.chdir(self._folder))
        self._held.enter_context(patch.dict(os.environ))
        for place in _WORK:
            self._held.enter_context(patch(place, _taken))
        # compiled before it is timed
        mission = load_mission("ares_v")
        for law in law_names():
            if not find_law(law).needs_trajectory:
                check_law(law, mission.arrays(foreseen=True), mission.start().navigation(), None)
        group = typer.main.get_command(app)
        self._verbs = dict(_leaves(group, ()))

    def end(self) -> None:
        self._held.close()
        self._held = contextlib.ExitStack()

    def make(self, random: Random) -> bytes:
        verb = random.choice(list(self._verbs))
        words = [*verb]
        parameters = self._verbs[verb].params
        for parameter in random.sample(parameters, random.randint(0, min(5, len(parameters)))):
            name = random.choice(parameter.opts)
            if name.startswith("-"):
                words.append(name if random.random() < 0.97 else name[:-1])
            if not getattr(parameter, "is_flag", False):
                words.append(_value(parameter, random))
        if random.random() < 0.1:
            words.insert(random.randint(0, len(words)), text(random))
        return json.dumps(words).encode()

    def run(self, data: bytes) -> str:
        words = [str(word).replace("\x00", "") for word in json.loads(data)]
        status, said = commanded(*words)
        check(status in (0, 1, 2, 130), f"exit status {status}")
        if "taken" in said:
            return "taken"
        return "refused" if status == 2 else f"status {status}"


def _leaves(command: Any, verb: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], Any]]:
    if hasattr(command, "commands"):
        for name, inner in command.commands.items():
            yield from _leaves(inner, (*verb, name))
    elif verb[0] not in _LONG:
        yield verb, command


#: Works for minutes whatever it is told.
_LONG = ("reproduce",)


def _value(parameter: Any, random: Random) -> str:
    kind = random.random()
    values = parameter.type_descriptor.annotation
    if kind < 0.5 and isinstance(values, EnumType):
        return str(random.choice([*values]).value)
    if kind < 0.5:
        return random.choice((repr(number(random)), str(random.randint(-3, 300)), "1"))
    return random.choice(TEXTS)
