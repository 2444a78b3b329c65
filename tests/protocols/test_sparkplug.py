"""Sparkplug B against Google's own Protocol Buffers, and its rules of births, deaths and losses."""

from __future__ import annotations

import random

import pytest
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from hypothesis import given
from hypothesis import strategies as st

from seerob.protocols import ProtocolError
from seerob.protocols.links.json_pointer import at, document, parts
from seerob.protocols.plc.sparkplug import Kind, Node, Payload, decode, encode, topic

TYPES = {"uint64": 4, "uint32": 13, "float": 2, "double": 1, "bool": 8, "string": 9, "message": 11}


def schema():
    """The schema of the payload, by the field numbers of the public one."""
    file = descriptor_pb2.FileDescriptorProto(name="sparkplug.proto", package="s", syntax="proto2")
    fields = {
        "Metric": [
            ("name", 1, "string"), ("alias", 2, "uint64"), ("timestamp", 3, "uint64"),
            ("datatype", 4, "uint32"),
            ("is_historical", 5, "bool"), ("is_null", 7, "bool"), ("int_value", 10, "uint32"),
            ("long_value", 11, "uint64"), ("float_value", 12, "float"), ("double_value", 13, "double"),
            ("boolean_value", 14, "bool"), ("string_value", 15, "string"),
        ],
        "Payload": [("timestamp", 1, "uint64"), ("metrics", 2, "message"), ("seq", 3, "uint64")],
    }  # fmt: skip
    for name, entries in fields.items():
        message = file.message_type.add(name=name)
        for field, number, kind in entries:
            added = message.field.add(name=field, number=number, type=TYPES[kind], label=1)
            if kind == "message":
                added.label, added.type_name = 3, ".s.Metric"
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName("s.Payload"))


THEIRS = schema()


def theirs(*metrics, seq=0):
    payload = THEIRS(timestamp=1_700_000_000_000, seq=seq)
    for metric in metrics:
        payload.metrics.add(**metric)
    return payload.SerializeToString()


@pytest.mark.parametrize(
    ("metric", "value"),
    [
        ({"datatype": 10, "double_value": -1.5}, -1.5),
        ({"datatype": 9, "float_value": 0.25}, 0.25),
        ({"datatype": 11, "boolean_value": True}, True),
        ({"datatype": 12, "string_value": "idle"}, "idle"),
        ({"datatype": 3, "int_value": 2**32 - 5}, -5.0),
        ({"datatype": 1, "int_value": 2**32 - 5}, -5.0),
        ({"datatype": 2, "int_value": 0xFFFE}, -2.0),
        ({"datatype": 7, "int_value": 2**32 - 5}, 2.0**32 - 5),
        ({"datatype": 4, "long_value": 2**64 - 7}, -7.0),
        ({"datatype": 10, "is_null": True}, None),
    ],
)
def test_values_that_google_wrote(metric, value):
    (found,) = decode(theirs({"name": "a", "alias": 3, **metric})).metrics
    assert (found.value, found.name, found.alias) == (value, "a", 3)
    # And what we write, Google reads as the same.
    again = THEIRS.FromString(encode(Payload(metrics=(found,), seq=4)))
    (other,) = again.metrics
    assert decode(theirs({"name": "a", "datatype": found.type, **_value_of(other)})).metrics[0].value == value


def _value_of(metric):
    return {f.name: v for f, v in metric.ListFields() if f.name.endswith("_value") or f.name == "is_null"}


def say(node, kind, *metrics, seq, device=""):
    where = topic("/".join(x for x in ("spBv1.0", "plant", kind, "edge", device) if x))
    return node.take(where, decode(theirs(*metrics, seq=seq)))


def born():
    node = Node()
    assert say(node, "NBIRTH", {"name": "bdSeq", "datatype": 8, "long_value": 0}, seq=0)
    assert say(
        node, "DBIRTH",
        {"name": "speed", "alias": 1, "datatype": 10, "double_value": 0.5},
        {"name": "count", "alias": 2, "datatype": 3, "int_value": 0},
        seq=1, device="belt",
    )  # fmt: skip
    return node


def values(node):
    return {key[1]: value for key, (value, _) in node.values.items() if key[0] == "plant/edge/belt"}


def test_names_come_in_the_birth_and_numbers_after_it():
    node = born()
    assert values(node) == {"speed": 0.5, "count": 0.0}
    assert say(node, "DDATA", {"alias": 2, "int_value": 2**32 - 1}, seq=2, device="belt")
    assert values(node) == {"speed": 0.5, "count": -1.0}
    assert say(node, "DDATA", {"alias": 1, "double_value": 9.0, "is_historical": True}, seq=3, device="belt")
    assert values(node)["speed"] == 0.5
    assert not say(node, "DDATA", {"alias": 77, "double_value": 9.0}, seq=4, device="belt")


