"""The twin at this tick, and what follows from it. Valid until the next tick.

What two criteria share has its one home here and is computed once per tick. Accessors raise
`Undecided` when the robot or human they speak of was not heard lately, does not follow what was
heard, or has a mass that nobody gave: a stale or guessed number can never be green.

What says nothing of whether it may be relied on (`data`, `rotations`, `hearings` and so on) is for the
engine, the picture and the recorder. While a criterion is asked (`asking`) it is closed: reading it raises
`NotAsked`, so that no author of a criterion can forget to ask.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Mapping
from contextlib import contextmanager
from copy import deepcopy
from functools import partial
from operator import itemgetter
from typing import ClassVar, NamedTuple, cast

import mujoco
import numpy as np
from numpy.typing import NDArray

from seerob.core.errors import Undecided, Unweighed
from seerob.core.snapshot import Event
from seerob.core.transforms import Array
from seerob.distance.least import Closest, Closests, Per, Query, Surveyor
from seerob.kernels.axes import felt, principal_axes, quaternion
from seerob.kernels.chain import along, at_point
from seerob.kernels.spans import greatest
from seerob.kernels.speed import PLACED, Placed, by_coordinate, carried, fastest, in_body, place, velocities
from seerob.model.model import Frame, Gap, Mechanism, Model
from seerob.twin.attachments import Columns, moving_dofs
from seerob.twin.authors_view import OF_AN_INSTANT, AuthorsView, Others, moved_by_others, without
from seerob.twin.drawn_points import DrawnPoints, Local
from seerob.twin.moving_points import Moved, Point, PointSurvey, place_of
from seerob.twin.mujoco_addresses import POSES, addresses
from seerob.twin.signals import Signals
from seerob.twin.spans import Knots, Path
from seerob.twin.speed_noise import SpeedNoise
from seerob.twin.validity.hearing import SLACK
from seerob.twin.validity.hearing import Hearing as Hearing  # noqa: PLC0414
from seerob.twin.validity.validity import Validity
from seerob.workstation.variables import VARIABLE as VARIABLE  # noqa: PLC0414
from seerob.workstation.variables import Value

Indices = NDArray[np.int64]
Foresee = Callable[[str, Array], tuple[Array, Array, str] | None]
"""Asks what a robot or human does at instants ahead [s] (m,): joint positions and velocities there, shape (m,
n) each, and why they may be others; None where nobody knows."""
ForeseeSamples = Callable[[str, float], tuple[Indices, str] | None]
"""Asks for the samples through which somebody goes until an instant [s], a table of
`seerob.kernels.pull.KNOTS`, and why they may go elsewhere; None where it is to be asked otherwise."""
_NO_SAMPLES: ForeseeSamples = lambda name, until: None  # noqa: E731

MOST_PLACES = 512
"""Sets of bodies of which places are kept from tick to tick."""
WRITTEN = ("placed", "velocities of")
"""What is kept of them lies in buffers."""


class MassEllipsoid(NamedTuple):
    """Effective masses of a point, [Khatib1995]_."""

    inverse: Array
    """Inverse of the effective mass matrix [1/kg], shape (3, 3)."""
    axes: Array
    """Its principal axes as columns of a right-handed frame, shape (3, 3)."""
    masses: Array
    """Along them, smallest first [kg], shape (3,); infinite where the point cannot be pushed."""
    wxyz: list[float]
    """Quaternion of the axes, w first."""


class _Point(NamedTuple):
    """What joints do to a point at this tick."""

    jacobian: Array
    velocity: Array
    sigma: list[float]
    wxyz: list[float]


def _picking(rows: Indices) -> Callable[[list[float]], tuple[float, ...]]:
    """Make what takes some of many numbers."""
    if len(rows) < 2:
        return lambda every: tuple(every[i] for i in rows)
    return cast("Callable[[list[float]], tuple[float, ...]]", itemgetter(*rows.tolist()))


class State(Validity):
    """A view of the engine's `mujoco.MjData`; never keep one beyond its tick."""

    many: ClassVar[bool] = False

    def __init__(
        self, model: Model, data: mujoco.MjData, hearings: dict[str, Hearing], signals: Signals | None = None
    ) -> None:
        super().__init__(model, hearings, signals)
        self._data = data
        self._at_least = False
        self._path: Path | None = None
        self._ahead: Foresee = lambda name, t: None
        self.knots: Knots = lambda name, begin, end: ()
        """Instants between which what `foresee` tells is one cubic, besides the ticks."""
        self.foresee_samples: ForeseeSamples = _NO_SAMPLES
        """Tells both at once, until somebody else sets `foresee`."""
        self.events: tuple[Event, ...] = ()
        """What happened to loose workpieces since the last tick."""
        self.touches: list[tuple[int, int, float]] | None = None
        """Of every contact two of MuJoCo's bodies and the normal force [N]; None where none is calculated."""
        self._quicker: dict[str, Array] = {}
        """By how much joints are faster than the twin has them, while that is asked for (`quicker`)."""
        self._noise = SpeedNoise(model)
        n = len(model.bodies)
        self._rotations, self._positions = np.zeros((n, 3, 3)), np.zeros((n, 3))
        self._quaternions = np.zeros((n, 4))
        self._shown = np.zeros((n, 7), "<f4")
        self._alone = [(i,) for i in range(n)]
        """Each body by itself, as it is asked for."""
        self._places: dict[tuple[int, ...], tuple[Array, Array, Array, Array]] = {}
        self._others_of: dict[tuple[str, ...], Others] = {}
        self._movers: dict[int, tuple[tuple[str, ...], tuple[int, ...]]] = {}
        self.between = False
        """Whether it is at an instant between two ticks: what is within there is shown to nobody."""
        self.captured_between: tuple[Array, Array] | None = None
        """Of an instant between two ticks: ``qpos`` and ``qvel`` with people as they were captured; None at a
        tick, and where nobody is held (`seerob.twin.spans.Path.captured`)."""
        self._wanted: mujoco.MjData | None = None
        """Where people were captured; made when somebody asks."""
        self._full_mass_matrix = np.zeros((model.mj.nv, model.mj.nv))
        self._drawn: dict[tuple[int, bytes], Local] = {}
        """Points that are drawn."""
        self._points: dict[tuple[Hashable, ...], tuple[Frame, int, Indices, NDArray[np.bool_], Array]] = {}
        """Points of which Jacobians are asked: what of them is the same at all ticks."""
        self.columns = {m.name: Columns.of(m, model.mj) for m in model.mechanisms.values()}
        """Where the joints of each robot and human are among all."""
        self._joints = {name: _picking(each.own_q) for name, each in self.columns.items()}
        # Views that MuJoCo writes through; to ask the data for them takes longer than to use them.
        self._xmat, self._xpos = data.xmat, data.xpos
        self._placed = Placed(
            addresses(model.mj, data, *POSES), self._xmat, self._xpos, data.xquat,
            self._rotations, self._positions, self._quaternions, self._shown,
        )  # fmt: skip
        """Keeps the arrays of its table."""
        self._table = PLACED.rows(self._placed)
        self._surveyor = Surveyor(model.shapes)
        self._moving = PointSurvey(model.mj, data, self.columns)
        self._cdof, self._com, self._qvel = data.cdof, data.subtree_com, data.qvel
        self._cvel, self._qpos, self._sparse_mass_matrix = data.cvel, data.qpos, data.M
        self._corners = by_coordinate([body.corners for body in model.bodies])
        self._reach = np.array([body.radius + body.deviation for body in model.bodies])

    def refresh(self, t: float) -> None:
        """Take the engine's new positions and velocities; called once per tick by the engine."""
        # mj_step leaves what follows from positions one step behind.
        place(self._table, self.attachments.ids)
        self.t = t
        self._cache.clear()
        self.heard()
        self._surveyor.forget()
        self._moving.forget()

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

    @property
    def path(self) -> Path | None:
        """How everybody came here from the last tick, whoever was heard: for bounds; None at the first."""
        self._open("path", "foresee, or bound what happens between two ticks in falls or lowest")
        return self._path

    @path.setter
    def path(self, path: Path | None) -> None:
        self._path = path

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

    # -- people as they were captured -------------------------------------------------------

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

    def signals_meanwhile(self, name: str) -> tuple[Value, ...]:
        """What a variable was between the last tick and this one, where its source tells more often.

        Raises:
            Undecided: It may not be relied on.
        """
        self.asked.add(VARIABLE + name)
        path = self._path
        return () if path is None else self._signals.meanwhile(name, float(path.t[0]), self.t)

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

    @contextmanager
    def for_author(self, author: str) -> Iterator[State]:
        """While a criterion of one's own is asked: what it is given is its own, and nobody else reads it.

        For the judge: whatever an author writes into an array changes no other criterion and no motion.

        Args:
            author: Name of that criterion.

        Yields:
            What it is asked with: the accessors of this state, until it has answered.
        """
        kept = self._cache, self._places
        self._cache, self._places, self._author = {}, {}, author
        view = AuthorsView(self, OF_AN_INSTANT)
        try:
            yield cast("State", view)
        finally:
            view.answered()
            self._cache, self._places = kept
            self._author = ""

    # -- joints -----------------------------------------------------------------------------

    def q(self, mechanism: Mechanism) -> Array:
        """Joint positions of the twin [rad or m], shape (n,)."""
        self.require(mechanism.name)
        return self._q(mechanism)

    def _q(self, mechanism: Mechanism) -> Array:
        return np.asarray(self._qpos[self.columns[mechanism.name].own_q])

    def qd(self, mechanism: Mechanism) -> Array:
        """Joint velocities of the twin [rad/s or m/s], shape (n,)."""
        self.require(mechanism.name)
        self.speeds_asked.add(mechanism.name)
        return np.asarray(self._qvel[self.columns[mechanism.name].own_v])

    def speed_error(self, mechanism: Mechanism) -> Array | None:
        """How far its joint velocities may be off, where they follow from noisy positions.

        Returns:
            Three standard deviations, and between two samples how far they are from the velocities that these
            say [rad/s or m/s], shape (n,); None where nobody says that they do.
        """
        if mechanism.role == "human":  # of whom a bone may be known, and others not
            self.hearing(mechanism.name)
        else:
            self.require(mechanism.name)
        return self._every_speed_error().get(mechanism.name)

    @property
    def clear(self) -> bool:
        """Whether nothing of anybody is in doubt, and no speed may be off or is told by nobody.

        Nor does a device see any person bone by bone, nor is what a hand holds or let go off: `TrackingError`
        has nothing to add then, and every accessor answers, but those that rest on masses and measurements.
        """
        found: bool | None = self._cache.get("clear")
        if found is None:
            hearings = self._hearings
            found = self._cache["clear"] = (
                len(self._sound or self._find_sound()) == len(hearings)
                and not self.attachments.unknown
                and not self._every_speed_error()
                and not (self.lags and any(self.lags.values()))
                and not (self.left and any(self.left.values()))
                and not any(hearing.bones for hearing in hearings.values())
                and self.all_moved()
            )
        return found

    @property
    def speed_errors(self) -> Mapping[str, Array]:
        """By name of whose speeds were derived from noisy positions: `speed_error`, where there is any."""
        found: dict[str, Array] | None = self._cache.get("speed errors")
        if found is None:
            every = self._every_speed_error().items()
            found = self._cache["speed errors"] = {name: error for name, error in every if error.any()}
        return found

    def _every_speed_error(self) -> dict[str, Array]:
        found: dict[str, Array] | None = self._cache.get("every speed error")
        if found is None:
            every = ((name, hearing.speed_error(self.t)) for name, hearing in self._hearings.items())
            found = {name: error for name, error in every if error is not None}
            self._cache["every speed error"] = found
        return found

    def speed_noise(self, bodies: tuple[int, ...]) -> Array:
        """How far the speed of any point of bodies may be off by `speed_errors` [m/s], shape (b,).

        Args:
            bodies: By index. Whether they may be relied on is for who asks for their speeds.
        """
        errors = self.speed_errors
        if not errors:
            return np.zeros(len(bodies))
        ids, rows = self.attachments.ids, self._rows_of(bodies)
        return self._noise.of_bodies(self._data, ids, self._rotations, self._positions, rows, errors)

    def joint_noise(self) -> Array:
        """How far ``MjData.qvel`` may be off by `speed_errors` [rad/s or m/s], shape (nv,)."""
        found = np.zeros(self._model.mj.nv)
        for name, error in self.speed_errors.items():
            mechanism = self._model.mechanisms[name]
            found[mechanism.v_address] = np.abs(mechanism.coupling) @ error
        return found

    @contextmanager
    def quicker(self, name: str, by: Array) -> Iterator[None]:
        """While joints of a robot or human are by so much faster than the twin has them, now and ahead.

        For the judge, who asks what an error of speeds would change.

        Args:
            name: Of the robot or human.
            by: [rad/s or m/s], shape (n,).
        """
        data, mechanism = self._data, self._model.mechanisms[name]
        speeds, cache = data.qvel.copy(), self._cache
        self._quicker[name] = by
        data.qvel[mechanism.v_address] += mechanism.coupling @ by
        mujoco.mj_comVel(self._model.mj, data)
        self._cache = {}
        try:
            yield
        finally:
            del self._quicker[name]
            data.qvel[:] = speeds
            mujoco.mj_comVel(self._model.mj, data)
            # What was written into buffers meanwhile is of other speeds.
            self._cache = {key: kept for key, kept in cache.items() if key[0] not in WRITTEN}

    @property
    def foresee(self) -> Foresee:
        """What a motion that is known ahead will do."""
        return self._foreseen if self._closed else self._ahead

    @foresee.setter
    def foresee(self, ahead: Foresee) -> None:
        self._ahead, self.foresee_samples = ahead, _NO_SAMPLES

    def _foreseen(self, name: str, t: Array) -> tuple[Array, Array, str] | None:
        self.asked.add(name)
        self.speeds_asked.add(name)
        found = self._ahead(name, t)
        if found is None or name not in self._quicker:
            return found
        q, qd, invalid_reason = found
        return q, qd + self._quicker[name], invalid_reason

    def samples_ahead(self, name: str, until: float) -> tuple[Indices, str] | None:
        """Samples through which a motion that is known ahead goes, and why it may be another one.

        Args:
            name: Of the robot.
            until: When it is looked at last [s].

        Returns:
            A table of `seerob.kernels.pull.KNOTS`; None where nobody knows, or `foresee` is to be asked.
        """
        self.asked.add(name)
        self.speeds_asked.add(name)
        return None if self._quicker else self.foresee_samples(name, until)

    def measured_torques(self, mechanism: Mechanism) -> Array:
        """Joint torques that its source measured, between samples as positions are [N·m or N], shape (n,).

        Raises:
            Undecided: Not heard, heard without torques, or with torques of another sign or unit.
        """
        return np.asarray(self.torques_within(mechanism, self.t, self.t)[0])

    def torques_within(self, mechanism: Mechanism, begin: float, end: float) -> Array:
        """Joint torques at two instants of the last tick, and as its source measured them between these.

        From one to the next they lie on straight lines.

        Args:
            mechanism: The robot.
            begin: [s].
            end: [s].

        Returns:
            Shape (k, n) [N·m or N], the first of ``begin`` and the last of ``end``.

        Raises:
            Undecided: As `measured_torques`, at any of these instants.
        """
        self.require(mechanism.name)
        hearing = self._hearings[mechanism.name]
        if hearing.coarse:
            raise Undecided(f"{mechanism.name}: {hearing.coarse}")
        inside = [said for said in hearing.heard if begin + SLACK < said.t < end - SLACK]
        if reason := next((said.reason for said in inside if said.reason), ""):
            raise Undecided(f"{mechanism.name}: {reason}")
        return np.array([self._torques_at(mechanism, t) for t in (begin, *(said.t for said in inside), end)])

    def _torques_at(self, mechanism: Mechanism, t: float) -> Array:
        hearing = self._hearings[mechanism.name]
        heard = hearing.around(t)
        around = [said.torques for said in heard if said.torques is not None]
        if not around or len(around) < len(heard):
            raise Undecided(f"{mechanism.name}: its source measures no joint torques")
        if hearing.invalid_torque_reason:
            raise Undecided(f"{mechanism.name}: {hearing.invalid_torque_reason}")
        # Outside its range np.interp holds the last value, as the reference does.
        times = [said.t for said in heard]
        return np.array([np.interp(t, times, joint) for joint in np.transpose(around)])

    # -- dynamics ---------------------------------------------------------------------------

    def weigh(self, mechanism: Mechanism) -> None:
        """Raise `Undecided` unless it is known what a robot weighs, with all that it holds now."""
        self.require(mechanism.name, *mechanism.holders)
        unknown = self.attachments.unknown
        if unknown and (lost := unknown.keys() & set(mechanism.carried)):
            raise Undecided(unknown[min(lost)])
        if mechanism.unknown_masses and not self._at_least:
            raise Unweighed("; ".join(mechanism.unknown_masses))

    @contextmanager
    def known_masses_alone(self) -> Iterator[None]:
        """While only what would be exceeded by less is asked: what nobody weighed weighs nothing meanwhile.

        Of a mass matrix, and of what grows with it, that is a bound from below.
        """
        kept, self._cache, self._at_least = self._cache, {}, True
        try:
            yield
        finally:
            self._cache, self._at_least = kept, False

    def _known(self, mechanisms: tuple[Mechanism, ...], M: Array) -> Array:
        """A mass matrix without the bodies that nobody weighed, and with what keeps it invertible."""
        mj, rows = self._model.mj, np.zeros((6, self._model.mj.nv))
        for body in dict.fromkeys(i for mechanism in mechanisms for i in mechanism.unweighed):
            mujoco.mj_jacBodyCom(mj, self._data, rows[:3], rows[3:], body)
            moved = np.hstack([self.columns[mechanism.name].of_rows(rows) for mechanism in mechanisms])
            turn = self._data.ximat[body].reshape(3, 3)
            inertia = turn @ np.diag(mj.body_inertia[body]) @ turn.T
            M = M - mj.body_mass[body] * moved[:3].T @ moved[:3] - moved[3:].T @ inertia @ moved[3:]
        return np.asarray(M + (1e-9 * np.trace(M) + 1e-15) * np.eye(len(M)))

    def _weigh_exactly(self, mechanism: Mechanism) -> None:
        self.weigh(mechanism)
        if why := self._hearings[mechanism.name].coarse:
            raise Undecided(f"{mechanism.name}: {why}")

    def _make_masses(self) -> None:
        """Have MuJoCo's mass matrix of this tick."""
        if "M" not in self._cache:
            mujoco.mj_makeM(self._model.mj, self._data)
            self._cache["M"] = True

    def mass_matrix(self, *mechanisms: Mechanism) -> Array:
        """Joint-space mass matrix M(q) with tools and workpieces [kg·m², kg·m or kg], shape (n, n).

        Of several mechanisms, one on another, that of the joints of all in turn.

        Raises:
            Undecided: A mass that nobody gave, or what drives it is too coarse for what a mass is asked for.
        """
        for mechanism in mechanisms:
            self._weigh_exactly(mechanism)
        key = "M", *[mechanism.name for mechanism in mechanisms]
        if key not in self._cache:
            self._make_masses()
            if len(mechanisms) == 1:
                M = self.columns[mechanisms[0].name].of_mass_matrix(self._sparse_mass_matrix)
            else:
                mujoco.mj_fullM(self._model.mj, self._data, self._full_mass_matrix)
                every = np.eye(self._model.mj.nv)
                C = np.hstack([self.columns[mechanism.name].of_rows(every) for mechanism in mechanisms])
                M = C.T @ self._full_mass_matrix @ C
            unknown = any(mechanism.unknown_masses for mechanism in mechanisms)
            self._cache[key] = self._known(mechanisms, M) if unknown else M
        return np.asarray(self._cache[key])

    # -- kinematics -------------------------------------------------------------------------

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

    def drawn_point(self, frame: Frame, offset: Array) -> Callable[[], Array]:
        """Where a point of a frame is now [m], shape (3,): worked out when it is drawn, maybe ticks later.

        Args:
            frame: The frame.
            offset: The point in it [m], shape (3,).

        Raises:
            Undecided: As `pose`.
        """
        self._require_frame(frame)
        return partial(self._drawn_points().point, frame, offset)

    def _drawn_points(self) -> DrawnPoints:
        placed: DrawnPoints | None = self._cache.get("placed once")
        if placed is None:
            placed = self._cache["placed once"] = DrawnPoints(self._xmat, self._xpos, self._drawn)
        return placed

    def drawn_points(self) -> Callable[[Frame, Array], Array]:
        """Where points of frames are in a tick that is `clear`: as `drawn_point`, of any of them.

        Raises:
            Undecided: It is not, so that each is to be asked for.
        """
        if not self.clear or self._author:
            raise Undecided("asked alone")
        return self._drawn_points().point

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

    def jacobian(self, frame: Frame, mechanism: Mechanism, offset: Array | None = None) -> Array:
        """Jacobian of a point of a frame, linear rows first, world axes, shape (6, n).

        Args:
            frame: The frame.
            mechanism: Whose joints the columns are.
            offset: The point in the frame [m], shape (3,); its origin when not given. Of a person the bone of
                the frame alone must be known.
        """
        self._require_point(frame, mechanism)
        return self._point(frame, mechanism, offset).jacobian

    def _require_point(self, frame: Frame, mechanism: Mechanism) -> None:
        """Raise `Undecided` unless a point is where the twin shows it: of a person, by its bone."""
        bones: tuple[int, ...] = ()
        if mechanism.role == "human":
            bones = tuple(i for i in mechanism.bodies if self._model.bodies[i].mj == frame.mj)
        if bones:
            self.require_bodies(bones)
        else:
            self.require(mechanism.name)

    def velocity(self, frame: Frame, mechanism: Mechanism, offset: Array | None = None) -> Array:
        """Velocity that the joints of a mechanism give a point, linear before angular, (6,) [m/s, rad/s].

        Arguments as of `jacobian`; of a person the bone of the frame alone must be known.
        """
        self._require_point(frame, mechanism)
        self.speeds_asked.add(mechanism.name)
        return self._point(frame, mechanism, offset).velocity

    def singular_values(self, frame: Frame, mechanism: Mechanism, offset: Array | None = None) -> list[float]:
        """Singular values of the linear rows of `jacobian`, largest first; three."""
        return self.velocity_ellipsoid(frame, mechanism, offset)[0]

    def velocity_ellipsoid(
        self, frame: Frame, mechanism: Mechanism, offset: Array | None = None
    ) -> tuple[list[float], list[float]]:
        """Singular values of the linear rows of `jacobian`, largest first, and their axes as a quaternion."""
        self.require(mechanism.name)
        point = self._point(frame, mechanism, offset)
        return point.sigma, point.wxyz

    def mass_ellipsoid(
        self, frame: Frame, mechanism: Mechanism, offset: Array | None = None
    ) -> MassEllipsoid:
        """What somebody feels of a mechanism who is hit by a point of it; arguments as of `jacobian`.

        Raises:
            Undecided: As `mass_matrix`.
        """
        M = self.mass_matrix(mechanism)
        key = ("Λ", id(frame), mechanism.name, None if offset is None else offset.tobytes())
        if key not in self._cache:
            J = self._point(frame, mechanism, offset).jacobian
            inverse, axes, figures = np.empty((3, 3)), np.empty((3, 3)), np.empty(7)
            if not felt(J, M, inverse, axes, figures):
                raise np.linalg.LinAlgError("M, a mass matrix, is not positive definite")
            self._cache[key] = frame, MassEllipsoid(inverse, axes, figures[:3], figures[3:].tolist())
        found: MassEllipsoid = self._cache[key][1]
        return found

    def inverse_effective_mass(
        self, frame: Frame, mechanism: Mechanism, offset: Array | None = None
    ) -> Array:
        """Inverse of the effective mass matrix of a point [1/kg], shape (3, 3); see `mass_ellipsoid`."""
        return self.mass_ellipsoid(frame, mechanism, offset).inverse

    def _point(self, frame: Frame, mechanism: Mechanism, offset: Array | None) -> _Point:
        # Not its name: a tool's working point is called like the tool.
        key = ("point", id(frame), mechanism.name, None if offset is None else offset.tobytes())
        kept = self._cache.get(key)
        if kept is None:
            # With the frame itself: another one may get the id of one that is forgotten.
            kept = self._cache[key] = frame, self._moving_point(key, frame, mechanism, offset)
        found: _Point = kept[1]
        return found

    def _moving_point(
        self, key: tuple[Hashable, ...], frame: Frame, mechanism: Mechanism, offset: Array | None
    ) -> _Point:
        mj, columns = self._model.mj, self.columns[mechanism.name]
        bound = self._points.get(key)
        if bound is None or bound[0] is not frame:
            dofs = np.arange(mj.nv)[columns.all_v]
            moves, root = moving_dofs(mj, frame.mj)[dofs], int(mj.body_rootid[frame.mj])
            if len(self._points) == MOST_PLACES:
                self._points.clear()
            bound = self._points[key] = frame, root, dofs, moves, place_of(frame, offset)
        _, root, dofs, moves, local = bound
        J, v, axes, figures = np.empty((6, len(dofs))), np.empty(6), np.empty((3, 3)), np.empty(7)
        at_point(
            self._xmat, self._xpos, self._cdof, self._com, frame.mj, root, dofs, moves, local, self._qvel,
            J, v, axes, figures,
        )  # fmt: skip
        if columns.coupling is not None:
            # Joints that others follow: the ellipsoid is that of the commanded ones.
            J = J @ columns.coupling
            v = J @ self._qvel[columns.own_v]
            values, directions = np.empty((1, 3)), np.empty((1, 3, 3))
            principal_axes(J[None, :3].copy(), values, directions)
            figures[:3] = np.nan if np.isnan(values).any() else values[0]
            quaternion(directions[0], figures[3:])
        sigma = figures.tolist()
        return _Point(J, v, sigma[:3], sigma[3:])

    def moving(self, points: tuple[Point, ...]) -> tuple[Moved, list[int]]:
        """What joints do to all points that are asked for so in a tick that is `clear`, and which these are.

        Raises:
            Undecided: It is not, a mass is not known, or some joints follow others: ask `velocity`,
                `velocity_ellipsoid` and `mass_ellipsoid`.
        """
        if not self.clear or self._author or self._quicker:
            raise Undecided("asked alone")
        for _, mechanism, _, weighed in points:
            if self.columns[mechanism.name].coupling is not None:
                raise Undecided("asked alone")
            if weighed:
                self._weigh_exactly(mechanism)
                self._moving.weighed = True
        if self._moving.weighed:
            self._make_masses()
        return self._moving.at(points)

    def along(self, bodies: tuple[int, ...], mechanism: Mechanism, points: Array, directions: Array) -> Array:
        r"""Rows :math:`u^T J_v` of points of several bodies, shape (b, n); see `jacobian`.

        Args:
            bodies: By index.
            mechanism: Whose joints the columns are.
            points: One of each body, in the world [m], shape (b, 3).
            directions: Likewise, shape (b, 3).
        """
        self.require(mechanism.name)
        moves, roots = self.attachments.moves(self._model.mj, bodies), self.attachments.roots
        rows = np.array(bodies, np.int64)
        every = np.empty((len(rows), self._model.mj.nv))
        along(self._cdof, self._com, roots[rows], moves, points, directions, every)
        return self.columns[mechanism.name].of_rows(every)

    def body_velocities(
        self, bodies: tuple[int, ...], *, allow_estimated: bool = False
    ) -> tuple[Array, Array]:
        """Linear and angular velocities of bodies at their origins [m/s, rad/s].

        Returns:
            Of all bodies, shape (n, 3) each, so that indices stay what they are; of others they are NaN.
            Valid until the next tick.
        """
        self.placed(bodies, allow_estimated=allow_estimated)
        self.speeds_asked |= self._owners(bodies).everyone
        key = ("velocities of", bodies)
        if key not in self._cache:
            self._cache[key] = True
            _, _, *buffers = self._places[bodies]
            for buffer, every in zip(buffers, self._velocities(), strict=True):
                buffer[self._rows_of(bodies)] = every[self._rows_of(bodies)]
        _, _, linear, angular = self._places[bodies]
        return linear, angular

    def _velocities(self) -> tuple[Array, Array]:
        if "v" not in self._cache:
            linear, angular = np.empty((2, *self._positions.shape))
            velocities(
                self._cvel, self._com, self._positions, self.attachments.ids, self.attachments.roots,
                linear, angular,
            )  # fmt: skip
            self._cache["v"] = linear, angular
        linear, angular = self._cache["v"]
        return linear, angular

    def fastest_point(self, index: int) -> tuple[float, Array, Array]:
        """Bound on the speed of any point of a body, and the point where it is largest.

        Its real surface may lie `Body.deviation` outside its shape; that is in the bound.

        Returns:
            Speed [m/s], the corner in the world [m] (3,), its velocity [m/s] (3,).
        """
        self.speeds_asked |= self._relied_on_bodies(self._alone[index]).everyone
        speed, point, velocity = self._fastest()
        return float(speed[index]), point[index], velocity[index]

    def fastest_points(
        self, bodies: tuple[int, ...], *, allow_estimated: bool = False
    ) -> tuple[Array, Array, Array]:
        """Bounds on the speed of any point of bodies [m/s] (b,), with corners (b, 3) and velocities (b, 3).

        Args:
            bodies: By index.
            allow_estimated: As in `require_bodies`.
        """
        owners = self._relied_on_bodies(bodies, allow_estimated)
        self.speeds_asked |= owners.everyone
        speed, point, velocity = self._fastest()
        # A third of what an index of rows takes.
        rows = owners.rows
        return speed[rows], point.take(rows, 0), velocity.take(rows, 0)

    def fastest_speeds(self, bodies: tuple[int, ...], *, allow_estimated: bool = False) -> Array:
        """Bounds on the speed of any point of bodies [m/s], shape (b,); arguments as of `fastest_points`."""
        owners = self._relied_on_bodies(bodies, allow_estimated)
        self.speeds_asked |= owners.everyone
        return np.asarray(self._fastest()[0][owners.rows])

    def fastest_speed(self, bodies: tuple[int, ...], *, allow_estimated: bool = False) -> float:
        """Bound on the speed of the fastest point of bodies [m/s], 0 of none; arguments likewise."""
        owners = self._relied_on_bodies(bodies, allow_estimated)
        self.speeds_asked |= owners.everyone
        return float(greatest(self._fastest()[0], owners.rows))

    def largest_speeds(self) -> Array:
        """Bound on the speed of any point of each body [m/s], shape (n,): for bounds, never for a verdict."""
        self._open("largest_speeds", "fastest_points(bodies)")
        return self._fastest()[0]

    def _fastest(self) -> tuple[Array, Array, Array]:
        if "fastest" not in self._cache:
            n = len(self._positions)
            speed, point, velocity = np.zeros(n), np.zeros((n, 3)), np.zeros((n, 3))
            corners, start = self._corners
            fastest(
                self._rotations, self._positions, *self._velocities(), corners, start, self._reach,
                speed, point, velocity,
            )  # fmt: skip
            for name, hearing in self._hearings.items():
                if hearing.held:
                    self._add_captured(name, hearing, speed, point, velocity)
            self._cache["fastest"] = speed, point, velocity
        speed, point, velocity = self._cache["fastest"]
        return speed, point, velocity

    def _add_captured(self, name: str, hearing: Hearing, speed: Array, point: Array, velocity: Array) -> None:
        """Put captured speeds of a person who is touched where they are larger than the twin's."""
        person, mj = self._model.mechanisms[name], self._model.mj
        q, v = hearing.captured, hearing.captured_v
        if self.captured_between is not None:
            q, v = (
                every[rows]
                for every, rows in zip(
                    self.captured_between, (person.q_address, person.v_address), strict=True
                )
            )
        if q is None or v is None:
            return
        data = self._as_captured(name, q)
        data.qvel[:] = self._data.qvel
        data.qvel[person.v_address] = v
        mujoco.mj_kinematics(mj, data)
        mujoco.mj_comPos(mj, data)
        mujoco.mj_comVel(mj, data)
        ids = self.attachments.ids
        R, x = data.xmat.reshape(-1, 3, 3)[ids], data.xpos[ids]
        linear, angular = np.empty((2, *x.shape))
        velocities(data.cvel, data.subtree_com, x, ids, self.attachments.roots, linear, angular)
        other = np.zeros_like(speed), np.zeros_like(point), np.zeros_like(velocity)
        corners, start = self._corners
        fastest(R, x, linear, angular, corners, start, self._reach, *other)
        rows = np.array([*person.bodies, *person.carried])
        rows = rows[other[0][rows] > speed[rows]]
        for each, more in zip((speed, point, velocity), other, strict=True):
            each[rows] = more[rows]

    # -- distances --------------------------------------------------------------------------

    def closest(self, gap: Gap, *, allow_estimated: bool = False, strayed: bool = False) -> Closest:
        """Where two sets are nearest; ``allow_estimated`` and ``strayed`` as in `require_bodies`."""
        self._relied_on_bodies(gap.bodies, allow_estimated, strayed)
        if self._author:
            return self._distances(gap.query, Per.SETS).at(0)
        return self._surveyor.closest(gap.query, self._rotations, self._positions)

    def closest_per_body(self, gap: Gap, *, allow_estimated: bool = False, strayed: bool = False) -> Closests:
        """Where each body of ``gap.b`` is nearest to ``gap.a``, in the order of ``gap.b``."""
        self._relied_on_bodies(gap.bodies, allow_estimated, strayed)
        return self._distances(gap.query, Per.BODY)

    def nearest(self, questions: tuple[tuple[Query, Per], ...]) -> tuple[Closests, list[int]]:
        """All distances of a tick that is `clear`, and where the answers to some questions begin among them.

        Raises:
            Undecided: It is not, or they are not asked together (yet), so that each is to be asked alone.
        """
        found = None
        if self.clear and not self._author:
            found = self._surveyor.together(questions, self._rotations, self._positions)
        if found is None:
            raise Undecided("asked alone")
        return found

    def distances(self, query: Query, per: Per, *, allow_estimated: bool = False) -> Closests:
        """What a query says now; ``allow_estimated`` as in `require_bodies`."""
        self.require_bodies(query.bodies, allow_estimated=allow_estimated)
        return self._distances(query, per)

    def _distances(self, query: Query, per: Per) -> Closests:
        found = self._surveyor.ask(query, per, self._rotations, self._positions)
        return deepcopy(found) if self._author else found
