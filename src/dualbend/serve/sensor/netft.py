"""ATI Net F/T: a sensor that sends records over UDP, and tells its units over HTTP."""

from __future__ import annotations

import selectors
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

from dualbend.errors import refusing
from dualbend.run.record import TableRow
from dualbend.serve.port import bound, udp_socket
from dualbend.serve.sensor import rdt
from dualbend.types import Side, Vector

_POLL_S = 0.02
"""Until the page's thread sees that it shall end."""


class NetFT:
    """One sensor, which sends a record a command cycle to the client that asked for it last.

    ``ft_sequence`` of a record counts command cycles from 1: a record that was sent twice has it
    twice. Port 0 takes any that is free. Raises InputError where a port cannot be opened.
    """

    def __init__(
        self, side: Side, address: str, port: int, http_port: int, period_s: float
    ) -> None:
        self.side: Side = side
        self._socket = udp_socket()
        self.address = address
        self.port = bound(self._socket, address, port, f"serve.{side}.sensor_port")
        page = rdt.page(f"{side} sensor", 1.0 / period_s)
        with refusing(
            f"serve.{side}.http_port = {http_port} at {address}: cannot be opened", OSError
        ):
            self._web = _Web((address, http_port), page)
        self.http_port = int(self._web.server_address[1])
        threading.Thread(target=self._web.serve_forever, args=(_POLL_S,), daemon=True).start()
        self._client: tuple[str, int] | None = None
        self._left: int | None = None
        self._sequence, self._cycle, self._status = 0, 0, 0
        self._counts, self._bias = [0] * 6, [0] * 6
        self._known = False
        self._count = dict.fromkeys(
            ("sent", "repeated", "requests", "malformed", "taken_over", "biased"), 0
        )

    def watch(self, selector: selectors.BaseSelector) -> None:
        """Register what is waited on."""
        selector.register(self._socket, selectors.EVENT_READ, self.receive)

    def publish(self, cycle: int, wrench: Vector, *, clipped: bool) -> None:
        """Tell the reading (6,) [N, N m] of a cycle, about the sensor's origin, in its axes."""
        self._cycle, self._counts, self._known = cycle, rdt.counts_of(wrench), True
        self._status = rdt.SATURATED if clipped else 0
        self._send()

    def again(self) -> None:
        """Tell the reading again: whoever waits for it may have missed it."""
        if self._client is not None:
            self._send()
            self._count["repeated"] += 1

    def receive(self) -> None:
        """Take one request."""
        try:
            data, client = self._socket.recvfrom(64)
        except OSError:
            return
        request = rdt.decode(data)
        if request is None:
            self._count["malformed"] += 1
            return
        self._count["requests"] += 1
        command, count = request
        if command == rdt.BIAS:
            self._bias = list(self._counts)
            self._count["biased"] += 1
        elif command == rdt.STOP:
            self._client = None
        else:
            self._count["taken_over"] += self._client not in (None, client)
            self._client, self._left = client, count or None
            if self._known:
                self._send()

    def _send(self) -> None:
        if self._client is None:
            return
        self._sequence += 1
        counts = [count - zero for count, zero in zip(self._counts, self._bias, strict=True)]
        record = rdt.encode(self._sequence, self._cycle + 1, self._status, counts)
        try:
            self._socket.sendto(record, self._client)
        except OSError:  # the client has gone, or there is no way to it
            self._client = None
            return
        self._count["sent"] += 1
        if self._left is not None:
            self._left -= 1
            if not self._left:
                self._client = None

    def told(self) -> list[str]:
        """Return where the sensor listens, and in which units."""
        return [
            f"{self.side} sensor: ATI Net F/T, RDT at UDP {self.address}:{self.port}, "
            f"http://{self.address}:{self.http_port}/netftapi2.xml; {rdt.COUNTS_PER_UNIT} counts "
            "per N and per N m, on the arm, about the sensor's origin, in its axes (x into the "
            "sheet), with the tool's weight"
        ]

    def counted(self) -> TableRow:
        """Return what went out and came in."""
        at = f"{self.address}:{self.port}"
        return {"port": f"{self.side} sensor", "protocol": "netft", "at": at, **self._count}

    def close(self) -> None:
        """Free both ports."""
        self._socket.close()
        self._web.shutdown()
        self._web.server_close()


class _Web(ThreadingHTTPServer):
    daemon_threads = True

    def __init__(self, at: tuple[str, int], page: bytes) -> None:
        self.page = page
        super().__init__(at, _Page)

    def handle_error(self, request: object, client_address: object) -> None:
        """Say nothing: a client may go away in the middle of a request."""


class _Page(BaseHTTPRequestHandler):
    timeout = 5.0

    def do_GET(self) -> None:
        """Send the sensor's page; there is no other."""
        assert isinstance(self.server, _Web)
        if self.path.partition("?")[0] != "/netftapi2.xml":
            self.send_error(404)
            return
        self.send_response(200)
        self.send_header("Content-Type", "application/xml")
        self.send_header("Content-Length", str(len(self.server.page)))
        self.end_headers()
        self.wfile.write(self.server.page)

    def log_message(self, format: str, *args: object) -> None:
        """Keep the terminal for the run."""
