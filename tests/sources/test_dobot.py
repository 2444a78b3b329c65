"""Dobot controllers: bytes as the maker's own client lays them out, damaged ones, and the twin they drive."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from listening import heard

from seerob.app.emulation.motions import swing
from seerob.app.emulators.dobot import SINCE, DobotServer
from seerob.core.errors import InputError
from seerob.core.samples import JointSample, Quality, SignalSample
from seerob.devices.sources.dobot import Dobot, joint_sample
from seerob.protocols import ProtocolError
from seerob.protocols.robots.dobot import LENGTH, TEST_VALUE, RobotMode, decode
from seerob.workstation.source import Target

SIX = (0.0, 0.3, -1.2, 0.0, 1.2, 0.0)
# Names and types in the order in which the maker's Python client (TCP-IP-Python-V4) reads them.
CLIENT = np.dtype(
    [
        *(("len", "<u2"), ("r0", "V6"), ("di", "<u8"), ("do", "<u8"), ("RobotMode", "<u8"), ("stamp", "<u8")),
        *(("RunTime", "<u8"), ("TestValue", "<u8"), ("r2", "V8"), ("SpeedScaling", "<f8"), ("r3", "V16")),
        *(("v", "<f8"), ("i", "<f8"), ("program", "<f8"), ("in", "<u2"), ("out", "<u2"), ("r4", "V76")),
        *((name, "<f8", 6) for name in ("q*", "qd*", "qdd*", "i*", "m*", "QActual", "QDActual", "IActual")),
        *((name, "<f8", 6) for name in ("force", "ToolVectorActual", "TCPSpeedActual", "tcp", "tool*")),
        *((name, "<f8", 6) for name in ("speed*", "temperatures", "modes", "voltages")),
        *(("hand", "V4"), ("User", "u1"), ("Tool", "u1"), ("queued", "u1"), ("paused", "u1"), ("vj", "u1")),
        *(("aj", "u1"), ("r5", "u1"), ("vx", "u1"), ("vr", "u1"), ("ax", "u1"), ("ar", "u1"), ("r6", "V2")),
        *((n, "u1") for n in ("brakes", "EnableStatus", "DragStatus", "RunningStatus", "ErrorStatus", "jog")),
        *(
            (n, "u1")
            for n in ("type", "b1", "b2", "b3", "b4", "b5", "six", "CollisionState", "a", "a4", "a5")
        ),
        *(("a6", "u1"), ("r7", "V61"), ("vibration", "<f8"), ("command", "<u8"), ("MActual", "<f8", 6)),
        *(("Load", "<f8"), ("centre", "<f8", 3), ("user", "<f8", 6), ("tool", "<f8", 6), ("r8", "V8")),
        *(
            ("SixForceValue", "<f8", 6),
            ("tq", "<f8", 4),
            ("aq", "<f8", 4),
            ("auto", "<u2"),
            ("export", "<u2"),
        ),
        *(("safety", "u1"), ("r9", "V19")),
    ]
)


def frame(**values):
    """As a controller says it, laid out by `CLIENT`."""
    one = np.zeros(1, CLIENT)
    usual = {"len": LENGTH, "TestValue": TEST_VALUE, "RobotMode": 7, "RunTime": 61_234, "SpeedScaling": 50.0}
    usual["EnableStatus"] = 1
    for name, value in {**usual, **values}.items():
        one[name] = value
    return one.tobytes()


def test_every_field_is_where_the_makers_client_has_it():
    assert CLIENT.itemsize == LENGTH
    q, qd, tool = (10.5, -20, 30, -40, 50, -60), (1, 2, 3, 4, 5, 6.5), (100, 200, 300, 1, 2, 3)
    flags = {"EnableStatus": 1, "ErrorStatus": 1, "CollisionState": 1, "User": 2}
    said = decode(frame(QActual=q, QDActual=qd, ToolVectorActual=tool, Load=1.5, **flags))
    assert (said.positions, said.speeds, said.tool, said.payload) == (q, qd, tool, 1.5)
    assert (said.mode, said.time, said.speed_scaling) == (7, 61.234, 50.0)
    assert (said.user_frame, said.enabled, said.alarm, said.collision) == (2, True, True, True)
    assert (said.dragged, said.running) == (False, False)
    for name, there in {"DragStatus": (True, False), "RunningStatus": (False, True)}.items():
        flag = decode(frame(**{name: 1}))
        assert (flag.dragged, flag.running) == there
    sample = joint_sample(said, target="arm", arrived=3.0)
    assert sample.q == pytest.approx(np.radians(q))
    assert sample.qd == pytest.approx(np.radians(qd))
    assert (sample.t, sample.t_device, sample.tcp, sample.tau) == (3.0, 61.234, None, None)
    in_base = joint_sample(decode(frame(ToolVectorActual=tool)), target="arm", arrived=0.0)
    assert in_base.tcp == pytest.approx((0.1, 0.2, 0.3))


@pytest.mark.parametrize(
    ("mode", "quality"),
    [
        (RobotMode.INITIALIZING, Quality.INVALID),
        (RobotMode.POWER_OFF, Quality.INVALID),
        (RobotMode.BRAKES_OPEN, Quality.DEGRADED),
        (RobotMode.DISABLED, Quality.DEGRADED),
        (RobotMode.ALARM, Quality.DEGRADED),
        (0, Quality.DEGRADED),
        (99, Quality.DEGRADED),
        (RobotMode.ENABLED, Quality.GOOD),
        (RobotMode.PAUSED, Quality.GOOD),
        (RobotMode.COLLISION, Quality.GOOD),
    ],
)
def test_a_robot_that_may_be_elsewhere_is_not_relied_on(mode, quality):
    assert joint_sample(decode(frame(RobotMode=mode)), target="arm", arrived=0.0).quality is quality


@pytest.mark.parametrize("said", [{"EnableStatus": 0}, {"ErrorStatus": 1}])
def test_a_robot_that_contradicts_its_mode_is_not_relied_on(said):
    for mode in (RobotMode.RUNNING, RobotMode.ENABLED, RobotMode.DRAGGED, RobotMode.SINGLE_MOVE):
        sample = joint_sample(decode(frame(RobotMode=mode, **said)), target="arm", arrived=0.0)
        assert sample.quality is Quality.DEGRADED


@pytest.mark.parametrize(
    "data",
    [
        b"",
        frame()[:-1],
        frame(len=1439),
        frame(TestValue=0),
        frame(RunTime=0),
        struct.pack("<H", LENGTH) * 720,
    ],
)
def test_what_is_none_of_its_messages_is_refused(data):
    with pytest.raises(ProtocolError):
        decode(data)


def test_a_controller_is_heard_over_its_socket():
    motion = swing(SIX)
    with DobotServer(motion, payload=2.0) as server:
        samples = heard(Dobot(robot="arm", host="127.0.0.1", port=server.port), lambda s: len(s) > 20)
    joints = [s for s in samples if isinstance(s, JointSample)]
    for sample in joints:
        q, qd = motion(sample.t_device - SINCE)
        assert sample.q == pytest.approx(q, abs=1e-9)
        assert sample.qd == pytest.approx(qd, abs=1e-9)
        assert sample.payload == 2.0
        assert sample.quality in (Quality.GOOD, Quality.LATE)  # a loaded machine reads late
    assert any(sample.quality is Quality.GOOD for sample in joints)
    told = next(s for s in samples if isinstance(s, SignalSample)).values
    assert (told["robot_mode"], told["enabled"], told["speed_scaling"]) == ("running", True, 1.0)


def test_an_arm_of_another_number_of_joints_is_refused(tmp_path):
    seven = Target(name="arm", joints=tuple("abcdefg"), units=("rad",) * 7)
    with pytest.raises(InputError, match="6"):
        Dobot(robot="arm", host="127.0.0.1").open(tmp_path, seven)
