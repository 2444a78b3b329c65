"""Where an OPC UA server keeps a variable: node ids by namespace URI, and paths of browse names.

Units of OPC UA's EngineeringUnits, which are UNECE Recommendation 20 codes written as numbers.
"""

from __future__ import annotations

import base64
import binascii
import re
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple
from uuid import UUID

import msgspec
from msgspec import Meta

if TYPE_CHECKING:
    from asyncua.ua import NodeId

NAMESPACE = "http://www.opcfoundation.org/UA/units/un/cefact"

CODES: dict[str, str] = {
    "MTR": "m",
    "CMT": "cm",
    "MMT": "mm",
    "INH": "inch",
    "MTS": "m/s",
    "C16": "mm/s",
    "2X": "m/min",
    "MSK": "m/s2",
    "C81": "rad",
    "DD": "deg",
    "2A": "rad/s",
    "E96": "deg/s",
    "RPM": "rpm",
    "SEC": "s",
    "C26": "ms",
    "MIN": "min",
    "HTZ": "Hz",
    "KGM": "kg",
    "GRM": "g",
    "TNE": "t",
    "NEW": "N",
    "NU": "N.m",
    "PAL": "Pa",
    "KPA": "kPa",
    "MPA": "MPa",
    "BAR": "bar",
    "KEL": "K",
    "CEL": "degC",
    "AMP": "A",
    "4K": "mA",
    "VLT": "V",
    "WTT": "W",
    "KWT": "kW",
    "JOU": "J",
    "P1": "%",
    "C62": "1",
}
"""UNECE common code → unit as the dictionary spells it."""


def number(code: str) -> int:
    """The ``UnitId`` of a common code: its letters as one big-endian number."""
    return int.from_bytes(code.encode("ascii"), "big")


_BY_NUMBER = {number(code): unit for code, unit in CODES.items()}


def unit(unit_id: int) -> str:
    """The unit of a ``UnitId``; empty for one that is not known."""
    return _BY_NUMBER.get(unit_id, "")


# Names may hold whatever they like, semicolons and bars too; a namespace ends where a kind begins.
_NODE = re.compile(r"(?:nsu=(?P<uri>.+?);|ns=(?P<number>\d{1,5});)?(?P<kind>[sigb])=(?P<name>.*)", re.DOTALL)
WRITE = 'write "nsu=urn:…;s=name", "ns=2;i=7" or { browse = ["urn:…|Folder", …] }'
LARGEST = (1 << 32) - 1
"""Node id that is a number."""


class Address(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A path of browse names from the server's Objects folder."""

    browse: Annotated[tuple[str, ...], Meta(min_length=1, max_length=50)]
    """Each ``namespace-uri|name``, or ``name`` for the standard's own."""


class NodeName(NamedTuple):
    """A node id as it is written: ``nsu=uri;s=DB.speed``, ``ns=2;i=7``."""

    uri: str
    """URI of the namespace; empty when it is meant by number."""
    number: int
    kind: str
    """``s`` text, ``i`` number, ``g`` GUID, ``b`` bytes in base64."""
    name: str

    def node_id(self, namespace: int) -> NodeId:
        """The node id in a namespace of a server."""
        from asyncua import ua

        make: Any = ua.NodeId
        name: int | UUID | bytes | str = self.name
        if self.kind == "i":
            name = int(self.name)
        elif self.kind == "g":
            name = UUID(self.name)
        elif self.kind == "b":
            name = base64.b64decode(self.name, validate=True)
        found: NodeId = make(name, namespace)
        return found


def node_name(text: str) -> NodeName:
    """The parts of a node id.

    Raises:
        ValueError: It is none.
    """
    match = _NODE.fullmatch(text)
    if match is None:
        raise ValueError(WRITE)
    found = NodeName(match["uri"] or "", int(match["number"] or 0), match["kind"], match["name"])
    try:
        if found.kind == "g":
            UUID(found.name)
        elif found.kind == "b":
            base64.b64decode(found.name, validate=True)
    except (ValueError, binascii.Error):
        raise ValueError(WRITE) from None
    if found.kind == "i":
        counts = found.name.isascii() and found.name.isdigit() and int(found.name) <= LARGEST
    else:
        counts = bool(found.name)
    if not counts or found.number > 0xFFFF:
        raise ValueError(WRITE)
    return found


def written(node_id: NodeId, uri: str) -> str:
    """A node id as a dictionary has it, which lasts when namespaces are numbered anew.

    Args:
        node_id: Of a server.
        uri: Of its namespace; empty for the standard's own.
    """
    name = node_id.Identifier
    if isinstance(name, bytes):
        text = f"b={base64.b64encode(name).decode('ascii')}"
    else:
        text = f"{'g' if isinstance(name, UUID) else 'i' if isinstance(name, int) else 's'}={name}"
    return f"nsu={uri};{text}" if uri else text


def browse_name(text: str) -> tuple[str, str]:
    """Namespace and name of one step of a path; the namespace is empty for the standard's own."""
    # A URI has no bar, a name may.
    uri, bar, name = text.partition("|")
    return (uri, name) if bar else ("", text)


def address(raw: object) -> str | Address:
    """Where a variable is: ``nsu=uri;s=DB.speed``, ``ns=2;i=7``, or ``{ browse = [...] }``.

    Raises:
        ValueError: It cannot be understood.
    """
    if isinstance(raw, str):
        node_name(raw)
        return raw
    if isinstance(raw, dict):
        return msgspec.convert(raw, Address)
    raise ValueError(f"{raw!r} is neither a node id nor a path of browse names")
