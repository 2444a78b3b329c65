r"""What a robot's source says of itself, against the twin: where its tool is, and what its joints hold.

A controller that is heard says, beside the joints, where it has its own tool centre point (TCP). The twin at
the same joints must have it there too, or it is another robot, another tool or another calibration.

.. math:: e = \| {}^{root}T_{base}\; p_{said} - {}^{root}T_{flange}(q)\; {}^{flange}p_{TCP} \|

The speed of that point must be that of the twin's, :math:`|J_{TCP}(q)\,\dot q|`, whatever frame it is told
in: else times or units of the joints are wrong. And what joints hold up must have the sign of the model's
gravity.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import mujoco
import numpy as np

from seerob.core.errors import SeerobError
from seerob.core.samples import JointSample, Quality, Sample
from seerob.core.snapshot import Finding
from seerob.core.transforms import Array, inverse, transform
from seerob.description.description import Description
from seerob.description.robots import library
from seerob.files.trajectories.trajectory import TrajectorySamples
from seerob.files.waypoints.arm import Arm, Posture
from seerob.kernels.arm import nearest_point, other_way, point_speeds
from seerob.model.model import Mechanism, Model
from seerob.model.mounting.compilation import pose_matrix
from seerob.workstation.workstation import Robot

TOLERANCE = 0.010
"""How far the TCP may be from the twin's when the file does not say [m].

Each arm is measured at the factory, and its maker's ROS driver warns that without those figures ends of arms
"might be off in the magnitude of centimeters" (ur_robot_driver, robot setup); arms of one maker differ by
19 mm (UR3, UR3e) and more."""
MOST = 5000
"""Samples of a file that are looked at, evenly."""
MOVES = 0.1
"""A TCP whose places span less than this does not tell a frame from another [m]."""
TURNED = transform(np.diag([-1.0, -1.0, 1.0]))
"""Half a turn about z: between the base of a UR controller and the ``base_link`` of its description."""
LEAST_BIAS = 2.0
"""Torques of the model up to this are too small beside friction to tell a sign [N·m or N], RMS."""
OPPOSITE = 0.5
"""Torques whose sum with the model's is smaller than this, of their difference, have the opposite sign."""
SPEED_SHARE, SPEED_FLOOR = 0.2, 0.02
"""Speeds of one point may differ by this share of the larger, as rounded and filtered ones do
(`seerob.devices.live.contradictions.SHARE`), and by this [m/s], which is noise of speeds that are derived."""
SPEED_SEEN = 0.05
"""Below it a tool stands, and speeds tell nothing [m/s]."""
SPAN = 0.5
"""Over which ways are compared live [s], as `seerob.devices.live.contradictions.SPAN`."""
LAG = 0.03
"""By which one of two speeds may be filtered more than the other [s], likewise."""
ANCHORS = 10
"""Instants of a span that the newest is compared with."""
LIMITS = np.array([SPAN, SPEED_FLOOR * SPAN, SPEED_SHARE, LAG])
"""Of two ways, as `seerob.kernels.arm.other_way` takes them."""
EVERY, FEWEST = 0.1, 5
"""Live torques are looked at so often [s], and judged from so many on."""
PAYLOAD_FLOOR, PAYLOAD_SHARE = 0.15, 0.1
"""By so much more than the twin carries a controller may have at its flange [kg, share]: it is weighed by the
arm's own torques, or typed in. Own choice."""
UNITS = {1e3: "N·mm read as N·m", 1e-3: "kN·m read as N·m", 100.0: "N·cm read as N·m"}
ROWS = 200
"""Samples whose torques are compared, evenly."""
TURNS = 0.2
"""A flange that turned by less (Frobenius norm) does not tell one tool from another."""


# -- mathematics --------------------------------------------------------------------------------


class Fit(NamedTuple):
    """A TCP fixed to a flange that explains where it was said to be."""

    offset: Array
    """Position of the TCP in the flange [m], shape (3,)."""
    error: float
    """Largest distance that is left [m]."""


