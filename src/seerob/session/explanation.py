r"""Does the model explain a log? Inverse dynamics against measured torques, and what would close the gap.

.. math:: \tau_i = (M \ddot q + c + g)_i + Y(q, \dot q, \ddot q)_i\,\varphi
          + F_{c,i}\,\mathrm{sgn}(\dot q_i) + F_{v,i}\,\dot q_i + o_i - d\,\dot{\hat\tau}_i + \varepsilon_i

:math:`\varphi = (m, h, \Sigma)` is a payload on the flange beside what the file has there: its mass, its
first and second moments in the flange's frame.
Torques that a controller filters, or logs a sample later, come :math:`d` after the motion that needs them: it
is taken at that instant, and what is left of the delay is fitted with the rate at which the smooth part
:math:`\hat\tau` of a first fit changes (all but Coulomb's friction), so that it is in every interval.
The equation is linear in all that is fitted: weighted least
squares, weights from the residuals of a first fit, per joint. Errors of neighbouring samples are alike,
so variances are raised by (1 + ρ)/(1 − ρ), ρ their correlation per joint, as residuals of such a fit show it.
Intervals: 95 % by Student's t.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations_with_replacement

import mujoco
import numpy as np
from numpy.typing import NDArray

from seerob.core.errors import InputError
from seerob.core.transforms import Array
from seerob.model.model import Mechanism, Model
from seerob.twin.controller_check import ControllerLog

SLOW = {"rad": 0.02, "m": 0.002}
"""Below it a joint may stick: its friction is anything up to Coulomb's, and its rows are left out."""
HALF_WINDOW = 0.02
"""Accelerations are slopes of the speeds over so long before and after [s], or one sample either way."""
PASSES, SETTLED, LONGEST = 4, 5e-4, 0.1
"""Fits in which the delay of torques is found, at the most; less of it is linear, and more is none [s]."""
MOST = 4000
"""Samples that are used, in stretches that are spread evenly."""
LEAST = 20
"""Samples with a moving joint that a fit needs."""
NORMAL_95 = 1.959964
"""Quantile of the normal distribution: 95 % lie between ± it."""
STUDENT_1 = 12.7062
"""That of Student's distribution with one degree of freedom."""
LARGEST_CONDITION = 1e5
"""Condition number above which a direction of the parameters is not told by the motion [scaled columns]."""
UNEXPLAINED_SHARE = 0.05
"""A joint is explained when what is left is at most this share of its torque limit, or of the largest torque
where nobody knows a limit: about what friction changes by with temperature."""
PAYLOAD = 0.02, 0.1
"""A payload is as the file has it when less than this share of what moves is missing, or so many kg."""
MOMENTS = tuple(combinations_with_replacement(range(3), 2))
POINTS = np.array([[0, 0, 0], *np.eye(3), *-np.eye(3), [1, 1, 0], [1, 0, 1], [0, 1, 1]], float) * 0.1
"""Ten points in the flange's frame whose point masses span all rigid bodies [m], shape (10, 3)."""


# -- mathematics --------------------------------------------------------------------------------


@dataclass(frozen=True)
class Figure:
    """A fitted number."""

    value: float
    half: float
    """Half of the interval in which the true value is with 95 %; infinite when the motion tells nothing."""

    @property
    def determined(self) -> bool:
        """Whether the motion tells it at all."""
        return bool(np.isfinite(self.half))

    def __str__(self) -> str:
        return f"{self.value:.4g} ± {self.half:.2g}" if self.determined else "not told by this motion"


@dataclass(frozen=True, eq=False)
class Fitted:
    """A weighted least-squares fit."""

    values: Array
    """Shape (p,)."""
    covariance: Array
    """Shape (p, p)."""
    determined: Array
    """Which parameters the rows tell, shape (p,), bool."""
    residuals: Array
    """Shape (N, n); NaN where a row was left out."""
    condition: float
    """Of the scaled columns that are told."""


def slopes(t: Array, values: Array, half: float) -> Array:
    """Slope of a straight line through the samples within ``half`` of each instant, at least one either side.

    Args:
        t: [s], shape (N,), increasing, N >= 3.
        values: Shape (N, n).
        half: [s]
    """
    n, half = len(t), half * (1 + 1e-6)  # a step that is the half window but for rounding is in it
    first = np.minimum(np.searchsorted(t, t - half, side="left"), np.arange(n) - 1).clip(0)
    last = np.maximum(np.searchsorted(t, t + half, side="right") - 1, np.arange(n) + 1).clip(None, n - 1)
    origin = t[0]
    x = t - origin
    sums = [
        np.concatenate([[np.zeros_like(a[0])], np.cumsum(a, axis=0)])
        for a in (x, x * x, values, x[:, None] * values)
    ]
    sx, sxx, sy, sxy = (s[last + 1] - s[first] for s in sums)
    count = (last - first + 1).astype(float)
    below = count * sxx - sx**2
    return np.asarray((count[:, None] * sxy - sx[:, None] * sy) / below[:, None])


