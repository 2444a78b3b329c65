"""Tools of the library: what a cell gets of each, and what nobody published stays unknown."""

import numpy as np
import pytest

from seerob.core.errors import InputError
from seerob.core.snapshot import Origin
from seerob.description.tools import library
from seerob.session.station import load

CELL = """
[[robots]]
name = "ur"
model = "library:ur5e"

[[tools]]
name = "hand"
model = "library:{tool}"
on = "ur/tool0"
{more}
"""


def cell(folder, tool, more=""):
    (folder / "workstation.toml").write_text(CELL.format(tool=tool, more=more))
    return load(folder)


def test_each_has_a_source_a_closed_envelope_away_from_the_robot_and_a_mass_that_bodies_can_have():
    assert len(library.names()) >= 10
    for name in library.names():
        tool = library.load(name)
        low = min(s.mesh.vertices[:, 2].min() for s in tool.solids)
        high = max(s.mesh.vertices[:, 2].max() for s in tool.solids)
        assert -0.03 < low <= 0.001, name
        assert 0.05 < high < 0.4, name
        if tool.tcp is not None:
            assert 0 < tool.tcp[2, 3] < high + 0.01, name
        if tool.inertial is not None:
            assert tool.inertial.origin is Origin.STATED
            assert "(" in tool.inertial.source
            a, b, c = np.linalg.eigvalsh(tool.inertial.inertia)
            assert a > 0
            assert c <= 1.02 * (a + b), name
            assert low < tool.inertial.com[2] < high


def test_a_cell_has_its_envelope_mass_and_working_point_and_what_the_file_says_goes_before(tmp_path):
    station = cell(tmp_path, "franka_hand")
    body = next(b for b in station.model.bodies if b.name == "hand")
    assert body.mass.value == pytest.approx(0.7126)
    assert station.model.robot("ur").tip.name == "hand"
    assert station.model.robot("ur").tip.body_from_frame[2, 3] == pytest.approx(0.1034)
    assert any("envelope made by seerob" in f.text for f in station.scene().findings if f.subject == "hand")
    station = cell(tmp_path, "franka_hand", "mass = 0.9\ntcp = { position = [0, 0, 0.2] }")
    body = next(b for b in station.model.bodies if b.name == "hand")
    assert body.mass.value == pytest.approx(0.9)
    assert station.model.robot("ur").tip.body_from_frame[2, 3] == pytest.approx(0.2)
    body = next(b for b in cell(tmp_path, "robotiq_2f_140").model.bodies if b.name == "hand")
    assert body.mass is None
    for tool, more, says in (
        ("nothing", "", "tool in the library"),
        ("franka_hand", "shape = { box = [1, 1, 1] }", "leave out mesh and shape"),
    ):
        with pytest.raises(InputError, match=says):
            cell(tmp_path, tool, more).model.bodies  # noqa: B018
