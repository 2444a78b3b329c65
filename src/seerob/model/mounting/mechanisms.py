"""From mounted chains to mechanisms: which joints and bodies are whose, who rides on whom, what is unseen."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from seerob.core.snapshot import LinkMass, Origin
from seerob.core.transforms import Array
from seerob.description.description import Description
from seerob.description.lint import DENSITIES, FRAME
from seerob.model.model import Body, Frame, Mechanism
from seerob.model.mounting.chains import ONE_PLACE, beyond_flange, couple, unknown_masses, weighed
from seerob.model.mounting.specification import Entry

THINGS = ("tool", "workpiece")
NOT_WEIGHED = "nobody gave its mass or its density"
SLIP = 0.1
"""How far the centre of mass of what has a shape of its own may lie outside it [m]: makers' files put those
of wrists up to 0.07 m outside their meshes (UR3, UR5 and UR10 of example-robot-data)."""
LUMP = 0.02
"""How far the centre of mass of what has no shape of its own may lie outside the shape that it is fixed to
[m]; all of its inertia may be outside by `SLIP`."""


@dataclass
class MechanismDraft:
    """A robot, a person or a machine on its way to a `Mechanism`."""

    description: Description
    role: str
    home: Array
    home_given: bool
    tip: Frame | None = None
    on: str = ""
    """Full name of the body that carries it; empty when it stands in the world."""


class Riders:
    """Who is mounted on whom.

    Args:
        chains: By name.
        carriers: Who carries each body, by the body's full name.
        entries: Bodies with a shape.
    """

    def __init__(
        self,
        chains: Mapping[str, MechanismDraft],
        carriers: Mapping[str, str],
        entries: Sequence[Entry],
        unweighed: Mapping[str, str],
    ) -> None:
        self._chains, self._carriers, self._entries = chains, carriers, entries
        self._unweighed = unweighed

    def above(self, name: str) -> str:
        """Who carries a robot or machine; empty for the world."""
        on = self._chains[name].on
        return self._carriers[on] if on else ""

    def of(self, name: str) -> tuple[str, ...]:
        """Machines mounted on a robot or a machine, and on those; a robot is no part of what it is on."""
        found: list[str] = []
        for other, chain in self._chains.items():
            if chain.role == "machine" and self.above(other) == name:
                found += [other, *self.of(other)]
        return tuple(found)

    def things(self, name: str) -> dict[str, float | None]:
        """Mass [kg] of each tool, workpiece and machine on a robot or machine; None when nobody gave one."""
        riders = self.of(name)
        things: dict[str, float | None] = {}
        for entry in self._entries:
            if entry.role == "workpiece" and entry.holder == entry.owner:
                continue  # loose: who holds it, and whether, only a run tells
            mounted = entry.carrier in (name, *riders) and entry.role in THINGS and entry.owner != name
            mass = None if entry.mass is None else entry.mass.value
            if entry.owner in riders:
                known = things.setdefault(entry.owner, 0.0)
                things[entry.owner] = None if known is None or mass is None else known + mass
            elif mounted:  # one mass for all its pieces
                known = things.setdefault(entry.owner, None)
                things[entry.owner] = known if mass is None else mass
        return things

    def _refused(self, machine: str) -> str:
        """Why what is on a robot has no mass, if it is a machine of which somebody gave a density."""
        chain = self._chains.get(machine)
        links = () if chain is None else chain.description.links
        return next((link.refused_mass for link in links if link.refused_mass), "")

    def weighed(self, name: str) -> tuple[LinkMass, ...]:
        """What each link of a robot or machine weighs, and each thing on it."""
        chain = self._chains[name]
        rows = [*weighed(chain.description, carried=bool(chain.on))]
        given = {e.owner: e.mass for e in self._entries if e.mass is not None}
        for thing, mass in self.things(name).items():
            stated = None if mass is None else given[thing]
            if stated is None:
                note = self._unweighed.get(thing) or self._refused(thing) or NOT_WEIGHED
                rows.append(LinkMass(name=thing, origin=Origin.MISSING, note=note))
            else:
                rows.append(LinkMass(name=thing, mass=mass, origin=stated.origin, source=stated.source))
        return tuple(rows)


def mechanism(
    mj: mujoco.MjModel,
    name: str,
    chain: MechanismDraft,
    riders: Riders,
    carriers: Mapping[str, str],
    bodies: Sequence[Body],
) -> Mechanism:
    """A chain as the compiled model has it.

    Args:
        mj: The `mujoco.MjModel`.
        name: Of the robot, person or machine.
        chain: What was mounted.
        riders: Who is mounted on whom.
        carriers: Who carries each body, by the body's full name.
        bodies: Of the workstation, numbered.
    """
    every = [joint for link in chain.description.links for joint in link.joints]
    commanded = [joint for joint in every if joint.mimic is None]
    coupling, offset = couple(every, commanded)
    ids = [mujoco.mj_name2id(mj, mujoco.mjtObj.mjOBJ_JOINT, f"{name}/{joint.name}") for joint in every]
    aboard = (name, *riders.of(name))
    own = {full: _body_id(mj, full) for full, carrier in carriers.items() if carrier in aboard}
    mj_bodies = np.array(sorted(i for i in own.values() if mj.body_weldid[i] != 0), np.int64)
    links = {f"{name}/{link.name}" for link in chain.description.links}
    beyond = {f"{name}/{link}" for link in beyond_flange(chain.description)}
    moving_ids = set(mj_bodies.tolist())
    own_bodies = [b for b in bodies if b.carrier in aboard and b.role != "area"]
    tip = chain.tip if chain.tip is not None else Frame(f"{name}/{chain.description.tip}", -1, np.eye(4))
    masses = riders.weighed(name)
    return Mechanism(
        name=name,
        role=chain.role,
        description=chain.description,
        joints=tuple(commanded),
        q_address=np.array([mj.jnt_qposadr[i] for i in ids], np.int64),
        v_address=np.array([mj.jnt_dofadr[i] for i in ids], np.int64),
        coupling=coupling,
        offset=offset,
        own=np.array([i for i, joint in enumerate(every) if joint.mimic is None], np.int64),
        home=chain.home,
        home_given=chain.home_given,
        tip=replace(tip, mj=_body_id(mj, tip.name)),
        bodies=tuple(b.index for b in bodies if b.owner == name),
        carried=tuple(b.index for b in own_bodies if b.owner != name),
        moving=tuple(b.index for b in own_bodies if b.mj in moving_ids),
        mj_bodies=mj_bodies,
        masses=masses,
        unweighed=tuple(
            i
            for row in masses
            if row.mass is None and (i := own.get(row.name, 0)) in moving_ids and mj.body_mass[i] > 0
        ),
        load=frozenset(
            i for full, i in own.items() if i in moving_ids and (full not in links or full in beyond)
        ),
        unknown_masses=unknown_masses(masses),
        impossible_masses=tuple(
            link.impossible_mass
            for link, row in zip(chain.description.links, masses, strict=False)
            if link.impossible_mass and row.mass is None
        ),
        velocity_limits=tuple(joint.velocity for joint in commanded),
        effort_limits=tuple(joint.effort for joint in commanded),
        rotor_inertia_known=all(joint.armature is not None for joint in commanded),
        on=riders.above(name),
        riders=riders.of(name),
        holders=tuple(dict.fromkeys(b.holder for b in own_bodies if b.holder and b.holder != name)),
        unshaped=() if chain.role == "human" else tuple(_unshaped(mj, masses, own_bodies)),
    )


def stands_out(a: float, b: float, variance: float) -> float:
    r"""How far a body at least reaches out of a span along an axis [m]; negative where it need not.

    What lies between :math:`x - a` and :math:`x + b` around its mean x has a variance of at most
    :math:`a b` (Bhatia and Davis 2000); the least e with :math:`(a + e)(b + e) \ge \sigma^2` is
    :math:`\sqrt{((a - b)/2)^2 + \sigma^2} - (a + b)/2`.

    Args:
        a: From the low end of the span to the centre of mass [m]; negative where that lies below it.
        b: From the centre of mass to the high end [m].
        variance: Of where the mass is along the axis, second moment over mass [m²].
    """
    return math.sqrt(((a - b) / 2) ** 2 + variance) - (a + b) / 2


def _unshaped(mj: mujoco.MjModel, masses: Iterable[LinkMass], bodies: Sequence[Body]) -> Iterable[str]:
    """Bodies with a mass of which some lies, by centre of mass and inertia, where nothing has a shape.

    The shapes of all that moves as one with a body count, and all its mass must go into them. A body whose
    mass nobody knows is shown by a shape of its own; by that of another only where its file says nothing.
    What is as light as a frame is none where it reaches from one joint to another that moves more than that.
    """
    data = mujoco.MjData(mj)
    mujoco.mj_kinematics(mj, data)
    mujoco.mj_comPos(mj, data)
    groups: dict[int, list[tuple[int, str, float]]] = {}
    for row in masses:
        i = _body_id(mj, row.name)
        if i > 0 and row.mass is None:
            near = [body.mj for body in bodies if mj.body_weldid[body.mj] == mj.body_weldid[i]]
            if i not in near and (row.note or not near):
                yield row.name
            elif i in near and row.note and mj.body_mass[i] > 0:  # where its centre lies is said all the same
                groups.setdefault(int(mj.body_weldid[i]), []).append((i, row.name, 0.0))
        elif i > 0 and 0 < (row.mass or 0.0) <= FRAME:
            if not any(mj.body_weldid[body.mj] == mj.body_weldid[i] for body in bodies) and _spans(
                mj, data, i
            ):
                yield row.name
        elif i > 0 and row.mass:
            groups.setdefault(int(mj.body_weldid[i]), []).append((i, row.name, float(mj.body_mass[i])))
    for weld, heavy in groups.items():
        shown = [body for body in bodies if int(mj.body_weldid[body.mj]) == weld and len(body.corners)]
        room = sum(map(_room, shown))
        dense = sum(mass for *_, mass in heavy) > DENSITIES[1] * room
        for i, name, _ in heavy:
            if dense:  # also where there is no shape at all
                yield name
                continue
            own = any(body.mj == i for body in shown)
            # A shape of its own is believed before an inertia: that of many files is a guess.
            centre, whole = (_out_of(mj, data, i, shown, spread=spread) for spread in (False, True))
            if centre > (SLIP if own else LUMP) or (not own and whole > SLIP):
                yield name


def _spans(mj: mujoco.MjModel, data: mujoco.MjData, i: int) -> bool:
    """Whether what moves as one with a body of MuJoCo joins joints in different places, and moves a mass."""
    weld = int(mj.body_weldid[i])
    onward = [k for k in range(mj.nbody) if mj.body_jntnum[k] and mj.body_weldid[mj.body_parentid[k]] == weld]
    onward = [k for k in onward if mj.body_subtreemass[k] > FRAME]
    places = [data.xanchor[mj.body_jntadr[k] + n] for k in (weld, *onward) for n in range(mj.body_jntnum[k])]
    return bool(onward) and max(float(np.linalg.norm(x - places[0])) for x in places) > ONE_PLACE


def _out_of(mj: mujoco.MjModel, data: mujoco.MjData, i: int, shown: Sequence[Body], *, spread: bool) -> float:
    """How far one of MuJoCo's bodies reaches out of shapes at least [m]; ``spread``: by its inertia too."""
    turn, own = data.ximat[i].reshape(3, 3), data.xmat[i].reshape(3, 3)
    about = mj.body_inertia[i] * spread
    second = turn @ np.diag(about.sum() / 2 - about) @ turn.T / mj.body_mass[i]
    found = 0.0
    for axis in (*turn.T, *own.T):
        ends = [_ends(data, body, axis) for body in shown]
        x = float(axis @ data.xipos[i])
        a, b = x - min(low for low, _ in ends), max(high for _, high in ends) - x
        found = max(found, stands_out(a, b, max(float(axis @ second @ axis), 0.0)))
    return found


def _ends(data: mujoco.MjData, body: Body, axis: Array) -> tuple[float, float]:
    """From where to where the shape of a body reaches along an axis of the world [m]."""
    along = body.corners @ (data.xmat[body.mj].reshape(3, 3).T @ axis) + data.xpos[body.mj] @ axis
    out = body.radius + body.deviation
    return float(along.min()) - out, float(along.max()) + out


def _room(body: Body) -> float:
    """The box around the shape of a body, in its own frame [m³]."""
    return float((np.ptp(body.corners, axis=0) + 2 * (body.radius + body.deviation)).prod())


def _body_id(mj: mujoco.MjModel, name: str) -> int:
    return int(mujoco.mj_name2id(mj, mujoco.mjtObj.mjOBJ_BODY, name))
