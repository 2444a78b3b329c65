"""The twin of a UR10 over RTDE, on real sockets: it follows, doubts, comes back, and can be replayed."""

from __future__ import annotations

import math
import subprocess
import sys
import threading
from functools import partial

import msgspec
import numpy as np
import pytest

from live_story import Story, elsewhere, lived, open_files, wait_for
from made_cell import TWO_R, made, two_r
from reached import asked
from seerob.app.emulators.rtde import RtdeServer
from seerob.core.errors import InputError
from seerob.core.markers import plain
from seerob.core.samples import JointSample, Quality, SignalSample
from seerob.devices.live.listening import Listener
from seerob.devices.sources.rtde import Rtde, figures, joint_sample, states
from seerob.outputs.sinks.recorder import Recorder
from seerob.protocols import ProtocolError
from seerob.protocols.robots.rtde import RobotMode, SafetyStatus, quality
from seerob.recording.recording import Recording
from seerob.session.station import load_recorded

HOME, AMPLITUDE = np.array([0, -1.2, 1.4, -1.5, -1.5, 0]), np.array([0.5, 0.3, -0.3, 0.4, -0.4, 0.5])
FASTEST = 1.5
"""More than any point of the robot moves [m/s]."""


def motion(t):
    return tuple((HOME + AMPLITUDE * np.sin(t)).tolist()), tuple((AMPLITUDE * np.cos(t)).tolist())


def cell(folder, server, *, frequency=125.0, timeout=0.2, more=""):
    return made(
        folder,
        '[[robots]]\nname = "arm"\nmodel = "library:ur10"\n'
        f'[[sources]]\nkind = "rtde"\nname = "controller"\nrobot = "arm"\nhost = "127.0.0.1"\n'
        f"port = {server.port}\nfrequency = {frequency}\ntimeout = {timeout}\n{more}"
        '[[safety]]\nkind = "velocity"\nname = "speed"\nat = "arm"\nlimit = 1.5\n',
    )


@pytest.mark.parametrize("frequency", [125.0, 500.0])
def test_the_twin_follows_the_robot(tmp_path, frequency):
    with RtdeServer(motion) as server:
        story = lived(cell(tmp_path, server, frequency=frequency), Story(150, Story.seen_enough))
    story.check_that_it_follows(motion)
    assert story.fastest() < FASTEST


def test_samples_lie_on_either_side_of_what_is_shown(tmp_path):
    with RtdeServer(motion) as server:
        story = lived(cell(tmp_path, server), Story(100))
    # Also on a machine that is late for some of them.
    assert np.mean(story.ahead()) > 0.2


def test_silence_is_undecided_within_the_time_out_and_the_robot_is_followed_again(tmp_path):
    server = RtdeServer(motion).start()
    heard_again = partial(Story.decided, first=210)
    story = Story(
        600,
        lambda story: heard_again(story) > 10,
        at_150=server.stop,
        at_210=partial(elsewhere, server, motion),
    )
    try:
        station = cell(tmp_path, server)
        lived(station, story)
    finally:
        server.stop()
    verdicts, times = story.verdicts(), [s.t for s in story.snapshots]
    lost = story.lost(150)
    last = max(s.t for s in story.joints() if s.t < times[lost])
    # A tick speaks of what was a delay ago.
    (source,) = station.workstation.sources
    assert times[lost] + source.behind() <= last + source.timeout + 2 * 0.01
    assert set(verdicts[lost:210]) == {"undecided"}
    back = lost + verdicts[lost:].index("within")
    assert back > 210
    assert story.decided(back) > 10
    # It was put where the robot is by then: that is no speed.
    assert story.fastest(back) < FASTEST


def test_a_process_that_listens_and_is_killed_is_a_silence_that_ends(tmp_path, monkeypatch):
    processes, started = [], subprocess.Popen.__init__

    def noted(process, *args, **options):
        processes.append(process)
        started(process, *args, **options)

    monkeypatch.setattr(subprocess.Popen, "__init__", noted)
    story = Story(300, lambda story: story.decided(200) > 10, at_50=lambda: processes[-1].kill())
    with RtdeServer(motion) as server:
        lived(cell(tmp_path, server), story)
    assert len(processes) == 2
    verdicts, lost = story.verdicts(), story.lost(50)
    back = lost + verdicts[lost:].index("within")
    assert set(verdicts[lost:back]) == {"undecided"}
    assert story.fastest(back) < FASTEST


