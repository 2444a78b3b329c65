r"""The kinematics of one very robot, as measured at the factory, in place of those of its type.

Denavit–Hartenberg parameters say where the axes lie and where the flange is,

.. math:: T(q) = \prod_i R_z(\theta_i + q_i)\, T_z(d_i)\, T_x(a_i)\, R_x(\alpha_i),

and nothing of where on the axes the links are. Each link is moved as little as puts its axis where it was
measured, with its far end turned to the next axis; so the flange is exact at all joint angles, and shapes
and centres of mass move by millimetres. Two axes that are almost parallel are measured with hundreds of
metres of d that cancel out, which is why frames cannot simply be replaced by frames.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import msgspec
import numpy as np
from msgspec import Meta, Struct

from seerob.core.errors import InputError
from seerob.core.files.bounded import TooLarge, content
from seerob.core.files.toml_file import loads
from seerob.core.snapshot import Finding
from seerob.core.transforms import Array, inverse, rotation_from_axis_angle, transform
from seerob.description.description import Description, Joint, JointKind, Link

LARGEST = 1 << 16
"""A longer file is none [B]."""
SAME_AXIS, SAME_PLACE = np.deg2rad(5.0), 0.05
"""A measured axis or flange that is further off [rad, m] is that of another type of robot."""
TRIED = 200
"""Postures in which the tool is compared."""

_SixNumbers = Annotated[tuple[float, ...], Meta(min_length=6, max_length=6)]


class Calibration(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Measured Denavit–Hartenberg parameters of an arm of six joints."""

    theta: _SixNumbers
    """[rad]"""
    a: _SixNumbers
    """[m]"""
    d: _SixNumbers
    """[m]"""
    alpha: _SixNumbers
    """[rad]"""
    checksum: tuple[int, ...] = ()
    """The controller's own figure."""

    def frames(self, q: Array) -> tuple[Array, ...]:
        """Pose of the base, of each joint's frame after it has turned, and so of the flange at last.

        Args:
            q: Joint angles [rad], shape (6,).

        Returns:
            base_from_frame, seven of shape (4, 4).
        """
        found = [np.eye(4)]
        x, z = np.eye(3)[0], np.eye(3)[2]
        for theta, a, d, alpha, angle in zip(self.theta, self.a, self.d, self.alpha, q, strict=True):
            turn = transform(rotation_from_axis_angle(z, theta + angle), [0, 0, d])
            found.append(found[-1] @ turn @ transform(rotation_from_axis_angle(x, alpha), [a, 0, 0]))
        return tuple(found)


def calibrated_by(description: Description, name: str, folder: Path) -> Description:
    """The description as a file beside the workstation says, which travels with it.

    Args:
        description: Of the type of robot.
        name: Of the file, in the folder.
        folder: Of the workstation file.

    Raises:
        InputError: There is no such file, it is something else, or of another type of robot.
    """
    remedy = "let seerob probe rtde ADDRESS --calibration FILE write it"
    try:
        held = content(folder / name, LARGEST)
    except TooLarge:
        raise InputError.at(name, "", f"more than {LARGEST} bytes are no calibration", remedy) from None
    except OSError as error:
        raise InputError.at(name, "", f"cannot be read: {error.strerror}", remedy) from error
    found = calibrated(description, read_calibration(held, name), name)
    return replace(found, files={**found.files, Path(name).name: held})


def read_calibration(held: bytes, file: str) -> Calibration:
    """A file that ``seerob probe rtde --calibration`` has written.

    Raises:
        InputError: It is something else.
    """
    remedy = "let seerob probe rtde ADDRESS --calibration FILE write it"
    try:
        found = msgspec.convert(loads(held.decode()), Calibration)
    except (ValueError, RecursionError) as error:
        raise InputError.at(file, "", f"no calibration: {error}", remedy) from error
    if not np.isfinite([found.theta, found.a, found.d, found.alpha]).all():
        raise InputError.at(file, "", "values that are not finite", remedy)
    return found


def written(calibration: Calibration, about: str) -> str:
    """The text of such a file.

    Args:
        calibration: What it holds.
        about: Where that comes from, in a line.
    """
    lines = [f"# {about}", "# Denavit-Hartenberg parameters of this very robot: rad and m"]
    lines += [
        f"{key} = [{', '.join(repr(float(x)) for x in getattr(calibration, key))}]"
        for key in ("theta", "a", "d", "alpha")
    ]
    return "\n".join([*lines, f"checksum = {list(calibration.checksum)}", ""])


