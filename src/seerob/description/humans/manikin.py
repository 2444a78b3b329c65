"""A digital human from stature, body mass and sex: the same kind of description as a robot's.

At zero the person stands upright on the floor (z = 0) with the middle of the hips over the root's origin and
faces +x, in the anatomical position: arms hanging, palms forward. `seerob.description.humans.skeleton` has
the frames, axes and signs, `seerob.description.humans.posture` named postures.

Mass properties of every bone are from the tables of de Leva 1996 or Zatsiorsky and Seluyanov 1979. A table's
segment that is one bone here keeps mass, centre and radii of gyration, scaled by the length. Where a segment
is several bones (trunk top = thorax and two clavicles, head = head and neck, foot = foot and toes), the small
piece is a uniform body of the bone's length and the large one is what remains, so that the bones together
have exactly the segment's mass, centre and inertia. Pieces scale with the lengths, as de Leva's table does:
what remains is a possible body for every stature and mass. The regressions replace masses and moments, the
centres stay de Leva's.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache

import numpy as np

from seerob.core.errors import InputError
from seerob.core.snapshot import Finding, Origin
from seerob.core.transforms import Array, transform
from seerob.description.description import Description, Inertial, Joint, JointKind, Link, Quantity
from seerob.description.humans import anthropometry
from seerob.description.humans.anthropometry import Body, Masses, Sex, body, table, unfit
from seerob.description.humans.skeleton import (
    AXES,
    BONES,
    PARENTS,
    ROOT,
    ROOT_FROM_ISB,
    SIDES,
    Axis,
    without_side,
)
from seerob.description.humans.skin import skin

SOURCES = {
    Masses.DELEVA: "de Leva 1996, Table 4 (shares of body mass, radii of gyration)",
    Masses.ZATSIORSKY: "Zatsiorsky and Seluyanov 1979, regressions for men; centre: de Leva 1996, Table 4",
}
SPLIT = "; split (share and shape are a choice): uniform body of the bone's length"
REMAINDER = "; less what was split off"
MENDED = "; largest moment lowered to that of a possible body"
ALMOST = 0.98
"""Of the sum of the two smaller moments, which the largest of a body cannot exceed."""
SEGMENTS = {"pelvis": "lower_trunk", "lumbar": "middle_trunk", "thorax": "upper_trunk"}
"""Bone → the tables' name where it is another."""
CLAVICLE_RADIUS = 0.2
"""Of the cylinder that stands for clavicle and flesh, as a share of its length: a choice."""


def _shifted(inertia: Array, mass: float, by: Array) -> Array:
    """Inertia about a point ``by`` [m] away from the centre of mass (Steiner)."""
    return np.asarray(inertia + mass * (by @ by * np.eye(3) - np.outer(by, by)))


def remainder(whole: Inertial, pieces: list[tuple[float, Array, Array]]) -> Inertial:
    """What is left of a body when pieces (mass [kg], centre [m], inertia [kg·m²]) are taken out of it."""
    mass = whole.mass - math.fsum(m for m, _, _ in pieces)
    com = (whole.mass * whole.com - sum((m * c for m, c, _ in pieces), np.zeros(3))) / mass
    about_whole = whole.inertia - sum((_shifted(i, m, c - whole.com) for m, c, i in pieces), np.zeros((3, 3)))
    inertia = _shifted(about_whole, -mass, com - whole.com)
    return Inertial(mass, com, inertia, Origin.ESTIMATED, whole.source + REMAINDER)


def inertials(body: Body) -> dict[str, Inertial]:
    """Mass properties of every bone in its own frame.

    Raises:
        InputError: The regressions were asked for and give a bone that cannot exist.
    """
    result = {bone: (_piece if without_side(bone) in _PIECES else _segment)(body, bone) for bone in BONES}
    groups = {"head": ("neck",), "thorax": tuple(f"{s}_clavicle" for s in SIDES)}
    groups |= {f"{s}_foot": (f"{s}_toes",) for s in SIDES}
    for bone, pieces in groups.items():
        taken = []
        for piece in pieces:
            shift = -body.offset["head"] if piece == "neck" else body.offset[piece]
            taken.append((result[piece].mass, result[piece].com + shift, result[piece].inertia))
        result[bone] = remainder(result[bone], taken)
    if body.overridden:
        result = {bone: each if _possible(each) else _mended(each) for bone, each in result.items()}
    if not all(map(_possible, result.values())):
        raise unfit(body.name, body.mass, body.stature)
    return result


def _possible(inertial: Inertial) -> bool:
    """Whether any distribution of mass has these moments."""
    smallest, middle, largest = np.linalg.eigvalsh(inertial.inertia)
    return bool(inertial.mass > 0 and smallest > 0 and smallest + middle > largest)


def _mended(inertial: Inertial) -> Inertial:
    """With the largest moment as small as the others allow: proportions by hand are not the tables'."""
    values, axes = np.linalg.eigh(inertial.inertia)
    values[2] = min(values[2], ALMOST * (values[0] + values[1]))
    return replace(inertial, inertia=axes @ np.diag(values) @ axes.T, source=inertial.source + MENDED)


_PIECES = ("neck", "clavicle", "toes")


