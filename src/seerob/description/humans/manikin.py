"""A digital human from stature, body mass and sex: the same kind of description as a robot's.

At zero the person stands upright on the floor (z = 0) with the middle of the hips over the root's origin
and faces +x, in the anatomical position: arms hanging, palms forward. `seerob.description.humans.skeleton`
has the frames, axes and signs, `seerob.description.humans.posture` named postures.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import lru_cache

import numpy as np

from seerob.core.errors import InputError
from seerob.core.snapshot import Finding, Origin
from seerob.core.transforms import transform
from seerob.description.description import Description, Joint, JointKind, Link, Quantity
from seerob.description.humans.anthropometry import Body, Masses, Sex, body
from seerob.description.humans.inertia import MENDED, inertials
from seerob.description.humans.skeleton import AXES, BONES, PARENTS, ROOT, ROOT_FROM_ISB, SIDES, Axis
from seerob.description.humans.skin import skin
from seerob.description.humans.tables import table

DAMPING = {
    "lumbar": 2.0,
    "thorax": 2.0,
    "neck": 0.5,
    "head": 0.3,
    "clavicle": 1.0,
    "shoulder": 1.0,
    "elbow": 0.5,
    "wrist": 0.1,
    "hip": 2.0,
    "knee": 1.0,
    "ankle": 0.5,
    "toes": 0.05,
}
"""Passive damping of the joints [N·m·s/rad]: a choice, of the order of what flesh has. It keeps a limb whose
torque limit is reached from spinning, and the controllers make up for it in what is heard."""
GRAVITY = 9.81
"""Gravitational acceleration [m/s²] by which strengths of Anderson et al. 2007 are multiplied."""


def build(
    *,
    name: str,
    stature: float,
    mass: float,
    sex: str,
    lengths: str = "drillis",
    masses: str = "deleva",
    hand: str = "right",
    own_lengths: Mapping[str, float] | None = None,
    own_masses: Mapping[str, float] | None = None,
) -> Description:
    """A standing person: 21 bones, 47 joint axes and six of the waist.

    Args:
        name: Of the person, for messages and findings.
        stature: [m]
        mass: Body mass [kg].
        sex: ``male`` or ``female``: which published table of segments.
        lengths: ``drillis`` (fractions of the stature) or ``deleva`` (distances of joint centres).
        masses: ``deleva`` or, for men, ``zatsiorsky``: segments' masses and moments of inertia.
        own_lengths: Lengths by hand [m], names of `seerob.description.humans.overrides.LENGTHS`.
        own_masses: Masses by hand [kg], by bone, or without side for both.
        hand: Dominant side, ``right`` or ``left``; its hand is the description's tip.

    Returns:
        Root link on the floor, then the 21 bones in the order of `seerob.description.humans.skeleton.BONES`.
        Foot to vertex is the stature and the bones weigh the body mass, exactly.

    Raises:
        InputError: A value is not a plausible adult's, or not one of the choices.
    """
    if hand not in SIDES:
        raise InputError.at(name, "hand", f"{hand!r} is not a side", "give right or left")
    own = tuple(None if each is None else tuple(each.items()) for each in (own_lengths, own_masses))
    return _built(name, stature, mass, sex, lengths, masses, hand, *own)


@lru_cache(maxsize=64)  # the same person stands in cell after cell, and nobody changes one
def _built(
    name: str,
    stature: float,
    mass: float,
    sex: str,
    lengths: str,
    masses: str,
    hand: str,
    own_lengths: tuple[tuple[str, float], ...] | None,
    own_masses: tuple[tuple[str, float], ...] | None,
) -> Description:
    person = body(
        name=name,
        stature=stature,
        mass=mass,
        sex=sex,
        lengths=lengths,
        masses=masses,
        own_lengths=None if own_lengths is None else dict(own_lengths),
        own_masses=None if own_masses is None else dict(own_masses),
    )
    solids = skin(person)
    mass_properties = inertials(person)
    links = [Link(ROOT, None, np.eye(4))]
    for bone in BONES:
        rotation = ROOT_FROM_ISB if PARENTS[bone] == ROOT else np.eye(3)
        offset = person.offset[bone]
        position = ROOT_FROM_ISB @ offset if PARENTS[bone] == ROOT else offset
        links.append(
            Link(
                bone,
                PARENTS[bone],
                transform(rotation, position),
                joints=tuple(_joint(axis, person) for axis in AXES if axis.bone == bone),
                inertial=mass_properties[bone],
                solids=solids[bone],
            )
        )
    mended = [bone for bone, each in mass_properties.items() if each.source.endswith(MENDED)]
    findings = _findings(name, person)
    if mended:
        text = f"moments of inertia of {', '.join(mended)} were lowered to those of a possible body"
        findings = (*findings, Finding(level="assumed", subject=name, text=text))
    source = (
        f"digital human: {sex}, {stature:g} m, {mass:g} kg, {hand}-handed; "
        f"lengths {person.lengths}, masses {person.masses}"
    )
    return Description(name, tuple(links), f"{hand}_hand", source, findings=findings)


def _joint(axis: Axis, person: Body) -> Joint:
    lower, upper = _range(axis)
    return Joint(
        axis.name,
        axis.kind,
        np.array(axis.axis),
        lower=lower,
        upper=upper,
        effort=_effort(axis, person),
        damping=0.0 if axis.group == "pelvis" else DAMPING[axis.group],
    )


def _range(axis: Axis) -> tuple[float | None, float | None]:
    if axis.group == "pelvis":
        return None, None
    ranges = table("limits")[axis.group]
    positive, negative = axis.senses
    return -math.radians(ranges[f"{negative}_deg"]), math.radians(ranges[f"{positive}_deg"])


def _effort(axis: Axis, person: Body) -> Quantity | None:
    """The larger of the torques in both directions: a joint has one limit."""
    torques = table("torques")
    if axis.kind is JointKind.PRISMATIC or axis.group not in torques:
        return None
    known = []
    for sense in axis.senses:
        entry = torques[axis.group][sense]
        if "coefficient" in entry:
            value = entry["coefficient"][person.sex] * person.mass * GRAVITY * person.stature
        else:
            value = float(entry["torque"][person.sex])
        known.append((value, sense, torques["sources"][entry["source"]]))
    value, sense, source = max(known, key=lambda item: item[0])
    return Quantity(value, Origin(source["origin"]), f"{source['text']} ({sense}, the stronger direction)")


def _findings(name: str, person: Body) -> tuple[Finding, ...]:
    def note(text: str, level: str = "note") -> Finding:
        return Finding(level=level, subject=name, text=text)

    limits = table("limits")
    text = (
        "skin: capsules and dilated rectangles of the segments' volumes, hand breadth 0.44 of its length "
        "(a choice); the outline of a real person differs by centimetres"
    )
    found = [
        note("21 bones and 47 joint axes: our proposal, the paper's axes are not published"),
        note(text, "assumed"),
        *(note(f"range of {group}: {rows['source']}") for group, rows in limits.items()),
    ]
    for key, row in table("torques")["sources"].items():
        groups = sorted({a.group for a in AXES if _uses(a, key)})
        found.append(note(f"torque limits of {', '.join(groups)}: {row['text']}", "assumed"))
    found.append(note("no torque limit is known for clavicle and toes, no speed limit for any joint"))
    if person.masses is Masses.ZATSIORSKY:
        found.append(note("masses of the regressions brought to the body mass, moments of inertia with them"))
    elif person.sex is Sex.FEMALE:
        found.append(note("female segment masses of de Leva sum to 99.99 % and are divided by that"))
    return (*found, *person.findings)


def _uses(axis: Axis, source: str) -> bool:
    group = table("torques").get(axis.group, {})
    return any(group.get(sense, {}).get("source") == source for sense in axis.senses if sense)
