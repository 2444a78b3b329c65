"""How a skeleton's segments lie in the bones, by the pose that it has when nothing is turned.

Where a file's joints are in a body differs between programs by centimetres: those of the spine may run along
the back, the hips 6 cm in front of the root. A posture of such joints alone leans, bends and nods while
somebody stands upright. But how segments turn is meant against the pose of rest. If somebody stands in it,
upright, with legs that hang down and arms to the sides, down, or between, it is known how every bone is
turned in it: a trunk, head and feet as the person's, limbs along their joints, palms down when arms are to
the sides. So segments show a posture by their orientations, and positions only where somebody is.

How a forearm is turned about itself in the pose of rest only a thumb tells; without one it is assumed, and
not assessed.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from seerob.core.snapshot import Finding
from seerob.core.transforms import Array, rotation_from_wxyz
from seerob.description.capture.captured import CaptureFrame, Layout
from seerob.description.capture.observing import Observer, Row
from seerob.description.description import Description
from seerob.description.humans.posture import posture
from seerob.description.humans.skeleton import BONES, SIDES, bone_poses, without_side

AXIS = np.cos(np.radians(20.0))
"""Up is an axis of the file when the way along it has this share of the way; right is, when it has."""
LEANING, HANGING, ASIDE, BENT = np.radians([25.0, 35.0, 30.0, 30.0])
"""What still stands: a trunk off the vertical, thighs and shanks off it, arms out of the frontal plane or
above the horizontal, elbows. Choices; the skeletons of the CMU library lean by 16° and spread legs by 20°."""
TRUNK, LIMB, BETWEEN, POSITION = 10.0, 1.0, 0.5, 0.02
"""Weights of orientations of pelvis, thorax and head (0.03 rad), of limbs, whose turn about themselves is
assumed, and of segments between; factor on those of positions, as joints of a skeleton are centimetres from
ours."""
THUMB = np.radians(60.0)
"""A thumb that is farther from where it is with palms down turns the hand about itself; a choice."""
_ARMS, _LEGS = ("upper_arm", "forearm", "hand"), ("thigh", "shank")
_NEXT = {"upper_arm": "forearm", "forearm": "hand", "thigh": "shank", "shank": "foot"}
_DOWN = np.array([0.0, -1.0, 0.0])


@dataclass(frozen=True, eq=False)
class _Body:
    """A skeleton in its pose of rest."""

    joints: Mapping[str, Array]
    """Bone → its proximal joint [m], (3,)."""
    axes: Array
    """File from body: columns forward, up, right of the person, shape (3, 3)."""

    def way(self, start: str, end: str) -> Array:
        """Direction from a bone's joint to another's in the body's axes, (3,); NaN where one is missing."""
        nothing = np.full(3, np.nan)
        way = self.axes.T @ (self.joints.get(end, nothing) - self.joints.get(start, nothing))
        size = float(np.linalg.norm(way))
        return way / size if size > 0 else nothing


def by_rest_pose(
    rest: CaptureFrame,
    layout: Layout,
    observer: Observer,
    description: Description,
    *,
    subject: str,
    orientation: float = 1.0,
    bones: Mapping[str, float] | None = None,
    mapped: Collection[str] = (),
) -> tuple[Observer, tuple[Finding, ...], bool]:
    """Bind a skeleton's segments by the pose in which nothing is turned.

    Args:
        rest: That pose, in any axes; or somebody who stands in a pose of calibration.
        layout: Of the device, with parents.
        observer: Its joints bound to bones.
        description: The person.
        subject: Whom findings are about.
        orientation: Factor on every weight of an orientation.
        bones: Further factors by bone.
        mapped: Names that the user gave a bone.

    Returns:
        The observer, what was found, and whether somebody stands in that pose: else the observer is as it
        was, and a warning says why.
    """
    joints = {row.bone: rest.positions[row.index] for row in observer.rows if not row.at.any()}
    axes, why = _axes(joints)
    body = _Body(joints, axes)
    why = why or _not_standing(body)
    pose = f"pose of {rest.pose or 'calibration'}"
    if why:
        text = f"its {pose} is not that of somebody who stands ({why}), so turns are not used"
        return observer, (Finding(level="warning", subject=subject, text=text),), False
    turned, rolled = _turned(body, observer, rest, description)
    weighed = {bone: orientation * _weight(bone) * (bones or {}).get(bone, 1.0) for bone in BONES}
    chest = _chest(layout, observer, mapped)
    rows = tuple(_rows((*observer.rows, *chest), chest, rest, body, turned, rolled, weighed, description))
    unrolled = [side for side in SIDES if not rolled[side]]
    text = (
        f"segments are turned against the {pose}, in which somebody stands with arms "
        f"{np.degrees(_raised(body)):.0f}° from hanging"
    )
    said = [Finding(level="assumed", subject=subject, text=text)]
    if unrolled:
        text = f"no thumb shows how palms are turned in it: not assessed of {' and '.join(unrolled)}"
        said.append(Finding(level="note", subject=subject, text=text))
    return replace(observer, rows=rows), tuple(said), True