def calibrated(description: Description, calibration: Calibration, file: str) -> Description:
    """The description with the axes and the flange where they were measured.

    Args:
        description: Of the type of robot.
        calibration: Of the very robot.
        file: It comes from, for findings and messages.

    Raises:
        InputError: It is that of another type of robot.
    """
    chain = _KinematicChain(description, calibration, file)
    nominal = poses(description, np.zeros(6))
    placed: dict[str, Array] = {}
    links: list[Link] = []
    for link in description.links:
        if link.name in chain.moved:
            placed[link.name] = chain.moved[link.name]
            parent = np.eye(4) if link.parent is None else placed[link.parent]
            links.append(replace(link, parent_from_link=inverse(parent) @ placed[link.name]))
        else:
            parent = np.eye(4) if link.parent is None else placed[link.parent]
            placed[link.name] = parent @ link.parent_from_link
            links.append(link)
    shift = max(float(np.linalg.norm(placed[n][:3, 3] - nominal[n][:3, 3])) for n in chain.moved)
    found = replace(description, links=tuple(links))
    text = (
        f"kinematics of this very robot ({file}, checksum {_sum(calibration)}): the tool is up to "
        f"{1e3 * farthest(description, found, chain.flange):.1f} mm from where that of its type is, "
        f"links up to {1e3 * shift:.1f} mm with all joints at 0; shapes, masses and inertias are of the type"
    )
    note = Finding(level="note", subject=description.name, text=text)
    return replace(found, findings=(*description.findings, note))


def off_by(description: Description, calibration: Calibration, file: str) -> float:
    """How far the flange of a model is from that of the very robot, at most [m].

    Raises:
        InputError: They are of another type.
    """
    chain = _KinematicChain(description, calibration, file)
    off = 0.0
    for q in _postures():
        there = chain.root_from_base @ calibration.frames(q)[-1]
        here = poses(description, q)[chain.flange]
        off = max(off, float(np.linalg.norm(here[:3, 3] - there[:3, 3])))
    return off


def farthest(one: Description, other: Description, link: str) -> float:
    """Largest distance of a link between two descriptions in the same postures [m]."""
    return max(
        float(np.linalg.norm(poses(one, q)[link][:3, 3] - poses(other, q)[link][:3, 3])) for q in _postures()
    )


def poses(description: Description, q: Array) -> dict[str, Array]:
    """root_from_link of every link of an arm, shape (4, 4) each.

    Args:
        description: Links with one revolute joint at most.
        q: Angle per joint [rad].
    """
    angles = iter(q)
    found: dict[str, Array] = {}
    for link in description.links:
        pose = link.parent_from_link if link.parent is None else found[link.parent] @ link.parent_from_link
        for joint in link.joints:
            turn = rotation_from_axis_angle(joint.axis, float(next(angles)))
            pose = pose @ transform(turn, joint.anchor - turn @ joint.anchor)
        found[link.name] = pose
    return found


class _KinematicChain:
    """Six joints in a row, where they are and where they were measured, at angles 0, in the root's frame."""

    def __init__(self, description: Description, calibration: Calibration, file: str) -> None:
        turning = [(link, link.joints[0]) for link in description.links if link.joints]
        kinds = [joint.kind for link in description.links for joint in link.joints if joint.mimic is None]
        if kinds != [JointKind.REVOLUTE] * 6 or len(turning) != 6:
            what = f"{description.name} has {len(kinds)} joints: only an arm of six that turn has one"
            raise InputError.at(file, "", what, "leave it out")
        frames, nominal = calibration.frames(np.zeros(6)), poses(description, np.zeros(6))
        base = nominal[turning[0][0].parent or description.links[0].name]
        # A controller's base is turned by half a turn to that of the usual description.
        bases = [base @ transform(rotation_from_axis_angle(np.eye(3)[2], turn)) for turn in (0.0, np.pi)]
        tried = [_misfit(turning, nominal, b, frames) for b in bases]
        angle, distance, joint = min(tried, key=lambda t: t[0] / SAME_AXIS + t[1] / SAME_PLACE)
        if angle > SAME_AXIS or distance > SAME_PLACE:
            what = (
                f"not of this type of robot: axis {joint} would be {1e3 * distance:.0f} mm and "
                f"{np.rad2deg(angle):.0f}° from that of {description.name}"
            )
            raise InputError.at(file, "", what, "is it the calibration of another robot?")
        self.root_from_base = bases[tried.index((angle, distance, joint))]
        measured = [self.root_from_base @ frame for frame in frames]
        self.flange = _flange(description, turning[-1][0], nominal, measured[-1], file)
        self.moved = _moved(turning, nominal, measured, self.flange)