def friction(qd: Array) -> Array:
    """What Coulomb and viscous friction and an offset add to each torque, per unit, from speeds (N, n).

    Returns:
        Shape (N, n, 3 n): first the Coulomb frictions of all joints, then the viscous ones, then the offsets.
    """
    n = qd.shape[1]
    found = np.zeros((*qd.shape, 3 * n))
    j = np.arange(n)
    found[:, j, j], found[:, j, n + j], found[:, j, 2 * n + j] = np.sign(qd), qd, 1.0
    return found


def fit(columns: Array, measured: Array, used: NDArray[np.bool_]) -> Fitted:
    """Weighted least squares with a variance per joint and correlated neighbours.

    Args:
        columns: Shape (N, n, p).
        measured: Shape (N, n).
        used: Which rows count, shape (N, n), bool.
    """
    p = columns.shape[-1]
    A, b = columns[used], measured[used]
    joint = np.broadcast_to(np.arange(measured.shape[1]), used.shape)[used]
    scale = np.linalg.norm(A, axis=0)
    alive = scale > 0
    scaled = A / np.where(alive, scale, 1.0)
    weights = np.ones(len(b))
    keep, determined = _basis(scaled)
    x = np.zeros(p)
    for _ in range(3):
        W = (scaled * weights[:, None]) @ keep
        # LARGEST_CONDITION bounds the condition, so that its square is far from what a float holds.
        x = keep @ np.linalg.solve(W.T @ W, W.T @ (weights * b))
        r = b - scaled @ x
        sigma = np.array(
            [
                np.sqrt(np.mean(r[joint == j] ** 2)) if (joint == j).any() else 1.0
                for j in range(used.shape[1])
            ]
        )
        weights = 1.0 / np.maximum(sigma[joint], 1e-9)
    residuals = np.full(measured.shape, np.nan)
    residuals[used] = r
    W = (scaled * weights[:, None]) @ keep
    inverse = np.linalg.inv(W.T @ W)
    leverage = ((W @ inverse) * W).sum(axis=1)
    taken = np.array([leverage[joint == j].sum() for j in range(used.shape[1])])
    inflation = _inflation(residuals, taken)[joint]
    alone = float((1 / inflation).sum())  # rows, as many as would say as much if each were alone
    freedom = alone / max(alone - keep.shape[1], 1.0)
    middle = (W * inflation[:, None]).T @ W * freedom
    covariance = keep @ inverse @ middle @ inverse @ keep.T * wider(alone - keep.shape[1]) ** 2
    singular = np.linalg.svd(W, compute_uv=False)
    back = np.where(alive, scale, 1.0)
    return Fitted(
        x / back,
        covariance / np.outer(back, back),
        determined & alive,
        residuals,
        float(singular[0] / singular[-1]),
    )


def _basis(scaled: Array) -> tuple[Array, Array]:
    """Directions of the parameters that the rows tell, shape (p, k); which parameters lie in them wholly."""
    _, s, vt = np.linalg.svd(np.linalg.qr(scaled, mode="r"), full_matrices=True)
    s = np.concatenate([s, np.zeros(vt.shape[0] - len(s))])
    good = s * LARGEST_CONDITION > s[0]
    hidden = (vt[~good] ** 2).sum(axis=0)
    return vt[good].T, hidden < 1e-6


def _inflation(residuals: Array, taken: Array) -> Array:
    r"""How much variances grow because neighbouring residuals are alike, per joint, at least 1, shape (n,).

    What k smooth columns take away of N errors that are alike leaves residuals that are less so: of errors
    with the correlation :math:`\rho`, each takes :math:`g = (1 + \rho)/(1 - \rho)` times its share, and
    :math:`r = (N \rho - k g)/(N - k g)` is seen, which is solved for :math:`\rho`.

    Args:
        residuals: NaN where a row was left out, shape (N, n).
        taken: Columns that were fitted to each joint, as many as its leverages add up to, shape (n,).
    """
    found = []
    for r, k in zip(residuals.T, taken.tolist(), strict=True):
        both = np.isfinite(r[1:]) & np.isfinite(r[:-1])
        if both.sum() < LEAST:
            found.append(1.0)
            continue
        a, b = r[1:][both], r[:-1][both]
        seen = 1 - float((a * b).sum() / max(np.sqrt((a * a).sum() * (b * b).sum()), 1e-300))
        share = k / float(np.isfinite(r).sum())
        middle = seen * (1 + share) / 2
        rho = 1 - middle - np.sqrt(max(middle**2 - 2 * seen * share, 0.0))
        rho = min(max(rho, 0.0), 0.999)
        found.append((1 + rho) / (1 - rho))
    return np.array(found)


