# SPDX-License-Identifier: Apache-2.0
"""Compute a campaign's statistics: counts, intervals, reserve, sensitivities, worst flights.

The file of flights is read one group of rows at a time, so that memory does not grow with the
campaign, except for three numbers per thousand flights (the tail for the reserve).
"""

import math
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
from numpy.typing import NDArray

from ares_studies.montecarlo.footprints import Footprint, Footprints
from ares_studies.montecarlo.store import GROUP
from ares_studies.montecarlo.table import DRAWN, FLAGS, Verdict

Array = NDArray[np.float64]
Interval = tuple[float, float]

CONFIDENCE = 0.95
#: Blocks of flights that the bootstrap resamples instead of single flights.
BLOCKS = 200
RESAMPLES = 2000
#: Fraction of flights for which the reserve suffices, and confidence of that.
RESERVE_SHARE = 0.997
RESERVE_CONFIDENCE = 0.90
#: Flights in sensitivities and scatter plots: the file's first group of rows.
SAMPLE = GROUP
#: Length of each list of worst flights.
WORST = 5
#: Most failed flights kept, for their tracks and marks.
FAILED = 30
#: Most bins of a histogram; of fewer flights it has the square root of their number.
BINS = 80
#: Most by which a histogram extends beyond the successful flights on either side, as a fraction.
NEAR = 0.25
#: Least fraction of all flights with the quantity that a histogram shows.
SHOWN = 0.98


class Tally:
    """Count flights and accumulate moments, chunk by chunk.

    Attributes:
        n: flights.
        counts: flights with each flag, and with all of them (`succeeded`).
        outcomes: flights by outcome.
        least, most: final mass, kg.
    """

    def __init__(self) -> None:
        """Start without flights."""
        self.n = 0
        self.counts = dict.fromkeys((*FLAGS, "succeeded"), 0)
        self.outcomes: Counter[str] = Counter()
        self.least, self.most = np.inf, -np.inf
        self._origin: float | None = None
        # by block: number of flights, sum and sum of squares of the mass
        self._blocks = np.zeros((3, BLOCKS))

    def add(self, table: Any) -> None:
        """Add flights, a pyarrow.Table that continues the previous ones."""
        self.n += table.num_rows
        for name in self.counts:
            self.counts[name] += int(np.count_nonzero(table[name].to_numpy()))
        self.outcomes.update(table["outcome"].to_pylist())
        mass = table["m_f_kg"].to_numpy()
        flown = np.isfinite(mass)
        mass = mass[flown]
        if mass.size == 0:
            return
        if self._origin is None:
            self._origin = float(mass[0])
        self.least, self.most = min(self.least, mass.min()), max(self.most, mass.max())
        block = table["flight"].to_numpy()[flown] % BLOCKS
        off = mass - self._origin
        for row, weights in enumerate((None, off, off * off)):
            self._blocks[row] += np.bincount(block, weights, BLOCKS)

    def proportion(self, name: str) -> Interval:
        """Compute the exact (Clopper-Pearson) interval of the fraction of flights with a flag."""
        from scipy.stats import binomtest  # slow to import, as all of scipy.stats

        interval = binomtest(self.counts[name], self.n).proportion_ci(CONFIDENCE, "exact")
        return float(interval.low), float(interval.high)

    def mass(self) -> Interval:
        """Compute mean and standard deviation of the final mass, kg."""
        if self._origin is None:
            return np.nan, np.nan
        mean, deviation = _moments(*self._blocks.sum(axis=1))
        return self._origin + float(mean), float(deviation)

    def mass_intervals(self) -> tuple[Interval, Interval]:
        """Compute bootstrap intervals of mean and standard deviation of the final mass, kg.

        Blocks of flights are resampled instead of flights: equally accurate, and of fixed size.
        """
        from scipy.stats import bootstrap

        blocks = self._blocks[:, self._blocks[0] > 0.0]
        if self._origin is None or blocks.shape[1] < 2:
            return (np.nan, np.nan), (np.nan, np.nan)

        def statistic(count: Array, total: Array, squares: Array, axis: int = -1) -> Array:
            return _moments(count.sum(axis), total.sum(axis), squares.sum(axis))

        found = bootstrap(
            tuple(blocks),
            statistic,
            n_resamples=RESAMPLES,
            paired=True,
            vectorized=True,
            confidence_level=CONFIDENCE,
            method="percentile",
            rng=np.random.default_rng(0),
        ).confidence_interval
        low, high = np.asarray(found.low), np.asarray(found.high)
        return (
            (self._origin + float(low[0]), self._origin + float(high[0])),
            (float(low[1]), float(high[1])),
        )


