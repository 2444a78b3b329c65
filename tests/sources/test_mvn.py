"""MVN over real sockets: sent by the emulator, heard by the source, whatever happens on the way."""

from __future__ import annotations

import asyncio
import contextlib
import random
import socket
import threading

import numpy as np
import pytest
from made_mvnx import PERSON, Q, made
from test_bvh import ROOT
from test_bvh import made as made_bvh

from free_ports import free_port
from seerob.app.commands.emulate import options_of
from seerob.app.emulation.mvn_person import Pose, animated, followed, recorded, segments
from seerob.app.emulators.mvn import MvnSender, datagrams
from seerob.core.errors import InputError
from seerob.core.transforms import rotation_from_wxyz, wxyz_from_rotation
from seerob.description.humans.skeleton import BONES, bone_poses
from seerob.devices.live.listening import Listener
from seerob.devices.sources.mvn import BETTER_GONE, MOST_CHARACTERS, Frames, Mvn, Transport, Unit
from seerob.protocols.tracking.mvn import Header, Items, Kind, decode, encode, pack_items
from seerob.protocols.tracking.mvn_pose import SEGMENTS, names
from seerob.workstation.source import Target

PATIENCE = 120.0
TARGET = Target(name="op", joints=(), units=(), lower=(), upper=(), velocity=(), description=PERSON)


def posed(k):
    positions, rotations = segments(PERSON, Q[k])
    return Pose(positions, np.array([wxyz_from_rotation(R) for R in rotations]))


POSES = [posed(k) for k in range(len(Q))]


def playing(t):
    return POSES[round(60 * t) % len(POSES)]


def one(kind=Kind.QUATERNION, k=0, **options):
    return datagrams(kind, POSES[k % len(POSES)], **{"sample": k, "t": k / 60, **options})


def hear(source, count, **options):
    """So many frames from the emulator, and what it sent."""

    async def listen():
        found = []
        async with asyncio.timeout(PATIENCE):
            while len(found) < count:
                with contextlib.suppress(OSError):  # nobody sends yet
                    async with contextlib.aclosing(source.frames()) as frames:
                        async for layout, frame in frames:
                            found.append((layout, frame))
                            if len(found) == count:
                                break
        return found

    people = options.pop("people", {0: playing})
    with MvnSender(people, to=("127.0.0.1", source.port), **options):
        return asyncio.run(listen())


def stands_as_sent(frame):
    k = round(60 * frame.t) % len(POSES)
    np.testing.assert_allclose(frame.positions, POSES[k].positions, atol=1e-5)
    assert np.abs(np.einsum("ij,ij->i", frame.orientations, POSES[k].wxyz)).min() > 1 - 1e-6


# -- over sockets --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"units": 100.0, "kinds": (Kind.UNITY,)},
        {"kinds": (Kind.EULER, Kind.META), "old": True},
        {"items_each": 5, "way": lambda sent: random.Random(0).sample(sent, len(sent))},
    ],
    ids=["quaternions", "unity in cm", "euler, old header", "in shuffled pieces"],
)
def test_the_person_who_is_sent_is_heard(options):
    for layout, frame in hear(Mvn(human="op", port=free_port()), 10, **options):
        assert layout.names == SEGMENTS
        assert layout.convention == "xsens"
        stands_as_sent(frame)


def test_the_same_over_tcp():
    # Who connects has to find somebody: the source listens first.
    source = Mvn(human="op", port=free_port(socket.SOCK_STREAM), transport=Transport.TCP)

    async def listen():
        found, sender = [], MvnSender({0: playing}, to=("127.0.0.1", source.port), tcp=True)

        async def connect():
            while True:
                with contextlib.suppress(OSError):
                    await asyncio.to_thread(sender.start)
                    return
                await asyncio.sleep(0.01)

        joining = asyncio.create_task(connect())
        try:
            async with asyncio.timeout(PATIENCE):
                while len(found) < 10:
                    with contextlib.suppress(OSError):
                        async with contextlib.aclosing(source.frames()) as frames:
                            async for _, frame in frames:
                                found.append(frame)
                                if len(found) == 10:
                                    break
        finally:
            await joining
            await asyncio.to_thread(sender.stop)
        return found

    for frame in asyncio.run(listen()):
        stands_as_sent(frame)


