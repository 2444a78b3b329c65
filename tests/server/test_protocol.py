"""The server over real sockets: what a page is told, in which order, and how far behind it may be."""

import threading
import time

import numpy as np
import pytest
from msgspec.structs import replace as replaced

from live_story import wait_for
from seerob.app.server import hub
from seerob.app.server import live as live_view
from seerob.app.server.client import WINDOW
from seerob.app.server.live import Live, LiveView
from seerob.app.server.player import Player
from seerob.app.server.serving import Server
from seerob.app.wire import schema
from seerob.core.snapshot import Hello, History, Scene, Snapshot, SoFar, Transport, Verdict
from seerob.outputs.sink import Writer
from seerob.outputs.sinks.recorder import Recorder
from seerob.recording.recording import Recording
from seerob.recording.result_log import ResultLog
from server.frames import MESHES, PATIENCE, Remembered, Visitor, scene, snapshot


@pytest.fixture
def live():
    feed = Live(rate=1000.0)
    with Server(scene=scene(), meshes=MESHES, feed=feed, port=0) as server:
        yield server, feed


def replay(snapshots, **options):
    return Server(scene=scene(), meshes=MESHES, feed=Player(Remembered(snapshots), **options), port=0)


@pytest.fixture(autouse=True)
def patient(monkeypatch):
    """However long a busy machine takes, what is shown here is the present; see test_stopped_run.py."""
    monkeypatch.setattr(live_view, "OLD", PATIENCE)


def test_a_page_is_told_everything_once_and_then_each_frame(live):
    server, feed = live
    with Visitor(server) as page:
        hello = page.read()
        assert (hello.mode, hello.duration, hello.schema) == ("live", None, schema())
        assert page.read() == scene()
        assert isinstance(page.read(), History)
        assert page.read() == Transport(playing=True, t=0.0, live=True)
        for k in range(50):
            feed.publish(snapshot(k))
            assert page.read() == snapshot(k)


def test_who_comes_late_gets_the_past_and_the_present(live):
    server, feed = live
    with Visitor(server) as early:
        for k in range(200):
            feed.publish(snapshot(k))
        early.until(lambda m: isinstance(m, Snapshot) and m.seq == 199)
    with Visitor(server) as late:
        trace = late.of(History).traces[0]
        assert trace.name == "distance"
        np.testing.assert_array_equal(np.frombuffer(trace.t, "<f8"), [snapshot(k).t for k in range(200)])
        values = np.array([snapshot(k).results[0].value for k in range(200)])
        np.testing.assert_array_equal(np.frombuffer(trace.values, "<f8"), values)
        np.testing.assert_array_equal(np.frombuffer(trace.verdicts, "u1"), values > 1)
        assert late.of(Snapshot) == snapshot(199)


def test_who_never_acknowledges_gets_a_window_and_then_the_newest(live):
    server, feed = live
    with Visitor(server, acknowledge=False) as stalled, Visitor(server) as other:
        for k in range(300):
            feed.publish(snapshot(k))
            other.until(lambda m, k=k: isinstance(m, Snapshot) and m.seq == k)
        frames = [stalled.of(Snapshot).seq for _ in range(WINDOW)]
        assert frames == list(range(WINDOW))
        with pytest.raises(TimeoutError):
            stalled.read(timeout=0.2)
        stalled.ask("ack", frames[-1])
        assert stalled.of(Snapshot).seq == 299
        skipped = sorted(client.skipped for client in server.hub.clients)
        assert skipped == [0, 300 - WINDOW - 1]


