"""Net F/T's requests and records against bytes written by hand, and a sensor's port."""

import select
import socket
import struct
import urllib.error
import urllib.request
import xml.etree.ElementTree as ET
from collections.abc import Iterator

import numpy as np
import pytest

from dualbend import InputError
from dualbend.serve.sensor.netft import NetFT
from dualbend.serve.sensor.rdt import SATURATED, decode, encode
from support.served import take

STREAM = bytes.fromhex("12 34 00 02 00 00 00 00")
ONE = bytes.fromhex("12 34 00 02 00 00 00 01")
STOP = bytes.fromhex("12 34 00 00 00 00 00 00")
BIAS = bytes.fromhex("12 34 00 42 00 00 00 00")
WRENCH = np.array([1.5, -2.0, 0.25, 0.001, -0.002, 3.0])


@pytest.fixture
def sensor() -> Iterator[NetFT]:
    one = NetFT("left", "127.0.0.1", 0, 0, 0.028)
    yield one
    one.close()


@pytest.fixture
def client(sensor: NetFT) -> Iterator[socket.socket]:
    with connected(sensor) as one:
        yield one


def connected(sensor: NetFT) -> socket.socket:
    one = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    one.connect(("127.0.0.1", sensor.port))
    one.settimeout(5.0)
    return one


def request(sensor: NetFT, client: socket.socket, data: bytes) -> None:
    client.send(data)
    assert take(sensor)


def record(client: socket.socket) -> tuple[int, ...]:
    return struct.unpack(">III6i", client.recv(100))


def silent(client: socket.socket) -> bool:
    return not select.select([client], [], [], 0.02)[0]


def test_requests_written_by_hand_are_read() -> None:
    assert decode(STREAM) == (2, 0)
    assert decode(ONE) == (2, 1)
    assert decode(STOP) == (0, 0)
    assert decode(BIAS) == (0x42, 0)
    for wrong in (b"", STREAM[:-1], STREAM + b"\0", b"\0" + STREAM[1:], b"\x12\x34\x00\x99" * 2):
        assert decode(wrong) is None


def test_a_record_is_written_by_hand() -> None:
    told = encode(2**32 + 1, 2, 0, [1, -1, 256, 0, 2**40, -(2**40)])
    assert told == bytes.fromhex(
        "00000001 00000002 00000000 00000001 ffffffff 00000100 00000000 7fffffff 80000001"
    )


def test_a_stream_has_a_record_a_cycle(sensor: NetFT, client: socket.socket) -> None:
    request(sensor, client, STREAM)
    for cycle in range(3):
        sensor.publish(cycle, WRENCH, clipped=cycle == 2)
        rdt, ft, status, *counts = record(client)
        assert (rdt, ft, status) == (cycle + 1, cycle + 1, SATURATED if cycle == 2 else 0)
        assert counts == [1_500_000, -2_000_000, 250_000, 1_000, -2_000, 3_000_000]
    request(sensor, client, STOP)
    sensor.publish(3, WRENCH, clipped=False)
    assert silent(client)


def test_a_record_that_is_repeated_has_the_same_number(
    sensor: NetFT, client: socket.socket
) -> None:
    request(sensor, client, STREAM)
    sensor.publish(7, WRENCH, clipped=False)
    sensor.again()
    assert [record(client)[:2], record(client)[:2]] == [(1, 8), (2, 8)]


def test_one_record_is_sent_at_once_and_no_more(sensor: NetFT, client: socket.socket) -> None:
    sensor.publish(0, WRENCH, clipped=False)
    request(sensor, client, ONE)
    assert record(client)[1] == 1
    sensor.publish(1, WRENCH, clipped=False)
    assert silent(client)


def test_the_bias_is_the_reading_when_it_came(sensor: NetFT, client: socket.socket) -> None:
    sensor.publish(0, WRENCH, clipped=False)
    request(sensor, client, BIAS)
    request(sensor, client, STREAM)
    assert record(client)[3:] == (0,) * 6
    sensor.publish(1, 2.0 * WRENCH, clipped=False)
    assert record(client)[3:] == (1_500_000, -2_000_000, 250_000, 1_000, -2_000, 3_000_000)


def test_a_second_client_takes_the_stream_and_is_counted(
    sensor: NetFT, client: socket.socket
) -> None:
    request(sensor, client, STREAM)
    with connected(sensor) as other:
        request(sensor, other, STREAM)
        sensor.publish(0, WRENCH, clipped=False)
        assert record(other)[1] == 1
        assert silent(client)
    assert sensor.counted()["taken_over"] == 1
    sensor.publish(1, WRENCH, clipped=False)  # to a client that has gone
    sensor.publish(2, WRENCH, clipped=False)


def test_mutated_requests_are_counted(sensor: NetFT, client: socket.socket) -> None:
    rng = np.random.default_rng(3)
    for _ in range(2000):
        data = bytearray(STREAM)
        data[int(rng.integers(8))] = int(rng.integers(256))
        request(sensor, client, bytes(data[: int(rng.integers(5, 10))]) + rng.bytes(2)[:1])
        sensor.publish(0, WRENCH, clipped=False)
    counts = sensor.counted()
    assert isinstance(counts["malformed"], int)
    assert isinstance(counts["requests"], int)
    assert counts["malformed"] + counts["requests"] == 2000
    request(sensor, client, b"\0" * 60_000)


def test_the_page_has_the_units(sensor: NetFT) -> None:
    at = f"http://127.0.0.1:{sensor.http_port}"
    with urllib.request.urlopen(f"{at}/netftapi2.xml?index=0", timeout=5.0) as page:
        root = ET.fromstring(page.read())
    assert [root.findtext(k) for k in ("cfgcpf", "cfgcpt")] == ["1000000", "1000000"]
    assert [root.findtext(k) for k in ("scfgfu", "scfgtu", "comrdtrate")] == ["N", "Nm", "36"]
    with pytest.raises(urllib.error.HTTPError, match="404"):
        urllib.request.urlopen(f"{at}/../etc/passwd", timeout=5.0)
    with socket.create_connection(("127.0.0.1", sensor.http_port), timeout=5.0) as rude:
        rude.sendall(b"\xff\0 nothing\r\n\r\n")
        rude.recv(100)
    with urllib.request.urlopen(f"{at}/netftapi2.xml", timeout=5.0) as page:
        assert page.status == 200


def test_a_port_that_is_taken_is_named(sensor: NetFT) -> None:
    for ports, key in (
        ((sensor.port, 0), "serve.right.sensor_port"),
        ((0, sensor.http_port), "serve.right.http_port"),
    ):
        with pytest.raises(InputError, match=f"{key} = .*cannot be opened"):
            NetFT("right", "127.0.0.1", *ports, 0.028)
    with pytest.raises(InputError, match=r"at nowhere\.invalid"):
        NetFT("right", "nowhere.invalid", 0, 0, 0.028)
