"""No mass is dropped: each link's is known, or what moves it is undecided."""

from __future__ import annotations

import re

import numpy as np
import pytest
import trimesh

from made_cell import FLOATING, TWO_R, made, results_at, state_at, two_r
from seerob.app import cli
from seerob.core.errors import Undecided
from seerob.core.snapshot import Origin
from seerob.criteria.contact.impact_mass import moving_masses
from seerob.description.description import Description, Joint, JointKind, Mimic, Quantity
from seerob.model import provenance
from seerob.model.mounting.chains import couple
from seerob.model.mounting.mechanisms import MechanismDraft, Riders
from seerob.model.mounting.specification import Entry
from seerob.outputs.report.evidence import masses
from seerob.twin.accuracy.mass_tolerances import MassTolerances

BOX = '<collision><geometry><box size="{0} {0} {0}"/></geometry></collision>'
SIX = '<inertia ixx="{0}" iyy="{0}" izz="{0}" ixy="0" ixz="0" iyz="0"/>'
INERTIAL = f'<inertial><mass value="3"/>{SIX.format(0.01)}</inertial>'
CRITERIA = """
[[safety]]
kind = "kinetic_energy"
name = "kinetic_energy"
robot = "arm"
limit = 100
[[safety]]
kind = "effective_mass"
name = "effective_mass"
at = "arm"
limit = 100
[[safety]]
kind = "power_and_force"
name = "power_and_force"
robot = "arm"
"""
ENERGY, EFFECTIVE, CONTACT = "kinetic_energy", "effective_mass", "power_and_force"
FAST = ((0.0, 0.0), (1.0, 0.0))


def gripper(inside: str) -> str:
    """The arm with something behind a fixed joint at its end."""
    return two_r().replace('<link name="tip"/>', f'<link name="tip">{inside}</link>')


def station(folder, urdf, more=""):
    return made(folder, FLOATING + TWO_R + more + CRITERIA, {"arm.urdf": urdf})


def rows(cell):
    return {row.name: row for row in cell.model.robot("arm").masses}


@pytest.mark.parametrize(
    ("inside", "said"),
    [
        (BOX.format(0.1), "nobody gave the mass of arm/tip"),
        (BOX.format(0.1).replace("collision", "visual"), "nobody gave the mass of arm/tip"),
        (f'<inertial><mass value="0"/>{SIX.format(0)}</inertial>{BOX.format(0.1)}', "nobody gave"),
        (f"<inertial>{SIX.format(0.01)}</inertial>", "inertial without a mass"),
        (f'<inertial><mass value="3"/>{SIX.format(0)}</inertial>{BOX.format(0.1)}', "inertia of 0"),
        (INERTIAL.replace('izz="0.01"', 'izz="1"') + BOX.format(0.1), "break A \\+ B"),
        (INERTIAL.replace('izz="0.01"', 'izz="1"'), "break A \\+ B"),
        (INERTIAL.replace('"3"', '"0.001"') + BOX.format(0.2), "lighter than any foam"),
        (f'<inertial><mass value="3"/>{SIX.format(1e-6)}</inertial>{BOX.format(0.1)}', "radius of gyration"),
    ],
    ids=[
        "none",
        "shown only",
        "zero",
        "no mass",
        "no inertia",
        "refused",
        "refused, no shape",
        "foam",
        "a point",
    ],
)
def test_what_nobody_weighed_behind_a_fixed_joint_leaves_it_undecided(tmp_path, inside, said):
    cell = station(tmp_path, gripper(inside))
    found = results_at(cell, arm=FAST)
    assert re.search(said, rows(cell)["arm/tip"].note or cell.model.robot("arm").unknown_masses[0])
    found[CONTACT] = results_at(cell, arm=((0.0, 0.0), (0.05, 0.0)))[CONTACT]
    for name in (ENERGY, EFFECTIVE, CONTACT):
        assert (name, found[name].verdict) == (name, "undecided")
        assert re.search(said, found[name].reason)
    assert any("arm/tip" in f.text and "UNDECIDED" in f.text for f in cell.model.findings)


