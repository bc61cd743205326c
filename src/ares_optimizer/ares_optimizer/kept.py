# SPDX-License-Identifier: Apache-2.0
"""Keep the last solutions for those who ask again.

A flight from the pad is planned before its nodes start, by the optimizer node when it starts, and
when guidance asks; most missions are optimized before they are flown, and flown several times. The
search takes seconds and finds the same each time.
"""

import math
import os
import pickle
import threading
from collections import OrderedDict
from contextlib import suppress
from functools import cache
from hashlib import sha256
from itertools import chain
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import ares_models
import ares_optimizer
from ares_models.arrays import MissionArrays
from ares_models.plans import flies_in_air
from ares_optimizer.deadline import Deadline
from ares_optimizer.registry import METHODS, SHARED_SOLUTIONS
from ares_optimizer.solution import Solution
from ares_optimizer.solve import solve

#: Most solutions that a process keeps, and a shared folder.
_MOST, _MOST_SHARED = 8, 200

_kept: OrderedDict[bytes, Solution] = OrderedDict()
_lock = threading.Lock()


def solve_once(
    arrays: MissionArrays,
    method: str,
    state: NDArray[np.void],
    heating: str,
    deadline: Deadline,
    *,
    verify: bool = True,
    anew: bool = False,
) -> Solution:
    """Solve a mission, or return the solution that was found before from the same inputs.

    It was found by this process, or by one that shares its solutions: see
    :data:`ares_optimizer.registry.SHARED_SOLUTIONS`. A solution by other code is not returned.

    What a limit of time may have changed is not kept, nor what a registered method found.

    Args:
        arrays: the mission.
        method, state, heating, deadline, verify: as in :func:`ares_optimizer.solve.solve`.
        anew: solve, whatever is known, for those who ask later.

    Raises:
        OptimizerError: unknown method, or bad state.
    """
    key = _key_of(arrays, method, state, heating, verify)
    if not anew:
        with _lock:
            known = _kept.get(key) or _shared(key)
        if known is not None and not deadline.passed:
            return known
    solution = solve(arrays, method, state=state, heating=heating, deadline=deadline, verify=verify)
    if method in METHODS and not deadline.passed:
        with _lock:
            _kept[key] = solution
            if len(_kept) > _MOST:
                _kept.popitem(last=False)
            _share(key, solution)
    return solution


def _file_of(key: bytes) -> Path | None:
    """Return the file of a solution that this code shares; None: none is shared."""
    folder = os.environ.get(SHARED_SOLUTIONS)
    return Path(folder, sha256(_code() + key).hexdigest()) if folder else None


def _shared(key: bytes) -> Solution | None:
    """Return a solution of another process; None: there is none."""
    file = _file_of(key)
    if file is None or not file.is_file():
        return None
    # whatever is wrong with a file: the search finds it again
    with suppress(Exception):
        solution: Solution = pickle.loads(file.read_bytes())
        file.touch()
        return solution
    return None


def _share(key: bytes, solution: Solution) -> None:
    """Share a solution with other processes, in place of the one that was used least recently."""
    file = _file_of(key)
    if file is None:
        return
    # without room, or without the folder, the others search themselves
    with suppress(OSError):
        file.parent.mkdir(parents=True, exist_ok=True)
        new = file.with_suffix(f".{os.getpid()}")
        new.write_bytes(pickle.dumps(solution))
        new.replace(file)
        by_use = sorted(file.parent.iterdir(), key=lambda other: other.stat().st_mtime)
        for other in by_use[:-_MOST_SHARED]:
            other.unlink()


def _key_of(
    arrays: MissionArrays, method: str, state: NDArray[np.void], heating: str, verify: bool
) -> bytes:
    """Return a hash of all that a solution depends on."""
    # in the air each solution is verified
    verify = verify or flies_in_air(arrays.arcs)
    inputs = sha256(f"{method} {heating} {verify}".encode())
    begin = state.copy()
    # measured in flight; no search reads it
    begin["heating_rate"] = math.nan
    for part in (*arrays, begin):
        inputs.update(f"{part.shape}".encode())
        inputs.update(part.tobytes())
    return inputs.digest()


@cache
def _code() -> bytes:
    """Return a hash of the code that finds solutions."""
    code = sha256()
    packages = (Path(package.__file__ or "").parent for package in (ares_models, ares_optimizer))
    for file in chain.from_iterable(sorted(package.rglob("*.py")) for package in packages):
        code.update(file.read_bytes())
    return code.digest()
