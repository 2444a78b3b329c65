"""From a `Workstation` to a `Model`: read every file, mount everything, compile one MuJoCo model."""

from __future__ import annotations

import logging
import re
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from fnmatch import fnmatchcase
from functools import partial
from pathlib import Path
from types import MappingProxyType

import mujoco
import numpy as np

from seerob.core.errors import InputError, Problem, SeerobError, UnknownName
from seerob.core.snapshot import Finding
from seerob.core.transforms import Array
from seerob.description import lint
from seerob.description.description import Description, Inertial, Link, Quantity
from seerob.description.humans import posture
from seerob.description.loader import load_robot
from seerob.description.robots.calibration import calibrated_by
from seerob.description.robots.scaled import scaled
from seerob.description.shapes import openings
from seerob.description.tools import library
from seerob.distance.least import Shapes
from seerob.model.model import Body, Frame, Mechanism, Model
from seerob.model.mounting import loose as loose_mounting
from seerob.model.mounting import machines as machine_mounting
from seerob.model.mounting.chains import assumed, payload, placeholder
from seerob.model.mounting.contacts import add_contacts
from seerob.model.mounting.in_place import implausible
from seerob.model.mounting.machines import picked_up
from seerob.model.mounting.mechanisms import MechanismDraft, Riders, mechanism
from seerob.model.mounting.overrides import describe, home, overridden
from seerob.model.mounting.specification import Mounting, extreme_points
from seerob.model.mounting.specification import pose_matrix as pose_matrix  # noqa: PLC0414
from seerob.model.mounting.things import (
    AREA_COLOR,
    PART_COLOR,
    TOOL_COLOR,
    WORKPIECE_COLOR,
    MadeArea,
    load_thing,
    mount_sensor,
    mount_swept,
)
from seerob.model.variables import Bound, bound
from seerob.recording.format import filed
from seerob.workstation.tables.machines import Fingers
from seerob.workstation.workstation import (
    Area,
    Human,
    Machine,
    Mounted,
    Part,
    Place,
    Robot,
    Thing,
    Tool,
    Workpiece,
    Workstation,
)


def listed(mounting: Mounting) -> tuple[Body, ...]:
    """The bodies, with `mujoco` indices still to come: contacts are added by name first."""
    bodies = []
    known: dict[tuple[tuple[int, float], ...], tuple[Array, float]] = {}  # instances share their meshes
    for index, entry in enumerate(mounting.entries):
        if all(solid.mesh is not None for solid in entry.solids):
            key = tuple((id(solid.mesh), solid.radius) for solid in entry.solids)
            if key not in known:
                known[key] = extreme_points(entry.solids)
            corners, radius = known[key]
        else:
            corners, radius = extreme_points(entry.solids)
        notes = list(dict.fromkeys(solid.note for solid in entry.solids if solid.note))
        bodies.append(
            Body(
                index=index,
                name=entry.name,
                role=entry.role,
                owner=entry.owner,
                carrier=entry.carrier,
                mj=-1,
                solids=entry.solids,
                corners=corners,
                radius=radius,
                mass=entry.mass,
                mesh=entry.mesh,
                triangles=entry.triangles,
                note="; ".join(notes),
                holder=entry.holder,
            )
        )
    return tuple(bodies)


# MuJoCo's own way is a file in the folder where the user happens to be.
mujoco.set_mju_user_warning(logging.getLogger("mujoco").debug)

Progress = Callable[[str], None]
INERTIA = "principal moments greater than 0, none of them larger than the sum of the others"


def compile_workstation(
    station: Workstation,
    *,
    cache: Path | None = None,
    progress: Progress = lambda _: None,
    made: Mapping[str, MadeArea] = MappingProxyType({}),
) -> Model:
    """Read every file that the workstation names and compile the twin.

    Args:
        station: From `seerob.session.reading.read`.
        cache: Folder for distance trees and convex pieces that take long to make.
        progress: Told what is being read.
        made: Areas that are swept, by name.

    Raises:
        InputError: With every mistake in every file.
    """
    return _Compiler(station, cache, progress, made).run()


