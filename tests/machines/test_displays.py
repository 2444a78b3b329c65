"""Looks follow variables, and never claim what is not known."""

from __future__ import annotations

import pytest

from kept_run import Kept
from seerob import load
from seerob.core.errors import InputError
from seerob.core.samples import SignalSample
from seerob.session.scene import UNKNOWN, Looks
from seerob.twin.engine import Engine

STATION = """
variables = "variables.toml"
[[sources]]
kind = "signals_csv"
name = "plc"
file = "signals.csv"
time = "t"
time_unit = "s"
[[parts]]
name = "lamp"
shape = { sphere = 0.1 }
[[displays]]
of = "lamp"
variable = "lamp/on"
colors = { true = [1.0, 0.0, 0.0] }
[[parts]]
name = "pallet"
shape = { sphere = 0.1 }
[[displays]]
of = "pallet"
variable = "pallet/is"
hidden = ["gone"]
"""
VARIABLES = """
[[variables]]
name = "lamp/on"
source = "plc"
address = "lamp"
type = "bool"
[[variables]]
name = "pallet/is"
source = "plc"
address = "pallet"
type = "choice"
choices = { 0 = "gone", 1 = "here" }
"""


def made(folder, station=STATION, variables=VARIABLES):
    (folder / "workstation.toml").write_text(station)
    (folder / "variables.toml").write_text(variables)
    (folder / "signals.csv").write_text("t,lamp,pallet\n0,1,0\n0.1,0,1\n0.2,1,7\n0.3,,\n")
    return load(folder)


def test_lamps_are_lit_and_things_come_and_go(tmp_path):
    kept = Kept()
    made(tmp_path).run(writers=[kept])
    looks = {round(s.t, 2): s.looks for s in kept.snapshots}
    assert looks[0.0] == {"lamp": (1.0, 0.0, 0.0), "pallet": None}
    assert looks[0.1] == {}
    # A value that cannot be hides nothing.
    assert looks[0.2] == {"lamp": (1.0, 0.0, 0.0)}


@pytest.mark.parametrize(
    ("when_stale", "later"),
    [("undecided", {"lamp": UNKNOWN}), ("hold", {"lamp": (1.0, 0.0, 0.0), "pallet": None})],
)
def test_what_nobody_knows_looks_so_unless_it_is_held(tmp_path, when_stale, later):
    held = VARIABLES.replace("type =", f'when_stale = "{when_stale}"\ntype =')
    model = made(tmp_path, variables=held).model
    engine = Engine(model, signals={"plc": 0.2})
    looks = Looks(model)
    assert looks.at(engine.start()) == {"lamp": UNKNOWN}
    values = {"lamp/on": True, "pallet/is": "gone"}
    engine.take([SignalSample(source="plc", seq=0, t=0.0, values=values)])
    assert looks.at(engine.tick()) == {"lamp": (1.0, 0.0, 0.0), "pallet": None}
    for _ in range(25):
        state = engine.tick()
    assert looks.at(state) == later
    assert state.signals.at("lamp/on", state.t).invalid_reason


def test_a_display_of_nothing_is_an_error(tmp_path):
    with pytest.raises(InputError, match=r"displays\[0\].*lamb"):
        _ = made(tmp_path, STATION.replace('of = "lamp"', 'of = "lamb"')).bound
    with pytest.raises(InputError, match="give colors, hidden or both"):
        made(tmp_path, STATION.replace('hidden = ["gone"]', ""))
