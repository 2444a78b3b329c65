"""Which joints are whose, and which of MuJoCo's bodies moves each body: what a gripper lets go changes it."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from seerob.core.transforms import Array
from seerob.model.model import Body, Mechanism, Model
from seerob.model.mounting.loose import BODY

Indices = NDArray[np.int64]


def unknown_place(body: Body) -> str:
    """Why nobody knows where a body is that a gripper picks up, without a run."""
    if body.holder == body.owner:
        if body.name != f"{body.owner}/{BODY}":
            return f"{body.name}: only a run tells whether {body.owner} holds it"
        return f"{body.owner}: it is loose, and only a run tells where it is"
    return f"{body.owner}: {body.holder} picks it up and lets it go, and only a run tells where it is"


class Attachments:
    """Who moves whom, now.

    Args:
        model: The compiled workstation.

    Attributes:
        ids: Body of MuJoCo that each body rides on, shape (n,).
        roots: The first body of its tree, likewise.
        drawn: Index of the body in whose place each is drawn, shape (n,): its own, unless it is away.
        away: Bodies that are not where their robot is, because they lie elsewhere.
        unknown: Bodies of which nobody knows where they are, with the reason: what is picked up, until an
            engine follows it.
    """

    def __init__(self, model: Model) -> None:
        self.ids = np.array([body.mj for body in model.bodies], np.int64)
        self.roots = model.mj.body_rootid[self.ids].astype(np.int64)
        self.drawn = np.arange(len(model.bodies))
        self.away: set[int] = set()
        self.unknown = {b.index: unknown_place(b) for b in model.bodies if b.holder}
        self._moves: dict[tuple[int, ...], NDArray[np.bool_]] = {}

    def put(self, mj: mujoco.MjModel, index: int, carrier: int) -> None:
        """From now on a body rides on another one of MuJoCo's.

        Args:
            mj: The `mujoco.MjModel`.
            index: The body.
            carrier: MuJoCo's.
        """
        self.ids[index], self.roots[index] = carrier, mj.body_rootid[carrier]
        self._moves.clear()

    def moves(self, mj: mujoco.MjModel, bodies: tuple[int, ...]) -> NDArray[np.bool_]:
        """Which degrees of freedom move each of some bodies, shape (b, nv)."""
        if bodies not in self._moves:
            self._moves[bodies] = np.array([moving_dofs(mj, self.ids[i]) for i in bodies])
        return self._moves[bodies]


@dataclass(frozen=True, eq=False)
class Columns:
    """Where the joints of a mechanism are among all of the workstation, bound once."""

    own_q: Indices
    """Columns of the commanded joints in ``MjData.qpos``."""
    own_v: Indices
    """Columns of the commanded joints in ``MjData.qvel``."""
    all_v: Indices | slice
    coupling: Array | None
    """None where every joint is commanded itself."""
    entries: Indices
    """Where ``MjData.M`` has the mass matrix of ``all_v``, shape (n, n); -1 where it has nothing."""
    uncoupled: NDArray[np.bool_] | None
    """Where it has nothing: joints that do not move each other; None where all do."""
    joints: Indices
    """MuJoCo's, in the order of ``all_v``."""
    bodies: Indices
    """MuJoCo's body of each."""
    turns: NDArray[np.bool_]
    """Whether each turns; otherwise it slides."""
    masses: Array
    """What each carries [kg]."""

    @classmethod
    def of(cls, mechanism: Mechanism, mj: mujoco.MjModel) -> Columns:
        """Bind to a `mujoco.MjModel`."""
        v, n = mechanism.v_address, len(mechanism.v_address)
        in_turn = n > 0 and np.array_equal(v, v[0] + np.arange(n))
        return cls(
            mechanism.q_address[mechanism.own],
            v[mechanism.own],
            slice(int(v[0]), int(v[0]) + n) if in_turn else v,
            None if np.array_equal(mechanism.coupling, np.eye(n)) else mechanism.coupling,
            entries := _entries(mj, v.tolist()),
            (entries < 0) if (entries < 0).any() else None,
            joints := mj.dof_jntid[v].astype(np.int64),
            bodies := mj.jnt_bodyid[joints].astype(np.int64),
            mj.jnt_type[joints] == mujoco.mjtJoint.mjJNT_HINGE,
            mj.body_subtreemass[bodies],
        )

    def of_rows(self, every: Array) -> Array:
        """Columns of the commanded joints, (..., nv) to (..., n)."""
        own = every[..., self.all_v]
        return own.copy() if self.coupling is None else own @ self.coupling

    def of_mass_matrix(self, M: Array) -> Array:
        """Mass matrix of the commanded joints from ``MjData.M``, shape (n, n)."""
        own = M.take(self.entries)
        if self.uncoupled is not None:
            own[self.uncoupled] = 0.0
        return own if self.coupling is None else np.asarray(self.coupling.T @ own @ self.coupling)


def _entries(mj: mujoco.MjModel, dofs: list[int]) -> Indices:
    """Where ``MjData.M``, whose rows have what is left of the diagonal, has these columns; -1 for nothing."""
    at = {dof: k for k, dof in enumerate(dofs)}
    found = np.full((len(dofs), len(dofs)), -1, np.int64)
    for k, dof in enumerate(dofs):
        first = int(mj.M_rowadr[dof])
        for address in range(first, first + int(mj.M_rownnz[dof])):
            column = at.get(int(mj.M_colind[address]))
            if column is not None:
                found[k, column] = found[column, k] = address
    return found


def moving_dofs(mj: mujoco.MjModel, body: int) -> NDArray[np.bool_]:
    """Which degrees of freedom move one of MuJoCo's bodies, shape (nv,)."""
    found = np.zeros(mj.nv, bool)
    while body > 0:
        first = mj.body_dofadr[body]
        found[first : first + mj.body_dofnum[body]] = True
        body = mj.body_parentid[body]
    return found