def wider(freedom: float) -> float:
    """How much wider an interval of 95 % is of few rows than of many: Student's t, to 2 % from 4 on.

    Of fewer, as of one.
    """
    if freedom < 4:
        return STUDENT_1 / NORMAL_95
    z, v = NORMAL_95, freedom
    return 1 + (z**2 + 1) / (4 * v) + (5 * z**4 + 16 * z**2 + 3) / (96 * v**2)


# -- the robot ----------------------------------------------------------------------------------


class Dynamics:
    """Inverse dynamics of one robot as the file has it, and of a payload on its flange."""

    def __init__(self, model: Model, mechanism: Mechanism) -> None:
        self._mj = model.mj.__copy__()
        self._data = mujoco.MjData(self._mj)
        self._robot = mechanism
        self.flange = model.frames[f"{mechanism.name}/{mechanism.description.tip}"].mj
        points = np.array([[1, *x, *(x[i] * x[j] for i, j in MOMENTS)] for x in POINTS])
        self._of_points = np.linalg.inv(points)

    def _needed(self) -> Array:
        mj, data, found = self._mj, self._data, np.zeros(self._mj.nv)
        mujoco.mj_comPos(mj, data)
        mujoco.mj_comVel(mj, data)
        mujoco.mj_rne(mj, data, 1, found)
        found += mj.dof_armature * data.qacc
        return np.asarray(self._robot.coupling.T @ found[self._robot.v_address])

    def __call__(self, q: Array, qd: Array, qdd: Array) -> tuple[Array, Array]:
        """Torques that the motion needs (N, n) [N·m or N], and of each figure of a payload (N, n, 10)."""
        mj, data, robot = self._mj, self._data, self._robot
        N, n = q.shape
        needed, columns = np.zeros((N, n)), np.zeros((N, n, len(POINTS)))
        own = [x[self.flange].copy() for x in (mj.body_mass, mj.body_ipos, mj.body_inertia)]
        for i in range(N):
            data.qpos[robot.q_address] = robot.coupling @ q[i] + robot.offset
            data.qvel[robot.v_address] = robot.coupling @ qd[i]
            data.qacc[:] = 0.0
            data.qacc[robot.v_address] = robot.coupling @ qdd[i]
            mujoco.mj_kinematics(mj, data)
            needed[i] = self._needed()
            mj.body_mass[self.flange], mj.body_inertia[self.flange] = 0.0, 0.0
            mujoco.mj_kinematics(mj, data)
            empty = self._needed()
            mj.body_mass[self.flange] = 1.0
            for k, point in enumerate(POINTS):
                mj.body_ipos[self.flange] = point
                mujoco.mj_kinematics(mj, data)
                columns[i, :, k] = self._needed() - empty
            mj.body_mass[self.flange], mj.body_ipos[self.flange], mj.body_inertia[self.flange] = own
        # Each point mass is a payload; all payloads are sums of them.
        return needed, columns @ self._of_points.T


@dataclass(frozen=True, eq=False)
class JointExplained:
    """How well a joint's torques are explained."""

    name: str
    unit: str
    mean: float
    """Mean of measured less needed, with the file's model [N·m or N]."""
    rms: float
    largest: float
    """By size."""
    coulomb: Figure
    """[N·m or N]"""
    viscous: Figure
    """[N·m·s/rad or N·s/m]"""
    offset: Figure
    """[N·m or N]"""
    moves: bool
    """Whether it moves in the log; else its friction is not told, and may hold it."""
    left: float
    """Root mean square that the fit leaves [N·m or N]; of a joint that does not move, the payload alone."""
    asked: float
    """What may be left for it to be explained."""
    payload: float
    """Root mean square of what the fitted payload adds, by mass, centre and inertia [N·m or N]."""
    speed: float
    """Largest in the log [rad/s or m/s]."""

    @property
    def driven(self) -> str:
        """Why what was fitted beside a payload is no friction; empty when it may be."""
        if not self.moves:
            return ""
        if self.coulomb.value + self.coulomb.half < 0 and -self.coulomb.value > self.asked / 2:
            return f"Coulomb friction of {self.coulomb} {self.unit} drives it"
        if self.viscous.value + self.viscous.half < 0 and -self.viscous.value * self.speed > self.asked / 2:
            return "its viscous friction is negative: it drives it"
        if abs(self.offset.value) - self.offset.half > self.asked:
            return f"an offset of {self.offset} {self.unit} is no friction"
        return ""


