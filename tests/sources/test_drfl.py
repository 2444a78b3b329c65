"""The bridge of Doosan controllers: its message, its C++ program, and the twin that it drives."""

from __future__ import annotations

import shutil
import socket
import struct
import subprocess
import zlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from live_story import Story, lived, wait_for
from made_cell import made
from seerob.app import cli
from seerob.app.emulators.drfl import Drfl as DrflOptions
from seerob.app.emulators.drfl import DrflSender
from seerob.core.errors import InputError
from seerob.core.samples import JointSample, Quality, SignalSample
from seerob.devices.live.listening import Listener
from seerob.devices.sources.drfl import Drfl, is_older, joint_sample, states
from seerob.protocols import ProtocolError
from seerob.protocols.robots.doosan_drfl import LENGTH, Message, RobotState, decode, encode

BRIDGE = Path(__file__).resolve().parents[2] / "bridges/doosan_drfl"
HOME, AMPLITUDE = np.array([0, -1.2, 1.4, -1.5, -1.5, 0]), np.array([0.4, 0.2, 0.3, 0.2, 0.4, 0.3])

STAND_IN = """
#include <string>
struct RT_OUTPUT_DATA_LIST {
    double time_stamp;
    float actual_joint_position[6], actual_joint_velocity[6], actual_joint_torque[6];
    float external_joint_torque[6];
    unsigned char robot_mode, robot_state;
    unsigned short control_mode;
};
typedef RT_OUTPUT_DATA_LIST* LPRT_OUTPUT_DATA_LIST;
namespace DRAFramework {
class CDRFLEx {
public:
    bool open_connection(std::string host, unsigned int port) { return host == "192.0.2.1" && port == 12345; }
    bool close_connection() { return true; }
    bool connect_rt_control(std::string, unsigned int port) { return port == 12347; }
    bool disconnect_rt_control() { return true; }
    bool set_rt_control_output(std::string version, float, int) { return version == "v1.0"; }
    bool start_rt_control() { return true; }
    bool stop_rt_control() { return true; }
    LPRT_OUTPUT_DATA_LIST read_data_rt() {
        // Every sample is handed out twice.
        data_.time_stamp = 0.01 * (calls_++ / 2);
        for (int k = 0; k < 6; ++k) {
            data_.actual_joint_position[k] = 10.5f * k - 20;
            data_.actual_joint_velocity[k] = -1.25f * k;
            data_.actual_joint_torque[k] = 3.5f * k;
            data_.external_joint_torque[k] = 0.5f;
        }
        data_.robot_mode = 1;
        data_.robot_state = 2;
        data_.control_mode = 770;
        return &data_;
    }
private:
    RT_OUTPUT_DATA_LIST data_;
    int calls_ = 0;
};
}
"""


def motion(t):
    return tuple((HOME + AMPLITUDE * np.sin(t)).tolist()), tuple((AMPLITUDE * np.cos(t)).tolist())


def message(**more):
    six = tuple(range(6))
    plain = Message(7, 1.5, six, six, six, (0.0,) * 6, 1, RobotState.MOVING, 0)
    return plain._replace(**more)


@pytest.fixture
def port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        return free.getsockname()[1]


def cell(folder, port, robot="ur10"):
    return made(
        folder,
        f'[[robots]]\nname = "arm"\nmodel = "library:{robot}"\n'
        f'[[sources]]\nkind = "drfl"\nrobot = "arm"\nport = {port}\n'
        '[[safety]]\nkind = "velocity"\nname = "speed"\nat = "arm"\nlimit = 1.5\n',
    )


# -- the message --------------------------------------------------------------------------------

SIX = st.tuples(*[st.floats(width=32, allow_nan=False)] * 6)


@given(SIX, SIX, st.none() | SIX, st.integers(0, 255), st.integers(0, 2**32 - 1))
def test_what_is_written_is_read(positions, speeds, torques, state, number):
    sent = message(number=number, positions=positions, speeds=speeds, torques=torques, state=state)
    assert decode(encode(sent)) == sent


def test_bytes_are_where_the_layout_says():
    data = encode(message())
    assert len(data) == LENGTH == 128
    assert data[:8] == b"SRDF\x01\x00\x80\x00"
    assert struct.unpack_from("<d", data, 16) == (1.5,)
    assert struct.unpack_from("<6f", data, 48) == tuple(range(6))
    assert (data[120], data[121]) == (1, 2)
    assert struct.unpack_from("<I", data, 124) == (zlib.crc32(data[:124]),)


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (b"", "not a message"),
        (b"SRDF", "4 bytes"),
        (b"SRDF\x02\x00" + bytes(122), "version 2"),
        (encode(message())[:-1], "127 bytes"),
        (encode(message()) + b"\0", "129 bytes"),
        (encode(message())[:50] + b"\xff" + encode(message())[51:], "damaged"),
    ],
)
def test_messages_that_are_none(data, says):
    with pytest.raises(ProtocolError, match=says):
        decode(data)


@given(st.integers(0, 127), st.integers(0, 7))
def test_no_flipped_bit_is_read_as_another_sample(byte, bit):
    data = bytearray(encode(message()))
    data[byte] ^= 1 << bit
    with pytest.raises(ProtocolError):
        decode(bytes(data))


@given(st.binary(max_size=200))
def test_nothing_else_is_a_message(data):
    with pytest.raises(ProtocolError):
        decode(data)


