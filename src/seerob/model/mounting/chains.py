"""What follows from a chain of links alone: coupled joints, and what each link weighs or nobody knows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from msgspec.structs import replace

from seerob.core.shapes import Solid
from seerob.core.snapshot import Finding, LinkMass, Origin
from seerob.core.transforms import Array
from seerob.description.description import Description, Inertial, Joint, Link, base_from_links, groups
from seerob.description.lint import DENSITIES, FLANGES, LIGHT, TIPS, as_good_as_a_point, too_light
from seerob.model.model import Mechanism
from seerob.model.mounting.specification import extreme_points

PLACEHOLDER_DENSITY = 500.0
"""Of the box around a moving link that nobody gave a mass [kg/m³]: it lets the twin move, and no
criterion may use it."""
ONE_PLACE = 1e-3
"""Joints that are no farther from each other are in one place [m]: frames are written to the millimetre."""
MAX_PAYLOAD = 500.0
"""More than this on a robot is a mistake in a unit rather than a payload [kg]."""


def couple(every: Sequence[Joint], commanded: Sequence[Joint]) -> tuple[Array, Array]:
    """All joints as an affine function of the commanded ones; mimics of mimics are followed.

    Args:
        every: All m joints.
        commanded: The n of them that mimic no other.

    Returns:
        ``coupling`` (m, n) and ``offset`` (m,) of ``q_all = coupling @ q + offset``.
    """
    column = {joint.name: i for i, joint in enumerate(commanded)}
    by_name = {joint.name: joint for joint in every}
    coupling, offset = np.zeros((len(every), len(commanded))), np.zeros(len(every))
    for row, joint in enumerate(every):
        factor, shift, at = 1.0, 0.0, joint
        while at.mimic is not None:
            shift += factor * at.mimic.offset
            factor *= at.mimic.multiplier
            at = by_name[at.mimic.joint]
        coupling[row, column[at.name]] = factor
        offset[row] = shift
    return coupling, offset


def weighed(description: Description, *, carried: bool) -> tuple[LinkMass, ...]:
    """What each link of a robot weighs: a mass is known, or what moves it is undecided; none is dropped.

    A link weighs what its file says. Where it says nothing, a link with a shape is a body whose mass nobody
    gave, and so is one that a joint moves; a frame, which has neither, weighs nothing. A joint without a body
    of its own is one of several in one place, as a ball joint is written: its link weighs nothing either.

    Args:
        description: Of the robot.
        carried: Whether its root moves too.

    Returns:
        In the order of the links. What is unknown and moves has no mass.
    """
    found: dict[str, LinkMass] = {}
    carrying = _joints_without_body(description)
    spare = LIGHT
    moving: set[str] = set()
    for group in groups(description.links):
        for link in group:
            if carried or link.joints or link.parent in moving:
                moving.add(link.name)
            row = _weighed(description.name, link, bodiless=link.name in carrying)
            silent = link.inertial is None and not link.refused_mass and not link.joints
            bound = _heaviest(link) if silent and row.mass is None else 0.0
            if 0 < bound < spare:
                spare -= bound
                note = f"at most {bound:.2g} kg, its shape in the heaviest metal: taken as a frame"
                row = LinkMass(name=row.name, mass=0.0, origin=Origin.COMPUTED, note=note)
            head = "" if link is group[0] else f"{description.name}/{group[0].name}"
            found[link.name] = replace(row, moves=link.name in moving, merged=head)
    return tuple(found[link.name] for link in description.links)


def _weighed(robot: str, link: Link, *, bodiless: bool) -> LinkMass:
    """What one link weighs by what its file says of it alone."""
    name, inertial = f"{robot}/{link.name}", link.inertial
    if inertial is not None:
        invalid_reason = (
            f"it is a guess ({inertial.source})"
            if inertial.origin is Origin.ASSUMED
            else too_light(link) or as_good_as_a_point(link)
        )
        if invalid_reason:
            return LinkMass(name=name, origin=Origin.MISSING, note=invalid_reason)
        return LinkMass(name=name, mass=inertial.mass, origin=inertial.origin, source=inertial.source)
    if link.refused_mass:
        return LinkMass(name=name, origin=Origin.MISSING, note=link.refused_mass)
    if link.solids or link.visual or (link.joints and not bodiless):
        return LinkMass(name=name, origin=Origin.MISSING)
    what = "a joint without a body of its own" if link.joints else "a frame"
    return LinkMass(name=name, mass=0.0, origin=Origin.COMPUTED, note=what)


def _joints_without_body(description: Description) -> set[str]:
    """Links that joints move, that nothing is said of, and that need not be there.

    They have what they carry in one place with themselves, or are fixed to what has a mass.
    """
    poses = base_from_links(description, {})
    places = {
        link.name: [poses[link.name][:3, :3] @ j.anchor + poses[link.name][:3, 3] for j in link.joints]
        for link in description.links
    }
    found: set[str] = set()
    heavy: set[str] = set()
    every = groups(description.links)
    for group in reversed(every):
        names = {link.name for link in group}
        onward = [other[0] for other in every if other[0].parent in names]
        if any(link.inertial or link.refused_mass or link.solids or link.visual for link in group):
            heavy |= names
        elif onward and all(link.name in heavy for link in onward):
            ends = [place for link in (group[0], *onward) for place in places[link.name]]
            if max(float(np.linalg.norm(end - ends[0])) for end in ends) > ONE_PLACE:
                continue
            heavy |= names
        else:
            continue
        found |= {link.name for link in group if link.joints}
    return found


def _heaviest(link: Link) -> float:
    """What a link of its shape weighs at most [kg]: the box around it in the heaviest metal."""
    solids = (*link.solids, *(Solid(mesh=mesh) for mesh in link.visual))
    points, radius = extreme_points(solids)
    stands_out = max(solid.deviation for solid in solids)
    return float(DENSITIES[1] * (np.ptp(points, axis=0) + 2 * (radius + stands_out)).prod())


def beyond_flange(description: Description) -> frozenset[str]:
    """Links that a file mounts on the robot's flange or on its tip: a gripper, a sensor, a tool."""
    found: set[str] = set()
    for link in description.links:
        parent = link.parent or ""
        if parent in found or parent == description.tip or parent.lower().endswith(FLANGES):
            found.add(link.name)
    return frozenset(found)


