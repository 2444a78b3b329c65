"""Another recording on the axis of one that is replayed: what of it is plotted, and what is refused."""

import numpy as np
import pytest

import seerob as sr
from seerob.app.commands.replay import _beside, _others
from seerob.app.server.access import Tokens
from seerob.app.server.player import Player
from seerob.app.server.serving import Server
from seerob.core.errors import InputError
from seerob.core.snapshot import History
from seerob.outputs.sinks.recorder import Recorder
from server.frames import Visitor

CELL = """
title = "Cell"
[[parts]]
name = "table"
shape = {{ box = [1, 1, 1] }}
[[humans]]
name = "person"
stature = 1.75
mass = 70
sex = "female"
at = {{ position = [{x}, 0, 0] }}
[[safety]]
kind = "minimum_distance"
name = "{name}"
between = ["table", "person"]
limit = 0.5
"""


@pytest.fixture
def recorded(tmp_path):
    def record(folder, text=CELL, **values):
        cell = tmp_path / folder
        cell.mkdir(parents=True)
        (cell / "workstation.toml").write_text(text.format(**values))
        sr.load(cell).run(folder=cell, sinks=[Recorder()])
        return cell / "run.mcap"

    return record


def test_a_page_is_told_of_the_same_criteria_of_another_run(recorded):
    ours, other = recorded("near", x=2, name="gap"), recorded("far", x=4, name="gap")
    recording = sr.Recording.open(ours)
    player = Player(recording, beside=_beside(other, recording))
    with (
        Server(scene=recording.scene, meshes=recording.meshes, feed=player, port=0) as server,
        Visitor(server) as page,
    ):
        told = page.until(lambda m: isinstance(m, History) and m.traces and len(m.traces[0].values))
    (mine,), (theirs,) = told.traces, told.beside
    assert mine.name == theirs.name == "gap"
    # The nearest place of a person is a little aside of the axis on which they stand.
    assert np.frombuffer(theirs.values)[0] - np.frombuffer(mine.values)[0] == pytest.approx(2, abs=1e-3)
    assert told.beside_title == "far/run.mcap"


def test_without_one_nothing_is_beside_and_another_criterion_is_refused(recorded):
    recording = sr.Recording.open(recorded("near", x=2, name="gap"))
    assert _beside(None, recording) == History(traces=())
    with pytest.raises(InputError, match="no criterion with a name, kind and unit"):
        _beside(recorded("far", x=4, name="other"), recording)


AREA = """
[[areas]]
name = "zone"
shape = {{ box = [1, 1, 1] }}
at = {{ position = [{x}, 0, 0] }}
"""


def test_what_is_of_another_kind_is_not_beside_though_its_name_and_unit_are_the_same(recorded):
    recording = sr.Recording.open(recorded("near", x=2, name="gap"))
    rule = 'kind = "minimum_distance"\nname = "{name}"\nbetween = ["table", "person"]\nlimit = 0.5\n'
    other = 'kind = "safety_area"\nname = "{name}"\nof = "person"\narea = "zone"\n'
    assert rule in CELL
    far = recorded("far", CELL.replace(rule, other) + AREA, x=4, name="gap")
    with pytest.raises(InputError, match="no criterion with a name, kind and unit"):
        _beside(far, recording)


def test_a_page_chooses_among_other_runs_of_the_folder_and_who_only_looks_does_not(recorded):
    ours = recorded("runs/b", x=2, name="gap")
    recorded("runs/c", x=4, name="gap")
    recorded("runs/a", x=4, name="other")
    recorded("elsewhere", x=5, name="gap")
    assert _others(recorded("alone", x=2, name="gap")) == {}
    recording = sr.Recording.open(ours)
    player = Player(recording, others=_others(ours))
    tokens = Tokens.made()
    with (
        Server(scene=recording.scene, meshes=recording.meshes, feed=player, port=0, tokens=tokens) as server,
        Visitor(server, path=f"/ws?token={tokens.view}") as looker,
        Visitor(server, path=f"/ws?token={tokens.control}") as page,
    ):
        told = page.until(lambda m: isinstance(m, History) and m.traces and len(m.traces[0].values))
        assert told.others == ("c/run.mcap", "a/run.mcap")
        assert (told.beside, told.beside_title) == ((), "")
        looker.ask("beside", 1.0)  # is not done
        page.ask("beside", 0.0)
        told = page.until(lambda m: isinstance(m, History) and (m.beside_title or m.beside_refusal))
        assert (told.beside_title, told.beside_refusal) == ("c/run.mcap", "")
        assert [trace.name for trace in told.beside] == ["gap"]
        assert looker.until(lambda m: isinstance(m, History) and m.beside_title) == told
        page.ask("beside", 1.0)
        told = page.until(lambda m: isinstance(m, History) and m.beside_title != "c/run.mcap")
        assert (told.beside, told.beside_title) == ((), "")
        assert told.beside_refusal.startswith("a/run.mcap: has no criterion with a name, kind and unit")
        page.ask("beside", -1.0)
        assert page.until(lambda m: isinstance(m, History) and not m.beside_refusal).beside == ()
        page.ask("beside", 2.0)
        assert page.end()[0] == 1007
    server.stop()
    assert [v.refused for v in server.visits.take(end=True) if v.role == "view" and v.event == "left"] == [
        {"beside": 1}
    ]
