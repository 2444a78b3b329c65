"""Planning beside others that move, and outside areas: against postures that are looked at one by one."""

from itertools import pairwise

import numpy as np
import pytest
from test_planning import ARM

import seerob
from seerob.app import cli
from seerob.app.console.terminal import Exit
from seerob.core.errors import InputError, UnknownName
from seerob.core.snapshot import Snapshot
from seerob.files.waypoints.reading import read_program
from seerob.session.planning.clearance import Clearance
from seerob.session.planning.others import PoseRecorder, movers
from seerob.session.planning.plan import plan

CELL = """
[[robots]]
name = "arm"
model = "arm.urdf"
q = [-1.2, 0.0]

[[robots]]
name = "other"
model = "arm.urdf"
base = { position = [1.9, 0.0, 0.0], rpy_deg = [0, 0, 90] }
q = [0.0, 0.0]

[[areas]]
name = "zone"
shape = { sphere = 0.1 }
at = { position = [0.75, 0.0, 0.0] }

[[areas]]
name = "carried"
on = "arm/fore"
shape = { sphere = 0.1 }

[[sources]]
kind = "waypoints"
robot = "other"
joint_speed = 2.0
joint_acceleration = 8.0
joint_jerk = 200.0
period = 0.05
[[sources.points]]
q = [0.0, 0.0]
[[sources.points]]
q = [1.5, 0.2]

[[sources]]
kind = "waypoints"
robot = "arm"
file = "planned.toml"
joint_speed = 1.0
joint_acceleration = 2.0
joint_jerk = 20.0
"""
MARGIN = 0.03
START, GOAL = [-1.2, 0.0], [1.2, 0.0]


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    folder = tmp_path_factory.mktemp("cell")
    (folder / "arm.urdf").write_text(ARM, encoding="utf-8")
    (folder / "workstation.toml").write_text(CELL, encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def model(cell):
    return seerob.load(cell).model


def dense(clearance, path):
    ways = [a + x * (b - a) for a, b in pairwise(path) for x in np.linspace(0, 1, 30)]
    return min(clearance.nearest(q).distance for q in ways)


def around(model, **how):
    return Clearance(model, model.robot("arm"), np.array(START), **how)


def test_an_area_is_kept_out_of_where_it_is_named(model):
    through = plan(model, "arm", [GOAL], margin=MARGIN)
    np.testing.assert_array_equal(through.q, [START, GOAL])
    assert any("looked through: zone" in text for text in through.around)
    found = plan(model, "arm", [GOAL], margin=MARGIN, keep_out=["zone"])
    assert dense(around(model, keep_out=["zone"]), found.q) >= MARGIN
    assert "area zone: kept away from" in found.around
    assert "# - area zone: kept away from" in found.toml()
    with pytest.raises(InputError, match="arm/fore ↔ zone"):
        plan(model, "arm", [[0.0, 0.0]], margin=MARGIN, keep_out=["zone"])


def test_an_area_that_is_not_there_or_moves_along_is_refused(model):
    with pytest.raises(UnknownName, match="zone"):
        plan(model, "arm", [GOAL], keep_out=["zne"])
    with pytest.raises(InputError, match="moves with arm"):
        plan(model, "arm", [GOAL], keep_out=["carried"])


def test_those_who_move_are_those_whom_a_source_drives(model):
    assert movers(model.workstation, "arm") == ("other",)
    assert movers(model.workstation, "other") == ("arm",)
    text = "other: stands where the file puts it, although a source moves it"
    assert text in plan(model, "arm", [GOAL], margin=MARGIN).around


def planned(cell, name, capsys, *options):
    file = cell / name
    call = ["plan", str(cell), "--robot", "arm", "--to=1.2,0", f"--margin={MARGIN}", "-o", str(file)]
    assert cli.main([*call, *options]) == Exit.WITHIN
    return np.array([w.q for w in read_program(file, name).waypoints]), capsys.readouterr().out


def test_what_others_sweep_is_kept_away_from_at_every_instant(cell, model, capsys):
    q, said = planned(cell, "swept.toml", capsys, "--others", "swept", "--voxel", "0.04")
    assert len(q) > 2
    assert "other: all that it sweeps" in said
    for share in np.linspace(0.0, 1.0, 6):
        at = {"other": share * np.array([1.5, 0.2])}
        assert dense(around(model, places=at), q) >= MARGIN - 1e-9


def test_at_an_instant_others_stand_where_their_source_has_them(cell, model, capsys):
    q, said = planned(cell, "end.toml", capsys, "--others", "1.6")
    assert len(q) > 2
    assert "at the instant that was given" in said
    assert dense(around(model, places={"other": np.array([1.5, 0.2])}), q) >= MARGIN - 1e-6
    late = PoseRecorder(100.0)
    late.write(Snapshot(seq=0, t=1.25, poses=b"", joints={"other": (0.0, 0.0)}), ())
    with pytest.raises(InputError, match=r"the motion of the others ends at 1\.25 s, before 100 s"):
        late.require()


def test_every_seed_finds_a_path_near_the_shortest(model):
    lengths = []
    for seed in range(2):
        q = plan(model, "arm", [GOAL], margin=MARGIN, keep_out=["zone"], seed=seed).q
        lengths.append(sum(np.linalg.norm(b - a) for a, b in pairwise(q)))
    assert max(lengths) < 1.15 * min(lengths)


def test_who_moves_is_not_taken_to_stand_still_unless_somebody_says_so(cell, capsys):
    call = ["plan", str(cell), "--robot", "arm", "--to=1.2,0", f"--margin={MARGIN}", "-o"]
    assert cli.main([*call, str(cell / "unsaid.toml")]) == Exit.UNDECIDED
    assert "other: moved by sources, and taken to stand still" in capsys.readouterr().out
    assert cli.main([*call, str(cell / "still.toml"), "--others", "still"]) == Exit.WITHIN


DEGREES = "t [s],j1 [deg],j2 [deg]\n" + "".join(f"{0.1 * k:.1f},{0.2 * k:.1f},0.1\n" for k in range(11))
BY_FILE = '[[sources]]\nkind = "csv"\nrobot = "other"\nfile = "other.csv"\n'


def test_what_a_run_would_hold_is_not_planned_around_as_known(tmp_path, capsys):
    """A file in degrees that may be in radians; a base that nobody has so far away."""
    (tmp_path / "arm.urdf").write_text(ARM, encoding="utf-8")
    (tmp_path / "other.csv").write_text(DEGREES, encoding="utf-8")
    alone = CELL[: CELL.index("[[sources]]")]
    (tmp_path / "workstation.toml").write_text(alone + BY_FILE, encoding="utf-8")
    call = ["plan", str(tmp_path), "--robot", "arm", "--to=1.2,0", f"--margin={MARGIN}", "-o"]
    for how in ("swept", "0.5"):
        assert cli.main([*call, str(tmp_path / "a.toml"), "--others", how]) == Exit.ERROR
        assert "degrees" in " ".join(capsys.readouterr().err.split())
    far = alone.replace("q = [-1.2, 0.0]", "q = [-1.2, 0.0]\nbase = { position = [75, 0, 0] }", 1)
    (tmp_path / "workstation.toml").write_text(far, encoding="utf-8")
    assert cli.main([*call, str(tmp_path / "b.toml")]) == Exit.UNDECIDED
    assert "# Not known to be clear: arm" in (tmp_path / "b.toml").read_text(encoding="utf-8")
