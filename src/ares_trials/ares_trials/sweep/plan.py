# SPDX-License-Identifier: Apache-2.0
"""Select the files to try and the actions on each."""

from collections.abc import Mapping
from copy import deepcopy
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

from ares_models.input_file import InputKind, read_input
from ares_models.mission import MISSION as MISSION_FILE
from ares_models.mission import Mission
from ares_models.mission_keys import Part
from ares_trials.sweep.attempts import ACTIONS, DISPERSIONS, MISSION
from ares_trials.sweep.inputs import Input, inputs, to_yaml
from ares_trials.sweep.pool import Task
from ares_vehicle_sim.dispersions import DISPERSIONS as DISPERSIONS_FILE
from ares_vehicle_sim.dispersions import Dispersions

#: Additional files, so that every key is used somewhere.
_OWN = {
    MISSION: ("elements", "arcs", "solids", "pad", "programme"),
    DISPERSIONS: ("dispersions", "covariance"),
}
#: Other targets for one of them.
_TARGETS: Mapping[str, Mapping[str, object]] = {
    "apsides": {
        "perigee_radius_m": 6563140.0,
        "apogee_radius_m": 42164140.0,
        "inclination_deg": 28.5,
        "at": "perigee",
    },
    "transfer": {
        "perigee_altitude_m": 185000.0,
        "apogee_altitude_m": 35786000.0,
        "inclination_deg": 28.5,
        "argument_of_perigee_deg": 140.0,
    },
    "circle": {"perigee_altitude_m": 185000.0, "inclination_deg": 28.5},
    "escape": {"perigee_altitude_m": 185000.0, "c3_m2_s2": 1e6, "true_anomaly_deg": 5.0},
}
#: A whole parking orbit for Vulcan's coast.
_PARKING = {
    "perigee_altitude_m": 185000.0,
    "apogee_altitude_m": 185000.0,
    "inclination_deg": 28.5,
}
#: Targets that need an epoch to define the node.
_DATED: Mapping[str, Mapping[str, object]] = {
    "raan": {
        "radius_m": 6518889.0,
        "speed_m_s": 7840.675,
        "flight_path_angle_deg": 1.0064,
        "inclination_deg": 28.5,
        "raan_deg": 114.64,
    },
    "local_time": {
        "radius_m": 6518889.0,
        "speed_m_s": 7840.675,
        "flight_path_angle_deg": 1.0064,
        "inclination_deg": 28.5,
        "local_time_of_node_h": 0.899,
    },
    "latitude": {
        "perigee_altitude_m": 185000.0,
        "apogee_altitude_m": 250000.0,
        "inclination_deg": 28.5,
        "raan_deg": 114.64,
        "argument_of_latitude_deg": 150.0,
        "true_anomaly_deg": 10.0,
    },
    "orbit_local_time": {
        "perigee_altitude_m": 185000.0,
        "inclination_deg": 28.5,
        "local_time_of_node_h": 0.899,
    },
    "asymptote": {
        "perigee_altitude_m": 185000.0,
        "c3_m2_s2": 1e7,
        "inclination_deg": 28.5,
        "dla_deg": 5.0,
        "rla_deg": 124.0,
    },
}
_EPOCH = "2026-01-01T12:00:00Z"
#: End of an ascent from a pad.
_STATE = {
    "radius_m": 6678137.0,
    "speed_m_s": 7725.8,
    "flight_path_angle_deg": 0.0,
    "inclination_deg": 97.4,
}
#: Starts relative to the ground.
_STARTS: Mapping[str, Mapping[str, object]] = {
    "over_ground": {
        "time_s": 155.9,
        "geodetic_latitude_deg": 28.6318,
        "longitude_deg": -80.0004,
        "altitude_m": 42_123.6,
        "ground_speed_m_s": 1494.02,
        "elevation_deg": 13.3074,
        "ground_azimuth_deg": 88.3041,
    },
    "earth_fixed": {
        "time_s": 155.9,
        "earth_fixed_position_m": [979247.7, -5553813.1, 3058330.0],
        "earth_fixed_velocity_m_s": [1480.021, -24.597, 202.55],
    },
}
#: The rail from which a boost programme of its own begins.
_RAIL = {"length_m": 20.0, "elevation_deg": 88.0, "azimuth_deg": 60.5}
#: Other boost programmes for the mission that has one.
_PROGRAMMES: Mapping[str, Mapping[str, object]] = {
    "over_time": {
        "over": "time_s",
        "table": [[0.0, 90.0, 60.5], [10.0, 90.0, 60.5], [60.0, 62.0, 60.5], [150.0, 30.0, 62.0]],
        "horizon": "launch",
        "beyond": "constant",
        "until": {"time_s": 150.0},
    },
    "over_altitude": {
        "over": "altitude_m",
        "table": [[0.0, 90.0, 60.5], [400.0, 90.0, 60.5], [400.0, 86.0, 60.5]],
        "horizon": "local",
        "beyond": "velocity",
        "until": {"altitude_m": 60000.0},
    },
    "to_a_speed": {
        "kick": {"altitude_m": 400.0},
        "kick_deg": 4.0,
        "azimuth_deg": 60.5,
        "until": {"speed_m_s": 1500.0},
    },
    "to_the_end": {"kick": {"time_s": 10.0}, "kick_deg": 4.0, "azimuth_deg": 60.5},
}
#: Sampling interval: one input in SAMPLE is flown or solved.
SAMPLE = 20
_MODELS: Mapping[str, type[Part]] = {MISSION: Mission, DISPERSIONS: Dispersions}
_KINDS: Mapping[str, InputKind] = {MISSION: MISSION_FILE, DISPERSIONS: DISPERSIONS_FILE}


