"""From a frame of a device to pulls on bones: names, weights, mounting, where the device's world lies."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from seerob.core.samples import BodyPoint, Vec3, Vec4
from seerob.core.transforms import Array, left_product, right_product, wxyz_from_rotation
from seerob.description.capture.captured import CaptureFrame, Layout
from seerob.description.capture.mapping import Convention, Place
from seerob.description.description import Description
from seerob.description.humans.posture import posture
from seerob.description.humans.skeleton import BONES, bone_poses

LARGEST = 1e3
"""No person is farther from the origin of a device's world [m]."""
UNIT = 0.1
"""By how much the length of a quaternion may differ from 1."""
LIMBS = (
    ("left_thigh", "right_thigh"),
    ("left_upper_arm", "right_upper_arm"),
    *(
        (f"{side}_{bone}", f"{side}_{next_bone}")
        for side in ("left", "right")
        for bone, next_bone in (
            ("thigh", "shank"), ("shank", "foot"), ("upper_arm", "forearm"), ("forearm", "hand"),
        )
    ),
)  # fmt: skip
"""Bones that begin at the two ends of what no posture changes in length, but for the shoulders, by some
centimetres; from the trunk outward."""
OWN_PLACE = 0.2
"""No device places a joint farther from ours [m]: about the length of a clavicle."""


@dataclass(frozen=True, eq=False)
class Row:
    """One row of a device's frames, bound to a bone."""

    index: int
    """In the device's layout."""
    name: str
    bone: str
    at: Array
    """Where it is in the bone's frame [m], (3,)."""
    segment_from_bone: Array | None
    """How the bone is turned in the device's segment, (3, 3); None when nobody knows."""
    position: float
    """Weight of its position."""
    orientation: float
    """Weight of its orientation."""
    fitted: bool = False
    """Its place on the bone is still to be found: see `seerob.description.capture.mapping.Place`."""
    rolled: bool = True
    """Whether its orientation tells how the bone is turned about itself."""


@dataclass(frozen=True, eq=False)
class Size:
    """Lengths of the person, for a device whose metres, and whose shares of a body, are a guess."""

    hips: tuple[int, int]
    """Rows of both hips."""
    shoulders: tuple[int, int]
    """Rows of both shoulders."""
    trunk: float
    """From the middle of the hips to that of the shoulders of who stands upright [m]."""
    limbs: tuple[tuple[int, int, float], ...]
    """Rows at both ends of a limb, from the trunk outward, and its length [m]; hips and shoulders first."""
    carried: tuple[tuple[int, int], ...]
    """Rows that are at no joint, and the row of the joint that carries them."""

    def fitted(self, positions: Array) -> Array:
        """Places of a frame with every limb as long as the person's, in the directions that the device sees.

        Args:
            positions: About the middle of the hips, shape (n, 3), NaN where not known.

        Returns:
            Positions about the middle of the hips [m], shape (n, 3); trunk and shoulders are those of who
            stands upright, as nothing shows how they bend. NaN where no direction leads there.
        """
        at = positions.tolist()
        out = [[math.nan] * 3 for _ in at]
        ways = [[b - a for a, b in zip(at[near], at[far], strict=True)] for near, far, _ in self.limbs]
        found = [math.hypot(*way) for way in ways]
        scale = sum([length for *_, length in self.limbs]) / (sum(found) or math.nan)
        ways = [
            [x * (length / (size or math.nan)) for x in way]
            for way, size, (*_, length) in zip(ways, found, self.limbs, strict=True)
        ]
        hips, shoulders = (
            [(a + b) / 2 for a, b in zip(at[one], at[other], strict=True)]
            for one, other in (self.hips, self.shoulders)
        )
        trunk = [b - a for a, b in zip(hips, shoulders, strict=True)]
        size = self.trunk / (math.hypot(*trunk) or math.nan)
        for (left, right), middle, way in (
            (self.hips, (0.0, 0.0, 0.0), ways[0]),
            (self.shoulders, [x * size for x in trunk], ways[1]),
        ):
            out[left] = [a - b / 2 for a, b in zip(middle, way, strict=True)]
            out[right] = [a + b / 2 for a, b in zip(middle, way, strict=True)]
        for (near, far, _), way in zip(self.limbs[2:], ways[2:], strict=True):
            out[far] = [a + b for a, b in zip(out[near], way, strict=True)]
        for row, joint in self.carried:
            out[row] = [o + (a - b) * scale for o, a, b in zip(out[joint], at[row], at[joint], strict=True)]
        return np.array(out)


