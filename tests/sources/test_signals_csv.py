"""Signals from a table: every row a picture of all variables, and nothing made of what cannot be read."""

from __future__ import annotations

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from seerob.core.errors import InputError
from seerob.devices.sources.signals_csv import SignalsCsv
from seerob.workstation.source import Target
from seerob.workstation.variables import Kind, Variable

SPEED = Variable(name="belt/speed", source="plc", address="v", unit="mm/s", range=(0, 1000))
CLEAR = Variable(name="clear", source="plc", address="c", type=Kind.BOOL, inverted=True)
TARGET = Target(variables=(SPEED, CLEAR))


def opened(folder, text, **more):
    (folder / "s.csv").write_text(text, encoding="utf-8", newline="")
    options = {"name": "plc", "file": "s.csv", "time": "t", "time_unit": "ms"} | more
    return SignalsCsv(**options).open(folder, TARGET)


def test_rows_are_pictures_in_si_from_run_time_0(tmp_path):
    found = opened(tmp_path, "t;v;c\n1000;250;1\n1100;;0\n\n1250;2000;\n1300;100;maybe\n", delimiter=";")
    assert found.duration == pytest.approx(0.3)
    assert [s.t for s in found.samples] == pytest.approx([0.0, 0.1, 0.25, 0.3])
    assert [s.values for s in found.samples] == [
        {"belt/speed": 0.25, "clear": False},
        {"belt/speed": 0.25, "clear": True},
        {"belt/speed": 0.25, "clear": True},
        {"belt/speed": 0.1, "clear": True},
    ]
    assert [sorted(s.doubts) for s in found.samples] == [[], [], ["belt/speed"], ["clear"]]


def test_a_gap_longer_than_the_time_out_is_a_warning(tmp_path):
    (warning,) = (f for f in opened(tmp_path, "t,v,c\n0,1,1\n900,1,1\n").findings if f.level == "warning")
    assert "0.9 s between two rows" in warning.text


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("t,v\n0,1\n", "no column 'c'"),
        ("x,v,c\n0,1,1\n", "no column 't'"),
        ("t,v,v,c\n0,1,1,1\n", "'v' is there 2 times"),
        ("t,v,c\n", "no row of values"),
        ("t,v,c\n5,1,1\n5,1,1\n", "does not come after"),
        ("t,v,c\nnan,1,1\n", "is no time"),
        ("t,v,c\n1e300,1,1\n", "is no time"),
        ("t,v,c\n0,1," + "1" * 200_000, "has no end"),
    ],
)
def test_what_cannot_be_is_told(tmp_path, text, message):
    with pytest.raises(InputError, match=message):
        opened(tmp_path, text)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None, max_examples=60)
@given(text=st.text(alphabet='tvc,\n\r"0159.-en\x00', max_size=60))
def test_any_text_is_read_or_refused(tmp_path, text):
    try:
        found = opened(tmp_path, "t,v,c\n" + text)
    except InputError:
        return
    times = [s.t for s in found.samples]
    assert times == sorted(set(times))
