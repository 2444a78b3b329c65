"""ABB controllers that stream positions: bytes as the maker's definitions have them, compiled by others."""

from __future__ import annotations

import asyncio
import contextlib
import math

import numpy as np
import pytest
from abb_robot_client._egm_protobuf import egm_pb2
from abb_robot_client.egm import EGM
from hypothesis import given
from hypothesis import strategies as st

from free_ports import free_port
from live_story import Story, lived, wait_for
from made_cell import made
from seerob.app.emulators.egm import EPOCH, EgmServer
from seerob.core.errors import InputError
from seerob.core.samples import JointSample, SignalSample
from seerob.devices.live.device_clock import RESTART_HOLD, SETTLED, DeviceClock
from seerob.devices.live.differentiation import Differentiator
from seerob.devices.live.listening import Listener
from seerob.devices.sources.egm import GUIDED, Egm
from seerob.protocols import ProtocolError
from seerob.protocols.robots import abb_egm
from seerob.protocols.robots.abb_egm import Message, MotionState, MotorState, RapidState
from seerob.workstation.source import Target

HOME, AMPLITUDE = np.array([0, 0.5, 0.2, -0.4, 0.1, 1.2]), np.array([0.4, 0.2, 0.3, 0.2, 0.4, 0.3])
NUMBERS = st.floats(-1e6, 1e6)


def motion(t):
    return tuple((HOME + AMPLITUDE * np.sin(t)).tolist()), tuple((AMPLITUDE * np.cos(t)).tolist())


def foreign(**more):
    """A message of the maker's definitions."""
    said = egm_pb2.EgmRobot()
    said.header.seqno, said.header.tm, said.header.mtype = 7, 12_345, more.pop("kind", 2)
    said.feedBack.joints.joints.extend(more.pop("joints", (1.0, -2.0, 3.5, 0.0, 90.0, 180.0)))
    assert not more
    return said


def cell(folder, port):
    return made(
        folder,
        '[[robots]]\nname = "arm"\nmodel = "library:crb15000_5_95"\n'
        '[[sources]]\nkind = "egm"\nname = "controller"\nrobot = "arm"\nhost = "127.0.0.1"\n'
        f"port = {port}\ntimeout = 0.2\n"
        '[[safety]]\nkind = "velocity"\nname = "speed"\nat = "arm"\nlimit = 1.5\n',
    )


# -- against the maker's definitions, compiled by others ----------------------------------------


