# SPDX-License-Identifier: Apache-2.0
"""Store a campaign in a folder: its settings, the flights as they are flown, and the final file.

campaign.json     settings; a run with other settings is refused
parts/            one Parquet file per chunk of flights, each written atomically
flights.parquet   all flights in order, written after the last part
"""

import fcntl
import json
import math
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict
from itertools import chain
from pathlib import Path
from typing import IO, Any

import pyarrow as pa
import pyarrow.parquet as pq

from ares_models.writable import check_folder
from ares_studies.montecarlo.flights import Settings

#: 2: columns of what comes down.
FORMAT = 2
SETTINGS = "campaign.json"
PARTS = "parts"
FLIGHTS = "flights.parquet"

#: Columns with few different values.
TEXTS = ["end", "outcome", "failure"]
#: Rows per group in the final file.
GROUP = 20_000
_PARTIAL = ".partial"


class StoreError(ValueError):
    """Report in one line that a folder cannot hold this campaign."""


def check_campaign(folder: Path) -> None:
    """Check, before the work, that a folder can hold a campaign; leave nothing.

    Raises:
        StoreError: it holds something else, or cannot be written; one line.
    """
    try:
        if folder.is_file():
            raise StoreError(f"{folder}: is a file; expected a folder")
        if folder.is_dir() and not (folder / SETTINGS).exists() and any(folder.iterdir()):
            raise StoreError(f"{folder}: is no campaign; expected a new or empty folder")
        check_folder(folder)
    except OSError as error:
        raise StoreError(f"{folder}: {error.strerror}") from error


def describe(settings: Settings) -> dict[str, Any]:
    """Return everything on which a flight depends, except its number, as plain data."""
    options = asdict(settings.options)
    data = {
        "format": FORMAT,
        "mission": settings.mission.model_dump(mode="json"),
        "guidance": settings.law,
        "dispersions": settings.dispersions.model_dump(mode="json"),
        "seed": settings.seed,
        "law_settings": asdict(settings.law_settings),
        "simulator": {key: None if math.isinf(x) else x for key, x in options.items()},
    }
    plain: dict[str, Any] = json.loads(json.dumps(data, allow_nan=False))
    return plain


def _first_difference(old: Any, new: Any, path: str = "") -> str:
    """Describe the first key in which plain data differ, with both values; "" if none."""
    if isinstance(old, dict) and isinstance(new, dict):
        for key in sorted(old.keys() | new.keys(), key=lambda key: (key != "format", key)):
            found = _first_difference(old.get(key), new.get(key), f"{path}.{key}" if path else key)
            if found:
                return found
        return ""
    return "" if old == new else f"{path} was {json.dumps(old)}, now {json.dumps(new)}"