def _moments(count: Any, total: Any, squares: Any) -> Array:
    """Compute mean and standard deviation, stacked, from counts and sums."""
    mean = total / count
    variance = np.maximum(squares / count - mean * mean, 0.0)
    return np.array([mean, np.sqrt(variance * count / np.maximum(count - 1.0, 1.0))])


@dataclass(frozen=True)
class Reserve:
    """Hold the propellant reserve for dispersions.

    Attributes:
        needed: least number of flights for the bound.
        used_kg: upper bound on the use of the last stage, in RESERVE_SHARE of flights with
            RESERVE_CONFIDENCE; nan: too few flights, or too many missed the target.
        nominal_kg: use in the undispersed flight.
    """

    needed: int
    used_kg: float
    nominal_kg: float

    @property
    def reserve_kg(self) -> float:
        """Return the bound minus the nominal use."""
        return self.used_kg - self.nominal_kg


def bound_rank(n: int) -> int:
    """Return the rank of the value that bounds RESERVE_SHARE of n with RESERVE_CONFIDENCE; 0: none.

    Distribution-free (order statistics): the k-th largest is beyond the quantile if at least
    k of n flights are, a binomial number.
    """
    from scipy.stats import binom

    return int(binom.ppf(1.0 - RESERVE_CONFIDENCE, n, 1.0 - RESERVE_SHARE))


def flights_needed() -> int:
    """Return the least number of flights for a bound on the reserve."""
    return int(np.ceil(np.log(1.0 - RESERVE_CONFIDENCE) / np.log(RESERVE_SHARE)))


class _Tail:
    """Keep the largest of many numbers."""

    def __init__(self, size: int) -> None:
        self._size = size
        self._values = np.zeros(0)

    def add(self, values: Array) -> None:
        together = np.concatenate([self._values, values])
        if together.size > self._size:
            together = np.partition(together, together.size - self._size)[-self._size :]
        self._values = together

    def largest(self, k: int) -> float:
        """Return the k-th largest, k from 1."""
        return float(np.sort(self._values)[-k])


@dataclass(frozen=True)
class Load:
    """Hold the greatest values of a load of the air, one a flight.

    Attributes:
        mean, most: over the flights that do not meet the ground.
        bound: upper bound in RESERVE_SHARE of flights with RESERVE_CONFIDENCE; nan: too few.
        limited: flights with a limit.
        kept: those of them within ALLOWED of it.
        worst: greatest fraction of the limit; nan: there is none.
    """

    mean: float
    most: float
    bound: float
    limited: int
    kept: int
    worst: float


class _LoadTally:
    """Accumulate a load and its fraction of the limit."""

    def __init__(self, size: int) -> None:
        self._tail = _Tail(size)
        self._count, self._sum = 0, 0.0
        self._limited, self._kept, self._worst = 0, 0, math.nan

    def add(self, values: Array, shares: Array) -> None:
        values, shares = values[np.isfinite(values)], shares[np.isfinite(shares)]
        self._tail.add(values)
        self._count += values.size
        self._sum += float(values.sum())
        if shares.size:
            self._limited += shares.size
            self._kept += int(np.count_nonzero(shares <= ALLOWED))
            self._worst = float(np.fmax(self._worst, shares.max()))

    def load(self) -> Load | None:
        """Return the load; None: no flight has it."""
        if not self._count:
            return None
        rank = bound_rank(self._count)
        bound = self._tail.largest(rank) if rank else math.nan
        mean, most = self._sum / self._count, self._tail.largest(1)
        return Load(mean, most, bound, self._limited, self._kept, self._worst)


@dataclass(frozen=True)
class Histogram:
    """Hold a histogram of a quantity.

    The range is that of the successful flights, or of all if none succeeded, extended to the others
    if they are close, and until it has SHOWN of all. Values outside it are in no bin.

    Attributes:
        edges: shape (bins + 1,).
        counts: of the successful flights, shape (bins,).
        failed: of the others, shape (bins,).
        below, above: number of values outside.
    """

    edges: Array
    counts: NDArray[np.int64]
    failed: NDArray[np.int64]
    below: int
    above: int


@dataclass(frozen=True)
class Summary:
    """Hold the statistics of a campaign.

    Attributes:
        tally: counts and moments.
        reserve: of propellant.
        loads: of flights in the air, by column of the table.
        histograms: by column of the table.
        influences: rank correlation (Spearman's) of each draw with a result, strongest first, by
            the result's column.
        worst: rows, by criterion.
        failures: rows of the first failed flights.
        sample: columns of the first flights.
        footprints: of what comes down.
    """

    tally: Tally
    reserve: Reserve
    loads: dict[str, Load]
    histograms: dict[str, Histogram]
    influences: dict[str, dict[str, float]]
    worst: dict[str, list[dict[str, Any]]]
    failures: list[dict[str, Any]]
    sample: dict[str, Array] = field(repr=False)
    footprints: tuple[Footprint, ...] = ()

    @property
    def failed(self) -> dict[int, str]:
        """Return the reason of each of the first failed flights."""
        return {row["flight"]: row["failure"] for row in self.failures}


