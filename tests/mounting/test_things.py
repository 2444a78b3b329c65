"""Tools, workpieces and parts: what no body can be is refused, what speaks of a wrong unit is said."""

from __future__ import annotations

import numpy as np
import pytest

from made_cell import FLOATING, TWO_R, made, two_r
from seerob.core.errors import InputError
from seerob.description.lint import impossible_inertia

BOX = "shape = { box = [0.2, 0.1, 0.1] }\n"
TOOL = '[[tools]]\nname = "grip"\non = "arm/tip"\n'
PART = '[[parts]]\nname = "grip"\n'
INERTIA = "mass = 1\ncom = [0, 0, 0]\ninertia = "


def findings(folder, text, subject="grip"):
    model = made(folder, FLOATING + TWO_R + text, {"arm.urdf": two_r()}).model
    return [(f.level, f.text) for f in model.findings if f.subject == subject]


def problem(folder, text):
    with pytest.raises(InputError) as error:
        made(folder, FLOATING + TWO_R + text, {"arm.urdf": two_r()})
    (only,) = error.value.problems
    return only


@pytest.mark.parametrize("table", [TOOL, PART])
@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("shape = { box = [200, 100, 100] }\n", "read as mm it would be 0.2 m"),
        ("shape = { sphere = 1e-5 }\n", "largest extent 2e-05 m"),
        (BOX + "mass = 20000\n", "at most 10000 kg"),
        (BOX + "mass = 60\n", "3e+04 kg/m³"),
        (BOX + "mass = 0.01\n", "5 kg/m³"),
        ("shape = { sphere = 0.1 }\nmass = 200\n", "kg/m³"),
        (BOX + "density = 2.7\n", "density is 2.7 kg/m³"),
        (BOX + "mass = 1\ncom = [0.3, 0, 0]\n", "outside the shape's box"),
    ],
)
def test_what_speaks_of_a_wrong_unit_is_a_warning(tmp_path, table, text, words):
    warnings = [said for level, said in findings(tmp_path, table + text) if level == "warning"]
    assert any(words in said for said in warnings), warnings


@pytest.mark.parametrize("density", [10.01, 24_990])
def test_what_is_plausible_is_not_warned_of(tmp_path, density):
    said = findings(tmp_path, f"{TOOL}{BOX}mass = {density * 0.002}\ncom = [0.1, 0, 0]\n")
    assert not [text for level, text in said if level == "warning"]


@pytest.mark.parametrize(
    ("more", "told"),
    [
        ("com = [0.05, 0, 0]\n", "how its mass is spread about its centre"),
        ("com = [0, 0, 0]\n", "how its mass is spread about its centre"),
        ("", "where in its shape its mass is"),
        ("uniform_density = true\n", ""),
        ("com = [0.05, 0, 0]\ninertia = [0.01, 0.01, 0.01, 0, 0, 0]\n", ""),
    ],
)
def test_what_nobody_says_of_a_mass_is_told_as_assumed(tmp_path, more, told):
    """A point mass has no moments at all, and may be anywhere in the shape."""
    said = findings(tmp_path, f"{TOOL}{BOX}mass = 2\n{more}")
    found = [text for level, text in said if level == "assumed" and "nobody says" in text]
    assert [told in text for text in found] == [True] * bool(told)


def test_a_mesh_in_the_wrong_unit_names_the_one_that_fits(tmp_path):
    corners = "v 0 0 0\nv 90 0 0\nv 0 90 0\nv 0 0 90\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    (tmp_path / "t.obj").write_text(corners)
    said = findings(tmp_path, TOOL + 'mesh = "t.obj"\nunits = "m"\n')
    assert any("read as mm it would be 0.09 m" in text for level, text in said if level == "warning")


