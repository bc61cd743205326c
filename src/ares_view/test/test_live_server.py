# SPDX-License-Identifier: Apache-2.0
"""The server of the live page: access, refused commands, slow readers."""

import asyncio
import json
import socket
import time
from itertools import count
from pathlib import Path

import pytest
from tornado.httpclient import AsyncHTTPClient, HTTPClientError, HTTPRequest
from tornado.websocket import websocket_connect

from ares_bags.writer import BagWriter
from ares_models.mission import load_mission
from ares_node.identity import id_text
from ares_view.live.address import Access, AddressError, free_port, listen
from ares_view.live.flight_report import NoReport, ReportMaker, find_bag
from ares_view.live.server import MAX_COMMAND, LiveServer, read_command
from ares_view.live.story import Story

LOOPBACK = "127.0.0.1"
REFERENCE = Path(__file__).parents[3] / "bags" / "reference"


@pytest.fixture
def commands():
    return []


@pytest.fixture
def server(commands):
    story = Story()
    story.begin(7, load_mission("ares_v"))
    made = LiveServer(listen(LOOPBACK, 0), story, lambda *said: commands.append(said))
    yield made
    made.close(1.0)


def answer(url, request_timeout=20.0, **headers):
    """Fetch a page; return the response."""

    async def get():
        request = HTTPRequest(url, headers=headers, request_timeout=request_timeout)
        return await AsyncHTTPClient(force_instance=True).fetch(request, raise_error=False)

    return asyncio.run(get())


def told(server, *said, until="flight", **headers):
    """Send messages as a page; return those received up to one of kind `until`."""

    async def talk():
        url = f"ws://{server.access.host}:{server.access.port}/socket{server.access.query}"
        page = await websocket_connect(HTTPRequest(url, headers=headers))
        for text in said:
            page.write_message(text)
        found = [json.loads(await page.read_message())]
        while found[-1]["kind"] != until:
            found.append(json.loads(await page.read_message()))
        page.close()
        return found

    return asyncio.run(asyncio.wait_for(talk(), 20))


def test_the_page_loads_nothing_from_elsewhere(server):
    page = answer(server.access.url)
    assert page.code == 200
    policy = page.headers["Content-Security-Policy"]
    assert "default-src 'none'" in policy
    assert "connect-src 'self'" in policy
    assert page.headers["Referrer-Policy"] == "no-referrer"
    text = page.body.decode()
    assert "Waiting for a flight" in text
    assert len(text) < 300_000
    assert b"plotly.js v" in answer(f"{server.access.url}plotly.js").body[:200]


def test_a_name_that_was_made_to_point_here_is_refused(server):
    port = server.access.port
    for name in (f"localhost:{port}", f"127.0.0.1:{port}", f"[::1]:{port}"):
        assert answer(server.access.url, Host=name).code == 200
    foreign = (f"evil.example:{port}", "127.0.0.1", f"127.0.0.1:{port + 1}", f"127.0.0.1.x:{port}")
    for name in foreign:
        assert answer(server.access.url, Host=name).code == 403


@pytest.mark.parametrize("origin", ["http://evil.example", "null", "http://127.0.0.1:1"])
def test_a_foreign_page_cannot_read_along(server, origin):
    with pytest.raises(HTTPClientError, match="403"):
        told(server, Origin=origin)


def test_our_own_page_can(server):
    own = f"http://{LOOPBACK}:{server.access.port}"
    assert told(server, Origin=own)[0]["kind"] == "flight"


def test_beyond_this_machine_a_token_is_needed():
    listener = listen("0.0.0.0", 0)
    server = LiveServer(listener, Story(), lambda *_: None)
    try:
        access = server.access
        assert len(access.token) >= 32
        assert access.token in access.url
        here = f"http://{LOOPBACK}:{access.port}"
        for path in ("/", "/plotly.js"):
            assert answer(f"{here}{path}?token={access.token}").code == 200
            for wrong in ("", "?token=", f"?token={access.token}x", "?token=%ff"):
                assert answer(f"{here}{path}{wrong}").code in (400, 403)
        page = answer(f"{here}/?token={access.token}").body.decode()
        assert f"plotly.js?token={access.token}" in page

        async def listen_in():
            await websocket_connect(f"ws://{LOOPBACK}:{access.port}/socket")

        with pytest.raises(HTTPClientError, match="403"):
            asyncio.run(listen_in())
    finally:
        server.close(1.0)


def test_no_report_before_there_is_a_bag(server):
    page = answer(f"{server.access.url}report")
    assert (page.code, page.headers["Content-Type"]) == (404, "text/plain; charset=utf-8")
    assert page.body.decode() == ("There is no report yet: no recorded flight has ended.\n")
    assert server.unseen


def test_a_report_that_cannot_be_made_says_why(server, tmp_path):
    server.report = ReportMaker(tmp_path / "gone")
    page = answer(f"{server.access.url}report")
    assert page.code == 404
    assert page.body.decode() == f"ares: bag {tmp_path / 'gone'} does not exist\n"


def test_a_report_is_made_once(server):
    server.report = ReportMaker(REFERENCE)
    first = answer(f"{server.access.url}report", request_timeout=110.0)
    assert first.code == 200
    assert first.headers["Content-Type"].startswith("text/html")
    assert b"Flown to the target" in first.body
    assert answer(f"{server.access.url}report").body == first.body


