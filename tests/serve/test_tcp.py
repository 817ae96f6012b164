"""A TCP port: no client can make it wait, or keep what it does not read."""

import selectors
import socket
from collections.abc import Iterator

import pytest

from dualbend.serve.tcp import Client, TcpPort


class Kept:
    """A port that keeps what came, and the selector that it is watched by."""

    def __init__(self) -> None:
        self.came, self.gone = list[bytes](), list[Client]()
        at = ("127.0.0.1", 0)
        self.port = TcpPort(at, "serve.key", self.take, greeting=b"hello", left=self.gone.append)
        self.selector = selectors.DefaultSelector()
        self.port.watch(self.selector)

    def take(self, client: Client) -> None:
        self.came.append(bytes(client.data))
        client.data.clear()

    def go(self) -> None:
        while found := self.selector.select(0.02):
            for key, _ in found:
                key.data()

    def connected(self) -> socket.socket:
        return socket.create_connection(("127.0.0.1", self.port.port), 5.0)


@pytest.fixture
def kept() -> Iterator[Kept]:
    one = Kept()
    yield one
    one.port.close()
    one.selector.close()


def test_a_client_is_greeted_heard_and_let_go(kept: Kept) -> None:
    with kept.connected() as client:
        client.sendall(b"word")
        kept.go()
        assert client.recv(10) == b"hello"
        assert kept.came == [b"word"]
    kept.go()
    assert kept.port.clients == []
    assert len(kept.gone) == 1


def test_a_client_that_reads_nothing_is_kept_for_a_while_and_then_let_go(kept: Kept) -> None:
    with kept.connected() as deaf, kept.connected() as other:
        kept.go()
        first = kept.port.clients[0]
        sent = 0
        while not first.behind:
            first.send(bytes(65536))
            sent += 65536
        deaf.recv(65536)
        first.send()
        assert first.open
        for _ in range(20):
            first.send(bytes(65536))
        kept.port.tidy()
        assert not first.open
        assert len(kept.port.clients) == 1
        other.sendall(b"still here")
        kept.go()
        assert kept.came == [b"still here"]


def test_there_are_at_most_sixteen(kept: Kept) -> None:
    clients = []
    for _ in range(17):
        clients.append(kept.connected())
        kept.go()
    assert len(kept.port.clients) == 16
    assert clients[16].recv(10) == b""
    for client in clients:
        client.close()
