# SPDX-License-Identifier: Apache-2.0
"""Send messages to Foxglove and Lichtblick over a WebSocket. No ROS graph."""

from collections import deque
from typing import Any

import foxglove
from foxglove.websocket import Capability, ServerListener

from ares_bags.schema import message_definition

HOST = "127.0.0.1"


class FoxgloveServer(ServerListener):
    """Serve channels of ROS 2 messages as in a bag: CDR with `ros2msg` definitions.

    A late client gets the messages that a late subscription would get in ROS 2.
    """

    def __init__(self, name: str, port: int) -> None:
        """Start the server.

        Args:
            name: shown by clients.
            port: on loopback.

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
            keep: number of latest messages sent to late clients.
        """
        text = message_definition(type_name).encode()
        schema = foxglove.Schema(name=type_name, encoding="ros2msg", data=text)
        self._kept[topic] = deque(maxlen=keep)
        self._channels[topic] = foxglove.Channel(
            topic, schema=schema, message_encoding="cdr", context=self._context
        )

    def send(self, topic: str, stamp_ns: int, data: bytes) -> None:
        """Send a serialized message.

        Args:
            topic: of a channel.
            stamp_ns: flight time, ns; a negative one becomes zero, since log times are unsigned.
            data: CDR with its encapsulation header.
        """
        stamp_ns = max(stamp_ns, 0)
        self._kept[topic].append((stamp_ns, data))
        self._channels[topic].log(data, log_time=stamp_ns)

    def broadcast_time(self, stamp_ns: int) -> None:
        """Broadcast the flight time, ns; see `send`."""
        self._server.broadcast_time(max(stamp_ns, 0))

    def clear(self) -> None:
        """Clear the messages of the previous flight, also in the clients."""
        for kept in self._kept.values():
            kept.clear()
        self._server.clear_session()

    def close(self) -> None:
        """Stop serving."""
        self._server.stop()

    def on_subscribe(self, client: Any, channel: Any) -> None:
        """Send a late client the messages kept of a channel; runs in the server's thread."""
        # the channel sends to all its clients: earlier ones get a duplicate, which is harmless
        for stamp_ns, data in list(self._kept.get(channel.topic, ())):
            self._channels[channel.topic].log(data, log_time=stamp_ns)
