"""The source: every kind of file says the same, and what is wrong in one is named with its place."""

import gzip
import re
import zipfile

import numpy as np
import pytest

from seerob.core.errors import InputError
from seerob.core.quantities import Pose
from seerob.core.samples import JointSample
from seerob.core.verdict import Verdict
from seerob.description.robots import library
from seerob.devices.sources.waypoints import Waypoints
from seerob.files.waypoints.reading import read_program
from seerob.session.reading import convert_workstation
from seerob.session.station import load
from seerob.workstation.source import Target

A = (0.0, -70.0, 80.0, -100.0, -90.0, 0.0)
B = (20.0, -60.0, 70.0, -95.0, -90.0, 10.0)
"""[deg]"""
GIVEN = {
    "joint_speed": 0.8, "joint_acceleration": 1.2, "joint_jerk": 12.0,
    "tool_speed": 0.2, "tool_acceleration": 0.5, "tool_jerk": 5.0,
}  # fmt: skip
POSE = {"position": [-0.6, -0.2, 0.5], "rpy_deg": [180, 0, 0]}


def target():
    description = library.load("ur10e")
    own = description.joints()
    return Target(
        name="ur10e",
        joints=tuple(j.name for j in own),
        units=("rad",) * 6,
        lower=tuple(j.lower for j in own),
        upper=tuple(j.upper for j in own),
        velocity=(2.0,) * 6,
        description=description,
    )


def opened(folder, **more):
    return Waypoints(**{"robot": "ur10e", **GIVEN, **more}).open(folder, target())


def q_of(found):
    return np.array([s.q for s in found.samples if isinstance(s, JointSample)])


def urp(text):
    return gzip.compress(text.encode(), mtime=0)


def waypoint(name, angles):
    values = ", ".join(str(v) for v in np.radians(angles))
    position = f'<position><JointAngles angles="{values}"/></position>'
    return f'<Waypoint type="Fixed" name="{name}"><motionParameters/>{position}</Waypoint>'


def polyscope(inside):
    tree = f"<children><MainProgram><children>{inside}</children></MainProgram></children>"
    return f"<URProgram name='p'>{tree}</URProgram>"


MOVE = '<Move motionType="MoveJ" speed="0.8" acceleration="1.2"><children>{}</children></Move>'


def test_every_file_of_the_same_waypoints_is_the_same_motion(tmp_path):
    a, b = (", ".join(map(str, v)) for v in (A, B))
    quoted = [", ".join(f"d2r({x})" for x in v) for v in (A, B)]
    files = {
        "w.toml": f"[[waypoints]]\nq_deg = [{a}]\n[[waypoints]]\nq_deg = [{b}]\npause = 0.5\n",
        "w.yaml": f"waypoints:\n  - q_deg: [{a}]\n  - {{q_deg: [{b}], pause: 0.5}}\n",
        "w.csv": "name,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,pause_ms\n"
        + f"a,{a},\nb,{b},500\n".replace(" ", ""),
        "w.script": f"movej([{quoted[0]}], v=0.8, a=1.2)\nmovej([{quoted[1]}], v=0.8, a=1.2)\nsleep(0.5)\n",
    }
    expected = None
    for name, text in files.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    (tmp_path / "w.urp").write_bytes(
        urp(
            polyscope(
                MOVE.format(waypoint("a", A) + waypoint("b", B)) + "<Wait><waitTime>0.5</waitTime></Wait>"
            )
        )
    )
    from openpyxl import Workbook

    book = Workbook()
    book.active.append(["name", *(f"q{i + 1}_deg" for i in range(6)), "pause_s"])
    book.active.append(["a", *A, None])
    book.active.append(["b", *B, 0.5])
    book.save(tmp_path / "w.xlsx")
    for name in (*files, "w.urp", "w.xlsx"):
        found = opened(tmp_path, file=name)
        q = q_of(found)
        np.testing.assert_allclose(q[0], np.radians(A), atol=1e-12)
        np.testing.assert_allclose(q[-1], np.radians(B), atol=1e-12)
        expected = q if expected is None else expected
        np.testing.assert_allclose(q, expected, atol=1e-9, err_msg=name)


def test_by_hand_and_in_a_table_a_pose_is_the_same(tmp_path):
    table = {
        "robots": [{"name": "ur10e", "model": "library:ur10e"}],
        "sources": [
            {"kind": "waypoints", "robot": "ur10e", **GIVEN, "base": "base",
             "points": [{"q_deg": list(A)}, {"name": "p", "move": "joint", "at": POSE, "blend_mm": 5}]}
        ],
    }  # fmt: skip
    station, problems = convert_workstation(table, "w")
    assert problems == []
    by_hand = station.sources[0].open(tmp_path, target())
    head = "q1_deg;q2_deg;q3_deg;q4_deg;q5_deg;q6_deg;move;x_mm;y_mm;z_mm;rx_rad;ry_rad;rz_rad"
    rows = [
        ";".join(map(str, A)) + ";;;;;;;",
        f";;;;;;joint;-600;-200;500;{repr(np.pi).replace('.', ',')};0;0",
    ]
    (tmp_path / "w.csv").write_text("\n".join([head, *rows]), encoding="utf-8")
    in_table = opened(tmp_path, file="w.csv", base="base")
    np.testing.assert_allclose(q_of(by_hand), q_of(in_table), atol=1e-7)


