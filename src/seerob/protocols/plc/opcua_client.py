"""An OPC UA client that only reads: sessions, nodes by names that last, and changes, the newest of each.

Namespaces are meant by their URI and resolved at every connection: their numbers may change when a server
restarts. The socket below a session, which asyncua leaves open when it is cancelled or the link breaks, is
closed here, and cancellations are made those that asyncio knows.

Units of OPC UA's EngineeringUnits, which are UNECE Recommendation 20 codes written as numbers.
"""

from __future__ import annotations

import asyncio
import base64
import binascii
import logging
import re
import socket
import time
import traceback
from collections.abc import AsyncGenerator, Iterator, Mapping
from contextlib import asynccontextmanager, contextmanager, suppress
from datetime import UTC, datetime
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple
from uuid import UUID

import msgspec
from msgspec import Meta

from seerob.core.errors import SeerobError
from seerob.core.extras import need
from seerob.core.snapshot import Finding
from seerob.protocols import NotLetIn, ProtocolError
from seerob.protocols.links.credentials import Server, secret, server_of
from seerob.protocols.plc.opcua_security import (
    Endpoint,
    certificate,
    chosen,
    endpoint,
    why_another,
    why_refused,
)

if TYPE_CHECKING:
    from asyncua.client.client import Client
    from asyncua.client.ua_client import UASocketProtocol
    from asyncua.common.node import Node
    from asyncua.common.subscription import DataChangeNotif
    from asyncua.ua import NodeId, QualifiedName


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


@contextmanager
def plainly_cancelled() -> Iterator[None]:
    """Pass on any cancellation as `asyncio.CancelledError` itself.

    In Python 3.11 `asyncio.timeout` takes no other for its own. wait_for2, which asyncua waits with, raises a
    subclass where an answer comes together with the cancellation: no time-out would follow, and the program
    would end.
    """
    try:
        yield
    except asyncio.CancelledError as error:
        if type(error) is asyncio.CancelledError:
            raise
        raise asyncio.CancelledError(*error.args) from error


def hang_up(link: UASocketProtocol | None) -> None:
    """Close the socket of a link, if there is one; the loop does it next.

    Args:
        link: ``client.uaclient.protocol`` of asyncua; None before there was one.
    """
    if link is not None and link.transport is not None:
        link.transport.close()


@contextmanager
def hung_up_on_failure(client: Client) -> Iterator[None]:
    """Leave no socket open when connecting fails, or is cancelled."""
    try:
        yield
    except BaseException:
        hang_up(client.uaclient.protocol)
        raise


PATIENCE = 2.0
"""With each answer [s]."""
SESSION = 60_000
"""Time-out of a session [ms]: some servers lose shorter ones in storms."""
BEAT = 0.5
"""A server of which nothing was heard is asked so often whether it is there [s]."""
SILENT = ("asyncua", "asyncua.client.ua_client", "asyncua.common.subscription")


STATE, CLOCK = 2259, 2258
"""Numbers of State and CurrentTime of Server_ServerStatus, which every server has (OPC 10000-6, NodeIds)."""
RUNNING = 0
"""Of ServerState (OPC 10000-5, 12.6)."""
CLOCK_STANDS = 3.0
"""A server whose own clock stands for so long hangs [s]: some set it once a second."""


class Security(StrEnum):
    """How a session is protected."""

    NONE = "none"
    SIGN = "sign"
    ENCRYPT = "encrypt"
    """Basic256Sha256, signed and encrypted."""


class Way(msgspec.Struct, frozen=True, kw_only=True):
    """How to get to a server."""

    url: Annotated[
        str, Meta(pattern=r"^opc\.tcp://[^\s/]+", description="an address such as opc.tcp://192.168.0.1:4840")
    ]
    security: Security = Security.NONE
    certificate: str | None = None
    """Own certificate (PEM or DER), which the server must trust."""
    key: str | None = None
    """Its private key (PEM)."""
    server_certificate: str | None = None
    """The server's own; what another shows is refused."""
    user: str | None = None
    password_env: str | None = None
    """Environment variable that holds the password."""


def server(way: Way) -> Server:
    """Who is given the password of a `Way`, or of what has its fields."""
    return server_of(way.url, encrypted=way.security is not Security.NONE)


class NodeValue(NamedTuple):
    """What a server says of one node."""

    value: Any
    invalid_reason: str
    """Its status, when that is not good."""
    age: float
    """By its own stamps [s]."""
    stamp: float | None
    """Source's time [s since 1970]."""