def test_samples_pull_every_bone_to_where_it_was():
    """From the socket to the mailbox: what the twin is driven by, with the run's thread and clock."""
    source = Mvn(human="op", name="suit", port=free_port())
    heard, enough = [], threading.Event()

    def post(sample):
        heard.append(sample)
        if len(heard) >= 10:
            enough.set()

    with MvnSender({0: playing}, to=("127.0.0.1", source.port)):
        listener = Listener(source, TARGET, post)
        listener.start()
        assert enough.wait(PATIENCE)
        listener.ask_to_stop()
        assert listener.join(PATIENCE)
    for sample in heard:
        rotations, _ = bone_poses(PERSON, Q[round(60 * sample.t_device) % len(Q)])
        for point in sample.points:
            off = rotation_from_wxyz(point.wxyz).T @ rotations[BONES.index(point.bone)]
            assert np.trace(off) > 3 - 1e-5


def test_two_people_in_one_stream_are_told_apart():
    def aside(t):
        return Pose(playing(t).positions + np.array([5.0, 0.0, 0.0]), playing(t).wxyz)

    found = hear(Mvn(human="op", port=free_port()), 20, people={0: playing, 7: aside})
    assert {frame.subject for _, frame in found} == {"0", "7"}
    for _, frame in found:
        k = round(60 * frame.t) % len(POSES)
        shift = frame.positions - POSES[k].positions
        np.testing.assert_allclose(shift, np.tile([5.0 * (frame.subject == "7"), 0, 0], (23, 1)), atol=1e-5)


def test_what_is_in_the_stream_is_said_at_the_start():
    source = Mvn(human="op", port=free_port())
    with MvnSender({0: playing, 3: playing}, to=("127.0.0.1", source.port), units=100.0):

        async def ask():
            async with asyncio.timeout(PATIENCE):
                while True:
                    with contextlib.suppress(OSError):
                        return await source.ask()

        said = "\n".join(f"{f.level}: {f.text}" for f in asyncio.run(ask()))
    assert "note: mvn: character 0" in said
    assert "assumed: mvn: positions are in cm" in said
    assert "warning: mvn: characters 0, 3: the first that is heard is followed" in said


def test_silence_and_a_taken_port_are_errors_of_the_connection():
    async def first(source):
        async with contextlib.aclosing(source.frames()) as frames:
            return await anext(frames)

    source = Mvn(human="op", port=free_port())
    with pytest.raises(TimeoutError, match="nothing sent"):
        asyncio.run(first(source))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", source.port))
        with pytest.raises(OSError, match="in use"):
            asyncio.run(first(source))


# -- frames from datagrams -----------------------------------------------------------------------


def fed(frames, stream, arrived=0.0):
    found = [frames.feed(data, arrived) for data in stream]
    return [item[1] for item in found if item is not None]


def test_the_kind_that_says_more_is_used_and_the_other_when_it_is_gone():
    frames = Frames()
    assert len(fed(frames, [*one(Kind.EULER), *one(), *one(Kind.EULER, 1), *one(k=1)], 0.0)) == 3
    assert fed(frames, one(Kind.EULER, 2), 0.5) == []
    assert len(fed(frames, one(Kind.EULER, 3), 2 * BETTER_GONE)) == 1


@pytest.mark.parametrize(("units", "said"), [(1.0, "m"), (100.0, "cm")])
def test_the_unit_is_guessed_whatever_the_posture(units, said):
    for k in range(len(POSES)):
        frames = Frames()
        (frame,) = fed(frames, one(k=k, units=units))
        assert frames.characters[0].unit == said
        stands_as_sent(frame)


def test_a_unit_that_is_given_counts_and_is_doubted(caplog):
    (frame,) = fed(Frames(unit=Unit.CM), one())
    np.testing.assert_allclose(frame.positions, 0.01 * POSES[0].positions, atol=1e-6)
    assert "in cm its trunk is no person's, in m it is" in caplog.text


def test_a_stream_of_no_size_has_turns_but_no_positions(caplog):
    (frame,) = fed(Frames(), one(units=7.0))
    assert np.isnan(frame.positions).all()
    assert np.isfinite(frame.orientations).all()
    assert "in no unit" in caplog.text


