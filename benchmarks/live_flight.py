# SPDX-License-Identifier: Apache-2.0
"""Compare lock-step flights with and without the live page, in turn; count a reader's updates.

    ./ares exec python benchmarks/live_flight.py [--rounds N] [--chromium]

The reader receives everything and draws nothing; `--chromium` instead opens the page in a headless
browser, which draws it on the same processors.
"""

import argparse
import asyncio
import shutil
import statistics
import tempfile
import threading
from contextlib import suppress
from pathlib import Path

from figures import Figures, keep_option
from tornado.httpclient import HTTPClientError
from tornado.websocket import websocket_connect

from ares_bringup.fly import fly
from ares_bringup.options import FlyOptions, LiveOptions
from ares_view.live.address import LOOPBACK, free_port

#: A paced flight for the rate of updates: real-time factor and mission, 40 s.
PACE = 15.0


class Reader:
    """Read from the server until its end, without drawing."""

    def __init__(self, port: int) -> None:
        """Connect as soon as the server answers."""
        self.times: list[float] = []
        self._address = f"ws://{LOOPBACK}:{port}/socket"
        self._thread = threading.Thread(target=lambda: asyncio.run(self._read()), daemon=True)
        self._thread.start()

    async def _read(self) -> None:
        loop = asyncio.get_running_loop()
        connection = None
        while connection is None:
            with suppress(OSError, HTTPClientError):
                connection = await websocket_connect(self._address)
            await asyncio.sleep(0.02)
        while (text := await connection.read_message()) is not None:
            if str(text).startswith('{"kind":"update"'):
                self.times.append(loop.time())

    def rate(self) -> float:
        """Return the updates per second, once the server has ended."""
        self._thread.join()
        return (len(self.times) - 1) / (self.times[-1] - self.times[0])


class Chromium:
    """Open the page in a headless browser."""

    def __init__(self, port: int) -> None:
        """Open the page as soon as it is served."""
        self._port = port
        self._over = threading.Event()
        self._rate = 0.0
        self._thread = threading.Thread(target=self._look, daemon=True)
        self._thread.start()

    def _look(self) -> None:
        from playwright.sync_api import Error, sync_playwright

        flags = ["--headless", "--no-sandbox", "--disable-gpu"]
        with sync_playwright() as play:
            found = shutil.which("chromium") or shutil.which("google-chrome")
            browser = play.chromium.launch(executable_path=found, args=flags)
            page = browser.new_page(viewport={"width": 1280, "height": 900})
            while not self._over.is_set():
                with suppress(Error):
                    page.goto(f"http://{LOOPBACK}:{self._port}/")
                    break
            page.wait_for_function("() => live.frames > 2")
            first = page.evaluate("[live.frames, performance.now()]")
            self._over.wait()
            last = page.evaluate("[live.frames, live.heard]")
            self._rate = 1e3 * (last[0] - first[0]) / (last[1] - first[1])
            browser.close()

    def rate(self) -> float:
        """Return the drawings per second."""
        self._over.set()
        self._thread.join()
        return self._rate


def flown(bag: Path, pace: float, viewer: type[Reader] | type[Chromium] | None) -> list[float]:
    """Return the real-time factor of the default flight and, with a viewer, updates per second."""
    port = free_port(LOOPBACK, 0)
    live = LiveOptions(port=port, wait=True) if viewer else None
    reader = viewer(port) if viewer else None
    summary = fly(FlyOptions("ares_v", bag=bag, settings={"pace": pace}, live=live))
    assert summary.exit_code == 0 and summary.realtime_factor is not None
    return [summary.realtime_factor, *([reader.rate()] if reader else [])]


def main() -> None:
    """Print the rates of each round, the ratio of their medians, and updates per second."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--chromium", action="store_true", help="draw the page in a browser")
    keep_option(parser)
    options = parser.parse_args()
    viewer = Chromium if options.chromium else Reader
    plain, looked_at = [], []
    with tempfile.TemporaryDirectory() as name:
        for k in range(options.rounds):
            plain += flown(Path(name) / f"plain_{k}", 0.0, None)
            looked_at += flown(Path(name) / f"live_{k}", 0.0, viewer)[:1]
            print(f"without {plain[-1]:.0f}, with {looked_at[-1]:.0f} times real time", flush=True)
        _, updates = flown(Path(name) / "paced", PACE, viewer)
    what = "drawings" if options.chromium else "updates"
    figures = Figures(__file__, "Lock-step with and without the live page, medians in turn.")
    figures.add("without", statistics.median(plain), "times real time")
    figures.add("with", statistics.median(looked_at), "times real time")
    figures.add("with / without", statistics.median(looked_at) / statistics.median(plain), "")
    figures.add(f"{what} a second at {PACE:g} times real time", updates, "")
    if options.keep:
        figures.keep()


if __name__ == "__main__":
    main()
