"""The kind is the name of a module, and that is all."""

from __future__ import annotations

import importlib
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from seerob.app.cli import main
from seerob.core import plugin
from seerob.core.errors import SeerobError, UnknownName
from seerob.criteria.criterion import Criterion
from seerob.session.reading import BASES, read

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"

HEAD = "from seerob.criteria.criterion import Criterion\n"
RULE = "class {0}(Criterion, frozen=True, kw_only=True):\n    '''A rule.'''\n    unit = 'm'\n    robot: str\n"


@pytest.fixture
def module(tmp_path, monkeypatch):
    """Writes a module of a company and returns its dotted name."""
    monkeypatch.syspath_prepend(str(tmp_path))

    def write(name, text):
        package = tmp_path / f"acme_{name}"
        package.mkdir()
        (package / "__init__.py").write_text("")
        (package / "rule.py").write_text(text)
        return f"acme_{name}.rule"

    return write


@pytest.mark.parametrize(("group", "kind"), [(g, k) for g in BASES for k in plugin.kinds(g)])
def test_every_kind_that_ships_is_one_documented_class(group, kind):
    found = plugin.load(group, kind, BASES[group])
    assert found.__module__ == f"{plugin.home(group)}.{kind}"
    title = found.__doc__.strip().splitlines()[0]
    assert title.endswith(".")
    assert len(title) < 120
    assert found.__struct_config__.frozen
    assert found.__struct_config__.forbid_unknown_fields


def test_a_module_of_a_company_is_a_kind(module):
    kind = module("one", HEAD + RULE.format("Rule") + RULE.format("_Hidden"))
    assert plugin.load("safety", kind, Criterion, allow_plugins=True).__name__ == "Rule"


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("none", HEAD, "it defines: none"),
        ("two", HEAD + RULE.format("A") + RULE.format("B"), "it defines: A, B"),
        ("needs", "import a_package_nobody_has\n", "needs the package 'a_package_nobody_has'"),
        ("inner", "import seerob.nothing_of_that_name\n", "needs the package 'seerob.nothing_of_that_name'"),
        ("fails", "1 / 0\n", "ZeroDivisionError"),
        ("syntax", "def\n", "SyntaxError"),
    ],
)
def test_a_module_that_is_not_one_rule_says_why(module, name, text, words):
    kind = module(name, text)
    with pytest.raises(SeerobError) as error:
        plugin.load("safety", kind, Criterion, allow_plugins=True)
    assert words in str(error.value)
    assert kind in str(error.value)


@pytest.mark.parametrize(
    "kind", ["", ".", ".velocity", "velocity.", "a..b", "_hidden", "__init__", "a b", "a-b", "a/b"]
)
def test_a_kind_that_is_no_name_of_a_module_imports_nothing(kind):
    with pytest.raises(UnknownName, match=min(plugin.kinds("safety"))):
        plugin.load("safety", kind, Criterion)


def test_a_module_of_ours_is_no_kind_of_another_group():
    with pytest.raises(UnknownName):
        plugin.load("safety", "csv", Criterion)
    with pytest.raises(SeerobError, match="must define one Criterion"):
        plugin.load("safety", "seerob.core.errors", Criterion, allow_plugins=True)
    with pytest.raises(SeerobError, match=r"no module 'acme\.nothing'"):
        plugin.load("safety", "acme.nothing", Criterion, allow_plugins=True)


