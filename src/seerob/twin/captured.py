"""People as they were captured, wherever the physics lets the twin be, and what touches them there."""

from __future__ import annotations

import mujoco
import numpy as np

from seerob.core.errors import Undecided
from seerob.core.transforms import Array
from seerob.model.model import Model
from seerob.twin.places import StateOfPlaces
from seerob.twin.signals import Signals
from seerob.twin.validity.hearing import Hearing


class Captured(StateOfPlaces):
    """Where people were captured; arguments as of `StateOfPlaces`."""

    def __init__(
        self, model: Model, data: mujoco.MjData, hearings: dict[str, Hearing], signals: Signals | None = None
    ) -> None:
        super().__init__(model, data, hearings, signals)
        self.touches: list[tuple[int, int, float]] | None = None
        """Of every contact two of MuJoCo's bodies and the normal force [N]; None where none is calculated."""
        self.captured_between: tuple[Array, Array] | None = None
        """Of an instant between two ticks: ``qpos`` and ``qvel`` with people as they were captured; None at a
        tick, and where nobody is held (`seerob.twin.spans.Path.captured`)."""
        self._wanted: mujoco.MjData | None = None
        """Where people were captured; made when somebody asks."""

    def captured(self, name: str, bodies: tuple[int, ...], *, posture: bool = False) -> tuple[Array, Array]:
        """Where bones of a person were captured, wherever the physics lets the twin be.

        A hand that lies on a table, or that a robot pushes, is stopped there in the twin; what was captured
        is what the person did.

        Args:
            name: Of the person.
            bodies: Its bones, by index.
            posture: Whether only where bones are to one another is asked, which is known where nobody says
                where the person is.

        Returns:
            World from bone, shape (n, 3, 3), and the bones' origins in the world [m], (n, 3), in the order of
            ``bodies``. For one's own criteria what is in doubt is NaN, and the origin of a posture is that of
            the first bone.

        Raises:
            Undecided: What was heard of the person may not be relied on.
        """
        self.asked.add(name)
        if reason := self.invalid_source_reason(name):
            raise Undecided(reason)
        R, x = self._captured(name, bodies)
        if not self._author:
            return R, x
        names = [self._model.bodies[i].name.removeprefix(f"{name}/") for i in bodies]
        R[np.isin(names, self.invalid_orientations(name))] = np.nan
        if posture:
            return R, x - x[0]
        x[np.isin(names, self._invalid_bones(name))] = np.nan
        return R, x

    def _captured(self, name: str, bodies: tuple[int, ...]) -> tuple[Array, Array]:
        rows, q = self._rows_of(bodies), self._hearings[name].captured
        if q is not None and self.captured_between is not None:
            q = self.captured_between[0][self._model.mechanisms[name].q_address]
        if q is None:
            return self._rotations[rows], self._positions[rows]
        key = ("captured", name)
        if key not in self._cache:
            mujoco.mj_kinematics(self._model.mj, wanted := self._as_captured(name, q))
            self._cache[key] = wanted.xmat.reshape(-1, 3, 3).copy(), wanted.xpos.copy()
        R, x = self._cache[key]
        ids = self.attachments.ids[rows]
        return R[ids], x[ids]

    def _as_captured(self, name: str, q: Array) -> mujoco.MjData:
        """Data with all others where they are, and a person with given joints [rad or m]; no kinematics."""
        if self._wanted is None:
            self._wanted = mujoco.MjData(self._model.mj)
        self._wanted.qpos[:] = self._data.qpos
        self._wanted.qpos[self._model.mechanisms[name].q_address] = q
        return self._wanted

    def contact_forces(self, name: str) -> dict[int, tuple[float, str]]:
        """Bones of a person that something touches in the twin: the normal force [N], and who presses most.

        By index of the bone. Soft contacts and controllers make them: an estimate.

        Raises:
            Undecided: What was heard of the person may not be relied on, or no contact is calculated.
        """
        self.asked.add(name)
        if reason := self.invalid_source_reason(name):
            raise Undecided(reason)
        if self.touches is None:
            raise Undecided(f"{name}: no contacts are calculated (engine.physics, [[contacts]])")
        if self._hearings[name].reset_at > self.t - 2 * self._period:
            raise Undecided(f"{name}: the twin had to be put back to what was heard")
        own = {body.mj: body.index for body in self._model.bodies if body.owner == name}
        others = {body.mj: body.name for body in self._model.bodies}
        pressing: dict[int, dict[str, float]] = {}
        for one, other, force in self.touches:
            for mine, its in ((one, other), (other, one)):
                if mine in own and its not in own:
                    by = pressing.setdefault(own[mine], {})
                    who = others.get(its, "the floor")
                    by[who] = by.get(who, 0.0) + force
        return {i: (sum(by.values()), max(by, key=lambda who: by[who])) for i, by in pressing.items()}

    def strayed(self, name: str, bodies: tuple[int, ...]) -> tuple[Array, Array]:
        """How far bones of the twin of a person are from where they were captured.

        Args:
            name: Of the person.
            bodies: Its bones, by index.

        Returns:
            Between their origins [m], shape (n,), and the angles between them [rad], (n,); 0 where
            the twin follows within its tracking limit.
        """
        if not self.stray(name):
            return np.zeros(len(bodies)), np.zeros(len(bodies))
        rows, (R, x) = self._rows_of(bodies), self._captured(name, bodies)
        trace = np.einsum("nij,nij->n", self._rotations[rows], R)
        return (
            np.linalg.norm(self._positions[rows] - x, axis=1),
            np.arccos(np.clip((trace - 1) / 2, -1.0, 1.0)),
        )
