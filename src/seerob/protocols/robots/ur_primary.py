"""The primary interface of Universal Robots controllers, as far as it says how that very robot was built.

A stream of packages, big-endian: length (i32, itself included), kind (u8). One of kind 16, the robot's
state, is a row of parts of the same form; part 5 holds the Denavit–Hartenberg parameters that were
measured at the factory. Layout as in ``robot_state.h`` and ``kinematics_info.cpp`` of the maker's client
library, 2.14.0. Nothing is ever sent to the robot.
"""

from __future__ import annotations

import asyncio
import math
import struct
from collections.abc import Iterator
from dataclasses import dataclass

from seerob.protocols import ProtocolError
from seerob.protocols.links.connection import connected

PORT = 30011
"""The one that takes no commands."""
STATE, KINEMATICS = 16, 5
LARGEST = 1 << 16
"""A longer package is none [B]."""
ENOUGH = 1 << 20
"""Bytes after which it is not going to come."""
_HEAD = struct.Struct(">iB")
_KINEMATICS = struct.Struct(">6I24dI")


@dataclass(frozen=True, slots=True)
class Kinematics:
    """Measured Denavit–Hartenberg parameters, joint by joint, as T = Rz(θ + q) Tz(d) Tx(a) Rx(α)."""

    theta: tuple[float, ...]
    """[rad]"""
    a: tuple[float, ...]
    """[m]"""
    d: tuple[float, ...]
    """[m]; those of the two parallel joints may be hundreds of metres that cancel out."""
    alpha: tuple[float, ...]
    """[rad]"""
    checksum: tuple[int, ...] = (0,) * 6
    """One per joint; another arm has others."""
    status: int = 0


def packages(data: bytes) -> Iterator[tuple[int, bytes, int]]:
    """Whole packages (or parts of one) at the front of bytes: kind, payload, and where the next begins.

    Raises:
        ProtocolError: A length that cannot be.
    """
    begin = 0
    while begin + _HEAD.size <= len(data):
        length, kind = _HEAD.unpack_from(data, begin)
        if not _HEAD.size <= length <= LARGEST:
            raise ProtocolError(f"a package of {length} bytes: no primary interface")
        if begin + length > len(data):
            return
        yield kind, data[begin + _HEAD.size : begin + length], begin + length
        begin += length


def decode_kinematics(payload: bytes) -> Kinematics:
    """Part 5 of a robot's state.

    Raises:
        ProtocolError: It is too short, or a value is not finite.
    """
    if len(payload) < _KINEMATICS.size:
        raise ProtocolError(f"{len(payload)} bytes of kinematics where {_KINEMATICS.size} belong")
    values = _KINEMATICS.unpack_from(payload)
    if not all(math.isfinite(x) for x in values):
        raise ProtocolError("kinematics that are not finite")
    theta, a, d, alpha = (values[k : k + 6] for k in (6, 12, 18, 24))
    return Kinematics(theta, a, d, alpha, values[:6], values[30])


def kinematics_in(state: bytes) -> Kinematics | None:
    """What the payload of a robot's state says of the kinematics; None when it does not.

    Raises:
        ProtocolError: It cannot be understood.
    """
    found = (decode_kinematics(part) for kind, part, _ in packages(state) if kind == KINEMATICS)
    return next(found, None)


def encode_state(kinematics: Kinematics) -> bytes:
    """A package of the robot's state, with the kinematics and a part that others have before it."""
    k = kinematics
    payload = _KINEMATICS.pack(*k.checksum, *k.theta, *k.a, *k.d, *k.alpha, k.status)
    parts = _package(0, bytes(38)) + _package(KINEMATICS, payload)
    return _package(STATE, parts)


def _package(kind: int, payload: bytes) -> bytes:
    return _HEAD.pack(_HEAD.size + len(payload), kind) + payload


async def read_kinematics(host: str, port: int, patience: float) -> Kinematics:
    """Connect, listen until the controller says how the robot was built, and leave.

    Args:
        host: Name or address of the controller.
        port: `PORT` of a real one.
        patience: Longest time for all of it [s].

    Raises:
        OSError: There is no connection.
        TimeoutError: It does not say.
        ProtocolError: It says something else.
    """
    waiting, heard = b"", 0
    try:
        async with asyncio.timeout(patience), connected(host, port, patience) as connection:
            while heard < ENOUGH:
                data = (await connection.read(patience)).data
                if not data:
                    raise ProtocolError("closed the connection before it said its kinematics")
                waiting, heard, done = waiting + data, heard + len(data), 0
                for kind, payload, done in packages(waiting):  # noqa: B007 - of the last one
                    if kind == STATE and (found := kinematics_in(payload)) is not None:
                        return found
                waiting = waiting[done:]
    except TimeoutError as error:
        raise TimeoutError(f"does not say its kinematics within {patience:g} s") from error
    raise ProtocolError(f"{heard} bytes without its kinematics")
