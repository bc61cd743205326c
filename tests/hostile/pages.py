# SPDX-License-Identifier: Apache-2.0
"""Input to the server of the live page over its socket: HTTP, WebSocket frames, neither."""

import json
import logging
import socket
import struct
import time
import zlib
from collections.abc import Callable
from random import Random

from ares_view.live.address import LOOPBACK, listen
from ares_view.live.server import LiveServer, read_command
from ares_view.live.story import Story
from hostile.mutate import changed, number, text
from hostile.target import Target, check, one_line

_KEY = "dGhlIHNhbXBsZSBub25jZQ=="
#: Wall time in s that the server may take for anything.
_PATIENCE = 5.0


def _request(random: Random, host: str) -> bytes:
    path = random.choice(
        ("/", "/", "/plotly.js", "/socket", "/x", "//", "/?token=a", "/%00", "/" * 9)
    )
    if random.random() < 0.1:
        path = "/" + text(random)
    method = random.choice(("GET", "GET", "GET", "POST", "HEAD", "OPTIONS", "PUT", "X" * 50, ""))
    name = random.choice((host, host, host, "evil.example", "", f"localhost:{host[-5:]}", "\u00e4"))
    lines = [f"{method} {path} HTTP/1.1", f"Host: {name}"]
    if random.random() < 0.3:
        value = random.choice(("0", "5", "-1", "99999999999", "x", "1e9"))
        lines.append(f"Content-Length: {value}")
    if random.random() < 0.1:
        lines.append("Transfer-Encoding: chunked")
    if random.random() < 0.2:
        lines.append(f"X-Odd: {text(random)}")
    if random.random() < 0.05:
        lines += [f"X-{k}: {'y' * 1000}" for k in range(random.choice((5, 80)))]
    return ("\r\n".join(lines) + "\r\n\r\n").encode("utf-8", "replace")


def _shake(host: str, origin: str) -> bytes:
    lines = (
        "GET /socket HTTP/1.1",
        f"Host: {host}",
        "Upgrade: websocket",
        "Connection: Upgrade",
        f"Sec-WebSocket-Key: {_KEY}",
        "Sec-WebSocket-Version: 13",
        f"Origin: {origin}",
    )
    return ("\r\n".join(lines) + "\r\n\r\n").encode("utf-8", "replace")


def _frame(payload: bytes, random: Random) -> bytes:
    """Make a client's frame, usually a valid one."""
    first = random.choice((0x81, 0x81, 0x81, 0x82, 0x01, 0x80, 0x88, 0x89, 0x8A, 0xF1, 0x8F, 0xC1))
    length = len(payload)
    told = random.choice((length, length, length, length, 2**63, 2**64 - 1, 70_000, 0))
    head = struct.pack("!B", first)
    if told < 126:
        head += struct.pack("!B", 0x80 | told)
    elif told < 65536:
        head += struct.pack("!BH", 0x80 | 126, told)
    else:
        head += struct.pack("!BQ", 0x80 | 127, told)
    if random.random() < 0.1:
        # a client must mask what it says
        return head.replace(b"\x80", b"\x00") + payload
    return head + bytes(4) + payload


def command(random: Random) -> str:
    """Make a command of a page, valid or nearly so."""
    kind = random.random()
    if kind < 0.2:
        return random.choice(('{"command": "pause"}', '{"command": "play"}'))
    if kind < 0.4:
        return f'{{"command": "pace", "value": {number(random)!r}}}'.replace("inf", "1e999")
    if kind < 0.5:
        return random.choice(("[" * 900, '{"a":' * 150, "1" * 900, "NaN", "null", '"', "{}", "[]"))
    value = random.choice((None, True, text(random), [1.0], {"a": 1}, 10**300, number(random)))
    name = random.choice(("pace", "pause", text(random), None, 3, ["pace"], {"pace": 1}))
    return json.dumps({"command": name, "value": value})


class Commands(Target):
    """Try texts of a page: each is a command in its range, or refused in one line."""

    name = "commands of a page"
    share = 11.0

    def make(self, random: Random) -> bytes:
        said = command(random).encode("utf-8", "surrogatepass")
        return changed(said, random) if random.random() < 0.3 else said

    def run(self, data: bytes) -> str:
        try:
            name, value = read_command(data.decode("utf-8", "replace"))
        except ValueError as error:
            one_line(str(error))
            return "refused"
        check(name in ("pause", "play", "pace"), f"command {name}")
        check(value == 0.0 or 1e-3 <= value <= 1e6, f"pace {value}")
        return "obeyed"


