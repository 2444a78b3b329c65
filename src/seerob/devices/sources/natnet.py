"""OptiTrack Motive, live, through NatNet 2.0 to 4.x: skeletons, or rigid bodies worn as trackers."""

from __future__ import annotations

import time
from collections.abc import AsyncGenerator, Sequence
from contextlib import aclosing
from enum import StrEnum
from typing import Annotated

import numpy as np
from msgspec import Meta

from seerob.core.snapshot import Finding
from seerob.core.transforms import Array, rotation_from_wxyz, turned, wxyz_from_rotation
from seerob.description.capture.captured import CaptureFrame, Layout, Seen
from seerob.devices.capture.stream_source import CaptureStream
from seerob.devices.live.listening import Contact, contact_of
from seerob.files.motion_capture.upright import Up, world_from_file
from seerob.protocols.tracking import natnet
from seerob.protocols.tracking.natnet import Body, BoneModel, Models, ReceivedFrame, SkeletonModel, frames

LISTEN_AT_START = 0.4
"""How long frames are listened to at start [s]."""


class Tracked(StrEnum):
    """What of Motive's things moves the person."""

    SKELETONS = "skeletons"
    RIGID_BODIES = "rigid_bodies"
    """Worn on the body; the name in Motive says where: ``waist``, ``left_foot`` …"""


class Transmission(StrEnum):
    """How Motive sends."""

    MULTICAST = "multicast"
    UNICAST = "unicast"


class Coordinates(StrEnum):
    """Motive's setting *Bone Coordinates*."""

    GLOBAL = "global"
    LOCAL = "local"
    """Each bone against its parent."""


class Natnet(CaptureStream, frozen=True, kw_only=True):
    """A person tracked by OptiTrack Motive, live, through NatNet."""

    host: str = "127.0.0.1"
    """Address of the computer with Motive."""
    bind: str = "127.0.0.1"
    """Own address on the network of that computer."""
    transmission: Transmission = Transmission.MULTICAST
    """``multicast`` or ``unicast``, as Motive's settings say."""
    group: str = natnet.GROUP
    """Multicast group in Motive's settings."""
    port: Annotated[int, Meta(ge=1, le=65535)] = natnet.COMMAND_PORT
    """Motive's command port."""
    data_port: Annotated[int, Meta(ge=1, le=65535)] = natnet.DATA_PORT
    """Motive's data port; used with multicast."""
    tracked: Tracked = Tracked.SKELETONS
    """``skeletons``, or ``rigid_bodies`` that are worn as trackers."""
    up: Up | None = None
    """*Up Axis* in Motive's settings: ``y`` or ``z``; y, Motive's default, is assumed when not given."""
    coordinates: Coordinates = Coordinates.GLOBAL
    """*Bone Coordinates* in Motive's settings."""
    frequency: Annotated[float, Meta(ge=1, le=1000, extra={"unit": "Hz"})] = 120.0
    """Frames per second of the cameras [Hz]."""

    def period(self) -> float:
        """Interval between samples that is expected [s]."""
        return 1 / self.frequency

    async def frames(self) -> AsyncGenerator[tuple[Layout, CaptureFrame], None]:
        """Every skeleton of every frame, or all rigid bodies.

        Raises:
            OSError: There is no connection, or no longer.
            ProtocolError: What comes cannot be understood.
        """
        known: Models | None = None
        layouts: dict[int, tuple[Layout, SkeletonModel]] = {}
        rigid = _rigid_layout(())
        last = -1.0
        async with aclosing(self._heard()) as stream:
            async for heard in stream:
                if heard.models is not known:
                    known = heard.models
                    layouts = {s.id: (_layout(s), s) for s in known.skeletons}
                    rigid = _rigid_layout(known.bodies)
                if heard.frame.t == last:  # a frame that came twice
                    continue
                last = heard.frame.t
                for layout, frame in self._people(heard, layouts, rigid):
                    yield layout, frame

    def _people(
        self, heard: ReceivedFrame, layouts: dict[int, tuple[Layout, SkeletonModel]], rigid: Layout
    ) -> list[tuple[Layout, CaptureFrame]]:
        world = world_from_file(self.up or Up.Y)
        if self.tracked is Tracked.RIGID_BODIES:
            if not rigid.names:
                return []
            ids = tuple(body.id for body in heard.models.bodies)
            return [(rigid, _frame(heard.frame.t, ids, heard.frame.bodies, world, ""))]
        found = []
        for skeleton in heard.frame.skeletons:
            if skeleton.id not in layouts:
                continue
            layout, model = layouts[skeleton.id]
            # Frames give a bone's number with the skeleton's in the upper half.
            bones = [bone._replace(id=bone.id & 0xFFFF) for bone in skeleton.bones]
            if self.coordinates is Coordinates.LOCAL:
                bones = _composed(bones, model.bones)
            ids = tuple(bone.id & 0xFFFF for bone in model.bones)
            found.append((layout, _frame(heard.frame.t, ids, bones, world, model.name)))
        return found

    def contact(self) -> Contact:
        """The computer with Motive, which is asked and then sends."""
        return contact_of(self, listens=False)

    async def ask(self) -> tuple[Finding, ...]:
        """Which version, which people and bodies."""
        newest: ReceivedFrame | None = None
        until = None
        async with aclosing(self._heard()) as stream:
            async for newest in stream:
                until = newest.arrived + LISTEN_AT_START if until is None else until
                if time.monotonic() >= until:
                    break
        if newest is None:
            return ()
        return tuple(
            Finding(level=level, subject=self.human, text=f"natnet: {text}")
            for level, text in self._remarks(newest)
        )

    def _remarks(self, heard: ReceivedFrame) -> list[tuple[str, str]]:
        server, models = heard.server, heard.models
        version = ".".join(map(str, server.natnet[:2]))
        said = [
            ("note", f"{server.application} {'.'.join(map(str, server.version))}, NatNet {version}"),
            ("note", f"skeletons: {', '.join(s.name for s in models.skeletons) or 'none'}"),
            ("note", f"rigid bodies: {', '.join(b.name for b in models.bodies) or 'none'}"),
        ]
        if self.up is None:
            said.append(("assumed", "y is up, Motive's default: its datagrams do not say; give up"))
        names = [s.name for s in models.skeletons]
        if self.tracked is Tracked.RIGID_BODIES and not models.bodies:
            said.append(("warning", "no rigid body: make them in Motive, or follow skeletons"))
        elif self.tracked is Tracked.SKELETONS and not names:
            said.append(("warning", "no skeleton: make one in Motive and switch on its streaming"))
        elif self.tracked is Tracked.SKELETONS and self.subject and self.subject not in names:
            said.append(("warning", f"no skeleton is called {self.subject!r}"))
        elif self.tracked is Tracked.SKELETONS and len(names) > 1 and not self.subject:
            said.append(("warning", "several skeletons: the first is followed; name one as subject"))
        if (2, 0) <= server.natnet[:2] < (2, 6):
            text = "this version does not say when something is not seen: what is at 0, 0, 0 is left out"
            said.append(("warning", text))
        return said

    def _heard(self) -> AsyncGenerator[ReceivedFrame, None]:
        return frames(
            self.host,
            bind=self.bind,
            command_port=self.port,
            data_port=self.data_port,
            group=self.group if self.transmission is Transmission.MULTICAST else None,
        )


