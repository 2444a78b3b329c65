r"""Lens and pose of a camera from pictures of a printed board.

The lens is found from the board in several poses (Zhang 2000, IEEE PAMI 22(11)), the pose from the board at a
known place. What both leave open is carried to a point p of the cell: with J the derivatives of the picture,
G what an error of the lens does to the pose, and σ what corners are off,

.. math:: \Sigma_p = J_x \sigma^2 N^{-1} J_x^T + (J_x G + J_l) \Sigma_l (J_x G + J_l)^T + J_b \Sigma_b J_b^T,

of the pose, the lens and the board's own place; in pixels, and across the line of sight in metres.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from seerob.core.errors import InputError
from seerob.core.extras import need
from seerob.core.transforms import Array, inverse, transform, wxyz_from_rotation
from seerob.description.camera.board import Board, made
from seerob.description.camera.lens import Camera, project
from seerob.description.capture.registration import turn

LEAST_PICTURES, LEAST_CORNERS = 6, 8
ACROSS = 2.447746830680816
"""Radius that holds 95 % of a normal distribution in a plane: root of the 95 % quantile of χ² with 2."""


class Corners(NamedTuple):
    """Corners of a board that were found in a picture."""

    board: Array
    """In the board's frame [m], shape (n, 3)."""
    pixels: Array
    """Shape (n, 2)."""


class Lens(NamedTuple):
    """A lens that was found."""

    lens: Array
    """fx, fy, cx, cy, k1, k2, p1, p2, k3."""
    covariance: Array
    """Shape (9, 9)."""
    size: tuple[int, int]
    """Width and height [px]."""
    error_px: float
    """Root mean square of what corners are off [px]."""
    pictures: int
    """In which a board was found."""


def corners(picture: NDArray[Any], board: Board) -> Corners | None:
    """Corners of a board in a picture (height, width) or (height, width, 3), 8 bit; None where too few."""
    need("cv2")
    import cv2

    grey = picture if picture.ndim == 2 else cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
    own = made(board)
    detector = cv2.aruco.CharucoDetector(own)
    found, ids, *_ = detector.detectBoard(grey)
    if ids is None or len(ids) < LEAST_CORNERS:
        return None
    pixels = np.asarray(found, np.float32).reshape(-1, 1, 2).copy()
    cv2.cornerSubPix(
        grey, pixels, (3, 3), (-1, -1), (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 40, 1e-3)
    )
    places = np.asarray(own.getChessboardCorners(), float)[np.asarray(ids).ravel()]
    return Corners(places, pixels.reshape(-1, 2).astype(float))


def lens(pictures: Sequence[Array], board: Board) -> Lens:
    """Lens from pictures of a board in several poses.

    Raises:
        InputError: Too few pictures with a board, or not all of one size.
    """
    sizes = {picture.shape[:2] for picture in pictures}
    if len(sizes) > 1:
        raise InputError.at("pictures", "", f"{len(sizes)} sizes of pictures", "take all with one setting")
    seen = [found for picture in pictures if (found := corners(picture, board)) is not None]
    if len(seen) < LEAST_PICTURES:
        what = f"the board {board} is in {len(seen)} of {len(pictures)} pictures"
        remedy = (
            f"take {LEAST_PICTURES} or more, tilted in several ways, sharp, up to the edges of the picture"
        )
        raise InputError.at("pictures", "", what, remedy)
    import cv2

    height, width = sizes.pop()
    points = [one.board.astype(np.float32) for one in seen]
    pixels = [one.pixels.astype(np.float32) for one in seen]
    start: Any = None
    rms, K, k, _, _, deviations, *_ = cv2.calibrateCameraExtended(
        points, pixels, (width, height), start, start
    )
    nine = np.array([K[0, 0], K[1, 1], K[0, 2], K[1, 2], *np.ravel(k)[:5]])
    spread = np.ravel(deviations)[:9]
    return Lens(nine, np.diag(spread**2), (width, height), float(rms), len(seen))


LEAST_PX = 0.2
"""No corner is taken to be found better [px]: those of one board are off together where the lens is."""


def look(found: Corners, lens: Array) -> tuple[Array, Array, float]:
    """Where a camera sees a board.

    Args:
        found: Its corners.
        lens: fx, fy, cx, cy, k1, k2, p1, p2, k3.

    Returns:
        Camera from board, shape (4, 4); covariance of its error, translation [m] before rotation [rad], in
        the camera's axes about its eye, shape (6, 6); root mean square of what corners are off [px].

    Raises:
        ValueError: Too few corners, or they lie on a line, or behind the camera.
    """
    need("cv2")
    import cv2

    if len(found.board) < LEAST_CORNERS or np.linalg.svd(found.board - found.board.mean(0))[1][1] < 1e-3:
        raise ValueError("too little of the board is seen: show it whole")
    fx, fy, cx, cy, *k = lens.tolist()
    K = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    points, pixels = np.ascontiguousarray(found.board), np.ascontiguousarray(found.pixels)
    try:
        _, r, t = cv2.solvePnP(points, pixels, K, np.array(k), flags=cv2.SOLVEPNP_SQPNP)
        r, t = cv2.solvePnPRefineLM(points, pixels, K, np.array(k), r, t)
    except cv2.error:
        raise ValueError("nothing tells where the camera is that sees the board so") from None
    camera_from_board = transform(turn(np.ravel(r)), np.ravel(t))
    ahead = found.board @ camera_from_board[:3, :3].T + camera_from_board[:3, 3]
    if not (np.isfinite(ahead).all() and (ahead[:, 2] > 0.01).all()):
        raise ValueError("the board is not before the camera: show it whole")
    off = found.pixels - project(lens, ahead)
    px = math.sqrt(float((off**2).sum()) / len(off))
    J, _ = _derivatives(lambda x, more: project(lens + more, ahead @ turn(x[3:]).T + x[:3]).ravel())
    return camera_from_board, np.asarray(max(px, LEAST_PX) ** 2 / 2 * np.linalg.inv(J.T @ J), float), px