@asynccontextmanager
async def connect(way: Way, folder: Path) -> AsyncGenerator[Client, None]:
    """A session, until the block ends.

    Args:
        way: How to get there.
        folder: Where relative paths of certificates start.

    Raises:
        OSError: There is no connection.
        NotLetIn: The server is there and refuses.
        ProtocolError: It is no such server.
        InputError: asyncua is not installed.
    """
    from asyncua.ua.uaerrors import UaError

    client = _client(way.url)
    if way.user is not None:
        client.set_user(way.user)
        if way.password_env is not None:
            client.set_password(secret("password_env", way.password_env, server(way)))
    try:
        async with asyncio.timeout(3 * PATIENCE):
            with plainly_cancelled(), hung_up_on_failure(client):
                if way.security is not Security.NONE:
                    await _protect(client, way, folder)
                await client.connect()
    except TimeoutError as error:
        raise TimeoutError("no answer in time") from error
    except SeerobError:
        raise
    except Exception as error:
        if not isinstance(error, OSError) or client.uaclient.protocol is not None:  # somebody is there
            await _refused(error, way, folder)
        if isinstance(error, UaError):
            raise ProtocolError(f"the server refuses: {_text(error)}") from error
        if isinstance(error, ValueError):
            raise ProtocolError(str(error)) from error
        _refuse_garbled(error)
        raise
    link = client.uaclient.protocol
    try:
        with plainly_cancelled():
            yield client
    except UaError as error:
        raise ProtocolError(f"the server says: {_text(error)}") from error
    except Exception as error:
        _refuse_garbled(error)
        raise
    finally:
        # Whatever is left to be said, a stop does not wait long for it.
        with suppress(Exception):
            async with asyncio.timeout(PATIENCE / 2):
                with plainly_cancelled():
                    await client.disconnect()
        # A link that broke while it was closed counts as closed there, and its socket stays open.
        hang_up(link)
        await asyncio.sleep(0)


def _client(url: str) -> Client:
    """A client of asyncua that says who it is, and is silent about the rest.

    Raises:
        InputError: asyncua is not installed.
    """
    need("asyncua")
    from asyncua.client.client import Client

    for name in SILENT:
        logging.getLogger(name).setLevel(logging.CRITICAL)
    client = Client(url, timeout=PATIENCE)
    client.session_timeout = SESSION
    client.name = client.description = "seerob"
    client.application_uri = own_uri()
    return client


def own_uri() -> str:
    """What this application calls itself where no certificate says it."""
    return f"urn:{socket.gethostname()}:seerob"


async def endpoints(url: str) -> tuple[Endpoint, ...]:
    """What a server offers to whoever asks.

    Raises:
        OSError: There is no connection.
        ProtocolError: It is no such server, or does not say.
    """
    client = _client(url)
    try:
        async with asyncio.timeout(2 * PATIENCE):
            with plainly_cancelled(), hung_up_on_failure(client):
                said = await client.connect_and_get_server_endpoints()
    except (OSError, SeerobError):
        raise
    except Exception as error:
        raise ProtocolError(f"it does not say what it offers: {_text(error)}") from error
    finally:
        hang_up(client.uaclient.protocol)
    return tuple(map(endpoint, said))


async def _refused(error: Exception, way: Way, folder: Path) -> None:
    """Raise why the server lets nobody in, where what it offers, and what it was given, tell.

    Raises:
        NotLetIn: With what would be right.
    """
    try:
        offered = await endpoints(way.url)
    except (OSError, SeerobError):
        return
    own = None
    if way.certificate is not None and way.security is not Security.NONE:
        own = certificate((folder / way.certificate).read_bytes())
    said = f"{type(error).__name__}: {_text(error)}"
    if isinstance(error, OSError | AssertionError):
        said = ""  # it only ended the connection, which is no word
    why = why_another(offered, way.security.value) or why_refused(
        offered, way.security.value, error=said, own=own, user=way.user
    )
    if why:
        raise NotLetIn(why) from error


def not_pinned(way: Way, client: Client, subject: str) -> tuple[Finding, ...]:
    """What is believed of a server whose certificate nobody gave, while a session is protected."""
    if way.security is Security.NONE or way.server_certificate is not None:
        return ()
    shown = client.security_policy.peer_certificate
    who = f": {certificate(shown)}" if shown else ""
    text = f"whoever answers at {way.url} is believed{who}; give server_certificate, so that no other is"
    return (Finding(level="assumed", subject=subject, text=text),)


def _refuse_garbled(error: Exception) -> None:
    """Raise a ProtocolError for bytes on which asyncua failed: they are the server's mistake, not ours."""
    if isinstance(error, OSError | SeerobError):
        return
    frames = (frame.f_globals.get("__name__", "") for frame, _ in traceback.walk_tb(error.__traceback__))
    if any(name.startswith("asyncua.") for name in frames):
        what = f"{type(error).__name__}: {_text(error)[:100]}"
        raise ProtocolError(f"what the server says is no OPC UA ({what})") from error