class Store:
    """Hold a campaign's folder, locked by one process at a time.

    Attributes:
        folder: the folder.
    """

    def __init__(self, folder: Path, settings: Settings) -> None:
        """Start a campaign in a new folder, or continue the one that is there.

        Raises:
            StoreError: it holds another campaign, another process uses it, or it cannot be
                written; one line.
        """
        self.folder = folder
        self._parts = folder / PARTS
        try:
            self._begin(describe(settings))
        except (OSError, json.JSONDecodeError) as error:
            reason = getattr(error, "strerror", None) or f"{SETTINGS} is damaged"
            raise StoreError(f"{folder}: {reason}") from error

    def _begin(self, wanted: dict[str, Any]) -> None:
        file = self.folder / SETTINGS
        check_campaign(self.folder)
        self._made = not self.folder.exists()
        self._parts.mkdir(parents=True, exist_ok=True)
        self._lock: IO[str] = file.open("a+", encoding="utf-8")
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            self._lock.close()
            raise StoreError(f"{self.folder}: another process flies this campaign") from None
        self._lock.seek(0)
        text = self._lock.read()
        if not text:
            try:
                self._lock.write(json.dumps(wanted, indent=1) + "\n")
                self._lock.flush()
            except OSError:
                self._discard()
                raise
            return
        difference = _first_difference(json.loads(text), wanted)
        if difference:
            self.close()
            raise StoreError(f"{self.folder}: holds another campaign: {difference}")

    def _discard(self) -> None:
        """Remove a campaign without flights."""
        with suppress(OSError):
            # close retries the write that did not fit
            self._lock.close()
        with suppress(OSError):
            (self.folder / SETTINGS).unlink()
            self._parts.rmdir()
            if self._made:
                self.folder.rmdir()

    def close(self) -> None:
        """Release the folder."""
        self._lock.close()

    def __enter__(self) -> "Store":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def flights(self) -> Path:
        """Return the path of the final file of all flights."""
        return self.folder / FLIGHTS

    # ---- parts

    def _part(self, first: int, count: int) -> Path:
        return self._parts / f"{first:012}-{count}.parquet"

    def spans(self) -> list[tuple[int, int]]:
        """Return first flight and count of every part, in order; remove incomplete files."""
        spans = []
        for path in sorted(self._parts.iterdir()):
            if path.suffix == ".parquet":
                first, _, count = path.stem.partition("-")
                spans.append((int(first), int(count)))
            else:
                path.unlink()
        return spans

    def count(self) -> int:
        """Return the number of flights stored."""
        if self.flights.exists():
            return int(pq.read_metadata(self.flights).num_rows)
        return sum(count for _, count in self.spans())

    def reopen(self) -> None:
        """Make a completed campaign's file its first part, so that more flights can follow."""
        if self.flights.exists():
            for span in self.spans():
                self._part(*span).unlink()
            os.replace(self.flights, self._part(0, self.count()))

    @contextmanager
    def _whole(self, path: Path) -> Iterator[Path]:
        """Yield a temporary path to write to, and rename it to the file if that succeeds.

        Raises:
            StoreError: it cannot be written; one line. A campaign without flights is then removed.
        """
        partial = path.with_suffix(_PARTIAL)
        try:
            yield partial
            os.replace(partial, path)
        except OSError as error:
            with suppress(OSError):
                partial.unlink()
            why = os.strerror(error.errno) if error.errno else str(error)
            there = self.count()
            if not there:
                self._discard()
                raise StoreError(f"{self.folder}: {why}; no flight could be kept") from error
            raise StoreError(
                f"{self.folder}: {why}; {there:,} flights are in it, the same command with "
                f"--out {self.folder} goes on"
            ) from error

    def write(self, table: Any) -> None:
        """Store a chunk of flights, a pyarrow.Table.

        Raises:
            StoreError: it cannot be written; one line.
        """
        with self._whole(self._part(table["flight"][0].as_py(), table.num_rows)) as partial:
            pq.write_table(table, partial, compression="none", use_dictionary=TEXTS)

    def finish(self, count: int) -> None:
        """Combine the parts into one file of the first ``count`` flights.

        Raises:
            StoreError: it cannot be written; one line.
        """
        tables = self._joined(count)
        first = next(tables)
        with (
            self._whole(self.flights) as partial,
            pq.ParquetWriter(
                partial, first.schema, compression="zstd", use_dictionary=TEXTS
            ) as writer,
        ):
            for table in chain([first], tables):
                writer.write_table(table, row_group_size=GROUP)
        for span in self.spans():
            self._part(*span).unlink()

    def read(self, span: tuple[int, int]) -> Any:
        """Read a part, a pyarrow.Table."""
        return pq.read_table(self._part(*span))

    def _joined(self, count: int) -> Iterator[Any]:
        """Yield the first rows of all parts in order, in tables of about GROUP rows."""
        waiting: list[Any] = []
        for span in self.spans():
            if span[0] >= count:
                break
            waiting.append(self.read(span).slice(0, count - span[0]))
            if sum(table.num_rows for table in waiting) >= GROUP:
                yield pa.concat_tables(waiting)
                waiting = []
        if waiting:
            yield pa.concat_tables(waiting)