def test_a_bag_is_found_by_the_flight_that_it_names(tmp_path):
    for name, flight_id in (("one", 1), ("two", 2)):
        writer = BagWriter(tmp_path / name, {"flight_id": id_text(flight_id)})
        writer.close()
    (tmp_path / "three").mkdir()
    (tmp_path / "four").write_text("no folder")
    assert find_bag(tmp_path, 2) == tmp_path / "two"
    # one that is named need not name its flight
    assert find_bag(tmp_path / "one", 9) == tmp_path / "one"
    for where in (tmp_path, tmp_path / "nowhere"):
        with pytest.raises(NoReport, match=f"^There is no report: {where} has no bag of this"):
            find_bag(where, 9)


def test_this_machine_needs_no_token():
    for host in (LOOPBACK, "localhost"):
        with listen(host, 0) as listener:
            assert Access.of(listener).token == ""


def test_an_address_that_cannot_be_had():
    with listen(LOOPBACK, 0) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(AddressError, match=f"port is {port}, which is taken"):
            free_port(LOOPBACK, port)
    for host in ("no.such.host.invalid", "192.0.2.1", ".", "\N{SNOWMAN}" * 70):
        with pytest.raises(AddressError, match="expected an address of this machine"):
            free_port(host, 0)
    assert free_port(LOOPBACK, port) == port


@pytest.mark.parametrize(
    ("text", "command"),
    [
        ('{"command": "pause"}', ("pause", 0.0)),
        ('{"command": "play", "value": "x"}', ("play", 0.0)),
        ('{"command": "pace", "value": 10}', ("pace", 10.0)),
        ('{"command": "pace", "value": 0}', ("pace", 0.0)),
    ],
)
def test_commands(text, command):
    assert read_command(text) == command


@pytest.mark.parametrize(
    "text",
    [
        "",
        "pause",
        b"\xff\xfe",
        "[" * 900,
        "[]",
        '"pause"',
        "{}",
        '{"command": ["pause"]}',
        '{"command": "exit"}',
        '{"command": "pace", "value": "10"}',
        '{"command": "pace", "value": true}',
        '{"command": "pace", "value": null}',
        '{"command": "pace", "value": -1}',
        '{"command": "pace", "value": 1e-9}',
        '{"command": "pace", "value": 1e300}',
        '{"command": "pace", "value": NaN}',
        '{"command": "pace", "value": Infinity}',
        '{"command": "pace", "value": 1' + "0" * 400 + "}",
    ],
)
def test_what_is_no_command_is_refused_in_one_line(text, server, commands):
    with pytest.raises(ValueError, match=r"^[^\n]{1,200}$"):
        read_command(text)
    if isinstance(text, str):
        refused = told(server, text, until="refused")[-1]
        assert "\n" not in refused["reason"]
    assert commands == []


def test_a_long_command_ends_the_page_that_sent_it(server, commands):
    async def talk():
        url = f"ws://{LOOPBACK}:{server.access.port}/socket"
        page = await websocket_connect(url)
        page.write_message("x" * (MAX_COMMAND + 1))
        while await page.read_message() is not None:
            pass

    asyncio.run(asyncio.wait_for(talk(), 20))
    assert commands == []
    assert told(server)[0]["kind"] == "flight"


def test_a_command_is_passed_on(server, commands):
    async def talk():
        page = await websocket_connect(f"ws://{LOOPBACK}:{server.access.port}/socket")
        page.write_message('{"command": "pace", "value": 5}')
        while not commands:
            await asyncio.sleep(0.01)
        commands[0][2]("not today")
        while (message := json.loads(await page.read_message()))["kind"] != "refused":
            pass
        return message["reason"]

    assert asyncio.run(asyncio.wait_for(talk(), 20)) == "not today"
    assert commands[0][:2] == ("pace", 5.0)


def stuck(page):
    for _ in range(20):
        if not page.busy():
            return False
        time.sleep(0.01)
    return True


def test_who_reads_nothing_is_sent_nothing_more_and_others_read_on(server):
    """Open a page that reads nothing: one message is queued for it, no more."""
    handshake = (
        f"GET /socket HTTP/1.1\r\nHost: {LOOPBACK}:{server.access.port}\r\nUpgrade: websocket\r\n"
        "Connection: Upgrade\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
        "Sec-WebSocket-Version: 13\r\n\r\n"
    )
    with socket.create_connection((LOOPBACK, server.access.port)) as idle:
        idle.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        idle.sendall(handshake.encode())
        while not server.pages:
            time.sleep(0.01)
        (page,) = server.sockets
        deadline = time.monotonic() + 60.0
        for k in count():
            server.story.update(note=f"{k} " + "x" * 20_000)
            server.notify()
            if k % 20 == 0 and stuck(page):
                break
            assert time.monotonic() < deadline
        waiting = page.ws_connection.stream._write_buffer
        before = len(waiting)
        assert 0 < before < 100_000
        for k in range(200):
            server.story.update(note=f"{k} " + "y" * 20_000)
            server.notify()
        assert told(server)[0]["about"]["note"].startswith("199 ")
        assert len(waiting) <= before


def test_the_end_is_told_and_frees_the_port():
    server = LiveServer(listen(LOOPBACK, 0), Story(), lambda *_: None)

    async def watch():
        page = await websocket_connect(f"ws://{LOOPBACK}:{server.access.port}/socket")
        said = [json.loads(await page.read_message())["kind"]]
        server.story.update(verdict="Flown to the target", good=True)
        asyncio.get_running_loop().run_in_executor(None, server.close, 5.0)
        while (text := await page.read_message()) is not None:
            said.append(json.loads(text)["kind"])
        return said

    said = asyncio.run(asyncio.wait_for(watch(), 20))
    assert said[0] == "flight"
    assert said[-1] == "end"
    assert "update" in said
    assert free_port(LOOPBACK, server.access.port) == server.access.port