def test_a_heavy_gripper_behind_a_fixed_joint_counts(tmp_path):
    """3 kg at 2 m besides 1 kg at 1 m and at 2 m: ½·(1 + 4 + 12)·1² J, and its own inertia."""
    cell = station(tmp_path, gripper(INERTIAL))
    assert results_at(cell, arm=FAST)[ENERGY].value == pytest.approx(8.5 + 0.005, abs=1e-6)
    given = station(tmp_path / "by hand", gripper(BOX.format(0.1)), "masses.tip = { mass = 3 }\n")
    assert rows(given)["arm/tip"].mass == 3
    assert results_at(given, arm=FAST)[ENERGY].value == pytest.approx(8.5 + 0.0025, abs=1e-6)


@pytest.mark.parametrize(
    "inside", ["", BOX.format(0.01), f'<inertial><mass value="0"/>{SIX.format(0)}</inertial>']
)
def test_a_frame_weighs_nothing(tmp_path, inside):
    """Neither a bare link nor a marker that weighs 25 g at most, made of the heaviest metal."""
    cell = station(tmp_path, gripper(inside))
    assert (rows(cell)["arm/tip"].mass, rows(cell)["arm/tip"].merged) == (0, "arm/l2")
    assert results_at(cell, arm=FAST)[ENERGY].value == pytest.approx(2.5)


def test_many_markers_are_no_frames(tmp_path):
    """Each 25 g at most: the third of them is one too many."""
    some = "".join(
        f'<link name="m{i}">{BOX.format(0.01)}</link><joint name="f{i}" type="fixed"><parent link="tip"/>'
        f'<child link="m{i}"/></joint>'
        for i in range(3)
    )
    cell = station(tmp_path, two_r().replace("</robot>", some + "</robot>"))
    assert [rows(cell)[f"arm/m{i}"].mass for i in range(3)].count(None) == 2


def virtual(offset: float, inside: str = "") -> str:
    """A link without anything between the two of the arm, ``offset`` [m] ahead of the second joint."""
    bare = two_r().replace(
        '<joint name="j2"',
        f'<link name="mid">{inside}</link><joint name="jm" type="continuous"><parent link="l1"/>'
        f'<child link="mid"/><origin xyz="{1 - offset} 0 0"/><axis xyz="1 0 0"/>'
        '<limit effort="9" velocity="9"/></joint><joint name="j2"',
    )
    return bare.replace(
        '<parent link="l1"/><child link="l2"/><origin xyz="1 0 0"/>',
        f'<parent link="mid"/><child link="l2"/><origin xyz="{offset} 0 0"/>',
    )


@pytest.mark.parametrize(
    ("offset", "inside", "known"),
    [
        (0.0, "", True),
        (0.0005, "", True),
        (0.3, "", False),
        (0.0, BOX.format(0.1), False),
        (0.0, f'<inertial><mass value="0"/>{SIX.format(0)}</inertial>', True),
        (0.0, f'<inertial><mass value="3"/>{SIX.format(0)}</inertial>', False),
    ],
)
def test_a_link_between_joints_weighs_nothing_only_where_they_are_in_one_place(
    tmp_path, offset, inside, known
):
    cell = station(tmp_path, virtual(offset, inside))
    state = state_at(cell, arm=((0.0, 0.0, 0.0), (1.0, 0.0, 0.0)))
    if known:
        state.mass_matrix(cell.model.robot("arm"))
    else:
        with pytest.raises(Undecided, match="the mass of arm/mid"):
            state.mass_matrix(cell.model.robot("arm"))


def test_a_joint_that_moves_nothing_is_a_body_that_nobody_weighed(tmp_path):
    last = '<link name="flange"/><joint name="j3" type="continuous"><parent link="tip"/>'
    last += '<child link="flange"/></joint>'
    cell = station(tmp_path, two_r().replace("</robot>", last + "</robot>"))
    assert cell.model.robot("arm").unknown_masses == ("nobody gave the mass of arm/flange",)