def _misfit(
    turning: list[tuple[Link, Joint]], nominal: dict[str, Array], base: Array, frames: tuple[Array, ...]
) -> tuple[float, float, int]:
    """Largest angle [rad] and distance [m] between an axis and the one that was measured; of which joint."""
    worst = (0.0, 0.0, 1)
    for k, (link, joint) in enumerate(turning):
        direction, point = _axis(nominal[link.name], joint)
        pose = base @ frames[k]
        angle = float(np.arccos(np.clip(direction @ pose[:3, 2], -1, 1)))
        distance = float(np.linalg.norm(point - _nearest(point, pose)))
        worst = max(worst, (angle, distance, k + 1), key=lambda t: t[0] / SAME_AXIS + t[1] / SAME_PLACE)
    return worst


def _axis(root_from_link: Array, joint: Joint) -> tuple[Array, Array]:
    """Direction and anchor of a joint's axis in the root's frame."""
    return root_from_link[:3, :3] @ joint.axis, root_from_link[:3, :3] @ joint.anchor + root_from_link[:3, 3]


def _nearest(point: Array, frame: Array) -> Array:
    """Of the z axis of a frame, the point that is nearest to another."""
    z, origin = frame[:3, 2], frame[:3, 3]
    nearest: Array = origin + z * (z @ (point - origin))
    return nearest


def _flange(
    description: Description, last: Link, nominal: dict[str, Array], measured: Array, file: str
) -> str:
    """The link that stands where the controller's flange is.

    Raises:
        InputError: There is none.
    """
    # Not the last link itself, which stays on its axis.
    below = {last.name}
    best: tuple[float, str] | None = None
    for link in description.links:
        if link.parent not in below:
            continue
        below.add(link.name)
        turn = nominal[link.name][:3, :3].T @ measured[:3, :3]
        angle = float(np.arccos(np.clip((np.trace(turn) - 1) / 2, -1, 1)))
        distance = float(np.linalg.norm(nominal[link.name][:3, 3] - measured[:3, 3]))
        misfit = angle / SAME_AXIS + distance / SAME_PLACE
        if angle < SAME_AXIS and distance < SAME_PLACE and (best is None or misfit < best[0]):
            best = misfit, link.name
    if best is None:
        what = f"no link of {description.name} stands at the controller's flange"
        raise InputError.at(file, "", what, "use a description with such a link: tool0 of the maker's")
    return best[1]


def _moved(
    turning: list[tuple[Link, Joint]], nominal: dict[str, Array], measured: list[Array], flange: str
) -> dict[str, Array]:
    """root_from_link of the links that turn, and of the flange."""
    end, there = nominal[flange], measured[6]
    # Of the last link it is the flange that its far end is turned to.
    before = [*(_axis(nominal[link.name], joint) for link, joint in turning), (end[:3, 0], end[:3, 3])]
    directions = [*(frame[:3, 2] for frame in measured[:6]), there[:3, 0]]
    guesses = [point for _, point in before[:6]]
    moved: dict[str, Array] = {}
    # Where on its axis a joint is, the link before it says, which is turned to where the joint is.
    for _ in range(len(turning)):
        places = [_nearest(guess, frame) for guess, frame in zip(guesses, measured[:6], strict=True)]
        places.append(there[:3, 3])
        for k, (link, joint) in enumerate(turning):
            (direction, point), (following, beyond) = before[k], before[k + 1]
            turn = _least_turn(direction, directions[k])
            ends = turn @ (beyond - point), places[k + 1] - places[k]
            next_axes = turn @ following, directions[k + 1]
            twist = _turn_about(directions[k], (ends, next_axes))
            rotation = twist @ turn @ nominal[link.name][:3, :3]
            moved[link.name] = transform(rotation, places[k] - rotation @ joint.anchor)
            if k + 1 < len(turning):
                guess = moved[link.name] @ inverse(nominal[link.name]) @ np.append(beyond, 1.0)
                guesses[k + 1] = guess[:3]
    moved[flange] = there
    return moved


def _turn_about(axis: Array, pairs: Iterable[tuple[Array, Array]]) -> Array:
    """The rotation about an axis that turns vectors best into others, in the least squares."""
    across = along = 0.0
    for a, b in pairs:
        across += float(axis @ np.cross(a, b))
        along += float(a @ b - (axis @ a) * (axis @ b))
    return rotation_from_axis_angle(axis, float(np.arctan2(across, along)))


def _least_turn(one: Array, other: Array) -> Array:
    """The rotation by the least angle that turns a unit vector into another, no opposite one."""
    cross = np.cross(one, other)
    sine = float(np.linalg.norm(cross))
    if sine < 1e-15:
        return np.eye(3)
    return rotation_from_axis_angle(cross / sine, float(np.arctan2(sine, one @ other)))


def _postures() -> Array:
    return np.random.default_rng(0).uniform(-np.pi, np.pi, (TRIED, 6))


def _sum(calibration: Calibration) -> str:
    return " ".join(f"{x:08x}" for x in calibration.checksum) or "unknown"
