"""Criteria of a cell with openings of which nobody says whether they are closed: in runs and over arrays."""

import numpy as np
import pytest
import trimesh
from msgspec.structs import replace

from made_cell import FLOATING, TWO_R, made, person, results_at, two_r
from made_ticks import SOURCE, rows
from seerob.core.errors import InputError
from seerob.core.snapshot import Result, Verdict
from seerob.criteria.judging import closed_too
from seerob.model.volumes.moving import Moving
from seerob.recording.answers import Answers
from seerob.session.batch import Column, _closed_too
from seerob.session.planning.clearance import Clearance
from seerob.testing import never_within

SAID = {"": "", "open": 'openings = "open"\n', "closed": 'openings = "closed"\n'}
SENSOR = """
[[sensors]]
name = "scan"
at = { position = [0, -2, 0.3] }
capability = 0.07
response = 0.08
source = "data sheet"
[sensors.laser_scanner]
range = 5.5
angle_deg = 270
resolution_deg = 0.5
fields = [{ name = "warn", corners = [[-2, 0], [3, 0], [3, 4], [-2, 4]] }]
"""
STOP = "stop = { acceleration = 0, reaction = 0.02, stopping = 0.05 }\n"
TERMS = "intrusion = 0\nhuman_uncertainty = 0\nrobot_uncertainty = 0\n"
CRITERIA = {
    "minimum_distance": 'between = ["arm", "op"]\nlimit = 0.22\n',
    "separation": f'between = ["arm", "op"]\n{STOP}{TERMS}',
    "safety_area": 'area = "zone"\nof = "arm"\n',
    "power_and_force": 'robot = "arm"\nhuman = "op"\n',
    "scanner_field": 'sensor = "scan"\nfield = "warn"\nof = "op"\n',
    "effective_mass": 'at = "arm"\ntoward = "op"\nlimit = 10\n',
    "velocity": 'of = "arm"\nlimit = 9\n',
}


def bowl(size):
    """A cube without the face towards +x, as a file."""
    box = trimesh.creation.box((size, size, size))
    return trimesh.Trimesh(box.vertices, box.faces[box.face_normals[:, 0] < 0.5]).export(file_type="ply")


def cell(folder, said, *, where="tools"):
    place = 'on = "arm/tip"\nmass = 1\nat = { position = [0.15, 0, 0] }\n'
    text = FLOATING + TWO_R + "base = { position = [0, 0, 1.65] }\n" + person("op", 2.6, 0, 0) + SENSOR
    text += f'[[{where}]]\nname = "bowl"\nmesh = "bowl.ply"\nunits = "m"\nup = "z"\n{place}{SAID[said]}'
    text += '[[areas]]\nname = "zone"\nshape = { sphere = 0.02 }\nat = { position = [2.31, 0, 1.65] }\n'
    for kind, options in CRITERIA.items():
        text += f'[[safety]]\nkind = "{kind}"\nname = "{kind}"\n{options}'
    return made(folder, text, {"arm.urdf": two_r(), "bowl.ply": bowl(0.3)})


@pytest.mark.parametrize("where", ["tools", "workpieces"])
def test_nothing_is_within_that_is_not_so_with_and_without_a_lid(tmp_path, where):
    """A single flat rim: closed, as nobody says, is closed as somebody says."""
    cells = {said: cell(tmp_path / f"c{said}", said, where=where) for said in SAID}
    q = np.random.default_rng(0).uniform(-0.15, 0.15, (25, 2))
    qd = np.random.default_rng(1).uniform(-1, 1, (25, 2))
    many = {said: one.batch(q={"arm": q}, qd={"arm": qd}) for said, one in cells.items()}
    taken_back = set()
    for k in range(25):
        found = {said: results_at(one, arm=(q[k], qd[k])) for said, one in cells.items()}
        for name in CRITERIA:
            unsaid, as_open, closed = (found[said][name] for said in SAID)
            if as_open.verdict == "within" and closed.verdict != "within":
                assert unsaid.verdict == "undecided"
                assert "rests on openings of bowl" in unsaid.reason
                taken_back.add(name)
            else:
                assert unsaid.verdict == as_open.verdict, (name, unsaid, as_open, closed)
            assert unsaid.value == as_open.value
            answers = many[""][name].answers
            if unsaid.value is not None and name != "safety_area":  # of which a tick bounds the depth
                ends = unsaid.interval or (unsaid.value, unsaid.value)
                of_many = answers.interval or (answers.value, answers.value)
                assert [end[k] for end in of_many] == pytest.approx(ends, abs=1e-6), name
            if as_open.verdict is not None:
                assert (many[""][name].answers.verdict[k] == many["open"][name].answers.verdict[k]) == (
                    unsaid.verdict == as_open.verdict
                )
    assert {"minimum_distance", "separation", "safety_area"} <= taken_back
    assert "velocity" not in taken_back


