"""What a notebook and a process pool get of a workstation and of a run."""

import pickle
from concurrent.futures import ProcessPoolExecutor
from html.parser import HTMLParser
from importlib import import_module
from multiprocessing import get_context

import pytest

import seerob as sr
from seerob.outputs.sink import Closing

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


@pytest.mark.parametrize("of", ["station", "run", "batch"])
def test_tables_hold_every_criterion_and_no_markup_of_the_file(station, of):
    shown = {"station": station, "run": station.run(), "batch": station.batch()}[of]
    tags = Tags()
    tags.feed(shown._repr_html_())
    assert set(tags.tags) <= {"div", "p", "b", "span", "table", "thead", "tbody", "tr", "th", "td"}
    assert tags.tags.count("tr") == 3
    assert "speed <script>" in tags.text


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
