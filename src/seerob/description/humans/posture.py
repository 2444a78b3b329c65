"""A posture: joint values by name or from the library, standing on the floor.

A name says what a positive value does (``right_knee_flexion``); its opposite word means the other sign and
``both_`` means both sides. A key that ends in ``_deg`` is in degrees, all else is in rad and m.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seerob.core import quantities
from seerob.core.errors import InputError, Problem, UnknownName
from seerob.core.transforms import Array
from seerob.description.description import Description, JointKind
from seerob.description.humans.anthropometry import table
from seerob.description.humans.skeleton import AXES, JOINTS, bone_poses, resolve

HEIGHT = JOINTS.index("pelvis_z")
SOLES = ("right_foot", "left_foot", "right_toes", "left_toes")
LARGEST = 1e6
"""No angle or length is as large, in any unit."""
ROUNDING = 1e-9
"""A value this far beyond a limit [rad or m] is at it: 20° written as radians."""


def names() -> tuple[str, ...]:
    """Postures in the library (``data/postures.toml``)."""
    return tuple(table("postures"))


def posture(
    description: Description,
    wanted: str | Mapping[str, float],
    *,
    joints: Mapping[str, float] | None = None,
    position: tuple[float, float] = (0.0, 0.0),
    heading: float = 0.0,
    floor: bool = True,
    file: str = "posture",
) -> Array:
    """Joint values of a posture.

    Args:
        description: The person.
        wanted: Name of a posture in the library, or joint values by name [rad, m; deg where the key ends in
            ``_deg``]; joints that are not named are at 0.
        joints: Values that replace those of ``wanted``, by name as there.
        position: Of the pelvis over the floor, in the root's frame: x forward, y left [m].
        heading: Turn to the left about the vertical [rad].
        floor: Move the pelvis up or down until the lowest sole is on the floor, z = 0 of the root.
        file: What the values were read from, for messages.

    Returns:
        Joint values [rad, m], shape (53,).

    Raises:
        UnknownName: No such posture or joint.
        InputError: A value is not finite, given twice or beyond its limit; all such values are named.
    """
    q = joint_values(description, named(wanted) if isinstance(wanted, str) else wanted, file=file)
    q = joint_values(description, joints or {}, base=q, file=file)
    q[JOINTS.index("pelvis_x")] += position[0]
    q[JOINTS.index("pelvis_y")] += position[1]
    q[JOINTS.index("pelvis_turn_left")] += heading
    return on_floor(description, q) if floor else q


def named(name: str) -> dict[str, float]:
    """Joint values of a posture of the library, as its file has them.

    Raises:
        UnknownName: It is not there.
    """
    library = table("postures")
    if name not in library:
        raise UnknownName("posture", name, library)
    return dict(library[name])


def joint_values(
    description: Description, wanted: Mapping[str, Any], *, base: Array | None = None, file: str = "posture"
) -> Array:
    """Joint values by name as an array, checked against the limits; see `posture`.

    Args:
        description: The person.
        wanted: Joint values by name.
        base: Values of the joints that are not named, shape (53,); 0 when not given.
        file: What the values were read from, for messages.

    Returns:
        Joint values [rad, m], shape (53,).
    """
    q = np.zeros(len(AXES)) if base is None else np.array(base, float)
    given: dict[int, str] = {}
    problems: list[Problem] = []
    joints = description.joints()
    for key, raw in wanted.items():
        places, value = _read(key, raw, file, problems)
        for place, sign in places:
            if place in given:
                what = f"{AXES[place].name} was already given by {given[place]!r}"
                problems.append(Problem(file, key, what, "give it once"))
                continue
            given[place] = key
            q[place] = sign * value + 0.0
            joint = joints[place]
            low = -np.inf if joint.lower is None else joint.lower
            high = np.inf if joint.upper is None else joint.upper
            if not low - ROUNDING <= q[place] <= high + ROUNDING:
                problems.append(Problem(file, key, *_beyond(place, sign, value, low, high)))
            q[place] = min(max(q[place], low), high)
    if problems:
        raise InputError(dict.fromkeys(problems))
    return q


def _read(
    key: str, raw: object, file: str, problems: list[Problem]
) -> tuple[tuple[tuple[int, float], ...], float]:
    """Places in q with their signs, and the value in SI."""
    stem, unit, factor = quantities.split(key) or (key, "", 1.0)
    places = resolve(stem)
    expected = "m" if AXES[places[0][0]].kind is JointKind.PRISMATIC else "rad"
    if unit not in ("", expected):
        problems.append(
            Problem(file, key, f"is in {unit}, {stem} is in {expected}", f"give it in {expected}")
        )
        return (), 0.0
    if isinstance(raw, bool) or not isinstance(raw, int | float) or not abs(raw) < LARGEST:
        problems.append(Problem(file, key, f"{raw!r} is not a number to use", f"give one in {expected}"))
        return (), 0.0
    return places, float(raw) * factor


def _beyond(place: int, sign: float, value: float, low: float, high: float) -> tuple[str, str]:
    """What is wrong and the remedy, in the direction that the user spoke of."""
    first, last = sorted((sign * low, sign * high))
    if AXES[place].kind is JointKind.PRISMATIC:
        return f"{value:g} m is beyond its limit", f"give {first + 0.0:g}…{last + 0.0:g} m"
    first, last, shown = (float(np.degrees(x)) + 0.0 for x in (first, last, value))
    return f"{shown:.1f}° is beyond its limit", f"give {first:g}…{last:g}°"


def sole_corners(
    description: Description, rotations: Array, positions: Array
) -> tuple[Array, Array, NDArray[np.intp]]:
    """Where the soles may touch the floor.

    A sole is a rectangle dilated by r: its lowest point is r below its lowest corner.

    Args:
        description: The person.
        rotations: From `bone_poses`, shape (..., 21, 3, 3).
        positions: From `bone_poses` [m], shape (..., 21, 3).

    Returns:
        Lowest points of the balls at the corners and the centres of these balls in the root's frame [m],
        each (..., m, 3), and the index of the bone that each belongs to, (m,).
    """
    centers, radii, owners = [], [], []
    for index, link in enumerate(description.links[1:]):
        for solid in link.solids if link.name in SOLES else ():
            assert solid.points is not None
            corners = np.vstack([solid.points, solid.points[1] + solid.points[-1] - solid.points[0]])
            turned = np.einsum("...ij,kj->...ki", rotations[..., index, :, :], corners)
            centers.append(turned + positions[..., index, None, :])
            radii += [solid.radius] * len(corners)
            owners += [index] * len(corners)
    center = np.concatenate(centers, axis=-2)
    return center - np.array(radii)[:, None] * np.array([0.0, 0.0, 1.0]), center, np.array(owners, np.intp)


def lowest_sole(description: Description, q: ArrayLike) -> Array:
    """Height of the lowest point of the feet over the floor [m], shape (...), of joint values (..., 53)."""
    lowest, _, _ = sole_corners(description, *bone_poses(description, q))
    return np.asarray(lowest[..., 2].min(axis=-1))


def on_floor(description: Description, q: ArrayLike) -> Array:
    """Move the pelvis up or down until the lowest sole is on the floor; every other joint value stays.

    Args:
        description: The person.
        q: Joint values [rad, m], shape (..., 53).

    Returns:
        Joint values [rad, m], shape (..., 53).
    """
    values = np.array(q, float)
    values[..., HEIGHT] -= lowest_sole(description, values)
    return values
