"""Where everything is at this tick, and where frames and bodies of whom one may rely on are."""

from __future__ import annotations

from collections.abc import Callable
from operator import itemgetter
from typing import cast

import mujoco
import numpy as np
from numpy.typing import NDArray

from seerob.core.transforms import Array
from seerob.kernels.speed import PLACED, Placed, carried, in_body, place
from seerob.model.model import Frame, Mechanism, Model
from seerob.twin.attachments import Columns
from seerob.twin.authors_view import Others, moved_by_others, without
from seerob.twin.mujoco_addresses import POSES, addresses
from seerob.twin.signals import Signals
from seerob.twin.validity.hearing import Hearing
from seerob.twin.validity.validity import Validity

Indices = NDArray[np.int64]
MOST_PLACES = 512
"""Sets of bodies, and points, of which places are kept from tick to tick."""


def _picking(rows: Indices) -> Callable[[list[float]], tuple[float, ...]]:
    """Make what takes some of many numbers."""
    if len(rows) < 2:
        return lambda every: tuple(every[i] for i in rows)
    return cast("Callable[[list[float]], tuple[float, ...]]", itemgetter(*rows.tolist()))


class StateOfPlaces(Validity):
    """Where robots, people and machines are.

    Args:
        model: The compiled workstation.
        data: The engine's.
        hearings: What is known of each robot, person and machine.
        signals: What machines say.
    """

    def __init__(
        self, model: Model, data: mujoco.MjData, hearings: dict[str, Hearing], signals: Signals | None = None
    ) -> None:
        super().__init__(model, hearings, signals)
        self._data = data
        self.between = False
        """Whether it is at an instant between two ticks: what is within there is shown to nobody."""
        n = len(model.bodies)
        self._rotations, self._positions = np.zeros((n, 3, 3)), np.zeros((n, 3))
        self._quaternions = np.zeros((n, 4))
        self._shown = np.zeros((n, 7), "<f4")
        self._alone = [(i,) for i in range(n)]
        """Each body by itself, as it is asked for."""
        self._places: dict[tuple[int, ...], tuple[Array, Array, Array, Array]] = {}
        self._others_of: dict[tuple[str, ...], Others] = {}
        self._movers: dict[int, tuple[tuple[str, ...], tuple[int, ...]]] = {}
        self.columns = {m.name: Columns.of(m, model.mj) for m in model.mechanisms.values()}
        """Where the joints of each robot and human are among all."""
        self._joints = {name: _picking(each.own_q) for name, each in self.columns.items()}
        # Views that MuJoCo writes through; to ask the data for them takes longer than to use them.
        self._xmat, self._xpos, self._qpos = data.xmat, data.xpos, data.qpos
        self._placed = Placed(
            addresses(model.mj, data, *POSES), self._xmat, self._xpos, data.xquat,
            self._rotations, self._positions, self._quaternions, self._shown,
        )  # fmt: skip
        """Keeps the arrays of its table."""
        self._table = PLACED.rows(self._placed)

    def refresh(self, t: float) -> None:
        """Take the engine's new positions and velocities; called once per tick by the engine."""
        # mj_step leaves what follows from positions one step behind.
        place(self._table, self.attachments.ids)
        self.t = t
        self._cache.clear()
        self.heard()

    # -- what says nothing of whether it may be relied on: closed while a criterion is asked ---------

    @property
    def data(self) -> mujoco.MjData:
        """The `mujoco.MjData`."""
        self._open("data", "data_of(names), q, qd, pose or another accessor")
        return self._data

    @property
    def rotations(self) -> Array:
        """World from body, in the order of `Model.bodies`, shape (n, 3, 3)."""
        self._open("rotations", "placed(bodies)")
        return self._rotations

    @property
    def positions(self) -> Array:
        """World position of the bodies' origins [m], shape (n, 3)."""
        self._open("positions", "placed(bodies)")
        return self._positions

    @property
    def quaternions(self) -> Array:
        """World from body, w first, shape (n, 4)."""
        self._open("quaternions", "placed(bodies)")
        return self._quaternions

    def joint_positions(self, mechanism: Mechanism) -> Array:
        """Joint positions as they are shown [rad or m], shape (n,)."""
        self._open("joint_positions", "q(mechanism)")
        return self._q(mechanism)

    def poses(self) -> bytes:
        """Little-endian float32, seven per body: position [m], quaternion w first."""
        self._open("poses", "placed(bodies)")
        return self._shown.take(self.attachments.drawn, axis=0).tobytes()

    def joints(self) -> dict[str, tuple[float, ...]]:
        """Joint positions of everybody as they are shown [rad or m], by name."""
        self._open("joints", "q(mechanism)")
        every = self._qpos.tolist()
        return {name: pick(every) for name, pick in self._joints.items()}

    # -- what may be relied on ------------------------------------------------------------------

    def placed(
        self,
        bodies: tuple[int, ...],
        *,
        allow_estimated: bool = False,
        allow_invalid: bool = False,
        strayed: bool = False,
    ) -> tuple[Array, Array]:
        """Where bodies are: world from body, and the world position of their origins [m].

        Args:
            bodies: By index.
            allow_estimated: As in `require_bodies`.
            allow_invalid: Also invalid bones of people of whom the others may be relied on, as shown:
                for whoever judges bone by bone (`invalid_bones`). For one's own criteria they are NaN.
            strayed: As in `require_bodies`.

        Returns:
            Of all bodies, shape (n, 3, 3) and (n, 3), so that indices stay what they are; of others they are
            NaN. Valid until the next tick.

        Raises:
            Undecided: One of them may be elsewhere.
        """
        if allow_invalid:
            owners = self._owners(bodies)
            self.require(*owners.others)
            for name in owners.people:
                self.hearing(name, strayed=strayed)
        else:
            self.require_bodies(bodies, allow_estimated=allow_estimated, strayed=strayed)
        if bodies not in self._places:
            if len(self._places) == MOST_PLACES:
                self._places.clear()
                self._cache.clear()
            n = len(self._positions)
            R, x, v, w = (np.full((n, *shape), np.nan) for shape in ((3, 3), (3,), (3,), (3,)))
            self._places[bodies] = R, x, v, w
        R, x, _, _ = self._places[bodies]
        key = ("placed", bodies)
        if key not in self._cache:
            rows = self._rows_of(bodies)
            R[rows], x[rows] = self._rotations[rows], self._positions[rows]
            if allow_invalid and self._author:
                lost = list(self.invalid_bodies(bodies))
                R[lost], x[lost] = np.nan, np.nan
            self._cache[key] = True
        return R, x

    def in_body(
        self, index: int, point: Array, *, allow_estimated: bool = False, strayed: bool = False
    ) -> tuple[float, float, float]:
        """A point of the world as a body has it in its own frame [m].

        Args:
            index: Of the body.
            point: In the world [m], shape (3,).
            allow_estimated: As in `require_bodies`.
            strayed: As in `require_bodies`.

        Raises:
            Undecided: The body may be elsewhere.
        """
        self._relied_on_bodies(self._alone[index], allow_estimated, strayed)
        found: tuple[float, float, float] = in_body(self._rotations, self._positions, index, point)
        return found

    def _rows_of(self, bodies: tuple[int, ...]) -> Indices:
        return self._owners(bodies).rows

    def data_of(self, *names: str) -> mujoco.MjData:
        """MuJoCo's data, of which only what these robots, people and machines decide may be used.

        For what has no accessor of its own. Of one's own criteria it is a copy, in which everybody else and
        all that they move is not a number.

        Raises:
            Undecided: One of them was not heard.
        """
        self.require(*names)
        self.speeds_asked.update(names)
        if not self._author:
            return self._data
        if names not in self._others_of:
            self._others_of[names] = moved_by_others(self._model, names)
        return without(self._model.mj, self._data, self._others_of[names])

    def q(self, mechanism: Mechanism) -> Array:
        """Joint positions of the twin [rad or m], shape (n,)."""
        self.require(mechanism.name)
        return self._q(mechanism)

    def _q(self, mechanism: Mechanism) -> Array:
        return np.asarray(self._qpos[self.columns[mechanism.name].own_q])

    def pose(self, frame: Frame) -> tuple[Array, Array]:
        """World rotation (3, 3) and position (3,) [m] of a frame.

        Raises:
            Undecided: Whoever moves it was not heard; of a person, this bone is in doubt.
        """
        self._require_frame(frame)
        return self._pose(frame)

    def _require_frame(self, frame: Frame) -> None:
        names, bodies = self._movers.get(frame.mj) or self._movers_of(frame.mj)
        self.require(*names)
        if bodies:
            self.require_bodies(bodies)

    def _movers_of(self, body: int) -> tuple[tuple[str, ...], tuple[int, ...]]:
        """Whom the place of a body of MuJoCo depends on: the innermost robot or machine, or a bone."""
        model = self._model
        bones = tuple(b.index for b in model.bodies if b.role == "human" and b.mj == body)
        moving = [m for m in model.mechanisms.values() if body in m.mj_bodies]
        names = () if bones or not moving else (min(moving, key=lambda m: len(m.mj_bodies)).name,)
        self._movers[body] = names, bones
        return names, bones

    def _pose(self, frame: Frame) -> tuple[Array, Array]:
        key = ("pose", id(frame))
        if key not in self._cache:
            # With the frame itself: another one may get the id of one that is forgotten.
            self._cache[key] = frame, *carried(self._xmat, self._xpos, frame.mj, frame.body_from_frame)
        _, rotation, position = self._cache[key]
        return rotation, position