def test_results_know_that_it_is_planned_timed_here_and_on_which_branch(tmp_path):
    (tmp_path / "w.script").write_text(
        f"movej({np.radians(A).tolist()})\nmovel(p[-0.6,-0.2,0.5,3.14,0,0], r=0.01)\nfoo()\n",
        encoding="utf-8",
    )
    texts = [f"{f.level}: {f.text}" for f in opened(tmp_path, file="w.script").findings]
    said = "\n".join(texts)
    assert "assumed: motion comes from a plan that was not executed (w.script): preliminary" in said
    assert "timed by seerob" in said
    assert "in the frame of base: a controller may have another tool point" in said
    assert "line 2: branch shoulder" in said
    assert "left out, with their waiting: foo (1)" in said


def test_the_tool_point_of_the_program_is_used_unless_the_source_says_another(tmp_path):
    text = "set_tcp(p[0,0,0.1,0,0,0])\nmovej({})\nmovej(p[-0.6,-0.2,0.5,3.141592653589793,0,0])\n"
    (tmp_path / "w.script").write_text(text.format(np.radians(A).tolist()), encoding="utf-8")
    (tmp_path / "v.script").write_text(
        text.format(np.radians(A).tolist())
        .replace("0.1,0,0,0])\n", "0,0,0,0])\n")
        .replace("0.5,3.14", "0.6,3.14"),
        encoding="utf-8",
    )
    a, b = opened(tmp_path, file="w.script"), opened(tmp_path, file="v.script")
    np.testing.assert_allclose(q_of(a)[-1], q_of(b)[-1], atol=1e-7)
    c = opened(tmp_path, file="w.script", tcp=Pose(position=(0.0, 0.0, 0.0)))
    assert np.abs(q_of(c)[-1] - q_of(a)[-1]).max() > 0.05


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("w.doc", b"x", ".doc extension"),
        ("w.toml", b"waypoints = 3", "no list `waypoints`"),
        ("w.toml", b"[[waypoint]]\nq = [0]", "unknown key 'waypoint'"),
        ("w.toml", b"waypoints = [3]", "is no table"),
        ("w.toml", b"[[waypoints]]\nq = [0]\nat = {}", "give either q or at"),
        ("w.toml", b"[[waypoints]]\nat = { position = [0, 0, 0], rpy = [0, 0, 0] }", "needs its move"),
        ("w.toml", b"[[waypoints]]\nmove = 'linear'\nat = { position = [0, 0, 0] }", "needs its orientation"),
        ("w.toml", b"[[waypoints]]\nmove = 'circular'\nq = [0]", "via belongs"),
        ("w.toml", b"x = [", "is not TOML"),
        ("w.yaml", b"a: &x [1]\nwaypoints: [*x]", "holds aliases"),
        ("w.yaml", b"[" * 5000, "nested deeper|is not YAML"),
        ("w.yaml", b"3", "is no table"),
        ("w.yaml", b"a: [", "is not YAML"),
        ("w.csv", b"q1_deg,q1_deg\n1,2\n", "twice"),
        ("w.csv", b"q1,q2\n1,2\n", "is no column of waypoints"),
        ("w.csv", b"x_deg,y_m\n1,2\n", "deg does not fit"),
        ("w.csv", b"q1_deg,q2_deg\n1,foo\n", "row 2 column 'q2_deg'"),
        ("w.csv", b"q1_deg,q2_deg\n,2\n", "some before them are empty"),
        ("w.csv", b"q1_deg,q2_deg\n0,5,1,5\n", "4 cells, the header names 2 columns; was a decimal comma"),
        ("w.csv", b"x_m,y_m,z_m\n1,2,\n", "only x, y of x, y, z"),
        ("w.urp", b"\x1f\x8b123", "is not gzip|is cut off"),
        ("w.urp", gzip.compress(b"<a/>", mtime=0)[:-9], "is cut off|is not gzip"),
        ("w.urp", urp("<!DOCTYPE a [<!ENTITY b 'c'>]><a>&b;</a>"), "entities"),
        ("w.urp", urp("<a>"), "is not XML"),
        ("w.urp", urp("<a/>"), "no waypoint"),
        ("w.urp", urp(polyscope("<Loop>" + MOVE.format(waypoint("a", A)) + "</Loop>")), "`Loop` is left out"),
        ("w.urp", urp(polyscope(MOVE.format(waypoint("a", [float("nan")] * 6)))), "are no numbers"),
        ("w.urp", urp(polyscope(waypoint("a", A))), "no move of a known type"),
        ("w.script", b"movej([0,0,0,0,0,0,0])", "7 joint positions"),
    ],
)  # fmt: skip
def test_mistakes_are_named(tmp_path, name, content, said):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=said):
        opened(tmp_path, file=name)


