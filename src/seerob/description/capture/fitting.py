"""The posture of a person that agrees best with pulls on the bones, joint limits kept."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from seerob.core.samples import ORIENTATION_SCALE, POSITION_SCALE, BodyPoint
from seerob.core.transforms import Array, rotation_from_wxyz
from seerob.description.description import Description, JointKind
from seerob.description.humans.posture import posture
from seerob.description.humans.skeleton import AXES, BONES, JOINTS, without_side
from seerob.kernels import posture_fit as kernel

REST = 0.2
"""Pull of the posture of rest: a joint 5 rad away from it counts as much as a point 2 cm away."""
TURN_REST = 0.7
"""Pull of the posture of rest on joints about a bone's own axis, in the measure of `REST`: a straight arm or
leg hardly shows how it is turned."""
UPRIGHT = 20.0
"""Pull of the posture of rest on how the pelvis leans, and on its height where it is higher below the head
than that of somebody who stands, in the measure of `REST`, while nothing is seen but head and arms; own
choice: who raises both hands neither swings the legs forward nor leaves the floor. Who is lower may sit,
crouch or bow: nobody knows. A head that is higher takes the person along."""
HEAD = BONES.index("head")
KEEP = 6.0
"""Pull of the posture a `KEEP_TIME` before, in the same measure: it smooths what is hardly seen, such as
how a forearm is turned, and hardly delays what is."""
KEEP_TIME = 1 / 60
"""[s]"""
ENOUGH = 1e-5
"""A step this small [rad or m] ends the iteration."""
FIRST_ITERATIONS, NEXT_ITERATIONS = 80, 10
AGAIN, AGAIN_ITERATIONS = 2, 4
"""Fits that follow, each with the result of the one before as its posture of rest and of before."""


@dataclass(frozen=True, eq=False)
class Pulls:
    """What is seen at one instant, in the root's frame of the person."""

    names: tuple[str, ...]
    """What the devices call them."""
    bone: NDArray[np.int64]
    """Of each, in the order of `BONES`, shape (m,)."""
    at: Array
    """In the bone's frame [m], shape (m, 3)."""
    position: Array
    """[m], shape (m, 3)."""
    wp: Array
    """One over the error of the position [1/m], 0 where it is not seen, shape (m,)."""
    rotation: Array
    """Root from bone, shape (m, 3, 3)."""
    wo: Array
    """One over the error of the orientation [1/rad], 0 where it is not seen, shape (m,)."""

    def of_links(self) -> kernel.Seen:
        """What is seen by links, of which the root is the first, as the compiled loop takes it."""
        return kernel.Seen(self.bone + 1, self.at, self.position, self.wp, self.rotation, self.wo)

    def same(self, other: Pulls) -> bool:
        """Whether the same is seen of the same bones."""
        return (
            self.names == other.names
            and np.array_equal(self.bone, other.bone)
            and np.array_equal(self.wp > 0, other.wp > 0)
            and np.array_equal(self.wo > 0, other.wo > 0)
        )

    def toward(self, other: Pulls, share: float) -> Pulls:
        """A share of the way to later ones of the same; rotations are chords of the arcs between."""
        return replace(
            self,
            position=(1 - share) * self.position + share * other.position,
            rotation=(1 - share) * self.rotation + share * other.rotation,
        )


def pulls(points: Sequence[BodyPoint], root_from_world: Array) -> Pulls:
    """Pulls of what devices see, from the world into the person's root frame (4, 4)."""
    m = len(points)
    R, origin = root_from_world[:3, :3], root_from_world[:3, 3]
    seen = np.array([p.position is not None for p in points], bool)
    turned = np.array([p.wxyz is not None for p in points], bool)
    position = np.array([p.position or (0.0, 0.0, 0.0) for p in points]).reshape(m, 3) @ R.T + origin
    rotation = R @ rotation_from_wxyz(np.array([p.wxyz or (1.0, 0, 0, 0) for p in points]).reshape(m, 4))
    return Pulls(
        names=tuple(p.name for p in points),
        bone=np.array([BONES.index(p.bone) for p in points], np.int64),
        at=np.array([p.at for p in points], float).reshape(m, 3),
        position=position,
        wp=np.sqrt([p.position_weight for p in points]) / POSITION_SCALE * seen,
        rotation=rotation,
        wo=np.sqrt([p.orientation_weight for p in points]) / ORIENTATION_SCALE * turned,
    )