def test_who_does_not_read_costs_bounded_memory_and_is_cut_off_in_the_end():
    feed = Live(rate=1000.0)
    nodes = 3000  # frames of 84 kB fill every buffer on the way
    with Server(scene=scene(nodes), meshes={}, feed=feed, port=0) as server:
        stalled = Visitor(server, acknowledge=False, max_queue=1)
        with Visitor(server) as other:
            frames = [snapshot(k, nodes) for k in range(40)]
            for k, frame in enumerate(frames):
                feed.publish(frame)
                other.until(lambda m, k=k: isinstance(m, Snapshot) and m.seq == k)
            assert len(server.hub.clients) == 2
            buffered = [c.transport.get_write_buffer_size() for c in server._uvicorn.server_state.connections]
            assert max(buffered) < (WINDOW + 1) * 90_000 + 2**17
            for client in server.hub.clients:
                client._patience = 0.5  # only now: whatever the machine's speed, there was time to fill them

            def ended():
                feed.publish(frames[-1])
                other.of(Snapshot)
                return len(server.hub.clients) == 1

            wait_for(ended)
            wait_for(lambda: len(server._uvicorn.server_state.connections) == 1)
        stalled.socket.socket.close()


def test_who_reads_and_never_acknowledges_is_told_why_it_ends():
    feed = Live(rate=1000.0)
    over = threading.Event()

    def publish():
        k = 0
        while not over.wait(0.01):
            feed.publish(snapshot(k))
            k += 1

    publisher = threading.Thread(target=publish)
    with (
        Server(scene=scene(), meshes={}, feed=feed, port=0, patience=0.3) as server,
        Visitor(server, acknowledge=False) as page,
    ):
        publisher.start()
        try:
            assert page.end() == (1013, "nothing acknowledged for 0.3 s")
        finally:
            over.set()
            publisher.join()


def test_there_is_an_end_to_how_many_look(live, monkeypatch):
    server, _ = live
    monkeypatch.setattr(hub, "MOST_CLIENTS", 2)
    with Visitor(server) as a, Visitor(server) as b:
        a.read()
        b.read()
        with Visitor(server) as c:
            assert c.end() == (1013, "2 pages are connected already")
        assert isinstance(a.read(), Scene)


def test_an_acknowledgement_of_nothing_changes_nothing(live):
    server, feed = live
    with Visitor(server, acknowledge=False) as page:
        page.of(Transport)
        for bogus in (-1, 10**6, 2.5e300, 0):
            page.ask("ack", bogus)
        # Not from 0: on a busy machine the last of these may arrive after the first frame has left.
        for k in range(1, WINDOW + 6):
            feed.publish(snapshot(k))
            if k <= WINDOW:
                assert page.of(Snapshot).seq == k
        with pytest.raises(TimeoutError):
            page.read(timeout=0.2)


def test_a_page_comes_back(live):
    server, feed = live
    for k in range(5):
        with Visitor(server) as page:
            feed.publish(snapshot(k))
            assert page.until(lambda m, k=k: isinstance(m, Snapshot) and m.seq == k) == snapshot(k)
    wait_for(lambda: not server.hub.clients)


def test_the_present_cannot_be_paused_and_a_page_that_asks_is_told_so(live):
    server, feed = live
    feed.publish(snapshot(7))
    with Visitor(server) as page:
        page.of(Snapshot)
        for action, value in (("pause", None), ("seek", 0.0), ("speed", 2.0), ("step", 1), ("loop", 1)):
            page.ask(action, value)
            assert page.of(Transport) == Transport(playing=True, t=snapshot(7).t, live=True)
        feed.finish()
        assert page.of(Transport) == Transport(playing=False, t=snapshot(7).t, live=True)


def test_a_live_view_is_a_sink():
    with LiveView(scene=scene(), meshes=MESHES, port=0) as view:
        writer: Writer = view
        writer.write(snapshot(0), ())
        with Visitor(view.server) as page:
            assert page.of(Snapshot) == snapshot(0)
        assert view.url == f"http://127.0.0.1:{view.server.port}/"


def test_publishing_never_waits_and_outlives_the_server():
    feed = Live()
    early, late = snapshot(0), snapshot(1)
    for _ in range(20_000):
        feed.publish(early)
    feed.publish(late)
    with Server(scene=scene(), meshes={}, feed=feed, port=0) as server, Visitor(server) as page:
        assert page.of(Snapshot).seq == 1
    feed.publish(snapshot(2))
    feed.finish()


# -- replay -------------------------------------------------------------------------------------