def fixed_offset(rotations: Array, positions: Array, said: Array) -> Fit:
    r"""Least squares of :math:`R_i x + p_i = s_i`: closed form, since the :math:`R_i` are orthogonal.

    Args:
        rotations: Base from flange, shape (N, 3, 3).
        positions: Of the flange in the base [m], shape (N, 3).
        said: Of the TCP in the base [m], shape (N, 3).
    """
    offset = np.einsum("nji,nj->ni", rotations, said - positions).mean(axis=0)
    left = np.linalg.norm(rotations @ offset + positions - said, axis=1)
    return Fit(offset, float(left.max()))


def rigid_error(a: Array, b: Array) -> float:
    """Largest distance that is left when points (N, 3) are laid on others as one rigid body [m]."""
    a0, b0 = a - a.mean(axis=0), b - b.mean(axis=0)
    u, _, vt = np.linalg.svd(a0.T @ b0)
    d = np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])
    return float(np.linalg.norm(a0 @ (u @ d @ vt) - b0, axis=1).max())


def other_speed(said: Array, twin: Array) -> str:
    """Why two speeds of one point [m/s], shape (N,), are of no one motion; empty when they may be.

    Args:
        said: As the source says.
        twin: Of the same point in the twin, at the source's joint positions and velocities.
    """
    most = np.maximum(said, twin)
    seen = most > SPEED_SEEN
    if seen.sum() < FEWEST:
        return ""
    off, size = float(np.abs(said - twin)[seen].mean()), float(most[seen].mean())
    if off <= SPEED_FLOOR + SPEED_SHARE * size:
        return ""
    a, b = float(said[seen].mean()), float(twin[seen].mean())
    return (
        f"its own tool centre point moves at {a:.3g} m/s, the twin's at {b:.3g} m/s "
        f"(means over {int(seen.sum())} samples): are the times and the units of its joints right?"
    )


def heavier(said: float, twin: float) -> str:
    """Why what a source has at the flange is not what the twin carries [kg]; empty when it may be.

    Less than the twin carries is no contradiction: many programs never tell their controller.
    """
    if said <= twin + max(PAYLOAD_FLOOR, PAYLOAD_SHARE * twin):
        return ""
    return (
        f"its source has {said:.4g} kg at its flange, and the twin carries {twin:.4g} kg: was the tool "
        "changed, or something picked up (tools, workpieces)?"
    )


def sign_or_unit(measured: Array, model: Array) -> str:
    """What is wrong with the sign or the unit of measured torques, shape (N, n); empty when nothing is clear.

    Args:
        measured: As the source says [N·m or N].
        model: What gravity and speed ask of the joints, likewise.
    """
    size = float(np.sqrt((model**2).sum(axis=1).mean()))
    power, own = float((measured**2).sum()), float((model**2).sum())
    if size < LEAST_BIAS or power == 0.0:
        return ""
    apart, together = (float(np.linalg.norm(x)) for x in (measured - model, measured + model))
    if together < OPPOSITE * apart:
        added, taken = (x / np.sqrt(len(model)) for x in (together, apart))
        return (
            "its torques have the opposite sign of what the model needs: with those they add up to "
            f"{added:.3g} N·m, and differ from them by {taken:.3g} N·m (root mean square over the samples)"
        )
    ratio, correlation = (
        float((measured * model).sum()) / own,
        float((measured * model).sum()) / np.sqrt(power * own),
    )
    for factor, name in UNITS.items():
        if correlation > 0.9 and abs(ratio / factor - 1) < 0.4:
            return f"its torques are {ratio:.3g} × what the model needs: {name}?"
    return ""


