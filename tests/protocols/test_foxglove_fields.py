"""Messages of protobuf: our reader and the library say the same, and only ours says that a type is wrong."""

from __future__ import annotations

import pytest
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates

from seerob.protocols import ProtocolError
from seerob.protocols.links.protobuf_wire import fields, message, whole


def numbers(data):
    return {field.number: field.doubles()[0] for field in fields(data)}


def test_numbers_are_those_of_the_library():
    sent = JointStates()
    sent.joints.add(name="a", position=0.1, velocity=-2.5, effort=1e300)
    (joint,) = (f.bytes() for f in fields(sent.SerializeToString()))
    name, *rest = fields(joint)
    assert name.text() == "a"
    assert {f.number: f.doubles()[0] for f in rest} == {2: 0.1, 3: -2.5, 5: 1e300}


def test_a_number_of_another_type_is_refused_where_the_library_reads_zero():
    wrong = whole(1, 7)
    sent = message(1, message(4, wrong))
    (transform,) = FrameTransforms.FromString(sent).transforms
    assert transform.translation.x == 0.0
    with pytest.raises(ProtocolError, match="holds no doubles"):
        numbers(wrong)
