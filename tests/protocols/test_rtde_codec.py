"""RTDE bytes: golden frames that foreign programs agree on, and whatever a network can do to a stream."""

from __future__ import annotations

import random
import struct
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from seerob.protocols import ProtocolError
from seerob.protocols.robots.rtde import (
    LARGEST,
    Accepted,
    ControllerRequest,
    ControllerVersion,
    Data,
    InputsRequest,
    Kind,
    OutputsReply,
    OutputsRequest,
    Package,
    PauseRequest,
    Recipe,
    Splitter,
    StartRequest,
    TextMessage,
    VersionRequest,
    decode_reply,
    decode_request,
    encode_reply,
    encode_request,
    pack,
)

RECIPE = Recipe(("timestamp", "actual_q"), ("DOUBLE", "VECTOR6D"), 1)
VALUES = {"timestamp": 1.5, "actual_q": (0.0, -1.5, 1.5, 0.25, 3.0, -3.0)}
GOLDEN = [
    (VersionRequest(2), "0005560002"),
    (ControllerRequest(), "000376"),
    (
        OutputsRequest(("timestamp", "actual_q"), 100.0),
        "001d4f4059000000000000" + b"timestamp,actual_q".hex(),
    ),
    (StartRequest(), "000353"),
    (PauseRequest(), "000350"),
]
GOLDEN_REPLIES = [
    (Accepted(Kind.VERSION, True), "00045601"),
    (ControllerVersion(5, 12, 4, 0), "001376000000050000000c0000000400000000"),
    (OutputsReply(1, ("DOUBLE", "VECTOR6D")), "00134f01" + b"DOUBLE,VECTOR6D".hex()),
    (Data(1, RECIPE.pack(VALUES)), "003c5501" + struct.pack(">7d", 1.5, *VALUES["actual_q"]).hex()),
    (TextMessage("hi", "rtde", 2), "000c4d02" + b"hi".hex() + "04" + b"rtde".hex() + "02"),
]


def whole(data):
    return Splitter().feed(data)


def outcome(decode, package, version):
    """What a decoder makes of a package: a message, or the one error that it may raise."""
    try:
        return decode(package, version)
    except ProtocolError as error:
        return type(error)


@pytest.mark.parametrize(("message", "frame"), GOLDEN)
def test_golden_requests(message, frame):
    assert encode_request(message, 2).hex() == frame
    assert [decode_request(p, 2) for p in whole(bytes.fromhex(frame))] == [message]


@pytest.mark.parametrize(("message", "frame"), GOLDEN_REPLIES)
def test_golden_replies(message, frame):
    assert encode_reply(message, 2).hex() == frame
    assert [decode_reply(p, 2) for p in whole(bytes.fromhex(frame))] == [message]


def test_version_1_has_no_frequency_no_recipe_and_another_text():
    assert encode_request(OutputsRequest(("a", "b")), 1) == pack(Kind.OUTPUTS, b"a,b")
    for reply, payload in (
        (OutputsReply(0, ("DOUBLE",)), b"DOUBLE"),
        (Data(0, b"12345678"), b"12345678"),
        (TextMessage("stopped", level=1), b"\1stopped"),
    ):
        (package,) = whole(encode_reply(reply, 1))
        assert package.payload == payload
        assert decode_reply(package, 1) == reply


def test_an_empty_name_means_nothing():
    """ur_rtde ends its list with a comma."""
    (package,) = whole(pack(Kind.OUTPUTS, struct.pack(">d", 500) + b"timestamp,actual_q,"))
    assert decode_request(package, 2) == OutputsRequest(("timestamp", "actual_q"), 500.0)
    assert decode_request(Package(Kind.INPUTS, b"speed_slider_mask,"), 2) == InputsRequest(
        ("speed_slider_mask",)
    )


def test_every_type_comes_back_as_it_went():
    types = {
        "BOOL": True,
        "UINT8": 255,
        "UINT32": 2**32 - 1,
        "UINT64": 2**64 - 1,
        "INT32": -(2**31),
        "DOUBLE": 1 / 3,
        "VECTOR3D": (1.0, -2.0, 0.5),
        "VECTOR6D": (1.0, 2.0, 3.0, 4.0, 5.0, 6.0),
        "VECTOR6INT32": (-1, 2, -3, 4, -5, 6),
        "VECTOR6UINT32": (1, 2, 3, 4, 5, 6),
    }
    recipe = Recipe(tuple(types), tuple(types), 7)
    assert recipe.size == 1 + 1 + 4 + 8 + 4 + 8 + 24 + 48 + 24 + 24
    assert recipe.unpack(recipe.pack(types)) == types