def test_up_along_y_is_noticed(caplog):
    fallen = Pose(POSES[0].positions[:, [1, 2, 0]], POSES[0].wxyz)
    fed(Frames(), datagrams(Kind.QUATERNION, fallen, sample=0, t=0.0))
    assert 'give up = "y"' in caplog.text


def test_a_clock_that_stands_still_is_none():
    first, second, third = fed(Frames(), [one(k=k, t=0.0)[0] for k in range(3)])
    assert first.t == 0.0
    assert np.isnan([second.t, third.t]).all()


@pytest.mark.parametrize("bent", [False, True])
def test_joint_angles_are_compared_with_the_segments(caplog, bent):
    frames = Frames()
    (data,) = one(Kind.ANGLES)
    if bent:
        items = decode(data)
        assert isinstance(items, Items)
        angles = items.numbers()
        angles[8, 2] += 20.0
        data = encode(items.header, pack_items(items.ids, angles))
    fed(frames, [*one(), data])
    assert np.degrees(frames.characters[0].off) == pytest.approx(20.0 if bent else 0.0, abs=0.01)
    assert ("differ from those of its segments by 20.0°" in caplog.text) == bent


def test_the_t_pose_says_how_tall_and_meta_data_who():
    frames = Frames()
    fed(frames, [*one(Kind.SCALE), *one(Kind.META, name="Anna")])
    assert frames.characters[0].name == "Anna"
    assert frames.characters[0].stature == pytest.approx(1.8, abs=0.1)


def test_garbage_is_counted_and_told_once(caplog):
    frames = Frames()
    assert fed(frames, [b"", b"hello", one()[0][:40], *one()]) != []
    assert frames.refused == 3
    assert caplog.text.count("is not understood") == 1
    crowd = [data for k in range(MOST_CHARACTERS + 5) for data in one(character=k, k=k)]
    assert len(fed(Frames(), crowd)) == MOST_CHARACTERS


def test_props_come_after_the_body():
    values = np.hstack([POSES[0].positions, POSES[0].wxyz])
    header = Header(Kind.QUATERNION, 1, 0, True, 24, 0, 0, 23, 1, 0)
    data = encode(header, pack_items([*range(1, 24), 25], np.vstack([values, values[:1]])))
    layout, frame = Frames().feed(data, 0.0)
    assert layout.names == names(1)
    assert len(frame.positions) == 24


# -- what is played ------------------------------------------------------------------------------


def test_keyframes_and_recordings_can_be_sent(tmp_path):
    made(tmp_path / "x.mvnx", Q)
    again = recorded(tmp_path / "x.mvnx")
    for k in (0, 5, len(Q) - 2):
        np.testing.assert_allclose(again(k / 60).positions, POSES[k].positions, atol=1e-5)
    made_bvh(tmp_path / "x.bvh")
    joints = followed(tmp_path / "x.bvh", person=PERSON)(0.0)
    assert np.isfinite(joints.positions).all()
    assert np.linalg.norm(joints.positions[0] - ROOT[0][[2, 0, 1]]) < 0.1
    reach = animated("library:reach")
    assert np.isfinite(reach(3.0).positions).all()
    assert np.abs(reach(1.0).positions - reach(0.0).positions).max() > 0.01


def test_the_command_sends_what_it_is_told(tmp_path):
    made(tmp_path / "x.mvnx", Q)
    port = free_port()
    words = [
        "--file",
        str(tmp_path / "x.mvnx"),
        "--port",
        str(port),
        "--cm",
        "--rate",
        "60",
        "--noise",
        "0",
    ]
    server, what, where, *_ = options_of("mvn", words).ready()
    assert (what, where) == (f"a person, {tmp_path / 'x.mvnx'}", f"127.0.0.1:{port}")
    (data, *_) = server.instant(3)
    (frame,) = fed(Frames(unit=Unit.CM), [data])
    np.testing.assert_allclose(frame.positions, POSES[3].positions, atol=1e-5)
    (data, *_) = options_of("mvn", words[:-2]).ready().server.instant(3)
    (frame,) = fed(Frames(unit=Unit.CM), [data])
    off = frame.positions - POSES[3].positions
    assert 1e-4 < off.std() < 3e-4  # as it is measured
    with pytest.raises(InputError, match=r"<= 240 \[Hz\]"):
        options_of("mvn", ["--rate", "1000"])
