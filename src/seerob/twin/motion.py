"""How fast everything is at this tick, by how much that may be off, and what is known of its motion ahead."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager

import mujoco
import numpy as np

from seerob.core.transforms import Array
from seerob.kernels.spans import greatest
from seerob.kernels.speed import by_coordinate, fastest, velocities
from seerob.model.model import Mechanism, Model
from seerob.twin.captured import Captured
from seerob.twin.places import Indices
from seerob.twin.signals import Signals
from seerob.twin.spans import Knots, Path
from seerob.twin.speed_noise import SpeedNoise
from seerob.twin.validity.hearing import Hearing
from seerob.workstation.variables import VARIABLE, Value

Foresee = Callable[[str, Array], tuple[Array, Array, str] | None]
"""Asks what a robot or human does at instants ahead [s] (m,): joint positions and velocities there, shape (m,
n) each, and why they may be others; None where nobody knows."""
ForeseeSamples = Callable[[str, float], tuple[Indices, str] | None]
"""Asks for the samples through which somebody goes until an instant [s], a table of
`seerob.kernels.pull.KNOTS`, and why they may go elsewhere; None where it is to be asked otherwise."""
_NO_SAMPLES: ForeseeSamples = lambda name, until: None  # noqa: E731
WRITTEN = ("placed", "velocities of")
"""What is kept of these lies in buffers."""


class StateOfMotion(Captured):
    """Speeds of joints and bodies; arguments as of `seerob.twin.places.StateOfPlaces`."""

    def __init__(
        self, model: Model, data: mujoco.MjData, hearings: dict[str, Hearing], signals: Signals | None = None
    ) -> None:
        super().__init__(model, data, hearings, signals)
        self._path: Path | None = None
        self._ahead: Foresee = lambda name, t: None
        self.knots: Knots = lambda name, begin, end: ()
        """Instants between which what `foresee` tells is one cubic, besides the ticks."""
        self.foresee_samples: ForeseeSamples = _NO_SAMPLES
        """Tells both at once, until somebody else sets `foresee`."""
        self._quicker: dict[str, Array] = {}
        """By how much joints are faster than the twin has them, while that is asked for (`quicker`)."""
        self._noise = SpeedNoise(model)
        self._cdof, self._com, self._qvel, self._cvel = data.cdof, data.subtree_com, data.qvel, data.cvel
        self._corners = by_coordinate([body.corners for body in model.bodies])
        self._reach = np.array([body.radius + body.deviation for body in model.bodies])

    @property
    def path(self) -> Path | None:
        """How everybody came here from the last tick, whoever was heard: for bounds; None at the first."""
        self._open("path", "foresee, or bound what happens between two ticks in falls or lowest")
        return self._path

    @path.setter
    def path(self, path: Path | None) -> None:
        self._path = path

    # -- joints -----------------------------------------------------------------------------

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

    # -- between ticks and ahead ----------------------------------------------------------------

    def signals_meanwhile(self, name: str) -> tuple[Value, ...]:
        """What a variable was between the last tick and this one, where its source tells more often.

        Raises:
            Undecided: It may not be relied on.
        """
        self.asked.add(VARIABLE + name)
        path = self._path
        return () if path is None else self._signals.meanwhile(name, float(path.t[0]), self.t)

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

    # -- bodies ---------------------------------------------------------------------------------

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