# -- where the twin has it ----------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class ControllerTool:
    """Where a robot's own TCP may be in the twin; bound once.

    Attributes:
        arm: To the flange.
        tips: Points where the TCP may be, in the flange [m], by what they are.
        bases: Root from the frames that a controller may speak in, shape (k, 4, 4).
        tolerance: [m]
    """

    arm: Arm
    tips: dict[str, Array]
    bases: Array
    tolerance: float

    def off(self, posture: Posture, said: Array) -> tuple[Array, str, int]:
        """How far the TCP is from where it is said to be [m], shape (N,), at which tip, in which frame.

        Args:
            posture: The arm at N joint positions.
            said: Of the TCP, as the source has it [m], shape (N, 3).
        """
        error = np.empty(len(said))
        point, base = nearest_point(
            posture.rotation, posture.position, self._points, self.bases, np.ascontiguousarray(said), error
        )
        return error, tuple(self.tips)[point], base

    def speeds(self, posture: Posture, qd: Array) -> Array:
        """Speed of each point where the TCP may be [m/s], shape (tips, N).

        Args:
            posture: The arm at N joint positions.
            qd: [rad/s or m/s], shape (N, n).
        """
        return np.asarray(
            point_speeds(
                posture.rotation, posture.position, posture.anchors, posture.axes, posture.slides,
                np.ascontiguousarray(qd), self._points,
            )
        )  # fmt: skip

    @cached_property
    def _points(self) -> Array:
        return np.array(list(self.tips.values()), float)


class _Ways(NamedTuple):
    t: float
    speeds: Array
    """Speeds that were said, and of each tip [m/s], shape (1 + tips,)."""
    ways: Array
    """Their integrals [m], likewise."""


class ControllerCheck:
    """What a robot's live source says of itself, sample by sample.

    Args:
        model: The compiled workstation.
        name: A robot.
    """

    def __init__(self, model: Model, name: str) -> None:
        self._model, self._name = model, name
        self._robot = bound(model, name)
        self._ways: deque[_Ways] = deque(maxlen=ANCHORS)
        self._past = _past(())
        self._newest: _Ways | None = None
        self._torques: deque[tuple[Array, Array]] = deque(maxlen=ROWS)
        self._looked = -math.inf
        self._postures: deque[tuple[Array, Array, Array]] = deque(maxlen=ROWS)
        self._data: mujoco.MjData | None = None
        self.invalid_torque_reason = ""
        """Why its torques may not be relied on; empty when they may."""

    def invalid_reason(self, sample: JointSample) -> str:
        """Why one sample contradicts the twin; empty when it does not, or says nothing of its TCP."""
        looks = sample.t >= self._looked + EVERY
        self._looked = sample.t if looks else self._looked
        if looks:
            self._hear_torques(sample)
        if self._robot is None or (sample.tcp is None and sample.tcp_speed is None):
            return ""
        posture = self._robot.arm.posture(np.array([sample.q]))
        place, speed = self._place(sample, posture, looks=looks), self._speed(sample, posture)
        return place or speed

    def _place(self, sample: JointSample, posture: Posture, *, looks: bool) -> str:
        robot = self._robot
        if sample.tcp is None or robot is None:
            return ""
        error, _, frame = robot.off(posture, np.array([sample.tcp]))
        if error[0] <= robot.tolerance:
            return ""
        base = robot.bases[frame]
        if looks:
            said = base[:3, :3] @ sample.tcp + base[:3, 3]
            self._postures.append((posture.rotation[0], posture.position[0], said))
        return (
            f"its source has its own tool centre point {1e3 * error[0]:.0f} mm from the twin's, more than "
            f"{1e3 * robot.tolerance:g} mm (tcp_tolerance): {self._fits()}"
        )

    def _fits(self) -> str:
        """What would explain where it says that it is."""
        if len(self._postures) >= FEWEST and self._robot is not None:
            rotations, positions, said = (np.array(part) for part in zip(*self._postures, strict=True))
            turned = float(np.linalg.norm(rotations - rotations[0], axis=(1, 2)).max())
            fit = fixed_offset(rotations, positions, said)
            if turned > TURNS and fit.error <= self._robot.tolerance:
                return _offset(fit)
        return "another robot, tool or calibration"

    def _speed(self, sample: JointSample, posture: Posture) -> str:
        """Ways of the TCP over the last `SPAN`, as said and as the twin's."""
        if sample.tcp_speed is None or sample.qd is None or self._robot is None:
            self._newest = None
            return ""
        twin = self._robot.speeds(posture, np.array([sample.qd]))[:, 0]
        speeds = np.array([sample.tcp_speed, *twin.tolist()])
        last, t = self._newest, sample.t
        if not math.isfinite(speeds.sum()):
            self._newest = None
            return "the speed of its own tool centre point is no number"
        if last is None or not 0 < t - last.t < SPAN:
            self._ways.clear()
            self._newest = _Ways(t, speeds, np.zeros(len(speeds)))
            self._remember(self._newest)
            return ""
        ways = last.ways + 0.5 * (t - last.t) * (last.speeds + speeds)
        now = self._newest = _Ways(t, speeds, ways)
        found = _differ(self._past, now)
        if t - self._ways[-1].t >= SPAN / ANCHORS:
            self._remember(now)
        return found

    def _remember(self, now: _Ways) -> None:
        self._ways.append(now)
        self._past = _past(self._ways)

    def _hear_torques(self, sample: JointSample) -> None:
        model, mechanism = self._model, self._model.mechanisms[self._name]
        if sample.tau is None or not _compares_torques(model, mechanism):
            return
        self._data = self._data or mujoco.MjData(model.mj)
        qd = None if sample.qd is None else np.array(sample.qd)
        bias = _bias(model, self._data, mechanism, np.array(sample.q), qd)
        self._torques.append((np.array(sample.tau), bias))
        if len(self._torques) >= FEWEST:
            measured, needed = (np.array(part) for part in zip(*self._torques, strict=True))
            self.invalid_torque_reason = sign_or_unit(measured, needed)


