"""All connected pages: each message is encoded once and offered to every one of them."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Collection
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version
from math import inf, isfinite
from typing import Any

import msgspec
from msgspec.structs import replace
from starlette.websockets import WebSocket, WebSocketDisconnect

from seerob.app.server.access import Role, Visit, Visits
from seerob.app.server.allowance import Allowance
from seerob.app.server.client import Client, Closing
from seerob.app.server.company import Company
from seerob.app.server.desk import Desk
from seerob.app.server.feed import KNOWN_ACTIONS, Feed
from seerob.app.server.registrar import Registrar
from seerob.app.wire import schema
from seerob.core.errors import SeerobError
from seerob.core.markers import plain
from seerob.core.snapshot import (
    PROTOCOL,
    Command,
    Edit,
    Edited,
    Grab,
    Hello,
    History,
    Hold,
    Introduction,
    Measure,
    Measured,
    Mistake,
    Presence,
    Pull,
    Reach,
    Refused,
    Register,
    Registered,
    Scene,
    Snapshot,
    SoFar,
    Tracked,
    Tracking,
    Transport,
    VisitorInfo,
    VisitorPresence,
)
from seerob.devices.live import headset_offers
from seerob.devices.live.headset_offers import Offers
from seerob.session.measuring import Ruler

_log = logging.getLogger(__name__)
MOST_CLIENTS = 64
PATIENCE = 10.0
"""How long a page may leave a frame waiting [s]."""

_encode = msgspec.msgpack.Encoder(enc_hook=plain).encode
Message = (
    Command | Tracking | Register | Edit | Measure | Reach | Introduction | Presence | Hold | Grab | Pull
)
"""Of a page."""
_KINDS: dict[type, str] = {
    Tracking: "tracking",
    Measure: "measure",
    Reach: "measure",
    Presence: "presence",
    Introduction: "introduction",
    Hold: "introduction",
    Grab: "doing",
    Pull: "doing",
}
_decode: Callable[[bytes], Message] = msgspec.msgpack.Decoder(Message).decode
LARGEST_COMMAND = 512
"""[B]; one has less than 100."""
RATES: dict[str, tuple[float, float]] = {
    "ack": (120.0, 240.0),
    "tracking": (160.0, 320.0),
    "command": (40.0, 80.0),
    "edit": (10.0, 20.0),
    "measure": (10.0, 20.0),
    "presence": (60.0, 120.0),
    "introduction": (5.0, 20.0),
    "doing": (60.0, 120.0),
}
"""What one page may send: per second, and at once. Beyond that it is read no faster."""
LARGEST: dict[Role, int] = {Role.VIEW: 4096, Role.TRACK: 16384, Role.CONTROL: 16384}
"""Of a message [B], by what a visitor may: a presence has 2000, what a headset sees of a body 10 000."""
SHARED: dict[str, tuple[float, float]] = {
    "tracking": (640.0, 1280.0),
    "command": (100.0, 200.0),
    "edit": (20.0, 40.0),
    "measure": (20.0, 40.0),
    "presence": (1920.0, 3840.0),
    "introduction": (40.0, 200.0),
    "doing": (240.0, 480.0),
}
"""What all pages together may send."""


def read_message(data: bytes) -> Message:
    """Decode what a page sent.

    Raises:
        ValueError: It is no message of a page, an unknown command, or a value is missing or not finite.
    """
    try:
        command = _decode(data)
    except (msgspec.MsgspecError, RecursionError, UnicodeDecodeError) as error:
        raise ValueError(f"not a command: {error}") from None
    if isinstance(command, Measure | Reach) and not isfinite(command.t or 0.0):
        raise ValueError("measure needs a finite instant")
    if not isinstance(command, Command):
        return command
    if len(data) > LARGEST_COMMAND:
        raise ValueError(f"a command of {len(data)} bytes")
    if command.action not in KNOWN_ACTIONS | {"ack"}:
        raise ValueError("unknown action")
    if command.action not in ("play", "pause") and (command.value is None or not isfinite(command.value)):
        raise ValueError(f"{command.action} needs a finite value")
    return command


class Hub:
    """Sends what a feed shows to every page, and tells the feed what pages ask for.

    Everything here runs in the server's loop.
    """

    def __init__(
        self,
        *,
        scene: Scene,
        feed: Feed,
        offers: Offers,
        visits: Visits | None = None,
        desk: Desk | None = None,
        ruler: Callable[[], Ruler] | None = None,
        patience: float = PATIENCE,
    ) -> None:
        self._feed, self._patience, self._offers, self._desk = feed, patience, offers, desk
        self._ruler, self._measuring = ruler, asyncio.Lock()
        self._visits = Visits() if visits is None else visits
        self._hello = Hello(server=_name(), mode=feed.mode, duration=feed.duration, schema=schema())
        self._greeted: dict[Client, Hello] = {}
        self._scene = _encode(scene)
        self._registrar = Registrar(offers, scene)
        self._shared = {kind: Allowance(*rate) for kind, rate in SHARED.items()}
        self._newest: Snapshot | None = None
        self._until = inf
        self._ended: Closing | None = None
        self.clients: set[Client] = set()
        self.company = Company(self._visits.see)
        """Visitors as they see each other."""

    def begin(self, scene: Scene) -> None:
        """Send another scene to every page, of which snapshots are from now on."""
        self._scene, self._newest = _encode(scene), None
        self._registrar.begin(scene)
        turned = self._hello.mode != self._feed.mode
        self._hello = replace(self._hello, mode=self._feed.mode)
        for client in self.clients:
            if turned:
                client.offer("Hello", _encode(replace(self._greeted[client], mode=self._feed.mode)))
            client.begin(self._scene)
            client.offer("Transport", _encode(self._feed.transport()))

    def show(self, snapshot: Snapshot, until: float = inf) -> None:
        """Send a snapshot to every page, if it is sent before ``until`` [s], monotonic time."""
        self._newest, self._until = snapshot, until
        self._registrar.show(snapshot)
        if not self.clients:
            return
        payload = _encode(snapshot)
        self.company.show(with_frame=True)
        for client in self.clients:
            client.offer_frame(snapshot.seq, payload, until)

    def recall(self, visitors: tuple[VisitorInfo, ...], presences: tuple[VisitorPresence, ...]) -> None:
        """Show who was there when it was recorded, among those who are there now."""
        self.company.recall(visitors, presences)

    def tell(self, message: Transport | History | SoFar) -> None:
        """Send a change to every page."""
        payload = _encode(message)
        for client in self.clients:
            client.offer(type(message).__name__, payload)

    def end(self, closing: Closing) -> None:
        """End all connections, and those that come later, because there is nothing to show any more."""
        self._ended = closing
        for client in tuple(self.clients):
            client.end(closing)

    async def attend(self, socket: WebSocket) -> None:
        """Serve one page from the first message to the last."""
        with suppress(WebSocketDisconnect):  # gone before it was answered
            await self._attend(socket)

    async def _attend(self, socket: WebSocket) -> None:
        offered: list[str] = socket.scope["subprotocols"]
        if PROTOCOL not in offered:
            # Accepted in the page's own words first: a browser tells a page nothing of a refusal.
            await socket.accept(subprotocol=offered[0] if offered else None)
            await _close(socket, Closing(1002, f"this server speaks {PROTOCOL} only"))
            return
        await socket.accept(subprotocol=PROTOCOL)
        if self._ended is not None:
            await _close(socket, self._ended)
            return
        state = socket.scope["state"]
        address = socket.client.host if socket.client else ""
        if len(self.clients) >= MOST_CLIENTS:
            self._visits.turn_away(address, f"{MOST_CLIENTS} pages are connected already")
            await _close(socket, Closing(1013, f"{MOST_CLIENTS} pages are connected already"))
            return
        client = Client(state["line"], patience=self._patience)
        edits = self._desk is not None and Role.CONTROL in state["roles"]
        measures = self._ruler is not None and Role.CONTROL in state["roles"]
        number = self.company.number()
        may = (
            *sorted(state["roles"]),
            *(("measure",) if measures else ()),
            *(("edit",) if edits else ()),
        )
        self._greeted[client] = replace(self._hello, may=may, visitor=number)
        client.offer("Hello", _encode(self._greeted[client]))
        client.offer("Scene", self._scene)
        client.offer("History", _encode(self._feed.history()))
        if (so_far := self._feed.so_far()) is not None:
            client.offer("SoFar", _encode(so_far))
        client.offer("Transport", _encode(self._feed.transport()))
        if self._newest is not None:
            client.offer_frame(self._newest.seq, _encode(self._newest), self._until)
        self.clients.add(client)
        if self._desk is not None and edits:
            self._desk.come(client)
        visit = self._visits.come(state["role"], address, number)
        self.company.come(client, visit, state["roles"], number)
        listening = self._listen(client, socket, visit, state["roles"])
        task = asyncio.create_task(listening)
        try:
            closing = await client.over
        finally:
            self.clients.discard(client)
            self._greeted.pop(client, None)
            self._offers.gone(client)
            self.company.gone(client)
            self._registrar.gone(client)
            if self._desk is not None:
                self._desk.gone(client)
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)
            visit.leave()
        await _close(socket, closing)

    async def _listen(self, client: Client, socket: WebSocket, visit: Visit, roles: frozenset[Role]) -> None:
        last_answer: Tracked | None = None
        own = {kind: Allowance(*rate) for kind, rate in RATES.items()}
        most = max(LARGEST[role] for role in roles)
        try:
            while True:
                data = await socket.receive_bytes()
                if len(data) > most:
                    raise ValueError(f"a message of {len(data)} bytes; this page may send {most}")
                message = read_message(data)
                if isinstance(message, Command):
                    kind = "ack" if message.action == "ack" else "command"
                else:
                    kind = _KINDS.get(type(message), "edit")
                shared = self._shared.get(kind)
                wait = max(own[kind].take(), 0.0 if shared is None else shared.take())
                if wait:
                    # Meanwhile nothing is read, and whoever sends has to wait, too.
                    visit.refuse(f"more than {RATES[kind][0]:g} per second: {kind}")
                    await asyncio.sleep(wait)
                if isinstance(message, Tracking):
                    last_answer = self._offer(client, message, last_answer, visit, may=Role.TRACK in roles)
                elif isinstance(message, Grab | Pull):
                    pulls = isinstance(message, Pull) and Role.CONTROL in roles
                    self._do(client, message, visit, may=pulls or Role.TRACK in roles)
                elif isinstance(message, Presence):
                    self.company.move(client, message)
                elif isinstance(message, Introduction):
                    self.company.introduce(client, message)
                elif isinstance(message, Hold):
                    may = self._desk is not None and Role.CONTROL in roles
                    self.company.hold(client, message, may=may)
                elif isinstance(message, Edit):
                    client.offer("Edited", _encode(await self._edit(client, message, visit, roles)))
                elif isinstance(message, Register):
                    client.offer("Registered", _encode(await self._register(client, message, visit, roles)))
                elif isinstance(message, Measure | Reach):
                    client.offer("Measured", _encode(await self._measure(message, visit, roles)))
                elif kind == "ack":
                    client.acknowledge(int(message.value or 0))
                else:
                    if Role.CONTROL in roles:
                        self._feed.command(message)
                    else:
                        visit.refuse(message.action)
                    client.offer("Transport", _encode(self._feed.transport()))
        except ValueError as error:
            visit.refuse(str(error)[:200])
            client.end(Closing(1007, str(error)))
        except (WebSocketDisconnect, RuntimeError):
            client.end(Closing(1006, "gone"))

    async def _edit(self, client: Client, edit: Edit, visit: Visit, roles: frozenset[Role]) -> Edited:
        """Make an edit, to its end also when the page leaves meanwhile."""
        if self._desk is not None and Role.CONTROL in roles:
            return await asyncio.shield(self._desk.take(client, edit, self._held_from(client)))
        visit.refuse(f"edit: {edit.action[:20]}")
        what, remedy = "this page may not edit", "start seerob edit, and open its address to control"
        if self._desk is None:
            what = "this run is not edited"
        refusal = Mistake(key="", what=what, remedy=remedy)
        return Edited(id=edit.id, accepted=False, revision=0, mistakes=(refusal,))

    def _do(self, client: Client, what: Grab | Pull, visit: Visit, *, may: bool) -> None:
        """Pass on what a visitor does in the room; the page is told when nobody takes it.

        Raises:
            ValueError: It is too long, or no number.
        """
        refusal = "this page may not: open the address for tracking that seerob printed"
        if may:
            refusal = self._offers.do(client, what)
        if refusal:
            name = what.hand if isinstance(what, Grab) else what.control
            visit.refuse(f"doing: {refusal[:120]}")
            client.offer("Refused", _encode(Refused(what=name, reason=refusal)))

    def _held_from(self, client: Client) -> Callable[[Collection[str]], str]:
        return lambda names: self.company.held_by_another(client, names)

    async def _measure(self, asked: Measure | Reach, visit: Visit, roles: frozenset[Role]) -> Measured:
        if self._ruler is None or Role.CONTROL not in roles:
            visit.refuse("measure")
            return Measured(id=asked.id, refusal="nothing is measured here, or not by who may only look")
        async with self._measuring:
            # Both in the loop: the draft may be another one soon.
            ruler, seen = self._ruler(), self._feed.seen_at(asked.t)
            if seen is None:
                return Measured(id=asked.id, refusal="where everybody was then is not kept any more")
            try:
                if isinstance(asked, Reach):
                    result = await asyncio.to_thread(ruler.reach, asked.of, seen)
                else:
                    result = await asyncio.to_thread(ruler.measure, asked.between, seen)
            except SeerobError as error:
                return Measured(id=asked.id, refusal=str(error))
            except Exception as error:
                _log.exception("a measurement failed")
                return Measured(id=asked.id, refusal=f"a fault of the program: {error!r}")
        return Measured(id=asked.id, result=result)

    async def _register(
        self, client: Client, asked: Register, visit: Visit, roles: frozenset[Role]
    ) -> Registered:
        if Role.TRACK in roles:
            return await asyncio.to_thread(self._registrar.take, client, asked)
        visit.refuse("register")
        refusal = "this page may not: open the address for tracking that seerob printed"
        return Registered(id=asked.id, accepted=False, reason=refusal)

    def _offer(
        self, client: Client, tracking: Tracking, last_answer: Tracked | None, visit: Visit, *, may: bool
    ) -> Tracked:
        """Pass on what a headset sees; the page is told what became of it when that changes.

        Raises:
            ValueError: It contradicts itself.
        """
        offer = headset_offers.read(tracking, headset_offers.now())
        if may:
            refusal = self._offers.offer(tracking.human, client, offer)
        else:
            refusal = "this page may not: open the address for tracking that seerob printed"
        fit = self._offers.fit_of(tracking.human, client)
        fits, found, taller = fit or (None, "", None)
        answer = Tracked(
            human=tracking.human, accepted=not refusal, reason=refusal, fits=fits, found=found, taller=taller
        )
        if refusal:
            visit.refuse(f"tracking: {refusal}")
        if answer != last_answer:
            client.offer("Tracked", _encode(answer))
        return answer


def _name() -> str:
    try:
        return f"seerob {version('seerob')}"
    except PackageNotFoundError:  # run from a checkout that is not installed
        return "seerob"


async def _close(socket: WebSocket, closing: Closing) -> None:
    """Close politely; cut when the page does not even take that."""
    abort: Any = socket.scope["state"]["abort"]
    if closing.code != 1006:
        reason = closing.reason.encode(errors="replace")[:120].decode(errors="ignore")
        try:
            async with asyncio.timeout(1.0):
                await socket.close(closing.code, reason)
        except (TimeoutError, WebSocketDisconnect, RuntimeError):
            abort()
    asyncio.get_running_loop().call_later(2.0, abort)
