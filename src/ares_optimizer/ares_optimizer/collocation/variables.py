# SPDX-License-Identifier: Apache-2.0
"""Convert trial flights to the variables of a program."""

import numpy as np
from numpy.typing import NDArray

from ares_models.arrays import MissionArrays
from ares_optimizer.collocation import rollout
from ares_optimizer.collocation.intervals import Sweep, sweep_of
from ares_optimizer.collocation.pilot import TrialFlight, path_of, without_repeats
from ares_optimizer.collocation.transcription import CollocationProgram
from ares_optimizer.kernels import timetable

Array = NDArray[np.float64]


def guess_of(program: CollocationProgram, trial: TrialFlight) -> Array:
    """Convert a trial flight to variables of a program.

    Args:
        program: transcribed for the times of the flight.
        trial: the flight.
    """
    x = variables_of_trial(program)
    times = node_times(program)
    track = without_repeats(trial.track)
    path = path_of(track)
    times = np.clip(times, track[0, rollout.TIME], track[-1, rollout.TIME])
    states = np.column_stack((path(times), path(times, 1)))
    states[:, :3] /= program.radius
    states[:, 3:] /= program.speed
    x[: 6 * program.nodes] = states.ravel()
    directions = np.column_stack(
        [
            np.interp(times, track[:, rollout.TIME], track[:, rollout.DIRECTION + c])
            for c in range(3)
        ]
    )
    directions /= np.maximum(np.linalg.norm(directions, axis=1), 1e-9)[:, None]
    for point in program.points:
        if point["control"] >= 0:
            at = int(point["control"])
            x[at : at + 3] = directions[int(point["node"] + point["number"])]
    return x


def variables_of_trial(program: CollocationProgram) -> Array:
    """Return variables with the lengths and masses of the trial flight, and else 0."""
    x = np.zeros(program.size)
    for p, piece in enumerate(program.segments):
        x[program.lengths[p]] = float(piece["end"] - piece["start"]) / program.time
        x[program.masses[p]] = float(piece["mass"]) / program.mass
        x[program.ends[p]] = timetable.segment_mass(piece, piece["end"]) / program.mass
    return x


def node_times(program: CollocationProgram, lengths: Array | None = None) -> Array:
    """Return the mission elapsed time of each state, s, shape (nodes,).

    Args:
        program: the program.
        lengths: of the phases, s; None: those of the trial flight.
    """
    pieces = program.segments
    if lengths is None:
        lengths = pieces["end"] - pieces["start"]
    begins = float(program.start["time"][0]) + np.concatenate(([0.0], np.cumsum(lengths)))
    times = np.empty(program.nodes)
    times[0] = begins[0]
    for point in program.points:
        p = int(point["phase"])
        times[int(point["node"] + point["number"])] = begins[p] + point["fraction"] * lengths[p]
    return times


def sweep_of_trial(trial: TrialFlight, arrays: MissionArrays) -> Sweep:
    """Return the sweep of a trial flight."""
    track = trial.track
    position = track[:, rollout.POSITION : rollout.VELOCITY]
    return sweep_of(track[:, rollout.TIME], position, arrays.environment[0])
