"""A visitor who is 5 m elsewhere from one picture to the next, in a run over a real socket."""

import threading
import time

import msgspec
import numpy as np

import seerob as sr
from made_cell import VISITOR_AT_TABLE
from seerob.app.server.live import LiveView
from seerob.core.snapshot import Hello, History, Scene, Snapshot, SoFar, Tracked, Tracking, Transport, Verdict
from server.frames import PATIENCE, Visitor

STANDS = np.array([[0, 1.56, 0], [-0.25, 1.02, -0.3], [0.25, 1.02, -0.3]])
LEAP = np.array([5.0, 0, 0])
"""To the right of whoever looks ahead, so that the table is farther away then."""
HZ, NEAR, SLOW = 72.0, 0.1, 3.0
CELL = (
    VISITOR_AT_TABLE
    + """[[safety]]
kind = "minimum_distance"
name = "distance"
between = ["anna", "table"]
limit = 0.05
[[safety]]
kind = "velocity"
name = "speed"
of = "anna/head"
limit = 3.0
"""
)


class Headset(Visitor):
    """Says where head and hands are, and sees what the run makes of it."""

    _decoder = msgspec.msgpack.Decoder(Hello | Scene | History | SoFar | Transport | Snapshot | Tracked)

    def see(self, places):
        """Say one picture; yield snapshots until the next one is due."""
        shaken = places + 4e-4 * (np.random.default_rng().random((3, 3)) - 0.5)
        poses = np.column_stack([shaken, np.tile([1.0, 0, 0, 0], (3, 1))]).astype("<f4").tobytes()
        names = ("viewer", "left-grip", "right-grip")
        said = Tracking(human="anna", t=time.monotonic(), names=names, poses=poses)
        self.socket.send(msgspec.msgpack.encode(said))
        end = time.monotonic() + 1 / HZ
        while (left := end - time.monotonic()) > 0:
            try:
                message = self.read(timeout=left)
            except TimeoutError:
                return
            if isinstance(message, Snapshot):
                yield message

    def seen(self, places, until):
        """Snapshots while one is there, up to the first that will do."""
        found, end = [], time.monotonic() + PATIENCE
        while time.monotonic() < end:
            for snapshot in self.see(places):
                found.append(snapshot)
                if until(snapshot):
                    return found
        raise AssertionError(f"nothing would do; at last {found[-1:]}")


def test_who_leaps_by_5_m_is_undecided_and_nobody_is_fast(tmp_path):
    (tmp_path / "workstation.toml").write_text(CELL)
    station, over = sr.load(tmp_path), threading.Event()
    row = [body.name for body in station.model.bodies].index("anna/head")

    def head(snapshot):
        return np.frombuffer(snapshot.poses, "<f4").reshape(-1, 7)[row, :3].astype(float)

    def decided(snapshot):
        return all(result.verdict is Verdict.WITHIN for result in snapshot.results)

    with LiveView(scene=station.scene(), meshes=station.model.meshes, port=0) as view:
        how = {"live": True, "writers": (view,), "stop": over.is_set}
        run = threading.Thread(target=station.run, kwargs=how, daemon=True)
        run.start()
        with Headset(view.server) as page:
            before = head(page.seen(STANDS, decided)[-1])
            # x forward, y left of what has x right, y up, z backward
            after = before - [0, LEAP[0], 0]
            here = [np.linalg.norm(head(each) - before) < NEAR for each in page.seen(STANDS, decided)]
            seen = page.seen(STANDS + LEAP, lambda s: decided(s) and np.linalg.norm(head(s) - after) < NEAR)
            over.set()
        run.join(PATIENCE)
    assert all(here)
    reasons = {result.reason for snapshot in seen for result in snapshot.results}
    assert any("anna: " in why and ("jumped" in why or "elsewhere" in why) for why in reasons), reasons
    for snapshot in seen:
        away = min(np.linalg.norm(head(snapshot) - place) for place in (before, after))
        distance, speed = snapshot.results
        assert away < NEAR or distance.verdict is speed.verdict is Verdict.UNDECIDED, (away, distance)
        assert speed.value is None or speed.value < SLOW
