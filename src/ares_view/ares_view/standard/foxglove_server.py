# SPDX-License-Identifier: Apache-2.0
"""A WebSocket server that gives Foxglove and Lichtblick messages as they come. No ROS graph."""

from collections import deque
from typing import Any

import foxglove
from foxglove.websocket import Capability, ServerListener

from ares_bags.schema import message_definition

HOST = "127.0.0.1"


class FoxgloveServer(ServerListener):
    """Channels of ROS 2 messages, as they are in a bag: CDR, with `ros2msg` definitions.

    What a late reader of a topic would get in ROS 2, a late client of its channel gets here.
    """

    def __init__(self, name: str, port: int) -> None:
        """Open the server.

        Args:
            name: shown by clients.
            port: of this machine; others cannot connect.

        Raises:
            RuntimeError: the port cannot be opened.
        """
        self._context = foxglove.Context()
        self._channels: dict[str, foxglove.Channel] = {}
        self._kept: dict[str, deque[tuple[int, bytes]]] = {}
        self._server = foxglove.start_server(
            name=name,
            host=HOST,
            port=port,
            capabilities=[Capability.Time],
            context=self._context,
            server_listener=self,
        )

    def add(self, topic: str, type_name: str, keep: int = 0) -> None:
        """Offer a channel.

        Args:
            topic: full name.
            type_name: `package/msg/Name`.
            keep: messages that clients get who come later.
        """
        text = message_definition(type_name).encode()
        schema = foxglove.Schema(name=type_name, encoding="ros2msg", data=text)
        self._kept[topic] = deque(maxlen=keep)
        self._channels[topic] = foxglove.Channel(
            topic, schema=schema, message_encoding="cdr", context=self._context
        )

    def send(self, topic: str, stamp_ns: int, data: bytes) -> None:
        """Send a serialised message.

        Args:
            topic: of a channel.
            stamp_ns: flight time, ns; a negative one counts as zero: there is no such log time.
            data: as a publisher or a bag has it.
        """
        stamp_ns = max(stamp_ns, 0)
        self._kept[topic].append((stamp_ns, data))
        self._channels[topic].log(data, log_time=stamp_ns)

    def tell_time(self, stamp_ns: int) -> None:
        """Tell the clients what time it is, ns; see `send`."""
        self._server.broadcast_time(max(stamp_ns, 0))

    def begin_anew(self) -> None:
        """Another flight: clients forget the one before."""
        for kept in self._kept.values():
            kept.clear()
        self._server.clear_session()

    def close(self) -> None:
        """Serve no more."""
        self._server.stop()

    def on_subscribe(self, client: Any, channel: Any) -> None:
        """Called by the server, in a thread of its own."""
        # the others get it a second time, which changes nothing
        for stamp_ns, data in list(self._kept.get(channel.topic, ())):
            self._channels[channel.topic].log(data, log_time=stamp_ns)
