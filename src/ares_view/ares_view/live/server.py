# SPDX-License-Identifier: Apache-2.0
"""Serve the page and its WebSocket from a thread of its own. No ROS.

A slow page gets nothing new until it has received the message before.
"""

import asyncio
import json
import socket
import threading
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from importlib.resources import files
from typing import Any
from urllib.parse import urlsplit

import plotly as plotly_package
from tornado.httpserver import HTTPServer
from tornado.ioloop import PeriodicCallback
from tornado.web import Application, HTTPError, RequestHandler
from tornado.websocket import WebSocketClosedError, WebSocketHandler

from ares_view.live.address import Access
from ares_view.live.flight_report import NoReport, ReportMaker
from ares_view.live.page import render
from ares_view.live.story import Seen, Story

#: Wall time in s between messages to a page without news.
BEAT_PERIOD = 0.25
#: Wall time in s after which a page that receives nothing is disconnected.
SLOW_READER = 20.0
#: Most open pages; longest message of a page, bytes.
MAX_PAGES = 16
MAX_COMMAND = 1000
#: Refusals queued per page; beyond, the oldest are dropped.
MAX_REFUSALS = 4
#: Slowest and fastest real-time factor; 0 is as fast as possible.
PACES = (1e-3, 1e6)

#: Load nothing from elsewhere, forbid framing, send no referrer.
HEADERS = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self' 'unsafe-inline'; "
    "style-src 'unsafe-inline'; img-src data: blob:; connect-src 'self'; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'none'",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}

#: Executes a command: name, value, callback for the reason of a refusal.
Obey = Callable[[str, float, Callable[[str], None]], None]


def read_command(text: str | bytes) -> tuple[str, float]:
    """Parse a command of a page: `pause`, `play`, or `pace` with its value.

    Raises:
        ValueError: it is invalid; one line.
    """
    try:
        said = json.loads(text)
    except (ValueError, RecursionError):
        said = None
    if not isinstance(said, dict):
        raise ValueError("a command is a JSON object")
    name, value = said.get("command"), said.get("value", 0)
    if name in ("pause", "play"):
        return str(name), 0.0
    if name != "pace":
        raise ValueError(f"command is {name!r}; expected pause, play or pace"[:200])
    known = type(value) in (int, float)
    if not known or not (value == 0 or PACES[0] <= value <= PACES[1]):
        raise ValueError(f"pace is {value!r}; expected 0, or {PACES[0]:g} to {PACES[1]:g}"[:200])
    return "pace", float(value)


class _Guarded(RequestHandler):
    """Refuse requests with a wrong host name or token."""

    @property
    def live(self) -> "LiveServer":
        server: LiveServer = self.settings["live"]
        return server

    def prepare(self) -> None:
        access = self.live.access
        if not access.accepts_host(self.request.host):
            raise HTTPError(403, reason="Not the name of this server")
        if not access.accepts_token(self.get_query_argument("token", "")):
            raise HTTPError(403, reason="No, or a wrong token")

    def set_default_headers(self) -> None:
        for name, value in HEADERS.items():
            self.set_header(name, value)


class _Page(_Guarded):
    def get(self) -> None:
        self.finish(render(self.live.access.query))


class _Plotly(_Guarded):
    def get(self) -> None:
        self.set_header("Content-Type", "text/javascript; charset=utf-8")
        self.set_header("Cache-Control", "private, max-age=3600")
        script = files(plotly_package).joinpath("package_data", "plotly.min.js")
        self.finish(script.read_bytes())


class _Report(_Guarded):
    async def get(self) -> None:
        maker = self.live.report
        try:
            if maker is None:
                raise NoReport("There is no report yet: no recorded flight has ended.")
            self.finish(await maker.page())
        except NoReport as error:
            self.set_status(404)
            self.set_header("Content-Type", "text/plain; charset=utf-8")
            self.finish(f"{error}\n")


