# SPDX-License-Identifier: Apache-2.0
"""Files that people write: missions, dispersions, parameters; and their names."""

import os
import shutil
import tempfile
from abc import abstractmethod
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import yaml

from ares_bringup.params_file import node_values
from ares_models.input_file import InputError, InputKind
from ares_models.mission import MISSION, Mission, load_mission
from ares_studies.closed_loop import fly_compiled, ready_law
from ares_vehicle_sim.dispersions import DISPERSIONS, load_dispersions
from ares_vehicle_sim.simulator import CAMPAIGN, SimulatorOptions, true_vehicle
from hostile.mutate import TEXTS, text, yaml_structure, yaml_text
from hostile.target import Target, check, one_line

REFUSED = "refused"
TAKEN = "taken"


class _File(Target):
    """Write a new file for each input.

    Attributes:
        good: texts of valid files.
    """

    def __init__(self) -> None:
        self.good: list[str] = []
        self._folder = Path()

    def begin(self) -> None:
        self.end()
        self._folder = Path(tempfile.mkdtemp(prefix="ares-fuzz-"))
        self.path = self._folder / "input.yaml"

    def end(self) -> None:
        if self._folder.name:
            shutil.rmtree(self._folder, ignore_errors=True)

    def make(self, random: Random) -> bytes:
        good = random.choice(self.good)
        if random.random() < 0.5:
            return yaml_text(good, random)
        return yaml_structure(yaml.safe_load(good), random)

    def run(self, data: bytes) -> str:
        self.path.write_bytes(data)
        try:
            return self.use()
        except InputError as error:
            for problem in (str(error), *error.problems):
                one_line(problem)
            return REFUSED

    @abstractmethod
    def use(self) -> str:
        """Read the file, and use what it says."""


def _finite(name: str, record: Any, *, may_be: tuple[str, ...] = ()) -> None:
    """Assert that no number of a structured array is NaN, except in some fields."""
    for field in record.dtype.names or ():
        inner = record[field]
        if inner.dtype.names:
            _finite(f"{name}.{field}", inner, may_be=may_be)
        elif field not in may_be:
            check(not np.any(np.isnan(inner)), f"{name}.{field} is {inner}")


def _of(kind: InputKind) -> list[str]:
    return [kind.find(name).read_text(encoding="utf-8") for name in kind.shipped()]


class MissionFiles(_File):
    """Try missions: an accepted one has numbers in all arrays, and flies to an end with numbers."""

    name = "mission files"
    share = 1.0
    #: Of the missions that are taken, how many are flown.
    flown = 0.2
    #: One that needs no plan, one planned above the air, one from the pad.
    warm_up = ("ares_v", "ariane5_eca", "delta_iii_pad")

    def begin(self) -> None:
        super().begin()
        self.good = _of(MISSION)
        # compiled before it is timed
        for mission in map(load_mission, self.warm_up):
            _flown(mission)

    def use(self) -> str:
        mission = load_mission(self.path)
        arrays = mission.arrays(foreseen=True)
        _finite("arcs", arrays.arcs)
        _finite("jettisons", arrays.jettisons)
        _finite("environment", arrays.environment)
        _finite("start", mission.start().navigation(), may_be=("heating_rate",))
        check(bool(np.all(np.isfinite(arrays.atmosphere))), "the atmosphere has gaps")
        one_line(mission.describe()["name"])
        # a flight with free coasts takes hours of flight time, and seconds
        if not mission.plans_arcs and Random(self.path.read_bytes()).random() < self.flown:
            return _flown(mission)
        return TAKEN


def _flown(mission: Mission) -> str:
    """Fly a mission that was taken; what the end says must be numbers."""
    try:
        law = ready_law(mission)
    except ValueError as error:
        one_line(str(error))
        return "not flown"
    plant = fly_compiled(mission, options=CAMPAIGN, law=law).plant
    for field in ("time", "position", "velocity", "mass"):
        check(bool(np.all(np.isfinite(plant[field]))), f"{field} at the end is {plant[field]}")
    check(bool(plant["complete"]), "the flight has no end")
    return "flown"