class _Compiler:
    def __init__(
        self, station: Workstation, cache: Path | None, progress: Progress, made: Mapping[str, MadeArea]
    ) -> None:
        self.station, self.made = station, made
        self.cache = cache
        self.progress = progress
        self.folder = Path(station.folder)
        self.file = next(iter(station.files), "workstation")
        self.mounting = Mounting(self.file)
        self.problems: list[Problem] = []
        self.chains: dict[str, MechanismDraft] = {}
        self.carriers: dict[str, str] = {}
        self.unweighed: dict[str, str] = {}
        """By tool and workpiece, why it has no mass though somebody gave its density."""
        self.bound = Bound({}, {}, ())

    def run(self) -> Model:
        self.mounting.option(timestep=self.station.engine.timestep, gravity=self.station.engine.gravity)
        self._try("", self._variables)
        self.mounting.findings += left_out(self.station)
        for i, robot in enumerate(self.station.robots):
            if robot.on is None:
                self._try(f"robots[{i}]", partial(self._robot, robot))
        for i, human in enumerate(self.station.humans):
            self._try(f"humans[{i}]", partial(self._human, human))
        for i, part in enumerate(self.station.parts):
            self._try(f"parts[{i}]", partial(self._part, part))
        for i, machine in enumerate(self.station.machines):
            if machine.on is None:
                self._try(f"machines[{i}]", partial(self._machine, machine))
        for i, piece in enumerate(self.station.workpieces):
            if piece.loose:
                self._try(f"workpieces[{i}]", partial(self._loose, piece))
        if not self.problems:
            self._mount_all()
        if not self.problems:
            for i, machine in enumerate(self.station.machines):
                if isinstance(machine.motion, Fingers):
                    self._try(f"machines[{i}]", partial(self._grasps, machine, machine.motion))
            for i, area in enumerate(self.station.areas):
                self._try(f"areas[{i}]", partial(self._area, area))
            for i, sensor in enumerate(self.station.sensors):
                self._try(f"sensors[{i}]", partial(mount_sensor, self.mounting, self.carriers, sensor))
            for i, place in enumerate(self.station.places):
                self._try(f"places[{i}]", partial(self._place, place))
        if self.problems:
            raise InputError(self.problems)
        bodies = listed(self.mounting)
        self._actuators()
        loose = {piece.name: piece.friction for piece in self.station.workpieces if piece.loose}
        conveyors = {part.name for part in self.station.parts if part.conveyor is not None}
        add_contacts(
            self.mounting,
            bodies,
            self.station.contacts,
            file=self.file,
            cache=self.cache,
            loose=loose,
            conveyors=conveyors,
        )
        self.progress("compiling")
        try:
            with warnings.catch_warnings(record=True) as said:
                warnings.simplefilter("always")
                mj = self.mounting.spec.compile()
        except ValueError as error:
            raise self._refused(" ".join(str(error).split())) from error
        self.mounting.findings += [
            Finding(level="warning", subject="", text=f"MuJoCo says: {warning.message}") for warning in said
        ]
        return self._model(mj, bodies)

    def _refused(self, said: str) -> InputError:
        """What MuJoCo says of the model, in the file of the robot or person that it names."""
        named = re.search(r"Element name '([^/']+)/([^']*)'", said)
        owner, link = named.groups() if named else ("", "")
        file, key = (
            (self.chains[owner].description.source, f"link[{link}]")
            if owner in self.chains
            else (self.file, "")
        )
        remedy = f"give it a mass greater than 0 and {INERTIA}, or look at what is mounted there"
        return InputError.at(file, key, f"MuJoCo refuses the model: {said}", remedy)

    def _try(self, key: str, build: Callable[[], None]) -> None:
        try:
            build()
        except InputError as error:
            self.problems += [
                p._replace(
                    file=p.file or self.file, key=f"{key} ({p.key})" if p.key and key else p.key or key
                )
                for p in error.problems
            ]
        except UnknownName as error:
            self.problems.append(Problem(self.file, key, str(error)))

    def _variables(self) -> None:
        self.bound = bound(self.station)
        self.mounting.findings += self.bound.findings
        self.mounting.files |= self.bound.files

    # -- robots and humans ------------------------------------------------------------------

    def _robot(self, robot: Robot) -> None:
        self.progress(f"reading {robot.name} ({robot.model})")
        takes = robot.model.lower().endswith(".xacro") or robot.model.startswith("description:")
        if robot.arguments and not takes:
            what = f"{robot.model} is not a xacro file and takes none"
            raise InputError.at(self.file, "arguments", what, "leave them out, or name the .xacro file")
        description = load_robot(
            robot.model,
            folder=self.folder,
            packages=robot.packages,
            meshes=robot.meshes,
            arguments=robot.arguments,
            name=robot.name,
            outside=self.station.outside,
            visuals=robot.visuals == "read",
        )
        if robot.scale != 1:
            description = scaled(description, robot.scale, name=robot.name)
        description = overridden(description, robot, self.file)
        if robot.calibration is not None:
            description = calibrated_by(description, robot.calibration, self.folder)
        description = self._closing(robot, description)
        q = home(description, robot, self.file)
        on = self._above(robot.on, "on", ("machine",))
        chain = MechanismDraft(description, "robot", q, robot.q is not None, on=on)
        self._chain(robot.name, chain, pose_matrix(robot.base))
        self.mounting.files |= filed(
            robot.name,
            description.files,
            folder=self.folder,
            references=(robot.model, robot.meshes, robot.calibration),
            packages=robot.packages,
        )
        if robot.tool is not None:
            self.chains[robot.name].tip = self._tip_frame(robot)

    def _closing(self, robot: Robot, description: Description) -> Description:
        """What closes openings of its links in reality, or may."""
        found = lint.open_links(description)
        if not found:
            if robot.openings is not None:
                what = f"no mesh of a link of {robot.name} has openings"
                raise InputError.at(self.file, f"{robot.name}.openings", what, "leave openings out")
            return description
        links = tuple(
            replace(link, solids=openings.told(link.solids, robot.openings)) for link in description.links
        )
        level, text = lint.openings(robot.openings, (solid for link in links for solid in link.solids))
        finding = Finding(level=level, subject=robot.name, text=f"{', '.join(found)}: {text}")
        return replace(description, links=links, findings=(*description.findings, finding))

    def _tip_frame(self, robot: Robot) -> Frame | None:
        assert robot.tool is not None
        if any(tool.name == robot.tool for tool in self.station.tools):
            return None  # set when the tool is mounted
        name = robot.tool if "/" in robot.tool else f"{robot.name}/{robot.tool}"
        if not self.mounting.has(name):
            links = [f"{robot.name}/{link.name}" for link in self.chains[robot.name].description.links]
            wrong = UnknownName("link or tool", robot.tool, links + [t.name for t in self.station.tools])
            raise InputError.at(self.file, "tool", str(wrong))
        return Frame(name, -1, np.eye(4))

    def _human(self, human: Human) -> None:
        self.progress(f"making {human.name}")
        description, said = describe(human, touches=bool(self.station.contacts))
        self.mounting.findings += said
        q = posture.posture(description, human.posture, joints=human.joints, file=f"{human.name}.joints")
        self._chain(human.name, MechanismDraft(description, "human", q, True), pose_matrix(human.at))

    def _chain(self, name: str, chain: MechanismDraft, above_from_base: Array) -> None:
        self.chains[name] = chain
        self.mounting.findings += chain.description.findings
        for link in chain.description.links:
            self._link(name, chain, link, above_from_base)

    def _link(self, owner: str, chain: MechanismDraft, link: Link, above_from_base: Array) -> None:
        full = f"{owner}/{link.name}"
        if link.parent is None:
            parent, pose = chain.on or None, above_from_base @ link.parent_from_link
        else:
            parent, pose = f"{owner}/{link.parent}", link.parent_from_link
        body = self.mounting.body(full, parent, pose)
        self.carriers[full] = owner
        for joint in link.joints:
            self.mounting.joint(body, f"{owner}/{joint.name}", joint)
        mass = None
        if link.inertial is not None:
            self.mounting.inertial(body, link.inertial)
            mass = _weight(link.inertial)
        elif link.joints and link.solids:
            self.mounting.inertial(body, placeholder(link.solids))
        elif link.joints:
            self.mounting.massless(body)
        if link.solids or link.visual:
            self.mounting.shape(
                full,
                role=chain.role,
                owner=owner,
                carrier=owner,
                solids=link.solids,
                visual=link.visual,
                mass=mass,
            )

    # -- things -----------------------------------------------------------------------------

    def _part(self, part: Part) -> None:
        self._thing(part, "part", None, pose_matrix(part.at), PART_COLOR)

    def _machine(self, machine: Machine) -> None:
        description, thing = machine_mounting.loaded(machine, self.folder, file=self.file)
        start = machine_mounting.home(machine.motion)
        on = self._above(machine.on, "on", ("robot", "machine"))
        chain = MechanismDraft(description, "machine", start, True, on=on)
        self._chain(machine.name, chain, pose_matrix(machine.at))
        self.mounting.files |= filed(
            machine.name, thing.files, folder=self.folder, references=(machine.mesh,)
        )

    def _loose(self, piece: Workpiece) -> None:
        if not self.station.engine.physics:
            what = f"{piece.name} is loose, and only physics moves it"
            raise InputError.at(self.file, "on", what, "set engine.physics = true, or say what carries it")
        self.progress(f"reading {piece.name}")
        description, thing = loose_mounting.loaded(piece, self.folder, file=self.file)
        self._chain(
            piece.name, MechanismDraft(description, "workpiece", np.zeros(6), True), pose_matrix(piece.at)
        )
        for entry in self.mounting.entries:
            if entry.owner == piece.name:
                entry.holder = piece.name
        self.mounting.files |= filed(piece.name, thing.files, folder=self.folder, references=(piece.mesh,))

    def _grasps(self, gripper: Machine, fingers: Fingers) -> None:
        """Loose workpieces in the hand: in a file that is not run the heaviest of them weighs on it."""
        names = [p.name for p in self.station.workpieces if p.loose and fnmatchcase(p.name, fingers.takes)]
        weights = {name: self.chains[name].description.links[0].inertial for name in names}
        heaviest = max(names, key=lambda name: w.mass if (w := weights[name]) else 0.0, default="")
        between = np.eye(4)
        finger = next(e for e in self.mounting.entries if e.owner == gripper.name)
        ends = extreme_points(finger.solids)[0][:, 2]
        between[2, 3] = 0.5 * (ends.min() + ends.max())
        for entry in [e for e in self.mounting.entries if e.owner in weights]:
            weighs = weights[entry.owner] if entry.owner == heaviest else None
            machine_mounting.graspable(self.mounting, gripper.name, entry, weighs, between)
            self.carriers[f"{gripper.name}/{entry.owner}"] = gripper.name

    def _place(self, place: Place) -> None:
        if place.on is not None and not self.mounting.has(self._body(place.on)):
            raise UnknownName("part, machine or link", place.on, [*self.carriers, *self._parts()])
        names = [other.name for other in self.station.places]
        if place.returns is not None and place.returns not in names:
            raise UnknownName("place", place.returns, names)
        if sum(other.name == place.name for other in self.station.places) > 1:
            what = f"the name {place.name!r} is taken by another place"
            raise InputError.at(self.file, "name", what, "choose another")

    def _parts(self) -> list[str]:
        return [part.name for part in self.station.parts]

    def _area(self, area: Area) -> None:
        on = None if area.on is None else self._body(area.on)
        if on is not None and not self.mounting.has(on):
            raise UnknownName("link, tool or bone", area.on or "", self.carriers)
        if area.swept is not None:
            mount_swept(self.mounting, area, self.made, file=self.file)
        else:
            self._thing(area, "area", on, pose_matrix(area.at), AREA_COLOR)

    def _mount_all(self) -> None:
        """Mount what is on something else; what that is may come later in the file."""
        waiting = [
            *(
                (f"robots[{i}]", robot.on, partial(self._robot, robot))
                for i, robot in enumerate(self.station.robots)
                if robot.on is not None
            ),
            *(
                (f"machines[{i}]", machine.on, partial(self._machine, machine))
                for i, machine in enumerate(self.station.machines)
                if machine.on is not None
            ),
            *(
                (f"tools[{i}]", t.on, partial(self._mount, "tool", t))
                for i, t in enumerate(self.station.tools)
            ),
            *(
                (f"workpieces[{i}]", w.on, partial(self._mount, "workpiece", w))
                for i, w in enumerate(self.station.workpieces)
                if not w.loose
            ),
        ]
        while waiting:
            ready = [entry for entry in waiting if self.mounting.has(self._body(entry[1]))]
            if not ready:
                known = list(self.carriers)
                self.problems += [
                    Problem(self.file, f"{key}.on", str(UnknownName("link or tool", on, known)))
                    for key, on, _ in waiting
                ]
                return
            for entry in ready:
                waiting.remove(entry)
                self._try(entry[0], entry[2])

    def _body(self, on: str) -> str:
        """Full name of the body that ``on`` means: a machine's name means what moves of it."""
        machine = on in self.chains and self.chains[on].role == "machine"
        return f"{on}/{machine_mounting.BODY}" if machine else on

    def _above(self, on: str | None, key: str, roles: tuple[str, ...]) -> str:
        """Full name of the body that carries a chain of joints; empty for the world.

        Raises:
            InputError: It is carried by what cannot carry it.
        """
        if on is None:
            return ""
        carrier = self.carriers.get(self._body(on), "")
        if not carrier or self.chains[carrier].role not in roles:
            what = f"{on} carries no joints"
            raise InputError.at(self.file, key, what, f"name what moves: a {' or a '.join(roles)}")
        return self._body(on)

    def _mount(self, role: str, thing: Mounted) -> None:
        color = TOOL_COLOR if role == "tool" else WORKPIECE_COLOR
        on = self._body(thing.on)
        self._thing(thing, role, on, pose_matrix(thing.at), color)
        if isinstance(thing, Workpiece) and thing.rest is not None:
            machine = next((m for m in self.station.machines if m.name == thing.on), None)
            picked_up(self.mounting, thing, machine, pose_matrix(thing.rest), file=self.file)
        if isinstance(thing, Tool):
            carrier = self.carriers[on]
            wanted = next((r.tool for r in self.station.robots if r.name == carrier), None)
            tip = None if thing.tcp is None else pose_matrix(thing.tcp)
            if tip is None and thing.library is not None:
                tip = library.load(thing.library).tcp
            if tip is not None and wanted in (None, thing.name):
                self.chains[carrier].tip = Frame(thing.name, -1, tip)

    def _thing(
        self,
        thing: Thing,
        role: str,
        parent: str | None,
        parent_from_thing: Array,
        color: tuple[float, float, float, float],
    ) -> None:
        self.progress(f"reading {thing.name}")
        moves = role in ("tool", "workpiece")
        loaded = load_thing(thing, self.folder, color, needs_mass=moves, file=self.file, cache=self.cache)
        self.mounting.findings += loaded.findings
        self.mounting.files |= filed(thing.name, loaded.files, folder=self.folder, references=(thing.mesh,))
        carrier = "" if parent is None else self.carriers[parent]
        body = self.mounting.body(thing.name, parent, parent_from_thing)
        if carrier:
            self.carriers[thing.name] = carrier
        mass = None
        if loaded.refused_mass:
            self.unweighed[thing.name] = loaded.refused_mass
        if loaded.inertial is not None:
            self.mounting.inertial(body, loaded.inertial)
            mass = _weight(loaded.inertial)
        for piece in loaded.pieces:
            name = f"{thing.name}/{piece.name}" if piece.name else thing.name
            if piece.name:
                self.mounting.body(name, thing.name, np.eye(4))
                if carrier:
                    self.carriers[name] = carrier
            self.mounting.shape(
                name,
                role=role,
                owner=thing.name,
                carrier=carrier,
                solids=piece.solids,
                visual=piece.visual,
                mass=mass if piece is loaded.pieces[0] else None,
            )

    # -- the model --------------------------------------------------------------------------

    def _actuators(self) -> None:
        """One per degree of freedom of all but loose workpieces, in the same order; the engine sets them."""
        loose = (piece.name for piece in self.station.workpieces if piece.loose)
        free = {f"{name}/{joint}" for name in loose for joint in loose_mounting.JOINTS}
        for joint in self.mounting.spec.joints:
            if joint.name in free:
                continue
            self.mounting.spec.add_actuator(
                name=joint.name,
                target=joint.name,
                trntype=mujoco.mjtTrn.mjTRN_JOINT,
                gaintype=mujoco.mjtGain.mjGAIN_FIXED,
                biastype=mujoco.mjtBias.mjBIAS_AFFINE,
            )

    def _model(self, mj: mujoco.MjModel, bodies: Sequence[Body]) -> Model:
        numbered = tuple(replace(body, mj=_body_id(mj, body.name)) for body in bodies)
        frames = {
            name: Frame(name, _body_id(mj, name), np.eye(4))
            for name in (*self.carriers, *(part.name for part in self.station.parts))
        }
        self.progress("building distance trees")
        shapes = Shapes.build([(body.name, body.solids) for body in numbered], cache=self.cache)
        riders = self._riders()
        mechanisms = {
            name: mechanism(mj, name, chain, riders, self.carriers, numbered)
            for name, chain in self.chains.items()
        }
        model = Model(
            workstation=self.station,
            mj=mj,
            bodies=numbered,
            frames=frames,
            mechanisms=mechanisms,
            shapes=shapes,
            meshes=self.mounting.meshes,
            findings=(
                *self.mounting.findings,
                *(f for robot in self.station.robots for f in self._about(robot, mechanisms[robot.name])),
            ),
            files={**self.station.files, **self.mounting.files},
            dictionary=self.bound.variables,
            cache=self.cache,
        )
        findings = (*model.findings, *self._too_small(model), *implausible(model), *unasked(model))
        return replace(model, findings=findings)

    def _too_small(self, model: Model) -> Iterator[Finding]:
        """What is said of areas that something sweeps of which no shape shows a part."""
        for area in self.station.areas:
            if area.swept is not None and (unshaped := model.unshaped((area.swept.of,))):
                text = f"{area.name} is swept by what is not all shown: {unshaped}"
                yield Finding(level="warning", subject=area.name, text=text, holds=(area.name,))

    def _riders(self) -> Riders:
        return Riders(self.chains, self.carriers, self.mounting.entries, self.unweighed)

    def _about(self, robot: Robot, mechanism: Mechanism) -> list[Finding]:
        given = self.chains[robot.name].tip is not None or robot.model.startswith("library:")
        return [*assumed(mechanism, tip_given=given), *payload(robot.name, self._riders().things(robot.name))]


