"""What joints do to points, what robots weigh, and the torques that they measure, at this tick."""

from __future__ import annotations

from collections.abc import Hashable, Iterator
from contextlib import contextmanager
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from seerob.core.errors import Undecided, Unweighed
from seerob.core.transforms import Array
from seerob.kernels.axes import felt, principal_axes, quaternion
from seerob.kernels.chain import along, at_point
from seerob.model.model import Frame, Mechanism, Model
from seerob.twin.attachments import moving_dofs
from seerob.twin.motion import StateOfMotion
from seerob.twin.moving_points import Moved, Point, PointSurvey, kinematics_table, place_of
from seerob.twin.places import MOST_PLACES, Indices
from seerob.twin.signals import Signals
from seerob.twin.validity.hearing import SLACK, Hearing


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


class Dynamics(StateOfMotion):
    """Jacobians, masses and torques; arguments as of `seerob.twin.places.StateOfPlaces`."""

    def __init__(
        self, model: Model, data: mujoco.MjData, hearings: dict[str, Hearing], signals: Signals | None = None
    ) -> None:
        super().__init__(model, data, hearings, signals)
        self._at_least = False
        self._full_mass_matrix = np.zeros((model.mj.nv, model.mj.nv))
        self._sparse_mass_matrix = data.M
        self._points: dict[tuple[Hashable, ...], tuple[Frame, int, Indices, NDArray[np.bool_], Array]] = {}
        """Points of which Jacobians are asked: what of them is the same at all ticks."""
        self._moving, self._kinematics = PointSurvey(model.mj, data, self.columns), kinematics_table(data)

    def refresh(self, t: float) -> None:
        """Take the engine's new positions and velocities, and forget what followed from the last ones."""
        super().refresh(t)
        self._moving.forget()

    # -- torques ----------------------------------------------------------------------------

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

    # -- masses -----------------------------------------------------------------------------

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

    # -- points -----------------------------------------------------------------------------

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
            self._kinematics, frame.mj, root, dofs, moves, local, J, v, axes, figures,
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
