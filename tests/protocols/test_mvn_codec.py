"""MVN's datagrams: golden bytes, one pose in every kind, and whatever a network can do to them."""

from __future__ import annotations

import random
import struct

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from seerob.app.emulation.mvn_person import Pose
from seerob.app.emulators.mvn import datagrams
from seerob.protocols import ProtocolError
from seerob.protocols.tracking.mvn import (
    LATE,
    MAX_PARTS,
    MAX_WAITING,
    Assembly,
    Header,
    Items,
    Kind,
    Scale,
    ScalePoint,
    Skipped,
    Splitter,
    Tags,
    TimeCode,
    decode,
    encode,
    pack_items,
    pack_scale,
    pack_tags,
)
from seerob.protocols.tracking.mvn_pose import (
    FINGERS,
    JOINTS,
    PARENTS,
    SEGMENTS,
    UNITY,
    Up,
    looks_y_up,
    names,
    pose,
    unit_of,
)

RNG = np.random.default_rng(0)
STEPS = np.array([[0, 0, 0.1]] * 23) + RNG.uniform(-0.03, 0.03, (23, 3))


def somebody():
    positions = np.zeros((23, 3))
    positions[0] = 1.0, 2.0, 0.9
    for k in range(1, 23):
        positions[k] = positions[PARENTS[k]] + STEPS[k] * (1 if k < 15 else -1)
    return Pose(positions, Rotation.random(23, rng=RNG).as_quat(scalar_first=True))


WHO = somebody()


def parts(kind, **options):
    return datagrams(kind, WHO, **{"sample": 7, "t": 1.5, **options})


def whole(kind, **options):
    (data,) = parts(kind, **options)
    found = decode(data)
    assert isinstance(found, Items)
    return found


# -- bytes ---------------------------------------------------------------------------------------


def test_a_datagram_byte_by_byte_as_the_specification_lays_it_out():
    data = bytes.fromhex(
        "4d5854503032"  # MXTP02
        "00000102"  # sample 258
        "8001"  # the only part, one item
        "000003e8"  # 1000 ms
        "0217000000000020"  # character 2, 23 segments, no props, no fingers, reserved, 32 bytes
        "00000001"
        "3f800000400000004040000000000000"  # 1 2 3, 0
        "3f8000000000000000000000"  # 1 0 0
    )
    found = decode(data)
    assert found.header == Header(Kind.QUATERNION, 258, 0, True, 1, 1000, 2, 23)
    assert found.ids.tolist() == [1]
    assert found.values.tolist() == [[1, 2, 3, 0, 1, 0, 0]]
    assert encode(found.header, pack_items(found.ids, found.values)) == data


def test_three_parts_are_numbered_0_1_and_0x82():
    assert [data[10] for data in parts(Kind.QUATERNION, items_each=10)] == [0, 1, 0x82]


def test_the_point_of_the_specification():
    assert 256 * 1 + 13 == 269
    found = decode(encode(Header(Kind.POINTS, 1, 0, True, 1, 0, 0), pack_items([269], np.ones((1, 3)))))
    assert found.ids[0] >> 8 == SEGMENTS.index("Pelvis") + 1


def test_names_and_their_order():
    assert len(SEGMENTS) == 23
    assert sorted(UNITY) == sorted(SEGMENTS)
    assert len(JOINTS) == 22
    assert all(parent < k for k, parent in enumerate(PARENTS))
    full = names(2, FINGERS)
    assert (len(full), len(set(full))) == (65, 65)
    assert full[23:26] == ("Prop1", "Prop2", "LeftCarpus")
    assert full.index("RightCarpus") == 43 + 2  # table 2


