"""Which way is up, when the file does not say or the camera was tilted: people stand on their feet."""

from __future__ import annotations

import re
from enum import StrEnum

import numpy as np

from seerob.core.snapshot import Finding
from seerob.core.transforms import Array, transform
from seerob.protocols.tracking.kinect import JOINTS

UPRIGHT_SHARE = 0.1
"""Share of the frames, those in which the body is longest, that tell the vertical."""
SOLE = 0.02
"""Height of joints of the feet over the floor of somebody who stands, as cameras see them [m]; a choice."""
CLEAR = 0.6
"""An axis is up when so much of the way from feet to head is along it, as a share."""


class Up(StrEnum):
    """The axis that points up in a file."""

    X = "x"
    Y = "y"
    Z = "z"
    MINUS_X = "-x"
    MINUS_Y = "-y"
    MINUS_Z = "-z"


_TURNS = {
    # World (z up) from file; the axes go round, so that right-handed stays right-handed.
    "z": np.eye(3),
    "y": np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
    "x": np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]),
    "-z": np.diag([1.0, -1.0, -1.0]),
    "-y": np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]),
    "-x": np.array([[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]]),
}
_X_FORWARD = {
    "y": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
    "-y": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]),
}


def world_from_file(up: str, *, x_forward: bool = False) -> Array:
    """Rotation into a world with z up, shape (3, 3).

    Args:
        up: Axis of the file that points up: ``z``, ``y``, ``-y`` …
        x_forward: With y up, x stays x, as in OpenSim (x forward, y up, z right); else z becomes x.
    """
    return np.array(_X_FORWARD.get(up, _TURNS[up]) if x_forward else _TURNS[up])


# -- by the names of markers and joints ---------------------------------------------------------

_HEIGHTS = (
    # Parts of names, without case and side, from the floor up; the first that fits counts.
    (0, r"toe|foot|heel|calc|mt[1-5]$|hee$|ball"),
    (1, r"ank|mall?eol|mal[lm]|tib|shank|knee|^[lr]?kne|low(er)?leg"),
    (2, r"asis|psis|^[lr]?(asi|psi)|sacr|pelv|waist|^[lr]?hip|iliac"),
    (4, r"head|^[lr][fb]hd$|nose|ear$|eye$|vertex|temple|forehead"),
    (3, r"sho$|should|acr|clav|ster|xiph|manub|^c7|^t1$|^t[2-9]$|^t10$|strn|scap|neck|thorax|chest|spine"),
)


def height_of(name: str) -> int | None:
    """0 for a foot … 4 for the head; None when the name does not say, as those of arms."""
    text = re.sub(r"[^a-z0-9]", "", name.rpartition(":")[2].lower())
    if re.search(r"hand|finger|wrist|wri$|arm|elb|thumb|toolbox|radi|uln", text):
        return None
    return next((height for height, pattern in _HEIGHTS if re.search(pattern, text)), None)


def up_axis(names: tuple[str, ...], positions: Array) -> tuple[str, float] | None:
    """The axis along which heads are above feet.

    Args:
        names: Of the points, as the file has them.
        positions: Shape (n, k, 3), NaN where not seen.

    Returns:
        The axis (``-y``) and the share of the way up that is along it, from 0 to 1; None when too few
        names say how high they are.
    """
    known = [(i, h) for i, name in enumerate(names) if (h := height_of(name)) is not None]
    if len({h for _, h in known}) < 2:
        return None
    places = np.array([i for i, _ in known])
    heights = np.array([h for _, h in known], float)
    # A few hundred instants say the same as all.
    chosen = positions[:: max(1, len(positions) // 300), places]
    ways = []
    for points in chosen:
        seen = np.isfinite(points).all(axis=1)
        if len(set(heights[seen].tolist())) < 2:
            continue
        high = heights[seen] - heights[seen].mean()
        ways.append(high @ (points[seen] - points[seen].mean(axis=0)))
    if not ways:
        return None
    way = np.median(ways, axis=0)
    size = float(np.linalg.norm(way))
    if size == 0 or not np.isfinite(size):
        return None
    axis = int(np.abs(way).argmax())
    return ("" if way[axis] > 0 else "-") + "xyz"[axis], float(abs(way[axis]) / size)


# -- a camera that looks down at somebody -------------------------------------------------------

_ANKLES = [JOINTS.index("ANKLE_LEFT"), JOINTS.index("ANKLE_RIGHT")]
_FEET = [JOINTS.index("FOOT_LEFT"), JOINTS.index("FOOT_RIGHT")]
_NECK = JOINTS.index("NECK")


def kinect_upright(positions: Array, *, file: str) -> tuple[Array, Finding]:
    """Where a depth camera stands, by its joints, shape (n, 32, 3); see `camera_upright`."""
    return camera_upright(
        positions[:, _ANKLES].mean(axis=1), positions[:, _NECK], positions[:, _FEET], file=file
    )


def camera_upright(ankles: Array, neck: Array, feet: Array, *, file: str) -> tuple[Array, Finding]:
    """Where the camera stands, from the person it sees: upright, over a floor, heading kept.

    The vertical is the direction from the ankles to the neck in the frames in which that way is longest.

    Args:
        ankles: Their middle in the camera's frame x forward, y left, z up [m], shape (n, 3); NaN where not
            seen.
        neck: Likewise, or the middle of the shoulders.
        feet: What stands on the floor, shape (n, k, 3).
        file: As messages name it.

    Returns:
        World from camera, shape (4, 4): the floor at z = 0, the camera above the origin, looking along x;
        and what was estimated.
    """
    ways = neck - ankles
    length = np.linalg.norm(ways, axis=1)
    usable = np.flatnonzero(np.isfinite(length) & (length > 0.3))
    if len(usable) == 0:
        text = (
            f"{file}: the camera is taken as level at the origin, as neck and feet are never seen together; "
            "give at"
        )
        return np.eye(4), Finding(level="assumed", subject="", text=text)
    longest = usable[np.argsort(length[usable])[-max(1, int(len(usable) * UPRIGHT_SHARE)) :]]
    directions = ways[longest] / length[longest, None]
    up = np.median(directions, axis=0)
    up /= np.linalg.norm(up)
    spread = float(np.degrees(np.median(np.arccos(np.clip(directions @ up, -1, 1)))))
    rotation = upright_rotation(up)
    heights = (feet @ rotation.T)[..., 2]
    floor = float(np.nanpercentile(heights, 5)) - SOLE if np.isfinite(heights).any() else 0.0
    tilt = float(np.degrees(np.arccos(np.clip(up[2], -1, 1))))
    text = (
        f"{file}: pose of the camera estimated from {len(longest)} frames in which the person stands most "
        f"upright: tilted by {tilt:.1f}°, {-floor:.2f} m above the floor (directions spread by "
        f"{spread:.1f}°); measure it and give at"
    )
    return transform(rotation, (0.0, 0.0, -floor)), Finding(level="assumed", subject="", text=text)


def upright_rotation(up: Array) -> Array:
    """World (z up) from a frame in which ``up`` points up; what is forward (x) there stays in the plane x, z.

    Args:
        up: Unit vector, shape (3,).

    Returns:
        Rotation matrix, shape (3, 3).
    """
    forward = np.array([1.0, 0.0, 0.0])
    if abs(up[0]) > 0.99:
        # It looks straight down or up: what was above in the picture is forward.
        forward = np.array([0.0, 0.0, -np.sign(up[0])])
    x = forward - up * (forward @ up)
    x /= np.linalg.norm(x)
    return np.array([x, np.cross(up, x), up])