def test_placeholder_inertias_are_guesses(tmp_path):
    same = re.sub(r"(i(xx|yy|zz))=.[^ ]*[0-9].", r"\1='0.1'", two_r(masses=(1.0, 2.0))).replace(
        '<link name="tip"/>', f'<link name="tip">{INERTIAL.replace("0.01", "0.1")}</link>'
    )
    cell = station(tmp_path, same)
    assert len(cell.model.robot("arm").unknown_masses) == 3
    assert results_at(cell, arm=FAST)[ENERGY].verdict == "undecided"


def test_what_stands_still_weighs_on_nobody(tmp_path):
    cell = station(
        tmp_path, two_r().replace('<link name="base"/>', f'<link name="base">{BOX.format(0.1)}</link>')
    )
    assert (rows(cell)["arm/base"].mass, rows(cell)["arm/base"].moves) == (None, False)
    assert results_at(cell, arm=FAST)[ENERGY].verdict == "within"


def test_the_table_has_every_link_and_everything_on_it(tmp_path):
    tool = '[[tools]]\nname = "grip"\non = "arm/tip"\nshape = {{ box = [0.1, 0.1, 0.1] }}\n{}\n'
    for given, mass in (("mass = 2", 2), ("density = 1000", 1), ("", None)):
        cell = station(tmp_path / (given or "none"), two_r(), tool.format(given))
        table = rows(cell)
        assert [table[f"arm/{name}"].mass for name in ("base", "l1", "l2", "tip")] == [0, 1, 1, 0]
        assert table["grip"].mass == (mass and pytest.approx(mass))
        assert (table["grip"].note != "") is (table["grip"].origin == "missing") is (mass is None)
        (info,) = (m for m in cell.scene().mechanisms if m.name == "arm")
        assert info.masses == cell.model.robot("arm").masses


def test_library_robots_weigh_what_their_links_do(tmp_path):
    cell = made(tmp_path, '[[robots]]\nname = "arm"\nmodel = "library:ur10e"\n')
    robot = cell.model.robot("arm")
    total = sum(link.inertial.mass for link in robot.description.links if link.inertial)
    assert sum(row.mass for row in robot.masses) == pytest.approx(total)
    moving = sum(row.mass for row in robot.masses if row.moves)
    assert moving == pytest.approx(np.sum(cell.model.mj.body_mass[robot.mj_bodies]))


def test_a_gripper_of_the_robots_own_file_is_load(tmp_path):
    """M/2 + m_L: what the file mounts on its flange counts in full, as a tool of the workstation does."""
    urdf = two_r().replace('"tip"', '"tool0"')
    grip = f'<link name="grip">{INERTIAL}{BOX.format(0.1)}</link><joint name="g" type="fixed">'
    grip += '<parent link="tool0"/><child link="grip"/></joint>'
    tool = '[[tools]]\nname = "grip"\non = "arm/tool0"\nshape = { box = [0.1, 0.1, 0.1] }\nmass = 3\n'
    own = station(tmp_path / "own", urdf.replace("</robot>", grip + "</robot>"))
    mounted = station(tmp_path / "mounted", urdf, tool)
    for cell in (own, mounted):
        assert moving_masses(cell.model, cell.model.robot("arm")) == pytest.approx((2, 3))


def test_a_volume_that_is_known_within_bounds_leaves_the_mass_within_them(tmp_path):
    """A ball with a hole: its mass by density has an error that energies and the load of a stop carry.

    An energy goes by centre and moments, too, which are off by more than the mass.
    """
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.1)
    stl = trimesh.Trimesh(ball.vertices, ball.faces[7:]).export(file_type="stl")
    tool = '[[tools]]\nname = "grip"\non = "arm/tip"\nmesh = "grip.stl"\nunits = "m"\ndensity = 500\n'
    tool += "hole_depth = 0\n"
    files = {"arm.urdf": two_r(), "grip.stl": stl}
    cell = made(tmp_path, FLOATING + TWO_R + tool + CRITERIA, files)
    (body,) = (b for b in cell.model.bodies if b.name == "grip")
    assert body.mass.error > 1e-3
    energy = results_at(cell, arm=FAST)[ENERGY]
    low, high = energy.interval
    carried = energy.value - 2.5
    assert body.mass.spread_error > body.mass.error
    assert high - energy.value == pytest.approx(body.mass.spread_error * carried, rel=1e-9)
    assert energy.value - low == pytest.approx(body.mass.spread_error * carried, rel=1e-9)
    heaviest = MassTolerances(cell.model, cell.model.robot("arm")).heaviest_load()
    assert heaviest == pytest.approx(body.mass.value * (1 + body.mass.error))


