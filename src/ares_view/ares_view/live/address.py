# SPDX-License-Identifier: Apache-2.0
"""Where the page is served, and to whom. Standard library only."""

import errno
import hmac
import ipaddress
import secrets
import socket
from dataclasses import dataclass

LOOPBACK = "127.0.0.1"
#: Names by which a browser on this machine may call it.
_LOCAL_NAMES = ("127.0.0.1", "localhost", "[::1]")
_BACKLOG = 16


class AddressError(ValueError):
    """The page cannot be served there; the text is one line."""


def listen(host: str, port: int) -> socket.socket:
    """A socket that browsers can connect to.

    Args:
        host: an address or a name of this machine.
        port: 0 takes a free one.

    Raises:
        AddressError: no such address here, or the port cannot be had.
    """
    try:
        family, kind, protocol, _, where = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        listener = socket.socket(family, kind, protocol)
    except (OSError, UnicodeError) as error:
        raise AddressError(f"host is {host!r}; expected an address of this machine") from error
    try:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(where)
        listener.listen(_BACKLOG)
        listener.setblocking(False)
    except OSError as error:
        listener.close()
        raise AddressError(_why(error, host, port)) from error
    return listener


def _why(error: OSError, host: str, port: int) -> str:
    if error.errno == errno.EADDRINUSE:
        return f"port is {port}, which is taken; expected a free one, or 0 for any"
    if error.errno == errno.EACCES:
        return f"port is {port}, which this user may not open; expected one from 1024 up, or 0"
    return f"host is {host!r}; expected an address of this machine"


def free_port(host: str, port: int) -> int:
    """The port that `listen` would take now.

    Raises:
        AddressError: as `listen`.
    """
    with listen(host, port) as listener:
        return int(listener.getsockname()[1])


def _is_loopback(address: str) -> bool:
    return ipaddress.ip_address(address.partition("%")[0]).is_loopback


@dataclass(frozen=True)
class Door:
    """Who may come in.

    Attributes:
        host: where the page is served, as a browser writes it.
        port: its port.
        token: what stands in the address of the page; empty: nothing, on this machine only.
    """

    host: str
    port: int
    token: str

    @classmethod
    def of(cls, listener: socket.socket) -> "Door":
        """The door of a socket: one that others than this machine can reach has a token."""
        address, port = listener.getsockname()[:2]
        local = _is_loopback(address)
        if ipaddress.ip_address(address).is_unspecified:
            address = socket.gethostname()
        host = f"[{address}]" if ":" in address else address
        return cls(host, port, "" if local else secrets.token_urlsafe(24))

    @property
    def url(self) -> str:
        """Of the page."""
        return f"http://{self.host}:{self.port}/{self.query}"

    @property
    def query(self) -> str:
        """What follows the path of every address."""
        return f"?token={self.token}" if self.token else ""

    def knows(self, host: str) -> bool:
        """Whether a request was meant for this server, by its header Host.

        A foreign page whose name was made to point here calls it by that name. Behind a token
        any name will do: this machine may have more than it knows of.
        """
        if self.token:
            return True
        name, _, port = host.rpartition(":")
        return name in (*_LOCAL_NAMES, self.host) and port == str(self.port)

    def admits(self, token: str) -> bool:
        """Whether a token is the right one; it takes as long whatever is wrong with it."""
        return hmac.compare_digest(token.encode(), self.token.encode()) or not self.token
