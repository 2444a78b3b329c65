"""Writing, the only place where the twin does: variables of machines, and Cartesian targets to ROS.

Off unless file and command line both allow it. Threads of their own write, so a slow device or network never
slows the loop.

What triggers write are edges: a verdict that came or went since the run began; each writing and each failure
is one line of the log. What a source says of where a tool is to be is published, over rosbridge, ROS-TCP
or Zenoh, when the twin gets there, in the frame that the controller wants; of what waits, only the newest is
sent. Nothing that its source does not call good is sent, and nothing is repeated: a controller that must stop
when targets cease has to see to that itself. Where steps say where to (`seerob.session.steps`), it is said
again and again until the robot is heard to be there.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import time
from collections import Counter, deque
from collections.abc import AsyncGenerator, Mapping, Sequence
from contextlib import asynccontextmanager
from pathlib import Path
from threading import Condition, Event, Thread
from typing import Any, Protocol, Self

import numpy as np
from msgspec.structs import replace

from seerob.core.errors import InputError, SeerobError, UnknownName
from seerob.core.samples import PoseSample, Quality, Sample, SignalSample
from seerob.core.snapshot import Snapshot, SourceLine
from seerob.core.transforms import Array, inverse, rotation_from_wxyz, transform, wxyz_from_rotation
from seerob.devices.live.listening import because
from seerob.devices.motion_files import fixed_links
from seerob.model.model import Model
from seerob.outputs.sink import Closing
from seerob.protocols.links.connection import Connection, connected
from seerob.protocols.links.websocket_link import Link, linked
from seerob.protocols.ros import rmw_zenoh, ros_tcp, rosbridge
from seerob.protocols.ros.ros_messages import Edition, ros1_name, store
from seerob.protocols.ros.rosbridge import Status
from seerob.session.opening import signal_timeouts, target
from seerob.session.steps import Steps
from seerob.workstation.tables.writing import CartesianTarget, TargetMessage, TargetWire, Trigger
from seerob.workstation.variables import Variable

_log = logging.getLogger(__name__)

WITHIN = 2.0
"""A writing that takes longer has failed [s]."""
STOP_WITHIN = 3.0
"""[s]"""


class Writes(Protocol):
    """A source that can write."""

    async def write(self, variable: Variable, raw: bool, folder: Path) -> None:
        """Write one bool, as the device has it.

        Raises:
            OSError: There is no connection.
            SeerobError: The device refuses.
        """


class _Edge:
    """One trigger at work."""

    def __init__(self, trigger: Trigger, variable: Variable, writer: Writes, sets: str) -> None:
        self.trigger, self.variable, self.writer = trigger, variable, writer
        self.wanted: bool | None = None
        """None before the first verdict, which is no edge."""
        self.written: bool | None = None
        self.sets = sets
        """Variable of the twin that its control sets; empty where it follows a verdict."""
        self.is_set = False
        self.due = 0.0
        """Not written before this instant, host's monotonic time [s]."""
        self.failing = False

    @property
    def waits(self) -> bool:
        """Whether there is something to write."""
        return self.wanted != self.written


def allowed(model: Model, *, on_command_line: bool) -> bool:
    """Whether anything may be written: only where workstation file and command line both say so."""
    station = model.workstation
    return bool(station.triggers) and station.allow_writing and on_command_line


