"""A page that offers what a headset sees, over the connection it has anyway."""

import asyncio
import time
from contextlib import contextmanager

import msgspec
import numpy as np
import pytest
from websockets.exceptions import InvalidStatus

from seerob.app.emulation.mvn_person import Pose, segments
from seerob.app.emulators.headset import seen as visitor
from seerob.app.server.access import Tokens
from seerob.app.server.live import Live
from seerob.app.server.serving import Server
from seerob.core.samples import BodySample
from seerob.core.snapshot import Tracked, Tracking
from seerob.core.transforms import wxyz_from_rotation
from seerob.description.capture.calibration import POSTURES, CalibrationPose
from seerob.description.capture.estimated import estimated
from seerob.description.capture.following import Following
from seerob.description.capture.mapping import conventions
from seerob.description.humans import manikin
from seerob.description.humans.angles import angles
from seerob.description.humans.posture import posture
from seerob.description.humans.skeleton import bone_poses
from seerob.devices.capture.options import Calibration
from seerob.devices.capture.stream_source import _Hearing
from seerob.devices.live.headset_offers import LONGEST_NAME, MOST_NAMES, SHORTEST, Offer, Offers, now, read
from seerob.devices.live.listening import Listener
from seerob.devices.live.receivers import Receivers
from seerob.devices.sources.headset import Headset, frame, layout_of
from server.frames import MESHES, PATIENCE, Visitor, scene

POINTS = ("viewer", "left-grip", "right-grip")
PLACES = np.array([[0.0, 1.7, 0.0], [-0.3, 1.0, -0.4], [0.3, 1.0, -0.4]])
TOKENS = Tokens.made()


class Page(Visitor):
    """A page in a headset."""

    _decoder = msgspec.msgpack.Decoder()

    def see(self, k=0, *, human="anna", names=POINTS, places=PLACES, **more):
        poses = np.column_stack([places, np.tile([1.0, 0, 0, 0], (len(places), 1))]).astype("<f4").tobytes()
        said = {"human": human, "t": 1.0 + k / 72, "names": tuple(names), "poses": poses} | more
        self.socket.send(msgspec.msgpack.encode(Tracking(**said)))

    def answer(self, timeout=PATIENCE):
        while True:
            data = self.socket.recv(timeout=timeout)
            if b"tracked" in data[:20]:
                return msgspec.msgpack.decode(data, type=Tracked)


@pytest.fixture(name="server")
def a_server():
    with Server(scene=scene(), meshes=MESHES, feed=Live(), port=0) as server:
        yield server


@contextmanager
def heard(server):
    """What a run that shows these pages hears of the headset."""
    samples = []
    source = Headset(human="anna", name="headset", timeout=1.0).taking(server.offers)
    listener = Listener(source, None, samples.append)
    listener.start()
    end = time.monotonic() + PATIENCE
    while "anna" not in server.offers._waiting and time.monotonic() < end:
        time.sleep(0.005)
    yield samples
    listener.ask_to_stop()
    assert listener.join(PATIENCE)
    assert "anna" not in server.offers._waiting


@pytest.fixture(name="samples")
def a_source(server):
    with heard(server) as samples:
        yield samples


def seen(page, samples, enough=1, **more):
    """Offer until the source has said something."""
    end, k = time.monotonic() + PATIENCE, 0
    while len(samples) < enough and time.monotonic() < end:
        # What is said again to the last bit is no news.
        page.see(k, **({"places": np.array(PLACES) + 3e-7 * (k % 3)} | more))
        k += 1
        time.sleep(0.01)
    assert len(samples) >= enough
    return samples[-1]


def test_three_points_arrive_as_pulls_on_head_and_hands(server, samples):
    with Page(server) as page:
        sample = seen(page, samples, 3)
        assert page.answer() == Tracked(human="anna", accepted=True)
    points = {p.name: p for p in sample.points}
    assert {p.bone for p in sample.points} == {"head", "left_hand", "right_hand"}
    # x forward, y left, z up of x right, y up, z backward
    np.testing.assert_allclose(points["viewer"].position, [0, 0, 1.7], atol=1e-6)
    np.testing.assert_allclose(points["left-grip"].position, [0.4, 0.3, 1.0], atol=1e-6)


def test_what_is_not_tracked_or_only_estimated_is_said(server, samples):
    places = PLACES.copy()
    places[1] = np.nan
    with Page(server) as page:
        sample = seen(page, samples, places=places, guessed=b"\0\0\1")
    points = {p.name: p for p in sample.points}
    assert points["left-grip"].position is None
    assert points["right-grip"].confidence < points["viewer"].confidence == 1.0