class _Complaints(logging.Handler):
    """Collect what the server's library logs, which users would see as tracebacks."""

    def __init__(self) -> None:
        super().__init__(logging.ERROR)
        self.said: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.said.append(record.getMessage())


class Sockets(Target):
    """Connect to the server: it answers or hangs up, and still serves the page."""

    name = "socket of the page"
    share = 1.0
    stateful = True

    def __init__(self) -> None:
        self._server: LiveServer | None = None

    def begin(self) -> None:
        self.end()
        self._complaints = _Complaints()
        for name in ("tornado", "asyncio"):
            logging.getLogger(name).addHandler(self._complaints)
        self._obeyed: list[tuple[str, float]] = []
        story = Story()
        story.begin(1, None)

        def obey(name: str, value: float, _refuse: Callable[[str], None]) -> None:
            self._obeyed.append((name, value))

        self._server = LiveServer(listen(LOOPBACK, 0), story, obey)
        self._count = 0

    def end(self) -> None:
        if self._server is not None:
            self._server.close(0.1)
            self._server = None
            for name in ("tornado", "asyncio"):
                logging.getLogger(name).removeHandler(self._complaints)

    @property
    def host(self) -> str:
        """Name and port, as a browser writes them."""
        assert self._server is not None
        return f"{LOOPBACK}:{self._server.access.port}"

    def make(self, random: Random) -> bytes:
        # the port of the run stands in its requests as a word
        host = "HOST"
        kind = random.random()
        if kind < 0.4:
            data = _request(random, host)
        else:
            origin = random.choice(
                (f"http://{host}",) * 6 + ("http://evil.example", "null", "", "[")
            )
            data = _shake(host, origin)
            for _ in range(random.choice((0, 1, 1, 2, 5))):
                said = command(random).encode("utf-8", "surrogatepass")
                if random.random() < 0.05:
                    said = random.choice((random.randbytes(200), said * 3000, bytes(200_000)))
                data += _frame(said, random)
        return changed(data, random) if random.random() < 0.3 else data

    def run(self, data: bytes) -> str:
        assert self._server is not None
        data = data.replace(b"HOST", self.host.encode())
        refused_origin = b"Origin: http://evil.example\r\n" in data
        self._count += 1
        before = len(self._obeyed)
        # by the input itself, so that it can be done again
        manner = zlib.crc32(data) % 8
        begun = time.monotonic()
        with socket.create_connection((LOOPBACK, self._server.access.port), _PATIENCE) as line:
            line.settimeout(_PATIENCE)
            try:
                half = len(data) // 2
                line.sendall(data[:half])
                if manner == 0:
                    # gone in the middle, with a reset
                    line.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
                    return "left"
                if manner == 1:
                    # what the server says is not waited for, and the rest comes later
                    time.sleep(0.002)
                line.sendall(data[half:])
                line.shutdown(socket.SHUT_WR)
                answer = b""
                while part := line.recv(65536):
                    answer += part
                    check(len(answer) < 50_000_000, "an endless answer")
            except OSError:
                # it has hung up, or says nothing
                check(time.monotonic() - begun < _PATIENCE, "the server takes no end")
                answer = b""
        check(not self._complaints.said, f"the server complains: {self._complaints.said[:1]}")
        if refused_origin and data.count(b"\r\n\r\n") == 1:
            check(b" 101 " not in answer[:20], "a page of another site was let in")
        check(all(name in ("pause", "play", "pace") for name, _ in self._obeyed[before:]), "obeyed")
        if self._count % 100 == 0:
            self._still_serves()
        return answer[9:12].decode("ascii", "replace") if answer.startswith(b"HTTP") else "hung up"

    def _still_serves(self) -> None:
        assert self._server is not None
        self._obeyed.clear()
        with socket.create_connection((LOOPBACK, self._server.access.port), _PATIENCE) as line:
            line.settimeout(_PATIENCE)
            line.sendall(f"GET / HTTP/1.0\r\nHost: {self.host}\r\n\r\n".encode())
            check(line.recv(20).startswith(b"HTTP/1.1 200"), "the page is not served any more")
        check(len(self._server.sockets) <= 16, f"{len(self._server.sockets)} pages are open")