class _Socket(_Guarded, WebSocketHandler):
    """Send the story to one open page and receive its commands."""

    def initialize(self) -> None:
        self._seen = Seen()
        self._sending: asyncio.Future[None] | None = None
        self._sent_at = 0.0
        self._refusals: deque[str] = deque(maxlen=MAX_REFUSALS)

    def prepare(self) -> None:
        super().prepare()
        if len(self.live.sockets) >= MAX_PAGES:
            raise HTTPError(503, reason="Too many pages")

    def check_origin(self, origin: str) -> bool:
        return urlsplit(origin).netloc == self.request.host

    def open(self, *_args: str, **_words: str) -> None:
        self.set_nodelay(True)
        self.live.sockets.add(self)
        self.send_news()

    def on_close(self) -> None:
        self.live.sockets.discard(self)

    def on_message(self, message: str | bytes) -> None:
        try:
            name, value = read_command(message)
        except ValueError as error:
            self.refuse(str(error))
            return
        loop = asyncio.get_running_loop()

        def refuse(reason: str) -> None:
            loop.call_soon_threadsafe(self.refuse, reason)

        self.live.obey(name, value, refuse)

    def refuse(self, reason: str) -> None:
        """Queue the reason of a refused command."""
        self._refusals.append(reason)
        self.send_news()

    def busy(self) -> bool:
        """Tell whether the page has yet to receive the message before; disconnect a slow reader."""
        if self._sending is None or self._sending.done():
            return False
        if time.monotonic() - self._sent_at > SLOW_READER:
            self.cut()
        return True

    def cut(self) -> None:
        """End the connection at once."""
        if self.ws_connection is not None and self.ws_connection.stream is not None:
            self.ws_connection.stream.close()

    def send(self, message: dict[str, Any]) -> None:
        """Send, unless the page is busy."""
        if self.busy():
            return
        try:
            text = json.dumps(message, allow_nan=False, separators=(",", ":"))
            self._sending = asyncio.ensure_future(self.write_message(text))
            self._sending.add_done_callback(_forget)
        except WebSocketClosedError:
            self.on_close()
        self._sent_at = time.monotonic()

    def send_news(self, beat: bool = False) -> None:
        """Send what the page lacks; if nothing, a heartbeat when `beat` is due."""
        if self.busy():
            return
        if self._refusals:
            self.send({"kind": "refused", "reason": self._refusals.popleft()})
            return
        story = self.live.story
        message, self._seen = story.news(self._seen)
        if message is not None:
            self.send(message)
        elif beat and time.monotonic() - self._sent_at > 0.9 * BEAT_PERIOD:
            self.send({"kind": "beat", "age_s": story.age()})

    async def say_goodbye(self) -> None:
        """Send the last news and the end, then close."""
        await self._taken()
        self.send_news()
        await self._taken()
        self.send({"kind": "end"})
        await self._taken()
        self.close(1001)

    async def _taken(self) -> None:
        if self._sending is not None:
            await asyncio.wait([self._sending])


def _forget(sent: "asyncio.Future[None]") -> None:
    # a page that has closed meanwhile is no error
    if not sent.cancelled():
        sent.exception()


class LiveServer:
    """Run the server until `close`.

    Attributes:
        access: access rules.
        story: the flight shown.
        obey: gets commands, in the server's thread.
        sockets: the open pages.
        report: makes the report of the flight; None without a closed bag.
    """

    def __init__(self, listener: socket.socket, story: Story, obey: Obey) -> None:
        """Start serving.

        Args:
            listener: the listening socket.
            story: the flight shown.
            obey: gets commands.
        """
        self.access = Access.of(listener)
        self.story = story
        self.obey = obey
        self.sockets: set[_Socket] = set()
        self.report: ReportMaker | None = None
        self._listener = listener
        self._started: Future[None] = Future()
        self._thread = threading.Thread(target=self._run, name="live", daemon=True)
        self._thread.start()
        self._started.result()

    @property
    def pages(self) -> int:
        """Return the number of open pages."""
        return len(self.sockets)

    @property
    def unseen(self) -> bool:
        """Return True while no page is open and no report is being made."""
        return not self.sockets and not (self.report is not None and self.report.busy)

    def notify(self) -> None:
        """Send the news to all pages."""
        self._loop.call_soon_threadsafe(self._send_all)

    def close(self, patience: float) -> None:
        """Send all pages the end, and stop.

        Args:
            patience: wall time in s for them to receive it.
        """
        self._loop.call_soon_threadsafe(self._over.set_result, patience)
        self._thread.join()

    def _send_all(self, beat: bool = False) -> None:
        for page in tuple(self.sockets):
            page.send_news(beat)

    def _run(self) -> None:
        try:
            asyncio.run(self._serve())
        except BaseException as error:
            if self._started.done():
                raise
            # the constructor waits for the start and raises this
            self._started.set_exception(error)

    async def _serve(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._over: asyncio.Future[float] = self._loop.create_future()
        application = Application(
            [("/", _Page), ("/plotly.js", _Plotly), ("/report", _Report), ("/socket", _Socket)],
            live=self,
            websocket_max_message_size=MAX_COMMAND,
            log_function=lambda _handler: None,
        )
        server = HTTPServer(application)
        server.add_socket(self._listener)
        beat = PeriodicCallback(lambda: self._send_all(beat=True), 1e3 * BEAT_PERIOD)
        beat.start()
        self._started.set_result(None)
        patience = await self._over
        beat.stop()
        server.stop()
        if self.report is not None:
            self.report.end()
        goodbyes = [asyncio.ensure_future(page.say_goodbye()) for page in tuple(self.sockets)]
        if goodbyes:
            await asyncio.wait(goodbyes, timeout=patience)
        for page in tuple(self.sockets):
            page.cut()
        await server.close_all_connections()