def test_a_formula_that_nobody_has_calculated_is_no_empty_cell(tmp_path):
    """Else a speed that was written would be taken as not given."""
    from openpyxl import Workbook

    book = Workbook()
    book.active.append(["q1_deg", "q2_deg", "speed"])
    book.active.append([1, 2, "=1/4"])
    book.save(tmp_path / "made.xlsx")
    with pytest.raises(InputError, match="row 2: cell 3: a formula without its result; open it in Excel"):
        read_program(tmp_path / "made.xlsx", "made.xlsx")
    result = {"0.25": 0.25, "": None}  # that of a formula may be an empty text
    for text, speed in result.items():
        with (
            zipfile.ZipFile(tmp_path / "made.xlsx") as made,
            zipfile.ZipFile(tmp_path / "calculated.xlsx", "w") as calculated,
        ):
            for name in made.namelist():
                part = made.read(name)
                if name.endswith("sheet1.xml"):
                    cell = b'<c r="C2"%s><f>1/4</f><v>%s</v>' % (b"" if text else b' t="str"', text.encode())
                    part, count = re.subn(rb'<c r="C2"><f>1/4</f><v ?/?>(</v>)?', cell, part)
                    part = part.replace(b"</v></v>", b"</v>")
                    assert count == 1
                calculated.writestr(name, part)
        (waypoint,) = read_program(tmp_path / "calculated.xlsx", "calculated.xlsx").waypoints
        assert waypoint.speed == speed


def test_nodes_of_a_polyscope_program_that_are_left_out_are_named(tmp_path):
    nodes = '<Popup/><Gripper><x/></Gripper><Wait type="Sleep"><waitTime>0.5</waitTime></Wait>'
    inside = MOVE.format(waypoint("a", A) + waypoint("b", B)) + nodes
    (tmp_path / "w.urp").write_bytes(urp(polyscope(inside)))
    texts = " ".join(f.text for f in opened(tmp_path, file="w.urp").findings)
    assert "taken to move nothing were left out, with their waiting: Gripper (1), Popup (1)" in texts


def test_a_file_that_unpacks_without_end_is_not_unpacked(tmp_path):
    (tmp_path / "w.urp").write_bytes(gzip.compress(b"\0" * (65 << 20), mtime=0))
    with pytest.raises(InputError, match="unpacks to more than"):
        opened(tmp_path, file="w.urp")


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({}, "give either file or points"),
        ({"file": "a.toml", "branch": "up"}, "signs of shoulder"),
    ],
)
def test_wrong_options_are_refused(options, said):
    with pytest.raises(ValueError, match=said):
        Waypoints(robot="ur10e", **options)


def test_links_that_are_not_there_are_named(tmp_path):
    (tmp_path / "w.script").write_text("movej([0,0,0,0,0,0])", encoding="utf-8")
    with pytest.raises(InputError) as caught:
        opened(tmp_path, file="w.script", at="tol0", base="bass")
    assert [p.key for p in caught.value.problems] == ["at", "base"]
    assert "tool0" in caught.value.problems[0].remedy


def test_a_position_beyond_a_limit_is_refused(tmp_path):
    (tmp_path / "w.script").write_text("movej([0,0,0,0,0,0])\nmovej([7,0,0,0,0,0])", encoding="utf-8")
    with pytest.raises(InputError, match="above its limit"):
        opened(tmp_path, file="w.script")


CELL = """
engine.physics = false
[[robots]]
name = "arm"
model = "library:ur10e"
[[sources]]
kind = "waypoints"
robot = "arm"
file = "a.script"
joint_jerk = 20.0
values = { "get_standard_digital_in(2)" = false }
[[safety]]
kind = "kinetic_energy"
name = "E"
robot = "arm"
limit = 240
"""
BRANCH = "movej([0,-1.2,1.2,-1.5,-1.5,0])\nif (get_standard_digital_in({})):\n  movej([1,0,0,0,0,0])\nend\n"


@pytest.mark.parametrize(("pin", "verdict"), [(1, Verdict.UNDECIDED), (2, Verdict.WITHIN)])
def test_of_a_robot_whose_motion_is_left_out_nothing_is_within(tmp_path, pin, verdict):
    (tmp_path / "w.toml").write_text(CELL, encoding="utf-8")
    text = BRANCH.format(pin) + "movej([0.3,-1.2,1.2,-1.5,-1.5,0])\n"
    (tmp_path / "a.script").write_text(text, encoding="utf-8")
    summary = load(tmp_path / "w.toml").run(end=0.02)
    assert summary.results["E"].verdict is verdict
    held = [f for f in summary.scene.findings if "arm" in f.holds]
    assert len(held) == (verdict is Verdict.UNDECIDED)
