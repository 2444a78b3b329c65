"""What follows from a chain of links alone: coupled joints, and masses that nobody gave."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from seerob.geometry import Solid
from seerob.model import Mechanism
from seerob.model_io.description import Description, Inertial, Joint, Link
from seerob.model_io.lint import TIPS
from seerob.mounting.specification import extreme_points
from seerob.snapshot import Finding, Origin
from seerob.transforms import Array

PLACEHOLDER_DENSITY = 500.0
"""Of the box around a moving link that nobody gave a mass [kg/m³]: it lets the twin move, and no
criterion may use it."""
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


def unweighed_links(description: Description, *, loaded: Collection[str]) -> list[Link]:
    """Links that joints move and whose mass nobody gave.

    A frame between two joints has no mass of its own; a joint that moves nothing heavy has no
    mass matrix.

    Args:
        description: Of the robot.
        loaded: Links that something is mounted on.
    """
    heavy = {link.name for link in description.links if link.inertial is not None or link.name in loaded}
    for link in reversed(description.links):
        if link.name in heavy and link.parent is not None:
            heavy.add(link.parent)
    return [
        link
        for link in description.links
        if link.joints and link.inertial is None and (link.solids or link.name not in heavy)
    ]


def unknown_masses(name: str, links: Sequence[Link], things: Mapping[str, bool]) -> tuple[str, ...]:
    """What of a robot's moving bodies has a mass that nobody gave, one sentence each.

    Args:
        name: The robot.
        links: Of it, whose mass nobody gave.
        things: Tools and workpieces mounted on it, and whether their mass is known.
    """
    unweighed = [thing for thing, known in things.items() if not known]
    return (
        *(f"nobody gave the mass of {name}/{link.name}" for link in links),
        *(f"nobody gave the mass or the density of {thing}" for thing in unweighed),
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
    text = "carries " + ("at least " if len(known) < len(things) else "") + f"{total:.4g} kg: "
    text += ", ".join(
        f"{name} {'unknown' if mass is None else f'{mass:.4g} kg'}" for name, mass in things.items()
    )
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
