"""Sparkplug B: topics and payloads of MQTT messages that carry named, typed values. Pure functions.

Field numbers and data types as in the Eclipse Tahu schema. Names and types come in a birth message;
what follows speaks of them by number (alias), so a listener who missed the birth understands nothing
until the next one.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from enum import StrEnum

from seerob.protocols import ProtocolError
from seerob.protocols.links.protobuf_wire import Field, Wire, double, fields, message, varint, whole

NAMESPACE = "spBv1.0"
MAX_METRICS = 20_000
LARGEST = 4 << 20
"""Payload [byte]."""

SIGNED = {1: 8, 2: 16, 3: 32, 4: 64}
"""Data types of signed whole numbers → bits; they travel as two's complement."""
DOUBLE, BOOLEAN, STRING = 10, 11, 12


class Kind(StrEnum):
    """What a message is, by its topic."""

    NODE_BIRTH = "NBIRTH"
    NODE_DEATH = "NDEATH"
    DEVICE_BIRTH = "DBIRTH"
    DEVICE_DEATH = "DDEATH"
    NODE_DATA = "NDATA"
    DEVICE_DATA = "DDATA"


@dataclass(frozen=True, slots=True)
class Topic:
    """Who speaks."""

    group: str
    kind: Kind
    node: str
    device: str = ""

    @property
    def speaker(self) -> str:
        """``group/node`` or ``group/node/device``."""
        return "/".join(part for part in (self.group, self.node, self.device) if part)