@dataclass(frozen=True, eq=False)
class Observer:
    """Makes pulls on bones of what one device sees; frozen."""

    rows: tuple[Row, ...]
    world_from_capture: Array
    """Shape (4, 4)."""
    size: Size | None = None
    """Of a device whose metres are a guess."""

    def points(self, frame: CaptureFrame) -> tuple[BodyPoint, ...]:
        """What a frame says of the person's bones, in the order of the rows.

        Args:
            frame: With as many rows as the layout that this was bound to.
        """
        R, origin = self.world_from_capture[:3, :3], self.world_from_capture[:3, 3]
        seen = np.asarray(frame.positions, float)
        if self.size is not None:
            seen = self.size.fitted(seen)
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
            positions = (seen @ R.T + origin).tolist()
            near = (np.abs(seen) < LARGEST).all(axis=1).tolist()  # false for NaN
            turns = self._turns(frame)
        shares = None if frame.confidence is None else np.asarray(frame.confidence, float).tolist()
        sure: float | None = None
        out = []
        for row, at in zip(self.rows, self._at, strict=True):
            i = row.index
            wp, wo = row.position, row.orientation
            if shares is not None:
                sure = _share(shares[i])
                wp, wo = wp * sure, wo * sure
            out.append(
                BodyPoint(
                    name=row.name,
                    bone=row.bone,
                    at=at,
                    position=tuple(positions[i]) if wp > 0 and near[i] else None,
                    wxyz=turns.get(i) if wo > 0 else None,
                    position_weight=wp,
                    orientation_weight=wo,
                    confidence=sure,
                    rolled=row.rolled,
                )
            )
        return tuple(out)

    def _turns(self, frame: CaptureFrame) -> dict[int, Vec4]:
        """World from bone, by row of the layout, of the bones of which that is known."""
        indices, matrices = self._mounted
        if frame.orientations is None or not indices:
            return {}
        given = np.asarray(frame.orientations, float)[indices]
        length = np.sqrt(np.einsum("ij,ij->i", given, given))
        known = (np.abs(length - 1.0) < UNIT).tolist()  # false for NaN
        found = np.einsum("ijk,ik->ij", matrices, given / length[:, None]).tolist()
        return {
            i: (w, x, y, z) if w >= 0 else (-w, -x, -y, -z)
            for i, there, (w, x, y, z) in zip(indices, known, found, strict=True)
            if there
        }

    @cached_property
    def _mounted(self) -> tuple[list[int], Array]:
        """Rows whose bones' turns are known, and what makes these of quaternions of the rows, (n, 4, 4)."""
        known = {row.index: row.segment_from_bone for row in self.rows if row.segment_from_bone is not None}
        world = left_product(wxyz_from_rotation(self.world_from_capture[:3, :3]))
        found = [world @ right_product(wxyz_from_rotation(segment)) for segment in known.values()]
        return list(known), np.array(found).reshape(-1, 4, 4)

    @cached_property
    def _at(self) -> tuple[Vec3, ...]:
        """Where each row is in its bone's frame [m]."""
        return tuple(_three(row.at) for row in self.rows)