@dataclass(frozen=True, eq=False)
class Explanation:
    """What explains the torques of a log."""

    robot: str
    source: str
    samples: int
    moving: int
    """Samples in which some joint moves."""
    joints: tuple[JointExplained, ...]
    payload: Figure
    """Mass on the flange beside what the file has there [kg]."""
    com: tuple[Figure, Figure, Figure]
    """Its centre of mass in the flange's frame [m]; not told where there is no mass to speak of."""
    carried: float
    """Mass that the file has there [kg]."""
    mass: float
    """Mass of all that the joints move, as the file has it [kg]."""
    delay: Figure
    """By which torques come after the motion that needs them [s]."""
    condition: float

    @property
    def unexplained(self) -> tuple[str, ...]:
        """Joints that move, of which more is left than asked."""
        return tuple(j.name for j in self.joints if j.moves and j.left > j.asked)

    @property
    def held(self) -> tuple[str, ...]:
        """Joints that stand, of which more is left than asked: friction may hold them, or something else."""
        return tuple(j.name for j in self.joints if not j.moves and j.left > j.asked)

    @property
    def misplaced(self) -> tuple[str, ...]:
        """Joints at which what is on the flange weighs as the file has it, and pulls elsewhere than there."""
        return tuple(j.name for j in self.joints if j.payload > j.asked)

    @property
    def driven(self) -> tuple[str, ...]:
        """Joints whose fit needs what is no friction, each with what."""
        return tuple(f"{j.name}: {j.driven}" for j in self.joints if j.driven)

    @property
    def slack(self) -> float:
        """Up to this a mass that is missing does not count [kg]."""
        return max(PAYLOAD[0] * self.mass, PAYLOAD[1])

    @property
    def explains(self) -> bool | None:
        """Whether the model of the file explains the log, friction apart; None when the motion tells not."""
        low, high = self.payload.value - self.payload.half, self.payload.value + self.payload.half
        if self.unexplained or self.misplaced or self.driven or low > self.slack or high < -self.slack:
            return False
        determined = self.payload.determined and max(abs(low), abs(high)) <= self.slack
        return True if determined and not self.held else None


