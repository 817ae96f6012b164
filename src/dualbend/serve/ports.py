"""Ports of this machine that nobody has, for a client that is told them."""

from __future__ import annotations

import itertools
import os
import socket
from contextlib import suppress

import msgspec

from dualbend.errors import InputError
from dualbend.scenario.sections import ServeConfig
from dualbend.types import SIDES

_PORTS = ("robot_port", "sensor_port", "http_port")
_FIRST, _COUNT = 20_000, 12_000
"""Below those that a system gives to sockets which ask for any."""

_numbers = itertools.count(8 * os.getpid())


def with_ports(config: ServeConfig) -> ServeConfig:
    """Return a configuration in which ports that it leaves open are free ones of this machine."""
    sides = {}
    for side in SIDES:
        own = config.own(side)
        left_open = [name for name in _PORTS if not getattr(own, name)]
        sides[side] = msgspec.structs.replace(own, **{name: free_port() for name in left_open})
    return msgspec.structs.replace(config, **sides)


def free_port() -> int:
    """Return a port that nobody has, and that no cell of another process tries first."""
    for number in itertools.islice(_numbers, _COUNT):
        port = _FIRST + number % _COUNT
        with suppress(OSError):
            for kind in (socket.SOCK_DGRAM, socket.SOCK_STREAM):
                with socket.socket(socket.AF_INET, kind) as probe:
                    probe.bind(("127.0.0.1", port))
            return port
    raise InputError(f"none of the ports from {_FIRST} on is free")


def ports_of(config: ServeConfig) -> dict[str, str]:
    """Return the ports of a configuration that has them all: ``left_robot_port`` and so on."""
    return {
        f"{side}_{name}": str(getattr(config.own(side), name)) for side in SIDES for name in _PORTS
    }
