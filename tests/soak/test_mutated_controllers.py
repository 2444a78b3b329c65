"""Any bytes may come from a controller or a machine: they are understood, or refused, no more."""

import json

import pytest
from pymodbus.exceptions import ModbusException
from pymodbus.framer import FramerSocket
from pymodbus.pdu import DecodePDU
from pymodbus.pdu.bit_message import ReadCoilsResponse
from pymodbus.pdu.register_message import ReadHoldingRegistersResponse

from seerob.app.emulation.motions import swing
from seerob.app.emulators.drfl import DrflSender
from seerob.app.emulators.fri import FriServer
from seerob.devices.sources.mqtt import Plain, plain_change
from seerob.devices.sources.rtde import FIELDS
from seerob.protocols import ProtocolError
from seerob.protocols.plc import s7_web, sparkplug
from seerob.protocols.plc.modbus import Block, Device, Place, Table, Type, Words, take
from seerob.protocols.robots import abb_egm, doosan_drfl, fri, rtde, ur_primary
from soak.mutations import refusals

COUNTS = [pytest.param(1000, id="short"), pytest.param(100_000, id="long", marks=pytest.mark.soak)]
RECIPE = rtde.Recipe(FIELDS[:3], ("DOUBLE", "VECTOR6D", "VECTOR6D"), 1)
BLOCKS = {table: Block(table, 0, 8) for table in (Table.HOLDING, Table.COIL)}


def replies(version):
    said = (
        rtde.OutputsReply(1, RECIPE.types),
        rtde.TextMessage("hello", "here", rtde.Level.WARNING),
        rtde.ControllerVersion(5, 12, 4, 0),
        rtde.Data(1, RECIPE.pack({name: 0.5 if k == 0 else (0.5,) * 6 for k, name in enumerate(FIELDS[:3])})),
    )
    return b"".join(rtde.encode_reply(reply, version) for reply in said)


def read_replies(data, version):
    for package in rtde.Splitter().feed(data):
        reply = rtde.decode_reply(package, version)
        if isinstance(reply, rtde.Data):
            RECIPE.unpack(reply.values)


def requests(version):
    return b"".join(
        rtde.encode_request(r, version) for r in (rtde.OutputsRequest(FIELDS, 125.0), rtde.StartRequest())
    )


def read_requests(data, version):
    for package in rtde.Splitter().feed(data):
        rtde.decode_request(package, version)


def fri_server(edition):
    return FriServer(swing((0.1,) * 7), to=("", 1), edition=edition, torques=lambda t: (1.0,) * 7)


def monitoring(edition):
    return fri.encode_monitoring(fri_server(edition).message(0.5))


def an_answer(edition):
    answer = fri.answer_to(fri.decode_monitoring(monitoring(edition)), 3)
    return fri.encode_answer(answer)


def guided():
    six = (0.1,) * 6
    said = abb_egm.Message(
        7, 1e9, six, (1.0,), (1.0, 2.0, 3.0), motors=1, motion=2, program=2, force=six, utilization=50.0
    )
    return abb_egm.encode(said)


def kinematics():
    six = (0.1,) * 6
    return ur_primary.encode_state(
        ur_primary.Kinematics(checksum=(1,) * 6, theta=six, a=six, d=six, alpha=six)
    )


def read_primary(data):
    for kind, payload, _ in ur_primary.packages(data):
        if kind == ur_primary.STATE:
            ur_primary.kinematics_in(payload)


class Wire:
    """Stands where pymodbus's client does: what comes is framed and decoded by pymodbus itself."""

    connected = True

    def __init__(self, data):
        self._data = data

    async def read_holding_registers(self, first, *, count, device_id):
        _, answer = FramerSocket(DecodePDU(False)).handleFrame(self._data, 0, 0)
        if answer is None:
            raise ModbusException("no answer")
        return answer

    read_coils = read_input_registers = read_discrete_inputs = read_holding_registers


def modbus_frame(table):
    answer = (
        ReadCoilsResponse(dev_id=1, transaction_id=1, bits=[True] * 8)
        if table is Table.COIL
        else ReadHoldingRegistersResponse(dev_id=1, transaction_id=1, registers=list(range(8)))
    )
    return FramerSocket(DecodePDU(False)).buildFrame(answer)


def read_modbus(data, table):
    more = {"type": Type.BIT} if table.bits else {"type": Type.F32, "words": Words.HIGH_FIRST}
    place = Place(table=table, at=2, **more)
    asked = Device(Wire(data), 1).block(BLOCKS[table])
    try:
        asked.send(None)  # it waits for nothing here, and an event loop for each would take most of the time
    except StopIteration as ended:
        take(BLOCKS[table], ended.value, {"v": place})
    except OSError as error:
        raise ProtocolError(str(error)) from error


def born():
    metrics = tuple(
        sparkplug.Metric(name=f"m{k}", alias=k, type=t, value=7.0) for k, t in enumerate((4, 9, 10))
    )
    return sparkplug.encode(sparkplug.Payload(seq=0, metrics=metrics))


def read_sparkplug(data):
    node = sparkplug.Node()
    node.take(sparkplug.topic("spBv1.0/g/NBIRTH/n"), sparkplug.decode(data))


def read_plain(data):
    change = plain_change("v", Plain("t", "/a/0"), data, retained=False, now=0.0)
    if change.invalid_reason:
        raise ProtocolError(change.invalid_reason)


def json_of(value):
    return json.dumps(value).encode()


DECODERS = {
    **{
        f"rtde {what} {version}": (lambda m=make, v=version: m(v), lambda data, r=read, v=version: r(data, v))
        for what, make, read in (("replies", replies, read_replies), ("requests", requests, read_requests))
        for version in (1, 2)
    },
    "ur_primary": (kinematics, read_primary),
    **{f"fri {e}": (lambda e=e: monitoring(e), fri.decode_monitoring) for e in fri.Edition},
    "fri answer": (
        lambda: an_answer(fri.Edition.V1),
        lambda data: fri.decode_answer(data, fri.Edition.V1),
    ),
    "drfl": (lambda: DrflSender(swing((0.1,) * 6), to=("", 1)).message(3), doosan_drfl.decode),
    "egm": (guided, abb_egm.decode),
    **{
        f"modbus {table}": (lambda t=table: modbus_frame(t), lambda data, t=table: read_modbus(data, t))
        for table in BLOCKS
    },
    "siemens": (
        lambda: json_of([{"jsonrpc": "2.0", "id": k, "result": 2.5} for k in range(3)]),
        lambda data: s7_web.results(data, 3),
    ),
    "sparkplug": (born, read_sparkplug),
    "mqtt": (lambda: json_of({"a": [1.5, 2]}), read_plain),
}


@pytest.mark.parametrize("count", COUNTS)
@pytest.mark.parametrize("kind", DECODERS)
def test_mutated_packets_of_controllers_are_read_or_refused(kind, count):
    make, read = DECODERS[kind]
    assert refusals(read, make(), seed=17, count=count) > 0