def hoop(folder, said, *, physics):
    """A hoop at the end of an arm that takes a small ball through its opening between two ticks, at 3 m/s."""
    speed, at = 1.45, 0.195
    angle = speed * at
    box = trimesh.creation.box((0.1, 0.02, 0.1))
    bare = trimesh.Trimesh(box.vertices, box.faces[np.abs(box.face_normals[:, 1]) < 0.5])
    text = (
        f"engine = {{ gravity = [0, 0, 0], physics = {physics} }}\n{TWO_R}{SOURCE}"
        '[[tools]]\nname = "hoop"\non = "arm/tip"\nmass = 0.01\nmesh = "hoop.ply"\nunits = "m"\nup = "z"\n'
        f"at = {{ position = [0.08, 0, 0] }}\n{SAID[said]}"
        '[[parts]]\nname = "ball"\nshape = { sphere = 0.002 }\n'
        f"at = {{ position = [{2.08 * np.cos(angle)}, {2.08 * np.sin(angle)}, 0] }}\n"
        '[[safety]]\nkind = "minimum_distance"\nname = "c"\nbetween = ["hoop", "ball"]\nlimit = 0.006\n'
    )
    motion = rows(lambda t: ((speed * t, 0.0), (speed, 0.0)), np.arange(0, 0.4 + 1e-9, 1 / 125).tolist())
    files = {"arm.urdf": two_r(), "motion.csv": motion, "hoop.ply": bare.export(file_type="ply")}
    return made(folder, text, files)


@pytest.mark.parametrize("physics", ["true", "false"])
def test_what_passes_an_opening_between_two_ticks_is_not_within(tmp_path, physics):
    runs = {
        said: hoop(tmp_path / f"h{said}", said, physics=physics).run(folder=tmp_path / f"r{said}")
        for said in SAID
    }
    found = {said: run.results["c"] for said, run in runs.items()}
    assert [found[said].verdict for said in SAID] == ["undecided", "within", "exceeded"]


LINK = (
    '<robot name="r"><link name="base"/><link name="l"><inertial><mass value="1"/>'
    '<inertia ixx="0.03" iyy="0.03" izz="0.03" ixy="0" ixz="0" iyz="0"/></inertial><collision>'
    '<geometry><mesh filename="bowl.obj"/></geometry></collision></link>'
    '<joint name="j" type="continuous"><parent link="base"/><child link="l"/>'
    '<axis xyz="0 0 1"/><limit effort="9" velocity="2"/></joint></robot>'
)


def of_a_link(folder, said):
    box = trimesh.creation.box((0.4, 0.4, 0.4))
    mesh = trimesh.Trimesh(box.vertices, box.faces[box.face_normals[:, 0] < 0.5])
    text = (
        f'[[robots]]\nname = "arm"\nmodel = "arm.urdf"\n{SAID[said]}'
        '[[parts]]\nname = "post"\nshape = { sphere = 0.02 }\nat = { position = [0.5, 0, 0] }\n'
        '[[safety]]\nkind = "minimum_distance"\nname = "d"\nbetween = ["arm", "post"]\nlimit = 0.3\n'
    )
    return made(folder, text, {"arm.urdf": LINK, "bowl.obj": mesh.export(file_type="obj")})


