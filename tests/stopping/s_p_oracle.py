"""S_p from the integrals of ISO/TS 15066:2016 5.5.4.2.3, by Pinocchio and sums: ``from s_p_oracle import …``.

.. math:: S_p(t_0) = v_h (\\tau + T_s) + \\int_{t_0}^{t_0 + \\tau} v_r\\,dt + S_s + K

of the fastest corner of each box of a random chain, for a stop that begins at any :math:`\\tau \\le T_r`.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

T_R, T_S, DECELERATION, V_H, K = 0.06, 0.15, 12.0, 1.6, 0.3
STEP = 2.5e-4
"""Of the sums [s]; what they miss is on the side of the product."""


class Chain:
    """A chain of boxes behind joints that turn and slide about any axes."""

    def __init__(self, rng, *, turning=False):
        n = int(rng.integers(1, 6))
        self.slides = (rng.random(n) < 0.25) & (not turning)
        links, joints, self.boxes = ['<link name="base"/>'], [], []
        for k in range(n):
            x, size = rng.normal(size=3) * 0.2, rng.uniform(0.02, 0.4, 3)
            self.boxes.append((x, size))
            where = f'<origin xyz="{x[0]} {x[1]} {x[2]}"/>'
            links.append(
                f'<link name="l{k}"><inertial>{where}<mass value="{rng.uniform(0.5, 4)}"/>'
                '<inertia ixx="0.02" iyy="0.03" izz="0.04" ixy="0" ixz="0" iyz="0"/></inertial>'
                f'<collision>{where}<geometry><box size="{size[0]} {size[1]} {size[2]}"/></geometry>'
                "</collision></link>"
            )
            at, turn, axis = rng.normal(size=3) * 0.3, rng.normal(size=3), rng.normal(size=3)
            axis /= np.linalg.norm(axis)
            joints.append(
                f'<joint name="j{k}" type="{"prismatic" if self.slides[k] else "revolute"}">'
                f'<parent link="{f"l{k - 1}" if k else "base"}"/><child link="l{k}"/>'
                f'<origin xyz="{at[0]} {at[1]} {at[2]}" rpy="{turn[0]} {turn[1]} {turn[2]}"/>'
                f'<axis xyz="{axis[0]} {axis[1]} {axis[2]}"/>'
                '<limit lower="-99" upper="99" effort="1e5" velocity="60"/></joint>'
            )
        self.urdf = f'<robot name="chain">{"".join(links + joints)}</robot>'
        self._model = pin.buildModelFromXML(self.urdf)
        self._data = self._model.createData()
        signs = np.array(np.meshgrid(*[(-0.5, 0.5)] * 3)).reshape(3, -1).T
        self._corners = [x + signs * size for x, size in self.boxes]

    def corners(self, q, qd):
        """Velocity of each corner of each box [m/s], shape (n, 8, 3)."""
        pin.forwardKinematics(self._model, self._data, q, qd)
        found = []
        for k, corners in enumerate(self._corners):
            R, v = self._data.oMi[k + 1].rotation, self._data.v[k + 1]
            found.append((v.linear + np.cross(v.angular, corners)) @ R.T)
        return np.array(found)

    def places(self, q):
        """Of each corner of each box [m], shape (n, 8, 3)."""
        pin.forwardKinematics(self._model, self._data, q)
        every = ((self._data.oMi[k + 1], corners) for k, corners in enumerate(self._corners))
        return np.array([corners @ M.rotation.T + M.translation for M, corners in every])

    def speeds(self, q, qd):
        """Of the fastest corner of each box at instants [m/s], shape (m, n)."""
        every = [self.corners(a, b) for a, b in zip(q, qd, strict=True)]
        return np.linalg.norm(every, axis=-1).max(axis=-1)


def knots(rng, kind, n, end):
    """Instants, positions and velocities between which joints move along cubics, shapes (m,) and (m, n)."""
    t = np.cumsum(rng.uniform(0.002, 0.03, int(end / 0.002)))
    t = np.concatenate([[0.0], t[t < end], [end]])
    step, size = np.diff(t)[:, None], 10 ** rng.uniform(-0.5, 0.7)
    shape = (len(step), n)
    if kind == "bang-bang":
        a = size * 10 * np.where(rng.random(shape) < 0.5, -1, 1)
    elif kind == "turning":
        a = size * rng.normal(size=shape) * 20
    elif kind == "bursts":
        a = size * 60 * rng.normal(size=shape) * (rng.random(shape) < 0.15)
    else:
        a = size * 5 * rng.normal(size=shape)
    qd = np.vstack([np.zeros(n), np.cumsum(a * step, axis=0)]) + rng.normal(size=n) * size * 0.3
    q = np.vstack([np.zeros(n), np.cumsum(step * (qd[1:] + qd[:-1]) / 2, axis=0)])
    if kind == "bulging":
        # Extremes inside, at 0.37 of spans among others: what velocities at both ends do not show.
        q[1:] += np.cumsum(step * rng.normal(size=shape) * size * 0.1, axis=0)
    return t, q + rng.normal(size=n), qd


def cubic(t, q, qd, at):
    """Positions and velocities on the cubics through knots, shapes (m, n)."""
    k = np.clip(np.searchsorted(t, at, side="right") - 1, 0, len(t) - 2)
    T = (t[k + 1] - t[k])[:, None]
    x = (at[:, None] - t[k][:, None]) / T
    a, b, va, vb = q[k], q[k + 1], qd[k] * T, qd[k + 1] * T
    h = np.array([2 * x**3 - 3 * x**2 + 1, x**3 - 2 * x**2 + x, 3 * x**2 - 2 * x**3, x**3 - x**2])
    d = np.array([6 * x**2 - 6 * x, 3 * x**2 - 4 * x + 1, 6 * x - 6 * x**2, 3 * x**2 - 2 * x])
    return h[0] * a + h[1] * va + h[2] * b + h[3] * vb, (d[0] * a + d[1] * va + d[2] * b + d[3] * vb) / T


def required(v, model, v_h=V_H):
    """S_p of parts at each instant from their speeds at steps of `STEP`, shape (m - T_R / STEP, n)."""
    lead = round(T_R / STEP)
    way = np.concatenate([np.zeros((1, v.shape[1])), np.cumsum((v[1:] + v[:-1]) / 2 * STEP, axis=0)])
    found = []
    for k in range(len(v) - lead):
        onset = v[k : k + lead + 1]
        T_s = np.full(lead + 1, T_S) if model != "by deceleration" else onset.max(axis=1) / DECELERATION
        share = 1.0 if model == "bound" else 0.5
        tau = np.arange(lead + 1) * STEP
        person = v_h * (tau + T_s)
        every = person[:, None] + way[k : k + lead + 1] - way[k] + share * onset * T_s[:, None] + K
        found.append(every.max(axis=0))
    return np.array(found)


def required_by_joints(chain, t, q, qd, rates):
    """S_p at each instant where each joint brakes by itself with a rate of its own [rad/s²], by sums.

    Args:
        chain: Of joints that turn.
        t: Instants at steps of `STEP`, shape (m,).
        q: Positions then, shape (m, n).
        qd: Velocities, likewise.
        rates: Shape (n,).

    Returns:
        Shape (m - T_R / STEP, n).
    """
    lead, v = round(T_R / STEP), chain.speeds(q, qd)
    way = np.concatenate([np.zeros((1, v.shape[1])), np.cumsum((v[1:] + v[:-1]) / 2 * STEP, axis=0)])
    stops, times = np.zeros_like(way), np.abs(qd / rates).max(axis=1)
    for k in range(len(t)):
        after = np.linspace(0, times[k], 25)[:, None]
        left = np.maximum(np.abs(qd[k]) - rates * after, 0.0)
        turned = np.sign(qd[k]) * (qd[k] ** 2 - left**2) / (2 * rates)
        corners = [chain.places(q[k] + each) for each in turned]
        stops[k] = np.linalg.norm(np.array(corners) - chain.places(q[k]), axis=-1).max(axis=(0, 2))
    found = []
    for k in range(len(t) - lead):
        tau = np.arange(lead + 1) * STEP
        onset = slice(k, k + lead + 1)
        every = V_H * (tau + times[onset])[:, None] + way[onset] - way[k] + stops[onset] + K
        found.append(every.max(axis=0))
    return np.array(found)