@pytest.mark.parametrize("with_length", [False, True])
def test_meta_data_skips_what_it_does_not_know(with_length):
    text = b"name:Anna \xc3\x84\nnew:1\nxmid:00A1\nnonsense\ncolor:ff0000\n"
    payload = struct.pack(">I", len(text)) + text if with_length else text
    found = decode(encode(Header(Kind.META, 1, 0, True, 0, 0, 0), payload))
    assert isinstance(found, Tags)
    assert found.tags == {"name": "Anna Ä", "new": "1", "xmid": "00A1", "color": "ff0000"}
    assert decode(encode(found.header, pack_tags(found.tags))).tags == found.tags


def test_scale_comes_back():
    point = ScalePoint(7, 1, "pTopOfHead", 3, (0.0, 0.5, 0.25))
    found = decode(encode(Header(Kind.SCALE, 1, 0, True, 2, 0, 0), pack_scale([("L5", (1, 2, 3))], [point])))
    assert isinstance(found, Scale)
    assert found.segments == (("L5", (1.0, 2.0, 3.0)),)
    assert found.points == (point,)


@pytest.mark.parametrize("payload", [b"01:02:03.450", b"\0\0\0\x0c01:02:03.450"])
def test_time_code(payload):
    found = decode(encode(Header(Kind.TIME_CODE, 1, 0, True, 1, 0, 0), payload))
    assert isinstance(found, TimeCode)
    assert found.seconds == pytest.approx(3723.45)


@pytest.mark.parametrize("numbers", [3, 9])
def test_centre_of_mass_alone_and_with_its_rates(numbers):
    payload = struct.pack(f">{numbers}f", *range(numbers))
    found = decode(encode(Header(Kind.MASS_CENTER, 1, 0, True, 1, 0, 0), payload))
    assert found.values.tolist() == [list(range(numbers))]


def test_an_unknown_kind_is_skipped():
    data = b"MXTP77" + encode(Header(Kind.META, 1, 0, True, 0, 0, 0), b"anything")[6:]
    assert isinstance(decode(data), Skipped)


@pytest.mark.parametrize(
    ("data", "complaint"),
    [
        (b"", "0 bytes"),
        (b"HTTP/1.1 200 OK\r\n\r\n0123456789", "begins with"),
        (parts(Kind.QUATERNION)[0][:-1], "cut short"),
        (encode(Header(Kind.QUATERNION, 1, 0, True, 1, 0, 0), bytes(33)), "no multiple"),
        (encode(Header(Kind.SCALE, 1, 0, True, 1, 0, 0), b"\xff" * 8), "do not fit"),
        (
            encode(Header(Kind.SCALE, 1, 0, True, 1, 0, 0), struct.pack(">Ii", 1, -1) + bytes(16)),
            "does not fit",
        ),
        (encode(Header(Kind.TIME_CODE, 1, 0, True, 1, 0, 0), b"25 o'clock"), "HH:MM:SS"),
        (encode(Header(Kind.MASS_CENTER, 1, 0, True, 1, 0, 0), bytes(8)), "neither a position"),
    ],
)
def test_what_is_wrong_is_said(data, complaint):
    with pytest.raises(ProtocolError, match=complaint):
        decode(data)


# -- one pose, whatever it comes in --------------------------------------------------------------


@pytest.mark.parametrize("units", [1.0, 100.0])
@pytest.mark.parametrize("kind", [Kind.QUATERNION, Kind.EULER, Kind.UNITY])
@pytest.mark.parametrize("old", [False, True])
def test_the_same_person_in_every_kind(kind, units, old):
    found, positions, turns = pose(whole(kind, units=units, old=old), lengths=1 / units)
    assert found == SEGMENTS
    np.testing.assert_allclose(positions, WHO.positions, atol=2e-6)
    assert np.abs(np.einsum("ij,ij->i", turns, WHO.wxyz)).min() > 1 - 1e-6
    assert unit_of(units * positions) == ("m" if units == 1 else "cm")


