"""The twin of an LBR over FRI, on real sockets: it follows, keeps the session alive and commands nothing."""

from __future__ import annotations

import socket
import threading

import numpy as np
import pytest

from live_story import Story, listening, lived, open_files, wait_for
from made_cell import made
from reached import asked
from seerob.app.emulators.fri import FriServer
from seerob.core.errors import InputError
from seerob.core.samples import JointSample, SignalSample
from seerob.devices.live.listening import Listener
from seerob.devices.sources.fri import DeviceTime, Fri
from seerob.protocols.robots.fri import Edition, Monitoring, encode_monitoring

HOME, AMPLITUDE = np.array([0, 0.5, 0, -1.4, 0, 1.2, 0]), np.array([0.4, 0.2, 0.3, 0.2, 0.4, 0.3, 0.5])


def motion(t):
    return tuple((HOME + AMPLITUDE * np.sin(t)).tolist()), tuple((AMPLITUDE * np.cos(t)).tolist())


@pytest.fixture
def port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        return free.getsockname()[1]


def cell(folder, port, *, robot="iiwa14", more=""):
    return made(
        folder,
        f'[[robots]]\nname = "arm"\nmodel = "library:{robot}"\n'
        f'[[sources]]\nkind = "fri"\nname = "controller"\nrobot = "arm"\nhost = "127.0.0.1"\n'
        f"port = {port}\ntimeout = 0.2\n{more}"
        '[[safety]]\nkind = "velocity"\nname = "speed"\nat = "arm"\nlimit = 1.5\n',
    )


@pytest.mark.parametrize("edition", Edition)
def test_the_twin_follows_the_robot_and_commands_nothing(tmp_path, port, edition):
    with FriServer(motion, to=("127.0.0.1", port), edition=edition) as server:
        story = lived(cell(tmp_path, port), Story(120, Story.seen_enough))
        assert server.answers > 10
        assert server.wrong == []
        assert server.moved_by_answer < 1e-12
    story.check_that_it_follows(motion)
    speeds = [np.abs(np.subtract(motion(s.t_device)[1], s.qd)).max() for s in story.joints() if s.qd]
    assert len(speeds) > 10
    assert np.median(speeds) < 1e-3


def test_the_session_becomes_ready_because_it_is_answered(tmp_path, port):
    heard = []
    listener = Listener(Fri(robot="arm", host="127.0.0.1", port=port), None, heard.append)
    with FriServer(motion, to=("127.0.0.1", port), torques=lambda t: (t,) * 7) as server:
        listener.start()
        try:
            said = lambda: {s.values["session"] for s in heard if isinstance(s, SignalSample)}  # noqa: E731
            wait_for(lambda: "MONITORING_READY" in said())
            server.overlay = True
            wait_for(lambda: "COMMANDING_ACTIVE" in said())
            count = server.answers
            wait_for(lambda: server.answers > count + 20)
        finally:
            listener.ask_to_stop()
            assert listener.join(10.0)
        assert server.wrong == []
        assert server.moved_by_answer < 1e-12
    assert all(s.tau == pytest.approx((s.t_device,) * 7) for s in heard if isinstance(s, JointSample))


def test_silence_is_undecided_and_the_robot_is_followed_again(tmp_path, port):
    server = FriServer(motion, to=("127.0.0.1", port)).start()
    story = Story(260, at_40=server.stop, at_100=server.start)
    try:
        lived(cell(tmp_path, port), story)
    finally:
        server.stop()
    verdicts = story.verdicts()
    lost = story.lost(40)
    assert set(verdicts[lost:100]) == {"undecided"}
    assert "within" in verdicts[100:]
    assert story.fastest(100) < 1.5


def test_what_the_controller_is_is_said_at_start(tmp_path, port):
    with FriServer(motion, to=("127.0.0.1", port), period=0.01) as server:
        server.overlay = True
        said = " ".join(f.text for f in asked(cell(tmp_path, port)).scene().findings)
    for text in ("speaks FRI 2.7", "slope of a parabola", "sends every 10 ms", "motion overlay", "torques"):
        assert text in said


def test_another_arm_is_an_error(tmp_path, port):
    with pytest.raises(InputError, match="an LBR has 7"):
        _ = cell(tmp_path, port, robot="ur10").sources


