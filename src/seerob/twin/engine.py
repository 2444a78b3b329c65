r"""The engine: pulls the twin toward the samples and steps the physics, one `State` per tick.

Each joint is pulled by an actuator with

.. math:: \tau = k_p (q_{ref} - q) + k_d (\dot q_{ref} - \dot q) + \tau_{ff},\quad
          k_p = \omega^2 \bar M_{ii},\; k_d = 2 \omega \bar M_{ii}

critically damped at the stated bandwidth ω, where :math:`\bar M_{ii}` is the largest diagonal
element of the mass matrix over a set of poses, tools and payloads included, and
:math:`\tau_{ff}` are the torques that the reference motion itself needs (recursive Newton–Euler).
The gains live in MuJoCo's actuators, whose damping `implicitfast` integrates implicitly; the same
gains as applied forces diverge at a floating root. Torque limits clamp the whole sum.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

import mujoco
import numpy as np

from seerob.core.errors import InputError, SimulationDiverged, Undecided
from seerob.core.samples import (
    BodySample,
    GrabSample,
    JointSample,
    PoseSample,
    Quality,
    Sample,
    SignalSample,
)
from seerob.core.transforms import Array, rotation_from_wxyz
from seerob.description.capture.following import COASTS, Following
from seerob.devices.live.differentiation import PositionNoise
from seerob.files.trajectories.trajectory import QUIET
from seerob.kernels import pull as kernel
from seerob.kernels.bound import COLUMNS
from seerob.model.model import Mechanism, Model
from seerob.model.mounting.compilation import pose_matrix
from seerob.twin import controller_check
from seerob.twin.accuracy.tracking_error import TrackingError
from seerob.twin.control.actuation import TaskPull, set_gains, set_torque_limits
from seerob.twin.control.inverse_kinematics import solve_pose
from seerob.twin.control.reference import Reference
from seerob.twin.control.sample_values import beyond_limits, is_possible, largest_speed, torques_of
from seerob.twin.control.unheard import BEATS, QUICKEST, Unheard
from seerob.twin.machines.following import HOLD, Machines, Moved
from seerob.twin.machines.gripping import Grips, own_masses
from seerob.twin.machines.loose import Loose
from seerob.twin.moving_base import moved_by_poses
from seerob.twin.mujoco_addresses import POSES, addresses
from seerob.twin.signals import Signals
from seerob.twin.spans import Path
from seerob.twin.state import State
from seerob.twin.validity.hearing import EVERYWHERE, NOWHERE, BonesHeard, Heard, Hearing
from seerob.workstation.variables import VARIABLE

DEFAULT_TIMEOUT = 0.2
"""Time-out [s] of what is heard without a source that states one."""
WILD = 300.0
"""Above it the physics has lost a joint [rad/s or m/s]."""
NEAR = 2e-3
"""A twin that is nearer to where it is found to be is pulled there [rad or m]: at a bandwidth of 20 Hz its
speed is off by 0.09 rad/s or m/s for a moment, as much as that of a robot that brakes at 3 rad/s² and was not
heard for 30 ms. Ordinary jitter stays below."""
LAGS = 0.2
"""Share of the tracking limit from which on speeds of a person are also those that were captured: something
touched the twin between two ticks, which is not told, or it is still on its way there. Own choice."""
FAULTS = (mujoco.FatalError, mujoco.UnexpectedError)
"""How MuJoCo gives up."""
POSE_TOLERANCE = 1e-4
"""Largest error of a solved Cartesian target [m or rad] that still counts as reached."""


def together(off: Array) -> Array:
    r"""Errors of joints as large as if they were independent, for those that act all at once.

    Who sums squares of shares :math:`w_j \delta_j` must find no less than
    :math:`\sum_j |w_j \delta_j| \le \sqrt{n} \sqrt{\sum_j w_j^2 \delta_j^2}` of n of them.

    Args:
        off: [rad/s or m/s], shape (..., n).
    """
    return np.asarray(np.sqrt((off > 0).sum(axis=-1, keepdims=True)) * off)


def moved_by_joints_alone(mj: mujoco.MjModel) -> bool:
    """Whether nothing but joints and actuators takes part in a step, integrated as here.

    Args:
        mj: The model, with no contacts, limits, equalities, friction, tendons, soft bodies, sensors or
            plug-ins, if so.
    """
    parts = mj.ngeom, mj.neq, mj.ntendon, mj.nflex, mj.nsensor, mj.nplugin, mj.na
    limits = mj.jnt_limited.any() or mj.dof_frictionloss.any()
    return not (any(parts) or limits) and mj.opt.integrator == mujoco.mjtIntegrator.mjINT_IMPLICITFAST


def last_tick(duration: float, period: float) -> int:
    """Number of the last tick of a motion, which ends with it: from half to one and a half as long as others.

    Args:
        duration: Of the motion [s].
        period: Of a tick [s].
    """
    return 0 if duration <= kernel.SLACK else max(1, math.floor(duration / period + 0.5))


class Engine:
    """The twin in motion.

    Attributes:
        state: The twin at the last tick; the same object throughout.
        signals: What machines say, by variable.
        ahead: Whose future is known: past their newest sample nothing will be said.
        end: When the motion ends, and the last tick with it [s]; inf while nobody knows.
    """

    def __init__(
        self,
        model: Model,
        *,
        driven: dict[str, float] | None = None,
        live: Collection[str] = (),
        complete: Collection[str] = (),
        signals: dict[str, float] | None = None,
        untimed: dict[str, str] | None = None,
        gappy: Collection[str] = (),
        coarse: Mapping[str, str] = MappingProxyType({}),
        controllers: bool = True,
        contacts: bool = True,
        state: type[State] = State,
    ) -> None:
        """Set the twin up at its home position.

        Args:
            model: The compiled workstation.
            driven: Time-out [s] of the source of each robot and human that a source drives.
            live: Those of them whose source is live; when a sample is late they coast, until the time-out;
                machines do not, and people for `COASTS` at most.
            complete: Those of them of whom each change is heard: no sample is missing between two.
            signals: Time-out [s] of each variable, or source of variables.
            untimed: Why nobody knows how late a variable is heard, by name.
            gappy: Variables that are heard live, of which samples may be missing.
            controllers: Whether the twin is pulled at all; off, it moves freely from where the first
                samples put it, and nothing that is heard later is compared with it.
            coarse: Why what is heard is too coarse for energies and forces, by name.
            contacts: Whether the contacts that the file asks for act.
            state: What follows from where everybody is.
        """
        driven = driven or {}
        self.model = model = own_masses(model)
        self.controllers = controllers
        engine = model.workstation.engine
        # Without controllers there is nothing but physics that could move it.
        self.physics = engine.physics or not controllers
        self._mj = model.mj.__copy__()
        self._mj.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
        if not contacts:
            self._mj.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
        if not controllers:
            # Nothing stiff is left, and Runge–Kutta keeps the energy.
            self._mj.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
        self._steps = round(engine.tick / engine.timestep)
        self._dt = engine.timestep
        self._period = engine.tick
        self._limit = engine.tracking_limit
        self._data = mujoco.MjData(self._mj)
        self._wanted = mujoco.MjData(self._mj)
        # Views that MuJoCo writes through; to ask the data for them takes longer than to use them.
        self._qpos, self._qvel = self._data.qpos, self._data.qvel
        self._shown = mujoco.MjData(self._mj)
        self._mechanisms = list(model.mechanisms.values())
        self._people = {m.name: m for m in self._mechanisms if m.role == "human"}
        # What a variable says of a machine stands until it says something else.
        coasting = set(live) - {machine.name for machine in model.workstation.machines}
        self.ahead = set(driven) - set(live) - {m.name for m in model.workstation.machines}
        following = {machine.name for machine in model.workstation.machines if machine.motion.variables()}
        self._stands = self.ahead | following
        """Who stands when nothing more is said, and may not when it was in motion."""
        self._live = {*live, *following}
        self._leapt = dict.fromkeys(following, (-np.inf, ""))
        """Mechanisms that follow variables → until when their last jump counts [s], and what is said of it.
        """
        self._unread = coasting  # what a file says was looked at when it was read
        coasts = {
            name: min(driven[name], COASTS if name in self._people else math.inf)
            for name in coasting & {*driven}
        }
        self._coasting = {
            name: coasts[name] for name in self._people if name in coasts and name not in complete
        }
        """People → how long they go on [s]: after that nobody says how fast they are."""
        self._references = {
            m.name: Reference(m.home, largest_speed(m), coast=coasts.get(m.name, 0.0))
            for m in self._mechanisms
        }
        self._hearings = {
            m.name: Hearing(
                # What moves freely is where it is, whatever is heard.
                given=m.home_given or not controllers,
                driven=m.name in driven and controllers,
                timeout=driven.get(m.name, DEFAULT_TIMEOUT),
                grace=BEATS if m.name in following else 0.0,
                coarse=coarse.get(m.name, ""),
            )
            for m in self._mechanisms
        }
        self._dof = self._mj.jnt_dofadr[self._mj.actuator_trnid[:, 0]].astype(np.int64)
        """Degree of freedom of each actuator."""
        self._kp, self._kd = set_gains(
            self._mj, self._wanted, self._mechanisms, engine, self._dof, controllers=controllers
        )
        self._limits = set_torque_limits(self._mj, self._mechanisms, self._dof)
        self._task_pulls = [
            TaskPull(self._mj, model.mechanisms[human.name], engine.human_bandwidth)
            for human in model.workstation.humans
            if human.follow == "task" and controllers
        ]
        self._strayed = False
        """Whether the physics holds a person elsewhere than captured."""
        self._almost = 0.999 * self._limits
        self._before, self._torques = np.zeros((2, self._mj.nv))
        self._simple = self.controllers and not self._task_pulls and moved_by_joints_alone(self._mj)
        """Whether a step is no more than `kernel.STEP`."""
        # Called from Python once, they tell when there is not enough memory for them.
        mujoco.mj_passive(self._mj, self._wanted)
        mujoco.mj_rne(self._mj, self._wanted, 1, self._torques)
        if self._simple:
            mujoco.mj_step(self._mj, self._wanted)
            mujoco.mj_resetData(self._mj, self._wanted)
        n = len(self._mechanisms)
        self._found = np.zeros(n), np.zeros(n, bool), np.zeros(n)
        """Of each who is pulled the largest error of a joint [rad or m], whether a torque limit is reached,
        and how far speeds are from those that are said [rad/s or m/s]."""
        self._divide(self._steps)
        self._landing: list[Mechanism] = []
        """Who is still to be put elsewhere."""
        self._broken: set[str] = set()
        """Who was put elsewhere during a tick."""
        self._noises: dict[str, tuple[PositionNoise, deque[float]]] = {}
        """By robot whose live source says no speeds: noise of its positions, and its newest instants [s]."""
        self._noiseless: set[str] = set()
        """Those of whom too few positions were heard to tell that noise."""
        quickest = {robot.name: robot.acceleration_limits or QUICKEST for robot in model.workstation.robots}
        quickest |= {machine.name: math.inf for machine in model.workstation.machines}
        silent = {m.name for m in model.workstation.machines if set(gappy) & set(m.motion.variables())}
        silent |= set(live) - following - set(complete)
        self._unheard = {
            name: Unheard(name, np.full(len(model.mechanisms[name].home), most), self._hearings[name].timeout)
            for name, most in quickest.items()
            if name in silent and controllers
        }
        """By robot and machine that is heard live."""
        self._untold = {
            name: Unheard(VARIABLE + name, np.full(1, math.inf), (signals or {}).get(name, DEFAULT_TIMEOUT))
            for name in gappy
        }
        """By variable that is heard live."""
        self._said: dict[str, controller_check.ControllerCheck] = {}
        self._carried = {name: controller_check.carried(model, name) for name in model.mechanisms}
        """By robot, what its live source says of itself."""
        self._followings: dict[str, Following] = {}
        """By person that devices see."""
        self.signals = Signals(model.dictionary, signals or {}, untimed)
        self._machines = Machines(model.workstation.machines, self.signals)
        self.state = state(model, self._shown, self._hearings, self.signals)
        self.state.foresee, self.state.knots = self._foresee, self._knots_of
        self.state.foresee_samples = self._samples_ahead
        self._loose = Loose(model, self._mj, self._data, self._shown, self.signals)
        for index in self._loose.bodies():
            self.state.attachments.unknown.pop(index, None)
        self._grips = Grips(self.state, self._mj, self._loose)
        self._off = {
            name: TrackingError(model, [b.index for b in model.bodies if b.owner == name])
            for name in self._loose.names
        }
        self._tick = 0
        self._now = 0.0
        """Instant of the last tick [s]."""
        self.end = math.inf
        self._place(0.0)

    def _divide(self, steps: int) -> None:
        """Make room for each step of a tick."""
        self._steps, rows = steps, steps + 1
        mj, data, wanted, shown = self._mj, self._data, self._wanted, self._shown
        of_q, of_v = (rows, mj.nq), (rows, mj.nv)
        self._course = np.tile(mj.qpos0, (rows, 1)), np.zeros(of_v), np.zeros(of_v)
        """Where every joint is to be at each step of a tick and at its end [rad or m], its velocity half a
        step earlier, as `mujoco.mj_step` counts, and its acceleration."""
        self._way = np.empty(of_q), np.empty(of_v)
        """Positions and velocities at each step of a tick."""
        self._instants = np.empty(rows)
        """When each step begins, and when the tick ends [s]."""
        calls = addresses(mj, wanted, "mj_rne", *POSES, "mj_passive")
        person = np.array([m.role == "human" for m in self._mechanisms], bool)
        error, saturated, unlike = self._found
        physics = kernel.Physics(
            calls, addresses(mj, data, *kernel.STEP) if self._simple else calls[:0],
            data.qpos, data.qvel, self._before, data.ctrl, data.actuator_force, shown.qpos, shown.qvel,
            wanted.qpos, wanted.qvel, wanted.qacc, wanted.qfrc_passive,
            data.qfrc_bias, data.qfrc_passive, data.qfrc_applied, data.qfrc_actuator, data.qfrc_smooth,
            mj.dof_armature, mj.dof_damping,
            self._kp, self._kd, self._almost, self._dof, self._instants, *self._course, self._torques,
            np.zeros(mj.nv), np.zeros(1), np.zeros((steps, mj.nu)), *self._way,
            error, person, saturated, unlike,
        )  # fmt: skip
        joints = {m.name: _joints(m, rows) for m in self._mechanisms}
        self._courses = {name: (own.q, own.v, own.a) for name, own in joints.items()}
        self._unlike_by = {name: own.off for name, own in joints.items()}
        self._led = {name: (own.led_q, own.led_v) for name, own in joints.items()}
        """Where joints are pulled to at the end of a tick, and their velocities then."""
        self._bound = physics, joints
        """Keeps the arrays of both tables."""
        self._physics = kernel.PHYSICS.rows(physics)
        self._motions = np.zeros((len(joints) * kernel.MOTION_ROWS, COLUMNS), np.int64)
        for k, (name, own) in enumerate(joints.items()):
            first, end = k * kernel.MOTION_ROWS, (k + 1) * kernel.MOTION_ROWS
            middle = first + kernel.KNOT_ROWS
            self._references[name].bind(self._motions[first:middle])
            self._motions[middle:end] = kernel.JOINTS.rows(own)

    # -- what comes in ----------------------------------------------------------------------

    def take(self, samples: Sequence[Sample]) -> None:
        """Hear samples: what they say is where the twin is pulled from now on."""
        for sample in samples:
            if isinstance(sample, SignalSample):
                self.signals.take(sample)
                for name, untold in self._untold.items() if sample.quality is Quality.GOOD else ():
                    if name in sample.values and name not in sample.doubts:
                        untold.hear(sample.t - sample.ages.get(name, 0.0), 0, speeds=False)
                for moved in self._machines.hear(sample):
                    self._move(moved)
                continue
            if isinstance(sample, GrabSample):
                self._loose.hear(sample)
                continue
            untimed = sample.late if sample.t_device is None else 0.0
            if isinstance(sample, BodySample):
                self._following(sample.target).hear(sample)
                hearing = self._hearings[sample.target]
                hearing.older = max(untimed, hearing.older)
                continue
            mechanism = self._target(sample)
            self._hearings[mechanism.name].older = untimed
            reason = sample.invalid_reason("its source")
            if not is_possible(sample):
                # Nothing to be pulled to; not knowing where it is must show all the same.
                taken, reason = (
                    bool(np.isfinite(sample.t)),
                    "its source sends values that are not finite, or beyond 10⁶",
                )
            elif isinstance(sample, JointSample):
                still = _still(len(sample.q), late=sample.quality is Quality.LATE)
                qd = still if sample.qd is None else np.array(sample.qd, float)
                if mechanism.name in self._unread:
                    contradicted = self._contradicted(sample)
                    reason = reason or beyond_limits(sample, mechanism) or contradicted
                if sample.payload is not None:
                    reason = reason or controller_check.heavier(sample.payload, self._carried[mechanism.name])
                taken = self._take_one(mechanism.name, sample.t, np.array(sample.q, float), qd)
            else:
                taken, missed = self._take_pose(mechanism, sample)
                reason = reason or missed
            if taken and mechanism.name in self._unheard:
                speeds = isinstance(sample, JointSample) and sample.qd is not None
                self._unheard[mechanism.name].hear(sample.t, sample.seq, speeds=speeds)
            self._note(mechanism.name, sample.t, reason, sample, taken=taken)
            if isinstance(sample, JointSample) and (sample.unmeasured or not sample.placed):
                reason = f"{sample.source} says nothing of {', '.join(sample.unmeasured)}"
                parts = ((reason, sample.unmeasured),) if sample.unmeasured else ()
                places = EVERYWHERE if sample.placed else NOWHERE
                self._hearings[mechanism.name].bones_heard.append(BonesHeard(sample.t, parts, places=places))

        for name, following in self._followings.items():
            hearing = self._hearings[name]
            hearing.driven = self.controllers
            for found in following.until(self._next()):
                qd = _still(len(found.q), late=found.late)
                self._references[name].take(found.t, found.q, qd, anew=found.anew and self._tick > 0)
                hearing.follow(found)
                hearing.leaves_at = self._references[name].leaves_at if name in self.ahead else 0.0
                hearing.once = self._references[name].once

    def _contradicted(self, sample: JointSample) -> str:
        """Why what a source says of itself is not the twin; empty when it may be."""
        if sample.tcp is None and sample.tcp_speed is None and sample.tau is None:
            return ""
        if sample.target not in self._said:
            self._said[sample.target] = controller_check.ControllerCheck(self.model, sample.target)
        said = self._said[sample.target]
        found = said.invalid_reason(sample)
        self._hearings[sample.target].invalid_torque_reason = said.invalid_torque_reason
        return found

    def _silent(self, name: str) -> bool:
        """Whether what drives it was silent: of a live source only the newest sample is ever this old."""
        age = self._now - self._references[name].until
        return self._tick > 0 and age > self._hearings[name].timeout

    def _take_one(self, name: str, t: float, q: Array, qd: Array | None, *, anew: bool = False) -> bool:
        """Take what says where somebody is; whether it is newer than what was heard before.

        What comes late finds the twin where it was taken to be meanwhile. It is put where it is found to be:
        if it were pulled there, it would show a speed that nobody had.
        """
        reference, now = self._references[name], self._now
        anew = anew or self._silent(name)
        # A file is heard ahead; only what is heard live can be late.
        late = name in self._live and self._tick > 0 and reference.until < now
        before = reference.at(now)[0] if late and not anew else None
        taken = reference.take(t, q, qd, anew=anew)
        if taken and before is not None:
            off = float(np.abs(reference.at(now)[0] - before).max(initial=0.0))
            if off > NEAR:
                reference.land(now)
            if off > self._limit:
                self._hearings[name].reset_at = now
        return taken

    def _move(self, moved: Moved) -> None:
        """A machine follows what its variables say."""
        taken = self._take_one(moved.machine, moved.t, moved.q, moved.qd, anew=self._tick > 0 and moved.anew)
        if taken and moved.machine in self._unheard and not moved.invalid_reason:
            self._unheard[moved.machine].hear(moved.t - moved.age, 0, speeds=False)
        self._hearings[moved.machine].older = moved.age
        self._note(moved.machine, moved.t, moved.invalid_reason, None, taken=taken)

    def _note(
        self, name: str, t: float, reason: str, sample: JointSample | PoseSample | None, *, taken: bool
    ) -> None:
        """Note that a robot, a person or a machine was heard, and why that may not be relied on."""
        hearing = self._hearings[name]
        hearing.driven = self.controllers
        if taken and (not hearing.heard or t > hearing.heard[-1].t):
            jump = f"its samples jump at {t:.3f} s" if self._references[name].jumped else ""
            if name in self._leapt:
                if jump:
                    self._leapt[name] = t + HOLD, jump
                until, said = self._leapt[name]
                jump = said if t <= until else ""
            torques = None if sample is None else torques_of(sample)
            off = None if sample is None else self._speed_error(name, sample)
            hearing.take(Heard(t, reason or jump, torques, off))
            hearing.once = self._speedless(name)
            hearing.leaves_at = self._references[name].leaves_at if name in self._stands else 0.0

    def _speed_error(self, name: str, sample: JointSample | PoseSample) -> Array | None:
        """How far speeds may be off that were derived from noisy positions; None where they are not.

        Of a live source that says none, they are slopes of the parabola through its newest three samples.
        """
        said, error = (sample.qd, sample.qd_error) if isinstance(sample, JointSample) else (None, None)
        if name in self._unread:
            self._noiseless.discard(name)
            if said is None or error is not None:
                noise, times = self._noises.setdefault(name, (PositionNoise(), deque(maxlen=3)))
                noise.add(sample.t, tuple(self._references[name].newest.tolist()))
                times.append(sample.t)
                if said is None:
                    error = noise.speed_error(times) if len(times) == 3 else None
                    if error is None:
                        self._noiseless.add(name)
            elif name in self._noises:
                self._noises[name][0].restart()
                self._noises[name][1].clear()
            if error is not None and not max(error, default=0.0) > QUIET:
                return None
        return None if error is None else np.array(error)

    def _speedless(self, name: str) -> bool:
        """Whether what was heard tells no speed: one position, or too few to tell how noisy they are."""
        return self._references[name].once or name in self._noiseless

    def _following(self, name: str) -> Following:
        """What captured motion of a person goes through.

        Raises:
            UnknownName: There is no such person.
        """
        if name not in self._followings:
            human = self.model.human(name)
            at = next(h.at for h in self.model.workstation.humans if h.name == name)
            timeout = self._hearings[name].timeout
            self._followings[name] = Following(human.description, pose_matrix(at), timeout)
        return self._followings[name]

    def _target(self, sample: JointSample | PoseSample) -> Mechanism:
        """Robot or human that a sample drives.

        Raises:
            UnknownName, InputError: There is none; it has another number of joints, or takes no poses.
        """
        if isinstance(sample, PoseSample):
            return moved_by_poses(self.model, sample)
        mechanism = self.model.mechanism(sample.target)
        n, qd, tau = len(mechanism.joints), sample.qd, sample.tau
        if len(sample.q) != n or (qd is not None and len(qd) != n) or (tau is not None and len(tau) != n):
            heard = f"{len(sample.q)} joint values" + (
                "" if sample.qd is None else f", {len(sample.qd)} speeds"
            )
            heard += "" if sample.tau is None else f", {len(sample.tau)} torques"
            raise InputError.at(sample.source, sample.target, heard, f"{sample.target} has {n} joints")
        return mechanism

    def _take_pose(self, mechanism: Mechanism, sample: PoseSample) -> tuple[bool, str]:
        """Resolve a Cartesian target into joint positions: whether it was taken, why it is not reached."""
        frame = self.model.frame(sample.target)
        reference = self._references[mechanism.name]
        q, miss = solve_pose(
            self._mj,
            self._wanted,
            mechanism,
            frame,
            rotation_from_wxyz(sample.wxyz),
            np.array(sample.position),
            start=reference.newest,
        )
        missed = f"{sample.target} cannot reach the pose that was heard: the nearest that was found is {miss}"
        taken = reference.take(sample.t, q, _still(len(q), late=sample.quality is Quality.LATE))
        return taken, "" if miss.larger <= POSE_TOLERANCE else missed

    def _foresee(self, name: str, t: Array) -> tuple[Array, Array, str] | None:
        """Tell what a robot or human will do (`seerob.twin.motion.Foresee`): by its file, or it stands."""
        hearing, mechanism = self._hearings[name], self.model.mechanisms[name]
        if name in self._loose.names:
            return None
        if not hearing.driven:
            if not (self.controllers and hearing.given):
                return None
            return np.tile(mechanism.home, (len(t), 1)), np.zeros((len(t), len(mechanism.home))), ""
        if name not in self.ahead:
            return None
        q, qd, _ = self._references[name].course(t)
        return q, qd, hearing.invalid_ahead_reason(self.state.t, float(t[-1]) if len(t) else self.state.t)

    def _samples_ahead(self, name: str, until: float) -> tuple[kernel.Indices, str] | None:
        """Tell what `_foresee` does from now on as the samples it goes through, of whom a file moves."""
        hearing = self._hearings[name]
        if name not in self.ahead or name in self._loose.names or not hearing.driven:
            return None
        return self._references[name].table, hearing.invalid_ahead_reason(self.state.t, until)

    def _knots_of(self, name: str, begin: float, end: float) -> Array:
        """Tell between which instants that is one cubic (`seerob.twin.spans.Knots`)."""
        if name not in self.ahead:
            return np.zeros(0)
        return self._references[name].between(begin + kernel.SLACK, end - kernel.SLACK)

    # -- time -------------------------------------------------------------------------------

    def _next(self) -> float:
        """When the tick that comes next ends [s]."""
        whole = (self._tick + 1) * self._period
        ends = self.end < math.inf and self._tick + 1 == last_tick(self.end, self._period)
        return self.end if ends and abs(self.end - whole) > kernel.SLACK else whole

    def _stretch(self, length: float) -> None:
        """Cut a tick that is not as long as others [s] into equal steps, no longer than those of others."""
        steps, before = max(1, math.ceil(length / self._dt - 1e-6)), self._dt
        self._dt = self._mj.opt.timestep = length / steps
        if self._centred:
            # Velocities of mj_step belong half a step earlier than its positions: of another step now.
            self._data.qvel += 0.5 * (1 - self._dt / before) * (self._data.qvel - self._before)
        self._divide(steps)

    def start(self) -> State:
        """The twin at t = 0, placed on the first samples without being pulled there."""
        self._place(0.0)
        self._note_errors()
        self.state.heard()
        return self.state

    def tick(self) -> State:
        """Advance by one tick and return the twin then.

        Raises:
            SimulationDiverged: A position that is not finite, or MuJoCo gave up.
        """
        start, t = self._now, self._next()
        if abs(t - start - self._period) > kernel.SLACK:
            self._stretch(t - start)
        for reference in self._references.values():
            reference.forget(start)
        for hearing in self._hearings.values():
            hearing.forget(start)
        self.signals.forget(start)
        self._broken.clear()
        for name in (put := self._loose.begin(self._before)):
            self.state.left.pop(name, None)
        self._broken.update(put)
        if self.physics:
            self._step(start, t)
        else:
            self._follow(t)
        self._tick += 1
        self._now = t
        self._show(t)
        self._loose.end(t)
        self._note_held()
        strayed = self._strayed
        self._note_errors()
        self.state.path = self._path(start, t, captured=strayed or self._strayed)
        if self._unheard or self._untold:
            every = (*self._unheard.values(), *self._untold.values())
            gaps = tuple(gap for each in every for gap in each.ended(t + kernel.SLACK))
            self.state.path = replace(self.state.path, gaps=gaps)
        self.state.attachments.unknown |= self._loose.lost()
        for name, coasts in self._coasting.items():
            reference = self._references[name]
            silent = not reference.waits and t - reference.until > coasts + kernel.SLACK
            self._hearings[name].once = silent or self._speedless(name)
        self.state.heard()
        return self.state

    @property
    def _centred(self) -> bool:
        """Whether the velocities of mj_step belong half a step earlier than its positions (see _pull)."""
        return self.controllers and self.physics and not self._data.ncon

    def _captured(self) -> tuple[Array, Array]:
        """What `_way` gives, with people where they were captured."""
        q, v = (each.copy() for each in self._way)
        q_all, v_all, a_all = self._course
        for person in self._people.values():
            q[:, person.q_address] = q_all[:, person.q_address]
            rows = person.v_address
            v[:, rows] = v_all[:, rows] + 0.5 * self._dt * a_all[:, rows]
        return q, v

    def _path(self, start: float, t: float, *, captured: bool) -> Path:
        """How everybody came from the last tick to this one."""
        broken = tuple(sorted(self._broken))
        q, v = self._way
        if self.physics:
            return Path(self._instants, q, v, broken, self._captured() if captured else None)
        inner = start + kernel.SLACK, t - kernel.SLACK
        inside = {
            instant
            for reference in self._references.values()
            for instant in reference.between(*inner).tolist()
        }
        instants = np.array([start, *sorted(inside), t], float)
        many_q, many_v = np.empty((len(instants), len(q[0]))), np.zeros((len(instants), len(v[0])))
        many_q[0], many_v[0] = q[0], v[0]
        many_q[1:] = self._shown.qpos
        many_v[-1] = self._shown.qvel
        for mechanism in self._mechanisms if inside else ():
            if self._references[mechanism.name].waits:
                continue
            found, speed, _ = self._references[mechanism.name].course(instants[1:-1])
            many_q[1:-1, mechanism.q_address] = found @ mechanism.coupling.T + mechanism.offset
            many_v[1:-1, mechanism.v_address] = speed @ mechanism.coupling.T
        return Path(instants, many_q, many_v, broken)

    def _follow(self, t: float) -> None:
        """Put the twin on what was heard, with the velocities of that motion."""
        self._way[0][0], self._way[1][0] = self._shown.qpos, self._shown.qvel
        for mechanism in self._mechanisms:
            reference = self._references[mechanism.name]
            if reference.landing and reference.lands(t):
                self._broken.add(mechanism.name)
        kernel.follow(self._motions, self._physics, t)

    def _step(self, start: float, end: float) -> None:
        """Step the physics from one instant to another [s]."""
        self._aim(start, end)
        every = self._mechanisms if self.controllers else ()
        self._landing = [one for one in every if self._references[one.name].landing]
        physics, begun, step = self._physics, True, 0
        while step < self._steps:
            if not begun or self._landing or self._task_pulls:
                self._pull(step, start + step * self._dt)
            if self._simple and not (self._landing or self._loose.names):
                step = kernel.steps(physics, step, True, WILD)
                begun = step == self._steps
            else:
                self._step_once(start + step * self._dt)
                begun = kernel.end(physics, step, self._centred, WILD)
            if not begun and self.controllers:
                self._put_back(step + 1, start + (step + 1) * self._dt)
                begun = kernel.end(physics, step, self._centred, WILD)
            step += 1
        self._land(self._steps, end)

    def _step_once(self, t: float) -> None:
        """Make one step of the physics, with all that may take part in it, from ``t`` on [s]."""
        if self._loose.names:
            self._loose.pull(t, self._dt)
        try:
            mujoco.mj_step(self._mj, self._data)
        except FAULTS as error:
            raise self._gave_up(error) from error

    def _aim(self, start: float, end: float) -> None:
        """Work out where every joint is to be at each step of the tick that begins, and at its end [s]."""
        steers = self.controllers and not self._task_pulls
        kernel.aim(self._motions, self._physics, start, end, self._dt, steers)

    def _pull(self, step: int, t: float) -> None:
        if self._landing:
            self._land(step, t)
        if self._task_pulls:
            kernel.steer(self._physics, step, step + 1, self._dt)
        kernel.begin(self._physics, step)
        for pull in self._task_pulls:
            pull.command(self._mj, self._data, self._wanted, self._kp)

    def _land(self, step: int, t: float) -> None:
        """Put there who jumped there by ``t`` [s], also where that is the instant of the tick itself."""
        for mechanism in self._landing:
            reference = self._references[mechanism.name]
            if reference.landing and reference.lands(t):
                self._broken.add(mechanism.name)
                self._put(mechanism, *(part[step] for part in self._courses[mechanism.name]))

    def _place(self, t: float) -> None:
        for mechanism in self._mechanisms:
            self._put(mechanism, *self._references[mechanism.name].at(t))
        try:
            mujoco.mj_forward(self._mj, self._data)
        except FAULTS as error:
            raise self._gave_up(error) from error
        self._show(t)

    def _put(self, mechanism: Mechanism, q: Array, v: Array, a: Array) -> None:
        self._qpos[mechanism.q_address] = mechanism.coupling @ q + mechanism.offset
        if not (self.controllers and self.physics):
            self._qvel[mechanism.v_address] = self._before[mechanism.v_address] = mechanism.coupling @ v
            return
        late = 0.5 * self._dt * a
        self._qvel[mechanism.v_address] = mechanism.coupling @ (v - late)
        self._before[mechanism.v_address] = mechanism.coupling @ (v - 3 * late)

    def _put_back(self, step: int, t: float) -> None:
        """Put what the physics has lost back to where it should be; its verdicts wait until it follows."""
        for mechanism in self._mechanisms:
            if not kernel.tame(self._data.qvel[mechanism.v_address], WILD):
                if mechanism.name in self._loose.names:
                    self._loose.stop(mechanism.name, self._before)
                    self._broken.add(mechanism.name)
                    continue
                self._put(mechanism, *(part[step] for part in self._courses[mechanism.name]))
                self._data.qacc_warmstart[mechanism.v_address] = 0.0
                self._hearings[mechanism.name].reset_at = t
                self._broken.add(mechanism.name)

    def _show(self, t: float) -> None:
        if not kernel.show(self._physics, self._centred):
            raise self._diverged()
        self.state.refresh(t)
        if self._grips.follow(self.state):
            self.state.refresh(t)

    def _note_held(self) -> None:
        """What hands and grippers hold now; what hands let go lies as far off as they were."""
        state, held = self.state, self._loose.held()
        for name, holders in state.held.items():
            people = {holder.rpartition("/")[0] for holder in holders} & self._people.keys()
            if name in held or not people:
                continue
            try:
                state.left[name] = float(self._off[name].at(state).max(initial=0.0))
            except Undecided as unknown:
                reason = f"{name}: let go by a hand that was not known ({unknown})"
                self._loose.lose([name], reason)
        for name, holders in held.items():
            if {holder.rpartition("/")[0] for holder in holders} & self._people.keys():
                state.left.pop(name, None)
        for name in self._loose.snapped():
            state.left.pop(name, None)
        state.events, state.held, state.lags = self._loose.said(), held, self._loose.lags()

    def _note_errors(self) -> None:
        if not self.controllers:
            return
        for name, following in self._followings.items():
            q = self.state.joint_positions(self.model.mechanisms[name])
            self._hearings[name].bones = following.errors(self.state.t, q)
        pulled, strayed = self.physics and self._tick > 0, False
        kernel.compare(self._motions, self._physics, self.state.t, self._dt, pulled, self.physics)
        if pulled and self.model.workstation.contacts and self.model.workstation.humans:
            self.state.touches = self._touches()
        found = zip(self._hearings.items(), *(each.tolist() for each in self._found), strict=True)
        for (name, hearing), error, saturated, unlike in found:
            if name in self._loose.names:
                continue
            if pulled:
                hearing.error, hearing.saturated = error, saturated
                if name in self._people:
                    strayed = self._note_captured(self._people[name], hearing) or strayed
            hearing.unlike = self._unlike(name) if unlike > QUIET else None
        self._strayed = strayed

    def _unlike(self, name: str) -> Array | None:
        """How far speeds of the twin are from those that are said, of whom that is more than `QUIET`."""
        # Noise of speeds that a file's positions told is that half way between two of them.
        around = () if name in self._unread else self._hearings[name].around(self.state.t)
        return together(self._unlike_by[name]) if all(s.speed_error is None for s in around) else None

    def _touches(self) -> list[tuple[int, int, float]]:
        """Every contact now: two of MuJoCo's bodies and the normal force [N]."""
        mj, data, force = self._mj, self._data, np.zeros(6)
        found = []
        for k in range(data.ncon):
            mujoco.mj_contactForce(mj, data, k, force)
            one, other = (int(mj.geom_bodyid[geom]) for geom in data.contact[k].geom)
            if force[0] > 0:
                found.append((one, other, float(force[0])))
        return found

    def _note_captured(self, person: Mechanism, hearing: Hearing) -> bool:
        """Where a person was captured, and how well that is what devices saw, where the twin is elsewhere.

        Returns:
            Whether it is.
        """
        hearing.captured, hearing.captured_v = self._led[person.name]
        limit = self.model.workstation.engine.human_tracking_limit
        hearing.held = hearing.error > LAGS * limit
        if (touches := self.state.touches) and not hearing.held:
            own = {self.model.bodies[i].mj for i in (*person.bodies, *person.carried)}
            hearing.held = any((one in own) != (other in own) for one, other, _ in touches)
        if hearing.error > limit:
            following = self._followings.get(person.name)
            hearing.residual = following.errors(self.state.t, hearing.captured) if following else {}
        return hearing.held or hearing.error > limit

    def _gave_up(self, error: Exception) -> SimulationDiverged:
        return SimulationDiverged(
            f"the physics gave up after {self._now:.3f} s: {error}; lower engine.timestep, or check masses, "
            "contacts and samples"
        )

    def _diverged(self) -> SimulationDiverged:
        """Say what of the twin is not finite."""
        for mechanism in self._mechanisms:
            bad = ~np.isfinite(self._qpos[mechanism.q_address])
            if bad.any():
                names = [j.name for link in mechanism.description.links for j in link.joints]
                joint = names[int(bad.argmax())]
                return SimulationDiverged(
                    f"{mechanism.name}/{joint} is not finite after {self._now:.3f} s; "
                    "lower engine.bandwidth or check masses and samples"
                )
        return SimulationDiverged(f"a velocity is not finite after {self._now:.3f} s")


def _still(n: int, *, late: bool) -> Array | None:
    """Speeds of n joints of which nobody says any: None, to be derived, or 0 where run time stood still.

    That makes the way from the sample before it too fast, and where nothing more is heard the twin goes on at
    that speed.
    """
    return np.zeros(n) if late else None


def _joints(m: Mechanism, rows: int) -> kernel.Joints:
    """Joints of one who is pulled, with room for so many instants of a tick."""
    led = not m.offset.any() and np.array_equal(m.coupling, np.eye(len(m.v_address)))
    q, v, a = np.zeros((3, rows, len(m.home)))
    return kernel.Joints(
        m.q_address.astype(np.int64),
        m.v_address.astype(np.int64),
        m.v_address[m.own].astype(np.int64),
        # Without mimics a person's 53 by 53 products can be spared.
        np.ascontiguousarray(m.coupling[:0] if led else m.coupling, float),
        np.ascontiguousarray(m.offset, float),
        q,
        v,
        a,
        np.zeros(len(m.home)),
        *np.zeros((2, len(m.v_address))),
    )