def test_a_recording_on_disk_is_shown_bit_for_bit(tmp_path):
    frames = [snapshot(k) for k in range(300)]
    with Recorder(lossless=True).open(scene(), MESHES, {}, tmp_path) as writer:
        for frame in frames:
            writer.write(frame, ())
    recording = Recording.open(tmp_path / "run.mcap")
    with (
        Server(scene=recording.scene, meshes=recording.meshes, feed=Player(recording), port=0) as server,
        Visitor(server) as page,
    ):
        hello = page.of(Hello)
        assert (hello.mode, hello.duration) == ("replay", recording.duration)
        assert page.of(Scene) == scene()
        assert page.of(Snapshot) == frames[0]
        for k in (299, 0, 150, 151, 3, 298):
            page.ask("seek", frames[k].t)
            assert page.of(Snapshot) == frames[k]
        page.ask("seek", 1e9)
        assert page.until(lambda m: isinstance(m, Transport) and m.t == frames[-1].t)
        assert page.of(Snapshot) == frames[-1]


def test_the_whole_recording_comes_as_history():
    frames = [snapshot(k) for k in range(30_000)]
    with replay(frames) as server, Visitor(server) as page:
        history = page.until(
            lambda m: isinstance(m, History) and m.traces[0].t[-8:] == np.float64(frames[-1].t).tobytes()
        )
        values = np.frombuffer(history.traces[0].values, "<f8")
        true = np.array([f.results[0].value for f in frames])
        assert len(values) <= 4000
        assert (values.min(), values.max()) == (true.min(), true.max())


def test_steps_go_from_snapshot_to_snapshot():
    frames = [snapshot(k) for k in (0, 1, 5, 6, 20)]
    with replay(frames) as server, Visitor(server) as page:
        assert page.of(Snapshot).seq == 0
        for steps, seq in ((1, 1), (1, 5), (2, 20), (-1, 6), (-3, 0)):
            page.ask("step", steps)
            assert page.of(Snapshot).seq == seq
        page.ask("step", -1)
        page.ask("seek", 0.055)
        assert page.of(Snapshot).seq == 5


def test_it_plays_in_order_faster_when_asked_and_pauses_at_the_end():
    frames = [snapshot(k) for k in range(120)]
    with replay(frames) as server, Visitor(server) as page:
        page.of(Snapshot)
        page.ask("speed", 4.0)
        page.ask("play")
        begun = time.monotonic()
        seen, state = [], None
        while state is None:
            message = page.read()
            if isinstance(message, Snapshot):
                seen.append(message.seq)
            elif isinstance(message, Transport) and not message.playing and seen:
                state = message
        # A lower bound only: a busy machine may be late, never early.
        assert time.monotonic() - begun >= 119 * 0.01 / 4.0
        assert state == Transport(playing=False, t=frames[-1].t, speed=4.0)
        assert seen == sorted(set(seen))
        assert (seen or [119])[-1] == 119 or page.of(Snapshot).seq == 119
        page.ask("play")
        assert page.of(Snapshot).seq < 119


def test_a_loop_starts_again():
    frames = [snapshot(k) for k in range(5)]
    with replay(frames, playing=True, loop=True) as server, Visitor(server) as page:
        previous, jumps = -1, 0
        while jumps < 3:
            seq = page.of(Snapshot).seq
            jumps += seq < previous
            previous = seq
        page.ask("loop", 0)
        page.until(lambda m: isinstance(m, Transport) and not m.playing and not m.loop)


def test_all_pages_share_one_player():
    frames = [snapshot(k) for k in range(100)]
    with replay(frames) as server, Visitor(server) as a, Visitor(server) as b:
        a.of(Snapshot)
        b.of(Snapshot)
        for k in (50, 10, 90):
            a.ask("seek", frames[k].t)
            b.until(lambda m, k=k: isinstance(m, Transport) and m.t == frames[k].t)
            assert b.of(Snapshot) == a.of(Snapshot) == frames[k]
        b.ask("speed", 0.0)
        assert a.of(Transport).speed == 0.01