@pytest.mark.parametrize(
    ("fields", "types"),
    [(("a",), ()), (("a",), ("NOT_FOUND",)), (("a", "b"), ("DOUBLE", "")), (("a",), ("IN_USE",))],
)
def test_a_recipe_that_cannot_be_read_is_refused(fields, types):
    with pytest.raises(ProtocolError):
        Recipe(fields, types, 1)


STREAM = b"".join(bytes.fromhex(frame) for _, frame in (*GOLDEN, *GOLDEN_REPLIES))


@given(st.lists(st.integers(0, len(STREAM)), max_size=30))
def test_however_a_stream_is_cut_the_packages_are_the_same(cuts):
    splitter, found = Splitter(), []
    edges = [0, *sorted(cuts), len(STREAM)]
    for a, b in pairwise(edges):
        found += splitter.feed(STREAM[a:b])
    assert found == whole(STREAM)
    assert len(found) == len(GOLDEN) + len(GOLDEN_REPLIES)


@given(st.integers(0, len(STREAM)))
def test_a_truncated_stream_gives_what_was_whole(end):
    found = whole(STREAM[:end])
    assert found == whole(STREAM)[: len(found)]
    assert sum(3 + len(p.payload) for p in found) <= end


@given(st.lists(st.sampled_from(range(len(GOLDEN_REPLIES))), max_size=20))
def test_repeated_and_reordered_packages_are_each_understood(order):
    stream = b"".join(bytes.fromhex(GOLDEN_REPLIES[i][1]) for i in order)
    assert [decode_reply(p, 2) for p in whole(stream)] == [GOLDEN_REPLIES[i][0] for i in order]


@pytest.mark.parametrize("size", [0, 1, 2])
def test_a_size_that_cannot_be_is_an_error(size):
    with pytest.raises(ProtocolError, match="the least is 3"):
        Splitter().feed(struct.pack(">HB", size, 85))


def test_what_is_waiting_is_never_more_than_one_package():
    splitter = Splitter()
    header = struct.pack(">HB", LARGEST, Kind.DATA)
    assert splitter.feed(header + b"x" * (LARGEST - 4)) == []
    (package,) = splitter.feed(b"y")
    assert len(package.payload) == LARGEST - 3
    with pytest.raises(ProtocolError, match="the most is 65535"):
        pack(Kind.DATA, b"x" * (LARGEST - 2))


@pytest.mark.parametrize("version", [1, 2])
@pytest.mark.parametrize("decode", [decode_request, decode_reply])
def test_malformed_packages_are_an_error_and_nothing_else(decode, version):
    """10 000: random ones, and real ones with bytes changed, doubled or lost."""
    chance = random.Random(7)
    real = [bytes.fromhex(frame) for _, frame in (*GOLDEN, *GOLDEN_REPLIES)]
    understood = refused = 0
    for _ in range(2500):
        kind = chance.choice([*Kind, chance.randrange(256)])
        packages = [Package(kind, chance.randbytes(chance.choice([0, 1, 2, 7, 8, 9, 16, 60, 300])))]
        frame = bytearray(chance.choice(real))
        for _ in range(chance.randrange(1, 4)):
            at, change = chance.randrange(len(frame)), chance.randrange(3)
            if change == 0:
                frame[at] = chance.randrange(256)
            elif change == 1:
                frame.insert(at, frame[at])
            elif len(frame) > 1:
                del frame[at]
        try:
            packages += whole(bytes(frame))
        except ProtocolError:
            refused += 1
        for package in packages:
            result = outcome(decode, package, version)
            understood += result is not ProtocolError
            refused += result is ProtocolError
    assert understood > 100
    assert refused > 100


@given(st.binary(max_size=200))
def test_data_of_another_length_is_an_error(values):
    if len(values) != RECIPE.size:
        with pytest.raises(ProtocolError, match="the recipe has 56"):
            RECIPE.unpack(values)
