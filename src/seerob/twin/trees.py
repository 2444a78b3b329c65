"""A robot's tree of joints, without MuJoCo's data: poses, Jacobians and masses of it alone, many at once.

What no joint moves against another is one link, so that a robot has as many as it has joints. Only trees of
joints that turn or slide, one to a body, are followed so; MuJoCo follows the others.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from seerob.core.transforms import Array
from seerob.kernels.chain import columns_of, followed, weighed

Indices = NDArray[np.int64]
_FOLLOWED = {int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)}


@dataclass(frozen=True, eq=False)
class Tree:
    """All bodies that one body of the world carries, bound once."""

    dofs: Indices
    """MuJoCo's degree of freedom of each joint, from the root outward, shape (n,)."""
    q_address: Indices
    zero: Array
    """Where each is drawn, in ``MjData.qpos`` [rad or m], shape (n,)."""
    parents: Indices
    turns: NDArray[np.bool_]
    fixed: Array
    axes: Array
    anchors: Array
    reference: Array
    """Where twists are said: where the root is drawn [m], shape (3,)."""
    masses: Array
    centers: Array
    inertias: Array
    armature: Array
    links: dict[int, tuple[int, Array, Array]]
    """MuJoCo's body: its link (0: the world), and rotation (3, 3) and origin (3,) [m] in it."""
    moves: NDArray[np.bool_]
    """Which joints move each link, shape (n + 1, n)."""

    @classmethod
    def of(cls, mj: mujoco.MjModel, root: int) -> Tree | None:
        """Bind to a `mujoco.MjModel`; None for a tree that only MuJoCo follows.

        Args:
            mj: The model.
            root: First body of the tree.
        """
        bodies = [int(b) for b in np.flatnonzero(mj.body_rootid == root)]
        joints = [int(mj.body_jntadr[b]) for b in bodies if mj.body_jntnum[b]]
        if (
            any(mj.body_jntnum[b] > 1 for b in bodies)
            or any(mj.body_mocapid[b] >= 0 for b in bodies)
            or any(int(mj.jnt_type[j]) not in _FOLLOWED for j in joints)
            or (mj.ntendon and mj.tendon_armature.any())
        ):
            return None
        links: dict[int, tuple[int, Array, Array]] = {0: (0, np.eye(3), np.zeros(3))}
        parents, fixed, weights = [], [], list[list[int]]()
        for body in bodies:
            link, turn, at = links[int(mj.body_parentid[body])]
            own = turn @ _rotation(mj.body_quat[body])
            origin = at + turn @ mj.body_pos[body]
            if mj.body_jntnum[body]:
                parents.append(link)
                fixed.append(np.hstack([own, origin[:, None]]))
                weights.append([])
                links[body] = len(parents), np.eye(3), np.zeros(3)
            else:
                links[body] = link, own, origin
            if links[body][0]:
                weights[links[body][0] - 1].append(body)
        n = len(parents)
        masses, centers, inertias = np.zeros(n), np.zeros((n, 3)), np.zeros((n, 3, 3))
        moves = np.zeros((n + 1, n), bool)
        for k, together in enumerate(weights):
            moves[k + 1] = moves[parents[k]]
            moves[k + 1, k] = True
            m = mj.body_mass[together]
            at = np.array([links[b][2] + links[b][1] @ mj.body_ipos[b] for b in together])
            masses[k] = m.sum()
            centers[k] = m @ at / masses[k] if masses[k] > 0 else 0.0
            for body, mass, d in zip(together, m, at - centers[k], strict=True):
                axes = links[body][1] @ _rotation(mj.body_iquat[body])
                inertias[k] += axes @ np.diag(mj.body_inertia[body]) @ axes.T
                inertias[k] += mass * ((d @ d) * np.eye(3) - np.outer(d, d))
        dofs, q = mj.jnt_dofadr[joints].astype(np.int64), mj.jnt_qposadr[joints].astype(np.int64)
        return cls(
            dofs=dofs,
            q_address=q,
            zero=mj.qpos0[q],
            parents=np.array(parents, np.int64),
            turns=np.array([mj.jnt_type[j] == mujoco.mjtJoint.mjJNT_HINGE for j in joints], np.bool_),
            fixed=np.array(fixed).reshape(n, 3, 4),
            axes=mj.jnt_axis[joints].reshape(n, 3),
            anchors=mj.jnt_pos[joints].reshape(n, 3),
            reference=mj.body_pos[root].copy(),
            masses=masses,
            centers=centers,
            inertias=inertias,
            armature=mj.dof_armature[dofs],
            links=links,
            moves=moves,
        )

    def follow(self, qpos: Array) -> Followed:
        """Where the tree is.

        Args:
            qpos: MuJoCo's positions, shape (N, nq).
        """
        n, count = len(self.parents), len(qpos)
        q = np.ascontiguousarray(qpos[:, self.q_address] - self.zero)
        rotations, positions = np.empty((count, n + 1, 3, 3)), np.empty((count, n + 1, 3))
        twists = np.empty((count, n, 6))
        followed(
            q, self.parents, self.turns, self.fixed, self.axes, self.anchors, self.reference,
            rotations, positions, twists,
        )  # fmt: skip
        return Followed(self, rotations, positions, twists)

    def places(self, dofs: Indices) -> Indices:
        """Where each joint is among some degrees of freedom, -1 for others, shape (n,)."""
        where = {int(dof): k for k, dof in enumerate(dofs)}
        return np.array([where.get(int(dof), -1) for dof in self.dofs], np.int64)


@dataclass(frozen=True, eq=False)
class Followed:
    """A tree at N instants."""

    tree: Tree
    rotations: Array
    """World from link, the world itself first, shape (N, n + 1, 3, 3)."""
    positions: Array
    """Their origins in the world [m], shape (N, n + 1, 3)."""
    twists: Array
    """What each joint causes, rotation first, shape (N, n, 6)."""

    def jacobian(self, body: int, local: Array, dofs: Indices) -> Array:
        """Jacobians of a point, linear rows first, world axes, shape (N, 6, m).

        Args:
            body: MuJoCo's, of this tree.
            local: The point in the body [m], shape (3,).
            dofs: MuJoCo's degrees of freedom that are the columns, shape (m,).
        """
        tree, (link, turn, at) = self.tree, self.tree.links[body]
        found = np.empty((len(self.twists), 6, len(dofs)))
        columns_of(
            self.twists, tree.reference, tree.moves[link], tree.places(dofs), self.rotations, self.positions,
            link, at + turn @ local, found,
        )  # fmt: skip
        return found

    def mass_matrix(self, dofs: Indices) -> Array:
        """Joint-space mass matrices of some degrees of freedom [kg·m², kg·m or kg], shape (N, m, m)."""
        tree, m = self.tree, len(dofs)
        found = np.empty((len(self.twists), m, m))
        weighed(
            self.rotations, self.positions, self.twists, tree.parents, tree.masses, tree.centers,
            tree.inertias, tree.armature, tree.reference, tree.places(dofs), found,
        )  # fmt: skip
        return found


def _rotation(wxyz: Array) -> Array:
    found = np.empty(9)
    mujoco.mju_quat2Mat(found, wxyz)
    return found.reshape(3, 3)