def test_quaternions_with_y_up():
    up = Pose(WHO.positions[:, [1, 2, 0]], WHO.wxyz[:, [0, 2, 3, 1]])
    (data,) = datagrams(Kind.QUATERNION, up, sample=1, t=0.0)
    _, positions, turns = pose(decode(data), up=Up.Y, lengths=1.0)
    np.testing.assert_allclose(positions, WHO.positions, atol=1e-6)
    assert np.abs(np.einsum("ij,ij->i", turns, WHO.wxyz)).min() > 1 - 1e-6
    assert looks_y_up(up.positions)
    assert not looks_y_up(WHO.positions)


def test_left_handed_turns_are_seen_in_a_mirror():
    """A turn to the left about up is one to the right in Unity's frame."""
    turn = Rotation.from_euler("z", 90, degrees=True).as_quat(scalar_first=True)
    values = np.zeros((23, 7))
    values[:, 3] = 1.0
    values[0, 3:] = turn[0], 0.0, -turn[3], 0.0  # -90° about Unity's y
    values[1:, 1] = 0.1
    _, _, turns = pose(Items(Header(Kind.UNITY, 1, 0, True, 23, 0, 0), np.arange(1, 24), values), lengths=1.0)
    np.testing.assert_allclose(turns, np.tile(turn, (23, 1)), atol=1e-12)


def test_what_was_not_sent_or_is_no_number_is_not_known():
    values = np.hstack([WHO.positions, WHO.wxyz])
    values[3, 0] = np.nan
    values[4, 3:] = 0.0
    values[5, 3:] *= 2.0
    values[6, 1] = 1e30
    keep = [k for k in range(23) if k != 10]
    items = Items(Header(Kind.QUATERNION, 1, 0, True, 22, 0, 0), np.array(keep) + 1, values[keep])
    _, positions, turns = pose(items, lengths=1.0)
    assert np.flatnonzero(np.isnan(positions).any(axis=1)).tolist() == [3, 6, 10]
    assert np.flatnonzero(np.isnan(turns).any(axis=1)).tolist() == [4, 5, 10]


def test_props_and_fingers_have_names():
    ids = np.array([*range(1, 24), 25, *range(25 + 1, 25 + 41)])
    values = np.tile([0, 0, 0, 1, 0, 0, 0.0], (len(ids), 1))
    header = Header(Kind.QUATERNION, 1, 0, True, len(ids), 0, 0, 23, 1, 40)
    found, _, _ = pose(Items(header, ids, values), lengths=1.0)
    assert found == names(1, 40)


@pytest.mark.parametrize("number", [0, -1, 1000])
def test_a_segment_that_is_none(number):
    items = Items(Header(Kind.QUATERNION, 1, 0, True, 1, 0, 0), np.array([number]), np.ones((1, 7)))
    with pytest.raises(ProtocolError, match="number"):
        pose(items, lengths=1.0)


def test_a_crowd_of_segments_is_refused():
    ids = np.full(2000, 30)
    with pytest.raises(ProtocolError, match="beyond the body's"):
        pose(Items(Header(Kind.QUATERNION, 1, 0, True, 0, 0, 0), ids, np.ones((2000, 7))), lengths=1.0)


# -- the way -------------------------------------------------------------------------------------


def fed(stream):
    assembly = Assembly()
    found = [assembly.feed(decode(data)) for data in stream]
    return [items for items in found if items is not None], assembly.losses


def test_parts_in_any_order_and_twice_make_the_same_sample():
    pieces = parts(Kind.QUATERNION, items_each=5)
    for seed in range(20):
        stream = pieces + random.Random(seed).choices(pieces, k=2)
        random.Random(seed).shuffle(stream)
        (items,), losses = fed(stream)
        assert items.values.tolist() == whole(Kind.QUATERNION).values.tolist()
        assert losses.doubled == 2


def test_samples_of_two_people_and_two_kinds_interleave():
    stream = [
        piece
        for sample in range(5)
        for pieces in zip(
            parts(Kind.QUATERNION, items_each=12, sample=sample),
            parts(Kind.QUATERNION, items_each=12, sample=sample, character=3),
            parts(Kind.ANGLES, items_each=12, sample=sample),
            strict=True,
        )
        for piece in pieces
    ]
    found, losses = fed(stream)
    assert len(found) == 15
    assert not losses