def _layout(skeleton: SkeletonModel) -> Layout:
    prefix = f"{skeleton.name}_"
    return Layout(seen=Seen.JOINTS, names=tuple(bone.name.removeprefix(prefix) for bone in skeleton.bones))


def _rigid_layout(bodies: Sequence[BoneModel]) -> Layout:
    return Layout(seen=Seen.TRACKERS, names=tuple(b.name for b in bodies), convention="trackers")


def _frame(
    t: float, ids: tuple[int, ...], bodies: Sequence[Body], world: Array, subject: str
) -> CaptureFrame:
    """Rows in the order of ``ids``; NaN for what was not tracked."""
    rows = {number: row for row, number in enumerate(ids)}
    positions, turns = np.full((len(ids), 3), np.nan), np.full((len(ids), 4), np.nan)
    seen = [(row, b) for b in bodies if b.tracked and (row := rows.get(b.id)) is not None]
    if seen:
        where = [row for row, _ in seen]
        positions[where] = np.array([body.position for _, body in seen]) @ world.T
        turns[where] = np.array([body.xyzw for _, body in seen])[:, [3, 0, 1, 2]]
    return CaptureFrame(t=t, positions=positions, orientations=turned(world, turns), subject=subject)


def _composed(bones: Sequence[Body], models: Sequence[BoneModel]) -> list[Body]:
    """Bones in the world, of bones each against its parent; untracked when one above is."""
    own = {bone.id: bone for bone in bones}
    world: dict[int, Body] = {}
    for model in models:  # parents come first
        number, parent = model.id & 0xFFFF, model.parent & 0xFFFF
        bone = own.get(number)
        if bone is None:
            continue
        above = world.get(parent) if model.parent > 0 and parent != number else None
        if above is None:
            world[number] = bone
            continue
        wxyz = np.array([b.xyzw[[3, 0, 1, 2]] for b in (above, bone)])
        usable = above.tracked and bone.tracked and bool(np.isfinite(wxyz).all() and wxyz.any(axis=1).all())
        if not usable:
            world[number] = bone._replace(tracked=False)
            continue
        rotation = rotation_from_wxyz(wxyz[0])
        turn = wxyz_from_rotation(rotation @ rotation_from_wxyz(wxyz[1]))
        place = above.position + rotation @ bone.position
        world[number] = bone._replace(position=place, xyzw=turn[[1, 2, 3, 0]])
    return list(world.values())