def _past(every: Sequence[_Ways]) -> tuple[Array, Array, Array]:
    """Instants (k,), speeds and ways (k, 1 + tips) of several."""
    t, speeds, ways = zip(*every, strict=True) if every else ((), (), ())
    return np.array(t, float), np.array(speeds, float, ndmin=2), np.array(ways, float, ndmin=2)


def _differ(past: tuple[Array, Array, Array], now: _Ways) -> str:
    """Why the ways from one of some instants until now are of no one motion; empty when all may be."""
    k = other_way(*past, now.t, now.speeds, now.ways, LIMITS)
    if k < 0:
        return ""
    went = now.ways - past[2][k]
    said, twin = went[0], went[1:]
    nearest = int(np.abs(twin - said).argmin())
    return (
        f"its own tool centre point went {1e3 * said:.0f} mm in {now.t - past[0][k]:.2g} s, "
        f"the twin's {1e3 * twin[nearest]:.0f} mm: the speeds that its source says are of no one motion"
    )


def carried(model: Model, name: str) -> float:
    """What the twin has on a robot, with all that its grippers ever hold, as far as weighed [kg]."""
    masses = (model.bodies[i].mass for i in model.mechanisms[name].carried)
    return sum(mass.value for mass in masses if mass is not None)


def bound(model: Model, name: str) -> ControllerTool | None:
    """Where the TCP of a robot may be; None for who is no robot, or whose joints follow others."""
    robot = next((r for r in model.workstation.robots if r.name == name), None)
    if robot is None:
        return None
    mechanism = model.mechanisms[name]
    try:
        arm = Arm(mechanism.description)
    except SeerobError:
        return None
    if arm.n != len(mechanism.joints):
        return None
    bases = [np.eye(4), TURNED]
    if robot.on is None:
        # Exports of simulators speak of the world.
        bases.append(inverse(pose_matrix(robot.base)))
    tolerance = TOLERANCE if robot.tcp_tolerance is None else robot.tcp_tolerance
    return ControllerTool(arm, _tips(model, robot, mechanism), np.array(bases), tolerance)


def try_out(model: Model, name: str) -> None:
    """Ask of a robot once what is asked of each of its samples: what is compiled at first use is, then."""
    if (robot := bound(model, name)) is not None:
        still = np.zeros((1, robot.arm.n))
        speeds = np.append(0.0, robot.speeds(robot.arm.posture(still), still))
        robot.off(robot.arm.posture(still), np.zeros((1, 3)))
        _differ(_past([_Ways(0.0, speeds, speeds)]), _Ways(1.0, speeds, speeds))