def test_a_mass_by_density_follows_triangles_within_their_deviation_and_no_verdict_is_better(tmp_path):
    """A ball of 100 mm in few triangles: it weighs less than the ball, and says that it may weigh more."""
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.1)
    sagitta = 0.1 - float(np.linalg.norm(ball.triangles_center, axis=1).min())
    files = {"arm.urdf": two_r(), "grip.stl": ball.export(file_type="stl")}
    tool = '[[tools]]\nname = "grip"\non = "arm/tip"\nmesh = "grip.stl"\nunits = "m"\ndensity = 500\n'
    told = tool + f"deviation_mm = {1e3 * sagitta:.6f}\n"
    exact = '[[tools]]\nname = "grip"\non = "arm/tip"\nshape = { sphere = 0.1 }\ndensity = 500\n'

    def energy(name, text, limit=100.0):
        criteria = CRITERIA.replace("limit = 100", f"limit = {limit:.9g}", 1)
        cell = made(tmp_path / name, FLOATING + TWO_R + text + criteria, files)
        return results_at(cell, arm=FAST)[ENERGY], cell

    (truth, _), (found, cell) = energy("exact", exact), energy("told", told)
    assert found.value < truth.value
    low, high = found.interval
    assert low < truth.value < high
    assert "as its surface lies within" in " ".join(f.text for f in cell.model.findings)
    inputs = provenance.masses(cell.model, cell.model.robot("arm"))
    assert any(given.name == "mass of grip may be off by" for given in inputs)
    # Between the triangles' energy and the ball's, nobody knows.
    between = (found.value + truth.value) / 2
    assert energy("bare", tool, between)[0].verdict == "within"
    assert energy("within", told, between)[0].verdict == "undecided"
    assert energy("beyond", told, low * 0.999)[0].verdict == "exceeded"
    assert energy("far", told, high * 1.001)[0].verdict == "within"


def test_what_the_known_masses_exceed_is_exceeded_whatever_else_weighs(tmp_path):
    """2.5 J of the two known links and 11.5 J with a gripper of 3 kg, which nobody weighed."""
    six = SIX.format(0.01)
    for limit, known, unknown in ((2.0, "exceeded", "exceeded"), (5.0, "exceeded", "undecided")):
        for inside, verdict in ((f'<inertial><mass value="3"/>{six}</inertial>', known), ("", unknown)):
            text = CRITERIA.replace("limit = 100", f"limit = {limit}", 1)
            folder = tmp_path / f"{limit}{bool(inside)}"
            urdf = gripper(inside + BOX.format(0.1))
            cell = made(folder, FLOATING + TWO_R + text, {"arm.urdf": urdf})
            result = results_at(cell, arm=FAST)[ENERGY]
            assert (limit, result.verdict) == (limit, verdict)
            if not inside and verdict == "exceeded":
                assert result.value == pytest.approx(2.5)
                assert "nobody gave the mass of arm/tip" in result.reason
            motion = {"arm": np.zeros((1, 2))}
            batch = cell.batch(motion, {"arm": np.array([[1.0, 0.0]])})
            assert batch[ENERGY].verdict == verdict


@pytest.mark.parametrize("last", [0, 1])
def test_a_placeholder_that_moves_the_twin_is_no_mass_that_exceeds_anything(tmp_path, last):
    """Of a link without a mass: the energy is that of the other one alone."""
    urdf = re.sub(rf'(<link name="l{1 + last}">)<inertial>.*?</inertial>', r"\1", two_r())
    text = CRITERIA.replace("limit = 100", "limit = 0.4", 1)
    cell = made(tmp_path, FLOATING + TWO_R + text, {"arm.urdf": urdf})
    result = results_at(cell, arm=FAST)[ENERGY]
    assert result.verdict == "exceeded"
    assert result.value == pytest.approx(0.5 if last else 2.0)


