"""A tree of joints followed alone is where MuJoCo has it, with the same Jacobians and masses."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from seerob.twin.trees import Tree

BRANCHED = """
<mujoco>
  <compiler angle="radian"/>
  <worldbody>
    <body name="floor"><geom size="0.1"/></body>
    <body name="base" pos="0.4 -2 0.3" quat="0.9 0.1 -0.3 0.2">
      <inertial pos="0.1 0 0" mass="4" diaginertia="0.1 0.2 0.3"/>
      <body name="cart" pos="0.2 0 0.1" quat="0.7 0 0.7 0.1">
        <joint type="slide" axis="1 2 0.5" armature="0.7" ref="0.2"/>
        <inertial pos="0 0.2 0.1" quat="0.8 0.5 0 0" mass="3" diaginertia="0.1 0.15 0.2"/>
        <body name="plate" pos="0 0.3 0.1" quat="0.6 0 0 0.8">
          <inertial pos="0.05 0 0.1" quat="0.5 0.5 0.1 0" mass="1.5" diaginertia="0.02 0.03 0.04"/>
          <body name="arm" pos="0.1 0.1 0.4">
            <joint axis="0.3 1 -0.2" pos="0.05 -0.1 0.2" armature="0.3" ref="-0.4"/>
            <inertial pos="0.3 0 0.1" mass="2" diaginertia="0.05 0.06 0.07"/>
            <body name="left" pos="0 0 0.5" quat="0.5 0.5 -0.5 0.5">
              <joint axis="1 0 0"/>
              <inertial pos="0 0.1 0" mass="0.7" diaginertia="0.01 0.02 0.02"/>
            </body>
            <body name="right" pos="0.1 0 0.5">
              <joint type="slide" axis="0 1 0"/>
              <inertial pos="0 0 0.2" mass="0.4" diaginertia="0.01 0.01 0.01"/>
            </body>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""
POINT = np.array([0.1, -0.2, 0.3])


def test_jacobians_and_masses_are_those_of_mujoco() -> None:
    mj = mujoco.MjModel.from_xml_string(BRANCHED)
    data, M = mujoco.MjData(mj), np.zeros((mj.nv, mj.nv))
    tree = Tree.of(mj, mj.body("base").id)
    assert tree is not None
    q, dofs = np.random.default_rng(3).uniform(-2, 2, (12, mj.nq)), np.array([3, 0, 1, 2])
    followed = tree.follow(q)
    masses, some = followed.mass_matrix(dofs), followed.mass_matrix(dofs[:2])
    for k in range(len(q)):
        data.qpos[:] = q[k]
        mujoco.mj_kinematics(mj, data)
        mujoco.mj_comPos(mj, data)
        mujoco.mj_makeM(mj, data)
        mujoco.mj_fullM(mj, data, M)
        assert masses[k] == pytest.approx(M[np.ix_(dofs, dofs)], abs=1e-13)
        assert (some[k] == masses[k][:2, :2]).all()
        for name in ("base", "cart", "plate", "arm", "left", "right"):
            body, J = mj.body(name).id, np.zeros((6, mj.nv))
            point = data.xpos[body] + data.xmat[body].reshape(3, 3) @ POINT
            mujoco.mj_jac(mj, data, J[:3], J[3:], point, body)
            assert followed.jacobian(body, POINT, dofs)[k] == pytest.approx(J[:, dofs], abs=1e-13)


@pytest.mark.parametrize(
    "joints",
    ['<joint type="ball"/>', "<freejoint/>", '<joint axis="1 0 0"/><joint axis="0 1 0"/>'],
)
def test_other_joints_are_left_to_mujoco(joints: str) -> None:
    body = f'<body name="base">{joints}<geom size="0.1"/></body>'
    mj = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{body}</worldbody></mujoco>")
    assert Tree.of(mj, mj.body("base").id) is None
