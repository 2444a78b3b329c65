"""The wire of Unity's ROS-TCP-Endpoint and ROS-TCP-Connector, version 0.7, of either side.

A frame is a destination and a body, each a u32 length and its bytes, little-endian. A destination is a topic,
whose body is a serialised message, or begins with two underscores: then the body is a command in JSON. An
empty frame says that somebody is still there.
"""

from __future__ import annotations

import json
import struct
from typing import Any, NamedTuple

from seerob.protocols import ProtocolError
from seerob.protocols.links.json_pointer import document
from seerob.protocols.ros.ros_messages import Edition

PORT = 10000
VERSION = "v0.7.0"
LONGEST_DESTINATION = 512
MAX_BODY = 1 << 20
"""[byte]"""
COMMAND = "__"
_LENGTH = struct.Struct("<I")


class Frame(NamedTuple):
    """What is sent at once."""

    destination: str
    body: bytes

    @property
    def is_command(self) -> bool:
        """Whether it is for the other program itself."""
        return self.destination.startswith(COMMAND)

    def fields(self) -> dict[str, object]:
        """Of a command.

        Raises:
            ProtocolError: It is no table.
        """
        # Unity ends some of its texts with a zero.
        found = document(self.body.rstrip(b"\0") or b"{}")
        if not isinstance(found, dict):
            raise ProtocolError(f"the command {self.destination[:40]} without a table")
        return found


class Splitter:
    """Cuts a stream into frames."""

    def __init__(self) -> None:
        self._data = bytearray()

    def feed(self, data: bytes) -> list[Frame]:
        """The frames that are complete with these bytes; without those that only say that somebody is there.

        Raises:
            ProtocolError: A length that no frame has.
        """
        self._data += data
        found, at = [], 0
        while (frame := self._frame(at)) is not None:
            at, destination, body = frame
            if destination or body:
                found.append(Frame(destination, body))
        del self._data[:at]
        return found

    def _frame(self, at: int) -> tuple[int, str, bytes] | None:
        destination = self._part(at, LONGEST_DESTINATION, "destination")
        if destination is None:
            return None
        at, name = destination
        body = self._part(at, MAX_BODY, "body")
        if body is None:
            return None
        try:
            return body[0], name.rstrip(b"\0").decode(), body[1]
        except UnicodeDecodeError:
            raise ProtocolError("a destination that is no text") from None

    def _part(self, at: int, most: int, what: str) -> tuple[int, bytes] | None:
        if len(self._data) < at + _LENGTH.size:
            return None
        (length,) = _LENGTH.unpack_from(self._data, at)
        if length > most:
            raise ProtocolError(f"a {what} of {length} bytes: is that ROS-TCP?")
        end = at + _LENGTH.size + length
        return None if len(self._data) < end else (end, bytes(self._data[at + _LENGTH.size : end]))


def pack(destination: str, body: bytes) -> bytes:
    """A frame."""
    name = destination.encode()
    return _LENGTH.pack(len(name)) + name + _LENGTH.pack(len(body)) + body


def command(name: str, fields: dict[str, Any]) -> bytes:
    """A frame with a command, such as ``subscribe``."""
    return pack(COMMAND + name, json.dumps(fields).encode())


def handshake(edition: Edition) -> bytes:
    """What an endpoint says first: its version, and how it serialises."""
    metadata = json.dumps({"protocol": "ROS1" if edition is Edition.ROS1 else "ROS2"})
    return command("handshake", {"version": VERSION, "metadata": metadata})


def edition_of(frame: Frame) -> Edition:
    """How an endpoint serialises, by its handshake; endpoints of before 0.7 say nothing and are of ROS 1.

    Raises:
        ProtocolError: It is no handshake.
    """
    metadata = frame.fields().get("metadata", "")
    said = document(metadata) if isinstance(metadata, str) and metadata else {}
    named = said.get("protocol", "ROS1") if isinstance(said, dict) else ""
    if named not in ("ROS1", "ROS2"):
        raise ProtocolError(f"a handshake of the unknown protocol {str(named)[:40]!r}")
    return Edition.ROS1 if named == "ROS1" else Edition.ROS2
