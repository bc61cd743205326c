# SPDX-License-Identifier: Apache-2.0
"""Fly chunks of flights in this thread, on all cores, or on a Dask cluster.

An engine takes chunks (first flight, count) and yields each as a table, in the order of completion.
The result of a flight does not depend on the engine.
"""

import os
import pickle
import threading
from collections import Counter
from collections.abc import Callable, Generator, Iterable
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from functools import partial
from itertools import islice
from typing import Any

import numpy as np
import pyarrow as pa

from ares_studies.montecarlo.arrays import RESULT
from ares_studies.montecarlo.flights import FlightRange, Flown, Settings
from ares_studies.montecarlo.table import make_table

Chunk = tuple[int, int]
#: Chunks of flights, each a pyarrow.Table.
Tables = Generator[Any, None, None]
Engine = Callable[[Settings, Iterable[Chunk]], Tables]

#: Chunks submitted per core, so that the next one is ready when one is done.
AHEAD = 2
#: Time limit of the connection to the scheduler, s.
CONNECT_TIMEOUT = 5.0
#: Retries of a chunk whose worker was lost.
RETRIES = 3

_own = threading.local()


class EngineError(ValueError):
    """Report in one line that an engine is not available."""


def fly_chunk(pickled: bytes, chunk: Chunk) -> Any:
    """Fly a chunk in this thread.

    Args:
        pickled: a `Settings`.
        chunk: first flight and count.

    Returns:
        The flights, a pyarrow.Table.
    """
    if getattr(_own, "pickled", None) != pickled:
        _own.settings = pickle.loads(pickled)
        _own.range = FlightRange(_own.settings)
        _own.pickled = pickled
    flown: Flown = _own.range.fly(*chunk)
    names = _own.settings.mission.jettison_names
    return make_table(flown, _own.range.columns, names, _own.range.pieces)


def cores() -> int:
    """Return the number of cores available to this process."""
    return len(os.sched_getaffinity(0))


def fly_here(settings: Settings, chunks: Iterable[Chunk]) -> Tables:
    """Fly in this thread."""
    pickled = pickle.dumps(settings)
    for chunk in chunks:
        yield fly_chunk(pickled, chunk)


def fly_on_cores(settings: Settings, chunks: Iterable[Chunk], *, count: int) -> Tables:
    """Fly in several threads; compiled flights release the interpreter's lock.

    Args:
        settings: of the flights.
        chunks: to be flown.
        count: number of threads.
    """
    pickled = pickle.dumps(settings)
    waiting = iter(chunks)
    pool = ThreadPoolExecutor(count, thread_name_prefix="flights")
    running: set[Future[Any]] = set()
    patient = True
    try:
        while True:
            for chunk in islice(waiting, AHEAD * count - len(running)):
                running.add(pool.submit(fly_chunk, pickled, chunk))
            if not running:
                return
            done, running = wait(running, return_when=FIRST_COMPLETED)
            for future in done:
                yield future.result()
    except KeyboardInterrupt:
        # do not wait for running flights
        patient = False
        raise
    finally:
        pool.shutdown(wait=patient, cancel_futures=True)


def fly_on_cluster(settings: Settings, chunks: Iterable[Chunk], *, address: str) -> Tables:
    """Fly on the workers of a Dask cluster; repeat the chunk of a lost worker on another.

    Args:
        settings: of the flights.
        chunks: to be flown.
        address: of the scheduler, such as ``tcp://host:8786``.

    Raises:
        EngineError: no scheduler there, no workers, or workers without this project.
    """
    # a slow import, needed by this engine only
    from distributed import Client, as_completed
    from distributed.comm import get_address_host_port

    try:
        # checked here, since a client with an invalid address cannot be closed
        get_address_host_port(address)
        client = Client(address, timeout=CONNECT_TIMEOUT, set_as_default=False)
    except (OSError, ValueError) as error:
        raise EngineError(f"no Dask scheduler at {address!r}: {_line(error)}") from error
    with client:
        _check_workers(client, address)
        pickled = pickle.dumps(settings)
        waiting = iter(chunks)
        queue = as_completed(loop=client.loop, with_results=True, raise_errors=False)
        where: dict[Any, Chunk] = {}
        losses: Counter[Chunk] = Counter()

        def submit(chunk: Chunk) -> None:
            future = client.submit(fly_chunk, pickled, chunk, pure=False, retries=RETRIES)
            where[future.key] = chunk
            queue.add(future)

        while True:
            room = AHEAD * max(1, sum(client.nthreads().values())) - len(where)
            for chunk in islice(waiting, max(0, room)):
                submit(chunk)
            if not where:
                return
            future, result = next(queue)
            chunk = where.pop(future.key)
            if isinstance(result, pa.Table):
                yield result
                continue
            # its worker was lost; errors of flights are in the table
            losses[chunk] += 1
            if losses[chunk] <= RETRIES:
                submit(chunk)
            else:
                yield lost(settings, chunk, result)


def _check_workers(client: Any, address: str) -> None:
    """Check that there are workers that can fly.

    Raises:
        EngineError: there are none.
    """
    if not client.nthreads():
        raise EngineError(f"the Dask scheduler at {address!r} has no workers")
    try:
        client.run(_can_fly)
    except Exception as error:
        raise EngineError(f"the workers of {address!r} cannot fly: {_line(error)}") from error


def _can_fly() -> None:
    """Import the modules of a flight on a worker."""
    __import__(fly_chunk.__module__)


def lost(settings: Settings, chunk: Chunk, error: object) -> Any:
    """Return a chunk that no worker completed, as failed flights."""
    flyer = FlightRange(settings)
    first, count = chunk
    flown = Flown(
        first,
        np.full((count, len(flyer.columns)), np.nan),
        np.zeros(count, RESULT),
        dict.fromkeys(range(first, first + count), f"{type(error).__name__}: {_line(error)}"),
    )
    return make_table(flown, flyer.columns, settings.mission.jettison_names, flyer.pieces)


def _line(error: object) -> str:
    return " ".join(str(error).split())


def choose(scheduler: str | None, workers: int | None) -> Engine:
    """Return the requested engine.

    Args:
        scheduler: address of a Dask scheduler; None: this machine.
        workers: threads; None: one per core.
    """
    if scheduler is not None:
        return partial(fly_on_cluster, address=scheduler)
    count = workers or cores()
    return fly_here if count == 1 else partial(fly_on_cores, count=count)
