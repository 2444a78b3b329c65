"""Where everybody else is while the robot moves: the twin of a run, kept tick by tick."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import mujoco
import numpy as np

from seerob.core.errors import Undecided
from seerob.core.samples import Placing
from seerob.core.snapshot import Result
from seerob.core.transforms import Array
from seerob.model.model import Mechanism, Model
from seerob.twin.state import State
from seerob.twin.validity.hearing import EVERYWHERE, BonesHeard, Hearing
from seerob.workstation.variables import Value


class Seen(NamedTuple):
    """How far bones may be from where the twin has them; see `seerob.twin.validity.hearing.Hearing`."""

    bones: dict[str, tuple[float | None, float | None]]
    unaimed: Mapping[str, float]
    """Hands, feet and heads of which only the joint was seen, each with a bound [rad]."""
    slack: Mapping[str, float]
    """Bones that are held or seen elsewhere, too, each with how much farther they may be [m]."""
    placings: tuple[Placing, ...] = ()
    """How well it is known where the worlds of devices lie, where that is not exact."""


class Witness:
    """Stands beside the judge of a run and keeps where the twin is and what may be doubted.

    Attributes:
        t: Instants of the ticks [s].
    """

    def __init__(self, judge: Callable[[State], tuple[Result, ...]]) -> None:
        self._judge = judge
        self.t: list[float] = []
        self._qpos: list[Array] = []
        self._qvel: list[Array] = []
        self._invalid_reasons: list[dict[str, str]] = []
        self._heard: list[dict[str, Value | Undecided]] = []
        self._seen: list[dict[str, Seen]] = []

    def __call__(self, state: State) -> tuple[Result, ...]:
        """Take one tick; what the judge says goes on."""
        self.t.append(state.t)
        self._qpos.append(np.array(state.data.qpos))
        self._qvel.append(np.array(state.data.qvel))
        self._invalid_reasons.append({name: state.invalid_reason(name) for name in state.hearings})
        asked = {c.active for c in state.model.workstation.safety if c.active is not None}
        self._heard.append({name: _heard(state, name) for name in asked})
        people = {name: h for name, h in state.hearings.items() if h.bones}
        t = state.t
        self._seen.append(
            {name: Seen(dict(h.bones), h.unaimed(t), h.slack(t), h.placings(t)) for name, h in people.items()}
        )
        return self._judge(state)

    def _tick(self, t: float) -> int:
        """The tick that is nearest to an instant [s]."""
        return int(np.abs(np.subtract(self.t, t)).argmin())

    def others(self, t: float) -> tuple[Array, Array, dict[str, str]]:
        """Positions, velocities and doubts of the whole twin at the tick that is nearest to ``t`` [s]."""
        k = self._tick(t)
        return self._qpos[k], self._qvel[k], self._invalid_reasons[k]

    def heard(self, t: float) -> tuple[dict[str, Value | Undecided], dict[str, Seen]]:
        """What switches criteria, as machines said it at the tick that is nearest to ``t`` [s], or why not.

        Also how far bones of people whom devices see may be from where the twin has them.
        """
        k = self._tick(t)
        return self._heard[k], self._seen[k]

    def moves(self, mechanism: Mechanism) -> bool:
        """Whether somebody ever moved."""
        q = np.array(self._qpos)[:, mechanism.q_address]
        return bool((np.ptp(q, axis=0) > 1e-3).any())


def _heard(state: State, name: str) -> Value | Undecided:
    try:
        value = state.signals.value(name, state.t)
    except Undecided as why:
        return why
    late = state.signals.untimed.get(name, "")
    return Undecided(late) if late and value is False else value


class Posed(State):
    """A state that is put together: the robot where the path has it, all others as they were seen."""

    def __init__(self, model: Model, robot: Mechanism, witness: Witness) -> None:
        """At home until `place` is called."""
        data: mujoco.MjData = mujoco.MjData(model.mj)
        hearings = {name: Hearing(given=True, driven=False) for name in model.mechanisms}
        super().__init__(model, data, hearings)
        self._robot, self._witness = robot, witness
        station = model.workstation
        driven = {source.target() for source in station.sources}
        driven |= {machine.name for machine in station.machines if machine.motion.variables()}
        names = {machine.name for machine in station.machines} - driven
        self._rests = {name: model.mechanisms[name].home for name in names}
        """Machines that nothing moves, and where their joints are."""
        self.invalid_reasons: dict[str, str] = {}
        """Why somebody's place may not be relied on, by name; empty when it may."""
        self._said: dict[str, Value | Undecided] = {}
        self.foresee = self._steady

    def _steady(self, name: str, t: Array) -> tuple[Array, Array, str] | None:
        """A speed that a place permits is one that is held there; the run of the plan knows better."""
        if name in self._rests:
            q = np.tile(self._rests[name], (len(t), 1))
            return q, np.zeros_like(q), ""
        if name != self._robot.name:
            return None
        q, qd = self.joint_positions(self._robot), self.data.qvel[self.columns[name].own_v]
        return np.tile(q, (len(t), 1)), np.tile(qd, (len(t), 1)), ""

    def place(self, t: float, others_at: float, q: Array, qd: Array, own_reason: str = "") -> None:
        """Put everybody where they are.

        Args:
            t: Instant that criteria with a memory are told [s].
            others_at: When the others were seen [s].
            q: Of the robot [rad or m], shape (n,).
            qd: Likewise [rad/s or m/s].
            own_reason: Why the robot's position may not be relied on.
        """
        qpos, qvel, invalid_reasons = self._witness.others(others_at)
        self.data.qpos[:], self.data.qvel[:] = qpos, qvel
        robot = self._robot
        self.data.qpos[robot.q_address] = robot.coupling @ q + robot.offset
        self.data.qvel[robot.v_address] = robot.coupling @ qd
        self.invalid_reasons = {**invalid_reasons, robot.name: own_reason}
        self._said, seen = self._witness.heard(others_at)
        for name, hearing in self.hearings.items():
            hearing.bones, unaimed, slack, placings = seen.get(name, Seen({}, {}, {}))
            places = EVERYWHERE._replace(slack=slack, placings=placings)
            hearing.bones_heard = [BonesHeard(t, unaimed=unaimed, places=places)]
        self.asked.clear()
        self.refresh(t)

    def invalid_place_reason(self, name: str) -> str:
        """Why nothing of a robot or person may be relied on; others as the run knew them then, bones too."""
        return self.invalid_reasons.get(name, "")

    def signal(self, name: str) -> Value:
        """Value of a variable that switches criteria, in SI, as the run heard it; may raise `Undecided`."""
        said = self._said[name]
        if isinstance(said, Undecided):
            raise said
        return said


Clock = Callable[[float], float]
"""When the others are to be seen, for when the given motion was there [s]."""
