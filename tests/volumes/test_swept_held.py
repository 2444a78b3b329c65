"""What a gripper picks up away from where the file has it in the hand: it is swept where it is held."""

from __future__ import annotations

import numpy as np
import pytest

from made_cell import made
from made_sweep import inside
from seerob.app.cli import main
from seerob.core.shapes import Mesh
from seerob.core.transforms import rotation_from_wxyz
from seerob.criteria.stopping.simulated import StopSimulation
from seerob.model.volumes.moving import posed
from seerob.model.volumes.swept import swept_volume
from seerob.twin.machines.gripping import Held, before

HIGH = 0.25
"""Where the bar is taken: so far below its middle [m]; the file has its middle in the hand."""
CELL = f"""
engine = {{ physics = false }}
[[machines]]
name = "axis"
shape = {{ box = [0.2, 0.2, 0.1] }}
mass = 5
turn = {{ about = [0, 1, 0] }}
[[machines]]
name = "hand"
on = "axis"
at = {{ position = [1.0, 0, 0] }}
shape = {{ box = [0.02, 0.02, 0.06] }}
mass = 0.2
grip = {{ upper = 0.1 }}
[[workpieces]]
name = "bar"
on = "hand"
shape = {{ box = [0.04, 0.04, 0.6] }}
mass = 2.0
rest = {{ position = [1.0, 0, {HIGH}] }}
"""
SOURCES = "".join(
    f'[[sources]]\nkind = "csv"\nrobot = "{name}"\nfile = "{name}.csv"\n' for name in ("axis", "hand")
)
AREA = '[[areas]]\nname = "way"\nswept = { of = "axis", start = 0.3, voxel = 0.04 }\n'
SWEPT = '[[safety]]\nkind = "swept_volume"\nname = "swept"\nof = "axis"\nvoxel = 0.04\n'
TAKEN = 0.2
"""The bar is in the hand from then on [s]."""
T = np.linspace(0, 1, 51)
ANGLE = -0.4 * (1 - np.cos(np.pi * np.clip((T - 0.3) / 0.7, 0, 1)))
OPENING = np.clip(0.1 - 0.5 * T, 0.04, 0.1)


def table(unit, values):
    rows = (f"{t!r},{x!r}\n" for t, x in zip(T.tolist(), values.tolist(), strict=True))
    return f"time [s],J1 [{unit}]\n" + "".join(rows)


FILES = {"axis.csv": table("rad", ANGLE), "hand.csv": table("m", OPENING / 2)}


class Way:
    """A writer that keeps where the bar is."""

    def __init__(self, station):
        self.node = [node.name for node in station.scene().nodes].index("bar")
        self.points, self.joints, self.last = [], [], None

    def write(self, snapshot, samples):
        self.joints.append(snapshot.joints)
        self.last = snapshot
        pose = np.frombuffer(snapshot.poses, "<f4").reshape(-1, 7)[self.node].astype(float)
        if snapshot.t > 0.3:
            corners = (np.indices((2, 2, 2)).reshape(3, 8).T - 0.5) * [0.04, 0.04, 0.6] * 0.999
            self.points.append(corners @ rotation_from_wxyz(pose[3:]).T + pose[:3])

    def __enter__(self):
        return self

    def __exit__(self, *_):
        return None


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    station = made(tmp_path_factory.mktemp("held"), CELL + SOURCES + AREA + SWEPT, FILES)
    way = Way(station)
    station.run(writers=[way])
    return station, way


def test_area_of_a_part_after_the_pick_up_contains_the_bar_as_it_is_held(ran):
    station, way = ran
    mesh = next(body.solids[0].mesh for body in station.model.bodies if body.name == "way")
    assert inside(Mesh(mesh.vertices, mesh.faces), np.vstack(way.points)).all()


def test_volume_of_a_run_contains_it_too(ran):
    hull = ran[1].last.results[0].markers[0]
    mesh = Mesh(np.array(hull.vertices), np.array(hull.faces, np.int32))
    assert inside(mesh, np.vstack(ran[1].points)).all()


def test_file_of_a_part_contains_it_too(ran, tmp_path):
    station, way = ran
    out = tmp_path / "way.stl"
    argv = ["swept", str(station.model.folder), "--of", "axis", "--voxel", "0.04", "--from", "0.3"]
    assert main([*argv, "-o", str(out)]) == 0
    triangles = np.frombuffer(out.read_bytes()[84:], np.dtype("12<f4,<u2"))["f0"].reshape(-1, 4, 3)[:, 1:]
    mesh = Mesh(
        triangles.reshape(-1, 3).astype(float), np.arange(3 * len(triangles), dtype=np.int32).reshape(-1, 3)
    )
    assert inside(mesh, np.vstack(way.points)).all()


def test_what_a_motion_alone_sweeps_says_where_the_bar_counts(ran):
    """Nobody told what is held: it is in the hand where the file has it, and that is said."""
    model, joints = ran[0].model, ran[1].joints
    motion = {name: np.array([each[name] for each in joints]) for name in joints[0]}
    alone = swept_volume(model, model.select("axis"), motion, voxel=0.04)
    held = swept_volume(model, model.select("axis"), motion, voxel=0.04, held=Held(model))
    said = "in the hand, where the file has it"
    assert (said in alone.guarantee, said in held.guarantee) == (True, False)
    assert held.grid.contains(np.vstack(ran[1].points)).all()
    assert not alone.grid.contains(np.vstack(ran[1].points)).all()


def test_it_stops_from_where_it_is_held(ran):
    model, joints = ran[0].model, ran[1].joints
    held = before(model, posed(model, {n: np.array([each[n] for each in joints]) for n in joints[0]}))
    state, bar = held._state, model.select("bar")[0]
    stop = StopSimulation(model, model.mechanisms["axis"], np.array([100.0]), [bar])
    stopped = stop.stop(state, 0.1)
    np.testing.assert_allclose(stopped.positions[0, 0], state.positions[bar], atol=1e-12)
    assert np.linalg.norm(state.positions[bar] - [np.cos(0.8), 0, np.sin(0.8)]) == pytest.approx(
        HIGH, abs=1e-3
    )