def test_a_controller_that_comes_late_is_followed(tmp_path):
    with RtdeServer(motion) as there:
        port = there.port
    server = RtdeServer(motion, port=port)
    station = cell(tmp_path, server)
    warning = [f.text for f in asked(station).scene().findings if "not reached at start" in f.text]
    assert warning == [
        "controller: not reached at start: Connection refused; it is tried again during the run"
    ]
    story = Story(100, lambda story: story.decided() > 10, at_20=server.start)
    try:
        lived(station, story)
    finally:
        server.stop()
    verdicts = story.verdicts()
    assert set(verdicts[:20]) == {"undecided"}
    assert "nothing heard yet" in story.snapshots[0].results[0].reason
    back = verdicts.index("within")
    assert story.decided(back) > 10
    assert story.fastest(back) < FASTEST


@pytest.mark.parametrize(
    ("values", "reason"),
    [
        ({"robot_mode": int(RobotMode.POWER_OFF)}, "its source says invalid"),
        ({"safety_status": int(SafetyStatus.FAULT)}, "its source says degraded"),
        ({"actual_q": (math.nan,) * 6}, "not finite"),
    ],
)
def test_a_robot_that_says_that_it_does_not_know_is_undecided_at_once(tmp_path, values, reason):
    with RtdeServer(motion) as server:
        story = Story(30, once_within=lambda: server.values.update(values))
        lived(cell(tmp_path, server), story)
    assert story.verdicts()[story.done + 20] == "undecided"
    assert reason in story.snapshots[story.done + 20].results[0].reason


def test_a_clock_that_stands_still_is_silence(tmp_path):
    """A controller that repeats itself has nothing to say."""
    with RtdeServer(motion) as server:
        story = Story(50, once_within=lambda: server.values.update(timestamp=server.now()))
        lived(cell(tmp_path, server), story)
    assert "not heard for" in story.snapshots[story.done + 40].results[0].reason


def test_what_was_heard_live_is_computed_again_bit_for_bit(tmp_path):
    server = RtdeServer(motion).start()
    station = cell(tmp_path / "cell", server)
    story = Story(130, at_40=server.stop, at_80=server.start)
    try:
        lived(station, story, folder=tmp_path / "run", sinks=[Recorder(lossless=True)])
    finally:
        server.stop()
    recording = Recording.open(tmp_path / "run" / "run.mcap")
    again = Story(10_000)
    feed = (tuple(tick.samples) for tick in recording.ticks())
    load_recorded(recording).run(feed=feed, writers=[again])
    encode = partial(msgspec.msgpack.encode, enc_hook=plain)
    # How its connection was, no sample says.
    assert {name for s in story.snapshots for name in s.sources} == {"controller"}
    lived_through = [msgspec.structs.replace(s, sources={}) for s in story.snapshots]
    assert [encode(s) for s in again.snapshots] == [encode(s) for s in lived_through]
    assert "undecided" in again.verdicts()
    assert any(isinstance(s, SignalSample) for samples in again.heard for s in samples)


def test_what_a_controller_lacks_is_said_and_what_cannot_be_known_is_undecided(tmp_path):
    lacking = frozenset({"robot_mode", "actual_qd", "safety_status", "safety_mode"})
    with RtdeServer(motion, without=lacking) as server:
        station = cell(tmp_path, server)
        story = lived(station, Story(30))
    said = " ".join(f.text for f in station.scene().findings)
    for text in ("does not say whether the robot is on", "no measured joint speeds", "its safety status"):
        assert text in said
    assert {s.qd for s in story.joints()} == {None}
    assert set(story.verdicts()) == {"undecided"}


def test_a_controller_without_joints_and_a_robot_of_another_kind_are_errors(tmp_path):
    with RtdeServer(motion, without=frozenset({"actual_q"})) as server:
        with pytest.raises(InputError, match="the controller has no actual_q"):
            cell(tmp_path / "a", server).reach()
        text = TWO_R + '[[sources]]\nkind = "rtde"\nrobot = "arm"\nhost = "127.0.0.1"\n'
        with pytest.raises(InputError, match="arm has 2 joints"):
            _ = made(tmp_path / "b", text, {"arm.urdf": two_r()}).sources


