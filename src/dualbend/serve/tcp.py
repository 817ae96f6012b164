"""A TCP port of a served cell: any number of clients, none of which can make it wait."""

from __future__ import annotations

import selectors
import socket
from collections.abc import Callable
from contextlib import suppress
from functools import partial

from dualbend.serve.port import bound

_AT_ONCE, _MOST_CLIENTS, _MOST_UNREAD = 65536, 16, 1 << 20
"""Bytes that are read at once; clients at a time; bytes that a client may leave unread."""


class Client:
    """One who has connected.

    Attributes
    ----------
    data : what came and was not taken yet
    open : the connection stands
    """

    def __init__(self, connection: socket.socket) -> None:
        self._connection = connection
        self.data, self._unsent, self.open = bytearray(), bytearray(), True

    @property
    def behind(self) -> bool:
        """Whether something could not be sent yet."""
        return bool(self._unsent)

    def send(self, data: bytes = b"") -> None:
        """Send, or keep for later what the system does not take now."""
        self._unsent += data
        try:
            sent = self._connection.send(self._unsent) if self._unsent else 0
        except BlockingIOError:
            sent = 0
        except OSError:
            self.open = False
            return
        del self._unsent[:sent]
        self.open &= len(self._unsent) <= _MOST_UNREAD

    def read(self) -> None:
        """Read what has come."""
        try:
            data = self._connection.recv(_AT_ONCE)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        self.data += data
        self.open &= bool(data)


class TcpPort:
    """Listens, and gives what each client sends to ``take``; ``left`` is told of one that goes.

    Raises InputError, which names ``key``, where the port cannot be opened.
    """

    def __init__(
        self,
        at: tuple[str, int],
        key: str,
        take: Callable[[Client], None],
        *,
        greeting: bytes = b"",
        left: Callable[[Client], None] = lambda client: None,
    ) -> None:
        self._listening = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        self._listening.setblocking(False)
        self._listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        self.port = bound(self._listening, *at, key)
        self._listening.listen(_MOST_CLIENTS)
        self._take, self._greeting, self._left = take, greeting, left
        self._clients = dict[Client, socket.socket]()
        self._selector: selectors.BaseSelector | None = None

    @property
    def clients(self) -> list[Client]:
        """Those who are connected."""
        return list(self._clients)

    def watch(self, selector: selectors.BaseSelector) -> None:
        """Register what is waited on, now and with each client."""
        self._selector = selector
        selector.register(self._listening, selectors.EVENT_READ, self._accept)

    def tidy(self) -> None:
        """Let go of clients that have gone, or that read nothing."""
        for client in self.clients:
            if not client.open:
                self._drop(client)

    def _accept(self) -> None:
        with suppress(OSError):
            connection, _ = self._listening.accept()
            if len(self._clients) >= _MOST_CLIENTS or self._selector is None:
                connection.close()
                return
            connection.setblocking(False)
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            client = Client(connection)
            self._clients[client] = connection
            self._selector.register(
                connection, selectors.EVENT_READ, partial(self._receive, client)
            )
            client.send(self._greeting)

    def _receive(self, client: Client) -> None:
        if client in self._clients:
            client.read()
            self._take(client)
            self.tidy()

    def read_all(self) -> None:
        """Take what has come by now from each client."""
        for client in self.clients:
            self._receive(client)

    def _drop(self, client: Client) -> None:
        connection = self._clients.pop(client)
        if self._selector is not None:
            with suppress(KeyError, ValueError):
                self._selector.unregister(connection)
        connection.close()
        self._left(client)

    def close(self) -> None:
        """Free the port and let go of all clients."""
        for client in self.clients:
            self._drop(client)
        self._listening.close()
