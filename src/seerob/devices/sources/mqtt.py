"""Machines that publish through an MQTT broker: plain values, JSON documents, and Sparkplug B."""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncGenerator, Iterator
from contextlib import aclosing, asynccontextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar

import msgspec
from msgspec import Meta

from seerob.core.errors import InputError, Problem, SeerobError
from seerob.core.extras import need
from seerob.core.snapshot import Finding
from seerob.devices.variables.access import missing_access
from seerob.devices.variables.json_values import value_and_time
from seerob.devices.variables.live_source import BEAT, LONGEST_PULSE, PULSES, Change, Node, VariablesSource
from seerob.files.tables.mapping import toml_value
from seerob.protocols import NotLetIn, ProtocolError
from seerob.protocols.links.credentials import Server, secret, trusting
from seerob.protocols.links.json_pointer import document, parts
from seerob.protocols.plc import sparkplug
from seerob.workstation.source import Opened, Target
from seerob.workstation.variables import Variable

if TYPE_CHECKING:
    import aiomqtt


LISTEN = 3.0
"""How long `browse` listens [s]."""
KEEP_ALIVE = 5
"""[s]"""
PATIENCE = 2.0
"""With the broker's answers [s]."""
WAITING = 4096
"""Messages that wait to be read."""


class Plain(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A topic whose payload is a value or a JSON document."""

    topic: Annotated[
        str,
        Meta(min_length=1, max_length=500, pattern=r"^[^#+\x00]+$", description="a topic without # and +"),
    ]
    pointer: str = ""
    """JSON pointer to the value; the whole payload when not given."""
    time: str | None = None
    """JSON pointer to when it was so: seconds or milliseconds since 1970, or an ISO 8601 text."""

    def __post_init__(self) -> None:
        parts(self.pointer)
        parts(self.time or "")


class Metric(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A metric of a Sparkplug B node or device."""

    node: Annotated[str, Meta(pattern=r"^[^/#+]+/[^/#+]+$", description='"group/edge node"')]
    """``group/node``."""
    metric: str
    device: Annotated[str, Meta(pattern=r"^[^/#+]*$", description="a name without /, # and +")] = ""

    @property
    def speaker(self) -> str:
        """``group/node`` or ``group/node/device``."""
        return f"{self.node}/{self.device}" if self.device else self.node


Address = Plain | Metric


def address(variable: Variable) -> Address:
    """Where a variable is published.

    Raises:
        ValueError: It cannot be understood.
    """
    raw = variable.address
    if isinstance(raw, str):
        raw = {"topic": raw}
    if not isinstance(raw, dict):
        raise ValueError('write "a/topic", { topic = …, pointer = … } or { node = …, metric = … }')
    if "metric" in raw or "node" in raw:
        return msgspec.convert(raw, Metric)
    return msgspec.convert(raw, Plain)


def plain_change(name: str, where: Plain, payload: bytes, *, retained: bool, now: float) -> Change:
    """What a payload says of a variable.

    Args:
        name: The variable.
        where: Its address.
        payload: As it was published.
        retained: Whether the broker had kept it from before.
        now: Wall clock [s since 1970].
    """
    try:
        try:
            value = document(payload)
        except ProtocolError:
            if where.pointer or where.time:
                raise
            value = payload.decode("utf-8", "replace")
        raw, age, stamp = value_and_time(value, where.pointer, where.time, now=now)
        if where.time is not None:
            return Change(name, raw, age=age, stamp=stamp)
    except (ProtocolError, ValueError) as error:
        return Change(name, None, invalid_reason=f"{where.topic}: {error}")
    except KeyError as error:
        return Change(name, None, invalid_reason=f"{where.topic}: the payload has no {error.args[0]!r}")
    if retained:
        return Change(
            name, raw, invalid_reason=f"{where.topic}: kept by the broker, nobody says how old it is"
        )
    return Change(name, raw)


class Mqtt(VariablesSource, frozen=True, kw_only=True):
    """Variables of machines that publish through an MQTT broker."""

    loads: ClassVar[tuple[str, ...]] = ("aiomqtt",)
    by_exception: ClassVar[bool] = False

    host: str
    """Name or address of the broker."""
    port: Annotated[int, Meta(ge=1, le=65535)] = 1883
    """8883 is usual with TLS."""
    tls: bool = False
    """Encrypted, and the broker's certificate is checked."""
    ca: str | None = None
    """Certificates that are trusted instead of the system's, a PEM file beside the workstation."""
    user: str | None = None
    """Name to log in with at the broker; none when not given."""
    password_env: str | None = None
    """Environment variable that holds the password: a workstation file is no place for one."""

    @property
    def _server(self) -> Server:
        return Server(self.host, self.port, self.tls)

    def open(self, folder: Path, target: Target | None) -> Opened:
        """Understand every address, and look whether the broker is there.

        Raises:
            InputError: With every address that cannot be understood; or no password where one is named.
        """
        problems = []
        for variable in () if target is None else target.variables:
            try:
                where = address(variable)
                if variable.write and not (isinstance(where, Plain) and where == Plain(where.topic)):
                    raise ValueError('a trigger is true or false on a topic of its own: write "a/topic"')
            except (ValueError, msgspec.ValidationError) as error:
                problems.append(Problem(f"mqtt {self.host}", f"{variable.name}.address", str(error)))
        problems += missing_access(self, folder, where=f"mqtt {self.host}", server=self._server)
        if problems:
            raise InputError(problems)
        return VariablesSource.open(self.beside(folder), folder, target)

    def times(self, variable: Variable) -> bool:
        """Its payload says when it was so; the broker only knows when it came."""
        where = address(variable)
        return isinstance(where, Plain) and where.time is not None

    def stamps(self, variable: Variable) -> bool:
        """A metric of Sparkplug has a time, and a payload whose ``time`` is given."""
        where = address(variable)
        return isinstance(where, Metric) or where.time is not None

    async def ask(self) -> tuple[Finding, ...]:
        """Connect once."""
        async with self._client():
            text = f"variables heard through the MQTT broker {self.host}:{self.port}"
            return (Finding(level="note", subject=self.name or "mqtt", text=text),)

    async def changes(
        self, variables: tuple[Variable, ...], folder: Path
    ) -> AsyncGenerator[tuple[Change, ...], None]:
        """What is published, each message as it comes; Sparkplug values again and again while alive."""
        wanted = {v.name: address(v) for v in variables}
        plain: dict[str, list[tuple[str, Plain]]] = {}
        metrics: dict[str, sparkplug.Node] = {}
        for name, where in wanted.items():
            if isinstance(where, Plain):
                plain.setdefault(where.topic, []).append((name, where))
            else:
                metrics[where.node] = sparkplug.Node()
        async with self._client(folder) as client, aclosing(_messages(client)) as messages:
            for text in (*plain, *(t for node in metrics for t in _topics(node))):
                await client.subscribe(text, qos=0, timeout=PATIENCE)
            yield _standing(wanted, metrics)
            within = min([self.timeout / PULSES, *(v.timeout / PULSES for v in variables), LONGEST_PULSE])
            async with aclosing(Pulse(client, within)) as pulse:
                async for message in messages:
                    if not pulse.shown(spoke=message is not None):
                        continue
                    if message is not None and (topic := str(message.topic)) in plain:
                        payload, now = _bytes(message.payload), time.time()
                        yield tuple(
                            plain_change(name, where, payload, retained=bool(message.retain), now=now)
                            for name, where in plain[topic]
                        )
                        continue
                    if message is not None:
                        _hear(metrics, str(message.topic), _bytes(message.payload))
                    yield _standing(wanted, metrics)

    async def write(self, variable: Variable, raw: bool, folder: Path) -> None:
        """Publish ``true`` or ``false``; called by `seerob.session.writing` alone."""
        where = address(variable)
        if not isinstance(where, Plain):
            raise ProtocolError("a metric of Sparkplug is not written")
        async with self._client(folder) as client:
            await client.publish(where.topic, str(raw).lower(), qos=1, timeout=PATIENCE)

    async def browse(self) -> AsyncGenerator[Node, None]:
        """What is published within three seconds, Sparkplug births by their metrics."""
        async with self._client() as client, aclosing(_messages(client)) as messages:
            await client.subscribe("#", qos=0, timeout=PATIENCE)
            end, seen = time.monotonic() + LISTEN, set()
            async for message in messages:
                if time.monotonic() > end:
                    return
                for node in () if message is None else _nodes(str(message.topic), _bytes(message.payload)):
                    if node.address not in seen:
                        seen.add(node.address)
                        yield node

    @asynccontextmanager
    async def _client(self, folder: Path = Path()) -> AsyncGenerator[aiomqtt.Client, None]:
        need("aiomqtt")
        import aiomqtt
        from aiomqtt.exceptions import MqttConnectError

        name = self.password_env
        password = None if name is None else secret("password_env", name, self._server)
        trusted = None if self.ca is None else folder / self.ca
        context = trusting(trusted, server=f"{self.host}:{self.port}") if self.tls else None
        client = aiomqtt.Client(
            self.host,
            self.port,
            username=self.user,
            password=password,
            keepalive=KEEP_ALIVE,
            timeout=PATIENCE,
            tls_context=context,
            max_queued_incoming_messages=WAITING,
        )
        try:
            async with known_end(client), client:
                yield client
        except MqttConnectError as error:
            raise NotLetIn(f"the broker refuses: {str(error).partition('] ')[2] or error}") from error
        except aiomqtt.MqttError as error:
            raise ConnectionError(str(error).partition("] ")[2] or str(error)) from error


def _topics(node: str) -> tuple[str, ...]:
    group, edge = node.split("/")
    return f"{sparkplug.NAMESPACE}/{group}/+/{edge}", f"{sparkplug.NAMESPACE}/{group}/+/{edge}/+"


def _bytes(payload: object) -> bytes:
    return payload if isinstance(payload, bytes) else str("" if payload is None else payload).encode()


async def _messages(client: aiomqtt.Client) -> AsyncGenerator[aiomqtt.Message | None, None]:
    """Messages as they come, and None every `BEAT` in which there is none."""
    messages = aiter(client.messages)
    waiting: asyncio.Task[aiomqtt.Message] | None = None
    try:
        while True:
            waiting = waiting or asyncio.ensure_future(anext(messages))
            done, _ = await asyncio.wait({waiting}, timeout=BEAT)
            if done:
                heard, waiting = waiting, None
                yield heard.result()
            else:
                yield None
    finally:
        if waiting is not None:
            waiting.cancel()
            await asyncio.gather(waiting, return_exceptions=True)


def _hear(nodes: dict[str, sparkplug.Node], topic: str, payload: bytes) -> None:
    where = sparkplug.topic(topic)
    if where is None:
        return
    node = nodes.get(f"{where.group}/{where.node}")
    if node is not None:
        try:
            node.take(where, sparkplug.decode(payload))
        except SeerobError:
            # Whatever it was, the count has a gap now: nothing stands until the next birth.
            node.alive = False
            node.values.clear()


def _standing(wanted: dict[str, Address], nodes: dict[str, sparkplug.Node]) -> tuple[Change, ...]:
    """What the living nodes last said: it stands until they say another or die."""
    return tuple(
        _metric(name, where, nodes[where.node]) for name, where in wanted.items() if isinstance(where, Metric)
    )


def _metric(name: str, where: Metric, node: sparkplug.Node) -> Change:
    said = node.values.get((where.speaker, where.metric))
    if not node.alive:
        return Change(name, None, invalid_reason=f"{where.node}: not alive, or its birth was not heard")
    if said is None:
        return Change(name, None, invalid_reason=f"{where.speaker}: has no metric {where.metric!r}")
    if said[0] is None:
        return Change(name, None, invalid_reason=f"{where.speaker}: says that {where.metric!r} has no value")
    return Change(name, said[0], stamp=said[1])


def _nodes(topic: str, payload: bytes) -> Iterator[Node]:
    where = sparkplug.topic(topic)
    if where is None:
        # What begins like a table in a dictionary is written as one.
        found = f"{{ topic = {toml_value(topic)} }}" if topic.startswith("{") else topic
        yield Node(found, "", "", payload[:40].decode("utf-8", "replace"))
    elif where.kind in (sparkplug.Kind.NODE_BIRTH, sparkplug.Kind.DEVICE_BIRTH):
        try:
            metrics = sparkplug.decode(payload).metrics
        except ProtocolError:
            return  # one who speaks nonsense does not hide the others
        device = f", device = {toml_value(where.device)}" if where.device else ""
        whose = f"node = {toml_value(f'{where.group}/{where.node}')}{device}"
        for m in metrics:
            found = f"{{ {whose}, metric = {toml_value(m.name)} }}"
            yield Node(found, str(m.type), "", str(m.value)[:40])


NOTHING = "seerob/is-the-broker-there"
"""A topic that nobody subscribes."""


class Pulse:
    """Whether a broker has sent something of late, or answers when it is asked.

    MQTT's own ping takes seconds, and a message that is not published is none. A topic that nobody has
    subscribed is unsubscribed: a broker confirms that all the same (MQTT 3.1.1, 3.10.4), and nothing
    follows from it.

    Args:
        client: Connected.
        within: How long ago that may be [s].
    """

    def __init__(self, client: aiomqtt.Client, within: float) -> None:
        self._client, self._within = client, within
        self._shown = time.monotonic()
        self._asking: asyncio.Task[None] | None = None

    def shown(self, *, spoke: bool) -> bool:
        """Whether it was there within that time.

        Args:
            spoke: It has just sent something.

        Raises:
            ConnectionError: It does not answer.
        """
        now = time.monotonic()
        if spoke:
            self._shown = now
        if self._asking is not None and self._asking.done():
            error, self._asking = self._asking.exception(), None
            if error is not None:
                raise ConnectionError(f"the broker does not answer: {error}")
        if self._asking is None and now - self._shown > self._within / 2:
            self._asking = asyncio.create_task(self._ask(now))
        return now - self._shown <= self._within

    async def aclose(self) -> None:
        """Ask no more."""
        if self._asking is not None:
            self._asking.cancel()
            await asyncio.gather(self._asking, return_exceptions=True)

    async def _ask(self, asked: float) -> None:
        await self._client.unsubscribe(NOTHING, timeout=PATIENCE)
        self._shown = max(self._shown, asked)


@asynccontextmanager
async def known_end(client: aiomqtt.Client) -> AsyncGenerator[None, None]:
    """Take note why connections end: asyncio logs what nobody has asked for.

    aiomqtt keeps the reason in a future, and begins another when the broker leaves while it connects.
    """
    futures = [getattr(client, "_disconnected", None)]
    try:
        yield
    finally:
        futures.append(getattr(client, "_disconnected", None))
        for future in futures:
            if isinstance(future, asyncio.Future) and future.done() and not future.cancelled():
                future.exception()