def test_a_whole_body_fits_into_a_message(server, samples):
    body = [f"joint-{k}-of-the-body" for k in range(MOST_NAMES - 4)]
    names = ("viewer", "hips", "left-foot-ankle", "right-foot-ankle", *body)
    with Page(server) as page:
        sample = seen(page, samples, names=names, places=np.full((len(names), 3), 0.5))
    assert {p.bone for p in sample.points} == {"head", "pelvis", "left_foot", "right_foot"}


@pytest.mark.parametrize("scale", [10.0, 0.1])
def test_who_works_at_another_scale_is_told_of_by_posture_alone(server, samples, scale):
    with Page(server) as page:
        own = seen(page, samples)
        assert own.placing is None
        assert {p.name: p.position for p in seen(page, samples, 2).points}
        after = len(samples) + 1
        scaled = seen(page, samples, after, scale=scale)
    assert f"works at scale {scale:g}" in scaled.placing.reason
    # In their own metres: who reaches out by 40 cm does so at any size.
    before, now = ({p.name: p.position for p in sample.points} for sample in (own, scaled))
    np.testing.assert_allclose(now["left-grip"], before["left-grip"], atol=1e-5)


def test_whoever_comes_after_nobody_came_for_long_is_taken_at_once(monkeypatch):
    monkeypatch.setattr("seerob.devices.sources.headset.SILENCE", 0.05)
    place, page = Offers(), object()
    source = Headset(human="anna", name="headset", timeout=0.05).taking(place)
    message = Tracking(human="anna", t=0.0, names=("viewer",), poses=np.zeros(7, "<f4").tobytes())
    offer = read(message, now())
    assert place.offer("anna", page, offer).startswith("nothing in this run waits")

    async def waited():
        with pytest.raises(TimeoutError, match="no page offers"):
            await anext(source._offers(place))
        assert place.offer("anna", page, offer._replace(arrived=now())) == "", "it is about to be back"
        again = source._offers(place)
        coming = asyncio.ensure_future(anext(again))
        await asyncio.wait((coming,), timeout=0.3)
        assert not coming.done(), "that nobody is there is said once"
        assert place.offer("anna", page, offer._replace(arrived=now())) == ""
        assert (await coming).t == 0.0
        with pytest.raises(TimeoutError, match="no page offers"):  # whoever has left is missed
            await anext(again)

    asyncio.run(waited())


def test_nobody_waits_for_it(server):
    with Page(server) as page:
        page.see(human="berta")
        answer = page.answer()
    assert not answer.accepted
    assert "nothing in this run waits for a headset of 'berta'" in answer.reason


def test_a_page_of_another_run_of_the_process_is_nobodys_headset(server, samples):
    with Server(scene=scene(), meshes=MESHES, feed=Live(), port=0) as other, Page(other) as page:
        page.see()
        assert "nothing in this run waits" in page.answer().reason
    assert samples == []


def test_a_run_hands_its_pages_offers_to_its_headset(server):
    headset = Headset(human="anna", name="headset", timeout=1.0)
    with Receivers([(headset, None)], server.offers) as receivers, Page(server) as page:
        samples, end = (), time.monotonic() + PATIENCE
        while not samples and time.monotonic() < end:
            page.see(int(1e3 * time.monotonic()))
            samples = receivers.take()
            time.sleep(0.01)
    assert samples[0].target == "anna"


def test_one_page_per_person_until_it_leaves(server, samples):
    with Page(server) as second:
        with Page(server) as first:
            seen(first, samples)
            assert first.answer().accepted
            second.see()
            assert "another page is the headset" in second.answer().reason
        end = time.monotonic() + PATIENCE
        answer = Tracked(human="anna", accepted=False)
        while not answer.accepted and time.monotonic() < end:
            second.see(500)
            try:
                answer = second.answer(timeout=0.1)
            except TimeoutError:
                continue
        assert answer.accepted


