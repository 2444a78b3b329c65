"""A page finds out where the room of its headset lies: touches through the socket, and what is heard then."""

import msgspec
import numpy as np
import pytest
from msgspec.structs import replace

from seerob.app.server.live import Live
from seerob.app.server.serving import Server
from seerob.core.samples import Placing
from seerob.core.snapshot import Node, Place, Register, Registered, Snapshot, Tracking
from seerob.core.transforms import inverse, rotation_from_wxyz, transform, wxyz_from_rotation
from seerob.description.capture.registration import turn
from seerob.devices.live.headset_offers import Registering, read
from seerob.devices.sources.headset import Headset, frame, layout_of
from seerob.protocols.tracking.vive import WORLD_FROM_XR
from server.frames import MESHES, PATIENCE, scene
from server.test_headset import PLACES, Page, heard, seen

TIP = np.array([0.0, -0.02, -0.1])
BOX = [(x, y, z) for z in (0.0, 0.6) for x in (0.0, 1.0) for y in (0.0, 1.0)]
CELL_FROM_ROOM = transform(turn(np.array([0, 0, 0.7])), [1.0, -0.5, 0.0])
NOISE = 0.002
MIXED = replace(
    scene(),
    nodes=(*scene().nodes, Node(name="table", role="part", owner="table", real=True)),
    landmarks=(
        *(Place(name=f"corner_{k}", position=at, accuracy=0.001) for k, at in enumerate(BOX)),
        Place(name="flange", node="r/link_1", position=(0.0, 0.0, 0.1), accuracy=0.001),
        *(Place(name=f"board_{k}", position=(1, 0, 0.8), accuracy_turn=0.01 * k) for k in (1, 2)),
    ),
    tips=(Place(name="r", node="r/link_2", position=(0.0, 0.0, 0.0)),),
)


def shown(seq, *, moved=0.0, doubts=None):
    poses = np.tile(np.array([0.5, 0.5, 0.9, 1, 0, 0, 0], "<f4"), (4, 1))
    poses[1, 0] += moved
    return Snapshot(seq=seq, t=0.01 * seq, poses=poses.tobytes(), doubts=doubts or {})


class Toucher(Page):
    """A page whose visitor touches what there is."""

    rng = np.random.default_rng(0)
    number = 0
    space = "first"

    def step(self, step, **more):
        self.number += 1
        said = Register(id=self.number, human="anna", space=self.space, step=step, **more)
        self.socket.send(msgspec.msgpack.encode(said))
        while True:
            data = self.socket.recv(timeout=PATIENCE)
            if b"registered" in data[:20]:
                answer = msgspec.msgpack.decode(data, type=Registered)
                assert answer.id == self.number
                return answer

    def grips(self, tips, turns):
        """Poses of the controller, whose tip is there in the room (z up) [m], as a page sends them."""
        positions = (tips - turns @ TIP) @ WORLD_FROM_XR
        wxyz = [wxyz_from_rotation(WORLD_FROM_XR.T @ R) for R in turns]
        return np.column_stack([positions, wxyz]).astype("<f4").tobytes()

    def sweep(self):
        way = np.linspace(0, 4 * np.pi, 200)
        lean = 0.5 * np.stack([np.cos(way), np.sin(way), 0 * way], -1) * np.linspace(0.2, 1, 200)[:, None]
        noise = self.rng.normal(0, 5e-4, (200, 3))
        return self.step("sweep", poses=self.grips(np.array([0.3, 0.2, 1.0]) + noise, turn(lean)))

    def touch(self, name, at, *, step="touch", off=(0, 0, 0), noise=NOISE):
        room = (inverse(CELL_FROM_ROOM) @ [*at, 1])[:3] + self.rng.normal(0, noise, 3) + off
        turns = np.tile(turn(self.rng.normal(0, 0.3, 3)), (30, 1, 1))
        tips = room + self.rng.normal(0, 3e-4, (30, 3))
        return self.step(step, landmark=name, poses=self.grips(tips, turns))

    def corners(self):
        return [self.touch(f"corner_{k}", at) for k, at in enumerate(BOX)]


@pytest.fixture(name="live")
def a_feed():
    return Live()


@pytest.fixture(name="server")
def a_server(live):
    with Server(scene=MIXED, meshes=MESHES, feed=live, port=0) as server:
        yield server


@pytest.fixture(name="page")
def a_page(server):
    with Toucher(server) as page:
        yield page


def test_touches_put_the_person_in_the_cell_with_a_covariance_and_before_that_nobody_knows(server, page):
    with heard(server) as samples:
        before = seen(page, samples, space="first")
        assert "register it" in before.placing.reason
        assert page.sweep().tip < 0.002
        answers = page.corners()
        assert answers[0].at == () and "at least" in answers[0].doubt  # noqa: PT018
        last = answers[-1]
        assert last.doubt == "" and last.accepted  # noqa: PT018
        assert last.landmarks == tuple(f"corner_{k}" for k in range(8))
        np.testing.assert_allclose(last.at[:3], CELL_FROM_ROOM[:3, 3], atol=0.01)
        assert 0.001 < last.error < 0.012
        samples.clear()
        after = seen(page, samples, space="first")
        assert after.placing.reason == ""
        assert after.placing.covariance == last.covariance
        head = next(p.position for p in after.points if p.name == "viewer")
        expected = transform(rotation_from_wxyz(last.at[3:]), last.at[:3]) @ [*(WORLD_FROM_XR @ PLACES[0]), 1]
        np.testing.assert_allclose(head, expected[:3], atol=1e-5)
        # Whoever works at another scale is nowhere in the cell, however well the room is known.
        samples.clear()
        giant = seen(page, samples, space="first", scale=10.0)
        assert "works at scale 10" in giant.placing.reason
        # After a recentring the room lies elsewhere, and nobody knows where.
        samples.clear()
        assert "register it" in seen(page, samples, space="second").placing.reason


