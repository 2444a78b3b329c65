"""Variables of PLCs and machines through OPC UA: subscribed, so that a value stands until it changes."""

from __future__ import annotations

from collections.abc import AsyncGenerator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar

import msgspec
from msgspec import Meta

from seerob.core.errors import InputError, Problem
from seerob.core.extras import need
from seerob.core.quantities import Seconds
from seerob.core.snapshot import Finding
from seerob.devices.variables.access import missing
from seerob.devices.variables.live_source import LONGEST_PULSE, PULSES, Change, Node, Shown, VariablesSource
from seerob.protocols import ProtocolError
from seerob.protocols.plc.opcua_client import (
    Changes,
    Security,
    Way,
    address,
    connect,
    find,
    not_pinned,
    said_unit,
    stated_unit,
    write_bool,
    written,
)
from seerob.workstation.source import Opened, Target
from seerob.workstation.variables import Kind, Variable, unit

if TYPE_CHECKING:
    from asyncua.client.client import Client
    from asyncua.common.node import Node as Found

MOST_BROWSED = 5000
DEEPEST = 12


class Opcua(VariablesSource, frozen=True, kw_only=True):
    """Variables of a PLC or machine through OPC UA."""

    loads: ClassVar[tuple[str, ...]] = ("asyncua",)
    by_exception: ClassVar[bool] = True

    url: Annotated[
        str, Meta(pattern=r"^opc\.tcp://[^\s/]+", description="an address such as opc.tcp://192.168.0.1:4840")
    ]
    """``opc.tcp://192.168.0.1:4840``"""
    interval: Seconds = 0.02
    """Publishing interval that is asked for [s]; a server may grant a longer one, and says so."""
    security: Security = Security.NONE
    """How the session is protected: not at all, signed, or signed and encrypted (Basic256Sha256)."""
    certificate: str | None = None
    """Own certificate beside the workstation, which the server must trust; for ``sign`` and ``encrypt``."""
    key: str | None = None
    """Its private key."""
    server_certificate: str | None = None
    """The server's certificate; another one is refused."""
    user: str | None = None
    """Name to log in with; anonymous when not given."""
    password_env: str | None = None
    """Environment variable that holds the password: a workstation file is no place for one."""

    def way(self) -> Way:
        """How to get there."""
        return msgspec.convert(self, Way, from_attributes=True)

    def open(self, folder: Path, target: Target | None) -> Opened:
        """Understand every address, and ask the server for each of them, if it can be reached.

        Raises:
            InputError: With every address that cannot be understood, certificate that is missing, and unit
                that the server states otherwise.
        """
        need(*self.loads)
        where = f"opcua {self.url}"
        problems = missing(where, self, folder)
        for variable in () if target is None else target.variables:
            try:
                address(variable.address)
            except (ValueError, msgspec.ValidationError) as error:
                problems.append(Problem(where, f"{variable.name}.address", str(error)))
        if problems:
            raise InputError(problems)
        return VariablesSource.open(self.beside(folder), folder, target)

    def sampling_gap(self) -> float:
        """The server keeps the newest value of each interval."""
        return self.interval

    def times(self, variable: Variable) -> bool:
        """The server is asked whether it has said everything."""
        return True

    def stamps(self, variable: Variable) -> bool:
        """SourceTimestamp, which servers give with nearly every value."""
        return True

    async def ask(self) -> tuple[Finding, ...]:
        """Connect once."""
        async with connect(self.way(), Path()) as client:
            changes = Changes()
            await changes.watch(client, {}, self.interval)
            text = f"variables subscribed at {self.url}, every {1e3 * (changes.revised or 0):.0f} ms at most"
            name = self.name or "opcua"
            return (Finding(level="note", subject=name, text=text), *not_pinned(self.way(), client, name))

    async def changes(
        self, variables: tuple[Variable, ...], folder: Path
    ) -> AsyncGenerator[tuple[Change | Shown, ...], None]:
        """What the server says, as it changes; first why some cannot be had."""
        async with connect(self.way(), folder) as client:
            nodes: dict[str, Found] = {}
            lost: dict[str, str] = {}
            for variable in variables:
                try:
                    node = await find(client, address(variable.address))
                    if wrong := await _disagreement(variable, node):
                        lost[variable.name] = wrong
                    else:
                        nodes[variable.name] = node
                except ProtocolError as error:
                    lost[variable.name] = str(error)
            changes = Changes()
            lost |= await changes.watch(client, nodes, self.interval)
            yield tuple(Change(name, None, invalid_reason=why) for name, why in lost.items())
            within = min([self.timeout / PULSES, *(v.timeout / PULSES for v in variables), LONGEST_PULSE])
            async for changed, shown in changes.heard(client, within):
                yield (
                    Shown(shown),
                    # A value that stands is as new as the newest answer, however long ago it changed.
                    *(
                        Change(name, found.value, invalid_reason=found.invalid_reason, stamp=found.stamp)
                        for name, found in changed.items()
                    ),
                )

    async def write(self, variable: Variable, raw: bool, folder: Path) -> None:
        """Write one bool; called by `seerob.session.writing` alone."""
        async with connect(self.way(), folder) as client:
            await write_bool(await find(client, address(variable.address)), raw)

    async def browse(self) -> AsyncGenerator[Node, None]:
        """The variables below Objects, without the server's own, by addresses that last."""
        from asyncua import ua

        async with connect(self.way(), Path()) as client:
            uris = await client.get_namespace_array()
            waiting = [(client.nodes.objects, 0)]
            seen: set[object] = set()
            while waiting and len(seen) < MOST_BROWSED:
                node, depth = waiting.pop()
                for child in await node.get_children():
                    if child.nodeid in seen or child.nodeid == client.nodes.server.nodeid:
                        continue
                    seen.add(child.nodeid)
                    if depth < DEEPEST:
                        waiting.append((child, depth + 1))
                    own = child.nodeid.NamespaceIndex == 0
                    if not own and await child.read_node_class() == ua.NodeClass.Variable:
                        yield await _described(client, child, uris)


async def _disagreement(variable: Variable, node: Found) -> str:
    """Why a variable is not what the dictionary says; empty when nothing speaks against it."""
    if variable.type is not Kind.NUMBER or variable.unit is None:
        return ""
    said = await said_unit(node)
    stated, given = unit(said), unit(variable.unit)
    if not said or stated == given:
        return ""
    # With a scale or an offset the user has said what the raw numbers are; not of another quantity, though.
    scaled = variable.scale != 1 or variable.offset != 0
    if scaled and (stated is None or given is None or stated.si == given.si):
        return ""
    return f"the server states the unit {said}, the dictionary {variable.unit}"


async def _described(client: Client, node: Found, uris: list[str]) -> Node:
    from asyncua.ua.uaerrors import UaError

    number = node.nodeid.NamespaceIndex
    place = written(node.nodeid, uris[number] if number else "")
    kind, value = "", ""
    try:
        kind = (await node.read_data_type_as_variant_type()).name
        value = str(await node.read_value())[:40]
    except UaError:
        pass  # not readable for us: it is named all the same
    return Node(place, kind, await stated_unit(node), value)