class Placed(NamedTuple):
    """A camera that was put in the cell."""

    camera: Camera
    along: float
    """What 95 % of the error of the camera's own position stay within [m]."""


def placed(
    found: Lens,
    seen: Sequence[Corners],
    cell_from_board: Array,
    *,
    accuracy: float,
    tools: dict[str, Array],
    board: Board,
) -> Placed:
    """Pose of a camera that sees a board at a known place.

    Args:
        found: Its lens.
        seen: The board in pictures that were taken from one place.
        cell_from_board: Where the board is, shape (4, 4).
        accuracy: How far that may be off, standard deviation per axis of each corner of it [m].
        tools: Points of the cell at which the error is asked [m], by name.
        board: The board.

    Raises:
        InputError: No picture shows enough of it.
    """
    if not seen:
        raise InputError.at(
            "placed", "", "no picture shows the board at its place", "show it whole and sharp"
        )
    import cv2

    fx, fy, cx, cy, *k = found.lens.tolist()
    K = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    points, pixels = np.concatenate([one.board for one in seen]), np.concatenate([one.pixels for one in seen])
    _, r, t = cv2.solvePnP(points, pixels, K, np.array(k), flags=cv2.SOLVEPNP_SQPNP)
    r, t = cv2.solvePnPRefineLM(points, pixels, K, np.array(k), r, t)
    camera_from_board = transform(turn(np.ravel(r)), np.ravel(t))

    def picture(of: Array) -> Callable[[Array, Array], Array]:
        """Pixels of points of the board's frame, by errors of the pose and the lens."""
        ahead = of @ camera_from_board[:3, :3].T + camera_from_board[:3, 3]
        return lambda x, more: project(found.lens + more, ahead @ turn(x[3:]).T + x[:3]).ravel()

    Jx, Jl = _derivatives(picture(points))
    off = (
        pixels - project(found.lens, points @ camera_from_board[:3, :3].T + camera_from_board[:3, 3])
    ).ravel()
    px = math.sqrt(float((off**2).sum()) / len(points))
    # Corners of one board are off together where the lens is: no better than all pictures say.
    sigma = max(px, found.error_px) / math.sqrt(2)
    N = np.linalg.inv(Jx.T @ Jx)
    G = -N @ Jx.T @ Jl
    pose = sigma**2 * N + G @ found.covariance @ G.T
    size = 0.5 * board.square * min(board.across, board.up)
    place = np.diag([accuracy**2] * 3 + [(accuracy / size) ** 2 / 2] * 3)
    worst, where = 0.0, str(board)
    asked = tools or {"the board": cell_from_board[:3, 3]}
    for name, at in asked.items():
        of = inverse(cell_from_board) @ np.append(at, 1.0)
        depth = float((camera_from_board @ of)[2])
        if depth <= 0:
            raise InputError.at("placed", name, "is behind the camera", "look at the robot, not away from it")
        tx, tl = _derivatives(picture(of[None, :3]))
        both = tx @ G + tl
        shift = (
            np.concatenate([np.eye(3), -_skew(of[:3])], -1)
            @ place
            @ np.concatenate([np.eye(3), _skew(of[:3])], 0)
        )
        turned = tx[:, :3] @ camera_from_board[:3, :3]
        S = sigma**2 * tx @ N @ tx.T + both @ found.covariance @ both.T + turned @ shift @ turned.T
        error = ACROSS * math.sqrt(float(np.linalg.eigvalsh(S)[-1])) * depth / min(fx, fy)
        if error >= worst:
            worst, where = error, name
    world_from_camera = cell_from_board @ inverse(camera_from_board)
    x, y, z = world_from_camera[:3, 3].tolist()
    w, i, j, k_ = wxyz_from_rotation(world_from_camera[:3, :3]).tolist()
    camera = Camera(
        width=found.size[0], height=found.size[1], fx=fx, fy=fy, cx=cx, cy=cy,
        distortion=(k[0], k[1], k[2], k[3], k[4]), position=(x, y, z), wxyz=(w, i, j, k_),
        error_px=max(px, found.error_px), error=worst, tool=where, board=str(board),
    )  # fmt: skip
    eye = np.concatenate([np.eye(3), -_skew(-camera_from_board[:3, 3])], -1)
    along = 2.7955 * math.sqrt(float(np.linalg.eigvalsh(eye @ pose @ eye.T)[-1]) + accuracy**2)
    return Placed(camera, along)


def _derivatives(picture: Callable[[Array, Array], Array]) -> tuple[Array, Array]:
    """Of pixels by the pose (6) and by the lens (9), by central differences."""
    steps = np.concatenate([np.full(6, 1e-6), np.full(4, 1e-3), np.full(5, 1e-6)])
    columns = []
    for k, step in enumerate(steps):
        e = np.zeros(15)
        e[k] = step
        columns.append((picture(e[:6], e[6:]) - picture(-e[:6], -e[6:])) / (2 * step))
    J = np.stack(columns, -1)
    return J[:, :6], J[:, 6:]


def _skew(v: Array) -> Array:
    x, y, z = v
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