def _weight(inertial: Inertial) -> Quantity:
    return Quantity(
        inertial.mass,
        inertial.origin,
        inertial.source,
        inertial.error,
        inertial.spread_error,
        inertial.within,
        inertial.gyration,
    )


def _body_id(mj: mujoco.MjModel, name: str) -> int:
    return int(mujoco.mj_name2id(mj, mujoco.mjtObj.mjOBJ_BODY, name))


def left_out(station: Workstation) -> Iterator[Finding]:
    """What is said of things that the file says are not in it."""
    for thing in station.left_out:
        what = "is left out of the twin" + (f" ({thing.why})" if thing.why else "")
        if thing.accepted is None:
            text = f'{what}: bring it, or say in [[left_out]] why that does not matter, accepted = "…"'
            yield Finding(level="warning", subject=thing.name, text=text, holds=("*",))
        else:
            text = f"{what}, so that nothing is judged of it: {thing.accepted}"
            yield Finding(level="assumed", subject=thing.name, text=text)


def unasked(model: Model) -> Iterator[Finding]:
    """Robots and machines that move and are judged by nobody, and people whom nobody asks about.

    One that carries a robot which somebody asks about holds that robot: nothing said of an arm is within
    while what moves it is not looked at.
    """
    station = model.workstation
    if not station.humans or not station.safety:
        return
    judged: set[int] = set()
    for criterion in station.safety:
        # A name that does not exist is told where the criterion is bound.
        with suppress(SeerobError):
            judged |= criterion.judged(model)
    named = {name for criterion in station.safety for name in criterion.subjects()}
    yield from _people(model)
    for moving in model.mechanisms.values():
        own = {i for i in moving.moving if model.bodies[i].carrier == moving.name}
        if not own or not own.isdisjoint(judged) or not _moves(model, moving):
            continue
        carried = tuple(
            m.name
            for m in model.mechanisms.values()
            if moving.name in model.carriers_of(m.name)
            and (m.name in named or not judged.isdisjoint(m.bodies))
        )
        remedy = f'name it in one, such as separation between = ["{moving.name}", "{station.humans[0].name}"]'
        what = (
            f"not evaluated: {moving.name} moves and carries {', '.join(carried)}"
            if carried
            else f"not evaluated: {moving.name} moves"
        )
        text = f"{what}, and no criterion asks about it: {remedy}"
        yield Finding(level="warning", subject=moving.name, text=text, holds=carried)


def _people(model: Model) -> Iterator[Finding]:
    """People whom no criterion of safety asks about, while it asks about others."""
    asked: set[str] = set()
    for criterion in model.workstation.safety:
        with suppress(SeerobError):
            asked |= {*criterion.subjects(), *criterion.depends(model)}
    humans = {human.name for human in model.workstation.humans}
    for name in [human.name for human in model.workstation.humans] if humans & asked else []:
        if name not in asked:
            others = ", ".join(sorted(humans & asked))
            text = (
                f"not evaluated: criteria ask about {others}, and none about {name}: name {name} in one, too"
            )
            yield Finding(level="warning", subject=name, text=text)


def _moves(model: Model, mechanism: Mechanism) -> bool:
    """Whether a source or variables drive it."""
    station = model.workstation
    if mechanism.name in {source.target() for source in station.sources}:
        return mechanism.role != "human"
    return any(m.name == mechanism.name and m.motion.variables() for m in station.machines)
