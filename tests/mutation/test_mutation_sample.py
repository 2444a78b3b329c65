"""A few mutants at every run of the tests; `scripts/mutate` tries them all."""

from __future__ import annotations

import ast
import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path

from mutation.operators import SPOKEN, mutants, mutated
from mutation.session import PACKAGE, put_in
from mutation.traces import Traces
from seerob.core.verdict import Verdict, judge
from seerob.criteria.stopping import models, terms

ROOT = Path(__file__).resolve().parents[2]
SOURCE = '''
LIMIT = 0.5
def judged(v: float, limits=(1, 2), *, strict: bool = True) -> bool:
    """Within 3 of it, in "m"."""
    v += told(f"{v * 2:.3f}", at=Label(position=2 * v), row=[3])
    return not v * 1000.0 <= max(LIMIT, -v) < abs(v), Result(unit="m", reason="none")
'''


def test_each_mutant_is_one_change():
    found = mutants(SOURCE, "made.py")
    compared = "v * 1000.0 {} max(LIMIT, -v) {} abs(v)"
    statement = "v += told(f'{v * 2:.3f}', at=Label(position=2 * v), row=[3])"
    assert [(m.before, m.after) for m in found] == [
        ("0.5", "0.55"),
        ("0.5", "500.0"),
        ("True", "False"),
        ("1", "2"),
        ("2", "3"),
        (statement, statement.replace("+=", "-=")),
        ("3", "4"),
        ("not " + compared.format("<=", "<"), compared.format("<=", "<")),
        *((compared.format("<=", "<"), compared.format(*ops)) for ops in ("><", "<<")),
        *((compared.format("<=", "<"), compared.format("<=", op)) for op in (">=", "<=")),
        ("v * 1000.0", "v / 1000.0"),
        ("1000.0", "1100.0"),
        ("1000.0", "1000000.0"),
        ("max", "min"),
        ("-v", "v"),
        ("abs(v)", "v"),
        ("'m'", "'km'"),
    ]
    texts = {ast.unparse(mutated(SOURCE, mutant)) for mutant in found}
    assert len(texts) == len(found)
    assert ast.unparse(ast.parse(SOURCE)) not in texts


def test_what_is_left_alone_is_left_alone_by_its_own_name():
    text = "def basis(v): return v < 1\nclass Presence:\n    def _worst_sight(self, v): return v < 1\n"
    text += "class RowMarkers:\n    def of(self, v): return v < 1\ndef told(v): say('so much', v / 2)\n"
    other = "class Other:\n    def _worst_sight(self, v): return v < 1\n"
    assert mutants(text, "made.py") == []
    assert {m.function for m in mutants(text + other, "made.py")} == {"Other._worst_sight"}
    trees = [ast.parse(path.read_text("utf-8")) for path in (PACKAGE / "criteria/sensors").glob("*.py")]
    trees += [ast.parse(path.read_text("utf-8")) for path in (PACKAGE / "criteria/safety").glob("*.py")]
    found = {name for tree in trees for name in _functions(tree)}
    assert found >= set(SPOKEN)


def _functions(tree):
    """Names of functions, and of methods with and without their class."""
    for node in tree.body:
        for part in (node, *(node.body if isinstance(node, ast.ClassDef) else ())):
            if isinstance(part, ast.FunctionDef):
                yield from {part.name, f"{getattr(node, 'name', '')}.{part.name}"}


def test_a_default_is_changed_where_the_function_keeps_it(monkeypatch):
    source = (PACKAGE / "core/verdict.py").read_text("utf-8")
    (mutant,) = (m for m in mutants(source, "core/verdict.py") if (m.function, m.before) == ("judge", "True"))
    monkeypatch.setattr(judge, "__kwdefaults__", dict(judge.__kwdefaults__))
    assert judge(1.0, 2.0) is Verdict.WITHIN
    put_in(mutant, source)
    assert judge(1.0, 2.0) is Verdict.EXCEEDED