#: Results that have a histogram: label, unit and decimals, by column of the table.
RESULT_NAMES = {
    "m_f_kg": ("final mass", "kg", 1),
    "t_plf_s": ("fairing jettison", "s", 2),
    "t_meco_s": ("cut-off", "s", 2),
    "propellant_used_kg": ("propellant used by the last stage", "kg", 0),
    "heating_at_jettison_w_m2": ("heating at the jettison", "W/m2", 1),
    "heating_peak_after_jettison_w_m2": ("highest heating from the jettison on", "W/m2", 1),
    "max_q_pa": ("highest dynamic pressure", "Pa", 0),
    "max_q_alpha_pa_rad": ("highest dynamic pressure times angle of attack", "Pa rad", 0),
    "radius_error_m": ("radius error", "m", 2),
    "speed_error_m_s": ("speed error", "m/s", 4),
    "flight_path_angle_error_deg": ("flight-path angle error", "deg", 6),
    "inclination_error_deg": ("inclination error", "deg", 6),
    "perigee_radius_error_m": ("perigee radius error", "m", 1),
    "apogee_radius_error_m": ("apogee radius error", "m", 1),
    "semi_major_axis_error_m": ("semi-major axis error", "m", 1),
    "eccentricity_error": ("eccentricity error", "1", 9),
    "c3_error_m2_s2": ("C3 error", "m2/s2", 1),
    "true_anomaly_error_deg": ("true anomaly error", "deg", 6),
}
#: Results whose sensitivities are reported.
TOLD = ("m_f_kg", "t_plf_s", "t_meco_s", "max_q_alpha_pa_rad")
#: Loads of the air, with the column of the fraction of the limit.
LOADS = {"max_q_pa": "max_q_of_limit", "max_q_alpha_pa_rad": "max_q_alpha_of_limit"}
#: Fraction of a limit up to which it counts as kept, as a plan keeps it.
ALLOWED = 1.001
#: Lists of worst flights: title, column, and whether low is bad.
LISTS = (
    ("least final mass", "m_f_kg", True),
    ("latest jettison", "t_plf_s", False),
    ("highest heating after the jettison", "heating_peak_after_jettison_w_m2", False),
    ("highest dynamic pressure", "max_q_pa", False),
    ("highest dynamic pressure times angle of attack", "max_q_alpha_pa_rad", False),
    ("farthest from the target's radius", "radius_error_m", False),
    ("farthest from the target's speed", "speed_error_m_s", False),
)
FAILURES = "failures"


def summarize(path: Path, nominal_kg: float, footprints: Footprints | None = None) -> Summary:
    """Compute the statistics of a campaign.

    Args:
        path: its file of flights.
        nominal_kg: propellant used by the last stage in the undispersed flight.
        footprints: without flights yet; None: where pieces come down is left out.
    """
    with pq.ParquetFile(path) as file:
        gathered = _Gathered(file.metadata.num_rows)
        for group in range(file.num_row_groups):
            table = file.read_row_group(group)
            gathered.add(table)
            if footprints is not None:
                footprints.add(table)
        histograms = _histograms(file, gathered)
    rank = bound_rank(gathered.tally.n)
    used = gathered.tail.largest(rank) if rank else np.nan
    return Summary(
        tally=gathered.tally,
        reserve=Reserve(flights_needed(), used if np.isfinite(used) else np.nan, nominal_kg),
        loads={
            name: load
            for name, tally in gathered.loads.items()
            if (load := tally.load()) is not None
        },
        histograms=histograms,
        influences={name: _influences(gathered.sample, name) for name in TOLD},
        worst={FAILURES: gathered.failures[: 2 * WORST], **gathered.worst},
        failures=gathered.failures,
        sample=gathered.sample,
        footprints=footprints.found() if footprints is not None else (),
    )


