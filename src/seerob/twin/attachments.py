"""Which of MuJoCo's bodies moves each body of the workstation: what a gripper lets go changes it."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from seerob.model.model import Body, Model
from seerob.twin.joint_columns import moving_dofs

Indices = NDArray[np.int64]


def unknown_place(body: Body) -> str:
    """Why nobody knows where a body is that a gripper picks up, without a run."""
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