async def _protect(client: Client, way: Way, folder: Path) -> None:
    from asyncua import ua
    from asyncua.crypto.security_policies import SecurityPolicyBasic256Sha256
    from asyncua.crypto.uacrypto import CertProperties

    encrypt = ua.MessageSecurityMode.SignAndEncrypt
    mode = encrypt if way.security is Security.ENCRYPT else ua.MessageSecurityMode.Sign
    if way.certificate is None or way.key is None:
        raise ProtocolError("a protected session needs certificate and key")
    own = certificate((folder / way.certificate).read_bytes())
    client.application_uri = own.uris[0] if own.uris else own_uri()
    # Some servers do not answer at all who encrypts for another: what they offer is asked before.
    offered = await endpoints(way.url)
    shown = chosen(offered, way.security.value)
    pinned = None if way.server_certificate is None else folder / way.server_certificate
    meant = None if pinned is None else certificate(pinned.read_bytes())
    if why := why_another(offered, way.security.value, meant):
        raise NotLetIn(why)
    assert shown is not None
    server = CertProperties(path_or_content=shown.certificate, extension="der")
    await client.set_security(
        SecurityPolicyBasic256Sha256,
        certificate=content(folder / way.certificate),
        private_key=content(folder / way.key),
        server_certificate=server if pinned is None else content(pinned),
        mode=mode,
    )


def content(path: Path) -> Any:
    """A certificate or key, PEM or DER by what is in it: asyncua goes by the end of the name."""
    from asyncua.crypto.uacrypto import CertProperties

    data = path.read_bytes()
    return CertProperties(path_or_content=data, extension="pem" if data.startswith(b"-----") else "der")


async def find(client: Client, where: str | Address) -> Node:
    """The node of an address.

    Raises:
        ProtocolError: The server has no such namespace or node.
    """
    from asyncua.ua.uaerrors import UaError

    try:
        if isinstance(where, str):
            return client.get_node(await _node_id(client, where))
        names = [await _browse_name(client, name) for name in where.browse]
        return await client.nodes.objects.get_child(names)
    except (UaError, ValueError) as error:
        raise ProtocolError(
            f"no node {where if isinstance(where, str) else '/'.join(where.browse)}: {_text(error)}"
        ) from error


async def _node_id(client: Client, text: str) -> NodeId:
    name = node_name(text)
    return name.node_id(await _namespace(client, name.uri) if name.uri else name.number)


async def _browse_name(client: Client, text: str) -> QualifiedName:
    from asyncua import ua

    uri, name = browse_name(text)
    return ua.QualifiedName(name, ua.Int16(await _namespace(client, uri) if uri else 0))


async def _namespace(client: Client, uri: str) -> int:
    try:
        return int(await client.get_namespace_index(uri))
    except ValueError:
        raise ProtocolError(f"the server has no namespace {uri!r}") from None


async def stated_unit(node: Node) -> str:
    """Unit that the server states for a variable, as the dictionary spells it; empty when it does not."""
    from asyncua.ua.uaerrors import UaError

    try:
        found = await (await node.get_child("0:EngineeringUnits")).read_value()
    except (UaError, ValueError):
        return ""
    return unit(getattr(found, "UnitId", 0) or 0)


async def said_unit(node: Node) -> str:
    """Unit of a variable as the dictionary spells it, or else in the server's words; empty without one."""
    from asyncua.ua.uaerrors import UaError

    try:
        found = await (await node.get_child("0:EngineeringUnits")).read_value()
    except (UaError, ValueError):
        return ""
    number = getattr(found, "UnitId", 0) or 0
    shown = getattr(getattr(found, "DisplayName", None), "Text", None)
    return unit(number) or str(shown or "")[:40] or (f"number {number}" if number else "")


async def write_bool(node: Node, value: bool) -> None:
    """Write a bool to a node that is one.

    Raises:
        ProtocolError: It is no bool, or the server refuses.
    """
    from asyncua import ua
    from asyncua.ua.uaerrors import UaError

    try:
        kind = await node.read_data_type_as_variant_type()
        if kind is not ua.VariantType.Boolean:
            raise ProtocolError(f"a {kind.name}: only a Boolean is written")
        # Without stamps: many controllers refuse a writing that brings its own.
        await node.write_value(ua.DataValue(ua.Variant(value, ua.VariantType.Boolean)))
    except UaError as error:
        raise ProtocolError(f"the server refuses: {_text(error)}") from error


