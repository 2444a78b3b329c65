"""Joint values of a person as the coordinates of OpenSim's full-body models, and back.

Names and senses are those of Rajagopal et al. 2016 (``pelvis_tilt``, ``hip_flexion_r``, ``arm_add_l`` …),
as far as they are known here from use, not from its file (confidence M). Its axes are the ISB's, as ours:
X forward, Y up, Z to the right. Three things differ and are converted or said:

- the pelvis turns in the order tilt, list, rotation, ours the other way round; the shoulder likewise;
- it has one joint of the back where we have two: each takes half of the turn, about the same axis;
- it has no neck, no collar bones, and oblique axes in ankle, foot, elbow and wrist: taken as straight.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from seerob.core.transforms import Array
from seerob.description.humans.skeleton import JOINTS

SIDES = {"r": "right", "l": "left"}
PELVIS = ("pelvis_tilt", "pelvis_list", "pelvis_rotation")
PLACE = ("pelvis_tx", "pelvis_ty", "pelvis_tz")
BACK = ("lumbar_extension", "lumbar_bending", "lumbar_rotation")
BENT = -1.0
"""Sign of knee flexion in our values; older models (gait2392) have it so too."""

_STRAIGHT = (
    # Ours on the right, theirs, sign.
    ("hip_flexion", "hip_flexion", 1.0),
    ("hip_adduction", "hip_adduction", 1.0),
    ("hip_internal_rotation", "hip_rotation", 1.0),
    ("knee_extension", "knee_angle", BENT),
    ("ankle_dorsiflexion", "ankle_angle", 1.0),
    ("ankle_inversion", "subtalar_angle", 1.0),
    ("toes_extension", "mtp_angle", 1.0),
    ("elbow_flexion", "elbow_flex", 1.0),
    ("elbow_pronation", "pro_sup", 1.0),
    ("wrist_flexion", "wrist_flex", 1.0),
    ("wrist_ulnar_deviation", "wrist_dev", 1.0),
)
ARM = ("arm_flex", "arm_add", "arm_rot")


def _index(side: str, name: str) -> tuple[int, float]:
    """Place in q of a movement named for the right side, and the sign that it has on this side."""
    from seerob.description.humans.skeleton import resolve

    ((place, sign),) = resolve(f"{SIDES[side]}_{name}")
    return place, sign


def coordinates() -> tuple[str, ...]:
    """All names, in the order of `from_joints`."""
    sided = [f"{theirs}_{s}" for s in SIDES for theirs in (*(t for _, t, _ in _STRAIGHT), *ARM)]
    return (*PELVIS, *PLACE, *BACK, *sided)


def is_length(name: str) -> bool:
    """Whether a coordinate is a length [m] and not an angle."""
    return name in PLACE


def in_its_world(points: Array) -> Array:
    """Points of a world with z up in OpenSim's (x forward, y up, z right), shape (..., 3)."""
    return np.stack([points[..., 0], points[..., 2], -points[..., 1]], axis=-1)


def from_joints(q: Array, pelvis: Array) -> Array:
    """OpenSim's coordinates of postures.

    Args:
        q: Joint values [rad, m], shape (n, 53).
        pelvis: Where the pelvis is in a world with z up [m], shape (n, 3).

    Returns:
        Angles [rad] and lengths [m] in OpenSim's world (x forward, y up, z right), shape (n, 37), in the
        order of `coordinates`.
    """
    found: dict[str, Array] = {}
    turn = _turn("YXZ", q[:, _places("pelvis_turn_left", "pelvis_list_right", "pelvis_tilt_back")])
    found |= zip(PELVIS, _angles("ZXY", turn).T, strict=True)
    found |= zip(PLACE, in_its_world(pelvis).T, strict=True)
    back = _turn("ZXY", q[:, _spine("lumbar")]) * _turn("ZXY", q[:, _spine("thorax")])
    found |= zip(BACK, _angles("ZXY", back).T, strict=True)
    for side in SIDES:
        for ours, theirs, sign in _STRAIGHT:
            place, own = _index(side, ours)
            found[f"{theirs}_{side}"] = sign * own * q[:, place]
        mirror = _mirror(side)
        arm = _turn("ZYX", q[:, _arm(side)])
        for name, values in zip(ARM, (_angles("ZXY", arm) * mirror[[0, 1, 2]]).T, strict=True):
            found[f"{name}_{side}"] = values
    return np.stack([found[name] for name in coordinates()], axis=1)