def test_strangers_are_not_listened_to(port):
    heard = []
    listener = Listener(Fri(robot="arm", host="127.0.0.2", port=port), None, heard.append)
    other = []
    with FriServer(motion, to=("127.0.0.1", port)) as server:
        listener.start()
        try:
            with FriServer(motion, to=("127.0.0.1", port), host="127.0.0.2", edition=Edition.V2) as own:
                wait_for(lambda: len(heard) > 20)
                other.append(own.answers)
        finally:
            listener.ask_to_stop()
            assert listener.join(10.0)
        assert server.answers == 0
    assert other[0] > 0


def test_kills_and_restarts_leave_no_thread_and_no_socket(monkeypatch, port):
    monkeypatch.setattr("seerob.devices.live.listening.FIRST_PAUSE", 0.005)
    monkeypatch.setattr("seerob.devices.sources.fri.SILENCE", 0.05)
    files, threads = open_files(), threading.active_count()
    server, heard = FriServer(motion, to=("127.0.0.1", port)), []
    listener = Listener(Fri(robot="arm", host="127.0.0.1", port=port), None, heard.append)
    listener.start()
    try:
        for _ in range(8):
            heard.clear()
            with server:
                wait_for(lambda: len(heard) > 3)
    finally:
        listener.ask_to_stop()
        assert listener.join(10.0)
    wait_for(lambda: open_files() <= files and threading.active_count() <= threads)


def test_doubled_and_overtaken_datagrams_are_no_news_and_cost_no_speed(port):
    heard = []
    listener = Listener(Fri(robot="arm", host="127.0.0.1", port=port), None, heard.append)
    listener.start()
    try:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as controller:

            def send(k):
                m = Monitoring(edition=Edition.V2_7, sequence=k, send_period=5, q=(0.01 * k,) * 7)
                controller.sendto(encode_monitoring(m), ("127.0.0.1", port))

            def known():
                return [s for s in heard if isinstance(s, JointSample)]

            # Until somebody listens, what is sent is lost.
            wait_for(lambda: (send(0), len(known()))[1] > 0)
            for k in (1, 2, 3, 3, 4, 6, 5, 7, 7, 8, 0, 9):
                send(k)
            wait_for(lambda: known()[-1].t_device == pytest.approx(0.045))
    finally:
        listener.ask_to_stop()
        assert listener.join(10.0)
    times = [s.t_device for s in known()]
    assert times == pytest.approx([0.005 * k for k in (0, 1, 2, 3, 4, 6, 7, 8, 9)])
    assert [s.qd for s in known()][:3] == [None, None, None]
    assert np.array([s.qd for s in known()][3:]) == pytest.approx(np.full((6, 7), 2.0))


# -- time -----------------------------------------------------------------------------


def test_messages_are_the_clock_where_there_is_none_and_the_count_comes_round():
    def message(sequence):
        return Monitoring(edition=Edition.V2, sequence=sequence, send_period=5, q=(0.0,) * 7)

    clock = DeviceTime()
    assert clock(message(2**32 - 1)) == pytest.approx(0.005 * (2**32 - 1))
    assert clock(message(0)) == pytest.approx(0.005 * 2**32)
    assert clock(message(2)) == pytest.approx(0.005 * (2**32 + 2))
    assert clock(message(2**32 - 2)) == pytest.approx(0.005 * (2**32 - 2))
    assert clock(message(3)) == pytest.approx(0.005 * (2**32 + 3))


@pytest.mark.parametrize("again", [False, True])
def test_positions_that_are_said_again_with_new_stamps_are_a_recording(port, again):
    """A period of a motion with the noise of encoders, again and again without a seam, or as it goes on."""
    rng, period, said = np.random.default_rng(4), 1.5, []

    def noisy(t):
        k = len(said)
        if again and k > 200:
            said.append(said[k - 150])
        else:
            q = HOME + AMPLITUDE * np.sin(2 * np.pi / period * 0.01 * k) + rng.normal(0, 2e-6, 7)
            said.append(tuple(q.tolist()))
        return said[-1], (0.0,) * 7

    source = Fri(robot="arm", host="127.0.0.1", port=port, frequency=100)
    with FriServer(noisy, to=("127.0.0.1", port)), listening(source) as heard:
        wait_for(lambda: len(said) > 500)
    joints = [s for s in heard if isinstance(s, JointSample)]
    doubted = [s for s in joints if "is a recording played" in s.reason]
    known = {q: k for k, q in reversed([*enumerate(said)])}
    late = [s for s in joints if known[s.q] < 200][-100:] if again else []
    assert bool(doubted) is again
    assert all("is a recording played" in s.reason for s in late)