@pytest.mark.parametrize("how", ["-m seerob check-file --allow-plugins", "-m seerob check-file", "sr.load"])
@pytest.mark.parametrize("inside", [True, False])
def test_a_module_beside_the_file_is_never_run(tmp_path, how, inside):
    kinds = ["rce.evil", "evil.rule"]
    cell = tmp_path / "cell"
    (cell / "rce").mkdir(parents=True)
    ran = tmp_path / "ran"
    text = f"open({str(ran)!r}, 'w').close()\n"
    for file in ("rce/__init__.py", "rce/evil.py", "evil.py"):
        (cell / file).write_text(text)
    tables = "".join(f'[[safety]]\nkind = "{kind}"\n' for kind in kinds)
    (cell / "workstation.toml").write_text('[[robots]]\nname = "r"\nmodel = "library:ur5e"\n' + tables)
    where = "." if inside else str(cell)
    words = (
        how.split()
        if how[0] == "-"
        else ["-c", "import sys, seerob; seerob.load(sys.argv[1], allow_plugins=True)"]
    )
    done = subprocess.run(
        [sys.executable, *words, where],
        cwd=cell if inside else tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode != 0
    for i, kind in enumerate(kinds):
        assert f"safety[{i}].kind" in done.stderr
        assert kind in done.stderr
    assert not ran.exists()


def test_an_installed_module_is_imported_by_its_name_only_where_that_is_allowed(module, tmp_path):
    ran = tmp_path / "ran"
    kind = module("named", f"open({str(ran)!r}, 'w').close()\n" + HEAD + RULE.format("Rule"))
    with pytest.raises(SeerobError, match="--allow-plugins"):
        plugin.load("safety", kind, Criterion)
    assert not ran.exists()
    assert plugin.load("safety", kind, Criterion, allow_plugins=True).__name__ == "Rule"
    assert ran.exists()


@pytest.mark.parametrize("present", [".", ""])
def test_no_module_is_taken_from_the_present_folder(tmp_path, monkeypatch, present):
    """In a notebook the present folder is where Python looks first."""
    (tmp_path / "evil").mkdir()
    (tmp_path / "evil" / "rule.py").write_text("1 / 0")
    info = tmp_path / "evil-1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: evil\nVersion: 1\n")
    (info / "entry_points.txt").write_text("[seerob.safety]\nevil.other = this\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [present, *sys.path])
    for kind in ("evil.rule", "evil.other"):
        with pytest.raises(SeerobError, match="lies in the folder that seerob is started in"):
            plugin.load("safety", kind, Criterion, allow_plugins=True)
    assert "this" not in sys.modules


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """The example's package, installed as anybody's is."""
    source, target = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("installed")
    shutil.copytree(EXAMPLES / "acme", source / "acme", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(EXAMPLES / "pyproject.toml", source)
    options = ["--no-deps", "--no-build-isolation", "--no-index", "--quiet", "--target", str(target)]
    subprocess.run([sys.executable, "-m", "pip", "install", *options, str(source)], check=True)
    return target


def test_an_installed_package_offers_its_kinds_by_entry_points(installed, monkeypatch, tmp_path, capsys):
    monkeypatch.syspath_prepend(str(installed))
    for name in [n for n in sys.modules if n.split(".")[0] == "acme"]:
        monkeypatch.delitem(sys.modules, name)
    assert main(["kinds", "safety"]) == 0
    line = next(line for line in capsys.readouterr().out.splitlines() if "acme.work_height" in line)
    assert "acme-rules 1.0" in line
    assert not any(name.split(".")[0] == "acme" for name in sys.modules)  # told of without being run
    (tmp_path / "workstation.toml").write_text(
        '[[robots]]\nname = "r"\nmodel = "library:ur5e"\n[[humans]]\nname = "op"\nstature = 1.75\n'
        'mass = 75\nsex = "male"\n[[safety]]\nkind = "acme.work_height"\nat = "r"\nlimit = 9\n'
        '[[ergonomics]]\nkind = "acme.bending"\nhuman = "op"\n'
    )
    station = read(tmp_path)
    assert (type(station.safety[0]).__name__, type(station.ergonomics[0]).__name__) == (
        "WorkHeight",
        "Bending",
    )
    assert plugin.kind_of("ergonomics", station.ergonomics[0]) == "acme.bending"
    with pytest.raises(SeerobError, match=r"kind 'acme\.work_hight'.*acme\.work_height"):
        plugin.load("safety", "acme.work_hight", Criterion)


def test_the_kind_of_a_class_needs_nobody_to_have_loaded_it(tmp_path, monkeypatch):
    """As in a process that a pickled station arrives in: its class is imported, its kind never was."""
    (tmp_path / "renamed_rules.py").write_text("class Speed:\n    pass\n")
    info = tmp_path / "renamed_rules-1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: renamed-rules\nVersion: 1\n")
    (info / "entry_points.txt").write_text("[seerob.safety]\nacme.speed = renamed_rules:Speed\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    speed = importlib.import_module("renamed_rules").Speed()
    assert plugin.kind_of("safety", speed) == "acme.speed"
    assert plugin.kind_of("ergonomics", speed) == "renamed_rules"
