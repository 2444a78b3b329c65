"""What pages measure, against what a criterion says of the same two things at the same instant."""

from contextlib import ExitStack
from threading import Event, Thread

import msgspec
import numpy as np
import pytest
from msgspec.structs import replace

from kept_run import Kept
from seerob.app.commands.replay import _model
from seerob.app.server.access import Role, Tokens
from seerob.app.server.live import Live, LiveView
from seerob.app.server.player import Player
from seerob.app.server.serving import Server
from seerob.app.server.trial import Still
from seerob.core.errors import InputError, Undecided
from seerob.core.snapshot import Hello, Measure, Measured, Reach, Snapshot
from seerob.outputs.sinks.recorder import Recorder
from seerob.recording.recording import Recording
from seerob.session.measuring import Ruler
from seerob.session.station import load
from server.frames import Visitor

MICROMETRE = 1e-6
CELL = """title = "Measured"

[[robots]]
name = "ur5e"
model = "library:ur5e"

[[humans]]
name = "operator"
stature = 1.75
mass = 75
sex = "male"
at = { position = [0.9, 0.1, 0], rpy_deg = [0, 0, 180] }

[[sources]]
kind = "csv"
robot = "ur5e"
file = "motion.csv"
loop = true

[[safety]]
kind = "minimum_distance"
name = "distance"
between = ["ur5e", "operator"]
"""


class Page(Visitor):
    """Measures."""

    def measure(self, *between, t=None):
        self.socket.send(msgspec.msgpack.encode(Measure(id=7, between=between, t=t)))
        return self.of(Measured)


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    folder = tmp_path_factory.mktemp("measured")
    (folder / "workstation.toml").write_text(CELL)
    rows = ["time [s]," + ",".join(f"J{i} [rad]" for i in range(1, 7))]
    for t in np.arange(0, 0.305, 0.01):
        q = np.array([0, -1.2, 1.4, -0.2, 1.5, 0]) + 0.2 * np.sin(8 * t)
        rows.append(",".join(f"{x:.9f}" for x in (t, *q)))
    (folder / "motion.csv").write_text("\n".join(rows) + "\n")
    return load(folder)


