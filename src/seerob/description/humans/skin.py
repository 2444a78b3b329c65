r"""The skin: a capsule or a dilated rectangle per bone, of the volume that the bone's mass has.

A core of edges a × b (b = 0: a segment, a capsule) dilated by r has the volume

.. math:: V = 2 r a b + \pi r^2 (a + b) + \tfrac{4}{3} \pi r^3

and the radius is solved so that :math:`V = m / \rho` exactly. Cores start and end r/2 inside the joints, so
that neighbours overlap there by as much as keeps a joint from pinching (cross-section 0.87 r).

These are not a scan: volumes are right, outlines are not. The error of the surface is of the order of
centimetres and belongs into the uncertainty of every distance.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np

from seerob.core.shapes import Solid, capsule, dilated_rectangle
from seerob.core.transforms import Array
from seerob.description.humans.anthropometry import Body, table
from seerob.description.humans.skeleton import without_side

Vector = Array

NEARLY = 1e-12
"""Share of a radius, far beyond rounding and far below what matters, within which halving begins to ask."""


def density(bone: str) -> float:
    """[kg/m³] of a bone's segment, with flesh."""
    densities = table("lengths")["density"]
    return float(densities.get(without_side(bone), densities["default"]))


def edges(solid: Solid) -> tuple[Vector, Vector]:
    """Edge vectors of a capsule's or dilated rectangle's core [m], each (3,); a capsule's second is 0."""
    assert solid.points is not None
    first = solid.points[1] - solid.points[0]
    second = solid.points[2] - solid.points[0] if len(solid.points) == 3 else np.zeros(3)
    return first, second


def volume(solid: Solid) -> float:
    """Volume of a capsule or dilated rectangle [m³]."""
    a, b = (float(np.linalg.norm(edge)) for edge in edges(solid))
    return dilated_volume(a, b, solid.radius)


def dilated_volume(a: float, b: float, r: float) -> float:
    """Volume [m³] of a rectangle a × b [m] dilated by r [m]."""
    return 2 * r * a * b + math.pi * r**2 * (a + b) + 4 / 3 * math.pi * r**3


def skin(body: Body) -> dict[str, tuple[Solid, ...]]:
    """Solids of every bone, in the bone's frame; left is the mirror image of right."""
    radii: dict[tuple[str, float], float] = {}
    solids: dict[str, tuple[Solid, ...]] = {}
    for bone in body.share:
        target = body.bone_mass(bone) / density(bone)
        key = without_side(bone), target
        if key not in radii:
            radii[key] = _matched(partial(_excess, body, bone, target), limit=0.5)
        solids[bone] = (_shape(body, bone, radii[key]),)
    return solids


def _excess(body: Body, bone: str, target: float, r: float) -> float:
    """By how much a bone of a radius [m] is larger than a volume [m³]."""
    return volume(_shape(body, bone, r)) - target


def _matched(excess: Callable[[float], float], *, limit: float) -> float:
    """Where a function that grows gets over zero: an interval from 0 on, halved until no number lies between.

    False position finds the place nearly first, so that few of the halves need the function.
    """
    below, above, at, side = 0.0, limit, limit, 0
    less, more = excess(below), excess(above)
    for _ in range(20):
        last, at = at, below - less * (above - below) / (more - less)
        if abs(at - last) <= NEARLY / 10 * at:
            break
        if (found := excess(at)) < 0:
            below, less, more, side = at, found, more / 2 if side < 0 else more, -1
        else:
            above, more, less, side = at, found, less / 2 if side > 0 else less, 1
    sure = at * (1 - NEARLY), at * (1 + NEARLY)
    if not (excess(sure[0]) < 0 < excess(sure[1])):
        sure = 0.0, limit
    low, high = 0.0, limit
    while low < (middle := (low + high) / 2) < high:
        if middle <= sure[0] or (middle < sure[1] and excess(middle) < 0):
            low = middle
        else:
            high = middle
    return high