@pytest.mark.parametrize(
    "wrong",
    [
        {"names": ("viewer", "viewer", "x")},
        {"names": ()},
        {"names": ("viewer", "left-grip", "x" * (LONGEST_NAME + 1))},
        {"poses": b""},
        {"poses": bytes(28 * 3 + 1)},
        {"guessed": b"\0"},
        {"t": float("nan")},
        {"t": -1.0},
        {"human": "a" * (LONGEST_NAME + 1)},
        {"scale": 0.0},
        {"scale": float("nan")},
        {"scale": 1e3},
        {"stands": "handstand"},
    ],
)
def test_an_offer_that_contradicts_itself_is_turned_away(server, wrong):
    with Page(server) as page:
        page.see(**wrong)
        assert page.end(PATIENCE)[0] == 1007


def test_without_the_token_nobody_offers():
    with Server(scene=scene(), meshes=MESHES, feed=Live(), port=0, tokens=TOKENS) as server:
        with pytest.raises(InvalidStatus, match="401"):
            Page(server)
        with pytest.raises(InvalidStatus, match="403"):
            Page(server, path=f"/ws?token={TOKENS.track}", origin="https://elsewhere.example")
        with Page(server, path=f"/ws?token={TOKENS.track}") as page:
            page.see(human="nobody")
            assert not page.answer().accepted


@pytest.mark.parametrize("role", ["view", "control"])
def test_who_may_only_look_is_nobodys_headset(role):
    with (
        Server(scene=scene(), meshes=MESHES, feed=Live(), port=0, tokens=TOKENS) as server,
        heard(server) as samples,
    ):
        with Page(server, path=f"/ws?token={getattr(TOKENS, role)}") as looker:
            for k in range(50):
                looker.see(k)
            answer = looker.answer()
            assert not answer.accepted
            assert "for tracking" in answer.reason
        assert samples == []
        with Page(server, path=f"/ws?token={TOKENS.track}") as tracker:
            seen(tracker, samples)
    refused = [v.refused for v in server.visits.take() if v.role == role and v.event == "left"]
    assert 1 <= next(iter(refused[0].values())) <= 50


def test_of_limbs_that_nobody_sees_nothing_is_scored():
    three = estimated({"head", "left_hand", "right_hand"})
    assert {"pelvis", "lumbar", "thorax", "left_thigh", "right_shank", "left_foot"} <= set(three)
    assert not {"head", "left_hand"} & set(three)
    assert "left_upper_arm" in three
    six = estimated({"pelvis", "head", "left_foot", "right_foot", "left_hand", "right_hand"})
    assert {"thorax", "left_forearm", "right_shank"} <= set(six)
    assert "left_toes" not in six
    assert {"viewer", "leftgrip"} <= conventions()["webxr"].places.keys()


def test_a_body_that_appears_later_is_taken_up(server, samples):
    body = (*POINTS, "hips", "left-foot-ankle", "right-foot-ankle")
    with Page(server) as page:
        seen(page, samples, 2)
        before, k, end = len(samples), 5000, time.monotonic() + PATIENCE
        while not any(len(s.points) == 6 for s in samples[before:]) and time.monotonic() < end:
            page.see(k, names=body, places=np.full((6, 3), 0.5))
            k += 1
            time.sleep(0.01)
    assert {p.bone for p in samples[-1].points} >= {"pelvis", "left_foot", "head"}


def test_ten_thousand_offers_a_second_are_not_ten_thousand_samples(server, samples):
    with Page(server) as page:
        seen(page, samples)
        begun = time.monotonic()
        for k in range(9000, 9500):
            page.see(k)
        page.see(9999, human="nobody")
        while page.answer().human != "nobody":
            pass
        passed = time.monotonic() - begun
    taken = [s for s in samples if s.t_device >= 1 + 9000 / 72]  # not what was on its way before
    assert len(taken) <= passed / SHORTEST + 1


TPOSE = np.array([[0.0, 1.638, -0.0875], [-0.895, 1.4315, 0.0], [0.895, 1.4315, 0.0]])
"""Where a person of 1.75 m has eyes and controllers, arms to the sides."""


def fitted(page, samples, places, sway=0.0):
    """What the page is told after its wearer stood so, and the sample of a picture after that."""
    for k in range(12):
        page.see(1000 + k, places=places + sway * (-1) ** k + 3e-7 * (k % 3), stands="tpose")
        time.sleep(2 * SHORTEST)
    end, k, answer, told = time.monotonic() + PATIENCE, 2000, None, None
    after = []
    while not after and time.monotonic() < end:
        page.see(k, places=places + 3e-7 * (k % 3))
        k += 1
        if told is None:
            try:
                answer = page.answer(timeout=0.02)
            except TimeoutError:
                continue
            # What is seen from now on is seen as it was fitted; another may be on its way.
            told = None if answer.fits is None else (len(samples), 1 + (k - 0.5) / 72)
        else:
            time.sleep(0.01)
            later = [each for each in samples[told[0] :] if isinstance(each, BodySample)]
            after = [each for each in later if each.t_device > told[1]]
    return answer, after[-1]