def test_only_real_time_will_do(tmp_path):
    with RtdeServer(motion) as server, pytest.raises(InputError, match="real time only"):
        cell(tmp_path, server).run()


@pytest.mark.skipif(sys.platform != "linux", reason="counts open files in /proc")
def test_kills_and_restarts_leave_no_thread_and_no_socket(monkeypatch, caplog):
    monkeypatch.setattr("seerob.devices.live.listening.FIRST_PAUSE", 0.005)
    server = RtdeServer(motion).start()
    heard = []
    files, threads = open_files(), threading.active_count()
    listener = Listener(Rtde(robot="arm", host="127.0.0.1", port=server.port), None, heard.append)
    listener.start()
    try:
        for k in range(20):
            heard.clear()
            wait_for(lambda: sum(isinstance(s, JointSample) for s in heard) > 3)
            server.stop()
            wait_for(lambda k=k: listener.statistics().losses > k)
            server.start()
    finally:
        listener.ask_to_stop()
        assert listener.join(10.0)
    wait_for(lambda: open_files() <= files and threading.active_count() <= threads)
    server.stop()


# -- values -------------------------------------------------------------------------------------


def test_values_are_samples_in_si():
    six = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    values = {"timestamp": 9.0, "actual_q": six, "actual_qd": six, "actual_current_as_torque": six}
    values |= {"robot_mode": 7, "safety_mode": 3, "runtime_state": 2, "payload": 1.5, "actual_TCP_pose": six}
    sample = joint_sample(values, target="arm", arrived=100.0)
    assert (sample.t, sample.t_device, sample.q, sample.qd, sample.tau) == (100.0, 9.0, six, six, six)
    assert sample.quality is Quality.GOOD
    assert states(values) == {
        "robot_mode": "RUNNING",
        "safety_status": "PROTECTIVE_STOP",
        "program_running": True,
    }
    assert figures(values) == {
        "payload": 1.5,
        **{f"actual_TCP_pose.{a}": x for a, x in zip(("x", "y", "z", "rx", "ry", "rz"), six, strict=True)},
    }
    assert states({"robot_mode": 42}) == {"robot_mode": "42"}
    with pytest.raises(ProtocolError, match="not six values"):
        joint_sample({**values, "actual_q": (1.0, 2.0, 3.0)}, target="arm", arrived=0.0)


@pytest.mark.parametrize(
    ("mode", "safety", "said"),
    [
        (7, 1, "good"),
        (7, None, "good"),
        (5, 7, "good"),  # an emergency stop: it stands where it says
        (3, 1, "invalid"),
        (-1, 1, "invalid"),
        (8, 1, "invalid"),
        (99, 1, "invalid"),
        (7, 9, "degraded"),
        (7, 99, "degraded"),
        (7, 10, "invalid"),
        (None, 1, "degraded"),
        (None, 11, "invalid"),
    ],
)
def test_what_a_state_means_for_the_truth(mode, safety, said):
    assert quality(mode, safety) == said


@pytest.mark.parametrize("mode", [math.nan, math.inf, 6.5])
def test_a_mode_that_is_no_whole_number_is_refused(mode):
    with pytest.raises(ProtocolError, match="where a whole number belongs"):
        states({"robot_mode": mode})


class Counted(RtdeServer):
    """Counts who comes."""

    clients = 0

    async def _welcome(self, reader, writer):
        self.clients += 1
        await super()._welcome(reader, writer)


def test_a_controller_that_has_lost_its_joints_is_one_line_of_the_log(monkeypatch, caplog):
    """After a change of firmware, say: there is nothing to hear, however often it is tried."""
    monkeypatch.setattr("seerob.devices.live.listening.FIRST_PAUSE", 0.005)
    samples = []
    with Counted(motion, without=frozenset({"actual_q"})) as server:
        source = Rtde(name="ur", robot="ur10", host="127.0.0.1", port=server.port)
        listener = Listener(source, None, samples.append)
        listener.start()
        wait_for(lambda: server.clients >= 3)
        listener.ask_to_stop()
        assert listener.join(10)
    assert samples == []
    (line,) = [r for r in caplog.records if r.name == "seerob.devices.live.listening"]
    assert "the controller has no actual_q" in line.getMessage()
