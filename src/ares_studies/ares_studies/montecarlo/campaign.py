# SPDX-License-Identifier: Apache-2.0
"""Fly a campaign, from its first chunk to the file of all flights."""

from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass
from typing import Any

from ares_studies.montecarlo.engines import Chunk, Engine
from ares_studies.montecarlo.flights import Settings
from ares_studies.montecarlo.statistics import Tally
from ares_studies.montecarlo.store import Store, StoreError

#: Most and fewest flights of a chunk: large chunks lose more when a process is killed, small ones
#: cost more per flight.
LARGEST_CHUNK = 1000
SMALLEST_CHUNK = 25
#: Least number of chunks of a campaign, so that all cores have work.
CHUNKS = 16


@dataclass(frozen=True)
class CampaignPlan:
    """Hold the size and the stopping rule of a campaign.

    Attributes:
        settings: of the flights.
        count: number of flights; an upper bound if it may stop early.
        success_width: stop when the 95 % interval of the success rate is narrower.
        mass_width_kg: stop when the 95 % interval of the mean final mass is narrower.
    """

    settings: Settings
    count: int
    success_width: float | None = None
    mass_width_kg: float | None = None

    @property
    def may_stop(self) -> bool:
        """Return whether it may end before `count` flights."""
        return self.success_width is not None or self.mass_width_kg is not None

    def narrow_enough(self, tally: Tally) -> bool:
        """Tell whether every limited interval is narrow enough."""
        if self.success_width is not None:
            low, high = tally.proportion("succeeded")
            if high - low > self.success_width:
                return False
        if self.mass_width_kg is not None:
            low, high = tally.mass_intervals()[0]
            if not high - low <= self.mass_width_kg:
                return False
        return True


def missing(spans: list[Chunk], count: int) -> Iterator[Chunk]:
    """Yield the chunks that are missing among `count` flights."""
    size = min(LARGEST_CHUNK, max(SMALLEST_CHUNK, count // CHUNKS))
    at = 0
    for first, rows in [*spans, (count, 0)]:
        while at < min(first, count):
            step = min(size, first - at, count - at)
            yield at, step
            at += step
        at = max(at, first + rows)


class _InOrder:
    """Check the stopping rule in order of flights, so that a campaign stops reproducibly."""

    def __init__(self, plan: CampaignPlan, store: Store) -> None:
        self._plan = plan
        self._store = store
        self._there = dict(store.spans())
        self._tally = Tally()
        self.stop_at: int | None = None
        self._look()

    def add(self, first: int, count: int) -> None:
        self._there[first] = count
        self._look()

    def _look(self) -> None:
        while self._plan.may_stop and self.stop_at is None and self._tally.n in self._there:
            span = (self._tally.n, self._there[self._tally.n])
            self._tally.add(self._store.read(span))
            if self._plan.narrow_enough(self._tally):
                self.stop_at = self._tally.n


def fly_campaign(
    plan: CampaignPlan, store: Store, engine: Engine, watch: Callable[[Any], None]
) -> int:
    """Fly the missing flights of a campaign and assemble its file.

    Args:
        plan: size and stopping rule.
        store: its folder, with the flights flown before.
        engine: flies the chunks.
        watch: gets every chunk of flights, a pyarrow.Table, when it is done.

    Returns:
        Number of flights in the file.

    Raises:
        StoreError: the folder holds more flights than requested.
        EngineError: the engine is not available.
    """
    if store.count() > plan.count:
        raise StoreError(f"{store.folder}: holds {store.count()} flights, more than {plan.count}")
    store.reopen()
    order = _InOrder(plan, store)
    if order.stop_at is None:
        _fly_missing(plan, store, engine, watch, order)
    count = plan.count if order.stop_at is None else order.stop_at
    store.finish(count)
    return count


def _fly_missing(
    plan: CampaignPlan, store: Store, engine: Engine, watch: Callable[[Any], None], order: _InOrder
) -> None:
    # closing ends threads and connections in any case
    with closing(engine(plan.settings, missing(store.spans(), plan.count))) as tables:
        for table in tables:
            store.write(table)
            watch(table)
            order.add(table["flight"][0].as_py(), table.num_rows)
            if order.stop_at is not None:
                return