def test_a_late_listener_and_one_who_missed_something_know_nothing_until_the_next_birth():
    late = Node()
    assert not say(late, "DDATA", {"alias": 1, "double_value": 2.0}, seq=5, device="belt")
    assert not late.alive
    node = born()
    assert not say(node, "DDATA", {"alias": 1, "double_value": 2.0}, seq=4, device="belt")
    assert (node.alive, node.lost, node.values) == (False, 2, {})
    assert say(node, "NBIRTH", seq=0)
    assert node.alive


def test_the_count_comes_round_and_the_dead_say_nothing():
    node = born()
    for k in range(2, 600):
        assert say(node, "DDATA", {"alias": 1, "double_value": float(k)}, seq=k % 256, device="belt")
    assert values(node)["speed"] == 599.0
    assert say(node, "DDEATH", seq=600 % 256, device="belt")
    assert values(node) == {}
    # Only a birth brings a device back.
    assert not say(node, "DDATA", {"alias": 1, "double_value": 1.0}, seq=601 % 256, device="belt")
    assert values(node) == {}
    say(node, "NDEATH", seq=0)
    assert not node.alive


@pytest.mark.parametrize(("number", "lives"), [(0, False), (7, True), (None, False)])
def test_after_the_death_of_another_connection_the_next_message_says_whether_it_lives(number, lives):
    """A broker gives up a connection that broke long after the node has made another."""
    for lost in (False, True):
        node = born()  # with number 0
        metrics = [] if number is None else [{"name": "bdSeq", "datatype": 8, "long_value": number}]
        say(node, "NDEATH", *metrics, seq=0)
        assert not node.alive
        understood = say(node, "DDATA", {"alias": 2, "int_value": 4}, seq=2 + lost, device="belt")
        assert node.alive is understood is (lives and not lost)
        assert values(node) == ({"speed": 0.5, "count": 4.0} if lives and not lost else {})


@pytest.mark.parametrize(
    ("text", "speaker"),
    [
        ("spBv1.0/g/NBIRTH/e", "g/e"),
        ("spBv1.0/g/DDATA/e/d", "g/e/d"),
        ("spBv1.0/g/DDATA/e", None),
        ("spBv1.0/g/NDATA/e/d", None),
        ("spBv1.0/g/NCMD/e", None),
        ("spBv1.0/STATE/host", None),
        ("other/topic", None),
    ],
)
def test_topics(text, speaker):
    found = topic(text)
    assert (found and found.speaker) == speaker


def test_malformed_payloads_are_an_error_or_a_payload():
    rng, outcomes = random.Random(9), {True: 0, False: 0}
    whole = theirs(
        {"name": "speed", "alias": 1, "datatype": 10, "double_value": 0.5},
        {"name": "on", "alias": 2, "datatype": 11, "boolean_value": True},
        {"name": "state", "datatype": 12, "string_value": "idle", "timestamp": 5},
    )
    node = Node()
    for _ in range(20_000):
        data = bytearray(whole)
        for _ in range(rng.randrange(1, 5)):
            data[rng.randrange(len(data))] = rng.randrange(256)
        try:
            node.take(topic("spBv1.0/g/" + rng.choice(list(Kind)[:2]) + "/e"), decode(bytes(data)))
            outcomes[True] += 1
        except ProtocolError:
            outcomes[False] += 1
    assert min(outcomes.values()) > 100


# -- JSON pointers ------------------------------------------------------------------------------


def test_pointers_of_the_standard():
    text = '{"foo": ["bar", "baz"], "": 0, "a/b": 1, "c%d": 2, "m~n": 8, " ": 7}'
    for pointer, value in {
        "/foo/0": "bar", "/": 0, "/a~1b": 1, "/c%d": 2, "/m~0n": 8, "/ ": 7,
    }.items():  # fmt: skip
        assert at(document(text), parts(pointer)) == value
    for nowhere in ("/foo/2", "/foo/x", "/gone", "/foo/0/a"):
        with pytest.raises(KeyError):
            at(document(text), parts(nowhere))
    with pytest.raises(ValueError, match="no JSON pointer"):
        parts("foo")


@pytest.mark.parametrize("text", ["NaN", '{"a": Infinity}', "[" * 100_000, "{", "\xff"])
def test_what_is_no_json_is_refused(text):
    with pytest.raises(ProtocolError, match="no JSON"):
        document(text)


@given(
    st.recursive(st.none() | st.booleans() | st.integers() | st.text(), lambda x: st.lists(x), max_leaves=20)
)
def test_documents_come_back(value):
    import json

    assert document(json.dumps(value)) == value