def to_joints(
    names: Sequence[str], values: Array, *, knee: float = BENT
) -> tuple[Array, Array, tuple[str, ...]]:
    """Postures of OpenSim's coordinates.

    Args:
        names: Of the coordinates; what is not known is left out, what is not there is 0.
        values: Angles [rad] and lengths [m], shape (n, k).
        knee: Sign of knee flexion in our values per theirs: -1 where a bent knee is positive.

    Returns:
        Joint values [rad, m] with the place of the pelvis left at 0, shape (n, 53); where the pelvis is in a
        world with z up [m], shape (n, 3), NaN where nobody says; and the names that were used.
    """
    known = {name: values[:, k] for k, name in enumerate(names)}
    zero = np.zeros(len(values))
    q = np.zeros((len(values), len(JOINTS)))

    def block(wanted: Sequence[str]) -> Array:
        return np.stack([known.get(name, zero) for name in wanted], axis=1)

    places = _places("pelvis_turn_left", "pelvis_list_right", "pelvis_tilt_back")
    q[:, places] = _angles("YXZ", _turn("ZXY", block(PELVIS)))
    half = _turn("ZXY", block(BACK))
    angles = _angles("ZXY", type(half).from_rotvec(half.as_rotvec() / 2))
    q[:, _spine("lumbar")] = q[:, _spine("thorax")] = angles
    for side in SIDES:
        for ours, theirs, sign in _STRAIGHT:
            place, own = _index(side, ours)
            factor = knee if theirs == "knee_angle" else sign
            q[:, place] = factor * own * known.get(f"{theirs}_{side}", zero)
        arm = block([f"{name}_{side}" for name in ARM]) * _mirror(side)
        q[:, _arm(side)] = _angles("ZYX", _turn("ZXY", arm))
    at = block(PLACE) if set(PLACE) <= set(known) else np.full((len(values), 3), np.nan)
    pelvis = np.stack([at[:, 0], -at[:, 2], at[:, 1]], axis=1)
    return q, pelvis, tuple(name for name in coordinates() if name in known)


def knee_sign(names: Sequence[str], values: Array) -> float | None:
    """Which sign a bent knee has: a knee bends to one side only.

    Returns:
        For ``knee`` of `to_joints`; None when the knees never bend by more than a little.
    """
    columns = [k for k, name in enumerate(names) if name in ("knee_angle_r", "knee_angle_l")]
    if not columns:
        return None
    with np.errstate(invalid="ignore"):
        knees = values[:, columns]
        most, least = np.nanmax(knees, initial=0.0), np.nanmin(knees, initial=0.0)
    if max(most, -least) < np.radians(10):
        return None
    return BENT if most > -least else -BENT


def _places(*names: str) -> list[int]:
    return [JOINTS.index(name) for name in names]


def _spine(bone: str) -> list[int]:
    return _places(f"{bone}_extension", f"{bone}_bend_right", f"{bone}_turn_left")


def _arm(side: str) -> list[int]:
    names = ("shoulder_flexion", "shoulder_internal_rotation", "shoulder_adduction")
    return [_index(side, name)[0] for name in names]


def _mirror(side: str) -> Array:
    """Signs of flexion, adduction, rotation about the axes of the bone."""
    return np.array([1.0, 1.0, 1.0] if side == "r" else [1.0, -1.0, -1.0])


def _turn(order: str, angles: Array):  # type: ignore[no-untyped-def]  # scipy has no types
    from scipy.spatial.transform import Rotation

    return Rotation.from_euler(order, angles)


def _angles(order: str, turn) -> Array:  # type: ignore[no-untyped-def]
    import warnings

    with warnings.catch_warnings():
        # At a singular pose the sum of two angles is right, and which is which does not matter.
        warnings.filterwarnings("ignore", message="Gimbal lock")
        return np.asarray(turn.as_euler(order))