def explain(model: Model, name: str, said: ControllerLog) -> Explanation:
    """Compare measured torques with those that the model needs, and fit what would close the gap.

    Args:
        model: The compiled workstation.
        name: The robot.
        said: What its source says; torques are needed.

    Raises:
        InputError: No torques, too little motion, masses that nobody gave, or a robot that is moved.
    """
    robot = model.robot(name)
    _refuse(model, robot, said)
    assert said.tau is not None
    qd = said.qd if said.qd is not None else slopes(said.t, said.q, HALF_WINDOW)
    qdd = slopes(said.t, qd, HALF_WINDOW)
    rows = spread(len(said.t), MOST)
    t, tau, delay = np.asarray(said.t[rows], float), np.asarray(said.tau[rows]), 0.0
    dynamics, n = Dynamics(model, robot), len(robot.joints)
    slow = np.array([SLOW[unit] for unit in robot.units])
    for _ in range(PASSES):
        since = t - delay
        q, qd_then, qdd_then = (
            _then(said.t, x, since) if delay else np.asarray(x[rows]) for x in (said.q, qd, qdd)
        )
        needed, payload = dynamics(q, qd_then, qdd_then)
        used = (np.abs(qd_then) > slow) & ((since >= said.t[0]) & (since <= said.t[-1]))[:, None]
        moving = int(used.any(axis=1).sum())
        if moving < LEAST:
            what = f"{name} moves in {moving} of {len(rows)} samples: a joint that stands may stick"
            raise InputError.at(
                said.file, "torques", what, f"log a motion in which joints move, {LEAST} samples or more"
            )
        gap = tau - needed
        columns = np.concatenate([payload, friction(qd_then)], axis=-1)
        first = fit(columns, gap, used).values[:-n]
        smooth = needed + payload @ first[: len(POINTS)] + qd_then * first[-n:]
        found = fit(np.concatenate([columns, -slopes(t, smooth, HALF_WINDOW)[..., None]], axis=-1), gap, used)
        more = float(found.values[-1]) if found.determined[-1] else 0.0
        if abs(more) < SETTLED or abs(delay + more) > LONGEST:
            break
        delay += more
    figures = [
        Figure(float(x), float(NORMAL_95 * np.sqrt(max(v, 0.0))) if determined else float("inf"))
        for x, v, determined in zip(found.values, np.diag(found.covariance), found.determined, strict=True)
    ]
    joints, added = [], payload @ found.values[: len(POINTS)]
    for j, joint in enumerate(robot.joints):
        limit = robot.effort_limits[j]
        asked = UNEXPLAINED_SHARE * (float(np.abs(tau[:, j]).max()) if limit is None else limit.value)
        moves = bool(used[:, j].any())
        r = found.residuals[used[:, j], j] if moves else gap[:, j] - added[:, j]
        joints.append(
            JointExplained(
                joint.name,
                "N·m" if robot.units[j] == "rad" else "N",
                float(gap[:, j].mean()),
                float(np.sqrt((gap[:, j] ** 2).mean())),
                float(np.abs(gap[:, j]).max()),
                figures[len(POINTS) + j],
                figures[len(POINTS) + n + j],
                figures[len(POINTS) + 2 * n + j],
                moves=moves,
                left=float(np.sqrt((r**2).mean())),
                asked=asked,
                payload=float(np.sqrt((added[:, j] ** 2).mean())),
                speed=float(np.abs(qd_then[:, j]).max()),
            )
        )
    carried = {model.bodies[i].owner: model.bodies[i].mass for i in robot.carried}
    return Explanation(
        robot=name,
        source=said.file,
        samples=len(rows),
        moving=moving,
        joints=tuple(joints),
        payload=figures[0],
        com=_centre(found, figures),
        carried=sum(mass.value for mass in carried.values() if mass is not None),
        mass=float(model.mj.body_mass[robot.mj_bodies].sum()),
        delay=Figure(delay + figures[-1].value, figures[-1].half),
        condition=found.condition,
    )


def _centre(found: Fitted, figures: list[Figure]) -> tuple[Figure, Figure, Figure]:
    """Centre of mass h / m, its variance to first order."""
    m, vm = found.values[0], found.covariance[0, 0]
    none = Figure(float("nan"), float("inf"))
    if not figures[0].determined or abs(m) <= 2 * figures[0].half:
        return none, none, none
    parts = []
    for k in range(1, 4):
        c = found.values[k] / m
        v = (found.covariance[k, k] - 2 * c * found.covariance[0, k] + c * c * vm) / m**2
        parts.append(
            Figure(float(c), float(NORMAL_95 * np.sqrt(max(v, 0.0)))) if figures[k].determined else none
        )
    return parts[0], parts[1], parts[2]


def _then(t: Array, values: Array, at: Array) -> Array:
    """Values at other instants [s], on straight lines between those that there are, shape (m, n)."""
    return np.stack([np.interp(at, t, column) for column in np.asarray(values).T], axis=1)


def spread(n: int, most: int) -> NDArray[np.int64]:
    """At most so many rows, evenly, and in stretches so that neighbours stay neighbours."""
    if n <= most:
        return np.arange(n, dtype=np.int64)
    stretch, count = most // 20, 20
    starts = np.linspace(0, n - stretch, count).astype(int)
    return np.unique((starts[:, None] + np.arange(stretch)).ravel()).astype(np.int64)


def _refuse(model: Model, robot: Mechanism, said: ControllerLog) -> None:
    if said.tau is None:
        remedy = "log measured torques: actual_current_as_torque of RTDE, measured torques of FRI"
        raise InputError.at(said.file, "torques", f"the source of {robot.name} measures none", remedy)
    if len(said.t) < LEAST:
        raise InputError.at(said.file, "torques", f"{len(said.t)} valid samples", f"log {LEAST} or more")
    robot.require_masses("seerob explain")
    if robot.unknown_masses:
        what = "; ".join(robot.unknown_masses)
        raise InputError.at(said.file, robot.name, what, f"give them in masses of {robot.name}")
    if not robot.alone:
        what = f"{robot.name} is moved, or moves others: what that takes is in its torques"
        raise InputError.at(
            said.file, robot.name, what, "explain a log of the robot alone, in a cell without them"
        )