@pytest.fixture(scope="module")
def recording(cell, tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    cell.run(folder=folder, sinks=[Recorder(lossless=True)])
    return Recording.open(folder / "run.mcap")


def told(snapshot):
    (found,) = snapshot.results
    return found.value


def test_of_a_recording_each_instant_is_measured_as_the_criterion_had_it(recording):
    ruler = Ruler(lambda: _model(recording))
    server = Server(
        scene=recording.scene, meshes=recording.meshes, feed=Player(recording), port=0, ruler=lambda: ruler
    )
    with server, Page(server) as page:
        assert "measure" in page.of(Hello).may
        every = list(recording.snapshots())
        values = set()
        for snapshot in every[:-1:5]:
            answer = page.measure("ur5e", "operator", t=snapshot.t)
            assert answer.refusal == ""
            found = answer.result
            assert found.t == snapshot.t
            assert found.value == pytest.approx(told(snapshot), abs=MICROMETRE)
            (line,) = found.markers
            assert np.linalg.norm(np.subtract(line.end, line.start)) == pytest.approx(found.value, abs=1e-9)
            assert (found.limit, found.verdict) == (None, None)
            values.add(round(found.value, 3))
        assert len(values) > 3
        # The file breaks off while the arm moves, and its source does not vouch for that instant.
        assert "may be elsewhere" in page.measure("ur5e", "operator", t=every[-1].t).refusal
        assert page.measure("ur5e", "nobody").refusal


def test_a_live_run_is_measured_where_it_was_shown_also_a_moment_ago(cell):
    over = Event()
    with LiveView(
        scene=cell.scene(), meshes=cell.model.meshes, port=0, ruler=Ruler(lambda: cell.model)
    ) as view:
        runs = Thread(target=lambda: cell.run(writers=[view], live=True, stop=over.is_set))
        runs.start()
        try:
            with Page(view.server) as page:
                first = page.of(Snapshot)
                later = page.until(lambda m: isinstance(m, Snapshot) and m.t > first.t + 0.1)
                for seen in (later, first):
                    found = page.measure("ur5e", "operator", t=seen.t).result
                    assert (found.t, found.value) == (seen.t, pytest.approx(told(seen), abs=MICROMETRE))
                assert page.measure("ur5e", "operator").result.t >= later.t
                assert "not kept" in page.measure("ur5e", "operator", t=-1.0).refusal
        finally:
            over.set()
            runs.join()


def test_reach_goes_along_with_who_reaches_and_is_told_to_who_may_measure(cell):
    seen, ruler = cell.first(cell.scene()), Ruler(lambda: cell.model)
    found = ruler.reach("operator/right_hand", seen)
    (hull,) = found.markers
    assert 0 < found.value < 0.5
    # Where the hand is now is inside.
    vertices = np.array(hull.vertices)
    poses = np.frombuffer(seen.poses, "<f4").reshape(-1, 7).copy()
    names = [node.name for node in cell.scene().nodes]
    hand = poses[names.index("operator/right_hand"), :3]
    assert (vertices.min(axis=0) < hand).all()
    assert (hand < vertices.max(axis=0)).all()
    poses[[name.startswith("operator/") for name in names], 0] += 1.0
    (moved,) = ruler.reach("operator/right_hand", replace(seen, poses=poses.tobytes())).markers
    assert np.array(moved.vertices) == pytest.approx(vertices + np.array([1, 0, 0]), abs=1e-5)
    with pytest.raises(Undecided, match="fell silent"):
        ruler.reach("operator/right_hand", replace(seen, doubts={"operator": "it fell silent"}))
    server = Server(scene=cell.scene(), meshes={}, feed=Still(seen), port=0, ruler=lambda: ruler)
    with server, Page(server) as page:
        page.socket.send(msgspec.msgpack.encode(Reach(id=-1, of="ur5e")))
        answer = page.of(Measured)
        assert (answer.id, answer.result.name, len(answer.result.markers)) == (-1, "reach of ur5e", 1)
        page.socket.send(msgspec.msgpack.encode(Reach(id=-2, of="nobody")))
        assert page.of(Measured).refusal


def test_who_may_only_look_or_track_does_not_measure(cell):
    tokens = Tokens.made()
    ruler = Ruler(lambda: cell.model)
    feed = Live()
    server = Server(scene=cell.scene(), meshes={}, feed=feed, port=0, tokens=tokens, ruler=lambda: ruler)
    feed.publish(cell.first(cell.scene()))
    feed.finish()  # what was last is shown however long ago that was
    with ExitStack() as stack:
        stack.enter_context(server)
        for role, token in zip(Role, tokens, strict=True):
            page = stack.enter_context(Page(server, path=f"/ws?token={token}"))
            assert ("measure" in page.of(Hello).may) == (role is Role.CONTROL)
            page.of(Snapshot)
            found = page.measure("ur5e", "operator")
            assert (found.result is not None) == (role is Role.CONTROL)


def test_nothing_is_measured_of_who_may_be_elsewhere_or_in_another_workstation(cell):
    kept = Kept()
    cell.run(writers=[kept], end=0.02)
    seen, ruler = kept.snapshots[0], Ruler(lambda: cell.model)
    for who in ("operator", "operator/right_hand", "ur5e", "ur5e/forearm_link"):
        with pytest.raises(Undecided, match="fell silent"):
            ruler.measure(("ur5e", "operator"), replace(seen, doubts={who: "it fell silent"}))
    only = replace(seen, doubts={"operator/left_hand": "it fell silent"})
    assert ruler.measure(("ur5e", "operator/right_hand"), only).value > 0
    with pytest.raises(InputError, match="another workstation"):
        ruler.measure(("ur5e", "operator"), replace(seen, poses=seen.poses[:-28]))
    with pytest.raises(InputError, match="is in both"):
        ruler.measure(("ur5e", "ur5e/forearm_link"), seen)
