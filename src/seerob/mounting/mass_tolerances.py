r"""Mass matrices of a robot whose masses are known within tolerances.

A body whose mass is off by a share has that share more or less of its inertia too: its part of the mass
matrix, :math:`M_b = m J_c^T J_c + J_\omega^T I J_\omega`, is scaled. Every part is positive semi-definite, so
that with a larger mass of any body

- :math:`\dot q^T M \dot q` is larger or the same,
- :math:`M^{-1}` is smaller in the order of Loewner, :math:`u^T J_v M^{-1} J_v^T u` too, and the effective
  mass along any direction larger or the same,
- :math:`M/2 + m_L` is larger.

All three are monotone in every mass, whatever the others are: their ends are at the ends of the masses.
"""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from seerob.model import Mechanism, Model
from seerob.state import State
from seerob.tolerances import Shifts, Tolerance
from seerob.transforms import Array


class MassTolerances:
    """Masses of one robot, with everything mounted on it, that are known within tolerances.

    Args:
        model: The compiled workstation.
        robot: The robot.
    """

    def __init__(self, model: Model, robot: Mechanism) -> None:
        self.robot = robot
        names = {int(i): str(model.mj.body(int(i)).name) for i in robot.mj_bodies}
        links = [i for i, name in names.items() if name.startswith(f"{robot.name}/")]
        station = model.workstation
        own = {table.name: table.mass_tolerance for table in station.robots}.get(robot.name)
        found: list[tuple[str, float, list[int], bool]] = []
        if own:
            found.append((f"mass_tolerance of {robot.name}", own, links, True))
        for thing in (*station.tools, *station.workpieces):
            bodies = [i for i, name in names.items() if name == thing.name]
            if thing.mass_tolerance and bodies:
                found.append((f"mass_tolerance of {thing.name}", thing.mass_tolerance, bodies, False))
        self.tolerances = tuple(Tolerance(name, 100 * share, "%") for name, share, _, _ in found)
        self._shares = np.array([share for _, share, _, _ in found])
        self._bodies = [bodies for _, _, bodies, _ in found]
        masses = model.mj.body_mass
        # Of M/2 + m_L: links by half, what is mounted in full.
        self._simplified = np.array(
            [
                share * sum(float(masses[i]) for i in bodies) / (2 if half else 1)
                for _, share, bodies, half in found
            ]
        )

    def __len__(self) -> int:
        """How many tolerances there are."""
        return len(self.tolerances)

    def simplified(self, nominal: float, shifts: Shifts) -> float:
        """M/2 + m_L at shifted masses [kg].

        Args:
            nominal: As given [kg].
            shifts: Of each tolerance.
        """
        return nominal + float(self._simplified @ np.array(shifts, float)) if shifts else nominal

    def matrices(self, state: State) -> Matrices:
        """Mass matrices of a state, to be asked at shifted masses.

        Raises:
            Undecided: Not heard, or a mass that nobody gave.
        """
        M = state.mass_matrix(self.robot)
        parts = [
            share * self._part(state, bodies)
            for share, bodies in zip(self._shares, self._bodies, strict=True)
        ]
        return Matrices(M, parts)

    def _part(self, state: State, bodies: Sequence[int]) -> Array:
        """What bodies make of the mass matrix, shape (n, n)."""
        mj, data, robot = state.model.mj, state.data, self.robot
        n = len(robot.joints)
        found, linear, angular = np.zeros((n, n)), np.zeros((3, mj.nv)), np.zeros((3, mj.nv))
        for body in bodies:
            mujoco.mj_jacBodyCom(mj, data, linear, angular, body)
            J_c, J_w = (rows[:, robot.v_address] @ robot.coupling for rows in (linear, angular))
            turn = data.ximat[body].reshape(3, 3)
            inertia = turn @ np.diag(mj.body_inertia[body]) @ turn.T
            found += mj.body_mass[body] * J_c.T @ J_c + J_w.T @ inertia @ J_w
        return found


class Matrices:
    """Mass matrices of one state."""

    def __init__(self, M: Array, parts: Sequence[Array]) -> None:
        self.M, self.parts = M, parts

    def at(self, shifts: Shifts) -> Array:
        """M at shifted masses, shape (n, n)."""
        found = self.M
        for shift, part in zip(shifts, self.parts, strict=True):
            found = found + shift * part
        return np.asarray(found)