class Fitter:
    """Fits postures of one person."""

    def __init__(self, description: Description) -> None:
        """Take the person's tree apart; a description of `seerob.description.humans.manikin.build`."""
        links = description.links
        names = [link.name for link in links]
        joints = description.joints()
        counts = [len(link.joints) for link in links]
        parent = np.array([-1 if link.parent is None else names.index(link.parent) for link in links])
        first = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
        chains: list[list[int]] = []
        for i, up in enumerate(parent):
            chains.append((chains[up] if up >= 0 else []) + list(range(first[i], first[i + 1])))
        chain = np.zeros((len(links), max(map(len, chains))), np.int64)
        for i, through in enumerate(chains):
            chain[i, : len(through)] = through
        self._links = kernel.Links(
            parent=parent,
            first=first,
            prismatic=np.array([j.kind is JointKind.PRISMATIC for j in joints], bool),
            axis=np.array([j.axis for j in joints], float),
            anchor=np.array([j.anchor for j in joints], float),
            offset=np.array([link.parent_from_link[:3, 3] for link in links]),
            mount=np.array([link.parent_from_link[:3, :3] for link in links]),
            chain=chain,
            length=np.array([len(through) for through in chains], np.int64),
        )
        self.lower = np.array([-np.inf if j.lower is None else j.lower for j in joints])
        """Of the joints [rad or m], shape (n,)."""
        self.upper = np.array([np.inf if j.upper is None else j.upper for j in joints])
        self.rest = posture(description, "standing")
        """Posture for what nobody measures, shape (n,)."""
        own_place = np.array([axis.bone == "pelvis" for axis in AXES])
        turns = np.array([axis.axis == (0.0, 1.0, 0.0) for axis in AXES])
        # Where the person is and faces has no rest.
        self._w_rest = np.where(own_place, 0.0, np.where(turns, TURN_REST, REST) ** 2)
        leans = np.isin(JOINTS, ["pelvis_list_right", "pelvis_tilt_back"])
        self._height = JOINTS.index("pelvis_z")
        self._w_upright = np.where(leans, UPRIGHT**2, self._w_rest)
        below = ("pelvis", "lumbar", "thorax", "thigh", "shank", "foot", "toes")
        self._below = np.array([without_side(bone) in below for bone in BONES])
        """Of each bone whether it is below head and arms: it shows how the trunk leans."""
        R, x = self.bones(self.rest)
        self._head_rest = R[HEAD], x[HEAD]
        self._w_keep = np.where(own_place, 1e-4, KEEP**2)
        # Loops that are not kept yet are compiled now: a run that waits for them falls behind.
        nothing = pulls((), np.eye(4))
        self.errors(nothing, self.fit(nothing, None)[0])

    def start(self, seen: Pulls) -> Array:
        """The posture of rest at the place and heading of what is seen: where a fit begins, shape (n,)."""
        q = self.rest.copy()
        n = len(q)
        R, p = self.bones(q)
        use = seen.wp > 0
        if not use.any():
            return q
        here = p[seen.bone] + np.einsum("mij,mj->mi", R[seen.bone], seen.at)
        weight = (seen.wp / seen.wp.sum())[use, None]
        a, b = here[use], seen.position[use]
        shift = (weight * a).sum(axis=0), (weight * b).sum(axis=0)
        da, db = a - shift[0], b - shift[1]
        turn = float(
            np.arctan2(
                (weight[:, 0] * (da[:, 0] * db[:, 1] - da[:, 1] * db[:, 0])).sum(),
                (weight[:, 0] * (da[:, :2] * db[:, :2]).sum(axis=1)).sum(),
            )
        )
        place = [axis.name for axis in AXES].index
        c, s = np.cos(turn), np.sin(turn)
        # The heading turns about the pelvis, which is above the root's origin in the posture of rest.
        pelvis = p[0]
        moved = shift[1] - np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ (shift[0] - pelvis) - pelvis
        q[place("pelvis_turn_left")] = turn
        q[place("pelvis_x")], q[place("pelvis_y")] = moved[0], moved[1]
        q[place("pelvis_z")] += moved[2]
        assert len(q) == n
        return q

    def fit(
        self,
        seen: Pulls,
        before: Array | None,
        *,
        reach: Array | float = np.inf,
        since: float = KEEP_TIME,
    ) -> tuple[Array, Array]:
        """The posture that agrees best.

        Args:
            seen: What is seen.
            before: The posture before, shape (n,); None for none.
            reach: How far each joint can have moved since [rad or m], shape (n,) or one for all.
            since: How long ago that was [s].

        Returns:
            Joint values [rad or m], shape (n,), and what is missing to what is seen, (m, 6): position [m],
            then the rotation vector [rad], in the root's frame; 0 where nothing is seen.
        """
        q = self.start(seen) if before is None else before.astype(float).copy()
        near = q if before is None else before
        reach = np.inf if before is None else reach
        error = np.zeros((len(seen.bone), 6))
        keep = self._w_keep * (0.0 if before is None else KEEP_TIME / max(since, 1e-3))
        lower, upper = np.maximum(self.lower, near - reach), np.minimum(self.upper, near + reach)
        rest, iterations = self.rest, FIRST_ITERATIONS if before is None else NEXT_ITERATIONS
        below = self._below[seen.bone[(seen.wp > 0) | (seen.wo > 0)]].any()
        w_rest = self._w_rest if below else self._w_upright.copy()
        most = np.inf if below else self.rest[self._height] + self._above(seen)
        for _ in range(1 + AGAIN):
            beside = kernel.Beside(rest, w_rest, near.copy(), keep)
            kernel.fit(q, lower, upper, beside, self._links, seen.of_links(), iterations, ENOUGH, error)
            rest, iterations = q.copy(), AGAIN_ITERATIONS
            if q[self._height] > most:
                rest[self._height], w_rest[self._height] = most, UPRIGHT**2
        return q, error

    def _above(self, seen: Pulls) -> float:
        """How much higher the head is seen than that of somebody who stands at the root [m]; at least 0."""
        head = (seen.bone == HEAD) & (seen.wp > 0)
        R, x = self._head_rest
        return float((seen.position[head] - x - seen.at[head] @ R.T)[:, 2].max(initial=0.0))

    def bones(self, q: Array) -> tuple[Array, Array]:
        """Root from bone (21, 3, 3) and positions [m] (21, 3), as `skeleton.bone_poses`."""
        poses = self.poses(q)
        return poses.R[1:], poses.p[1:]

    def poses(self, q: Array) -> kernel.Poses:
        """Root from link and joint axes, of the root too."""
        b, n = len(self._links.parent), len(q)
        found = kernel.Poses(np.empty((b, 3, 3)), np.empty((b, 3)), np.empty((n, 3)), np.empty((n, 3)))
        kernel.forward(q, self._links, found)
        return found

    def errors(self, seen: Pulls, q: Array) -> dict[str, tuple[float | None, float | None]]:
        """How far a posture is from what is seen: bone → position [m] and angle [rad].

        Of several things seen of a bone the largest; None where no position or no orientation was.
        """
        error = np.zeros((len(seen.bone), 6))
        kernel.residuals(self.poses(q), seen.of_links(), error)
        largest = np.full((2, len(BONES)), -1.0)
        for side, weight in enumerate((seen.wp, seen.wo)):
            use = weight > 0
            size = np.sqrt((error[use, 3 * side : 3 * side + 3] ** 2).sum(axis=1))
            np.maximum.at(largest[side], seen.bone[use], size)
        away, turned = largest.tolist()
        return {
            bone: (None if a < 0 else a, None if b < 0 else b)
            for bone, a, b in zip(BONES, away, turned, strict=True)
            if a >= 0 or b >= 0
        }