@pytest.mark.parametrize(("table", "where"), [(TOOL, "tools[0]"), (PART, "parts[0]")])
@pytest.mark.parametrize(
    ("text", "key", "what", "remedy"),
    [
        ("mass = 1\ncom = [0, 60, 0]\n", "com", "[0.0, 60.0, 0.0] m lies", "com_mm"),
        (INERTIA + "[1, 1, 3, 0, 0, 0]\n", "inertia", "A + B ≥ C", "[0.001667, 0.004167, 0.004167, "),
        (INERTIA + "[1, 1, 1, 2, 0, 0]\n", "inertia", "not all greater than 0", "ixx, iyy, izz"),
        (INERTIA + "[0, 0, 0, 0, 0, 0]\n", "inertia", "not all greater than 0", "ixx, iyy, izz"),
    ],
)
def test_what_no_body_can_have_is_refused(tmp_path, table, where, text, key, what, remedy):
    """A box of 1 kg: (b² + c²) / 12 = 0.02 / 12 and 0.05 / 12."""
    found = problem(tmp_path, table + BOX + text)
    assert found.key == f"{where} ({key})"
    assert what in found.what
    assert remedy in found.remedy


@pytest.mark.parametrize(
    ("table", "key"),
    [
        ("{ mass = 1, com = [0.5, 0, 0], inertia = [1, 1, 3, 0, 0, 0] }", "inertia"),
        ("{ mass = 1, com = [50, 0, 0] }", "com"),
    ],
)
def test_masses_of_links_are_looked_at_in_the_same_way(tmp_path, table, key):
    assert problem(tmp_path, f"[robots.masses]\nl1 = {table}\n").key == f"robots[0] (masses.l1.{key})"


def test_an_inertia_is_possible_when_points_of_mass_make_it():
    """Of any cloud of points the triangle inequality holds; of its negative or one enlarged moment not."""
    generator = np.random.default_rng(1)
    for _ in range(50):
        x = generator.normal(size=(5, 3))
        inertia = np.sum(x**2) * np.eye(3) - x.T @ x
        assert not impossible_inertia(inertia)
        values, axes = np.linalg.eigh(inertia)
        values[2] = 1.1 * (values[0] + values[1])
        assert "A + B" in impossible_inertia(axes @ np.diag(values) @ axes.T)
        assert "greater than 0" in impossible_inertia(-inertia)


def test_rounding_of_a_given_inertia_is_mended_and_said(tmp_path):
    said = dict(findings(tmp_path, TOOL + BOX + INERTIA + "[0.001, 0.001, 0.00201, 0, 0, 0]\n"))
    assert "rounding, mended" in said["note"]


@pytest.mark.parametrize(
    ("shape", "mass"), [("box = [0.2, 0.1, 0.1]", 5.4), ("sphere = 0.1", 2700 * 4e-3 * np.pi / 3)]
)
def test_a_mass_from_density_is_said_with_method_and_error(tmp_path, shape, mass):
    said = dict(findings(tmp_path, f"{TOOL}shape = {{ {shape} }}\ndensity = 2700\n"))
    assert said["note"].startswith(f"mass {mass:.4g} kg estimated: 2700 kg/m³ × volume of the ")
    assert said["note"].endswith("error ±0 %")


@pytest.mark.parametrize(
    ("mass", "level", "words"),
    [
        ("mass = 2\n", "note", "carries 2.5 kg: grip 2 kg, part 0.5 kg"),
        ("mass = 499.5\n", "note", "carries 500 kg"),
        ("mass = 600\n", "warning", "carries 600.5 kg"),
        ("", "note", "carries at least 0.5 kg: grip unknown, part 0.5 kg"),
    ],
)
def test_what_a_robot_carries(tmp_path, mass, level, words):
    part = '[[workpieces]]\nname = "part"\non = "grip"\nshape = { sphere = 0.05 }\nmass = 0.5\n'
    said = [(a, b) for a, b in findings(tmp_path, TOOL + BOX + mass + part, "arm") if "carries" in b]
    assert said[0][0] == level
    assert said[0][1].startswith(words)
    assert len(said) == 1
