"""An emulated PLC plays a table of values, and emulators that belong together are in step."""

import asyncio

import pytest

from seerob.app.emulation import motions
from seerob.app.emulators.opcua import Opcua
from seerob.core.errors import InputError

TABLE = "t [s],Belt/speed [mm/s],Door/open [bool]\n0,0,0\n2,100,1\n4,0,0\n"


def test_between_rows_numbers_are_on_a_line_and_bools_as_before(tmp_path):
    (tmp_path / "plc.csv").write_text(TABLE)
    table = motions.values(tmp_path / "plc.csv")
    assert [table.value("Belt/speed", t) for t in (0.0, 1.0, 2.0, 3.0, 4.0, 9.0)] == [0, 50, 100, 50, 0, 50]
    assert [table.value("Door/open", t) for t in (0.0, 1.9, 2.0, 3.9, 4.0)] == [
        False,
        False,
        True,
        True,
        False,
    ]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "no table of values"),
        (TABLE.replace(" [mm/s]", ""), "no table of values"),
        (TABLE.replace("t [s]", "t [ms]"), "no table of values"),
        (TABLE.replace("2,100,1", "2,fast,1"), "row 3"),
        (TABLE.replace("2,100,1", "2,100"), "row 3"),
        (TABLE.replace("2,100,1", "0,100,1"), "row 3.*ascending"),
        (TABLE.replace("2,100,1", "2,nan,1"), "row 3"),
        (TABLE.replace("0,0,0\n2", "1,0,0\n2"), "begin at t = 0"),
    ],
)
def test_what_is_no_table_is_said_with_its_row(tmp_path, text, said):
    (tmp_path / "plc.csv").write_text(text)
    with pytest.raises(InputError, match=said):
        motions.values(tmp_path / "plc.csv")


def test_rounds_begin_with_the_clock_of_the_machine(monkeypatch):
    motion = motions.played([0.0, 4.0, 8.0], [(0.0,), (1.0,), (0.0,)], [(0.25,), (0.0,), (0.25,)])
    monkeypatch.setattr(motions.time, "time", lambda: 1_000_003.0)  # 3 s after a multiple of 8
    early, late = motions.in_step(motion, 8.0), motions.in_step(motion, 8.0)
    assert early(0.0) == motion(3.0)
    assert late(50.0) == motion(3.0), "whenever its own time began"
    assert early(2.0) == motion(5.0)


def test_a_client_reads_the_table_with_its_units(tmp_path):
    from asyncua import Client

    (tmp_path / "plc.csv").write_text(TABLE.replace("100,1", "0,1").replace("0,0,0", "0,100,0"))
    server = Opcua(port=0, values=str(tmp_path / "plc.csv")).ready().server

    async def read():
        async with Client(server.url) as client:
            own = await client.get_namespace_index("urn:seerob:emulator")
            node = client.get_node(f"ns={own};s=Belt/speed")
            unit = await (await node.get_child("0:EngineeringUnits")).read_value()
            return await node.read_value(), unit.DisplayName.Text

    server.start()
    try:
        value, unit = asyncio.run(read())
    finally:
        server.stop()
    assert 0 <= value <= 100
    assert unit == "mm/s"