def test_the_newest_wins_and_what_is_lost_is_counted():
    def one(sample):
        return parts(Kind.QUATERNION, sample=sample)[0]

    first, _second = parts(Kind.QUATERNION, items_each=12, sample=3)
    found, losses = fed([one(1), first, one(5), one(4), one(5)])
    assert [items.header.sample for items in found] == [1, 5]
    assert (losses.incomplete, losses.late, losses.doubled, losses.skipped) == (1, 1, 1, 3)


def test_a_recording_that_begins_anew_and_a_counter_that_turns_over():
    def samples(*numbers):
        found, losses = fed([parts(Kind.QUATERNION, sample=n)[0] for n in numbers])
        return [items.header.sample for items in found], losses.late

    assert samples(500, 501, 0, 1) == ([500, 501, 0, 1], 0)
    assert samples(500, 500 - LATE) == ([500], 1)
    assert samples(2**32 - 1, 0, 2**32 - 2) == ([2**32 - 1, 0], 1)


def test_a_piece_of_one_recording_is_not_completed_by_the_next():
    first, second = parts(Kind.QUATERNION, items_each=12, sample=100)
    later = [data for n in range(100) for data in parts(Kind.QUATERNION, items_each=12, sample=n)]
    found, losses = fed([first, *later, second])
    assert [items.header.sample for items in found] == [*range(100)]
    assert losses.incomplete == 1


def test_pieces_that_never_end_take_no_memory():
    assembly = Assembly()
    for sample in range(0, 100_000, 100):
        for part in (0, 1, MAX_PARTS, 0x7F):
            header = Header(Kind.QUATERNION, sample, part, False, 0, 0, sample % 7)
            assembly.feed(Items(header, np.zeros(0, np.int32), np.zeros((0, 7))))
    assert len(assembly._waiting) <= MAX_WAITING
    assert assembly.losses.incomplete > 900


def test_a_stream_cut_anywhere():
    whole_stream = (
        parts(Kind.QUATERNION) + parts(Kind.ANGLES, old=True) + parts(Kind.META) + parts(Kind.SCALE)
    )
    stream = b"".join(whole_stream)
    for seed in range(10):
        splitter, found, at = Splitter(), [], 0
        while at < len(stream):
            step = random.Random(seed + at).randint(1, 400)
            found += splitter.feed(stream[at : at + step])
            at += step
        assert found == whole_stream


def test_a_stream_of_something_else():
    with pytest.raises(ProtocolError, match="begins with"):
        Splitter().feed(b"GET / HTTP/1.1\r\nHost: example\r\n\r\n")


def mangled(rng, data):
    """A datagram after a bad way."""
    broken = bytearray(data)
    for _ in range(rng.randint(0, 8)):
        broken[rng.randrange(len(broken))] = rng.randrange(256)
    broken = broken[: rng.randint(0, len(broken))] if rng.random() < 0.4 else broken
    return bytes(broken + rng.randbytes(rng.randint(0, 40) if rng.random() < 0.3 else 0))


def test_mangled_datagrams_are_refused_or_flagged():
    rng = random.Random(1)
    kinds = [k for k in Kind if k not in {Kind.POINTS, Kind.TRACKERS}]
    good = [data for kind in kinds for data in parts(kind)]
    assembly, refused = Assembly(), 0
    for _ in range(4000):
        try:
            found = decode(mangled(rng, rng.choice(good)))
            if isinstance(found, Items) and (items := assembly.feed(found)) is not None:
                _, positions, turns = pose(items, lengths=1.0)
                assert np.isnan(positions).any() or (np.abs(positions) <= 1e6).all()
                known = turns[np.isfinite(turns).all(axis=1)]
                np.testing.assert_allclose(np.linalg.norm(known, axis=1), 1.0, atol=1e-9)
        except ProtocolError:
            refused += 1
    assert 500 < refused < 3900