class Changes:
    """Changes of nodes as they come: of each node only the newest waits."""

    def __init__(self) -> None:
        self._waiting: dict[str, NodeValue] = {}
        self._names: dict[Any, list[str]] = {}
        self._arrived = asyncio.Event()
        self.revised: float | None = None
        """Publishing interval that the server grants [s]."""
        self._watched = time.monotonic()
        self._clock: tuple[object, float] = None, 0.0
        """What the server's clock said, and when it began to say that: host's monotonic time [s]."""
        self._hangs = False
        """Whether it answers, and does not run."""
        """When it was asked to be told."""

    async def watch(self, client: Client, nodes: Mapping[str, Node], interval: float) -> dict[str, str]:
        """Subscribe to nodes by name; returns why some cannot be watched.

        Raises:
            OSError: The connection is gone.
        """
        from asyncua.ua.uaerrors import UaError

        self._names, self._watched = {}, time.monotonic()
        for name, node in nodes.items():
            self._names.setdefault(node.nodeid, []).append(name)
        subscription = await client.create_subscription(1e3 * interval, self)
        self.revised = 1e-3 * float(subscription.parameters.RequestedPublishingInterval)
        refused: dict[str, str] = {}
        sampling: Any = 1e3 * interval
        for names in self._names.values():
            node = nodes[names[0]]
            try:
                await subscription.subscribe_data_change(node, queuesize=1, sampling_interval=sampling)
            except UaError as error:
                refused |= dict.fromkeys(names, _text(error))
        return refused

    def datachange_notification(self, node: Node, value: object, data: DataChangeNotif) -> None:
        """Called by asyncua, in the loop."""
        for name in self._names.get(node.nodeid, ()):
            self._waiting[name] = said(data.monitored_item.Value)
            self._arrived.set()

    async def heard(
        self, client: Client, pulse: float = BEAT
    ) -> AsyncGenerator[tuple[dict[str, NodeValue], float], None]:
        """What has changed, if anything, and until when the server has said everything that it had to say.

        The server is asked again and again whether it is there. Its answer comes after what it said before
        it was asked: who is told of changes alone would not see that they come late.

        Args:
            client: Connected, and watching.
            pulse: Between two questions, at least [s].

        Yields:
            Changes by name; when the newest question was asked that was answered, host's monotonic time [s].

        Raises:
            OSError: The connection is gone, or the server does not answer.
        """
        shown, asked = self._watched, 0.0
        asking: asyncio.Task[None] | None = None
        try:
            while True:
                changed, self._waiting = self._waiting, {}
                self._arrived.clear()
                yield changed, shown
                while not self._arrived.is_set():
                    left = asked + pulse - time.monotonic()
                    if asking is None and left <= 0:
                        asked = time.monotonic()
                        asking = asyncio.create_task(self._ask(client))
                    with suppress(TimeoutError):
                        async with asyncio.timeout(left if asking is None else None):
                            await self._arrived.wait()
                if asking is not None and asking.done():
                    asking.result()
                    # Of one that answers and does not run, what it said grows old; over a new connection not.
                    asking, shown = None, shown if self._hangs else asked
        finally:
            if asking is not None:
                asking.cancel()
                await asyncio.gather(asking, return_exceptions=True)

    async def _ask(self, client: Client) -> None:
        """Whether the server is there, and runs."""
        from asyncua import ua

        try:
            await client.check_connection()
            nodes = [client.get_node(ua.NodeId(ua.Int32(number))) for number in (STATE, CLOCK)]
            state, now = await client.read_values(nodes)
            if now is None or now != self._clock[0]:
                self._clock = now, time.monotonic()
            stands = time.monotonic() - self._clock[1] > CLOCK_STANDS
            self._hangs = stands or (isinstance(state, int) and state != RUNNING)
        finally:
            self._arrived.set()


def said(value: Any) -> NodeValue:
    """What a data value says."""
    status = value.StatusCode
    invalid_reason = "" if status is None or status.is_good() else f"the server says {status.name}"
    stamp = _seconds(value.SourceTimestamp)
    # Of two clocks that differ nothing is known; what lies ahead is as new as can be.
    return NodeValue(
        value.Value.Value, invalid_reason, 0.0 if stamp is None else max(0.0, time.time() - stamp), stamp
    )


def _seconds(stamp: datetime | None) -> float | None:
    if stamp is None or stamp.year < 1990:
        return None
    return (stamp if stamp.tzinfo else stamp.replace(tzinfo=UTC)).timestamp()


def _text(error: BaseException) -> str:
    return str(error).split("(", 1)[0].strip()[:200] or type(error).__name__
