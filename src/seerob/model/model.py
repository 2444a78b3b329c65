"""The compiled workstation: everything that does not change while it runs.

One `mujoco.MjModel` for the whole workstation, exact distance geometry, and the way from every
name in the file to an index. Names are resolved here, once; the loop only sees indices.
"""

from __future__ import annotations

from collections.abc import Iterable
from copy import copy, deepcopy
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from functools import cached_property
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from seerob.core.errors import InputError, Problem, UnknownName
from seerob.core.shapes import Solid
from seerob.core.snapshot import Finding, LinkMass, Origin
from seerob.core.transforms import Array, inverse, rotation_from_wxyz, transform
from seerob.description.description import Description, Joint, Quantity
from seerob.distance.least import Query, Shapes
from seerob.workstation.variables import Variable
from seerob.workstation.workstation import Workstation

Indices = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Body:
    """One named rigid body with a shape: a link, a tool, a workpiece, a part, a bone."""

    index: int
    """Slot in `State.rotations`, in distance queries and in `Snapshot.poses`."""
    name: str
    """Unique full name."""
    role: str
    """``robot``, ``tool``, ``workpiece``, ``part`` or ``human``."""
    owner: str
    """The table entry it comes from."""
    carrier: str
    """The robot that moves it, the human it is part of, or empty."""
    mj: int
    """Body of the `mujoco.MjModel`."""
    solids: tuple[Solid, ...]
    corners: Array
    """Points in its own frame whose convex hull, dilated by ``radius``, contains it, shape (k, 3) [m]."""
    radius: float
    """[m]"""
    mass: Quantity | None
    mesh: str | None
    """Hash of the display mesh."""
    triangles: int
    note: str
    holder: str = ""
    """The gripper that picks it up and lets it go, or its own name where people do: where it is, or whether
    it is here, depends on it."""

    def __repr__(self) -> str:
        return f"<Body {self.index} {self.name!r}: {self.role}, {len(self.solids)} solids>"

    @property
    def mover(self) -> str:
        """Whoever decides where it is: the robot or the person that carries it, or a gripper; or empty."""
        return self.carrier or self.holder

    @property
    def deviation(self) -> float:
        """How far the real surface may lie outside the shape used for distances [m]."""
        return max((solid.deviation for solid in self.solids), default=0.0)

    @property
    def may_be_closed(self) -> bool:
        """Whether its mesh has openings of which nobody says whether they are closed in reality."""
        return any(solid.lids for solid in self.solids)

    @property
    def closed(self) -> Body:
        """This body with these closed, solids in the order of `Shapes.closed`."""
        lids = (lid for solid in self.solids for lid in solid.closings)
        return replace(self, solids=(*(replace(solid, lids=()) for solid in self.solids), *lids))


@dataclass(frozen=True, eq=False)
class Frame:
    """A point of interest fixed to a body."""

    name: str
    mj: int
    """Body of the `mujoco.MjModel`."""
    body_from_frame: Array
    """Shape (4, 4)."""


