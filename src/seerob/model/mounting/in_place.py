"""What follows from the compiled workstation and can be implausible: where things are, how large and heavy.

The questions are asked once, of everybody at home; of whom a recorded source moves, when it was opened, of
where its samples begin. Whom a live source moves is asked for what depends on that when heard, see
`seerob.criteria.plausible_places`.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from types import MappingProxyType

import mujoco
import numpy as np

from seerob.core.snapshot import Finding
from seerob.core.transforms import Array
from seerob.description.lint import box
from seerob.distance.depth import Depths
from seerob.distance.least import Query
from seerob.model.model import Body, Frame, Mechanism, Model
from seerob.model.mounting.chains import beyond_flange
from seerob.model.mounting.specification import pose_matrix
from seerob.workstation.plausibility.ranges import (
    Quantity,
    data,
    entries_of,
    findings,
    listed,
    quantities,
    resting,
)
from seerob.workstation.variables import VARIABLE
from seerob.workstation.workstation import Body as GivenBody
from seerob.workstation.workstation import Thing as GivenThing

SUPPORTED = ("foot", "toes", "pelvis", "thigh", "shank")
"""Bones that a person stands, sits or kneels with."""
FEET = "humans.feet"
"""Kind of the quantity that says how far somebody is from what they stand or sit on."""
BELOW = "humans.feet_below"
"""Kind of the quantity that says how far somebody is below all that stands, where no floor is drawn."""
LEVEL = 0.05
"""What is not farther from z = 0 stands there [m]."""
TOUCHES = 0.01
"""A base that is so near to something stands on it, or beside it [m]."""
ON_AXIS = 0.01
"""A flange that is no farther from the axis of the last joint is on it [m]; a link that swings is not."""
SIGHT = 50.0
"""Farther apart is not measured [m]."""


def implausible(model: Model) -> tuple[Finding, ...]:
    """Everything that is implausible of a workstation, and what its file confirms of that."""
    station = model.workstation
    place = _Home(model)
    every = [*listed(entries_of(station), station.engine), *_variables(model), *_following(model, place)]
    return (*findings(every, station.confirmed), *_without_floor(model, place))


def _without_floor(model: Model, place: _Home) -> Iterator[Finding]:
    """Of whom nobody looks at what they stand on, where that is below z = 0 and nothing stands there."""
    if _drawn(model, place):
        return
    for human in model.workstation.humans:
        low = place.lowest(_of(model, model.mechanisms[human.name]))
        if human.name in place.still and low >= -LEVEL:
            continue  # where they stand is compared with z = 0
        text = (
            "nothing is drawn that stands at z = 0: nobody looks at what "
            f"{human.name} stands on {-low:.3g} m below it"
            if human.name in place.still
            else "nothing is drawn that stands at z = 0: nobody looks at what "
            f"{human.name} stands on where a source puts them below it"
        )
        yield Finding(level="assumed", subject=human.name, text=text)


def _variables(model: Model) -> Iterator[Quantity]:
    """What the dictionary says of variables: what asks them, and what moves by them, rests on it."""
    for name, variable in model.dictionary.items():
        moved = [m.name for m in model.workstation.machines if name in m.motion.variables()]
        about = (VARIABLE + name, *moved)
        yield from quantities(variable, key=f"variables.{name}", kind="variables", about=about)


def _following(model: Model, place: _Home) -> Iterator[Quantity]:
    yield from _sizes(model)
    yield from _links(model)
    yield from _payloads(model)
    yield from _published(model)
    yield from _left_out(model)
    yield from _people(model)
    yield from _feet(model, place, place.still)
    yield from _overlaps(model, place, {*place.still, *(robot.name for robot in model.workstation.robots)})
    yield from _parts(model, place)
    yield from _misplaced(model, place)
    yield from _across(model, place)
    yield from _bases(model, place)
    yield from _below(model, place)
    yield from _nobody(model, [place])


def implausible_motion(model: Model, q: Mapping[str, Sequence[Array]]) -> tuple[Finding, ...]:
    """Everything that is implausible of the places to which recorded motions go.

    Args:
        model: The compiled workstation.
        q: Joint positions by robot or human at some instants of its motion, the first one first, shape (n,).
    """
    if not q:
        return ()
    places = [
        _Home(model, {name: at[min(k, len(at) - 1)] for name, at in q.items()}) for k in range(_most(q))
    ]
    people = q.keys() & {human.name for human in model.workstation.humans}
    every = [*_feet(model, places[0], people), *_overlaps(model, places[0], q.keys())]
    if people:
        every += _nobody(model, places)
    return tuple(findings(every, model.workstation.confirmed))


def placed(model: Model, q: Mapping[str, Array], *, feet: bool = False) -> Iterator[Quantity]:
    """What can be implausible of where robots and people are, of whom that was heard.

    Args:
        model: The compiled workstation.
        q: Joint positions by robot or human, shape (n,).
        feet: Only of what people stand on.
    """
    place = _Home(model, q)
    people = q.keys() & {human.name for human in model.workstation.humans}
    yield from _feet(model, place, people)
    if not feet:
        yield from _overlaps(model, place, people)
        yield from _nobody(model, [place], "where they are heard to be")


def _most(q: Mapping[str, Sequence[Array]]) -> int:
    return max(len(at) for at in q.values())


# -- sizes and masses ---------------------------------------------------------------------------


def _owned(bodies: Iterable[Body]) -> dict[str, list[Body]]:
    """Bodies by the table entry that they belong to."""
    found: dict[str, list[Body]] = {}
    for body in bodies:
        found.setdefault(body.owner, []).append(body)
    return found


def _sizes(model: Model) -> Iterator[Quantity]:
    """Extent of every thing, its mass where a density tells it, and its density where it does not."""
    owned = _owned(model.bodies)
    for group in ("tools", "workpieces", "parts", "machines", "areas"):
        for i, thing in enumerate(getattr(model.workstation, group)):
            bodies = owned.get(thing.name, [])
            solids = [solid for body in bodies for solid in body.solids]
            if not solids:
                continue
            low, high = box(solids)
            read = f", {thing.mesh} read in {thing.units}" if thing.units else ""
            figures = [("extent", "m", float((high - low).max()), f"its largest edge{read}")]
            if group == "tools" and thing.tcp is not None:
                at = thing.tcp.position
                said = f"tcp.position = {list(at)} m to the box around its shape"
                figures.append(("tcp_outside", "m", _outside(np.array(at), low, high), said))
            mass = next((body.mass.value for body in bodies if body.mass is not None), None)
            volume = float((high - low).prod())
            if mass is not None and thing.mass is None and thing.density is not None:
                figures.append(("mass", "kg", mass, f"of its shape at {thing.density:g} kg/m³{read}"))
            elif mass is not None and volume > 0:
                said = f"{mass:g} kg in a box of {volume:.3g} m³{read}"
                figures.append(("bulk_density", "kg/m³", mass / volume, said))
                figures += _spread(thing, low, high)
            for name, unit, value, said in figures:
                yield Quantity(
                    f"{group}[{i}].{name}", f"{group}.{name}", unit, (value,), (thing.name,), said, thing.name
                )


def _links(model: Model) -> Iterator[Quantity]:
    """Density and spread of every link whose mass the workstation file gives, in the box around its shape."""
    for i, robot in enumerate(model.workstation.robots):
        for link, given in robot.masses.items():
            name = f"{robot.name}/{link}"
            solids = [solid for body in model.bodies if body.name == name for solid in body.solids]
            low, high = box(solids) if solids else (np.zeros(3), np.zeros(3))
            volume = float(np.prod(np.subtract(high, low)))
            if volume > 0:
                said = f"{given.mass:g} kg in a box of {volume:.3g} m³"
                figures = [("bulk_density", "kg/m³", given.mass / volume, said), *_spread(given, low, high)]
                for what, unit, value, said in figures:
                    key = f"masses.{link}.{what}"
                    yield Quantity(
                        f"robots[{i}].{key}", f"robots.{key}", unit, (value,), (robot.name,), said, robot.name
                    )


def _spread(given: GivenThing | GivenBody, low: Array, high: Array) -> list[tuple[str, str, float, str]]:
    """Where the mass of a thing is that the file gives, and how it is spread, against the box of its shape.

    Args:
        given: With its mass.
        low: Corner of the box [m].
        high: The other corner.
    """
    figures = []
    if given.com is not None:
        com = np.array(given.com)
        figures.append(("com_outside", "m", _outside(com, low, high), f"com {com.tolist()} m"))
    if given.inertia is not None and given.mass is not None:
        xx, yy, zz, xy, xz, yz = given.inertia
        most = float(np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]).max())
        radius, size = np.sqrt(max(most, 0.0) / given.mass), float(np.linalg.norm(high - low)) / 2
        said = f"{radius:.3g} m of {size:.3g} m, from inertia and mass"
        figures.append(("gyration", "", float(radius / size), said))
    return figures


def _outside(point: Array, low: Array, high: Array) -> float:
    return float(np.linalg.norm(np.maximum(np.maximum(low - point, point - high), 0)))


def _misplaced(model: Model, place: _Home) -> Iterator[Quantity]:
    """How far tools, and what is held, are from what carries them."""
    for group in ("tools", "workpieces"):
        for i, thing in enumerate(getattr(model.workstation, group)):
            own = [b.index for b in _seen(model.bodies) if b.owner == thing.name]
            carriers = {b.carrier for b in model.bodies if b.owner == thing.name}
            others = [b.index for b in _seen(model.bodies) if b.carrier in carriers and b.owner != thing.name]
            if not own or not others or getattr(thing, "rest", None) is not None:
                continue
            gap = max(place.distance(own, others, SIGHT), 0.0)
            said = f"from {thing.name} to anything that moves with {thing.on}"
            key = "apart"
            yield Quantity(
                f"{group}[{i}].{key}", f"{group}.{key}", "m", (gap,), (thing.name,), said, thing.name
            )


def _across(model: Model, place: _Home) -> Iterator[Quantity]:
    """How far tools point away from the axis of the last joint, where the flange is on it.

    That is z of a tool of the library; of another one, on a robot of the library, the way from the flange to
    its working point.
    """
    station = model.workstation
    arms = {robot.name for robot in station.robots if robot.model.startswith("library:")}
    carried = {tool.name for tool in station.tools}
    for i, tool in enumerate(station.tools):
        flange = None if tool.on in carried else model.frames.get(tool.on)
        if flange is None or (axis := place.axis(model, flange)) is None:
            continue
        flange_from_tool, world_from_flange = pose_matrix(tool.at), place.pose(flange)
        if tool.library is not None:
            way, said = flange_from_tool[:3, 2], f"between the last joint's axis and z of {tool.name}"
        elif tool.tcp is not None and model.carrier(flange).name in arms:
            way = flange_from_tool[:3, :3] @ tool.tcp.position + flange_from_tool[:3, 3]
            said = f"between the last joint's axis and the way to the working point of {tool.name}"
        else:
            continue
        beside = np.cross(world_from_flange[:3, 3] - axis[0], axis[1])
        if np.linalg.norm(beside) > ON_AXIS or np.linalg.norm(way) < ON_AXIS:
            continue
        along = abs(float(world_from_flange[:3, :3] @ way @ axis[1])) / float(np.linalg.norm(way))
        angle = float(np.arccos(min(1.0, along)))
        yield Quantity(f"tools[{i}].across", "tools.across", "rad", (angle,), (tool.name,), said, tool.name)


def _payloads(model: Model) -> Iterator[Quantity]:
    """What hangs on each robot, as a share of what its maker rates it for."""
    for i, robot in enumerate(model.workstation.robots):
        row = next((row for row in data().payloads if robot.model in row.models), None)
        if row is None:
            continue
        bodies = [model.bodies[k] for k in model.mechanisms[robot.name].carried]
        masses = {body.owner: body.mass.value for body in bodies if body.mass is not None}
        # One of another size is as strong as forces grow (`seerob.description.robots.scaled`).
        rated, of = row.kg * robot.scale**3, "" if robot.scale == 1 else f", × {robot.scale**3:.4g}"
        share = sum(masses.values()) / rated
        carried = ", ".join(f"{name} {m:.4g} kg" for name, m in masses.items())
        said = f"{carried} of {rated:.4g} kg: {row.source}{of}"
        yield Quantity(
            f"robots[{i}].payload", "robots.payload", "", (share,), (robot.name,), said, robot.name
        )


def _left_out(model: Model) -> Iterator[Quantity]:
    """How many constraints between the links of each robot are not in the twin."""
    for i, robot in enumerate(model.workstation.robots):
        left_out = model.mechanisms[robot.name].description.left_out
        said, name = ", ".join(left_out), "constraints_left_out"
        yield Quantity(
            f"robots[{i}].{name}", f"robots.{name}", "", (len(left_out),), (robot.name,), said, robot.name
        )


def _published(model: Model) -> Iterator[Quantity]:
    """What the links of each robot weigh, as a share of what its maker says that it weighs."""
    for i, robot in enumerate(model.workstation.robots):
        if robot.published_mass is None:
            continue
        mechanism = model.mechanisms[robot.name]
        beyond = {f"{robot.name}/{link}" for link in beyond_flange(mechanism.description)}
        rows = [row for row in mechanism.masses if row.name in mechanism.links - beyond]
        total, unknown = sum(row.mass or 0.0 for row in rows), any(row.mass is None for row in rows)
        share = total / robot.published_mass
        if unknown and share < 1:
            continue  # what nobody weighed is undecided by itself
        said = f"{total:.4g} kg of {robot.published_mass:g} kg: {robot.published_mass_source}"
        name = "published_mass.share"
        yield Quantity(f"robots[{i}].{name}", f"robots.{name}", "", (share,), (robot.name,), said, robot.name)


def _people(model: Model) -> Iterator[Quantity]:
    """Stature where a population tells it, and mass over its square."""
    for i, human in enumerate(model.workstation.humans):
        stature = human.stature
        if isinstance(stature, float | int) and human.adult:
            bmi = human.mass / stature**2
            said = f"{human.mass:g} kg, {stature:g} m"
            yield Quantity(f"humans[{i}].bmi", "humans.bmi", "kg/m²", (bmi,), (human.name,), said, human.name)


# -- places -------------------------------------------------------------------------------------


class _Home:
    """Everybody at home, or where motions put them."""

    def __init__(self, model: Model, q: Mapping[str, Array] = MappingProxyType({})) -> None:
        data = mujoco.MjData(model.mj)
        for mechanism in model.mechanisms.values():
            at = q.get(mechanism.name, mechanism.home)
            data.qpos[mechanism.q_address] = mechanism.coupling @ at + mechanism.offset
        mujoco.mj_kinematics(model.mj, data)
        self._data = data
        ids = [body.mj for body in model.bodies]
        self.rotations: Array = data.xmat[ids].reshape(-1, 3, 3).copy()
        self.positions: Array = data.xpos[ids].copy()
        self.shapes = model.shapes
        driven = {source.target() for source in model.workstation.sources}
        self.still = {
            name
            for name, m in model.mechanisms.items()
            if name in q or (name not in driven and (m.home_given or not m.joints))
        }
        """Robots, people and machines that stand where they are now, as far as the file says."""

    def pose(self, frame: Frame) -> Array:
        """Where a frame is in the world, shape (4, 4)."""
        world_from_body = np.eye(4)
        world_from_body[:3, :3] = self._data.xmat[frame.mj].reshape(3, 3)
        world_from_body[:3, 3] = self._data.xpos[frame.mj]
        found: Array = world_from_body @ frame.body_from_frame
        return found

    def axis(self, model: Model, frame: Frame) -> tuple[Array, Array] | None:
        """A point and the direction of the axis that a frame turns about; None where it turns about none."""
        joint = model.mj.body_jntadr[model.mj.body_weldid[frame.mj]]
        if joint < 0 or model.mj.jnt_type[joint] != mujoco.mjtJoint.mjJNT_HINGE:
            return None
        return self._data.xanchor[joint].copy(), self._data.xaxis[joint].copy()

    def lowest(self, bodies: Sequence[Body]) -> float:
        """Height of the lowest point of bodies [m]."""
        heights = [
            float((self.rotations[b.index] @ b.corners.T)[2].min() + self.positions[b.index][2] - b.radius)
            for b in bodies
            if len(b.corners)
        ]
        return min(heights, default=0.0)

    def box(self, bodies: Sequence[Body]) -> Array:
        """Lowest and highest corner (2, 3) [m] of a box around bodies; one that meets nothing without any."""
        low, high = np.full(3, np.inf), np.full(3, -np.inf)
        for b in bodies:
            if len(b.corners):
                corners = b.corners @ self.rotations[b.index].T + self.positions[b.index]
                low = np.minimum(low, corners.min(axis=0) - b.radius - TOUCHES)
                high = np.maximum(high, corners.max(axis=0) + b.radius + TOUCHES)
        return np.array([low, high])

    def distance(self, a: Sequence[int], b: Sequence[int], cap: float, shift: Array | None = None) -> float:
        """Between two sets of bodies [m], at most ``cap``; the first one moved by ``shift`` [m]."""
        positions = self.positions
        if shift is not None:
            positions = positions.copy()
            positions[list(a)] += shift
        return Query(self.shapes, a, b, cap=cap).minimum(self.rotations, positions).distance

    def depth(self, outer: Body, inner: Body) -> float:
        """How deep one reaches into the other [m]."""
        if not _meet(self.box([outer]), self.box([inner])):
            return 0.0
        if self.distance((outer.index,), (inner.index,), 0.1) > 0:
            return 0.0
        pairs = [(outer.index, inner.index), (inner.index, outer.index)]
        asked = Depths(self.shapes).ask(self.rotations, self.positions, pairs)
        # Of a thin plate through a body, only the body says how deep.
        return max(found.at_least for found in asked)


def _meet(one: Array, other: Array) -> bool:
    """Whether two boxes, as of `_Home.box`, have a point in common: what is in boxes that do not is apart."""
    return bool((one[0] <= other[1]).all() and (one[1] >= other[0]).all())


def _seen(bodies: Sequence[Body]) -> list[Body]:
    return [body for body in bodies if body.solids and body.role != "area"]


def _standing(model: Model) -> list[Body]:
    """Bodies that nobody moves: parts, bases of robots."""
    moved = {i for m in model.mechanisms.values() for i in m.moving}
    fixed = [b for b in _seen(model.bodies) if not b.mover or (b.role == "robot" and b.index not in moved)]
    return [b for b in fixed if not b.holder]


def _rooted(model: Model, place: _Home, name: str) -> list[Body]:
    """Of a robot that stands on nothing that moves: its base, and the links that turn with its first joint.

    A base alone may be as flat as a plate. Where nobody says how the joint is turned, the base alone.
    """
    mj, found = model.mj, [b for b in _standing(model) if b.owner == name]
    if not found or name not in place.still:
        return found
    for body in _of(model, model.mechanisms[name]):
        dof = mj.body_dofadr[mj.body_weldid[body.mj]]
        if body.owner == name and dof >= 0 and mj.dof_parentid[dof] < 0:
            turns = mj.jnt_type[mj.dof_jntid[dof]] == mujoco.mjtJoint.mjJNT_HINGE
            found += [body] if turns and body not in found else []
    return found


def _of(model: Model, mechanism: Mechanism) -> list[Body]:
    return _seen([model.bodies[i] for i in (*mechanism.bodies, *mechanism.carried)])


def _feet(model: Model, place: _Home, who: Collection[str]) -> Iterator[Quantity]:
    """How far people who stand still are from what they stand or sit on."""
    under = [b.index for b in _things(model)]
    floor = _drawn(model, place)
    lowest = min((0.0, *(place.lowest([b]) for b in _standing(model))))
    for i, human in enumerate(model.workstation.humans):
        if human.name not in who:
            continue
        bodies = _of(model, model.mechanisms[human.name])
        gap = place.lowest(bodies)
        if gap < 0 and not floor:
            # The origin is somewhere else, such as at the base of the robot.
            said = f"the lowest point of {human.name} is so far above the lowest point of all that stands"
            depth = min(gap - lowest, 0.0)
            yield Quantity(f"humans[{i}].feet_below", BELOW, "m", (depth,), (human.name,), said, human.name)
            continue
        feet = [b.index for b in bodies if b.name.rpartition("/")[2].endswith(SUPPORTED)]
        said = f"the lowest point of {human.name} is {gap:.3g} m above the floor z = 0"
        if gap > 0 and feet and under:
            on = place.distance(feet, under, gap)
            if on < gap:
                gap, said = max(on, 0.0), f"from what {human.name} stands or sits on"
        yield Quantity(f"humans[{i}].feet", FEET, "m", (gap,), (human.name,), said, human.name)


def _things(model: Model) -> list[Body]:
    """Parts and machines that are drawn."""
    return [b for b in _seen(model.bodies) if b.role in ("part", "machine")]


def _drawn(model: Model, place: _Home) -> bool:
    """Whether a part or machine stands at z = 0, so that this is the floor."""
    return any(abs(place.lowest([b])) <= LEVEL for b in _things(model))


def _overlaps(model: Model, place: _Home, who: Collection[str]) -> Iterator[Quantity]:
    """How deep people and roots of robots reach into what stands."""
    owners: dict[str, list[Body]] = {}
    for body in _standing(model):
        owners.setdefault(body.owner, []).append(body)
    roots = {r.name: _rooted(model, place, r.name) for r in model.workstation.robots if r.name in owners}
    owners |= roots
    for group in ("humans", "robots"):
        for i, table in enumerate(getattr(model.workstation, group)):
            if table.name not in who:
                continue
            own = _of(model, model.mechanisms[table.name]) if group == "humans" else roots.get(table.name, [])
            for owner, bodies in owners.items():
                if owner == table.name or not own:
                    continue
                a, b = [body.index for body in own], [body.index for body in bodies]
                if not _meet(place.box(own), place.box(bodies)) or place.distance(a, b, 0.1) > 0:
                    continue
                deep, inner, outer = max(
                    ((place.depth(y, x), x.name, y.name) for x in own for y in bodies),
                    key=lambda found: found[0],
                )
                said = f"{inner} in {outer}"
                about = (table.name, owner)
                yield Quantity(
                    f"{group}[{i}].inside.{owner}",
                    f"{group}.inside.{owner}",
                    "m",
                    (deep,),
                    about,
                    said,
                    table.name,
                )


def _floor(model: Model, place: _Home) -> bool:
    """Whether people or things stand at z = 0."""
    soles = [place.lowest(_of(model, model.mechanisms[human.name])) for human in model.workstation.humans]
    return any(abs(low) <= LEVEL for low in (*soles, *(place.lowest([b]) for b in _standing(model))))


def _below(model: Model, place: _Home) -> Iterator[Quantity]:
    """How far areas, and devices that watch, are below the floor, where nobody is."""
    station = model.workstation
    if not _floor(model, place):
        return
    for i, area in enumerate(station.areas):
        own = [b for b in model.bodies if b.owner == area.name and len(b.corners)]
        tops = [
            float((place.rotations[b.index] @ b.corners.T)[2].max() + place.positions[b.index][2] + b.radius)
            for b in own
        ]
        if area.on is None and tops and max(tops) < 0:
            said = f"the highest point of {area.name} below z = 0"
            key = "below_floor"
            yield Quantity(
                f"areas[{i}].{key}", f"areas.{key}", "m", (-max(tops),), (area.name,), said, area.name
            )
    entries = entries_of(station)
    for i, sensor in enumerate(station.sensors):
        if sensor.on is None and (at := sensor.at.position[2]) < 0:
            said, key = f"{sensor.name} below z = 0", "below_floor"
            about = resting("sensors", sensor, entries)
            yield Quantity(f"sensors[{i}].{key}", f"sensors.{key}", "m", (-at,), about, said, sensor.name)


def _bases(model: Model, place: _Home) -> Iterator[Quantity]:
    """How high bases of robots are, and how far from anything that they would stand on with another sign."""
    standing = _standing(model)
    floor = _floor(model, place)
    for i, robot in enumerate(model.workstation.robots):
        own = [b for b in standing if b.owner == robot.name]
        if robot.on or not own:
            continue
        at = robot.base.position[2]
        said = f"the base of {robot.name} above z = 0"
        yield Quantity(f"robots[{i}].height", "robots.height", "m", (at,), (robot.name,), said, robot.name)
        if at < 0 and floor:
            key, said = "below_floor", f"the base of {robot.name} below z = 0"
            yield Quantity(
                f"robots[{i}].{key}", f"robots.{key}", "m", (-at,), (robot.name,), said, robot.name
            )
        base, others = [b.index for b in own], [b.index for b in standing if b.owner != robot.name]
        if not others or abs(place.lowest(own)) <= LEVEL:
            continue
        gap = place.distance(base, others, SIGHT)
        if gap <= LEVEL:
            continue
        for words, sign in (("x", (-1, 1)), ("y", (1, -1)), ("x and of y", (-1, -1))):
            moved = [*robot.base.position]
            moved[0], moved[1] = sign[0] * moved[0], sign[1] * moved[1]
            shift = np.subtract(moved, robot.base.position)
            if not shift.any() or place.distance(base, others, LEVEL, shift) > TOUCHES:
                continue
            said = f"from the base of {robot.name} to anything; with the other sign of {words} on something"
            key = "stands_on_nothing"
            yield Quantity(
                f"robots[{i}].{key}", f"robots.{key}", "m", (gap,), (robot.name,), said, robot.name
            )
            break


def _parts(model: Model, place: _Home) -> Iterator[Quantity]:
    """How deep parts that stand reach into each other."""
    owned = _owned(_seen(model.bodies))
    every = [owned.get(part.name, []) for part in model.workstation.parts]
    boxes = np.array([place.box(bodies) for bodies in every]).reshape(-1, 2, 3)
    for i, (part, own) in enumerate(zip(model.workstation.parts, every, strict=True)):
        # Of hundreds of parts few are near each other; whose boxes are apart is not asked.
        meets = (boxes[:i, 0] <= boxes[i, 1]).all(axis=1) & (boxes[:i, 1] >= boxes[i, 0]).all(axis=1)
        for k in np.flatnonzero(meets):
            other, bodies = model.workstation.parts[k], every[k]
            a, b = [body.index for body in own], [body.index for body in bodies]
            if place.distance(a, b, 0.1) > 0:
                continue
            deep = max(place.depth(y, x) for x in own for y in bodies)
            about = (part.name, other.name)
            key = f"parts[{i}].inside.{other.name}"
            yield Quantity(
                key,
                f"parts.inside.{other.name}",
                "m",
                (deep,),
                about,
                f"{part.name} in {other.name}",
                part.name,
            )


def _nobody(
    model: Model, places: Sequence[_Home], where: str = "where the file puts them"
) -> Iterator[Quantity]:
    """How near anybody comes to each robot and machine."""
    place = places[0]
    people = [model.mechanisms[h.name] for h in model.workstation.humans]
    still = [b.index for m in people if m.name in place.still for b in _of(model, m)]
    if not still or len({m.name for m in people} - place.still):
        return  # somebody comes from elsewhere
    for group in ("robots", "machines"):
        for i, table in enumerate(getattr(model.workstation, group)):
            own = [b.index for b in _of(model, model.mechanisms[table.name])]
            if own:
                near = max(min(at.distance(still, own, SIGHT) for at in places), 0.0)
                said = f"from {table.name} to whoever is nearest, {where}"
                key = "nobody_within"
                yield Quantity(
                    f"{group}[{i}].{key}", f"{group}.{key}", "m", (near,), (table.name,), said, table.name
                )
