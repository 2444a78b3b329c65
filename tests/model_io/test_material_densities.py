"""Densities that come with seerob: by words in names of materials, with how far they may be off."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from test_mass_bounds import KILO, METRE, block_with_a_density

from made_cell import FLOATING, TWO_R, made, two_r
from seerob.app import cli
from seerob.app.console.terminal import Exit
from seerob.app.importing.folder import Densities, _stated_mass
from seerob.core.shapes import Mesh
from seerob.core.snapshot import Origin
from seerob.description.cad.assembly import Shape
from seerob.description.cad.materials import _families, material
from seerob.description.description import Inertial
from seerob.description.shapes.shapes import box_mesh
from seerob.twin.accuracy.mass_tolerances import MassTolerances


@pytest.mark.parametrize(
    ("name", "family"),
    [
        *((word, "steel") for word in ("Steel, mild", "S235JR", "1.4301", "X5CrNi18-10", "Stahl", "acier")),
        *((word, "aluminium") for word in ("Aluminum 6061-T6", "EN AW-6082", "AlMgSi1F31", "ALUMINIUM")),
        *((word, "cast iron") for word in ("EN-GJL-250", "Cast Iron", "GG25")),
        *((word, "brass") for word in ("CuZn39Pb3", "Messing")),
        *((word, None) for word in ("", "Steelcase blue", "PA6", "POM-C", "unsteel", "generic", "glasses")),
        ("steel on brass", None),
        ("PA66, glass filled", None),
        ("brass or bronze", None),
    ],
)
def test_a_family_is_known_by_a_word_of_its_own(name, family):
    found = material(name)
    assert (None if found is None else found.name) == family


def test_every_family_has_an_interval_and_a_source_and_no_word_of_another():
    for one, words in _families():
        assert 0 < one.low < one.high
        assert one.source
        assert one.low == pytest.approx(one.density * (1 - one.tolerance))
        assert one.high == pytest.approx(one.density * (1 + one.tolerance))
        assert words.search(one.name)
        assert material(one.name) == one


def block(name, density=None):
    return Shape("block", (box_mesh((0, 0, 0), (0.1, 0.1, 0.1)),), 0.0, 1, name, density=density)


def test_what_somebody_states_goes_before_what_the_library_has():
    steel = material("S235JR")
    assert Densities(library=True).of(block("S235JR")) == steel.density
    assert Densities(library=True).of(block("S235JR", 7850.0)) == 7850.0
    assert Densities(of_all=2700.0, library=True).of(block("S235JR")) == 2700.0
    assert Densities(by_material={"S235JR": 7850.0}, library=True).of(block("S235JR")) == 7850.0
    assert Densities().of(block("S235JR")) is None
    assert Densities(library=True).of(block("PA6")) is None
    found = Densities(library=True).weighed(block("S235JR"))
    assert found.mass == pytest.approx(1e-3 * steel.density)
    low, high = found.mass * (1 - found.error), found.mass * (1 + found.error)
    assert (low, high) == pytest.approx((1e-3 * steel.low, 1e-3 * steel.high))


def test_a_ball_of_triangles_may_be_off_by_both():
    ball = trimesh.creation.icosphere(3, 0.1)
    pieces = (Mesh(np.array(ball.vertices), np.array(ball.faces)),)
    shape = Shape("ball", pieces, 1e-3, 1, "steel")
    found, alone = Densities(library=True).weighed(shape), Densities(of_all=7900.0).weighed(shape)
    assert found.mass == alone.mass
    assert 1 + found.error == pytest.approx((1 + alone.error) * (1 + material("steel").tolerance))
    assert found.spread_error >= (1 + alone.spread_error) * (1 + material("steel").tolerance) - 1 - 1e-12


def test_what_is_imported_says_what_it_is_taken_for_and_by_how_much_it_may_be_off(tmp_path, capsys):
    pytest.importorskip("OCP")
    file, folder = tmp_path / "block.step", tmp_path / "my_cell"
    block_with_a_density(file, (KILO, "1.", METRE, "-2."))  # no density, and not taken
    assert cli.main(["import", str(file), str(folder), "--density", "library"]) == Exit.WITHIN
    assert "steel is taken for steel, 7700 to 8100 kg/m³" in capsys.readouterr().out
    table = json.loads((folder / "import.json").read_text())
    (row,) = table["parts"]
    assert row["density"] == 7900
    assert row["mass"] == pytest.approx(7.9)
    assert row["mass_error"] == pytest.approx(200 / 7900)
    assert table["options"]["density"] == ["library"]
    assert row["written"]["density_tolerance"] == pytest.approx(200 / 7900, abs=1e-6)
    assert row["written"]["density_tolerance"] >= 200 / 7900
    assert cli.main(["check-file", str(folder)]) == Exit.WITHIN
    assert cli.main(["import", str(file), str(folder)]) == Exit.WITHIN  # another revision
    assert json.loads((folder / "import.json").read_text())["parts"][0]["mass"] == pytest.approx(7.9)


@pytest.mark.parametrize("becomes", ["workpieces", "tools"])
@pytest.mark.parametrize("what", ["block", "ball"])
def test_what_was_imported_is_off_by_as_much_when_a_robot_carries_it(tmp_path, what, becomes):
    """The table of a part as it was written, under another heading and with a link that carries it."""
    pytest.importorskip("OCP")
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeSphere

    file, folder = tmp_path / f"{what}.step", tmp_path / "cell"
    ball = BRepPrimAPI_MakeSphere(50.0).Shape() if what == "ball" else None
    block_with_a_density(file, (KILO, "1.", METRE, "-2."), solid=ball)
    assert cli.main(["import", str(file), str(folder), "--density", "library"]) == Exit.WITHIN
    text = (folder / "workstation.toml").read_text()
    table = text[text.index("[[parts]]") :].replace("[[parts]]", f"[[{becomes}]]\non = 'arm/tip'")
    assert ("density_tolerance" if what == "block" else "mass_tolerance") in table
    cell = made(folder, FLOATING + TWO_R + table, {"arm.urdf": two_r()})
    found = MassTolerances(cell.model, cell.model.robot("arm"))
    volume = 1e-3 if what == "block" else 4 / 3 * np.pi * 0.05**3
    assert 8100 * volume * (1 - 2e-6) <= found.heaviest_load() < 8110 * volume


def test_of_a_mass_whose_shape_is_open_the_mass_and_its_even_density_are_written():
    sure = Inertial(2.0, np.zeros(3), np.eye(3), Origin.GIVEN, "file")
    assert _stated_mass(sure).keys() == {"mass", "com", "inertia"}
    assert _stated_mass(replace(sure, spread_error=0.1)) == {"mass": 2, "uniform_density": True}
    assert _stated_mass(replace(sure, error=0.1, spread_error=0.1)).keys() == {
        "mass", "mass_tolerance", "com", "inertia",
    }  # fmt: skip
    assert _stated_mass(replace(sure, error=1 / 3, spread_error=0.5)) == {
        "mass": 2,
        "uniform_density": True,
        "mass_tolerance": 0.333334,
    }