@dataclass(frozen=True, eq=False)
class Mechanism:
    """A robot or a human: joints that are driven, bodies that follow."""

    name: str
    role: str
    """``robot``, ``human``, ``machine``, or ``workpiece`` for one that is loose."""
    description: Description
    joints: tuple[Joint, ...]
    """The n joints that are commanded."""
    q_address: Indices
    """Columns of all joints, mimics included, in ``MjData.qpos``, shape (m,)."""
    v_address: Indices
    """In ``MjData.qvel``, shape (m,)."""
    coupling: Array
    """All joints from the commanded ones: ``q_all = coupling @ q + offset``, shape (m, n)."""
    offset: Array
    """Shape (m,)."""
    own: Indices
    """Row of each commanded joint among all of them, shape (n,)."""
    home: Array
    """Where it stands when nothing drives it, shape (n,) [rad or m]."""
    home_given: bool
    """Whether the file says so."""
    tip: Frame
    """Its point of interest: the tool's working point."""
    bodies: tuple[int, ...]
    """Its own bodies with a shape."""
    carried: tuple[int, ...]
    """Bodies of tools and workpieces mounted on it."""
    moving: tuple[int, ...]
    """Bodies, its own and carried ones, that its joints move."""
    mj_bodies: Indices
    """Every `mujoco` body that its joints move, tools and workpieces included."""
    masses: tuple[LinkMass, ...]
    """What each of its links weighs, and each thing on it."""
    unweighed: tuple[int, ...]
    """Bodies of `mujoco` that have another mass than nobody gave: what moves the twin in its place."""
    load: frozenset[int]
    """Bodies of `mujoco` that count as its load: what is mounted on it, by its own file too."""
    unknown_masses: tuple[str, ...]
    """What of its moving bodies has a mass that nobody gave, one sentence each."""
    velocity_limits: tuple[Quantity | None, ...]
    effort_limits: tuple[Quantity | None, ...]
    rotor_inertia_known: bool
    impossible_masses: tuple[Problem, ...] = ()
    """What files say of those that no body has, such as 0 kg."""
    on: str = ""
    """Robot or machine that carries it; empty when it stands in the world."""
    riders: tuple[str, ...] = ()
    """Machines that are mounted on it: their bodies are among its own, their joints are not."""
    holders: tuple[str, ...] = ()
    """Machines among ``riders`` that pick things up: its mass depends on them."""
    unshaped: tuple[str, ...] = ()
    """Full names of links and things with a mass, part of which lies where none of their shapes is."""

    def __repr__(self) -> str:
        return f"<Mechanism {self.name!r}: {self.role}, {len(self.joints)} joints, {len(self.bodies)} bodies>"

    @property
    def links(self) -> frozenset[str]:
        """Full names of its own links, which no name of a tool is taken for."""
        return frozenset(f"{self.name}/{link.name}" for link in self.description.links)

    @property
    def alone(self) -> bool:
        """Whether all that its bodies do follows from its own joints."""
        return not self.on and not self.riders

    @property
    def roughly_weighed(self) -> str:
        """Why masses of its links are figures of which intervals alone follow; empty where they are known."""
        inertials = [link.inertial for link in self.description.links if link.inertial is not None]
        if not any(one.error or one.spread_error or one.within for one in inertials):
            return ""
        return f"of the links of {self.name} masses are known within bounds alone: give them in masses"

    def require_masses(self, who: str) -> None:
        """Refuse a figure that rests on masses that cannot be; those that nobody gave leave it undecided.

        Args:
            who: The criterion whose figure it is.

        Raises:
            InputError: With every such mass.
        """
        if self.impossible_masses:
            remedy = f"give it in masses of {self.name} in the workstation file, or mend that file"
            raise InputError(
                p._replace(what=f"{p.what}; {who} needs it", remedy=f"{p.remedy}: {remedy}")
                for p in self.impossible_masses
            )

    @property
    def lower(self) -> Array:
        """Lower position limits [rad or m], -inf where there is none, shape (n,)."""
        return np.array([-np.inf if j.lower is None else j.lower for j in self.joints])

    @property
    def upper(self) -> Array:
        """Upper position limits [rad or m], inf where there is none, shape (n,)."""
        return np.array([np.inf if j.upper is None else j.upper for j in self.joints])

    @property
    def units(self) -> tuple[str, ...]:
        """``rad`` or ``m`` per joint."""
        return tuple("rad" if joint.kind == "revolute" else "m" for joint in self.joints)


@dataclass(frozen=True, eq=False)
class Gap:
    """A distance question between two named sets, bound once."""

    query: Query
    a: tuple[int, ...]
    """Bodies of the first set."""
    b: tuple[int, ...]
    carriers: tuple[str, ...]
    """Robots and humans whose pose the answer depends on."""
    deviation: float
    """How much nearer the real surfaces may be than the shapes used, as far as known [m]."""
    notes: tuple[str, ...]
    """What the shapes are when they are not the real thing."""

    @cached_property
    def bodies(self) -> tuple[int, ...]:
        """Those of both sets."""
        return *self.a, *self.b


Gaps = dict[tuple[tuple[int, ...], tuple[int, ...]], "Gap"]
Owned = tuple[mujoco.MjModel, Shapes, Gaps, tuple[Body, ...], dict[str, Frame], dict[str, Mechanism]]
"""What of a `Model` can be written to, copied."""


