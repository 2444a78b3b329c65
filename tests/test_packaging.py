"""What other places need agrees with the package: dependencies, the schema's name, commands of workflows."""

import json
import re
import tomllib
from pathlib import Path

import yaml

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
OTHERWISE = {"mujoco-core": "mujoco-python"}


def test_the_recipe_asks_for_what_the_package_asks_for():
    recipe = yaml.safe_load((ROOT / "packaging/conda/recipe.yaml").read_text())
    asked = {re.match(r"[\w.-]+", one)[0]: one for one in PROJECT["dependencies"]}
    run = {one.split()[0]: one.partition(" ")[2] for one in recipe["requirements"]["run"]}
    names = {OTHERWISE.get(name, name): text.removeprefix(name) for name, text in asked.items()}
    assert run == {"python": PROJECT["requires-python"], **names}
    assert recipe["context"]["version"] == PROJECT["version"]


def test_the_schema_store_matches_the_file_that_a_workstation_is():
    entry = json.loads((ROOT / "packaging/schemastore.json").read_text())
    assert (
        entry["fileMatch"] == [file.name for file in (ROOT / "workstations/guarded_cell").glob("*.toml")][:1]
    )


def test_workflows_call_targets_and_tests_that_there_are():
    made = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.M))
    for file in (ROOT / ".github/workflows").glob("*.yml"):
        text = file.read_text()
        assert yaml.safe_load(text)["jobs"]
        assert set(re.findall(r"run: make ([a-z-]+)", text)) <= made
        assert [name for name in re.findall(r"tests/\w+\.py", text) if not (ROOT / name).is_file()] == []
        assert "permissions" in yaml.safe_load(text)
