"""What sinks and the page need to know once, before the first snapshot, and what they show unjudged."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from importlib.metadata import version

import numpy as np
from msgspec import structs

from seerob.core.errors import UnknownName
from seerob.core.plugin import kind_of
from seerob.core.snapshot import (
    CameraInfo,
    ControlInfo,
    CriterionInfo,
    Finding,
    JointInfo,
    MechanismInfo,
    Node,
    Place,
    Scene,
    Taught,
)
from seerob.core.transforms import Array, wxyz_from_rotation
from seerob.criteria.question import Bound
from seerob.criteria.scoring.phases import entered_for
from seerob.description.camera import lens
from seerob.description.norms.editions import headline
from seerob.devices.capture.options import placement
from seerob.devices.capture.stream_source import CaptureStream
from seerob.devices.live.headset_offers import TakesOffers
from seerob.model.model import Frame, Mechanism, Model
from seerob.recording.format import content_hash
from seerob.recording.series import STILL
from seerob.session.opening import coarse
from seerob.twin.state import State
from seerob.workstation.source import TakesWaypoints, WaypointTarget
from seerob.workstation.variables import Value, WhenStale
from seerob.workstation.workstation import Camera, Landmark, Pose, Workstation, real_names


def unmet_phases(model: Model, bound: Sequence[Bound], end: float) -> Iterator[Finding]:
    """Phases of a task that begin when the motion is over [s]: what they enter is judged at no instant."""
    for rule in (one.criterion for one in bound):
        for phase in entered_for(model, rule):
            if phase.start > end + 1e-9:
                called = f"the phase {phase.title!r}" if phase.title else "a phase"
                text = (
                    f"{rule.name}: {called} begins at {phase.start:g} s, and the motion ends at {end:g} s: "
                    "it is judged at no instant; give a motion that has it, or its start in seconds"
                )
                yield Finding(level="warning", subject=rule.name, text=text, holds=(rule.name,))


def scene_of(
    model: Model,
    bound: Sequence[Bound],
    findings: Iterable[Finding] = (),
    *,
    files: dict[str, bytes],
    fed: bool = False,
) -> Scene:
    """What sinks and the page need to know once.

    Args:
        model: The compiled workstation.
        bound: Its criteria.
        findings: Of sources, besides those of the model.
        files: What the hash is of.
        fed: Whether samples come that are of no source of the workstation: then somebody may move.
    """
    station = model.workstation
    too_coarse = coarse(model)
    there = real_names(station)
    return Scene(
        title=station.title,
        edition=headline((b.basis for b in bound), station.edition),
        version=version("seerob"),
        workstation_hash=content_hash(files),
        period=station.engine.tick,
        nodes=tuple(
            Node(
                name=body.name,
                role=body.role,
                owner=body.owner,
                mesh=body.mesh,
                triangles=body.triangles,
                moves=bool(body.mover),
                mover=body.mover,
                mass=None if body.mass is None else body.mass.value,
                mass_origin=model.mass_origin(body),
                note=body.note,
                real=body.owner in there,
            )
            for body in model.bodies
        ),
        mechanisms=tuple(
            MechanismInfo(
                name=m.name,
                role=m.role,
                joints=tuple(
                    JointInfo(name=joint.name, unit=unit, lower=joint.lower, upper=joint.upper)
                    for joint, unit in zip(m.joints, m.units, strict=True)
                ),
                coarse=too_coarse.get(m.name, ""),
                masses=() if m.role == "human" else m.masses,
            )
            for m in model.mechanisms.values()
        ),
        criteria=tuple(
            CriterionInfo(
                name=b.criterion.name,
                kind=kind_of(b.group, b.criterion),
                group=b.group,
                title=(type(b.criterion).__doc__ or "").strip().split("\n")[0],
                subjects=b.criterion.subjects(),
                unit=b.criterion.unit,
                limit=getattr(b.criterion, "limit", None),
                at_most=b.criterion.at_most,
                basis=b.basis,
                levels=getattr(b.criterion, "levels", ()),
                between=_between(b, station, fed=fed),
            )
            for b in bound
        ),
        findings=tuple(dict.fromkeys((*model.findings, *_without_physics(model), *findings))),
        controls=tuple(
            ControlInfo(
                name=control.name,
                kind=str(control.kind),
                of=control.of,
                sets=control.sets,
                lower=control.lower,
                upper=control.upper,
                start=control.start,
            )
            for control in station.controls
        ),
        headsets={
            source.human: _floor(source.at)
            for source in station.sources
            if isinstance(source, TakesOffers) and isinstance(source, CaptureStream)
        },
        landmarks=tuple(landmark_of(model, landmark) for landmark in station.landmarks),
        tips=tuple(_tips(model)),
        taught=tuple(_taught(model)),
        cameras=tuple(camera_of(model, camera) for camera in station.cameras),
    )


def place_of(
    model: Model,
    name: str,
    frame: Frame | None,
    at: Array,
    accuracy: float = 0.0,
    accuracy_turn: float | None = None,
) -> Place:
    """A pose that goes along with a frame of the model, as a page knows it: in one of its nodes.

    Args:
        model: The compiled workstation.
        name: Its own.
        frame: What carries it; the world when None.
        at: Pose in that frame, shape (4, 4).
        accuracy: Standard deviation per axis [m].
        accuracy_turn: Of its turn [rad]; None where nobody says.

    Raises:
        UnknownName: What carries it has no shape, so that no node shows where it is.
    """
    node = ""
    if frame is not None:
        for body in sorted(model.bodies, key=lambda body: body.mj != frame.mj):
            node_from_frame = model.between(Frame(body.name, body.mj, np.eye(4)), frame)
            if node_from_frame is not None and body.holder == "" and (body.carrier or body.mj == frame.mj):
                node, at = body.name, node_from_frame @ at
                break
        else:
            raise UnknownName("link with a shape", frame.name, [body.name for body in model.bodies])
    x, y, z = at[:3, 3].tolist()
    w, i, j, k = map(float, wxyz_from_rotation(at[:3, :3]))
    return Place(
        name=name,
        node=node,
        position=(x, y, z),
        wxyz=(w, i, j, k),
        accuracy=accuracy,
        accuracy_turn=accuracy_turn,
    )


def landmark_of(model: Model, landmark: Landmark) -> Place:
    """Where a landmark is, in a node of the page.

    Raises:
        UnknownName: Nothing carries that name, or it has no shape.
    """
    frame = _carrier(model, landmark.on)
    at = placement(landmark.at)
    place = place_of(model, landmark.name, frame, at, landmark.accuracy, landmark.accuracy_turn)
    return structs.replace(place, board=landmark.board or "")


def _carrier(model: Model, name: str | None) -> Frame | None:
    """The frame of a body, link or tool; None for the world."""
    if name is None:
        return None
    body = next((body for body in model.bodies if body.name == name), None)
    return model.frame(name) if body is None else Frame(body.name, body.mj, np.eye(4))


def camera_of(model: Model, camera: Camera) -> CameraInfo:
    """A camera with its lens and its pose, in a node of the page.

    Raises:
        InputError: Its file is none that ``seerob calibrate camera`` wrote.
        UnknownName: Nothing carries the name that its file has, or it has no shape.
    """
    found = lens.read(model.folder / camera.calibration)
    place, mistake = None, ""
    if found.error is None or math.isnan(found.error):
        mistake = "where it stands is not known: seerob calibrate camera, with --placed and --at"
    else:
        place = place_of(model, camera.name, _carrier(model, found.on), found.world_from_camera)
        if found.error > camera.limit:
            off = f"{1e3 * found.error:.0f} mm at {found.tool}, more than {1e3 * camera.limit:.0f} mm"
            mistake = (
                f"it may be off by {off}: calibrate it again, nearer, or with a board that is known better"
            )
    return CameraInfo(
        name=camera.name,
        size=(found.width, found.height),
        lens=(found.fx, found.fy, found.cx, found.cy, *found.distortion),
        place=place,
        error=found.error,
        tool=found.tool,
        error_px=found.error_px,
        fetched=camera.address is not None,
        mistake=mistake,
    )


def _tips(model: Model) -> Iterator[Place]:
    for mechanism in model.mechanisms.values():
        if mechanism.role == "robot":
            with suppress(UnknownName):  # a robot without a shape is not shown
                tip = mechanism.tip
                yield place_of(model, mechanism.name, Frame(tip.name, tip.mj, np.eye(4)), tip.body_from_frame)


def _taught(model: Model) -> Iterator[Taught]:
    driven = set[str]()
    for number, source in enumerate(model.workstation.sources):
        driven.add(source.target())
        robot = model.mechanisms.get(source.target())
        if not isinstance(source, TakesWaypoints) or robot is None:
            continue
        hand = source.waypoint_target(robot.description)
        if hand is not None:
            yield from _taught_of(model, robot, number, hand)
    for robot in model.mechanisms.values():
        if robot.role == "robot" and robot.name not in driven:
            links = robot.description.links
            hand = WaypointTarget(robot.description.tip, np.eye(4), links[0].name, 0)
            yield from _taught_of(model, robot, None, hand)


def _taught_of(model: Model, robot: Mechanism, source: int | None, hand: WaypointTarget) -> Iterator[Taught]:
    with suppress(UnknownName):  # a link that is not there, or a robot without a shape
        tip, base = (model.frame(f"{robot.name}/{link}") for link in (hand.tip, hand.base))
        yield Taught(
            source=source,
            robot=robot.name,
            tip=place_of(model, robot.name, tip, hand.tip_from_tool),
            base=place_of(model, robot.name, base, np.eye(4)),
            points=hand.points,
        )


def _floor(at: Pose) -> tuple[float, float, float, float, float, float, float]:
    """Where a device's world lies: position [m], quaternion with w first."""
    placed = placement(at)
    x, y, z = placed[:3, 3].tolist()
    w, i, j, k = wxyz_from_rotation(placed[:3, :3])
    return x, y, z, w, i, j, k