def _axes(joints: Mapping[str, Array]) -> tuple[Array, str]:
    """File from body, and why there are none."""
    needed = [
        f"{side}_{bone}" for side in SIDES for bone in ("thigh", "shank", "foot", "upper_arm", "forearm")
    ]
    if missing := [bone for bone in (*needed, "head") if bone not in joints]:
        return np.eye(3), f"no joint for {missing[0]}"
    right = sum(joints[f"right_{bone}"] - joints[f"left_{bone}"] for bone in ("thigh", "upper_arm"))
    up = joints["head"] - 0.5 * (joints["right_foot"] + joints["left_foot"])
    vertical = _axis(np.asarray(up))
    if vertical is None:
        return np.eye(3), "from feet to head is along no axis of the file"
    level = np.asarray(right - vertical * (vertical @ right))
    if not np.linalg.norm(level) > AXIS * np.linalg.norm(right):
        return np.eye(3), "left and right are above each other"
    aside = _axis(level)
    aside = level / np.linalg.norm(level) if aside is None else aside
    return np.stack([np.cross(vertical, aside), vertical, aside], axis=1), ""


def _axis(way: Array) -> Array | None:
    """The axis of the file that a way is along, with its sign; None when it is along none."""
    size, axis = float(np.linalg.norm(way)), int(np.abs(way).argmax())
    if not size > 0 or abs(way[axis]) < AXIS * size:
        return None
    return np.asarray(np.sign(way[axis]) * np.eye(3)[axis])


def _not_standing(body: _Body) -> str:
    """Why the pose is not that of somebody who stands upright; empty when it is."""
    middle = {
        bone: 0.5 * (body.joints[f"right_{bone}"] + body.joints[f"left_{bone}"])
        for bone in ("thigh", "upper_arm")
    }
    trunk = body.axes.T @ (middle["upper_arm"] - middle["thigh"])
    if _angle(trunk, -_DOWN) > LEANING:
        return "the trunk leans"
    for side in SIDES:
        for bone in _LEGS:
            if _angle(body.way(f"{side}_{bone}", f"{side}_{_NEXT[bone]}"), _DOWN) > HANGING:
                return f"the {side} {bone} does not hang"
        toes = body.way(f"{side}_foot", f"{side}_toes")
        if toes[0] < 0:
            return "feet point backward: are left and right exchanged?"
        arm = body.way(f"{side}_upper_arm", f"{side}_forearm")
        fore = body.way(f"{side}_forearm", f"{side}_hand")
        outward = arm[2] if side == "right" else -arm[2]
        if abs(np.arcsin(arm[0])) > ASIDE or np.arcsin(arm[1]) > ASIDE or outward < -np.sin(ASIDE):
            return f"the {side} arm is neither at the side nor hanging"
        if np.isfinite(fore).all() and _angle(fore, arm) > BENT:
            return f"the {side} elbow is bent"
    return ""


def _angle(one: Array, other: Array) -> float:
    """Between two directions [rad]; infinite when one is not known."""
    angle = float(np.arctan2(np.linalg.norm(np.cross(one, other)), one @ other))
    return angle if np.isfinite(angle) else np.inf


def _raised(body: _Body) -> float:
    return float(np.mean([_angle(body.way(f"{s}_upper_arm", f"{s}_forearm"), _DOWN) for s in SIDES]))


def _turned(
    body: _Body, observer: Observer, rest: CaptureFrame, description: Description
) -> tuple[dict[str, Array], dict[str, bool]]:
    """Body from bone in the pose of rest, shape (3, 3) each, and of which sides a thumb tells the palm."""
    straight, _ = bone_poses(description, posture(description, "t_pose"))
    upright = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])  # world from body
    found = dict.fromkeys(BONES, np.eye(3))
    rolled = {}
    for side in SIDES:
        for bone in _LEGS:
            way = body.way(f"{side}_{bone}", f"{side}_{_NEXT[bone]}")
            found[f"{side}_{bone}"] = _swing(_DOWN, way)
        way = _DOWN
        for bone in _ARMS:
            usual = upright.T @ straight[BONES.index(f"{side}_{bone}")]
            own = body.way(f"{side}_{bone}", f"{side}_{_NEXT.get(bone, '')}")
            way = own if np.isfinite(own).all() else way
            found[f"{side}_{bone}"] = _swing(usual @ _DOWN, way) @ usual
        rolled[side] = _rolled(side, body, observer, rest, found)
    return found, rolled


