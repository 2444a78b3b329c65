"""FRI bytes: what the maker's own programs answer, and whatever a network can do to a datagram."""

from __future__ import annotations

import random
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from seerob.protocols import ProtocolError
from seerob.protocols.links.protobuf_wire import doubles, fields, message, varint, whole
from seerob.protocols.robots.fri import (
    COMMAND,
    LARGEST,
    Answer,
    Edition,
    Monitoring,
    SessionState,
    answer_to,
    decode_answer,
    decode_monitoring,
    encode_answer,
    encode_monitoring,
)

Q = (0.1, 0.2, 0.3, -1.2, 0.5, 0.6, 0.7)
POSE = (512.5, -3.0, 640.25, 0.5, -0.5, 0.5, 0.5)
GOLDEN = [
    (
        Answer(Edition.V1, 0, 0, Q),
        "0a080881800d1000180012410a3f099a9999999999b93f099a9999999999c93f09333333333333d33f"
        "09333333333333f3bf09000000000000e03f09333333333333e33f09666666666666e63f",
    ),
    (Answer(Edition.V2, 0, 0), "0a080881800d10001800"),
    (Answer(Edition.V2_7, 0, 0), "0a0000000a080881800d10001800fbbfd686"),
    (Answer(Edition.V2_7, 1, 1), "0a0000000a080881800d100118015ae513f0"),
]
FULL = {
    "sequence": 7,
    "reflected": 6,
    "session": SessionState.MONITORING_READY,
    "quality": 3,
    "send_period": 5,
    "receive_multiplier": 2,
    "safety": 1,
    "drives": (2,) * 7,
    "operation": 2,
    "control": 0,
    "q": Q,
    "tau": tuple(10 * x for x in Q),
    "external_tau": (0.5,) * 7,
    "time": 1_700_000_000.25,
    "io": (("MediaFlange.In1", 0.75),),
}
numbers = st.tuples(*[st.floats(-3.2, 3.2)] * 7)


def full(edition, **more):
    commanded = {"commanded_q": Q} if edition is Edition.V1 else {"tcp": POSE}
    return Monitoring(edition=edition, **(FULL | commanded | more))


@pytest.mark.parametrize(("answer", "datagram"), GOLDEN)
def test_answers_of_the_makers_own_programs(answer, datagram):
    assert encode_answer(answer).hex() == datagram
    assert decode_answer(bytes.fromhex(datagram), answer.edition) == answer


@pytest.mark.parametrize("edition", Edition)
def test_edition_is_told_by_the_datagram(edition):
    assert decode_monitoring(encode_monitoring(full(edition))) == full(edition)


@given(q=numbers, tau=numbers, sequence=st.integers(0, 2**32 - 1), edition=st.sampled_from(Edition))
def test_what_is_sent_is_what_is_read(q, tau, sequence, edition):
    m = full(edition, q=q, tau=tau, sequence=sequence)
    assert decode_monitoring(encode_monitoring(m)) == m


def test_packed_joints_are_the_same_joints():
    packed = message(1, message(1, struct.pack("<7d", *Q)))
    header = message(1, whole(1, 0x245142) + whole(2, 0) + whole(3, 0))
    one_by_one = header + message(3, message(1, doubles(1, Q)))
    assert decode_monitoring(header + message(3, packed)) == decode_monitoring(one_by_one)


@pytest.mark.parametrize(
    ("pose", "heard"),
    [(struct.pack("<7d", *POSE), POSE), (struct.pack("<6d", *POSE[:6]), ()), (b"", ())],
)
def test_a_packed_pose_is_the_same_pose_and_half_of_one_is_none(pose, heard):
    measured = message(1, doubles(1, Q)) + message(9, message(1, b"any name") + message(2, pose))
    header = message(1, whole(1, 0x245142) + whole(2, 0) + whole(3, 0))
    assert decode_monitoring(header + message(3, measured)).tcp == heard


@pytest.mark.parametrize("edition", Edition)
def test_monitoring_is_answered_and_never_commanded(edition):
    assert answer_to(full(edition, session=SessionState.IDLE), 0) is None
    answer = answer_to(full(edition), 3)
    assert (answer.sequence, answer.reflected) == (3, 7)
    assert answer.q == (Q if edition is Edition.V1 else ())
    # An overlay that somebody has started is answered with the controller's own joints.
    own = tuple(x + 0.01 for x in Q)
    assert answer_to(full(edition, session=SessionState.COMMANDING_ACTIVE, ipo_q=own), 0).q == own


@pytest.mark.parametrize(
    ("datagram", "says"),
    [
        (b"", "without a header"),
        (bytes(LARGEST + 1), "1500 at most"),
        (encode_answer(Answer(Edition.V2, 0, 0)), f"0x{COMMAND:x}"),
        (message(1, whole(1, 0x245142)), "header without field 2"),
        (message(1, whole(1, 0x245142) + whole(2, 0) + whole(3, 0)), "0 joint positions"),
        (encode_monitoring(full(Edition.V2_7))[:-1] + b"\x00", "checksum"),
        (varint(1 << 3 | 2) + varint(99) + b"x", "99 bytes, 1 are left"),
        (b"\xff" * 12, "more than 64 bits"),
        (varint(1 << 3 | 3), "wire type 3"),
        (b"\x00\x00", "number 0"),
    ],
)
def test_what_is_wrong_is_said(datagram, says):
    with pytest.raises(ProtocolError, match=says):
        decode_monitoring(datagram)


def test_malformed_datagrams_are_an_error_or_a_message():
    rng = random.Random(5)
    whole_ones = [encode_monitoring(full(e)) for e in Edition]
    outcomes = {"read": 0, "refused": 0}
    for _ in range(20_000):
        data = bytearray(rng.choice(whole_ones))
        for _ in range(rng.randrange(1, 6)):
            data[rng.randrange(len(data))] = rng.randrange(256)
        if rng.random() < 0.3:
            data = data[: rng.randrange(len(data))]
        try:
            found = decode_monitoring(bytes(data))
            assert 1 <= len(found.q) <= 16
            encode_answer(answer_to(found, 0) or Answer(Edition.V2, 0, 0))
            outcomes["read"] += 1
        except ProtocolError:
            outcomes["refused"] += 1
    assert min(outcomes.values()) > 100


@given(st.binary(max_size=200))
def test_any_bytes_are_fields_or_an_error(data):
    try:
        found = list(fields(data))
    except ProtocolError:
        return
    # A tag may be written longer than needed, so the bytes are not told apart; their number is.
    assert len(found) <= len(data) / 2