def test_who_stands_with_arms_to_the_sides_is_fitted(server, samples):
    """How controllers lie in the hands, and who is of another stature than the file says."""
    held = TPOSE + np.array([[0, 0, 0], [-0.03, 0, 0], [0.03, 0, 0]])
    with Page(server) as page:
        before = seen(page, samples)
        assert page.answer().fits is None
        answer, after = fitted(page, samples, held)
        assert answer.fits
        assert answer.taller == pytest.approx(1.0, abs=1e-3)
        at = {point.name: np.array(point.at) for point in after.points}
        old = {point.name: np.array(point.at) for point in before.points}
        assert np.linalg.norm(at["left-grip"] - old["left-grip"]) == pytest.approx(0.03, abs=1e-3)
        assert after.placing is None
    # Whoever puts it on next has not done that.
    with Page(server) as page:
        anew = seen(page, samples, len(samples) + 1)
        assert {point.name: point.at for point in anew.points} == {p.name: p.at for p in before.points}
        answer, after = fitted(page, samples, TPOSE * 0.94)
        assert answer.fits
        assert answer.taller == pytest.approx(0.94, abs=2e-3)
        assert "6 % smaller" in answer.found
        assert answer.found == after.placing.reason


def test_who_does_not_stand_still_is_not_fitted(server, samples):
    with Page(server) as page:
        seen(page, samples)
        page.answer()
        answer, after = fitted(page, samples, TPOSE, sway=0.05)
        assert answer.fits is False
        assert "stand still" in answer.found
        assert after.placing is None


def worn(*, calibrated, blind=()):
    """Somebody who turns neck and wrist, as a headset sees them that does not track the names in `blind`.

    Returns:
        What nothing tells of their posture, its angles as they are captured, and as they are.
    """
    person = manikin.build(name="anna", stature=1.75, mass=75.0, sex="male")
    calibration = Calibration(pose=CalibrationPose.NPOSE if calibrated else CalibrationPose.NONE)
    source = Headset(human="anna", name="headset", calibration=calibration)
    hearing, following = _Hearing(source, person), Following(person, np.eye(4))
    upright = posture(person, POSTURES[CalibrationPose.NPOSE])
    turns = {"neck_turn_left_deg": 30.0, "right_wrist_ulnar_deviation_deg": 20.0}
    bent = posture(person, turns | POSTURES[CalibrationPose.NPOSE])
    layout, found = None, []
    for k in range(200):
        places, turns = segments(person, upright if k < 80 else bent)
        pose = Pose(places, np.array([wxyz_from_rotation(turn) for turn in turns]))
        names, poses = visitor(lambda _, pose=pose: pose, body=True)(0.0)
        poses[[name in blind for name in names]] = np.nan
        layout = layout or layout_of(names)
        t, places = k / 72, poses[:, :3] + 1e-6 * (k % 3)
        offer = Offer(t, t, names, places, poses[:, 3:], (False,) * len(names))
        sample = hearing.take(layout, frame(offer, layout), t)
        if isinstance(sample, BodySample):
            following.hear(sample)
            found += following.until(t)
    return found[-1].undetermined, *(angles(*bone_poses(person, q)) for q in (found[-1].q, bent))


def test_turns_of_headset_and_controllers_count_once_it_is_known_how_they_are_worn():
    untold, captured, said = worn(calibrated=True)
    assert untold == frozenset()
    for name in ("neck_twist", "wrist_deviation", "wrist_flexion", "forearm_rotation"):
        np.testing.assert_allclose(
            getattr(captured, name), getattr(said, name), atol=np.radians(3.0), err_msg=name
        )
    bent = "wrist_flexion", "wrist_deviation", "forearm_rotation"
    wrists = {(what, side) for what in bent for side in range(2)}
    uncalibrated, *_ = worn(calibrated=False)
    assert uncalibrated == wrists | {("neck_twist", 0), ("neck_side_bend", 0)}
    one_lost, *_ = worn(calibrated=True, blind=("viewer", "left-grip"))
    assert one_lost == {
        *((what, 1) for what in bent),
        *((f"neck_{w}", 0) for w in ("flexion", "twist", "side_bend")),
    }