def _swing(one: Array, other: Array) -> Array:
    """The shortest rotation from one direction to another, shape (3, 3)."""
    axis, cosine = np.cross(one, other), float(one @ other)
    k = np.array([[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]])
    return np.asarray(np.eye(3) + k + k @ k / (1.0 + cosine))


def _rolled(side: str, body: _Body, observer: Observer, rest: CaptureFrame, found: dict[str, Array]) -> bool:
    """Whether a thumb is where the palm that is assumed has it."""
    hand = f"{side}_hand"
    for row in observer.rows:
        if row.bone != hand or abs(row.at[2]) < abs(row.at[1]) / 3 or hand not in body.joints:
            continue
        thumb = found[hand].T @ body.axes.T @ (rest.positions[row.index] - body.joints[hand])
        across, expected = thumb[[0, 2]], row.at[[0, 2]]
        if np.linalg.norm(across) > 0.01:
            angle = np.arctan2(across[0] * expected[1] - across[1] * expected[0], across @ expected)
            return bool(abs(angle) < THUMB)
    return False


def _weight(bone: str) -> float:
    if bone in ("pelvis", "thorax", "head"):
        return TRUNK
    return BETWEEN if without_side(bone) in ("lumbar", "neck", "clavicle") else LIMB


def _rows(
    rows: Iterable[Row],
    chest: Sequence[Row],
    rest: CaptureFrame,
    body: _Body,
    turned: Mapping[str, Array],
    rolled: Mapping[str, bool],
    weighed: Mapping[str, float],
    description: Description,
) -> Iterable[Row]:
    assert rest.orientations is not None  # of a skeleton
    segments = rotation_from_wxyz(rest.orientations)
    done = set()
    for row in rows:
        if row.bone == "thorax" and chest and row is not chest[0]:
            continue
        first = not row.at.any() and row.bone not in done and np.isfinite(segments[row.index]).all()
        part = without_side(row.bone)
        trunk = part in {"lumbar", "thorax", "neck", "head", "clavicle"}
        position = 0.0 if trunk else row.position * POSITION
        orientation, mount, at = 0.0, None, row.at
        if first:
            done.add(row.bone)
            mount = segments[row.index].T @ body.axes @ turned[row.bone]
            orientation = weighed[row.bone]
        if row.bone == "pelvis":
            position, at = row.position, _on_pelvis(row, rest, body, description)
        if position or orientation:
            side = row.bone.partition("_")[0]
            yield replace(
                row,
                at=at,
                segment_from_bone=mount,
                position=position,
                orientation=orientation,
                fitted=False,
                rolled=part not in {"forearm", "hand"} or rolled[side],
            )


def _on_pelvis(row: Row, rest: CaptureFrame, body: _Body, description: Description) -> Array:
    """Where the joint is in our pelvis, when the middle of the hips is where ours is [m], (3,)."""
    R, p = bone_poses(description, np.zeros(len(description.joints())))
    ours = 0.5 * sum(p[BONES.index(f"{side}_thigh")] for side in SIDES) - p[BONES.index("pelvis")]
    theirs = 0.5 * sum(body.joints[f"{side}_thigh"] for side in SIDES)
    way = body.axes.T @ (rest.positions[row.index] - theirs)
    return np.asarray(R[BONES.index("pelvis")].T @ ours + way)


def _chest(layout: Layout, observer: Observer, mapped: Collection[str]) -> list[Row]:
    """The segment that carries neck and shoulders: the joint before them, whatever it is called."""
    rows = {row.bone: row for row in observer.rows}
    if any(row.bone == "thorax" and row.name in mapped for row in observer.rows) or not layout.parents:
        return []
    carried = next((rows[bone] for bone in ("neck", "left_clavicle", "left_upper_arm") if bone in rows), None)
    if carried is None or (index := layout.parents[carried.index]) < 0:
        return []
    if any(row.index == index and row.bone == "pelvis" for row in observer.rows):
        return []
    return [replace(carried, index=index, name=layout.names[index], bone="thorax", at=np.zeros(3))]