@given(
    st.integers(0, 2**32 - 1),
    st.integers(1, 2**31),
    st.integers(0, 999_999),
    st.lists(NUMBERS, min_size=1, max_size=7),
    st.lists(NUMBERS, max_size=6),
    st.sampled_from(MotorState),
    st.sampled_from(MotionState),
    st.sampled_from(RapidState),
    st.booleans(),
)
def test_what_others_write_is_read(number, seconds, micro, joints, external, motors, motion, program, on):
    said = egm_pb2.EgmRobot()
    said.header.seqno, said.header.tm, said.header.mtype = number, 5, 2
    measured = said.feedBack
    measured.joints.joints.extend(joints)
    measured.externalJoints.joints.extend(external)
    measured.time.sec, measured.time.usec = seconds, micro
    place, turn = measured.cartesian.pos, measured.cartesian.orient
    place.x, place.y, place.z = 100.0, -20.5, 3.0
    turn.u0, turn.u1, turn.u2, turn.u3 = 1.0, 0.0, 0.0, 0.0
    said.planned.joints.joints.extend([-x for x in joints])
    said.motorState.state, said.mciState.state, said.rapidExecState.state = motors, motion, program
    said.measuredForce.fcActive = on
    said.measuredForce.force.extend([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    said.mciConvergenceMet, said.utilizationRate, said.moveIndex = True, 42.5, 3
    found = abb_egm.decode(said.SerializeToString())
    assert found == Message(
        sequence=number,
        time=seconds + 1e-6 * micro,
        joints=tuple(joints),
        external=tuple(external),
        tool=(100.0, -20.5, 3.0),
        motors=motors,
        motion=motion,
        program=program,
        force=(1.0, 2.0, 3.0, 4.0, 5.0, 6.0) if on else (),
        utilization=42.5,
    )


def test_a_message_without_a_clock_counts_as_of_its_header():
    assert abb_egm.decode(foreign().SerializeToString()).time == pytest.approx(12.345)


def test_a_receiver_of_others_hears_the_emulated_controller():
    port = free_port()
    receiver = EGM(port)
    with receiver.socket, EgmServer(motion, to=("127.0.0.1", port)):
        for _ in range(5):
            fine, state = receiver.receive_from_robot(60.0)
            assert fine
            assert state.motors_on
            assert state.rapid_running
            clock = state.robot_message.feedBack.time
            t = clock.sec + 1e-6 * clock.usec - EPOCH
            np.testing.assert_allclose(np.radians(state.joint_angles), motion(t)[0], atol=1e-6)


# -- what is heard ------------------------------------------------------------------------------


@pytest.mark.parametrize("clock", [True, False])
def test_the_twin_follows_the_robot(tmp_path, clock):
    port = free_port()
    with EgmServer(motion, to=("127.0.0.1", port), clock=clock):
        story = lived(cell(tmp_path, port), Story(120, Story.seen_enough))
    since = EPOCH if clock else 0.0
    joints = [sample for sample in story.joints() if sample.qd]
    assert len(joints) > 10
    for sample in joints:
        np.testing.assert_allclose(sample.q, motion(sample.t_device - since)[0], atol=2e-6)
    speeds = [np.abs(np.subtract(motion(s.t_device - since)[1], s.qd)).max() for s in joints]
    assert np.median(speeds) < 1e-2
    assert "within" in story.verdicts()


def test_silence_is_undecided_and_the_robot_is_followed_again(tmp_path):
    port = free_port()
    server = EgmServer(motion, to=("127.0.0.1", port)).start()
    story = Story(260, at_40=server.stop, at_100=server.start)
    try:
        lived(cell(tmp_path, port), story)
    finally:
        server.stop()
    verdicts = story.verdicts()
    assert set(verdicts[story.lost(40) : 100]) == {"undecided"}
    assert "within" in verdicts[100:]
    assert story.fastest(100) < 1.5


def test_states_are_signals_and_a_guided_motion_is_told():
    port, heard = free_port(), []
    source = Egm(robot="arm", host="127.0.0.1", port=port)
    with EgmServer(motion, to=("127.0.0.1", port)) as server:
        listener = Listener(source, None, heard.append)
        listener.start()
        said = lambda: [s.values for s in heard if isinstance(s, SignalSample)]  # noqa: E731
        try:
            wait_for(said)
            server.guided = MotionState.RUNNING
            wait_for(lambda: said()[-1]["guided_motion"] == "running")
        finally:
            listener.ask_to_stop()
            assert listener.join(10.0)
        assert said()[0] == {"motors": "on", "guided_motion": "stopped", "program": "running"}
        assert any(isinstance(sample, JointSample) for sample in heard)
        assert GUIDED in {finding.text for finding in asyncio.run(source.ask())}


def test_a_robot_of_other_joints_is_refused(tmp_path):
    source = Egm(robot="arm", host="127.0.0.1")
    with pytest.raises(InputError, match="7"):
        source.open(tmp_path, Target(name="arm", joints=tuple("abcdefg"), units=("rad",) * 7))


# -- what is no message -------------------------------------------------------------------------


def test_what_no_controller_sends_is_refused_with_the_reason():
    sensor = egm_pb2.EgmSensor()
    sensor.header.seqno, sensor.header.mtype = 1, 3
    sensor.planned.joints.joints.extend([0.0] * 6)
    for raw, reason in (
        (b"", "without header"),
        (sensor.SerializeToString(), "kind 3"),
        (foreign(kind=1).SerializeToString(), "kind 1"),
        (foreign(joints=()).SerializeToString(), "no measured joints"),
        (foreign(joints=(0.0,) * 33).SerializeToString(), "at most 32"),
        (bytes(abb_egm.LARGEST + 1), "at most 4096"),
        (foreign().SerializeToString() + b"\x52\x00", "field 10 holds 0 numbers"),
    ):
        with pytest.raises(ProtocolError, match=reason):
            abb_egm.decode(raw)


def test_nothing_is_within_by_joints_that_are_no_numbers(tmp_path):
    port = free_port()

    def broken(t):
        return (math.nan, *motion(t)[0][1:]), motion(t)[1]

    with EgmServer(broken, to=("127.0.0.1", port)):
        story = lived(cell(tmp_path, port), Story(60))
    assert story.joints()
    assert set(story.verdicts()) == {"undecided"}


@given(st.binary(max_size=200), st.integers(0, 400), st.binary(max_size=8))
def test_damaged_bytes_are_a_message_or_a_sentence(raw, at, some):
    whole = abb_egm.encode(Message(1, 1000.0, (0.0,) * 6, (1.0,), (1.0, 2.0, 3.0), force=(1.0,) * 6))
    for damaged in (
        raw,
        whole[:at],
        whole[:at] + some + whole[at:],
        whole[:at] + some + whole[at + len(some) :],
    ):
        with contextlib.suppress(ProtocolError):
            assert 0 < len(abb_egm.decode(damaged).joints) <= abb_egm.MOST


def test_milliseconds_that_begin_anew_after_49_days_are_doubted_for_a_moment_and_make_no_speed():
    clock, slope, doubts, speeds = DeviceClock(), Differentiator(5 * abb_egm.PERIOD), [], []
    for k in range(2000):
        t = 2**32 / 1000 - 4 + k * abb_egm.PERIOD
        said = abb_egm.decode(abb_egm.encode(Message(k, t, (0.25 * k,) * 6), clock=False))
        heard = clock.hear(said.time, 100 + k * abb_egm.PERIOD, hash(said.joints), forgeable=True)
        assert heard.t == pytest.approx(100 + k * abb_egm.PERIOD, abs=SETTLED)
        doubts.append(bool(heard.invalid_reason))
        speeds += slope.add(said.time, said.joints) or ()
    # 250 in a second, by milliseconds, and 2.5 s of doubt.
    np.testing.assert_allclose(speeds, 0.25 / abb_egm.PERIOD, rtol=1e-6)
    assert doubts == [1000 <= k <= 1000 + RESTART_HOLD / abb_egm.PERIOD for k in range(2000)]