def test_a_place_that_was_measured_counts_with_its_error():
    known = Registering(at=0.01, at_turn=0.02)
    source = Headset(human="anna", name="headset", registration=known)
    offer = read(
        Tracking(human="anna", t=1.0, names=("viewer",), poses=np.eye(1, 7, 3, dtype="<f4").tobytes()), 0.0
    )
    mixed = offer._replace(placing=Placing(reason="nobody knows"))
    placed = source._placed(frame(mixed, layout_of(offer.names)), mixed).placing
    np.testing.assert_allclose(np.diag(np.reshape(placed.covariance, (6, 6))), [1e-4] * 3 + [4e-4] * 3)
    assert placed.reason == ""
    guessed = Headset(human="anna", name="headset")._placed(frame(mixed, layout_of(offer.names)), mixed)
    assert guessed.placing.reason == "nobody knows"


def test_more_touches_state_less_and_the_mechanism_forgets_with_the_page(server, page):
    page.sweep()
    answers = [answer for answer in page.corners() if answer.error is not None]
    assert answers[-1].error < answers[0].error
    assert server.offers._rooms
    page.step("forget")
    assert not server.offers._rooms


def test_one_that_was_touched_elsewhere_leaves_everything_in_doubt_until_it_is_taken_back(page):
    page.sweep()
    page.corners()
    bad = page.touch("corner_0", BOX[0], off=(0.08, 0, 0))
    assert "corner_0 contradicts the others" in bad.doubt
    assert page.step("drop").doubt == ""


def test_where_an_error_is_larger_than_what_is_accepted_nothing_rests_on_it(page):
    page.sweep()
    for k in range(3):
        answer = page.touch(f"corner_{k}", BOX[k], noise=0.06)
    assert "are accepted" in answer.doubt


@pytest.mark.parametrize(
    ("step", "word"),
    [("touch", "turn it about its tip first"), ("check", "tip first"), ("nudge", "nothing to move"),
     ("known", "nobody says how well"), ("restore", "not whole")],
)  # fmt: skip
def test_steps_that_cannot_be_made_say_why(page, step, word):
    poses = page.grips(np.zeros((3, 3)), np.tile(np.eye(3), (3, 1, 1)))
    answer = page.step(step, landmark="corner_1", poses=poses)
    assert not answer.accepted
    assert word in answer.reason


def test_a_controller_in_a_known_pose_counts_with_how_well_that_is_known(server, page):
    known = Registering(pose=0.002, pose_turn=0.005, level=0.0, limit=0.5)
    server.offers.wait("anna", "key", lambda _: None, known)
    poses = page.grips(np.zeros((3, 3)), np.tile(np.eye(3), (3, 1, 1)))
    assert "give its accuracy_turn" in page.step("known", landmark="corner_1", poses=poses).reason
    one, two = (page.step("known", landmark=f"board_{k}", poses=poses) for k in (1, 2))
    turned = [np.reshape(answer.covariance, (6, 6))[5, 5] for answer in (one, two)]
    np.testing.assert_allclose(turned, [1e-4 + 25e-6, 4e-4 + 25e-6])
    assert two.error >= one.error


def test_a_flange_is_touched_where_the_robot_is_heard_to_be_and_stands(server, live, page):
    page.sweep()
    assert "nobody has shown yet" in page.touch("flange", (0.5, 0.5, 1.0)).reason
    hub, call = server.hub, server.call

    def show(*snapshots):
        call(lambda: [hub.show(one) for one in snapshots])

    show(shown(1), shown(10, moved=0.05))
    assert "moves" in page.touch("flange", (0.55, 0.5, 1.0)).reason
    show(shown(200, doubts={"r": "not heard"}))
    assert "not heard" in page.touch("flange", (0.5, 0.5, 1.0)).reason
    show(shown(400))
    assert page.touch("flange", (0.5, 0.5, 1.0)).accepted
    show(shown(600, moved=0.6))
    answer = page.touch("flange", (1.1, 0.5, 1.0))
    assert answer.landmarks == ("flange", "flange")


def test_what_is_kept_from_another_session_counts_after_one_touch_of_a_landmark(page):
    page.sweep()
    known = page.corners()[-1]
    page.space = "tomorrow"
    kept = page.step("restore", by=(*known.at, *known.about, *known.covariance))
    assert "check it" in kept.doubt
    page.sweep()
    checked = page.touch("corner_3", BOX[3], step="check", noise=0)
    assert checked.doubt == ""
    assert "register anew" in page.touch("corner_3", BOX[3], step="check", off=(0.1, 0, 0)).doubt


def test_what_is_moved_by_hand_widens(page):
    page.sweep()
    before = page.corners()[-1]
    after = page.step("nudge", by=(0.01, 0, 0, 0, 0, 0))
    assert after.error > before.error
    np.testing.assert_allclose(np.subtract(after.at[:3], before.at[:3]), [0.01, 0, 0], atol=1e-6)


@pytest.mark.parametrize("poses", [b"\0" * 27, np.full(7, np.nan, "<f4").tobytes(), bytes(28)])
def test_what_contradicts_itself_ends_the_connection(page, poses):
    page.socket.send(
        msgspec.msgpack.encode(Register(id=1, human="anna", space="s", step="sweep", poses=poses))
    )
    assert page.end()[0] == 1007