class Triggers(Closing):
    """The triggers of a run: takes snapshots like a sink, and writes to machines.

    Args:
        model: The compiled workstation.
        on_command_line: Whether the command line allows writing.

    Raises:
        InputError: It is not allowed, or a source that is to write cannot.
    """

    def __init__(self, model: Model, *, on_command_line: bool) -> None:
        if not allowed(model, on_command_line=on_command_line):
            remedy = "allow_writing = true in the workstation file and --allow-writing on the command line"
            raise InputError.at(
                "triggers", "", "writing to machines is not allowed", f"it takes both: {remedy}"
            )
        sources = {source.name: source for source in model.workstation.sources}
        self._folder = model.folder
        pulls = {control.name: control.sets for control in model.workstation.controls}
        self._edges: Sequence[_Edge] = [
            _Edge(trigger, variable, _writer(sources, variable), pulls.get(trigger.control or "", ""))
            for trigger in model.workstation.triggers
            for variable in [model.dictionary[trigger.variable]]
        ]
        self._pulled = any(edge.sets for edge in self._edges)
        self._sent = Counter[str]()
        """Bools that were written, by source."""
        self._condition = Condition()
        self._stopping = False
        self._thread = Thread(target=self._run, name="seerob-triggers", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def write(self, snapshot: Snapshot, samples: tuple[Sample, ...]) -> None:
        """Note which verdicts came or went; returns at once."""
        verdicts = {result.name: result.verdict for result in snapshot.results}
        pulled = [s.values for s in samples if isinstance(s, SignalSample)] if self._pulled else []
        for edge in self._edges:
            if edge.sets:
                edge.is_set = next(
                    (bool(v[edge.sets]) for v in reversed(pulled) if edge.sets in v), edge.is_set
                )
        with self._condition:
            for edge in self._edges:
                if edge.sets:
                    wanted = edge.is_set
                else:
                    wanted = edge.trigger.when.holds(verdicts.get(edge.trigger.criterion))
                if edge.wanted is None:
                    edge.written = wanted  # how it was at the start is no edge
                edge.wanted = wanted
            if any(edge.waits for edge in self._edges):
                self._condition.notify()

    def lines(self, known: Mapping[str, SourceLine]) -> dict[str, SourceLine]:
        """How sources are heard, and how many bools were written to them."""
        sent = dict(self._sent)
        return {**known, **{n: replace(known.get(n, SourceLine()), sent=sent[n]) for n in sent}}

    def close(self) -> None:
        """End; what waits is not written any more."""
        with self._condition:
            self._stopping = True
            self._condition.notify()
        if self._thread.is_alive():
            self._thread.join(STOP_WITHIN)

    def _run(self) -> None:
        while (job := self._next()) is not None:
            edge, wanted = job
            reason = asyncio.run(_write(edge, wanted, self._folder))
            with self._condition:
                edge.due = time.monotonic() + edge.trigger.every
                if reason and not edge.failing:
                    _log.warning("%s: could not be written: %s", edge.variable.name, reason)
                elif not reason:
                    edge.written = wanted
                    self._sent[edge.variable.source] += 1
                    word, by = str(wanted).lower(), edge.trigger.control or edge.trigger.criterion
                    _log.info("%s: %s written (%s)", edge.variable.name, word, by)
                edge.failing = bool(reason)

    def _next(self) -> tuple[_Edge, bool] | None:
        """The edge that is to be written next; None when the run is over."""
        with self._condition:
            while not self._stopping:
                now = time.monotonic()
                waiting = [edge for edge in self._edges if edge.waits]
                first = min(waiting, key=lambda edge: edge.due, default=None)
                if first is not None and first.due <= now:
                    return first, bool(first.wanted)
                self._condition.wait(None if first is None else first.due - now)
        return None


async def _write(edge: _Edge, wanted: bool, folder: Path) -> str:
    """Write one edge; why it could not be, or nothing."""
    try:
        raw = wanted != edge.variable.inverted
        await asyncio.wait_for(edge.writer.write(edge.variable, raw, folder), WITHIN)
    except (OSError, EOFError, SeerobError) as error:
        return because(error)
    except Exception as error:
        _log.exception("%s: a mistake in the source itself", edge.variable.name)
        return type(error).__name__
    return ""


def _writer(sources: Mapping[str, object], variable: Variable) -> Writes:
    source = sources[variable.source]
    if not hasattr(source, "write"):
        what = f"{variable.source}, a source of this kind, writes nothing"
        remedy = "take one that can: modbus, mqtt, opcua, siemens_web"
        raise InputError.at("triggers", variable.name, what, remedy)
    found: Writes = source
    return found


CONNECT_WITHIN = 2.0
"""[s]"""


class Wire(Protocol):
    """A connection on which a topic is announced."""

    async def publish(self, said: Mapping[str, Any]) -> None:
        """One message, as a table."""

    async def listen(self, patience: float) -> None:
        """Hear what the other side says; at most for a time [s].

        Raises:
            ConnectionError: It closed the connection, or says that something is wrong.
        """

    async def end(self) -> None:
        """Say that nothing more comes."""


@asynccontextmanager
async def wired(table: CartesianTarget) -> AsyncGenerator[Wire, None]:
    """Connect, and announce the topic.

    Raises:
        OSError: There is no connection.
        SeerobError: The other side is no such server.
    """
    if table.wire is TargetWire.ROSBRIDGE:
        largest, what = rosbridge.MAX_MESSAGE, "rosbridge server"
        port = table.port or rosbridge.PORT
        async with linked(table.host, port, largest=largest, what=what, tls=table.tls) as link:
            kind = str(table.message) if table.ros == 1 else str(table.message).replace("/", "/msg/")
            await link.send(rosbridge.advertise(table.topic, kind))
            yield _Rosbridge(link, table.topic)
    elif table.wire is TargetWire.ZENOH:
        types = await asyncio.to_thread(store, Edition.ROS2)
        kind = str(table.message).replace("/", "/msg/")
        async with rmw_zenoh.opened(table.host, table.port or rmw_zenoh.PORT) as router:
            definition = types.hash_rihs01(kind)
            yield _Zenoh(router, router.publisher(table.topic, kind, definition, table.domain), table)
    else:
        async with connected(table.host, table.port or ros_tcp.PORT, CONNECT_WITHIN) as connection:
            wire = _RosTcp(connection, table)
            await wire.begin()
            yield wire


class _Rosbridge:
    def __init__(self, link: Link, topic: str) -> None:
        self._link, self._topic = link, topic
        self._reader = rosbridge.Reader()

    async def publish(self, said: Mapping[str, Any]) -> None:
        await self._link.send(rosbridge.publish(self._topic, dict(said)))

    async def listen(self, patience: float) -> None:
        try:
            heard = await self._link.receive(patience)
        except TimeoutError:
            return
        if heard is None:
            raise ConnectionError("the server closed the connection")
        status = self._reader.take(heard[1])
        if isinstance(status, Status) and status.level == "error":
            raise ConnectionError(f"the server says: {status.text[:300]}")

    async def end(self) -> None:
        await self._link.send(rosbridge.unadvertise(self._topic))


class _RosTcp:
    def __init__(self, connection: Connection, table: CartesianTarget) -> None:
        self._connection, self._table = connection, table
        self._splitter = ros_tcp.Splitter()
        self._edition: Edition | None = None

    async def begin(self) -> None:
        """Hear how the endpoint serialises, and announce the topic."""
        async with asyncio.timeout(CONNECT_WITHIN):
            while self._edition is None:
                await self.listen(CONNECT_WITHIN)
        await asyncio.to_thread(store, self._edition)
        said = {"topic": self._table.topic, "message_name": ros1_name(str(self._table.message))}
        await self._connection.write(ros_tcp.command("publish", {**said, "queue_size": 1, "latch": False}))

    async def publish(self, said: Mapping[str, Any]) -> None:
        assert self._edition is not None
        body = serialised(self._table.message, said, self._edition)
        await self._connection.write(ros_tcp.pack(self._table.topic, body))

    async def listen(self, patience: float) -> None:
        try:
            _, data, _ = await self._connection.read(patience)
        except TimeoutError:
            return
        if not data:
            raise ConnectionError("the endpoint closed the connection")
        for frame in self._splitter.feed(data):
            if frame.destination == "__handshake":
                self._edition = ros_tcp.edition_of(frame)
            elif frame.destination == "__error":
                raise ConnectionError(f"the endpoint says: {str(frame.fields().get('text', ''))[:300]}")

    async def end(self) -> None:
        """Nothing: an endpoint forgets who closes the connection."""


class _Zenoh:
    def __init__(
        self, router: rmw_zenoh.Router, publisher: rmw_zenoh.Publisher, table: CartesianTarget
    ) -> None:
        self._router, self._publisher, self._table = router, publisher, table

    async def publish(self, said: Mapping[str, Any]) -> None:
        self._publisher.publish(serialised(self._table.message, said, Edition.ROS2), time.time())

    async def listen(self, patience: float) -> None:
        with contextlib.suppress(TimeoutError):
            await self._router.next(patience)

    async def end(self) -> None:
        """Nothing: whoever closes the session takes its token away."""


def serialised(message: TargetMessage, said: Mapping[str, Any], edition: Edition) -> bytes:
    """A message as ROS itself serialises it.

    Args:
        message: Its type.
        said: Its fields, as `seerob.session.writing.message` has them.
        edition: Who is to read it.
    """
    types = store(edition)

    def made(name: str, /, **fields: Any) -> Any:
        return types.types[f"geometry_msgs/msg/{name}"](**fields)

    def header() -> Any:
        sec, nanosec = said["header"]["stamp"].values()
        stamp = types.types["builtin_interfaces/msg/Time"](sec=sec, nanosec=nanosec)
        more = {"seq": 0} if edition is Edition.ROS1 else {}
        frame = said["header"]["frame_id"]
        return types.types["std_msgs/msg/Header"](stamp=stamp, frame_id=frame, **more)

    def pose(fields: Mapping[str, Any]) -> Any:
        place, turn = made("Point", **fields["position"]), made("Quaternion", **fields["orientation"])
        return made("Pose", position=place, orientation=turn)

    if message is TargetMessage.POSE:
        whole = pose(said)
    elif message is TargetMessage.POSE_STAMPED:
        whole = made("PoseStamped", header=header(), pose=pose(said["pose"]))
    else:
        fields = said["transform"]
        moved = made(
            "Transform",
            translation=made("Vector3", **fields["translation"]),
            rotation=made("Quaternion", **fields["rotation"]),
        )
        whole = made(
            "TransformStamped", header=header(), child_frame_id=said["child_frame_id"], transform=moved
        )
    pack = types.serialize_ros1 if edition is Edition.ROS1 else types.serialize_cdr
    return bytes(pack(whole, str(message).replace("/", "/msg/")))


AHEAD = 4096
"""Samples that are kept until the twin gets there."""
PAUSE = 1.0
"""Before it is connected again [s]."""
BEAT = 0.05
"""How soon the end is noticed [s]."""


def targets_allowed(model: Model, *, on_command_line: bool) -> bool:
    """Whether anything may be published: only where workstation file and command line both say so."""
    station = model.workstation
    return bool(station.targets) and station.allow_writing and on_command_line


class _Way:
    """One target at work: poses in, the newest of those that are due out."""

    def __init__(self, model: Model, table: CartesianTarget, frame_from_world: Array) -> None:
        self.table = table
        self.published = 0
        """Messages that were sent."""
        self.last = ""
        """Where that was which was sent last."""
        self.heard = self.refused = 0
        """Poses that came due, and those of them that were not sent since nobody may rely on them."""
        self.reason = "not connected"
        """Why nothing can be sent; empty while it can."""
        self._model, self._frame = model, model.frame(table.at)
        self._said_from_at: dict[str, Array | None] = {}
        """By what a source says poses of; None of what does not move with the tool."""
        self._frame_from_world = frame_from_world
        self.steps = Steps(model, table, signal_timeouts(model)[0]) if table.steps else None
        self._ahead = deque[PoseSample](maxlen=AHEAD)
        self._newest = deque[PoseSample](maxlen=1)

    def note(self, now: float, samples: Sequence[Sample]) -> None:
        """Take what is said of the tool, and find what is due at a run time [s]."""
        self._ahead.extend(s for s in samples if isinstance(s, PoseSample) and self._moved_by(s) is not None)
        while self._ahead and self._ahead[0].t <= now:
            self._newest.append(self._ahead.popleft())
            self.heard += 1

    def step(self, steps: Steps, snapshot: Snapshot, samples: Sequence[Sample]) -> None:
        """Take where steps say that the tool is to be at a tick."""
        self._newest.clear()
        if (pose := steps.next(snapshot, samples)) is not None:
            self._newest.append(pose)
            self.heard += 1

    def _moved_by(self, sample: PoseSample) -> Array | None:
        """The frame of which a pose is said, from the tool (4, 4); None where that moves on its own."""
        if sample.target not in self._said_from_at:
            said = self._model.frame(sample.target)
            self._said_from_at[sample.target] = self._model.between(said, self._frame)
        return self._said_from_at[sample.target]

    def take(self) -> dict[str, Any] | None:
        """The message that is to be published; None when there is nothing new."""
        try:
            sample = self._newest.pop()
        except IndexError:
            return None
        values = np.array([*sample.position, *sample.wxyz])
        if sample.quality is not Quality.GOOD or not np.isfinite(values).all() or not values[3:].any():
            self.refused += 1
            return None
        said_from_at = self._moved_by(sample)
        assert said_from_at is not None
        world = transform(rotation_from_wxyz(sample.wxyz), sample.position) @ said_from_at
        return message(self.table, self._frame_from_world @ world, time.time())

    def sent(self, said: Mapping[str, Any]) -> None:
        """Note what was sent."""
        self.published += 1
        pose = said.get("pose") or said.get("transform") or said
        place = pose["translation" if "translation" in pose else "position"]
        self.last = ", ".join(f"{place[axis]:.3f}" for axis in "xyz")

    def line(self) -> SourceLine:
        """How many were sent, and why it is none now."""
        word = self.reason or (self.steps.word if self.steps is not None else "")
        return SourceLine(heard=not self.reason, sent=self.published, received=self.heard, word=word)

    def __str__(self) -> str:
        """How many were sent, in a line, and why none were."""
        table = self.table
        if self.published:
            within = f" in {table.frame_id}" if table.message is not TargetMessage.POSE else ""
            last = f"{self.published} poses of {table.at} sent, the last at {self.last} m{within}"
            return f"{table.topic}: {last}{f'; {self.reason}' if self.reason else ''}"
        why = self.reason or (self.steps.word if self.steps is not None else "no pose of it was heard")
        if not self.reason and self.heard:
            why = f"{self.heard} poses were heard, {self.refused} that nobody may rely on"
        return f"{table.topic}: nothing was sent of {table.at}: {why}"


def message(table: CartesianTarget, pose: Array, now: float) -> dict[str, Any]:
    """A pose as ROS has it.

    Args:
        table: How it is to be published.
        pose: In the frame of ROS (4, 4).
        now: Wall clock, as ROS counts [s since 1970].
    """
    place = dict(zip("xyz", pose[:3, 3].tolist(), strict=True))
    w, x, y, z = wxyz_from_rotation(pose[:3, :3]).tolist()
    turn = {"x": x, "y": y, "z": z, "w": w}
    if table.message is TargetMessage.POSE:
        return {"position": place, "orientation": turn}
    whole, part = divmod(int(now * 1e9), 10**9)
    stamp = {"secs": whole, "nsecs": part} if table.ros == 1 else {"sec": whole, "nanosec": part}
    header = {"stamp": stamp, "frame_id": table.frame_id}
    if table.message is TargetMessage.POSE_STAMPED:
        return {"header": header, "pose": {"position": place, "orientation": turn}}
    moved = {"translation": place, "rotation": turn}
    return {"header": header, "child_frame_id": table.at.rpartition("/")[2], "transform": moved}


class CartesianTargets(Closing):
    """The Cartesian targets of a run: takes samples like a sink, and publishes to ROS.

    Args:
        model: The compiled workstation.
        on_command_line: Whether the command line allows writing.

    Raises:
        InputError: It is not allowed, or a name is not there.
    """

    def __init__(self, model: Model, *, on_command_line: bool) -> None:
        if not targets_allowed(model, on_command_line=on_command_line):
            remedy = "allow_writing = true in the workstation file and --allow-writing on the command line"
            raise InputError.at(
                "targets", "", "publishing Cartesian targets is not allowed", f"it takes both: {remedy}"
            )
        self.ways: list[_Way] = []
        for i, table in enumerate(model.workstation.targets):
            try:
                model.carrier(model.frame(table.at))
                frame = np.eye(4) if table.link is None else _standing(model, table.link)
            except UnknownName as error:
                raise InputError.at("workstation", f"targets[{i}]", str(error)) from error
            self.ways.append(_Way(model, table, inverse(frame)))
        self._over = Event()
        self._threads = [Thread(target=self._run, args=(way,), daemon=True) for way in self.ways]

    def __enter__(self) -> Self:
        for thread in self._threads:
            thread.start()
        return self

    def write(self, snapshot: Snapshot, samples: tuple[Sample, ...]) -> None:
        """Note what is due; returns at once."""
        for way in self.ways:
            if way.steps is not None:
                way.step(way.steps, snapshot, samples)
            else:
                way.note(snapshot.t, samples)

    def lines(self, known: Mapping[str, SourceLine]) -> dict[str, SourceLine]:
        """How sources are heard, and how many poses went to each topic."""
        return {**known, **{f"{w.table.host} {w.table.topic}": w.line() for w in self.ways}}

    def close(self) -> None:
        """End; what waits is not published any more."""
        self._over.set()
        for thread in self._threads:
            if thread.is_alive():
                thread.join(STOP_WITHIN)

    def _run(self, way: _Way) -> None:
        asyncio.run(self._publish(way))

    async def _publish(self, way: _Way) -> None:
        table, failing = way.table, False
        while not self._over.is_set():
            try:
                async with wired(table) as wire:
                    _log.info("%s: targets of %s are published", table.topic, table.at)
                    failing, way.reason = False, ""
                    await self._session(way, wire)
            except (OSError, EOFError, SeerobError) as error:
                if not failing:
                    _log.warning("%s: cannot be published: %s", table.topic, because(error))
                failing, way.reason = True, because(error)
                await asyncio.to_thread(self._over.wait, PAUSE)

    async def _session(self, way: _Way, wire: Wire) -> None:
        table, due = way.table, 0.0
        way.take()  # what was meant before there was a connection is no longer meant
        while not self._over.is_set():
            now = time.monotonic()
            said = way.take() if now >= due else None
            if said is not None:
                await wire.publish(said)
                way.sent(said)
                due = now + table.every
            await wire.listen(min(BEAT, table.every))
        await wire.end()


def _standing(model: Model, link: str) -> Array:
    """World from a link that no joint moves (4, 4), by its full name."""
    robots = [target(model, robot.name) for robot in model.workstation.robots]
    known = {
        name: np.array(robot.world_from_base) @ base_from_link
        for robot in robots
        if robot is not None and robot.world_from_base is not None
        for name, base_from_link in fixed_links(robot).items()
    }
    if link not in known:
        raise UnknownName("link that stands still", link, known)
    return known[link]