def test_openings_of_links_are_those_of_their_robot(tmp_path):
    cells = {said: of_a_link(tmp_path / f"l{said}", said) for said in SAID}
    found = {said: results_at(one, arm=([0.0], [0.0]))["d"] for said, one in cells.items()}
    assert [found[said].verdict for said in SAID] == ["undecided", "within", "exceeded"]
    assert [found[said].value for said in SAID] == pytest.approx([np.hypot(0.2, 0.3) - 0.02] * 2 + [0.28])
    told = {
        said: next(f for f in one.model.findings if "l: mesh is open" in f.text and "winding" not in f.text)
        for said, one in cells.items()
        if said != "open"
    }
    assert [each.level for each in told.values()] == ["warning", "note"]
    # A way is clear, and a swept volume large enough, of what may be there.
    away = {
        said: Clearance(one.model, one.model.robot("arm"), np.zeros(1)).nearest for said, one in cells.items()
    }
    assert [away[said](np.zeros(1)).distance for said in SAID] == pytest.approx(
        [0.28, np.hypot(0.2, 0.3) - 0.02, 0.28]
    )
    cores = {said: len(Moving(one.model, one.model.robot("arm").moving).cores) for said, one in cells.items()}
    assert cores == {"": 2, "open": 1, "closed": 1}


def test_the_key_of_a_robot_is_refused_where_no_link_is_open(tmp_path):
    with pytest.raises(InputError, match="no mesh of a link of arm has openings"):
        made(tmp_path, TWO_R + SAID["open"], {"arm.urdf": two_r()})


def test_the_harness_finds_nothing_within_that_is_in_doubt(tmp_path):
    text = (
        '[[robots]]\nname = "arm"\nmodel = "arm.urdf"\nq = [0.3]\n'
        + person("op", 3, 0, -1)
        + '[[safety]]\nkind = "minimum_distance"\nname = "d"\nbetween = ["arm", "op"]\nlimit = 0.3\n'
    )
    box = trimesh.creation.box((0.4, 0.4, 0.4))
    mesh = trimesh.Trimesh(box.vertices, box.faces[2:]).export(file_type="obj")
    made(tmp_path, text, {"arm.urdf": LINK, "bowl.obj": mesh})
    never_within(tmp_path)


def test_a_part_of_what_is_exceeded_is_within_with_openings_closed_too():
    near, far = (
        Result(name=name, value=1.0, limit=0.5, at_most=False, verdict=Verdict.WITHIN) for name in "ab"
    )
    hit, beyond = (replace(far, value=0.1, verdict=Verdict.EXCEEDED), replace(far, value=0.7))
    whole = Result(name="c", value=0.2, limit=0.5, at_most=False, verdict=Verdict.EXCEEDED, parts=(near, far))
    found = closed_too(whole, replace(whole, value=0.1, parts=(near, hit)), "why")
    assert found.verdict == "exceeded"
    assert found.interval == (0.1, 0.2)
    assert [part.verdict for part in found.parts] == ["undecided"] * 2
    assert closed_too(whole, replace(whole, parts=(near, beyond)), "why") is whole


def test_an_interval_over_arrays_stays_where_the_other_has_another_limit_or_no_value():
    def column(value, limit, off):
        made = Answers.against(np.array(value), np.array(limit), at_most=False)
        answers = made.between(np.array(value) - off, np.array(value) + off, at_most=False)
        return Column("d", "m", False, answers, np.full(len(value), "", object))

    said = column([1.0, 1.0, 1.0], [0.5, 0.5, 0.5], 0.1)
    other = column([0.7, 0.7, np.nan], [0.5, 0.6, 0.5], 0.05)
    low, high = _closed_too(said, other, "why").answers.interval
    assert low.tolist() == pytest.approx([0.65, 0.9, 0.9])
    assert high.tolist() == pytest.approx([1.1, 1.1, 1.1])
