"""What a notebook and a process pool get of a workstation and of a run."""

import pickle
from concurrent.futures import ProcessPoolExecutor
from html.parser import HTMLParser
from importlib import import_module
from multiprocessing import get_context

import msgspec
import nbformat
import numpy as np
import pytest
from nbclient import NotebookClient

import seerob as sr
from seerob.outputs.sink import Closing
from seerob.outputs.sinks.recorder import Recorder

CELL = """
title = "A <b>cell</b>"
[[robots]]
name = "arm"
model = "library:ur5e"
q_deg = [0, -90, 0, -90, 0, 0]
[[safety]]
kind = "velocity"
name = "speed <script>"
at = "arm"
limit = 0.5
[[safety]]
kind = "velocity"
name = "elsewhere"
at = "arm/forearm_link"
"""


@pytest.fixture
def station(tmp_path):
    (tmp_path / "workstation.toml").write_text(CELL)
    return sr.load(tmp_path)


def judged(station):
    """What a worker hands back."""
    return station.run(), station.batch()


class Seen(Closing):
    def write(self, snapshot, samples):
        self.last = snapshot


def test_it_is_said_in_a_line(station):
    run = station.run()
    assert repr(station) == "<Station 'A <b>cell</b>': one robot, two criteria>"
    arm = station.model.robot("arm")  # what an author of a criterion looks at first
    of_model = (arm, arm.description, arm.description.links[3], station.model.bodies[0])
    shapes = (station.model.bodies[0].solids[0], *(solid.mesh for solid in station.model.bodies[0].solids))
    seen = Seen()
    station.run(writers=[seen])
    of_tick = (seen.last, *seen.last.results)
    said = (run, run.results, run.results["elsewhere"], station.batch(), station.scene(), station.workstation)
    for what in (station.model, *station.bound, *of_model, *shapes, *of_tick, *said):
        assert len(repr(what)) < 120
        assert "\n" not in repr(what)
    assert "undecided" in repr(run)


@pytest.mark.parametrize("name", sr.__all__)
def test_what_seerob_offers_is_where_it_says(name):
    assert getattr(import_module(f"seerob.{sr._HOME[name]}"), name) is getattr(sr, name)


class Tags(HTMLParser):
    def __init__(self):
        super().__init__()
        self.tags, self.text = [], ""

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)

    def handle_data(self, data):
        self.text += f"{data} "


def test_tables_hold_every_criterion_and_no_markup_of_the_file(station, tmp_path):
    run = station.run(folder=tmp_path, sinks=[Recorder()])
    recording = sr.Recording.open(tmp_path / "run.mcap")
    for shown in (station, run, run.results, station.batch(), recording, recording.results):
        tags = Tags()
        tags.feed(shown._repr_html_())
        assert set(tags.tags) <= {"div", "p", "b", "span", "table", "thead", "tbody", "tr", "th", "td"}
        assert tags.tags.count("tr") == 3
        assert "speed <script>" in tags.text
    assert "the run: undecided" in run.results._repr_html_()


def test_a_station_is_judged_in_other_processes(station):
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        there = pool.submit(judged, station).result()
    for one, other in zip(there, judged(station), strict=True):
        assert repr(one) == repr(other)
        assert one._repr_html_() == other._repr_html_()


def test_criteria_that_were_added_come_along(station):
    from seerob.criteria.safety.velocity import Velocity

    more = station.with_criteria(Velocity(name="third", at="arm", limit=1.0))
    assert [bound.criterion.name for bound in pickle.loads(pickle.dumps(more)).bound] == [
        "speed <script>", "elsewhere", "third",
    ]  # fmt: skip


def test_a_file_that_changed_meanwhile_is_refused(tmp_path, station):
    mesh = tmp_path / "part.stl"
    import trimesh

    trimesh.creation.box((1, 1, 1)).export(mesh)
    text = (
        CELL + '[[parts]]\nname = "part"\nmesh = "part.stl"\nunits = "m"\nat = { position = [3, 0, 0.5] }\n'
    )
    (tmp_path / "workstation.toml").write_text(text)
    kept = pickle.dumps(sr.load(tmp_path))
    assert pickle.loads(kept).model.bodies
    trimesh.creation.box((2, 1, 1)).export(mesh)
    with pytest.raises(sr.InputError, match=r"part\.stl.*changed since"):
        pickle.loads(kept)


WALK = """
title = "A cell that moves"
[[robots]]
name = "arm"
model = "library:ur5e"
[[sources]]
kind = "csv"
robot = "arm"
file = "motion.csv"
mapping = { time_unit = "s", joint_unit = "rad" }
[[safety]]
kind = "velocity"
at = "arm"
limit = 0.5
"""
JOINTS = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
HEAD = ",".join(["t", *(f"{name}_joint" for name in JOINTS)])
MOTION = "\n".join([HEAD, *(f"{k / 100},{k / 50},-1,1,0,0,0" for k in range(51)), ""])


@pytest.fixture
def walk(tmp_path):
    (tmp_path / "workstation.toml").write_text(WALK)
    (tmp_path / "motion.csv").write_text(MOTION)
    return tmp_path


def test_a_run_is_shown_by_frames_of_the_same_run(walk):
    run = sr.load(walk).run()
    view = run.show()
    frames = [msgspec.msgpack.decode(frame, type=sr.Snapshot) for frame in view.frames]
    assert [frame.t for frame in frames] == pytest.approx([*np.arange(0, 0.5, 0.04), 0.5])
    worst = run.results["velocity arm"].worst()
    assert max(frame.results[0].value for frame in frames) == pytest.approx(worst.value, rel=0.05)
    assert {node.mesh for node in run.scene.nodes if node.mesh} <= view.meshes.keys()
    assert view.verdict == "the run: exceeded"
    with pytest.raises(sr.InputError, match="another process"):
        pickle.loads(pickle.dumps(run)).show()


def test_a_workstation_is_shown_where_everybody_begins(walk):
    view = sr.load(walk).show(height=300)
    (frame,) = view.frames
    assert msgspec.msgpack.decode(frame, type=sr.Snapshot).t == 0
    assert (view.height, view.verdict) == (300, "at the start, not run")


def test_a_notebook_that_is_run_holds_what_it_shows(walk):
    source = f"import seerob as sr\nrun = sr.load({str(walk)!r}).run()\nrun.show()"
    cells = [nbformat.v4.new_code_cell(each) for each in (source, "run")]
    book = nbformat.v4.new_notebook(cells=cells)
    NotebookClient(book, timeout=300, kernel_name="python3").execute()
    shown, told = (cell.outputs[-1].data for cell in book.cells)
    (view,) = (
        state["state"]
        for state in book.metadata.widgets["application/vnd.jupyter.widget-state+json"]["state"].values()
        if "frames" in state["state"]
    )
    assert shown["application/vnd.jupyter.widget-view+json"]["model_id"]
    assert len(view["frames"]) == 14
    assert view["_esm"].startswith("var ") or "export" in view["_esm"][-200:]
    assert "the run is EXCEEDED" in told["text/html"]