@dataclass(frozen=True, eq=False, repr=False)
class Model:
    """A compiled workstation; frozen. Made by `seerob.model.mounting.compilation.compile_workstation`."""

    workstation: Workstation
    mj: mujoco.MjModel
    """The `mujoco.MjModel` of the whole workstation."""
    bodies: tuple[Body, ...]
    frames: dict[str, Frame]
    """Every link by full name, also those without a shape."""
    mechanisms: dict[str, Mechanism]
    shapes: Shapes
    meshes: dict[str, bytes]
    """Display meshes, binary glTF by hash."""
    findings: tuple[Finding, ...]
    files: dict[str, bytes]
    """The workstation file and every file it names, by the name that it gives them."""
    dictionary: dict[str, Variable] = field(default_factory=dict)
    """Variables of controllers and machines by their names here."""
    cache: Path | None = None
    """Folder that keeps what takes long to make between starts."""
    _gaps: Gaps = field(default_factory=dict)
    _owned: dict[str, Owned] = field(default_factory=dict)

    def __repr__(self) -> str:
        of = f"{len(self.bodies)} bodies, {', '.join(self.mechanisms) or 'nobody moves'}"
        return f"<Model {self.workstation.title!r}: {of}>"

    def own_of(self, author: str) -> Model:
        """The copy that a criterion of one's own is given, by its name.

        Whatever it writes into MuJoCo's model, masses or shapes of bodies, joints and frames, or into the
        geometry that distances are asked of, changes nothing for anybody else.
        """
        if author not in self._owned:
            bodies, frames, mechanisms = deepcopy((self.bodies, self.frames, self.mechanisms))
            self._owned[author] = copy(self.mj), self.shapes.copied(), {}, bodies, frames, mechanisms
        mj, shapes, gaps, bodies, frames, mechanisms = self._owned[author]
        if any(piece.rest is not None or piece.loose for piece in self.workstation.workpieces):
            mj = copy(self.mj)  # what is picked up changes masses from tick to tick
        dictionary = {**self.dictionary}
        return replace(
            self, mj=mj, bodies=bodies, frames=frames, mechanisms=mechanisms, dictionary=dictionary,
            shapes=shapes, _gaps=gaps,
        )  # fmt: skip

    @cached_property
    def closed(self) -> Model | None:
        """This model with all openings closed of which nobody says whether they are; None without any.

        Only what distances are asked of is another one, in the arrays of this one's.
        """
        if not any(self.shapes.lids):
            return None
        bodies = tuple(body.closed if body.may_be_closed else body for body in self.bodies)
        return replace(self, bodies=bodies, shapes=self.shapes.closed(), _gaps={}, _owned={})

    @cached_property
    def possibly_closed(self) -> tuple[str, ...]:
        """Table entries whose meshes have openings of which nobody says whether they are closed."""
        return tuple(dict.fromkeys(body.owner for body in self.bodies if body.may_be_closed))

    @property
    def estimate_uncertainty(self) -> dict[str, float]:
        """How far bones that nobody sees may be off [m], of the people whose estimate the file accepts."""
        people = self.workstation.humans
        return {h.name: h.unseen_uncertainty for h in people if h.unseen_uncertainty is not None}

    @property
    def folder(self) -> Path:
        """Folder of the workstation file."""
        return Path(self.workstation.folder)

    def mechanism(self, name: str) -> Mechanism:
        """The robot or human of that name; UnknownName when there is none."""
        if name not in self.mechanisms:
            raise UnknownName("robot or human", name, self.mechanisms)
        return self.mechanisms[name]

    def robot(self, name: str) -> Mechanism:
        """The robot of that name; UnknownName when there is none."""
        robots = {n: m for n, m in self.mechanisms.items() if m.role == "robot"}
        if name not in robots:
            raise UnknownName("robot", name, robots)
        return robots[name]

    def mover(self, name: str) -> Mechanism:
        """The robot or machine of that name; UnknownName when there is none."""
        movers = {n: m for n, m in self.mechanisms.items() if m.role != "human"}
        if name not in movers:
            raise UnknownName("robot or machine", name, movers)
        return movers[name]

    def carriers_of(self, name: str) -> tuple[str, ...]:
        """Machines that carry a robot or machine, the nearest first."""
        found: list[str] = []
        above = self.mechanisms[name].on
        while above:
            found.append(above)
            above = self.mechanisms[above].on
        return tuple(found)

    def moving_of(self, name: str) -> tuple[int, ...]:
        """Moving bodies of a robot or machine, and of what carries it: whoever stops it stops both."""
        names = (self.mover(name).name, *self.carriers_of(name))
        return tuple(dict.fromkeys(i for each in names for i in self.mechanisms[each].moving))

    def human(self, name: str) -> Mechanism:
        """The human of that name; UnknownName when there is none."""
        humans = {n: m for n, m in self.mechanisms.items() if m.role == "human"}
        if name not in humans:
            raise UnknownName("human", name, humans)
        return humans[name]

    def frame(self, name: str) -> Frame:
        """A point of interest: a robot's name means its tool's working point, else a link's full name."""
        if name in self.mechanisms:
            return self.mechanisms[name].tip
        if name not in self.frames:
            raise UnknownName("link or frame", name, [*self.mechanisms, *self.frames])
        return self.frames[name]

    def between(self, a: Frame, b: Frame) -> Array | None:
        """Frame a from frame b, shape (4, 4); None where something can move one against the other."""
        if self.mj.body_weldid[a.mj] != self.mj.body_weldid[b.mj]:
            return None
        a_from_b: Array = inverse(self._welded(a)) @ self._welded(b)
        return a_from_b

    def _welded(self, frame: Frame) -> Array:
        """Pose of a frame in the body to which no joint connects its own, shape (4, 4)."""
        pose, body = frame.body_from_frame, frame.mj
        while body != self.mj.body_weldid[body]:
            turn = rotation_from_wxyz(self.mj.body_quat[body])
            pose = transform(turn, self.mj.body_pos[body]) @ pose
            body = int(self.mj.body_parentid[body])
        return pose

    def carrier(self, frame: Frame) -> Mechanism:
        """The robot, human or machine that moves a frame: of several the robot, else the innermost.

        Raises:
            UnknownName: None does.
        """
        movers = [m for m in self.mechanisms.values() if frame.mj in m.mj_bodies]
        if movers:
            return min(movers, key=lambda m: (m.role == "machine", len(m.mj_bodies)))
        raise UnknownName("robot or human that moves", frame.name, self.mechanisms)

    def select(self, name: str) -> tuple[int, ...]:
        """Bodies that a name means.

        A robot's name means all of its links and everything mounted on it, and what carries it: a cart
        that hits somebody is no less of the robot that stands on it (``arm/*`` means its links alone). A
        human's means the whole person; a tool's or part's name, or a prefix that ends before a ``/``,
        everything below it; ``*`` stands for any characters. A safety area is meant by its own name only.

        Raises:
            UnknownName: The name means no body that has a shape.
        """
        if name in self.mechanisms:
            mechanism = self.mechanisms[name]
            found: tuple[int, ...] = mechanism.bodies + mechanism.carried
            carriers = [self.mechanisms[each] for each in self.carriers_of(name)]
            if mechanism.role == "robot":
                every = (i for each in carriers for i in (*each.bodies, *each.carried))
                found = tuple(dict.fromkeys((*found, *every)))
        else:
            found = tuple(
                body.index
                for body in self.bodies
                if name in (body.name, body.owner)
                or (
                    body.role != "area" and (body.name.startswith(name + "/") or fnmatchcase(body.name, name))
                )
            )
        if not found:
            raise UnknownName("robot, human, tool or part with a shape", name, self.names())
        return found

    def unshaped(self, names: Iterable[str]) -> str:
        """What no shape shows of robots and links that names mean, in a sentence; empty for nothing.

        Names are those of `select`.
        """
        found: dict[str, None] = {}
        for name in names:
            found |= dict.fromkeys(
                link
                for m in self.mechanisms.values()
                for link in m.unshaped
                if name in (m.name, link) or link.startswith(name + "/") or fnmatchcase(link, name)
            )
        links = ", ".join(found)
        return f"no shape shows {links}, which has a mass: give it one, or mount one on it" if links else ""

    def names(self) -> tuple[str, ...]:
        """Every name that `select` takes without wildcards."""
        shaped = (name for name, m in self.mechanisms.items() if m.bodies or m.carried)
        found: dict[str, None] = dict.fromkeys(shaped)
        for body in self.bodies:
            pieces = body.name.split("/")
            found.update(dict.fromkeys("/".join(pieces[:i]) for i in range(1, len(pieces) + 1)))
        return tuple(found)

    def gap(self, a: Iterable[int], b: Iterable[int]) -> Gap:
        """The distance question between two sets of bodies; equal questions are the same object."""
        key = (tuple(a), tuple(b))
        if key not in self._gaps:
            chosen = [self.bodies[i] for i in (*key[0], *key[1])]
            self._gaps[key] = Gap(
                query=Query(self.shapes, key[0], key[1]),
                a=key[0],
                b=key[1],
                carriers=tuple(dict.fromkeys(body.mover for body in chosen if body.mover)),
                deviation=sum(max(self.bodies[i].deviation for i in side) for side in key),
                notes=tuple(dict.fromkeys(f"{b.owner}: {b.note}" for b in chosen if b.note)),
            )
        return self._gaps[key]

    def mass_origin(self, body: Body) -> Origin:
        """Where the mass of a body comes from."""
        return Origin.MISSING if body.mass is None else body.mass.origin