def test_seeking_while_playing_goes_on_from_there():
    frames = [snapshot(k) for k in range(3000)]
    with replay(frames, playing=True) as server, Visitor(server) as page:
        page.of(Snapshot)
        page.ask("seek", 20.0)
        first = page.until(lambda m: isinstance(m, Snapshot) and m.t >= 20.0)
        assert page.of(Snapshot).seq > first.seq


def test_acknowledging_after_a_jump_back_keeps_the_window_open():
    frames = [snapshot(k) for k in range(100)]
    with replay(frames) as server, Visitor(server, acknowledge=False) as page:
        page.of(Snapshot)
        for _ in range(WINDOW // 2 + 2):
            for k in (90, 10):
                page.ask("seek", frames[k].t)
                assert page.of(Snapshot).seq == k
            page.ask("ack", 10)  # of the last only, and smaller than one in flight before it


def test_a_recording_that_cannot_be_read_is_said_not_shown(caplog):
    class Broken(Remembered):
        def snapshot_at(self, t):
            raise OSError("disk gone")

    with Server(scene=scene(), meshes={}, feed=Player(Broken([snapshot(0), snapshot(1)])), port=0) as server:
        for _ in range(2):
            with Visitor(server) as page:
                assert page.end() == (1011, "nothing more to show: disk gone")
    assert "disk gone" in caplog.text


def test_nothing_is_left_after_a_stop():
    before = set(threading.enumerate())
    feed = Live()
    server = Server(scene=scene(), meshes={}, feed=feed, port=0)
    server.start()
    feed.publish(snapshot(0))
    with Visitor(server) as page, Visitor(server):
        page.of(Snapshot)
        port = server.port
        server.stop()
        server.stop()
        assert page.end() == (1001, "the server stops")
    assert set(threading.enumerate()) <= before
    # The port is free at once for the same address.
    with Server(scene=scene(), meshes={}, feed=Live(), port=port) as again:
        assert again.port == port
        assert again.notice == ""
        with Server(scene=scene(), meshes={}, feed=Live(), port=port) as moved:
            assert moved.port > port
            assert str(moved.port) in moved.notice


# -- what the run came to -----------------------------------------------------------------------


def judged(verdict):
    """Of a snapshot, by its number."""

    def made(k):
        one = snapshot(k)
        result = replaced(one.results[0], verdict=verdict(k), value=0.4, limit=0.5)
        return replaced(one, results=(result,))

    return made


def test_a_recording_that_exceeded_says_so_whatever_instant_is_shown():
    frames = [judged(lambda k: Verdict.EXCEEDED if k == 20 else Verdict.WITHIN)(k) for k in range(41)]
    with replay(frames) as server, Visitor(server) as page:
        told = page.until(lambda m: isinstance(m, SoFar) and m.whole)
        assert told.verdict is Verdict.EXCEEDED
        (one,) = told.criteria.values()
        assert (one.verdict, one.decided) == (Verdict.EXCEEDED, 1.0)
        page.ask("seek", frames[3].t)
        assert page.of(Snapshot).results[0].verdict is Verdict.WITHIN


def test_a_live_run_tells_what_it_came_to_when_that_changes_and_to_who_comes_late(live):
    server, feed = live
    feed.log = ResultLog(scene().criteria)
    made = judged(lambda k: Verdict.UNDECIDED if k == 5 else Verdict.WITHIN)
    with Visitor(server) as page:
        for k in range(3):
            feed.log.add(made(k))
            feed.publish(made(k))
        assert page.until(lambda m: isinstance(m, SoFar) and m.verdict is Verdict.WITHIN).whole is False
        for k in range(3, 9):
            feed.log.add(made(k))
            feed.publish(made(k))
        assert page.until(lambda m: isinstance(m, SoFar) and m.verdict is Verdict.UNDECIDED)
        with Visitor(server) as late:
            assert late.of(SoFar).verdict is Verdict.UNDECIDED
        feed.finish()
        assert page.until(lambda m: isinstance(m, SoFar) and m.whole).verdict is Verdict.UNDECIDED