def _tips(model: Model, robot: Robot, mechanism: Mechanism) -> dict[str, Array]:
    if robot.controller_tcp is not None:
        return {"controller_tcp": pose_matrix(robot.controller_tcp)[:3, 3]}
    data = mujoco.MjData(model.mj)
    data.qpos[mechanism.q_address] = mechanism.coupling @ mechanism.home + mechanism.offset
    mujoco.mj_kinematics(model.mj, data)

    def world(body: int) -> Array:
        return transform(data.xmat[body].reshape(3, 3), data.xpos[body])

    flange_from_world = inverse(world(model.frames[f"{robot.name}/{mechanism.description.tip}"].mj))
    tips = {FLANGE: np.zeros(3)}
    for tool in model.workstation.tools:
        if (
            tool.tcp is not None
            and tool.name in model.frames
            and model.frames[tool.name].mj in mechanism.mj_bodies
        ):
            frame = flange_from_world @ world(model.frames[tool.name].mj) @ pose_matrix(tool.tcp)
            tips[f"the tcp of {tool.name}"] = frame[:3, 3]
    own = flange_from_world @ world(mechanism.tip.mj) @ mechanism.tip.body_from_frame
    tips[f"the working point of {robot.name}"] = own[:3, 3]
    return tips


FLANGE = "its flange"


# -- a file, when it is opened ------------------------------------------------------------------