def bases(kind: str) -> dict[str, dict[str, Any]]:
    """Return valid files of a kind, as plain data by name."""
    file = _KINDS[kind]
    folder = resources.files("ares_trials").joinpath("sweep")
    paths = {name: file.find(name) for name in file.shipped()}
    paths |= {name: Path(str(folder.joinpath(f"{name}.yaml"))) for name in _OWN[kind]}
    found = {name: read_input(path, file)[0] for name, path in paths.items()}
    if kind == MISSION:
        for key, others in (("target", _TARGETS), ("initial_state", _STARTS)):
            found |= {name: found["ares_v"] | {key: dict(of)} for name, of in others.items()}
        for name, programme in _PROGRAMMES.items():
            found[name] = deepcopy(found["programme"]) | {"programme": deepcopy(dict(programme))}
        found["to_the_end"]["stages"][1]["arcs"][1]["burn_time_s"] = 320.0
        found["to_the_end"]["initial_state"]["rail"] = dict(_RAIL)
        parked = deepcopy(found["vulcan_gto"])
        parked["stages"][0]["arcs"][2] |= _PARKING
        found["parked"] = parked
        pad = found["electron_sso_pad"]
        for name, of in (("headed", pad["target"]), ("headed_to_a_state", _STATE)):
            found[name] = pad | {"target": {**of, "launch_heading": "south"}}
        dated = found["ares_v"] | {"epoch": _EPOCH}
        found |= {name: dated | {"target": dict(of)} for name, of in _DATED.items()}
    return found


@cache
def all_inputs(kind: str) -> list[Input]:
    """Return every input of a kind."""
    return list(inputs(_MODELS[kind], bases(kind)))


def each_once(found: list[Input]) -> list[Input]:
    """Select every value of every key once, in one of the files that have the key.

    A choice, on which all actions run, is tried in a file without a free coast if there is one:
    each method takes seconds to find a coast's length.
    """
    free = '"coast_s": "free"'
    planned = {name for name, data in bases(MISSION).items() if free in to_yaml(data)}
    alike: dict[object, list[Input]] = {}
    for one in found:
        keys = tuple(key for key in one.path if isinstance(key, str))
        alike.setdefault((keys, to_yaml(one.value)), []).append(one)
    for key, some in alike.items():
        if isinstance(some[0].value, str):
            alike[key] = [one for one in some if one.base not in planned] or some
    return [some[k % len(some)] for k, some in enumerate(alike.values())]


def tasks(kind: str, chosen: list[Input], everything: bool) -> list[Task]:
    """Return the tasks of inputs: each is read, then all actions or a sample of them run on it.

    Args:
        kind: of the inputs.
        chosen: the inputs.
        everything: run all actions on each. Otherwise run one action, in turn, on one input in
            SAMPLE, and one action in SAMPLE on each choice.
    """
    actions = ACTIONS[kind]

    def turn(k: int, one: Input) -> tuple[str, ...]:
        if everything:
            return actions
        if one.fit and isinstance(one.value, str):
            return actions[k % SAMPLE :: SAMPLE]
        return () if k % SAMPLE else (actions[k // SAMPLE % len(actions)],)

    return [Task(str(one), kind, to_yaml(one.data), turn(k, one)) for k, one in enumerate(chosen)]


def warm_up() -> list[Task]:
    """Return every action on one file of its kind, to load or compile what it needs."""
    first = {MISSION: "ares_v", DISPERSIONS: "dispersions"}
    return [
        Task(name, kind, to_yaml(bases(kind)[name]), ACTIONS[kind]) for kind, name in first.items()
    ]