def _shape(body: Body, bone: str, r: float) -> Solid:
    length, plain = body.length, without_side(bone)
    if plain in ("pelvis", "lumbar", "thorax"):
        return _trunk(body, bone, r)
    if plain == "head":
        # From the chin to the vertex; a ball that ends at the vertex when the mass asks for more.
        height = length["chin_height"]
        chin = length["head"] - (body.stature - height)
        top = length["head"] - r
        return capsule(np.array([0, min(chin + r, top), 0]), np.array([0, top, 0]), r, name=bone)
    if plain == "foot":
        return _sole(bone, r, body, -length["heel"], length["toe_joint"], length["ankle_height"])
    if plain == "toes":
        tip = length["foot"] - length["heel"] - length["toe_joint"]
        return _sole(bone, r, body, 0.0, tip, length["toe_joint_height"])
    if plain == "hand":
        return _hand(body, bone, r)
    end = {
        "neck": np.array([0, length["neck"], 0]),
        "upper_arm": np.array([0, -length["upper_arm"], 0]),
        "forearm": np.array([0, -length["forearm"], 0]),
        "thigh": np.array([0, -length["thigh"], 0]),
        "shank": np.array([0, -length["shank"], 0]),
    }
    if plain == "clavicle":
        return _between(np.zeros(3), body.offset[bone.replace("clavicle", "upper_arm")], r, r / 2, bone)
    # The lower leg must not stick out below the sole.
    inset = max(r / 2, r - length["ankle_height"]) if plain == "shank" else r / 2
    return _between(np.zeros(3), end[plain], r, inset, bone)


def _between(start: Vector, end: Vector, r: float, inset: float, name: str) -> Solid:
    """A capsule whose core starts r/2 after ``start`` and ends ``inset`` before ``end``."""
    whole = float(np.linalg.norm(end - start))
    along = (end - start) / whole
    first = min(r / 2, whole / 2)
    last = max(whole - inset, first)
    return capsule(start + first * along, start + last * along, r, name=name)


def _trunk(body: Body, bone: str, r: float) -> Solid:
    """A dilated rectangle in the frontal plane, as broad as the tables say until it is round."""
    length = body.length
    hip, chest = length["hip_breadth"], length["chest_breadth"]
    breadth = {"pelvis": hip, "lumbar": (hip + chest) / 2, "thorax": chest}[bone]
    height = {"pelvis": length["pelvis"], "lumbar": length["lumbar"], "thorax": length["shoulder"]}[bone]
    low = min(r / 2, height / 2)
    high = max(height - r / 2, low)
    side = max(breadth - 2 * r, 0.0)
    corner = np.array([0.0, low, -side / 2])
    return dilated_rectangle(corner, np.array([0, 0, side]), np.array([0, high - low, 0]), r, name=bone)


def _sole(bone: str, r: float, body: Body, back: float, front: float, joint_height: float) -> Solid:
    """A dilated rectangle on the floor from ``back`` to ``front`` of the joint [m], as broad as the foot."""
    start = min(back + r, (back + front) / 2)
    end = max(front - r, start)
    side = max(body.length["foot_breadth"] - 2 * r, 0.0)
    corner = np.array([start, r - joint_height, -side / 2])
    return dilated_rectangle(corner, np.array([end - start, 0, 0]), np.array([0, 0, side]), r, name=bone)


def _hand(body: Body, bone: str, r: float) -> Solid:
    """A dilated rectangle with the palm to +X, from the wrist to the fingertips, fingers straight."""
    whole, breadth = body.length["hand"], body.length["hand_breadth"]
    low = -max(whole - r, whole / 2)
    high = -min(r, whole / 2)
    side = max(breadth - 2 * r, 0.0)
    corner = np.array([0.0, low, -side / 2])
    return dilated_rectangle(corner, np.array([0, 0, side]), np.array([0, high - low, 0]), r, name=bone)
