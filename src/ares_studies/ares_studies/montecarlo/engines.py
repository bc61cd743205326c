# SPDX-License-Identifier: Apache-2.0
"""Who flies: this thread, all cores of this machine, or the workers of a Dask cluster.

An engine takes chunks (first flight, count) and gives each as a table, in the order in which
they get done. What a flight comes to does not depend on who flew it.
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
from ares_studies.montecarlo.flights import Flown, Range, Settings
from ares_studies.montecarlo.table import make_table

Chunk = tuple[int, int]
#: Chunks of flights, each a pyarrow.Table.
Tables = Generator[Any, None, None]
Engine = Callable[[Settings, Iterable[Chunk]], Tables]

#: Chunks that a core has at once: the next one is there when one is done.
AHEAD = 2
#: s to find the scheduler.
CONNECT_TIMEOUT = 5.0
#: How often a chunk whose worker was lost is begun again on another.
RETRIES = 3

_own = threading.local()


class EngineError(ValueError):
    """An engine cannot be had; the text is one line."""


def fly_chunk(pickled: bytes, chunk: Chunk) -> Any:
    """Fly a chunk in this thread.

    Args:
        pickled: a `Settings`.
        chunk: first flight and count.

    Returns:
        the flights, a pyarrow.Table.
    """
    if getattr(_own, "pickled", None) != pickled:
        _own.settings = pickle.loads(pickled)
        _own.range = Range(_own.settings)
        _own.pickled = pickled
    flown: Flown = _own.range.fly(*chunk)
    return make_table(flown, _own.range.columns, _own.settings.mission.jettison_names)


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0))


def fly_here(settings: Settings, chunks: Iterable[Chunk]) -> Tables:
    """Fly in this thread."""
    pickled = pickle.dumps(settings)
    for chunk in chunks:
        yield fly_chunk(pickled, chunk)


def fly_on_cores(settings: Settings, chunks: Iterable[Chunk], *, count: int) -> Tables:
    """Fly in as many threads; compiled flights leave the interpreter's lock alone.

    Args:
        settings: what is flown.
        chunks: which flights.
        count: threads.
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
        # flights under way are given up
        patient = False
        raise
    finally:
        pool.shutdown(wait=patient, cancel_futures=True)


def fly_on_cluster(settings: Settings, chunks: Iterable[Chunk], *, address: str) -> Tables:
    """Fly on the workers of a Dask cluster; a chunk whose worker is lost is flown by another.

    Args:
        settings: what is flown.
        chunks: which flights.
        address: of the scheduler, such as ``tcp://host:8786``.

    Raises:
        EngineError: no scheduler there, no workers, or workers without this project.
    """
    # only this engine needs it, and its import takes long
    from distributed import Client, as_completed
    from distributed.comm import get_address_host_port

    try:
        # a client refuses what is no address too, and cannot be closed then
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
            # a worker was lost with it; what goes wrong in a flight is in the table
            losses[chunk] += 1
            if losses[chunk] <= RETRIES:
                submit(chunk)
            else:
                yield lost(settings, chunk, result)


def _check_workers(client: Any, address: str) -> None:
    """Whether there are workers that can fly.

    Raises:
        EngineError: not so.
    """
    if not client.nthreads():
        raise EngineError(f"the Dask scheduler at {address!r} has no workers")
    try:
        client.run(_can_fly)
    except Exception as error:
        raise EngineError(f"the workers of {address!r} cannot fly: {_line(error)}") from error


def _can_fly() -> None:
    """Runs on every worker: imports what a flight needs."""
    __import__(fly_chunk.__module__)


def lost(settings: Settings, chunk: Chunk, error: object) -> Any:
    """A chunk that no worker brought to its end, as failed flights."""
    flyer = Range(settings)
    first, count = chunk
    flown = Flown(
        first,
        np.full((count, len(flyer.columns)), np.nan),
        np.zeros(count, RESULT),
        dict.fromkeys(range(first, first + count), f"{type(error).__name__}: {_line(error)}"),
    )
    return make_table(flown, flyer.columns, settings.mission.jettison_names)


def _line(error: object) -> str:
    return " ".join(str(error).split())


def choose(scheduler: str | None, workers: int | None) -> Engine:
    """The engine that is asked for.

    Args:
        scheduler: address of a Dask scheduler; None for this machine.
        workers: threads; None for one per core.
    """
    if scheduler is not None:
        return partial(fly_on_cluster, address=scheduler)
    count = workers or cores()
    return fly_here if count == 1 else partial(fly_on_cores, count=count)
