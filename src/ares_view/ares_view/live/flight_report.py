# SPDX-License-Identifier: Apache-2.0
"""The report of the flight that was shown: its bag is found, its page is made when it is asked for.

The page is that of `ares report`, in a process of its own. No ROS.
"""

import asyncio
import shlex
import sys
import tempfile
from pathlib import Path

from ares_bags.errors import BagError
from ares_bags.files import find_files
from ares_bags.reader import open_bag
from ares_node.identity import id_text

#: Bags of a folder that are looked into, the newest ones.
MOST_BAGS = 100
#: Wall time in s for the page to be made.
PATIENCE = 120.0
_COMMAND = (sys.executable, "-P", "-m", "ares_bringup", "report")


class NoReport(Exception):
    """There is no report of the flight; the text is one line."""


def find_bag(where: Path, flight_id: int) -> Path:
    """Find the bag of a flight.

    Args:
        where: the bag, or a folder of bags; of these it is the one that names the flight.
        flight_id: identity of the flight.

    Raises:
        NoReport: it is not there; one line.
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
    """Return what makes the report in a terminal."""
    return shlex.join(["./ares", "report", str(bag)])


class ReportMaker:
    """Makes the page of one bag, once, however many ask for it."""

    def __init__(self, bag: Path) -> None:
        """Make nothing yet.

        Args:
            bag: of the flight.
        """
        self._bag = bag
        self._lock = asyncio.Lock()
        self._page: bytes | None = None
        self._process: asyncio.subprocess.Process | None = None

    @property
    def busy(self) -> bool:
        """Whether it is being made."""
        return self._lock.locked()

    async def page(self) -> bytes:
        """Make the page, unless it is there.

        Raises:
            NoReport: it cannot be made; one line.
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
        """End the making, if it goes on."""
        if self._process is not None and self._process.returncode is None:
            self._process.kill()
