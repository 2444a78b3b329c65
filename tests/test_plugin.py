"""The kind is the name of a module, and that is all."""

from __future__ import annotations

import subprocess
import sys

import pytest

from seerob.core import plugin
from seerob.core.errors import SeerobError, UnknownName
from seerob.criteria.criterion import Criterion
from seerob.session.reading import BASES

HEAD = "from seerob.criteria.criterion import Criterion\n"
RULE = "class {0}(Criterion, frozen=True, kw_only=True):\n    '''A rule.'''\n    robot: str\n"


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
    assert plugin.load("safety", kind, Criterion).__name__ == "Rule"


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
        plugin.load("safety", kind, Criterion)
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
        plugin.load("safety", "seerob.core.errors", Criterion)
    with pytest.raises(SeerobError, match=r"no module 'acme\.nothing'"):
        plugin.load("safety", "acme.nothing", Criterion)


@pytest.mark.parametrize("how", ["-m seerob check-file", "sr.load"])
@pytest.mark.parametrize("inside", [True, False])
@pytest.mark.parametrize("kind", ["rce.evil", "evil.rule"])
def test_a_module_beside_the_file_is_never_run(tmp_path, how, inside, kind):
    cell = tmp_path / "cell"
    (cell / "rce").mkdir(parents=True)
    ran = tmp_path / "ran"
    text = f"open({str(ran)!r}, 'w').close()\n"
    for file in ("rce/__init__.py", "rce/evil.py", "evil.py"):
        (cell / file).write_text(text)
    (cell / "workstation.toml").write_text(
        f'[[robots]]\nname = "r"\nmodel = "library:ur5e"\n[[safety]]\nkind = "{kind}"\n'
    )
    where = "." if inside else str(cell)
    words = how.split() if how[0] == "-" else ["-c", "import sys, seerob; seerob.load(sys.argv[1])"]
    done = subprocess.run(
        [sys.executable, *words, where],
        cwd=cell if inside else tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode != 0
    assert "safety[0].kind" in done.stderr
    assert kind in done.stderr
    assert not ran.exists()
