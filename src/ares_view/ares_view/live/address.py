# SPDX-License-Identifier: Apache-2.0
"""Open the socket of the live page and control access to it. Standard library only."""

import errno
import hmac
import ipaddress
import secrets
import socket
from dataclasses import dataclass

LOOPBACK = "127.0.0.1"
#: Host names under which a browser on this machine may request the page.
_LOCAL_NAMES = ("127.0.0.1", "localhost", "[::1]")
_BACKLOG = 16


class AddressError(ValueError):
    """Report in one line that the page cannot be served at an address."""


def listen(host: str, port: int) -> socket.socket:
    """Open a listening socket for browsers.

    Args:
        host: an address or a name of this machine.
        port: 0 takes a free one.

    Raises:
        AddressError: not an address of this machine, or the port is not available.
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
    """Return the port that `listen` would open now.

    Raises:
        AddressError: see `listen`.
    """
    with listen(host, port) as listener:
        return int(listener.getsockname()[1])


def _is_loopback(address: str) -> bool:
    return ipaddress.ip_address(address.partition("%")[0]).is_loopback


@dataclass(frozen=True)
class Access:
    """Hold the address of the page and decide who may request it.

    Attributes:
        host: address of the server in a URL.
        port: its port.
        token: required in the URL of every request; "" for a server on loopback.
    """

    host: str
    port: int
    token: str

    @classmethod
    def of(cls, listener: socket.socket) -> "Access":
        """Return the access rules of a socket: a token is required unless it is on loopback."""
        address, port = listener.getsockname()[:2]
        local = _is_loopback(address)
        if ipaddress.ip_address(address).is_unspecified:
            address = socket.gethostname()
        host = f"[{address}]" if ":" in address else address
        return cls(host, port, "" if local else secrets.token_urlsafe(24))

    @property
    def url(self) -> str:
        """Return the URL of the page."""
        return f"http://{self.host}:{self.port}/{self.query}"

    @property
    def query(self) -> str:
        """Return the query string of every URL."""
        return f"?token={self.token}" if self.token else ""

    def accepts_host(self, host: str) -> bool:
        """Tell whether the header Host of a request names this server.

        Guards against DNS rebinding: a foreign page whose name was made to resolve to this address
        requests it under that name. With a token any name is accepted: this machine may have names
        that it does not know.
        """
        if self.token:
            return True
        name, _, port = host.rpartition(":")
        return name in (*_LOCAL_NAMES, self.host) and port == str(self.port)

    def accepts_token(self, token: str) -> bool:
        """Compare a token in constant time; without one required, accept any."""
        return hmac.compare_digest(token.encode(), self.token.encode()) or not self.token
