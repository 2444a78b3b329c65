"""Axes from shapes: true axes of mechanisms that OpenCASCADE made are found among the first proposals."""

import math
import tomllib

import made_mechanisms as made
import numpy as np
import pytest

from seerob.app import cli
from seerob.app.console.terminal import Exit
from seerob.description.cad import axes, step
from seerob.description.cad.assembly import baked
from seerob.description.description import base_from_links
from seerob.description.loader import load_robot
from seerob.description.mesh_files import MeshSource

pytest.importorskip("OCP")


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("mechanisms")
    true = {}
    for name, make in made.MECHANISMS.items():
        parts, true[name] = make()
        made.write(folder / f"{name}.step", parts)
    return folder, true


def assembly_of(path):
    return baked(step.read(MeshSource(path, path.read_bytes(), 1 << 28, 10**7)))


@pytest.mark.parametrize("name", made.MECHANISMS)
def test_every_true_axis_is_among_the_first_proposals(files, name):
    folder, true = files
    found = assembly_of(folder / f"{name}.step")
    first = axes.proposals(found)[: len(true[name])]
    for axis in true[name]:
        assert any(made.is_it(proposal, axis, found.names()) for proposal in first), axis


def test_screws_and_a_flange_are_no_first_choice(files):
    folder, _ = files
    found = assembly_of(folder / "clamp.step")
    names = found.names()
    every = axes.proposals(found)
    screws = [p for p in every if "screw" in names[p.b]]
    assert screws
    assert all(
        "as screws" in p.reason for p in screws if p.kind.value == "revolute" and names[p.a] == "clamp/block"
    )
    assert max(p.score for p in screws) < every[0].score


def test_accepted_axes_become_a_robot_that_moves_as_far_as_parts_let_it(files, tmp_path, capsys):
    folder, _ = files
    for name, joint, low, high in (
        # The leaf of 700 mm by 30 mm opens until its far edge is behind; the carriage runs between two ends.
        ("linear_axis", "slide_carriage", -0.2, 0.28),
        ("slide", "slide_block", None, None),
        ("door", "turn_leaf", None, math.pi),
    ):
        cell = tmp_path / name
        assert cli.main(["import", str(folder / f"{name}.step"), str(cell), "--accept", "1"]) == Exit.WITHIN
        assert "accepted" in capsys.readouterr().out
        assert cli.main(["check-file", str(cell)]) == Exit.WITHIN
        table = tomllib.loads((cell / "workstation.toml").read_text())
        (robot,), (part,) = table["robots"], table["parts"]
        assert part["name"].startswith(name)
        robot = load_robot(robot["model"], folder=cell)
        (found,) = robot.joints()
        assert found.name == joint
        if low is not None:
            assert found.lower == pytest.approx(low, abs=2e-3)
        if high is not None:
            assert found.upper == pytest.approx(high, abs=2e-3)
        assert found.lower < 0 < found.upper
        assert robot.links[-1].solids[0].deviation > 0 or name == "slide"


def test_what_moves_about_an_accepted_axis_weighs_what_its_solids_do(files, tmp_path):
    folder, _ = files
    cell = tmp_path / "cell"
    given = ("--accept", "1", "--density", "2700")
    assert cli.main(["import", str(folder / "door.step"), str(cell), *given]) == Exit.WITHIN
    assembly = assembly_of(folder / "door.step")
    names = [name.rpartition("/")[2] for name in assembly.names()]
    leaf = assembly.shapes[assembly.instances[names.index("leaf")].shape]
    (robot,) = tomllib.loads((cell / "workstation.toml").read_text())["robots"]
    inertial = load_robot(robot["model"], folder=cell).links[-1].inertial
    assert inertial.mass == pytest.approx(2700 * leaf.solid.volume, rel=1e-9)
    assert (inertial.error, inertial.spread_error) == (0, 0)
    expected = np.linalg.eigvalsh(2700 * leaf.solid.inertia)
    np.testing.assert_allclose(np.linalg.eigvalsh(inertial.inertia), expected, rtol=1e-9)


def test_an_arm_is_a_chain_of_six(files, tmp_path):
    folder, true = files
    cell = tmp_path / "cell"
    numbers = ",".join(str(n) for n in range(1, 7))
    options = ("--accept", numbers, "--ground", "arm/link_0")
    assert cli.main(["import", str(folder / "arm.step"), str(cell), *options]) == Exit.WITHIN
    (robot,) = tomllib.loads((cell / "workstation.toml").read_text())["robots"]
    chain = load_robot(robot["model"], folder=cell)
    assert [link.parent for link in chain.links] == [None, "base", *(f"link_{n}" for n in range(1, 6))]
    poses = base_from_links(chain, {})
    for number, axis in enumerate(true["arm"], 1):
        link = chain.link(f"link_{number}")
        between = np.array(axis.point) * 1e-3 - poses[link.name][:3, 3]
        along = np.array(axis.along)
        assert abs(link.joints[0].axis @ along) == pytest.approx(1, abs=1e-9)
        assert np.linalg.norm(between - (between @ along) * along) < 1e-6


def test_what_cannot_be_accepted_is_refused(files, tmp_path, capsys):
    folder, _ = files
    for options, says in (
        (("--accept", "9"), "numbers of proposals"),
        (("--accept", "x"), "numbers of proposals"),
        (("--accept", "1", "--ground", "nobody"), "no part"),
        (("--ground", "door/leaf"), "is of --accept"),
    ):
        code = cli.main(["import", str(folder / "door.step"), str(tmp_path / "cell"), *options])
        assert code == Exit.ERROR
        assert says in capsys.readouterr().err
    assert not (tmp_path / "cell").exists()
