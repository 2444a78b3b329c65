"""What the import contract is for is caught by it: one wrong arrow of each kind, in a copy of the sources."""

import os
import re
import shutil
import subprocess
import sys
import sysconfig
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
WRONG = {
    "A room imports only rooms below it": (
        "core/quantities.py",
        "def lazily():\n    import seerob.session.run\n",
    ),
    "Nothing is imported in a circle, in no room": (
        "outputs/palette.py",
        "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    import seerob.outputs.report.page\n",
    ),
    "Criteria do not import each other": (
        "criteria/safety/brake_distance.py",
        "from seerob.criteria.safety.velocity import point_velocity\n",
    ),
    "Rules do not import each other": (
        "criteria/ergonomics/ocra.py",
        "from seerob.criteria.ergonomics import rula\n",
    ),
    "Sources do not import each other": (
        "devices/sources/fanuc.py",
        "def lazily():\n    from seerob.devices.sources.rtde import Rtde\n",
    ),
    "Sinks do not import each other": ("outputs/sinks/influx.py", "import seerob.outputs.sinks.csv\n"),
    "Mesh formats do not import each other": (
        "description/meshes/step.py",
        "from seerob.description.meshes import stl\n",
    ),
    "Emulators do not import each other": ("app/emulators/fanuc.py", "import seerob.app.emulators.rtde\n"),
    "Sources and sinks know no physics": ("devices/sources/simulator.py", "import mujoco\n"),
}


@pytest.fixture(scope="module")
def said(tmp_path_factory):
    copy = tmp_path_factory.mktemp("house")
    ignored = shutil.ignore_patterns("__pycache__", "page", "*.toml", "*.json", "*.stl")
    shutil.copytree(ROOT / "src", copy / "src", ignore=ignored)
    shutil.copy(ROOT / "pyproject.toml", copy)
    for file, text in WRONG.values():
        with (copy / "src/seerob" / file).open("a", encoding="utf-8") as module:
            module.write(text)
    command = Path(sysconfig.get_path("scripts")) / "lint-imports"
    ran = subprocess.run(
        [sys.executable, str(command), "--no-cache"],
        cwd=copy, env={**os.environ, "PYTHONPATH": str(copy / "src")},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    return ran.stdout + ran.stderr


@pytest.mark.parametrize("contract", WRONG)
def test_a_wrong_arrow_breaks_its_contract(said, contract):
    assert f"{contract} BROKEN" in said


def test_every_contract_is_tried(said):
    assert said.count(" BROKEN") == len(WRONG)
    assert " KEPT" not in said


# -- the page -------------------------------------------------------------------------------------


def imported(page: Path) -> dict[Path, set[Path]]:
    """Modules of a page and what each imports of it, lazily and for types too."""
    found = {}
    for file in sorted([*page.rglob("*.ts"), *page.rglob("*.tsx")]):
        names = re.findall(r"""(?:\bfrom|\bimport)\s*\(?\s*["'](\.[^"']+)["']""", file.read_text("utf-8"))
        found[file.with_suffix("")] = {
            (file.parent / re.sub(r"\.tsx?$", "", name)).resolve() for name in names
        }
    return found


def test_no_module_of_the_page_is_imported_in_a_circle():
    modules = imported((ROOT / "web/src").resolve())
    assert len(modules) > 80
    assert sum(map(len, modules.values())) > 300
    TopologicalSorter(modules).prepare()


def test_a_circle_of_the_page_is_found(tmp_path):
    (tmp_path / "caption.ts").write_text('import { draw } from "./drawn"\n')
    (tmp_path / "drawn.ts").write_text('export const draw = async () => await import("./caption")\n')
    with pytest.raises(CycleError):
        TopologicalSorter(imported(tmp_path.resolve())).prepare()