def test_contact_and_effective_mass_exceed_by_what_is_known(tmp_path):
    known = station(tmp_path / "known", gripper(INERTIAL + BOX.format(0.1)))
    unknown = station(tmp_path / "unknown", gripper(BOX.format(0.1)))
    fast = ((0.0, 0.1), (4.0, 0.0))
    for cell in (known, unknown):
        assert results_at(cell, arm=fast)[CONTACT].verdict == "exceeded"
    text = CRITERIA.replace('at = "arm"\nlimit = 100', 'at = "arm/l2"\nlimit = 0.5')
    for folder, inside in (("k", INERTIAL), ("u", "")):
        cell = made(
            tmp_path / folder, FLOATING + TWO_R + text, {"arm.urdf": gripper(inside + BOX.format(0.1))}
        )
        assert results_at(cell, arm=fast)[EFFECTIVE].verdict == "exceeded"


def test_a_point_mass_on_a_frame_counts(tmp_path):
    """3 kg at 2 m without an inertia, as a payload frame has it."""
    point = f'<inertial><mass value="3"/>{SIX.format(0)}</inertial>'
    cell = station(tmp_path, gripper(point))
    assert rows(cell)["arm/tip"].mass == 3
    assert results_at(cell, arm=FAST)[ENERGY].value == pytest.approx(8.5, abs=1e-6)


MJCF = """
<mujoco><compiler angle="radian" {}/><worldbody><body name="base"><body name="l1">
<joint name="j1" axis="0 0 1"/>{}<body name="g" pos="1 0 0">{}</body></body></body></worldbody></mujoco>
"""
GEOM = '<geom type="box" size="0.5 0.05 0.05" pos="0.5 0 0" {}/>'


@pytest.mark.parametrize(
    ("compiler", "first", "second", "unknown"),
    [
        ("", GEOM.format('mass="2"'), GEOM.format('density="300"'), ()),
        ("", GEOM.format(""), GEOM.format('mass="2"'), ("arm/l1",)),
        ("", GEOM.format('mass="2"'), GEOM.format('mass="0"'), ("arm/g",)),
        (
            'inertiagrouprange="0 0"',
            GEOM.format('mass="2"') * 2,
            GEOM.format('mass="3" group="3"'),
            ("arm/g",),
        ),
        (
            'inertiagrouprange="0 0"',
            GEOM.format('mass="2"') + GEOM.format('mass="3" group="3"'),
            GEOM.format('mass="2"'),
            ("arm/l1",),
        ),
    ],
    ids=["given", "default density", "massless", "left out", "partly left out"],
)
def test_what_a_mjcf_does_not_weigh_is_unknown(tmp_path, compiler, first, second, unknown):
    text = '[[robots]]\nname = "arm"\nmodel = "arm.xml"\n'
    cell = made(tmp_path, text, {"arm.xml": MJCF.format(compiler, first, second)})
    assert tuple(row.name for row in cell.model.robot("arm").masses if row.mass is None) == unknown


def test_the_table_is_told_and_reported(tmp_path, capsys):
    cell = station(tmp_path, gripper(BOX.format(0.1)))
    assert cli.main(["check-file", str(tmp_path)]) == 0
    said = " ".join(capsys.readouterr().out.split())
    for words in (
        "mass arm: at least 2 kg, of which 2 kg move; unknown: arm/tip",
        "arm/l1: 1 kg, stated by its source (arm.urdf: link l1)",
        "arm/tip: unknown, missing, moves with arm/l2",
        "weigh nothing: arm/base",
    ):
        assert words in said
    html = str(masses(cell.scene()))
    assert html.count("<tr>") == 1 + 4
    assert "unknown: arm/tip" in html