class _Gathered:
    """Accumulate the first of two passes over the flights."""

    def __init__(self, count: int) -> None:
        self.tally = Tally()
        size = int((1.0 - RESERVE_SHARE) * count) + 1
        self.tail = _Tail(size)
        self.loads = {name: _LoadTally(size) for name in LOADS}
        self.spans: dict[str, Interval] = {}
        self.good_spans: dict[str, Interval] = {}
        self.failures: list[dict[str, Any]] = []
        self.worst: dict[str, list[dict[str, Any]]] = {name: [] for name, _, _ in LISTS}
        self.sample: dict[str, Array] = {}

    def add(self, table: Any) -> None:
        self.tally.add(table)
        used = table["propellant_used_kg"].to_numpy()
        arrived = table["terminal_accuracy"].to_numpy()
        self.tail.add(np.where(arrived, used, np.inf))
        # who falls to the ground meets the greatest loads there
        ascents = table["outcome"].to_numpy() != Verdict.IMPACT
        for name, share in LOADS.items():
            self.loads[name].add(table[name].to_numpy()[ascents], table[share].to_numpy())
        good = table["succeeded"].to_numpy()
        for name in RESULT_NAMES:
            values = table[name].to_numpy()
            _widen(self.spans, name, values)
            _widen(self.good_spans, name, values[good])
        self.failures += _rows(table, np.flatnonzero(~good)[: FAILED - len(self.failures)])
        for title, name, low_is_bad in LISTS:
            values = table[name].to_numpy()
            badness = -values if low_is_bad else np.abs(values)
            rows = np.argsort(-np.where(np.isfinite(badness), badness, -np.inf), kind="stable")
            both = self.worst[title] + [
                row for row in _rows(table, rows[:WORST]) if row[name] is not None
            ]
            order = np.argsort([row[name] if low_is_bad else -abs(row[name]) for row in both])
            self.worst[title] = [both[k] for k in order[:WORST]]
        if not self.sample:
            self.sample = {
                name: table[name].to_numpy()
                for name in table.schema.names
                if name not in ("end", "outcome", "failure")
            }


def _rows(table: Any, rows: Any) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = table.take(rows).to_pylist()
    return found


def _widen(spans: dict[str, Interval], name: str, values: Array) -> None:
    """Extend a span to the finite ones of some values."""
    values = values[np.isfinite(values)]
    if values.size:
        low, high = spans.get(name, (np.inf, -np.inf))
        spans[name] = (min(low, float(values.min())), max(high, float(values.max())))


def _edges(every: Interval, good: Interval, sample: Array, bins: int) -> Array:
    """Compute the bin edges of a quantity from its spans and a sample of all flights."""
    width = good[1] - good[0]
    low = every[0] if every[0] >= good[0] - NEAR * width else good[0]
    high = every[1] if every[1] <= good[1] + NEAR * width else good[1]
    known = sample[np.isfinite(sample)]
    if known.size and np.mean((known >= low) & (known <= high)) < SHOWN:
        low = min(low, float(np.quantile(known, 0.5 * (1.0 - SHOWN), method="lower")))
        high = max(high, float(np.quantile(known, 0.5 * (1.0 + SHOWN), method="higher")))
    return np.linspace(low, high if high > low else low + 1.0, bins + 1)


def _histograms(file: Any, gathered: _Gathered) -> dict[str, Histogram]:
    spans = gathered.spans
    bins = min(BINS, math.ceil(math.sqrt(gathered.tally.n)))
    found = {}
    for name, every in spans.items():
        good = gathered.good_spans.get(name, every)
        edges = _edges(every, good, gathered.sample[name], bins)
        found[name] = Histogram(edges, np.zeros(bins, np.int64), np.zeros(bins, np.int64), 0, 0)
    for group in range(file.num_row_groups):
        table = file.read_row_group(group, columns=[*spans, "succeeded"])
        succeeded = table["succeeded"].to_numpy()
        for name, before in found.items():
            found[name] = _counted(before, table[name].to_numpy(), succeeded)
    return found


def _counted(before: Histogram, values: Array, good: NDArray[np.bool_]) -> Histogram:
    """Add flights to a histogram."""
    edges = before.edges
    known = np.isfinite(values)
    values, good = values[known], good[known]
    return Histogram(
        edges,
        before.counts + np.histogram(values[good], edges)[0],
        before.failed + np.histogram(values[~good], edges)[0],
        before.below + int(np.count_nonzero(values < edges[0])),
        before.above + int(np.count_nonzero(values > edges[-1])),
    )


def _influences(sample: dict[str, Array], name: str) -> dict[str, float]:
    """Compute the influence of every draw on a result, strongest first; empty if it is constant."""
    from scipy.stats import spearmanr

    result = sample[name]
    known = np.isfinite(result)
    found = {}
    for column, drawn in sample.items():
        # what is dropped has no influence on the flight
        apart = column.startswith(f"{DRAWN}ballistic_coefficient")
        if apart or not column.startswith(DRAWN) or known.sum() < 3:
            continue
        if np.ptp(drawn[known]) == 0.0 or np.ptp(result[known]) == 0.0:
            continue
        correlation = float(spearmanr(drawn[known], result[known]).statistic)
        found[column.removeprefix(DRAWN)] = correlation
    return dict(sorted(found.items(), key=lambda influence: -abs(influence[1])))
