"""OptiTrack Motive, live, through NatNet 2.0 to 4.x: skeletons, or rigid bodies worn as trackers."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import AsyncGenerator, Sequence
from contextlib import aclosing
from dataclasses import replace
from enum import StrEnum
from typing import Annotated

import numpy as np
from msgspec import Meta

from seerob.core.snapshot import Finding
from seerob.core.transforms import Array, left_product, rotation_from_wxyz, wxyz_from_rotation
from seerob.description.capture.captured import CaptureFrame, Layout, Seen
from seerob.devices.capture.stream_source import CaptureStream
from seerob.devices.live.listening import Contact, contact_of
from seerob.files.motion_capture.upright import Up, world_from_file
from seerob.protocols.tracking import natnet
from seerob.protocols.tracking.natnet import (
    Bodies,
    Body,
    BoneModel,
    Models,
    ReceivedFrame,
    Skeleton,
    SkeletonModel,
    frames,
)

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
        people: dict[int, _Known] = {}
        rigid = _Known(_rigid_layout(()), (), ())
        world = _World(world_from_file(self.up or Up.Y))
        last = -1.0
        async with aclosing(self._heard()) as stream:
            async for heard in stream:
                if heard.models is not known:
                    known = heard.models
                    people = {s.id: _person(s) for s in known.skeletons}
                    numbers = tuple(body.id for body in known.bodies)
                    rigid = _Known(_rigid_layout(known.bodies), known.bodies, numbers)
                if heard.frame.t == last:  # a frame that came twice
                    continue
                last = heard.frame.t
                if self.tracked is Tracked.RIGID_BODIES:
                    if rigid.numbers:
                        yield rigid.layout, rigid.frame(last, heard.frame.bodies, world)
                    continue
                for skeleton in heard.frame.skeletons:
                    if (who := people.get(skeleton.id)) is not None:
                        yield who.layout, who.frame(last, self._in_world(skeleton, who), world)

    def _in_world(self, skeleton: Skeleton, who: _Known) -> Bodies:
        # Frames give a bone's number with the skeleton's in the upper half.
        bones = replace(skeleton.bones, numbers=tuple([number & 0xFFFF for number in skeleton.bones.numbers]))
        return Bodies.of(_composed(bones, who.models)) if self.coordinates is Coordinates.LOCAL else bones

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


class _World:
    """Poses of Motive in the world.

    Args:
        rotation: World from Motive's, shape (3, 3).
    """

    def __init__(self, rotation: Array) -> None:
        self.places = rotation.T
        self.turns = left_product(wxyz_from_rotation(rotation))[:, [1, 2, 3, 0]].T
        """Makes w, x, y, z of x, y, z, w there."""


class _Known:
    """A skeleton, or all rigid bodies, as frames tell of it.

    Args:
        layout: Its names.
        models: In the order of its rows.
        numbers: By which frames tell of them.
        subject: Who it is.
    """

    def __init__(
        self, layout: Layout, models: Sequence[BoneModel], numbers: tuple[int, ...], subject: str = ""
    ) -> None:
        self.layout, self.models, self._subject = layout, models, subject
        # Of two with one number nobody knows which is which.
        count = Counter(numbers)
        self.numbers = tuple([n if count[n] == 1 else None for n in numbers])

    def frame(self, t: float, bodies: Bodies, world: _World) -> CaptureFrame:
        """Rows in the order of the models; NaN for what was not tracked."""
        with np.errstate(invalid="ignore", over="ignore"):  # numbers that cannot be are for others
            positions, turns = bodies.poses[:, :3] @ world.places, bodies.poses[:, 3:] @ world.turns
        if bodies.numbers != self.numbers or not all(bodies.tracked):
            seen: dict[int | None, int] = {}
            for k, (number, tracked) in enumerate(zip(bodies.numbers, bodies.tracked, strict=True)):
                seen[number] = k if tracked and number not in seen else -1
            rows = [seen.get(number, -1) for number in self.numbers]
            nothing = np.full((1, 4), np.nan)
            positions = np.concatenate([positions, nothing[:, :3]])[rows]
            turns = np.concatenate([turns, nothing])[rows]
        return CaptureFrame(t=t, positions=positions, orientations=turns, subject=self._subject)


def _person(skeleton: SkeletonModel) -> _Known:
    numbers = tuple(bone.id & 0xFFFF for bone in skeleton.bones)
    return _Known(_layout(skeleton), skeleton.bones, numbers, skeleton.name)


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
