"""What grippers hold along a motion that was recorded: picked up and let go as in the run that it is of."""

from __future__ import annotations

import mujoco
import numpy as np

from seerob.core.transforms import Array
from seerob.model.model import Model
from seerob.twin.machines.gripping import Grips, own_masses
from seerob.twin.state import Hearing, State


class Held:
    """The grippers of a workstation at one instant of a motion after the other.

    Attributes:
        mj: The `mujoco.MjModel` that tells where bodies are on those that carry them: what is held is where
            it was taken, what was not yet is in the hand as the file has it.
    """

    def __init__(self, model: Model) -> None:
        """At the begin: nothing is held."""
        own = own_masses(model)
        self.mj: mujoco.MjModel = own.mj
        hearings = {name: Hearing(given=True, driven=False) for name in own.mechanisms}
        self._data = mujoco.MjData(own.mj)
        self._state = State(own, self._data, hearings)
        self._loose = any(body.holder for body in own.bodies)
        self._grips = Grips(self._state, own.mj)

    def follow(self, qpos: Array) -> None:
        """The next instant.

        Args:
            qpos: Positions of all joints [rad or m], shape (nq,).
        """
        if not self._loose:
            return
        self._data.qpos[:] = qpos
        self._state.refresh(self._state.t)
        if self._grips.follow(self._state):
            self._state.refresh(self._state.t)


def before(model: Model, qpos: Array) -> Held:
    """The grippers after a motion.

    Args:
        model: The compiled workstation.
        qpos: Positions of all joints at its instants [rad or m], shape (N, nq).
    """
    held = Held(model)
    for at in np.asarray(qpos, float):
        held.follow(at)
    return held