@pytest.mark.parametrize(
    ("state", "quality"),
    [(2, Quality.GOOD), (3, Quality.DEGRADED), (15, Quality.INVALID), (77, Quality.INVALID)],
)
def test_samples_are_in_si_and_say_what_they_are_worth(state, quality):
    sample = joint_sample(message(state=state, positions=(180.0,) * 6), target="arm", arrived=0.0)
    assert sample.q == pytest.approx((np.pi,) * 6)
    assert sample.qd == pytest.approx(np.radians(range(6)))
    assert sample.quality == quality
    assert states(message(state=6))["emergency_stop"] is True


def test_what_was_overtaken_is_left_out_and_a_new_bridge_is_not():
    newest = message(number=10, time=1.0)
    late = [is_older(message(number=k, time=0.1 * k), newest) for k in (9, 10, 11)]
    assert late == [True, True, False]
    assert not is_older(message(number=0, time=0.0), newest)
    assert not is_older(message(number=5, time=1.2), newest)
    assert not is_older(message(number=2, time=1.0), message(number=2**32 - 1, time=1.0))


def test_messages_that_come_twice_or_out_of_order_are_heard_once_and_in_order(port):
    held = []

    def way(data):
        held.append(data)
        return () if len(held) % 2 else (held[-1], held[-2], held[-1])

    heard = []
    listener = Listener(Drfl(robot="arm", port=port), None, heard.append)
    listener.start()
    try:
        with DrflSender(motion, to=("127.0.0.1", port), way=way):
            wait_for(lambda: sum(isinstance(s, JointSample) for s in heard) > 20)
    finally:
        listener.ask_to_stop()
        assert listener.join(10)
    times = [s.t_device for s in heard if isinstance(s, JointSample)]
    assert times == sorted(set(times))
    # The first may be one that came out of order: what came before it was sent before anybody listened.
    assert set(times[1:]) <= {decode(data).time for data in held[1::2]}


# -- the twin -----------------------------------------------------------------------------------


def test_the_twin_follows(tmp_path, port):
    with DrflSender(motion, to=("127.0.0.1", port), torques=(1.0,) * 6):
        story = lived(cell(tmp_path, port), Story(120, Story.seen_enough))
    story.check_that_it_follows(motion)
    assert story.joints()[-1].tau == (1.0,) * 6


def test_a_bridge_that_is_killed_and_started_again_is_followed_again(tmp_path, port):
    # Its time is by then far behind where it was: less than ten seconds are taken for a delay.
    sender = DrflSender(motion, to=("127.0.0.1", port)).start()

    def on():
        sender.t = lambda k: k / sender.rate - 100.0
        sender.start()

    story = Story(260, lambda story: story.decided(180) > 0, at_120=sender.stop, at_180=on)
    try:
        lived(cell(tmp_path, port), story)
    finally:
        sender.stop()
    assert any("not heard for" in s.results[0].reason for s in story.snapshots[120:])
    assert story.decided(180) > 0


def test_another_arm_is_an_error(tmp_path, port):
    with pytest.raises(InputError, match="the bridge sends 6"):
        _ = cell(tmp_path, port, robot="iiwa14").sources


def test_the_emulated_bridge_can_be_probed(port, capsys):
    with DrflOptions(port=port).ready().server:
        words = ["probe", "drfl", "--port", str(port), "--seconds", "2", "--set", "timeout=2"]
        assert cli.main(words) == 0
    said = capsys.readouterr().out
    assert "robot_state = moving" in said
    assert 'kind = "drfl"' in said


# -- the program --------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def program(tmp_path_factory):
    compiler = shutil.which("g++") or shutil.which("clang++")
    if compiler is None:
        pytest.skip("no C++ compiler")
    folder = tmp_path_factory.mktemp("bridge")
    (folder / "DRFLEx.h").write_text(STAND_IN)
    words = [compiler, "-std=c++14", "-Wall", "-Wextra", "-Werror", f"-I{folder}"]
    subprocess.run(
        [*words, str(BRIDGE / "main.cpp"), "-o", str(folder / "bridge"), "-pthread"], check=True, timeout=300
    )
    return folder / "bridge"


def test_the_program_sends_what_the_reader_reads(program, port):
    heard = []
    listener = Listener(Drfl(robot="arm", port=port), None, heard.append)
    listener.start()
    bridge = subprocess.Popen([program, "192.0.2.1", "--port", str(port), "--rate", "200"])
    try:
        wait_for(lambda: sum(isinstance(s, JointSample) for s in heard) > 10)
    finally:
        bridge.terminate()
        assert bridge.wait(30) == 0
        listener.ask_to_stop()
        assert listener.join(10)
    joints = [s for s in heard if isinstance(s, JointSample)]
    expected = np.radians(10.5 * np.arange(6) - 20)
    assert np.abs(np.array([s.q for s in joints]) - expected).max() < 1e-6
    assert joints[0].tau == tuple(3.5 * k for k in range(6))
    assert joints[0].qd == pytest.approx(np.radians(-1.25 * np.arange(6)), abs=1e-7)
    times = [s.t_device for s in joints]
    assert times == sorted(set(times))
    said = next(s for s in heard if isinstance(s, SignalSample))
    assert said.values["robot_state"] == "moving"
    assert said.values["control_mode"] == "770"


@pytest.mark.parametrize(
    ("words", "status"),
    [
        ([], 2),
        (["192.0.2.1", "--rate", "5"], 2),
        (["192.0.2.1", "--to", "nowhere"], 2),
        (["192.0.2.9"], 1),
        (["192.0.2.1", "--samples", "3"], 0),
    ],
)
def test_the_program_says_how_it_ended(program, words, status):
    done = subprocess.run([program, *words], capture_output=True, timeout=60, check=False)
    assert done.returncode == status
    assert bool(done.stderr) == (status != 0)