def _between(bound: Bound, station: Workstation, *, fed: bool) -> str:
    """Say what is known of the time between instants. A method's own reason holds at the ticks' rate only."""
    criterion, tick = bound.criterion, station.engine.tick
    if not station.sources and not fed:
        return STILL
    sparse = criterion.every is not None and criterion.every > 1.5 * tick
    if bound.watch is None and sparse and criterion.between_samples is None:
        return bound.unbounded
    return bound.between


def _without_physics(model: Model) -> tuple[Finding, ...]:
    if model.workstation.engine.physics:
        return ()
    text = (
        "engine.physics = false: the twin is put where the samples say; whether torque limits and contacts "
        "allow that motion is not looked at"
    )
    return (Finding(level="note", subject="engine", text=text),)


UNKNOWN = (0.55, 0.55, 0.6)
"""Of a lamp of which nobody knows whether it is lit: red, green, blue."""

Look = tuple[float, float, float] | None
"""Red, green, blue in 0…1; None where it is not drawn."""


class Looks:
    """The displays of a workstation, names resolved.

    Args:
        model: The compiled workstation.

    Raises:
        UnknownName: A display is of something that is not there.
    """

    def __init__(self, model: Model) -> None:
        self._displays = tuple(
            (display, tuple(model.bodies[i].name for i in model.select(display.of)))
            for display in model.workstation.displays
        )

    def at(self, state: State) -> dict[str, Look]:
        """Body → how it looks now; nothing where it looks as it is."""
        looks: dict[str, Look] = {}
        for display, bodies in self._displays:
            known = state.signals.at(display.variable, state.t)
            held = state.signals.dictionary[display.variable].when_stale is WhenStale.HOLD
            look: Look
            if known.value is None or (known.invalid_reason and not held):
                # What may be there is drawn.
                if not display.colors:
                    continue
                look = UNKNOWN
            elif (word := _word(known.value)) in display.hidden:
                look = None
            elif word in display.colors:
                look = display.colors[word]
            else:
                continue
            looks |= dict.fromkeys(bodies, look)
        return looks


def _word(value: Value) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


# -- who may be elsewhere than shown --------------------------------------------------------------


def invalid_reasons(state: State) -> dict[str, str]:
    """Robots, people, machines and single bodies that may not be where the twin shows them, with the reason.

    A robot, a person or a machine stands for all that it moves (`Node.mover`). Of a person of whom only
    some bones are in doubt those are named, and what the person holds.
    """
    found: dict[str, str] = {}
    for name in state.invalid_names():
        if reason := state.invalid_place_reason(name):
            found[name] = reason
        elif reason := state.invalid_reason(name):
            hearing = state.hearings[name]
            found |= {f"{name}/{bone}": "no device sees it" for bone in hearing.unobserved(state.t)}
            unplaced = hearing.unplaced(state.t)
            found |= {f"{name}/{bone}": hearing.unplaced_reason(state.t) for bone in unplaced}
            found |= {
                f"{name}/{bone}": why for why, bones in hearing.invalid_parts(state.t) for bone in bones
            }
            held = (body.name for body in state.model.bodies if body.mover == name and body.owner != name)
            found |= dict.fromkeys(held, reason)
    if state.attachments.unknown:
        bodies = state.model.bodies
        found |= {bodies[i].name: why for i, why in state.attachments.unknown.items()}
    return found