class DispersionFiles(_File):
    """Try dispersions: accepted ones give a vehicle of numbers."""

    name = "dispersion files"
    share = 1.0

    def begin(self) -> None:
        super().begin()
        self.good = _of(DISPERSIONS)
        self._mission = load_mission("ares_v")

    def use(self) -> str:
        dispersions = load_dispersions(self.path)
        if Random(self.path.read_bytes()).random() < 0.1:
            try:
                true, vehicle = true_vehicle(
                    self._mission, SimulatorOptions(), dispersions, seed=1, flight=3
                )
            except ValueError as error:
                one_line(str(error))
                return "not drawn"
            _finite("arcs", true.arcs)
            _finite("navigation", vehicle.navigation, may_be=("heating_rate",))
            return "drawn"
        return TAKEN


_PARAMETERS = """\
/**:
  ros__parameters:
    mission: ares_v
    seed: 3
/ares/vehicle_sim:
  ros__parameters:
    pace: 2.5
    paused: false
guidance:
  ros__parameters: {law: peg, gates: [1.0, 2.0]}
"""


class ParameterFiles(_File):
    """Try ROS parameter files, as a launch reads them before it starts anything."""

    name = "parameter files"
    share = 0.5

    def begin(self) -> None:
        super().begin()
        self.good = [_PARAMETERS]

    def use(self) -> str:
        try:
            values = node_values(self.path, "vehicle_sim")
        except (OSError, ValueError) as error:
            one_line(str(error))
            return REFUSED
        check(isinstance(values, dict), "no mapping")
        return TAKEN


class Names(Target):
    """Try names and paths of missions and dispersions: devices, pipes, folders, tricks."""

    name = "names of files"
    share = 0.3

    def __init__(self) -> None:
        self._folder = Path()

    def begin(self) -> None:
        self.end()
        self._folder = folder = Path(tempfile.mkdtemp(prefix="ares-fuzz-"))
        os.mkfifo(folder / "pipe.yaml")
        (folder / "folder.yaml").mkdir()
        (folder / "loop.yaml").symlink_to(folder / "loop.yaml")
        (folder / "zero.yaml").symlink_to("/dev/zero")
        (folder / "large.yaml").write_bytes(b"a: 1\n" * 200_000)
        (folder / "hidden.yaml").write_bytes(b"\xff\xfe")
        (folder / "good.yaml").symlink_to(MISSION.find("ares_v"))
        self._places = [str(path) for path in folder.iterdir()]
        self._places += ["/dev/zero", "/dev/random", "/dev/null", "/dev/stdin", "/dev/tty"]
        self._places += ["/proc/self/mem", "/proc/self/cmdline", "/proc/self/fd/0", "/sys"]

    def end(self) -> None:
        if self._folder.name:
            shutil.rmtree(self._folder, ignore_errors=True)

    def make(self, random: Random) -> bytes:
        place = random.choice((*self._places, *MISSION.shipped(), *DISPERSIONS.shipped()))
        kind = random.random()
        if kind < 0.3:
            name = place
        elif kind < 0.5:
            name = random.choice(TEXTS)
        elif kind < 0.7:
            name = place + random.choice(("/", "/.", "/..", "\x00", ".yaml", " ", "//../x"))
        else:
            name = text(random) + random.choice(("", ".yaml", "/", ".yml"))
        return name.encode("utf-8", "surrogatepass")

    def run(self, data: bytes) -> str:
        name = data.decode("utf-8", "surrogateescape")
        # the folder of this run has another name than that of the run that made it
        for load in (load_mission, load_dispersions):
            try:
                load(name)
            except InputError as error:
                for problem in (str(error), *error.problems):
                    one_line(problem)
            else:
                shipped = name in (*MISSION.shipped(), *DISPERSIONS.shipped())
                check(shipped or Path(name).is_file(), f"{name!r} is a file of missions")
        return "tried"
