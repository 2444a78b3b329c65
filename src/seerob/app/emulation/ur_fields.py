"""Fields of a Universal Robots controller's RTDE: all outputs and inputs, and what an arm says in them.

Names and types are those of the maker's guide and client libraries. What an emulator cannot know (currents,
voltages, temperatures) is made up and listed in `MADE_UP`: plausible, of no robot.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import mujoco
import numpy as np

from seerob.core.transforms import Array, transform, wxyz_from_rotation
from seerob.description.description import Description
from seerob.files.waypoints.arm import Arm
from seerob.model.mounting.specification import Mounting
from seerob.protocols.robots.rtde import Value


def _typed(**names: str) -> dict[str, str]:
    """Name → type, from types and the names that have them, between blanks."""
    return {name: kind for kind, words in names.items() for name in words.split()}


REGISTERS = {
    "{}_bit_registers0_to_31": "UINT32",
    "{}_bit_registers32_to_63": "UINT32",
    **{f"{{}}_bit_register_{k}": "BOOL" for k in range(64, 128)},
    **{f"{{}}_int_register_{k}": "INT32" for k in range(48)},
    **{f"{{}}_double_register_{k}": "DOUBLE" for k in range(48)},
}
"""General purpose registers, of ``input`` and of ``output``."""
OUTPUTS = _typed(
    DOUBLE="timestamp actual_execution_time speed_scaling target_speed_fraction actual_momentum "
    "actual_main_voltage actual_robot_voltage actual_robot_current standard_analog_input0 "
    "standard_analog_input1 standard_analog_output0 standard_analog_output1 io_current euromap67_24V_voltage "
    "euromap67_24V_current tool_analog_input0 tool_analog_input1 tool_output_current tool_temperature "
    "tcp_force_scalar payload joint_position_deviation_ratio collision_detection_ratio",
    VECTOR6D="target_q target_qd target_qdd target_current target_moment actual_q actual_qd actual_current "
    "actual_current_window joint_control_output actual_TCP_pose actual_TCP_speed actual_TCP_force "
    "target_TCP_pose target_TCP_speed joint_temperatures actual_joint_voltage payload_inertia ft_raw_wrench "
    "wrench_calc_from_currents tcp_offset target_base_acceleration",
    VECTOR3D="actual_tool_accelerometer elbow_position elbow_velocity payload_cog target_gravity",
    VECTOR6INT32="joint_mode",
    INT32="robot_mode safety_mode safety_status tool_output_voltage time_scale_source encoder0_raw "
    "encoder1_raw",
    UINT32="runtime_state robot_status_bits safety_status_bits analog_io_types euromap67_input_bits "
    "euromap67_output_bits tool_mode tool_analog_input_types script_control_line",
    UINT64="actual_digital_input_bits actual_digital_output_bits actual_configurable_digital_input_bits "
    "actual_configurable_digital_output_bits",
    UINT8="tool_output_mode tool_digital_output0_mode tool_digital_output1_mode",
) | {name.format(way): kind for way in ("output", "input") for name, kind in REGISTERS.items()}
"""All outputs of a controller, name → type."""

INPUTS = _typed(
    UINT32="speed_slider_mask input_bit_registers0_to_31 input_bit_registers32_to_63",
    DOUBLE="speed_slider_fraction standard_analog_output_0 standard_analog_output_1",
    UINT8="standard_digital_output_mask standard_digital_output configurable_digital_output_mask "
    "configurable_digital_output tool_digital_output_mask tool_digital_output standard_analog_output_mask "
    "standard_analog_output_type",
    VECTOR6D="external_force_torque",
) | {name.format("input"): kind for name, kind in REGISTERS.items()}
"""All inputs that a client may write, name → type."""

MADE_UP: dict[str, Value] = {
    "actual_execution_time": 0.0005,
    "actual_main_voltage": 48.0,
    "actual_robot_voltage": 48.0,
    "actual_robot_current": 1.5,
    "actual_joint_voltage": (48.0,) * 6,
    "actual_current_window": (1.0,) * 6,
    "joint_temperatures": (30.0,) * 6,
    "tool_temperature": 30.0,
    "io_current": 0.02,
    "tool_output_voltage": 0,
    "tool_mode": 253,
}
"""Plausible values of what no motion tells [V, A, °C, s]: those of no robot."""
CONSTANTS = (12.5, 12.5, 12.5, 9.0, 9.0, 9.0)
"""Torque constants [N·m/A], made up as well: the maker publishes none."""
RUNNING = 253
"""Mode of a joint at work."""
GRAVITY = 9.82
"""Of ``target_gravity`` [m/s²], as controllers have it."""
TURNED = np.diag([-1.0, -1.0, 1.0])
"""Half a turn about z: between the base that a controller speaks of and the ``base_link`` of descriptions."""


def defaults(types: Mapping[str, str]) -> dict[str, Value]:
    """What a controller says in fields that nothing sets."""
    empty: dict[str, Value] = {
        "BOOL": False,
        "DOUBLE": 0.0,
        "VECTOR3D": (0.0,) * 3,
        "VECTOR6D": (0.0,) * 6,
        "VECTOR6INT32": (0,) * 6,
        "VECTOR6UINT32": (0,) * 6,
    }
    return {name: MADE_UP.get(name, empty.get(kind, 0)) for name, kind in types.items()} | {
        "joint_mode": (RUNNING,) * 6,
        "target_gravity": (0.0, 0.0, GRAVITY),
    }


class ControllerState:
    """What a controller says of its arm, beside the joints.

    Args:
        description: The arm.
        tcp: How far its tool centre point is ahead of the flange [m].
        payload: What hangs at the flange, as somebody told the controller [kg].
    """

    def __init__(self, description: Description, *, tcp: float = 0.0, payload: float = 0.0) -> None:
        self._arm = Arm(description, link_from_tcp=transform(position=(0.0, 0.0, tcp)))
        self._tcp, self._payload = tcp, payload
        made = Mounting()
        for link in description.links:
            above = None if link.parent is None else f"arm/{link.parent}"
            body = made.body(f"arm/{link.name}", above, link.parent_from_link)
            for joint in link.joints:
                made.joint(body, joint.name, joint)
            if link.inertial is not None:
                made.inertial(body, link.inertial)
            elif link.joints:
                made.massless(body)
        if payload > 0:
            load = made.body("payload", f"arm/{description.tip}", np.eye(4))
            load.explicitinertial, load.mass, load.inertia = True, payload, [1e-6] * 3
        made.option(timestep=0.002, gravity=(0.0, 0.0, -GRAVITY))
        self._mj = made.spec.compile()
        self._data = mujoco.MjData(self._mj)
        still = (0.0,) * self._arm.n
        self(still, still)  # the first is slow, and would be late

    def torques(self, q: tuple[float, ...], qd: tuple[float, ...], qdd: tuple[float, ...]) -> Array:
        """What the joints of the arm need [N·m], by the masses of its description, shape (n,)."""
        data = self._data
        data.qpos[:], data.qvel[:], data.qacc[:] = q, qd, qdd
        mujoco.mj_fwdPosition(self._mj, data)
        mujoco.mj_comVel(self._mj, data)
        found = np.zeros(self._mj.nv)
        mujoco.mj_rne(self._mj, data, 1, found)
        return found

    def _momentum(self) -> float:
        """Of all links at the posture that `torques` was asked for [kg·m/s]."""
        data = self._data
        arm = data.xipos - data.subtree_com[self._mj.body_rootid]
        v = data.cvel[:, 3:] + np.cross(data.cvel[:, :3], arm)
        return float(np.linalg.norm(self._mj.body_mass @ v))

    def __call__(
        self, q: tuple[float, ...], qd: tuple[float, ...], qdd: tuple[float, ...] | None = None
    ) -> dict[str, Value]:
        """Its fields at joint positions [rad] and speeds [rad/s]; the tool in the controller's base."""
        posture = self._arm.posture(q)
        w, *axis = wxyz_from_rotation(TURNED @ posture.rotation).tolist()
        length = math.hypot(*axis)
        turn = 2 * math.atan2(length, w) / length if length > 0 else 0.0
        v, omega = (posture.jacobian() @ qd).reshape(2, 3)
        pose = (*(TURNED @ posture.position).tolist(), *(turn * x for x in axis))
        speed = (*(TURNED @ v).tolist(), *(TURNED @ omega).tolist())
        elbow = posture.anchors[2]
        swept = np.cross(posture.axes[:2], elbow - posture.anchors[:2])
        qdd = (0.0,) * len(q) if qdd is None else qdd
        moment = self.torques(q, qd, qdd)
        current = tuple((moment / np.array(CONSTANTS[: len(q)])).tolist())
        return {
            "actual_TCP_pose": pose,
            "actual_TCP_speed": speed,
            "target_TCP_pose": pose,
            "target_TCP_speed": speed,
            "payload": self._payload,
            "tcp_offset": (0.0, 0.0, self._tcp, 0.0, 0.0, 0.0),
            "elbow_position": tuple((TURNED @ elbow).tolist()),
            "elbow_velocity": tuple((TURNED @ (np.array(qd[:2]) @ swept)).tolist()),
            "actual_momentum": self._momentum(),
            "target_qdd": qdd,
            "target_moment": tuple(moment.tolist()),
            "target_current": current,
            "actual_current": current,
            "joint_control_output": current,
        }