def unknown_masses(rows: Sequence[LinkMass]) -> tuple[str, ...]:
    """What of a robot's moving bodies has a mass that nobody knows, one sentence each."""
    return tuple(
        f"the mass of {row.name} is unknown: {row.note}"
        if row.note
        else f"nobody gave the mass of {row.name}"
        for row in rows
        if row.moves and row.mass is None
    )


def assumed(robot: Mechanism, *, tip_given: bool) -> list[Finding]:
    """What is assumed of a robot because nobody gave it.

    Args:
        robot: The robot.
        tip_given: Whether the file or the library says which link is its point of interest.
    """
    texts = [
        f"{text}: energies and effective masses are UNDECIDED; a placeholder moves the twin"
        for text in robot.unknown_masses
    ]
    if not robot.rotor_inertia_known:
        texts.append(
            "rotor inertia not given for every joint: mass matrix and effective mass are link-side only "
            "(give rotor_inertia)"
        )
    if not tip_given and not robot.description.tip.lower().endswith(TIPS):
        texts.append(
            f"point of interest is the origin of {robot.description.tip}: name one with tool = or mount a "
            "tool with tcp"
        )
    return [Finding(level="assumed", subject=robot.name, text=text) for text in texts]


def payload(robot: str, things: Mapping[str, float | None]) -> list[Finding]:
    """What a robot carries, in one finding; none when nothing is mounted on it.

    Args:
        robot: The robot.
        things: Mass [kg] of each tool and workpiece mounted on it; None when nobody gave one.
    """
    if not things:
        return []
    known = {name: mass for name, mass in things.items() if mass is not None}
    total = sum(known.values())
    each = ", ".join(
        f"{name} unknown" if mass is None else f"{name} {mass:.4g} kg" for name, mass in things.items()
    )
    some = len(known) < len(things)
    text = f"carries at least {total:.4g} kg: {each}" if some else f"carries {total:.4g} kg: {each}"
    if total <= MAX_PAYLOAD:
        return [Finding(level="note", subject=robot, text=text)]
    text += f"; no robot beside a person carries more than {MAX_PAYLOAD:g} kg: check the unit"
    return [Finding(level="warning", subject=robot, text=text)]


def placeholder(solids: Sequence[Solid]) -> Inertial:
    """Mass properties of the box around solids, so that what nobody weighed can be moved."""
    points, radius = extreme_points(solids)
    size = np.ptp(points, axis=0) + 2 * radius + 1e-3
    mass = float(PLACEHOLDER_DENSITY * size.prod())
    inertia = np.diag([size[1] ** 2 + size[2] ** 2, size[0] ** 2 + size[2] ** 2, size[0] ** 2 + size[1] ** 2])
    center = (points.min(axis=0) + points.max(axis=0)) / 2
    return Inertial(mass, center, inertia * mass / 12, Origin.ASSUMED, "placeholder")