@pytest.mark.parametrize(
    ("published", "told"), [(2.0, False), (2.2, False), (1.75, False), (2.3, True), (1.7, True)]
)
def test_the_links_are_compared_with_what_the_maker_weighed(tmp_path, published, told):
    """Two links of 1 kg; a tool does not count, and what rests on another arm is held until confirmed."""
    energy = '[[safety]]\nkind = "kinetic_energy"\nrobot = "arm"\nlimit = 100\n'
    tool = '[[tools]]\nname = "t"\non = "arm/tip"\nshape = { sphere = 0.05 }\nmass = 0.5\n'
    said = f'published_mass = {published}\npublished_mass_source = "data sheet of 2024"\n'
    cell = made(tmp_path, FLOATING + TWO_R + said + tool + energy, {"arm.urdf": two_r()})
    found = [f for f in cell.model.findings if "published_mass" in f.text]
    assert bool(found) is told
    if told:
        assert "2 kg of" in found[0].text
        assert "data sheet of 2024" in found[0].text
        assert found[0].holds == ("arm",)


def test_joints_that_follow_one_that_follows_another():
    """b = 2 a + 0.5 and c = 0.25 − 3 b = −1.25 − 6 a, in whichever order they stand."""
    follows = {"a": None, "b": Mimic("a", 2.0, 0.5), "c": Mimic("b", -3.0, 0.25)}
    exact = {"a": (1.0, 0.0), "b": (2.0, 0.5), "c": (-6.0, -1.25)}
    for order in ("abc", "cba", "bca"):
        every = [
            Joint(name, JointKind.REVOLUTE, np.array([0.0, 0, 1]), mimic=follows[name]) for name in order
        ]
        coupling, offset = couple(every, [joint for joint in every if joint.mimic is None])
        np.testing.assert_array_equal(np.column_stack([coupling, offset]), [exact[name] for name in order])


def test_a_machine_weighs_what_all_its_links_do_or_nobody_knows():
    """Beside a tool on it, and another machine beside the robot."""

    def entry(owner, mass, carrier="arm", role="machine"):
        given = None if mass is None else Quantity(mass, Origin.GIVEN, "label")
        return Entry(owner, role, owner, carrier, (), given, None, 0)

    bare = Description(name="x", links=(), tip="", source="")
    chains = {name: MechanismDraft(bare, role, np.zeros(0), True, on=on) for name, role, on in (
        ("arm", "robot", ""), ("hand", "machine", "arm/tip"), ("cart", "machine", ""))}  # fmt: skip
    carriers = {"arm/tip": "arm", "hand/left": "hand"}
    for left, right, both in ((0.5, 0.25, 0.75), (None, 0.25, None), (0.5, None, None)):
        entries = [entry("hand", left, "hand"), entry("pen", 2.0, "hand", "tool"), entry("cart", 9.0, "cart")]
        entries += [
            entry("hand", right, "hand"),
            entry("post", 9.0, "arm", "part"),
            entry("gun", None, role="tool"),
        ]
        riders = Riders(chains, carriers, entries, {})
        assert riders.things("arm") == {"hand": both, "pen": 2.0, "gun": None}
        said = {row.name: (row.mass, row.origin, row.source, bool(row.note)) for row in riders.weighed("arm")}
        nobody = (None, Origin.MISSING, "", True)
        assert said == {
            "hand": nobody if both is None else (both, Origin.GIVEN, "label", False),
            "pen": (2.0, Origin.GIVEN, "label", False),
            "gun": nobody,
        }


def test_what_is_noticed_of_the_shape_of_a_link_whose_mass_is_given_is_told(tmp_path):
    """A mesh with a hole: how its mass is spread has bounds alone, with where they come from."""
    box = trimesh.creation.box((0.1, 0.1, 0.1)).subdivide()
    meshes = {"l.stl": trimesh.Trimesh(box.vertices, box.faces[1:]).export(file_type="stl")}
    arm = two_r().replace(
        "</link>", '<collision><geometry><mesh filename="l.stl"/></geometry></collision></link>'
    )
    text = FLOATING + TWO_R + '[robots.masses.l1]\nmass = 2\nsource = "a scale"\n'
    cell = made(tmp_path, text, {"arm.urdf": arm, **meshes})
    told = [finding for finding in cell.model.findings if finding.subject == "arm/l1"]
    assert any("the mass may be anywhere in its convex hull" in finding.text for finding in told)
    assert MassTolerances(cell.model, cell.model.robot("arm")).tolerances