Value = float | bool | str | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Metric:
    """One value."""

    name: str = ""
    alias: int | None = None
    time: float | None = None
    """Device's, since 1970 [s]."""
    type: int | None = None
    historical: bool = False
    """Whether the value is of the past, not of now."""
    value: Value = None
    """None when the device says that it has none, or it is of a type that is not read."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Payload:
    """What a message says."""

    time: float | None = None
    """[s]"""
    seq: int | None = None
    """0 to 255, then again from 0; a gap is a loss."""
    metrics: tuple[Metric, ...] = ()


def topic(text: str) -> Topic | None:
    """The parts of a topic; None when it is no message of a node or device."""
    parts = text.split("/")
    if len(parts) not in (4, 5) or parts[0] != NAMESPACE or parts[2] not in list(Kind):
        return None
    kind = Kind(parts[2])
    if (len(parts) == 5) != kind.startswith("D"):
        return None
    return Topic(parts[1], kind, parts[3], *parts[4:])


def decode(data: bytes) -> Payload:
    """What a payload says.

    Raises:
        ProtocolError: It is none.
    """
    if len(data) > LARGEST:
        raise ProtocolError(f"a payload of {len(data)} bytes; at most {LARGEST} are read")
    time = seq = None
    metrics: list[Metric] = []
    for f in fields(data):
        if f.number == 1:
            time = 1e-3 * f.whole()
        elif f.number == 2:
            metrics.append(_metric(f.bytes()))
            if len(metrics) > MAX_METRICS:
                raise ProtocolError(f"more than {MAX_METRICS} metrics")
        elif f.number == 3:
            seq = f.whole()
    return Payload(time=time, seq=seq, metrics=tuple(metrics))


def _metric(data: bytes) -> Metric:
    parts: dict[int, Field] = {f.number: f for f in fields(data)}
    kind = parts[4].whole() if 4 in parts else None
    null = 7 in parts and bool(parts[7].whole())
    return Metric(
        name=parts[1].text() if 1 in parts else "",
        alias=parts[2].whole() if 2 in parts else None,
        time=1e-3 * parts[3].whole() if 3 in parts else None,
        type=kind,
        historical=5 in parts and bool(parts[5].whole()),
        value=None if null else _value(parts, kind),
    )


def _value(parts: dict[int, Field], kind: int | None) -> Value:
    for number in (10, 11):
        if number in parts:
            return _signed(parts[number].whole(), kind)
    if 12 in parts:
        return parts[12].float()
    if 13 in parts:
        return next(iter(parts[13].doubles()), None)
    if 14 in parts:
        return bool(parts[14].whole())
    return parts[15].text() if 15 in parts else None


def _signed(value: int, kind: int | None) -> float:
    bits = SIGNED.get(kind or 0)
    if bits is None:
        return float(value)
    value &= (1 << bits) - 1
    return float(value - (1 << bits) if value >> (bits - 1) else value)


def typed(metric: Metric, kind: int | None) -> Value:
    """Value of a metric whose type was told in the birth: a data message need not repeat it."""
    if (
        metric.type is None
        and isinstance(metric.value, float)
        and kind in SIGNED
        and metric.value.is_integer()
    ):
        return _signed(int(metric.value), kind)
    return metric.value


def encode(payload: Payload) -> bytes:
    """The bytes of a payload; whole numbers go as Int64, other numbers as Double."""
    data = whole(1, None if payload.time is None else round(1e3 * payload.time))
    for m in payload.metrics:
        part = message(1, m.name.encode() if m.name else None) + whole(2, m.alias)
        part += whole(3, None if m.time is None else round(1e3 * m.time))
        part += whole(4, m.type) + whole(5, 1 if m.historical else None)
        data += message(2, part + _encoded(m))
    return data + whole(3, payload.seq)


def _encoded(metric: Metric) -> bytes:
    value, kind = metric.value, metric.type
    if value is None:
        return whole(7, 1)
    if isinstance(value, bool):
        return whole(14, int(value))
    if isinstance(value, str):
        return message(15, value.encode())
    if kind in SIGNED:
        bits = SIGNED[kind]
        return whole(10 if bits <= 32 else 11, int(value) & ((1 << max(bits, 32)) - 1))
    if kind == 9:
        return varint(12 << 3 | Wire.FIXED32) + struct.pack("<f", value)
    return double(13, value)


# -- who is alive, and what the numbers mean -----------------------------------------------------


@dataclass(eq=False)
class Node:
    """What is known of one edge node: births, aliases, the newest values, losses."""

    alive: bool = False
    seq: int | None = None
    lost: int = 0
    """Messages that were missed."""
    _born: Value = None
    """Number of the connection that its birth told."""
    _questioned: bool = False
    """Whether the death of another connection was heard: of one before this one, which a broker gives up long
    after it broke. Whether the node lives, its next message says."""
    _known: dict[int, tuple[str, str, int | None]] = field(default_factory=dict)
    """Alias → speaker, name, type."""
    _types: dict[tuple[str, str], int | None] = field(default_factory=dict)
    values: dict[tuple[str, str], tuple[Value, float | None]] = field(default_factory=dict)
    """Speaker and name → value and the device's time [s]."""

    def take(self, where: Topic, payload: Payload) -> bool:
        """Hear a message; whether it could be understood whole.

        Data before the first birth cannot, nor after a gap until the next birth: what was missed may
        have been a birth.
        """
        if where.kind is Kind.NODE_DEATH:
            died = _session(payload)
            self._questioned = self.alive and None not in (died, self._born) and died != self._born
            self.alive = False
            if not self._questioned:
                self.values.clear()
            return True
        if where.kind is Kind.NODE_BIRTH:
            self.alive, self.seq, self._born = True, payload.seq, _session(payload)
            self._questioned = False
            self._known.clear()
            self._types.clear()
            self.values.clear()
        elif not self._follows(payload.seq):
            self.alive = False
            self.values.clear()
            return False
        if where.kind is Kind.DEVICE_DEATH:
            self.values = {key: v for key, v in self.values.items() if key[0] != where.speaker}
            self._known = {alias: told for alias, told in self._known.items() if told[0] != where.speaker}
            return True
        if where.kind in (Kind.NODE_BIRTH, Kind.DEVICE_BIRTH):
            self._learn(where.speaker, payload.metrics)
        return self._hear(where.speaker, payload)

    def _follows(self, seq: int | None) -> bool:
        if self._questioned and seq is not None:
            self.alive, self._questioned = True, False
        if not self.alive:
            return False
        if seq is None:
            return True
        expected = None if self.seq is None else (self.seq + 1) % 256
        self.seq = seq
        if expected is not None and seq != expected:
            self.lost += (seq - expected) % 256
            return False
        return True

    def _learn(self, speaker: str, metrics: tuple[Metric, ...]) -> None:
        for m in metrics:
            if m.name:
                self._types[speaker, m.name] = m.type
                if m.alias is not None:
                    self._known[m.alias] = speaker, m.name, m.type

    def _hear(self, speaker: str, payload: Payload) -> bool:
        understood = True
        for m in payload.metrics:
            if m.historical:
                continue
            name, kind = m.name, self._types.get((speaker, m.name))
            if not name:
                known = self._known.get(-1 if m.alias is None else m.alias)
                if known is None or known[0] != speaker:
                    understood = False
                    continue
                _, name, kind = known
            self.values[speaker, name] = typed(m, kind), m.time if m.time is not None else payload.time
        return understood


def _session(payload: Payload) -> Value:
    """Number of the connection that a birth or death is of; None when it does not say."""
    return next((m.value for m in payload.metrics if m.name == "bdSeq"), None)
