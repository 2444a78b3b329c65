"""workstations/imported_line: what is in the repository is what its STEP file gives today."""

import json
import runpy
import tomllib
from pathlib import Path

import pytest
import trimesh

from seerob.app import cli
from seerob.app.console.terminal import Exit

ROOT = Path(__file__).parents[1]
WEIGHED = ("mass", "com", "inertia")
"""Of solids, which another OpenCASCADE may integrate otherwise in the last digit."""
FOLDER = ROOT / "workstations/imported_line"


def test_the_step_file_is_the_scripts():
    made = runpy.run_path(str(ROOT / "scripts/make-imported-line"))["line"]().text()
    assert (FOLDER / "line.step").read_text() == made


def test_importing_it_anew_gives_the_same_parts(tmp_path):
    new = tmp_path / "line"
    given = ("--density", "S235JR=7850", "--density", "AlMgSi1=2700")
    assert cli.main(["import", str(FOLDER / "line.step"), str(new), *given]) == Exit.WITHIN
    tables = [tomllib.loads((f / "workstation.toml").read_text())["parts"] for f in (FOLDER, new)]
    for old, row in zip(*tables, strict=True):
        assert row.keys() == old.keys()
        for key, value in row.items():
            assert value == (pytest.approx(old[key], rel=1e-6, abs=1e-9) if key in WEIGHED else old[key])
    before, now = (json.loads((f / "import.json").read_text()) for f in (FOLDER, new))
    for key in ("sha256", "format", "unit", "left_out", "findings"):
        assert before[key] == now[key]
    for old, row in zip(before["parts"], now["parts"], strict=True):
        # Another OpenCASCADE may cut round surfaces differently, within the same tolerance.
        for key in (
            "name",
            "in_file",
            "product",
            "mesh",
            "solids",
            "closed",
            "material",
            "density",
        ):
            assert old[key] == row[key]
        assert row["written"].keys() == old["written"].keys()
        for key, value in old["written"].items():
            close = pytest.approx(value, rel=1e-6, abs=1e-9) if key in WEIGHED else value
            assert row["written"][key] == close
        assert row["volume"] == pytest.approx(old["volume"], rel=0.01)
        assert row["box"] == [pytest.approx(corner, abs=2e-4) for corner in old["box"]]
        meshes = [trimesh.load(f / row["mesh"], force="mesh") for f in (FOLDER, new)]
        assert meshes[0].bounds == pytest.approx(meshes[1].bounds, abs=2e-4)