def _piece(body: Body, bone: str) -> Inertial:
    """A piece of a segment as a uniform body: toes a box, neck and clavicle bodies of revolution."""
    length, mass = body.length, body.bone_mass(bone)
    if without_side(bone) == "toes":
        forward, side = length["foot"] - length["heel"] - length["toe_joint"], length["foot_breadth"]
        com = np.array([forward / 2, -length["toe_joint_height"] / 2, 0.0])
        square = np.array([forward**2, length["toe_joint_height"] ** 2, side**2]) / 12
        return Inertial(
            mass, com, mass * np.diag(square.sum() - square), Origin.ESTIMATED, SOURCES[body.masses] + SPLIT
        )
    if bone == "neck":
        along = body.offset["head"]
        row = table("de_leva")[body.sex]["alternatives"]["head_2"]
        turning = row["radii"][2] / 100 * (length["neck"] + length["head"])  # as wide as the head
    else:
        along = body.offset[bone.replace("clavicle", "upper_arm")]
        turning = float(np.linalg.norm(along)) * CLAVICLE_RADIUS / math.sqrt(2)
    size = float(np.linalg.norm(along))
    axis = np.outer(along, along) / size**2
    inertia = mass * (turning**2 * axis + (turning**2 / 2 + size**2 / 12) * (np.eye(3) - axis))
    return Inertial(mass, along / 2, inertia, Origin.ESTIMATED, SOURCES[body.masses] + SPLIT)


def _segment(body: Body, bone: str) -> Inertial:
    """A whole segment of the table, in the frame of the bone that it is reported at."""
    people = table("de_leva")[body.sex]
    rows = people["segments"] | people["alternatives"]
    plain, length = without_side(bone), body.length
    mass = body.bone_mass(bone)
    if plain in ("pelvis", "lumbar", "thorax"):
        lower, middle, upper = rows["lower_trunk"], rows["middle_trunk"], rows["upper_trunk_2"]
        scale = length["trunk"] / (lower["length"] + middle["length"] + upper["length"])
        up_to_xiphion = lower["length"] + middle["length"]
        row, height, start = {
            "pelvis": (lower, lower["length"], 0.0),
            "lumbar": (middle, up_to_xiphion, length["pelvis"]),
            "thorax": (upper, up_to_xiphion + upper["length"], length["pelvis"] + length["lumbar"]),
        }[plain]
        height -= row["com"] / 100 * row["length"]
        if plain == "thorax":
            mass += sum(body.bone_mass(f"{s}_clavicle") for s in SIDES)
        return _inertial(
            body, bone, mass, np.array([0, height * scale - start, 0]), row["radii"], row["length"] * scale
        )
    if plain == "head":
        row, both = rows["head_2"], length["neck"] + length["head"]
        com = np.array([0, length["head"] - row["com"] / 100 * both, 0])
        return _inertial(body, bone, mass + body.bone_mass("neck"), com, row["radii"], both)
    if plain == "foot":
        row = rows["foot"]
        forward = row["com"] / 100 * length["foot"] - length["heel"]
        com = np.array([forward, length["foot_com_height"] - length["ankle_height"], 0])
        sagittal, transverse, longitudinal = row["radii"]
        # The foot's long axis points forward.
        radii = [longitudinal, transverse, sagittal]
        mass += body.bone_mass(bone.replace("foot", "toes"))
        return _inertial(body, bone, mass, com, radii, length["foot"])
    row = rows["hand_2"] if plain == "hand" else rows[plain]
    return _inertial(
        body, bone, mass, np.array([0, -row["com"] / 100 * length[plain], 0]), row["radii"], length[plain]
    )


def _inertial(body: Body, bone: str, mass: float, com: Array, radii: list[float], length: float) -> Inertial:
    """Radii of gyration [%] about the bone's X, Z and Y axis, or the regressions' moments about them."""
    x, z, y = (mass * (r / 100 * length) ** 2 for r in radii)
    if body.masses is Masses.ZATSIORSKY:
        plain = without_side(bone)
        name = SEGMENTS.get(plain, plain)
        given = {"mass": body.mass, "stature": body.stature}
        # Masses were brought to the sum of the body mass; moments go with them.
        scale = mass / anthropometry.zatsiorsky_masses(**given)[name]
        own = anthropometry.zatsiorsky_moments(name, **given)
        sagittal, transverse, longitudinal = (scale * i for i in own)
        x, y, z = sagittal, longitudinal, transverse
        if plain == "foot":
            x, y = y, x
    return Inertial(mass, com.astype(float), np.diag([x, y, z]), Origin.ESTIMATED, SOURCES[body.masses])


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
    adult: bool = True,
) -> Description:
    """A standing person: 21 bones, 47 joint axes and six of the waist.

    Args:
        name: Of the person, for messages and findings.
        stature: [m]
        mass: Body mass [kg].
        sex: ``male`` or ``female``: which published table of segments.
        lengths: ``drillis`` (fractions of the stature) or ``deleva`` (distances of joint centres).
        masses: ``deleva`` or, for men, ``zatsiorsky``: segments' masses and moments of inertia.
        own_lengths: Lengths by hand [m], names of `seerob.description.humans.anthropometry.LENGTHS`.
        own_masses: Masses by hand [kg], by bone, or without side for both.
        hand: Dominant side, ``right`` or ``left``; its hand is the description's tip.
        adult: Whether the tables are meant for the person; else proportions are an adult's all the same.

    Returns:
        Root link on the floor, then the 21 bones in the order of `seerob.description.humans.skeleton.BONES`.
        Foot to vertex is the stature and the bones weigh the body mass, exactly.

    Raises:
        InputError: A value is not a plausible person's, or not one of the choices.
    """
    if hand not in SIDES:
        raise InputError.at(name, "hand", f"{hand!r} is not a side", "give right or left")
    own = tuple(None if each is None else tuple(each.items()) for each in (own_lengths, own_masses))
    return _built(name, stature, mass, sex, lengths, masses, hand, *own, adult)


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
    adult: bool,
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
        adult=adult,
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
