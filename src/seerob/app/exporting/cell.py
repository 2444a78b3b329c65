"""A workstation as one description: the world, everything that stands or moves in it, and where joints are.

People, areas and sensors are no part of the cell that others simulate; they are left out.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from seerob.core.errors import InputError
from seerob.core.shapes import Mesh
from seerob.core.transforms import Array, rotation_from_wxyz, transform
from seerob.description.description import Description, Inertial, Link, base_from_links
from seerob.model.model import Body, Model
from seerob.model.mounting.things import PART_COLOR, TOOL_COLOR, WORKPIECE_COLOR, load_thing

WORLD = "world"


@dataclass(frozen=True, eq=False)
class Cell:
    """What is written."""

    description: Description
    """Its root is the world; names are full names: ``ur10/forearm_link``, ``line/fixture``."""
    home: dict[str, float]
    """Where joints are when nothing drives them, by full name [rad or m]."""
    notes: tuple[str, ...]
    """What is left out, or not known."""

    def placed(self) -> dict[str, Array]:
        """Pose of every link in the world (4, 4), with joints where they are at home."""
        return base_from_links(self.description, self.home)


def cell_of(model: Model) -> Cell:
    """Everything of a compiled workstation that other simulators know, too."""
    kept = {b.name: b for b in model.bodies if b.role not in ("human", "area")}
    links_of = {
        f"{name}/{link.name}": (name, link)
        for name, mechanism in model.mechanisms.items()
        if mechanism.role != "human"
        for link in mechanism.description.links
    }
    visual, inertials, notes = _things(model)
    people = [name for name, mechanism in model.mechanisms.items() if mechanism.role == "human"]
    links = [Link(WORLD, None, np.eye(4))]
    names = [model.mj.body(i).name for i in range(model.mj.nbody)]
    written: set[str] = {WORLD}
    for number in range(1, model.mj.nbody):
        name = names[number]
        if name not in links_of and name not in kept and name not in inertials:
            continue
        parent = names[int(model.mj.body_parentid[number])]
        if parent not in written:
            continue  # carried by a person
        at = transform(rotation_from_wxyz(model.mj.body_quat[number]), model.mj.body_pos[number])
        body = kept.get(name)
        link = _link(name, parent, at, links_of.get(name), body, visual.get(name, ()), inertials.get(name))
        written.add(name)
        links.append(link)
        if link.joints and link.inertial is None:
            notes.append(f"{name}: its mass is not known and is not written")
    if people:
        notes.append(f"{', '.join(people)}: people are left out")
    title = model.workstation.title or Path(model.workstation.folder).name
    home = {
        f"{name}/{joint.name}": float(q)
        for name, mechanism in model.mechanisms.items()
        if mechanism.role != "human"
        for joint, q in zip(mechanism.joints, mechanism.home, strict=True)
    }
    description = Description(title, tuple(links), links[-1].name, str(model.workstation.folder))
    return Cell(description, home, tuple(notes))


def _link(
    name: str,
    parent: str,
    at: Array,
    of: tuple[str, Link] | None,
    body: Body | None,
    visual: tuple[Mesh, ...],
    inertial: Inertial | None,
) -> Link:
    solids = () if body is None else body.solids
    if of is None:
        return Link(name, parent, at, inertial=inertial, visual=visual, solids=solids)
    owner, link = of
    joints = tuple(
        replace(
            joint,
            name=f"{owner}/{joint.name}",
            mimic=joint.mimic and replace(joint.mimic, joint=f"{owner}/{joint.mimic.joint}"),
        )
        for joint in link.joints
    )
    shown = link.visual or visual
    return Link(name, parent, at, joints, link.inertial, visual=shown, solids=solids)


def _things(model: Model) -> tuple[dict[str, tuple[Mesh, ...]], dict[str, Inertial], list[str]]:
    """What is shown of parts, tools and workpieces, and their masses, by full name; and what is not known."""
    station, notes = model.workstation, []
    visual: dict[str, tuple[Mesh, ...]] = {}
    inertials: dict[str, Inertial] = {}
    groups = (
        *((part, PART_COLOR) for part in station.parts),
        *((tool, TOOL_COLOR) for tool in station.tools),
        *((piece, WORKPIECE_COLOR) for piece in station.workpieces),
    )
    unknown = 0
    for thing, color in groups:
        weighed = thing.mass is not None or thing.density is not None or thing.library is not None
        try:
            loaded = load_thing(thing, model.folder, color, needs_mass=weighed)
        except InputError as error:
            loaded = load_thing(thing, model.folder, color, needs_mass=False)
            notes.append(f"{thing.name}: no mass of its shape ({error})")
        for piece in loaded.pieces:
            visual[f"{thing.name}/{piece.name}" if piece.name else thing.name] = piece.visual
        if loaded.inertial is not None:
            inertials[thing.name] = loaded.inertial
        unknown += not weighed or (thing.library is not None and loaded.inertial is None)
    if unknown:
        notes.append(f"{unknown} things have no mass: none is written")
    return visual, inertials, notes


def told_apart_below(description: Description) -> Iterator[tuple[Link, tuple[str, ...]]]:
    """Links with the names that lead to them in a tree of groups, without the world."""
    for link in description.links[1:]:
        yield link, tuple(link.name.split("/"))
