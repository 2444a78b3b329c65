"""What people pull: it sets variables of the twin, and a machine hears of it only where both allow it."""

import pytest
from made_trigger import VARIABLE

from live_story import wait_for
from made_cell import made
from seerob.app.emulators.siemens_web import SiemensWebServer
from seerob.core.errors import InputError
from seerob.core.samples import SignalSample
from seerob.core.snapshot import Snapshot
from seerob.session.opening import source_target
from seerob.session.run import engine_of
from seerob.session.writing import Triggers

STATION = """
allow_writing = true
variables = "variables.toml"
[[machines]]
name = "valve"
shape = { box = [0.03, 0.03, 0.2] }
mass = 0.3
turn = { about = [1, 0, 0], angle = "valve/angle", lower = 0.0, upper = 1.2 }
[[controls]]
name = "lever"
of = "valve"
kind = "lever"
sets = "valve/angle"
upper = 1.2
[[controls]]
name = "enabling"
of = "valve"
kind = "enabling"
sets = "enabled"
[[sources]]
kind = "room"
name = "room"
[[sources]]
kind = "siemens_web"
name = "plc"
url = "URL"
user = "twin"
password_env = "SEEROB_PLC_PASSWORD"
[[triggers]]
variable = "twin/fast"
control = "enabling"
every = 0.1
"""
VARIABLES = (
    VARIABLE.replace("ADDRESS", "'\"Twin\".fast'")
    + """
[[variables]]
name = "valve/angle"
source = "room"
address = "lever"
unit = "rad"
[[variables]]
name = "enabled"
source = "room"
address = "enabling"
type = "bool"
"""
)


@pytest.fixture
def plc(monkeypatch):
    monkeypatch.setenv("SEEROB_PLC_PASSWORD", "secret")
    monkeypatch.setenv("SEEROB_PLC_PASSWORD_HOST", "127.0.0.1")
    with SiemensWebServer({}, user="twin", password="secret", outputs=('"Twin".fast',)) as server:
        yield server


def cell(folder, url="http://127.0.0.1:9", station=STATION, variables=VARIABLES):
    return made(folder, station.replace("URL", url), {"variables.toml": variables})


def pulled(t, angle=0.0, *, enabled=False, seq=0):
    values = {"valve/angle": angle, "enabled": enabled}
    return SignalSample(source="room", seq=seq, t=t, values=values)


def test_what_follows_a_lever_is_where_it_was_pulled(tmp_path):
    model = cell(tmp_path).model
    engine = engine_of(model)
    engine.take([pulled(0.0)])
    engine.start()
    for k in range(1, 60):
        engine.take([pulled(0.01 * k, min(0.8, 0.02 * k))])
        state = engine.tick()
    assert state.joint_positions(model.mechanisms["valve"]) == pytest.approx([0.8], abs=0.01)
    room = next(source for source in model.workstation.sources if source.name == "room")
    target = source_target(model, room)
    assert [control.name for control in target.controls] == ["lever", "enabling"]


def test_a_machine_hears_of_a_control_by_its_trigger_alone(tmp_path, plc):
    written = plc.written['"Twin".fast']
    model = cell(tmp_path, plc.url).model
    with pytest.raises(InputError, match="it takes both"):
        Triggers(model, on_command_line=False)
    with Triggers(model, on_command_line=True) as triggers:
        for k, enabled in enumerate((False, False, True, True)):
            triggers.write(Snapshot(seq=k, t=0.01 * k, poses=b""), (pulled(0.01 * k, enabled=enabled),))
        # A tick in which nothing was heard changes nothing.
        triggers.write(Snapshot(seq=4, t=0.04, poses=b""), ())
        wait_for(lambda: written == [True])
        triggers.write(Snapshot(seq=5, t=0.05, poses=b""), (pulled(0.05),))
        wait_for(lambda: written == [True, False])


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('sets = "enabled"', 'sets = "twin/fast"', "written by a .*triggers"),
        ('sets = "enabled"', 'sets = "enabeld"', "enabled"),
        ('sets = "enabled"', 'sets = "valve/angle"', "a lever sets a number"),
        ('of = "valve"', 'of = "valv"', "nothing named 'valv' to pull"),
        ('name = "enabling"', 'name = "lever"', "'lever' is taken"),
        ("upper = 1.2\n[[controls]]", "upper = -1.0\n[[controls]]", "is not below"),
        ('control = "enabling"', 'control = "lever"', "that is true or false"),
        ('control = "enabling"', 'control = "enabling"\ncriterion = "x"', "criterion or control"),
    ],
)
def test_what_cannot_be_is_said_with_its_place(tmp_path, old, new, said):
    with pytest.raises(InputError, match=said):
        _ = cell(tmp_path, station=STATION.replace(old, new)).model