class ControllerLog(NamedTuple):
    """What a file says of a robot, in its valid rows; None where it says nothing.

    Of where the TCP is, and how fast, rows in which it is not said are NaN.
    """

    file: str
    t: Array
    """[s], shape (N,)."""
    q: Array
    """[rad or m], shape (N, n)."""
    qd: Array | None
    """[rad/s or m/s], shape (N, n)."""
    tau: Array | None
    """[N·m or N], shape (N, n)."""
    tcp: Array | None
    """[m], shape (N, 3)."""
    frame_known: bool
    """Whether the TCP is in the base frame of the controller; else in any."""
    tcp_speed: Array | None = None
    """[m/s], shape (N,)."""
    current: Array | None = None
    """Motor currents, where no torques are said [A], shape (N, n)."""

    def thinned(self, most: int, said: Array | None = None) -> ControllerLog:
        """At most so many rows of it, evenly; of those in which something is said, when it is given."""
        rows = np.arange(len(self.t))
        if said is not None:
            rows = rows[np.isfinite(said.reshape(len(said), -1)).all(axis=1)]
        rows = rows[:: max(1, -(-len(rows) // most))]
        every = (self.qd, self.tau, self.tcp, self.tcp_speed, self.current)
        qd, tau, tcp, speed, current = (None if x is None else x[rows] for x in every)
        thin = self._replace(t=self.t[rows], q=self.q[rows], qd=qd, tau=tau, tcp=tcp)
        return thin._replace(tcp_speed=speed, current=current)


def controller_log(samples: Iterable[Sample], file: str) -> ControllerLog | None:
    """What a source that was opened says of itself; None when it says nothing but where the joints are."""
    if isinstance(samples, TrajectorySamples):
        motion = samples.trajectory
        said = (motion.tau, motion.current, motion.tcp_position, motion.tcp_speed)
        if all(each is None for each in said):
            return None
        valid = np.ones(len(motion.t), bool) if motion.invalid is None else ~motion.invalid
        every = (samples.qd, motion.tau, motion.tcp_position, motion.tcp_speed, motion.current)
        qd, tau, tcp, speed, current = (None if x is None else x[valid] for x in every)
        if tcp is not None and motion.tcp_said is not None:
            tcp = np.where(motion.tcp_said[valid, None], tcp, np.nan)
        t = motion.t[valid] - motion.t[0]
        q = motion.q[valid]
        return ControllerLog(file, t, q, qd, tau, tcp, motion.tcp_in_base, speed, current) if len(t) else None
    rows = [s for s in samples if isinstance(s, JointSample) and s.quality is Quality.GOOD]
    if all(s.tau is None and s.tcp is None and s.tcp_speed is None for s in rows):
        return None
    q, qd, tau = (_table([getattr(s, field) for s in rows]) for field in ("q", "qd", "tau"))
    # Some say it only while they stand.
    tcp = np.array([UNSAID if s.tcp is None else s.tcp for s in rows])
    speed = np.array([np.nan if s.tcp_speed is None else s.tcp_speed for s in rows])
    return (
        None
        if q is None
        else ControllerLog(file, np.array([s.t for s in rows]), q, qd, tau, tcp, True, speed)
    )


UNSAID = (math.nan, math.nan, math.nan)


def _table(rows: Sequence[tuple[float, ...] | None]) -> Array | None:
    """Shape (N, n); None unless every row is there."""
    return np.array(rows) if rows and all(row is not None for row in rows) else None


def compared(model: Model, name: str, said: ControllerLog) -> Iterator[Finding]:
    """What is found when what a file says of itself is compared with the robot that it drives."""
    robot = bound(model, name)
    if robot is None:
        return
    if said.tcp is not None and len((words := said.thinned(MOST, said.tcp)).t):
        yield _about_tool(model, name, robot, words)
    if said.tcp_speed is not None and said.qd is not None:
        yield from _about_speed(name, robot, said.thinned(MOST, said.tcp_speed))
    if said.tau is not None:
        yield from _about_torques(model, name, said.thinned(ROWS))


def _about_tool(model: Model, name: str, robot: ControllerTool, words: ControllerLog) -> Finding:
    file, t, q, said = words.file, words.t, words.q, words.tcp
    assert said is not None
    posture = robot.arm.posture(q)
    error, tip, _ = robot.off(posture, said)
    worst = int(np.argmax(error))
    limit = f"{1e3 * robot.tolerance:g} mm (tcp_tolerance)"
    if error[worst] <= robot.tolerance:
        text = (
            f"{file}: its own tool centre point is where the twin has {tip}, to {1e3 * error[worst]:.1f} mm"
        )
        if tip == FLANGE and len(robot.tips) > 1 and _beside(robot):
            text += ": its controller knows of no tool, and says nothing of the twin's"
        return Finding(level="note", subject=name, text=text)
    rotations, positions = posture.rotation, posture.position
    if not words.frame_known:
        span = float(np.ptp(said, axis=0).max())
        here = [(rigid_error(rotations @ x + positions, said), what) for what, x in robot.tips.items()]
        least, what = min(here)
        if span < MOVES:
            text = "are in a frame that nobody gave, and move too little to be compared"
            return Finding(level="note", subject=name, text=f"{file}: its tool positions {text}")
        if least <= robot.tolerance:
            text = f"are those of {what} in a frame of their own, to {1e3 * least:.1f} mm"
            return Finding(level="note", subject=name, text=f"{file}: its tool positions {text}")
    guesses = list(_guesses(model, name, robot, q, said))
    would = "; ".join(guesses) if guesses else "no robot of the library and no tool would fit"
    text = (
        f"{file}: its own tool centre point is {1e3 * error[worst]:.0f} mm from {tip} in the twin at "
        f"{t[worst]:.3f} s, more than {limit}: {would}"
    )
    return Finding(level="warning", subject=name, text=text, holds=(name,))


def _beside(robot: ControllerTool) -> bool:
    """Whether the twin has a tool whose point is not at the flange."""
    return max(float(np.linalg.norm(x)) for x in robot.tips.values()) > robot.tolerance


def _guesses(model: Model, name: str, robot: ControllerTool, q: Array, said: Array) -> Iterator[str]:
    """Robots of the library, and tools, that would explain what was said."""
    own = next(r.model for r in model.workstation.robots if r.name == name)
    fits = []
    for other in library.names():
        if f"library:{other}" == own:
            continue
        arm = _arm(library.load(other))
        if arm is None or arm.n != robot.arm.n:
            continue
        error, tip, _ = ControllerTool(arm, robot.tips, robot.bases, robot.tolerance).off(
            arm.posture(q), said
        )
        if error.max() <= robot.tolerance:
            fits.append(
                (float(error.max()), f"library:{other} would fit, with {tip}, to {1e3 * error.max():.1f} mm")
            )
    if fits:
        # In few postures a tool that is far away would explain the wrong robot.
        yield from (text for _, text in sorted(fits)[:2])
        return
    posture = robot.arm.posture(q)
    rotations, positions = posture.rotation, posture.position
    found = [fixed_offset(rotations, positions, said @ b[:3, :3].T + b[:3, 3]) for b in robot.bases]
    best = min(found, key=lambda fit: (round(fit.error, 4), float(np.linalg.norm(fit.offset))))
    if best.error <= robot.tolerance:
        yield _offset(best)


def _offset(fit: Fit) -> str:
    place = ", ".join(f"{1e3 * x + 0.0:.0f}" for x in fit.offset.round(4))
    return (
        f"a tool centre point at [{place}] mm of the flange would fit to {1e3 * fit.error:.1f} mm: give "
        "the tool its tcp, or the robot controller_tcp"
    )


def _about_speed(name: str, robot: ControllerTool, words: ControllerLog) -> Iterator[Finding]:
    said, qd = words.tcp_speed, words.qd
    assert said is not None
    assert qd is not None
    # What fits at one of the points where the TCP may be is not told apart.
    found = [other_speed(said, twin) for twin in robot.speeds(robot.arm.posture(words.q), qd)]
    if all(found):
        yield Finding(level="warning", subject=name, text=f"{words.file}: {found[0]}", holds=(name,))


def _arm(description: Description) -> Arm | None:
    try:
        return Arm(description)
    except SeerobError:
        return None


def _of(model: Model, subjects: Sequence[str], mechanism: Mechanism) -> bool:
    """Whether a criterion speaks of the robot, or of what moves with it; also when it names nothing."""
    places = {s: model.frames[s].mj for s in subjects if s in model.frames}
    moved = any(mj in mechanism.mj_bodies for mj in places.values())
    return not subjects or mechanism.name in subjects or moved


def _of_torques(model: Model) -> list[Any]:
    return [c for c in (*model.workstation.safety, *model.workstation.ergonomics) if c.by_torque]


def _compares_torques(model: Model, mechanism: Mechanism) -> bool:
    """Whether measured torques are to be those of the model: no guessed masses, and not external ones."""
    external = any(
        getattr(c, "torques", "") == "external" and _of(model, c.subjects(), mechanism)
        for c in _of_torques(model)
    )
    return not (mechanism.unknown_masses or mechanism.roughly_weighed or external)


def _bias(model: Model, data: mujoco.MjData, mechanism: Mechanism, q: Array, qd: Array | None) -> Array:
    """What gravity and speed ask of the joints [N·m or N], shape (n,); ``data`` is overwritten."""
    data.qpos[mechanism.q_address] = mechanism.coupling @ q + mechanism.offset
    if qd is not None:
        data.qvel[mechanism.v_address] = mechanism.coupling @ qd
    mujoco.mj_fwdPosition(model.mj, data)
    mujoco.mj_fwdVelocity(model.mj, data)
    return np.asarray(mechanism.coupling.T @ data.qfrc_bias[mechanism.v_address])


def _about_torques(model: Model, name: str, said: ControllerLog) -> Iterator[Finding]:
    mechanism = model.mechanisms[name]
    if not _compares_torques(model, mechanism):
        return
    assert said.tau is not None
    data = mujoco.MjData(model.mj)
    speeds = [None] * len(said.q) if said.qd is None else list(said.qd)
    bias = np.array([_bias(model, data, mechanism, q, qd) for q, qd in zip(said.q, speeds, strict=True)])
    wrong = sign_or_unit(said.tau, bias)
    if wrong:
        holds = tuple(c.name for c in _of_torques(model) if _of(model, c.subjects(), mechanism))
        yield Finding(level="warning", subject=name, text=f"{said.file}: {wrong}", holds=holds)