def test_each_constant_of_a_statement_that_binds_several_is_put_in_by_its_name(monkeypatch):
    source = (PACKAGE / "criteria/stopping/terms.py").read_text("utf-8")
    changed = [m for m in mutants(source, "criteria/stopping/terms.py") if m.function == "<module>"]
    assert [(m.assigned, m.after) for m in changed] == [
        ("BOUND", "1.1"), ("BOUND", "1000.0"), ("CONSTANT", "0.55"), ("CONSTANT", "500.0"),
    ]  # fmt: skip
    for module in list(sys.modules.values()):  # whoever imported them, tests too
        for name in ("BOUND", "CONSTANT"):
            if vars(module).get(name) is getattr(terms, name):
                monkeypatch.setattr(module, name, getattr(terms, name))
    put_in(changed[2], source)
    assert (terms.BOUND, terms.CONSTANT, models.CONSTANT) == (1.0, 0.55, 0.55)


def test_equivalent_mutants_have_a_reason_and_are_named_once():
    known = tomllib.loads((ROOT / "tests/mutation/equivalent.toml").read_text("utf-8"))["equivalent"]
    assert all(entry["why"] for entry in known)
    assert len({entry["mutant"] for entry in known}) == len(known)


def test_a_sample_is_killed():
    """In a process of its own: it changes living code."""
    command = [sys.executable, ROOT / "scripts/mutate", "--sample", "22", "--jobs", "1"]
    files = ["criteria/contact/collision.py", "criteria/stopping/terms.py", "kernels/verdicts.py"]
    for only in files:
        command += ["--only", only]
    stopping = ("stopping", "stop_options", "stop_edges")
    for tests in (
        "contact/test_collision.py",
        "test_answers.py",
        "relations/test_plan.py::test_rows_are_judged_as_figures_are",
        *(f"stopping/test_{n}.py" for n in stopping),
    ):
        command += ["--tests", ROOT / "tests" / tests]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr
    told = re.findall(r"^(\S+): (\d+) of (\d+) mutants killed", done.stdout, re.MULTILINE)
    assert [file for file, *_ in told] == files
    assert all(int(killed) == int(tried) > 3 for _, killed, tried in told)


def test_a_test_that_fails_in_any_forked_process_kills_nothing(tmp_path):
    """Every mutant that it ran was counted as killed."""
    (tmp_path / "test_made.py").write_text(
        "import os\nfrom seerob.core.verdict import judge\nHERE = os.getpid()\n"
        "def test_it():\n    judge(1.0, None)\n    assert os.getpid() == HERE\n"
    )
    command = [sys.executable, ROOT / "scripts/mutate", "--only", "core/verdict", "--named", " judge: limit"]
    command += ["--jobs", "1", "--tests", tmp_path / "test_made.py"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 2, done.stdout + done.stderr
    assert "::test_it (in a forked process)" in done.stderr
    assert "survived" in done.stdout


def test_traces_are_kept_until_a_test_or_what_it_runs_changes(tmp_path):
    """And a test that fails has none."""
    text = "LIMIT = 2\n\n\ndef asked(v):\n    if v > LIMIT:\n        return 1\n    return 0\n"
    place, test, kept = tmp_path / "made.py", tmp_path / "test_made.py", tmp_path / "kept.json"
    test.write_text("one test")
    found = {}
    exec(compile(text, str(place), "exec"), found)
    runs = []

    def trace(source=text, loops=(), v=1):
        def run():
            runs.append(v)
            return found["asked"](v) < 9

        traces = Traces({"made.py": source, "other.py": text + "#"}, tmp_path, kept, list(loops))
        result = traces.of("test_made.py::test_it", test, run)
        traces.write()
        return result

    first = trace()
    assert {file: sorted(lines) for file, lines in first.lines.items()} == {"made.py": [5, 7]}
    assert first.functions == {"made.py": ["asked"]}
    assert first.names == ["LIMIT"]
    assert trace() == first
    assert len(runs) == 1
    assert sorted(trace(source=text + "#", v=3).lines["made.py"]) == [5, 6]
    assert trace(loops=["kernels/x.py"]).functions == first.functions
    test.write_text("another")
    assert trace() is not None
    assert len(runs) == 4
    found["asked"] = lambda v: 9
    test.write_text("a third")
    assert trace() is None
    assert len(json.loads(kept.read_text("utf-8"))) == 1
