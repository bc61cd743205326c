# SPDX-License-Identifier: Apache-2.0
"""Find the bag of the flight on the page; make its report on demand, as `ares report`. No ROS."""

import asyncio
import shlex
import sys
import tempfile
from pathlib import Path

from ares_bags.errors import BagError
from ares_bags.files import find_files
from ares_bags.reader import open_bag
from ares_node.identity import id_text

#: Largest number of bags that are searched, newest first.
MOST_BAGS = 100
#: Wall time limit for making the report, s.
PATIENCE = 120.0
_COMMAND = (sys.executable, "-P", "-m", "ares_bringup", "report")


class NoReport(Exception):
    """Report that a flight has no report; the text is one line."""


def find_bag(where: Path, flight_id: int) -> Path:
    """Find the bag of a flight.

    Args:
        where: the bag, or a folder of bags, searched for the flight's identity.
        flight_id: identity of the flight.

    Raises:
        NoReport: no such bag; one line.
    """
    try:
        find_files(where)
    except BagError:
        pass
    else:
        return where
    try:
        bags = [path for path in where.iterdir() if path.is_dir()]
        bags.sort(key=lambda path: path.stat().st_mtime, reverse=True)
    except OSError:
        bags = []
    for path in bags[:MOST_BAGS]:
        try:
            if open_bag(path).custom_data.get("flight_id") == id_text(flight_id):
                return path
        except BagError:
            continue
    raise NoReport(f"There is no report: {where} has no bag of this flight.")


def command(bag: Path) -> str:
    """Return the command that makes the report."""
    return shlex.join(["./ares", "report", str(bag)])


class ReportMaker:
    """Makes the report of one bag, once for all requests."""

    def __init__(self, bag: Path) -> None:
        """Prepare.

        Args:
            bag: of the flight.
        """
        self._bag = bag
        self._lock = asyncio.Lock()
        self._page: bytes | None = None
        self._process: asyncio.subprocess.Process | None = None

    @property
    def busy(self) -> bool:
        """Return True while the report is being made."""
        return self._lock.locked()

    async def page(self) -> bytes:
        """Return the page; make it on the first request.

        Raises:
            NoReport: the command failed; one line.
        """
        async with self._lock:
            if self._page is None:
                self._page = await self._made()
            return self._page

    async def _made(self) -> bytes:
        with tempfile.TemporaryDirectory() as folder:
            out = Path(folder) / "report.html"
            self._process = await asyncio.create_subprocess_exec(
                *(*_COMMAND, str(self._bag), "--out", str(out)),
                stdin=asyncio.subprocess.DEVNULL,
                stdout=asyncio.subprocess.DEVNULL,
                stderr=asyncio.subprocess.PIPE,
            )
            try:
                _, said = await asyncio.wait_for(self._process.communicate(), PATIENCE)
            finally:
                self.end()
            if self._process.returncode:
                lines = said.decode(errors="replace").split("\n")
                raise NoReport(" ".join(filter(None, lines)) or "The report cannot be made.")
            return out.read_bytes()

    def end(self) -> None:
        """Kill the command if it still runs."""
        if self._process is not None and self._process.returncode is None:
            self._process.kill()
