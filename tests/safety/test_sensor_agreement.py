"""A real device beside the twin's own field: agreement, lag, disagreement, silence."""

from __future__ import annotations

import pytest

from made_cell import made, state_at
from seerob.core.errors import InputError
from seerob.core.samples import SignalSample
from seerob.criteria.judging import Judge
from seerob.twin.validity.hearing import Heard

STATION = """
variables = "v.toml"
[[machines]]
name = "hand"
shape = { sphere = 0.05 }
slide = { lower = -2, upper = 2 }
[[areas]]
name = "curtain"
shape = { box = [0.02, 1.0, 1.0] }
[[sources]]
kind = "mqtt"
name = "plc"
host = "127.0.0.1"
port = 1
[[safety]]
kind = "sensor_agreement"
name = "it"
variable = "clear"
field = "curtain"
of = "hand"
limit = 0.15
"""
CLEAR = '[[variables]]\nname = "clear"\nsource = "plc"\naddress = "clear"\ntype = "bool"\n'


def story(folder, *instants, station=STATION):
    """Per instant (t, where the hand is, what the device says) the result."""
    cell = made(folder, station, {"v.toml": CLEAR})
    judge, found = Judge(cell.bound), []
    state = state_at(cell, hand=((1.0,), (0.0,)))
    for t, x, clear in instants:
        state.data.qpos[:] = x
        state.hearings["hand"].heard = [Heard(t)]
        if clear is not None:
            state.signals.take(SignalSample(source="plc", seq=0, t=t, values={"clear": clear}))
        state.refresh(t)
        found.append(judge(state)[0])
    return found


def test_agreement_is_no_disagreement_and_a_lag_is_measured(tmp_path):
    found = story(
        tmp_path, (0.0, 1.0, True), (0.1, 0.0, True), (0.2, 0.0, False), (0.3, 1.0, False), (0.4, 1.0, False)
    ) + story(tmp_path, (0.0, 0.0, True), (0.2, 0.0, True))
    assert [r.verdict for r in found] == ["within"] * 5 + ["within", "exceeded"]
    assert [r.value for r in found] == pytest.approx([0, 0, 0, 0, 0.1, 0, 0.2])
    assert found[-1].reason == "the device says free, the twin interrupted"
    assert found[3].reason == "the device says interrupted, the twin free"


def test_what_nobody_tells_is_undecided_and_mistakes_are_named(tmp_path):
    (silent,) = story(tmp_path, (0.0, 1.0, None))
    assert silent.verdict == "undecided"
    for change, message in (
        (('field = "curtain"', 'field = "curtan"'), "did you mean 'curtain'"),
        (('of = "hand"', 'of = "curtain"'), "nothing in it has a shape"),
        (('variable = "clear"', 'variable = "door"'), "no variable 'door'"),
    ):
        with pytest.raises(InputError, match=message):
            story(tmp_path, (0.0, 1.0, True), station=STATION.replace(*change))


def test_it_begins_anew_when_time_is_set_back_and_not_when_it_is_asked_twice(tmp_path):
    found = story(tmp_path, *((t, 0.0, True) for t in (0.0, 0.1, 0.1, 0.05, 0.1)))
    assert [r.value for r in found] == pytest.approx([0, 0.1, 0.1, 0, 0.05])
    assert {(r.unit, r.limit, r.at_most) for r in found} == {("s", 0.15, True)}


@pytest.mark.parametrize("free", [True, False])
def test_touching_the_field_is_being_in_it_whatever_the_device_calls_free(tmp_path, free):
    """A ball of 1/16 m and a field that begins at 1/32 m: figures without rounding."""
    station = STATION.replace("sphere = 0.05", "sphere = 0.0625").replace("0.02, 1.0", "0.0625, 1.0")
    station += f"free = {str(free).lower()}\n"
    for x, verdict in ((3 / 32, "exceeded"), (3 / 32 + 1e-6, "within"), (0.9, "within")):
        *_, last = story(tmp_path, (0.0, x, free), (0.2, x, free), station=station)
        assert (last.verdict, last.reason == "") == (verdict, verdict == "within")


def test_it_lasts_less_long_than_the_limit(tmp_path):
    for t, verdict in ((0.149, "within"), (0.15, "exceeded")):
        *_, last = story(tmp_path, (0.0, 0.0, True), (t, 0.0, True))
        assert last.verdict == verdict
