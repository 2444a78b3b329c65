r"""What a robot's source says of itself, against the twin: where its tool is, and what its joints hold.

A controller that is heard says, beside the joints, where it has its own tool centre point (TCP). The twin at
the same joints must have it there too, or it is another robot, another tool or another calibration.

.. math:: e = \| {}^{root}T_{base}\; p_{said} - {}^{root}T_{flange}(q)\; {}^{flange}p_{TCP} \|
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import mujoco
import numpy as np

from seerob.errors import SeerobError
from seerob.model import Mechanism, Model
from seerob.model_io import library
from seerob.model_io.description import Description
from seerob.mounting.compilation import pose_matrix
from seerob.samples import JointSample, Quality, Sample
from seerob.snapshot import Finding
from seerob.trajectories.trajectory import TrajectorySamples
from seerob.transforms import Array, inverse, transform
from seerob.waypoints.arm import Arm
from seerob.workstation import Robot

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
UNITS = {1e3: "N·mm read as N·m", 1e-3: "kN·m read as N·m", 100.0: "N·cm read as N·m"}
ROWS = 200
"""Samples whose torques are compared, evenly."""


# -- mathematics --------------------------------------------------------------------------------


class Fit(NamedTuple):
    """A TCP fixed to a flange that explains where it was said to be."""

    offset: Array
    """Of the TCP in the flange [m], shape (3,)."""
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
class SaidTool:
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

    def flange(self, q: Array) -> tuple[Array, Array]:
        """Rotation (..., 3, 3) and position (..., 3) of the flange in the root [m]."""
        posture = self.arm.posture(q)
        return posture.rotation, posture.position

    def off(self, q: Array, said: Array) -> tuple[Array, str, int]:
        """How far the TCP is from where it is said to be [m], shape (N,), at which tip, in which frame.

        Args:
            q: Joint positions [rad or m], shape (N, n).
            said: Of the TCP, as the source has it [m], shape (N, 3).
        """
        rotations, positions = self.flange(q)
        best: tuple[Array, str, int] | None = None
        for k, base in enumerate(self.bases):
            there = said @ base[:3, :3].T + base[:3, 3]
            for name, tip in self.tips.items():
                e = np.linalg.norm(rotations @ tip + positions - there, axis=-1)
                if best is None or e.max() < best[0].max():
                    best = e, name, k
        assert best is not None
        return best

    def doubt(self, sample: JointSample) -> str:
        """Why one sample contradicts the twin; empty when it does not, or says nothing of its TCP."""
        if sample.tcp is None:
            return ""
        error, _, _ = self.off(np.array([sample.q]), np.array([sample.tcp]))
        if error[0] <= self.tolerance:
            return ""
        return (
            f"its source has its own tool centre point {1e3 * error[0]:.0f} mm from the twin's, more than "
            f"{1e3 * self.tolerance:g} mm (tcp_tolerance): another robot, tool or calibration"
        )


def bound(model: Model, name: str) -> SaidTool | None:
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
    return SaidTool(arm, _tips(model, robot, mechanism), np.array(bases), tolerance)


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


class Said(NamedTuple):
    """What a file says of a robot, in its valid rows; None where it says nothing."""

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

    def thinned(self, most: int) -> Said:
        """At most so many rows of it, evenly."""
        step = max(1, -(-len(self.t) // most))
        qd, tau, tcp = (None if x is None else x[::step] for x in (self.qd, self.tau, self.tcp))
        return self._replace(t=self.t[::step], q=self.q[::step], qd=qd, tau=tau, tcp=tcp)


def said_by(samples: Iterable[Sample], file: str) -> Said | None:
    """What a source that was opened says of itself; None when it says nothing but where the joints are."""
    if isinstance(samples, TrajectorySamples):
        motion = samples.trajectory
        if motion.tau is None and motion.tcp_position is None:
            return None
        valid = np.ones(len(motion.t), bool) if motion.invalid is None else ~motion.invalid
        parts = [
            None if x is None else x[valid] for x in (motion.q, samples.qd, motion.tau, motion.tcp_position)
        ]
        assert parts[0] is not None
        t = motion.t[valid] - motion.t[0]
        return Said(file, t, parts[0], parts[1], parts[2], parts[3], motion.tcp_in_base) if len(t) else None
    heard = (s for s in samples if isinstance(s, JointSample))
    first = next(heard, None)
    if first is None or (first.tau is None and first.tcp is None):
        return None
    rows = [s for s in (first, *heard) if s.quality is Quality.GOOD]
    fields = (_table([getattr(s, field) for s in rows]) for field in ("q", "qd", "tau", "tcp"))
    q, qd, tau, tcp = fields
    return None if q is None else Said(file, np.array([s.t for s in rows]), q, qd, tau, tcp, True)


def _table(rows: Sequence[tuple[float, ...] | None]) -> Array | None:
    """Shape (N, n); None unless every row is there."""
    return np.array(rows) if rows and all(row is not None for row in rows) else None


def compared(model: Model, name: str, said: Said) -> Iterator[Finding]:
    """What is found when what a file says of itself is compared with the robot that it drives."""
    robot = bound(model, name)
    if robot is not None and said.tcp is not None:
        yield _about_tool(model, name, robot, said.thinned(MOST))
    if robot is not None and said.tau is not None:
        yield from _about_torques(model, name, said.thinned(ROWS))


def _about_tool(model: Model, name: str, robot: SaidTool, words: Said) -> Finding:
    file, t, q, said = words.file, words.t, words.q, words.tcp
    assert said is not None
    error, tip, _ = robot.off(q, said)
    worst = int(np.argmax(error))
    limit = f"{1e3 * robot.tolerance:g} mm (tcp_tolerance)"
    if error[worst] <= robot.tolerance:
        text = (
            f"{file}: its own tool centre point is where the twin has {tip}, to {1e3 * error[worst]:.1f} mm"
        )
        if tip == FLANGE and len(robot.tips) > 1 and _beside(robot):
            text += ": its controller knows of no tool, and says nothing of the twin's"
        return Finding(level="note", subject=name, text=text)
    rotations, positions = robot.flange(q)
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


def _beside(robot: SaidTool) -> bool:
    """Whether the twin has a tool whose point is not at the flange."""
    return max(float(np.linalg.norm(x)) for x in robot.tips.values()) > robot.tolerance


def _guesses(model: Model, name: str, robot: SaidTool, q: Array, said: Array) -> Iterator[str]:
    """Robots of the library, and tools, that would explain what was said."""
    own = next(r.model for r in model.workstation.robots if r.name == name)
    fits = []
    for other in library.names():
        if f"library:{other}" == own:
            continue
        arm = _arm(library.load(other))
        if arm is None or arm.n != robot.arm.n:
            continue
        error, tip, _ = SaidTool(arm, robot.tips, robot.bases, robot.tolerance).off(q, said)
        if error.max() <= robot.tolerance:
            fits.append(
                (float(error.max()), f"library:{other} would fit, with {tip}, to {1e3 * error.max():.1f} mm")
            )
    if fits:
        # In few postures a tool that is far away would explain the wrong robot.
        yield from (text for _, text in sorted(fits)[:2])
        return
    rotations, positions = robot.flange(q)
    found = [fixed_offset(rotations, positions, said @ b[:3, :3].T + b[:3, 3]) for b in robot.bases]
    best = min(found, key=lambda fit: (round(fit.error, 4), float(np.linalg.norm(fit.offset))))
    if best.error <= robot.tolerance:
        place = ", ".join(f"{1e3 * x + 0.0:.0f}" for x in best.offset.round(4))
        yield (
            f"a tool centre point at [{place}] mm of the flange would fit to {1e3 * best.error:.1f} mm: give "
            "the tool its tcp, or the robot controller_tcp"
        )


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


def _about_torques(model: Model, name: str, said: Said) -> Iterator[Finding]:
    mechanism = model.mechanisms[name]
    criteria = [c for c in (*model.workstation.safety, *model.workstation.ergonomics) if c.by_torque]
    external = any(
        getattr(c, "torques", "") == "external" and _of(model, c.subjects(), mechanism) for c in criteria
    )
    if mechanism.unknown_masses or external:
        return
    assert said.tau is not None
    data = mujoco.MjData(model.mj)
    bias = np.zeros_like(said.tau)
    for i, q in enumerate(said.q):
        data.qpos[mechanism.q_address] = mechanism.coupling @ q + mechanism.offset
        if said.qd is not None:
            data.qvel[mechanism.v_address] = mechanism.coupling @ said.qd[i]
        mujoco.mj_fwdPosition(model.mj, data)
        mujoco.mj_fwdVelocity(model.mj, data)
        bias[i] = mechanism.coupling.T @ data.qfrc_bias[mechanism.v_address]
    wrong = sign_or_unit(said.tau, bias)
    if wrong:
        holds = tuple(c.name for c in criteria if _of(model, c.subjects(), mechanism))
        yield Finding(level="warning", subject=name, text=f"{said.file}: {wrong}", holds=holds)