def bind(
    layout: Layout,
    places: tuple[Place | None, ...],
    description: Description,
    *,
    convention: Convention | None = None,
    world_from_capture: Array | None = None,
    position: float = 1.0,
    orientation: float = 1.0,
    bones: Mapping[str, float] | None = None,
) -> Observer:
    """Bind a device's rows to the bones of a person.

    Args:
        layout: The device's names.
        places: From `seerob.description.capture.mapping.places`.
        description: The person.
        convention: Whose names they are; says how segments are turned in a posture of rest.
        world_from_capture: Where the device's world lies, (4, 4); identity when not given.
        position: Factor on every weight of a position.
        orientation: Factor on every weight of an orientation.
        bones: Further factors by bone.
    """
    tall = stature(description)
    rested = None
    if convention is not None and convention.rest is not None:
        rested, _ = bone_poses(description, posture(description, convention.rest))
    rows = []
    for index, place in enumerate(places):
        if place is None:
            continue
        factor = (bones or {}).get(place.bone, 1.0)
        weights = place.position * position * factor, place.orientation * orientation * factor
        if not any(weights):
            continue  # as good as not mapped
        rows.append(
            Row(
                index=index,
                name=layout.names[index],
                bone=place.bone,
                at=place.at if place.metres else place.at * tall,
                segment_from_bone=None
                if rested is None or convention is None
                else convention.axes.T @ rested[BONES.index(place.bone)],
                position=weights[0],
                orientation=weights[1],
                fitted=place.fitted and weights[0] > 0,
            )
        )
    world = np.eye(4) if world_from_capture is None else world_from_capture
    return Observer(tuple(rows), world, _size(places, description) if layout.scaled else None)


def _size(places: Sequence[Place | None], description: Description) -> Size | None:
    """Of the rows that lie at joints; None where a limb has not both ends."""
    _, positions = bone_poses(description, np.zeros(len(description.joints())))
    own = {bone: positions[BONES.index(bone)] for bone in BONES}
    at_joint = {
        place.bone: row for row, place in enumerate(places) if place is not None and not place.at.any()
    }
    if any(bone not in at_joint for limb in LIMBS for bone in limb):
        return None
    shoulders, hips = ((own[f"left_{x}"] + own[f"right_{x}"]) / 2 for x in ("upper_arm", "thigh"))
    return Size(
        hips=(at_joint["left_thigh"], at_joint["right_thigh"]),
        shoulders=(at_joint["left_upper_arm"], at_joint["right_upper_arm"]),
        trunk=float(np.linalg.norm(shoulders - hips)),
        limbs=tuple((at_joint[a], at_joint[b], float(np.linalg.norm(own[b] - own[a]))) for a, b in LIMBS),
        carried=tuple(
            (row, at_joint[place.bone.replace("toes", "foot")])
            for row, place in enumerate(places)
            if place is not None and place.position > 0 and row not in at_joint.values()
        ),
    )


def with_mounts(observer: Observer, mounts: Mapping[int, tuple[Array, Array]]) -> Observer:
    """Return the observer with the mountings that a calibration found.

    Args:
        observer: As the device states it.
        mounts: Index of a row in the layout → ``segment_from_bone`` (3, 3) and ``at`` [m] (3,).
    """
    rows = tuple(
        replace(row, segment_from_bone=mounts[row.index][0], at=mounts[row.index][1])
        if row.index in mounts
        else row
        for row in observer.rows
    )
    return replace(observer, rows=rows)


def with_places(observer: Observer, places: Mapping[str, Array]) -> Observer:
    """Move rows on their bones: name of the row → place in the bone's frame [m], (3,)."""
    rows = tuple(
        replace(row, at=places[row.name], fitted=False) if row.name in places else row
        for row in observer.rows
    )
    return replace(observer, rows=rows)


def without_unplaced(observer: Observer) -> tuple[Observer, tuple[str, ...]]:
    """Drop positions whose place on the bone nobody knows; returns their rows' names, too."""
    rows = tuple(replace(row, position=0.0, fitted=False) if row.fitted else row for row in observer.rows)
    names = tuple(row.name for row in observer.rows if row.fitted)
    return replace(observer, rows=tuple(row for row in rows if row.position or row.orientation)), names


def stature(description: Description) -> float:
    """Height of the vertex of a person who stands upright [m]."""
    _, positions = bone_poses(description, np.zeros(len(description.joints())))
    head = next(link for link in description.links if link.name == "head")
    tops = [solid.points[:, 1].max() + solid.radius for solid in head.solids if solid.points is not None]
    return float(positions[BONES.index("head"), 2] + max(tops))


def _share(value: float) -> float:
    return min(max(value, 0.0), 1.0) if math.isfinite(value) else 0.0


def _three(v: Array) -> Vec3:
    return float(v[0]), float(v[1]), float(v[2])
