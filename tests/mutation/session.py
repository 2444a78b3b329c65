"""A pytest session that runs its tests once, and then those that a mutant could fail, for each mutant.

The changed code is put into the living functions of a forked process: nothing on disk changes, and what was
imported and collected once is not imported again. Which tests run which statements is seen while they run
unchanged. A test that fails in a forked process also without any change kills nothing, and is told.
"""

from __future__ import annotations

import ast
import gc
import importlib
import inspect
import os
import signal
import sys
import types
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cached_property, partial
from itertools import accumulate
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from _pytest.runner import runtestprotocol

import seerob
from mutation.operators import Mutant, assigned, mutated
from mutation.traces import Traces

PACKAGE = Path(inspect.getfile(seerob)).parent
LEAST = 20
"""Seconds that a test of a mutant may take at least before the mutant counts as one that never ends."""
NOT_PUT_IN = 1
"""Exit code of a process that could not change its code: nothing is known of the mutant."""
FIRST = 3
"""Exit code of a process whose first test failed; one more for each that did not."""


Callers = dict[tuple[str, str], list[Any]]
"""Tests that call a function, by file and qualified name."""
Lines = dict[tuple[str, int], set[str]]
"""Names of the tests that run a line, by file."""


class Outcome(NamedTuple):
    """What became of a mutant."""

    mutant: Mutant
    killed: bool
    tests: int
    """That run what it changes; none of them, and it survives."""


class Mutation:
    """The plugin.

    Args:
        sources: Text of the files that are changed, as it was when the mutants were made.
        mutants: To be tried.
        jobs: Processes at a time.
        tell: Called with each outcome.
        quick: How long the tests of one mutant may take unchanged, in all [s]; its quickest are run.
        kept: File of `Traces`, of all sources then; None keeps none.
    """

    def __init__(
        self,
        sources: dict[str, str],
        mutants: Sequence[Mutant],
        jobs: int,
        tell: Callable[[Outcome], None],
        *,
        quick: float = float("inf"),
        kept: Path | None = None,
    ) -> None:
        self.sources, self.mutants, self.jobs, self.tell = sources, mutants, jobs, tell
        self.quick, self.kept = quick, kept
        self.failed: list[str] = []
        """Tests that fail without any change, and mutants that could not be put in."""
        self.detour: dict[str, float] = {}
        """Of each test: how long it takes, times how much it calls; little where it asks one function."""
        self.naming: dict[str, list[Any]] = defaultdict(list)
        """Tests that call what speaks of a constant or attribute, by its name."""
        self.passing: dict[str, bool] = {}
        """Of each test that killed a mutant: whether it passes in a forked process with no change at all."""

    @pytest.hookimpl(tryfirst=True)
    def pytest_collection(self) -> None:
        """Examples of hypothesis are the same for every mutant, and a failing one is not made smaller."""
        # Not before: what is imported before pytest starts, its plugins cannot rewrite.
        from hypothesis import Phase, settings

        settings.register_profile(
            "mutation",
            deadline=None,
            derandomize=True,
            database=None,
            phases=[Phase.explicit, Phase.generate],
        )
        settings.load_profile("mutation")

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """Instead of running the tests once."""
        if session.testsfailed:
            raise session.Interrupted(f"{session.testsfailed} errors while tests were collected")
        _interpret({mutant.file for mutant in self.mutants})
        callers, lines, seconds = self._unchanged(session)
        changed = {mutant.file for mutant in self.mutants}
        statements = {file: _statements(self.sources[file]) for file in changed}
        queue = []
        for mutant in self.mutants:
            tests = self._tests(mutant, session, callers, seconds)
            if (statement := statements[mutant.file].get(mutant.node)) and mutant.function != "<module>":
                runs = set().union(*(lines[mutant.file, line] for line in statement))
                tests = [item for item in tests if item.nodeid in runs]
            spent = accumulate(seconds[item.nodeid] for item in tests)
            tests = [item for item, until in zip(tests, spent, strict=True) if until <= self.quick]
            queue.append((mutant, tests))
        running: dict[int, tuple[Mutant, list[Any]]] = {}
        kills: Counter[tuple[str, str, str]] = Counter()
        # Whatever is here by now stays: a collection in a forked process would copy it all.
        gc.collect()
        gc.freeze()
        while queue or running:
            while queue and len(running) < self.jobs:
                mutant, items = queue.pop(0)
                if items:
                    # What killed others of the same function kills this one, mostly.
                    items.sort(key=lambda item: -kills[mutant.file, mutant.function, item.nodeid])
                    limits = [_limit(seconds[item.nodeid]) for item in items]
                    running[_forked(mutant, self.sources[mutant.file], items, limits)] = mutant, items
                else:
                    self.tell(Outcome(mutant, False, 0))
            if running:
                pid, status = os.wait()
                if pid in running:
                    mutant, items = running.pop(pid)
                    if os.WIFEXITED(status) and os.WEXITSTATUS(status) == NOT_PUT_IN:
                        self.failed.append(mutant.key)
                        continue
                    first = os.WEXITSTATUS(status) - FIRST if os.WIFEXITED(status) else -1
                    if 0 <= first < len(items):
                        if not self._passes(items[first], seconds):
                            queue.append((mutant, items[:first] + items[first + 1 :]))
                            continue
                        kills[mutant.file, mutant.function, items[first].nodeid] += 1
                    self.tell(Outcome(mutant, status != 0, len(items)))
        return True

    def _passes(self, item: Any, seconds: Mapping[str, float]) -> bool:
        """Whether a test passes in a forked process if nothing is changed: else it tells of no mutant."""
        if item.nodeid not in self.passing:
            pid = _forked(None, "", [item], [_limit(seconds[item.nodeid])])
            self.passing[item.nodeid] = os.waitpid(pid, 0)[1] == 0
            if not self.passing[item.nodeid]:
                self.failed.append(f"{item.nodeid} (in a forked process)")
        return self.passing[item.nodeid]

    def _unchanged(self, session: pytest.Session) -> tuple[Callers, Lines, dict[str, float]]:
        """Tests that call each function and run each line, and how long each takes."""
        changed = {mutant.file for mutant in self.mutants}
        modules = {_module(file) for file in changed}
        sources = {file: text for file, text in self.sources.items() if self.kept or file in changed}
        loops = [file for file in changed if file.startswith("kernels/")]
        traces = Traces(sources, PACKAGE, self.kept, loops)
        callers: Callers = defaultdict(list)
        lines: Lines = defaultdict(set)
        seconds = {}

        def passes(item: pytest.Item) -> bool:
            # Else only the first test that asks would be seen to call what is behind the cache.
            for cached in _cached(modules):
                cached.cache_clear()
            return not any(report.failed for report in runtestprotocol(item, log=False, nextitem=None))

        for item in session.items:
            trace = traces.of(item.nodeid, item.path, partial(passes, item))
            if trace is None:
                self.failed.append(item.nodeid)
                continue
            seconds[item.nodeid] = trace.seconds
            self.detour[item.nodeid] = trace.seconds * trace.called
            for file, functions in trace.functions.items():
                for function in set(functions):
                    callers[file, function].append(item)
            for name in trace.names:
                self.naming[name].append(item)
            for file, run in trace.lines.items():
                for line in run:
                    lines[file, line].add(item.nodeid)
        traces.write()
        return callers, lines, seconds

    def _tests(
        self, mutant: Mutant, session: pytest.Session, callers: Callers, seconds: dict[str, float]
    ) -> list[Any]:
        # What is bound at import calls nothing: who speaks of it is asked.
        if mutant.function == "<module>":
            found = {item.nodeid: item for item in self.naming[mutant.assigned]}
        else:
            found = {
                item.nodeid: item
                for (file, function), items in callers.items()
                if file == mutant.file
                and (function == mutant.function or function.startswith(f"{mutant.function}."))
                for item in items
            }
            found |= {
                item.nodeid: item for item in self.naming[mutant.assigned] if mutant.assigned in _names(item)
            }
        return sorted(found.values(), key=lambda item: self.detour[item.nodeid])


def _statements(source: str) -> dict[int, range]:
    """Lines of the statement that each node of a file is in, without its body; none of a function's head."""
    tree = ast.parse(source)
    numbers = {id(node): k for k, node in enumerate(ast.walk(tree))}
    found: dict[int, range] = {}

    def inside(node: ast.AST, statement: range | None) -> None:
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
            statement = None
        elif isinstance(node, ast.stmt):
            body = getattr(node, "body", None)
            last = max(body[0].lineno - 1, node.lineno) if body else (node.end_lineno or node.lineno)
            statement = range(node.lineno, last + 1)
        if statement is not None:
            found[numbers[id(node)]] = statement
        for child in ast.iter_child_nodes(node):
            inside(child, statement)

    inside(tree, None)
    return found


def _names(item: pytest.Item) -> set[str]:
    """Global names and attributes that a test itself speaks of."""
    function = getattr(item, "function", None)
    codes = _codes(function.__code__) if isinstance(function, types.FunctionType) else ()
    return {name for code in codes for name in code.co_names}


def _limit(seconds: float) -> int:
    """Within which a test ends that took so long while its calls were followed [s]."""
    return LEAST + int(10 * seconds)


def _forked(mutant: Mutant | None, source: str, items: Sequence[Any], limits: Sequence[int]) -> int:
    """Number of a process that runs tests, each of which has its own limit [s], until one fails."""
    pid = os.fork()
    if pid:
        return pid
    try:
        signal.alarm(LEAST)
        silence = os.open(os.devnull, os.O_WRONLY)
        os.dup2(silence, 1)
        os.dup2(silence, 2)
        try:
            if mutant is not None:
                put_in(mutant, source)
        except (LookupError, StopIteration, AttributeError):
            os._exit(NOT_PUT_IN)
        for k, (item, limit) in enumerate(zip(items, limits, strict=True)):
            signal.alarm(limit)
            # What a file's tests share is made once where they follow each other.
            following = items[k + 1] if k + 1 < len(items) else None
            if any(report.failed for report in runtestprotocol(item, log=False, nextitem=following)):
                os._exit(min(FIRST + k, 255))
        os._exit(0)
    except BaseException:
        os._exit(2)


def put_in(mutant: Mutant, source: str) -> None:
    """Change the living code of this process."""
    path, tree = PACKAGE / mutant.file, mutated(source, mutant)
    module = importlib.import_module(_module(mutant.file))
    owner, _, method = mutant.function.partition(".")
    for cached in _cached(name for name in sys.modules if name.startswith("seerob")):
        cached.cache_clear()
    if mutant.function == "<module>":
        _rebind(module, tree, mutant)
    elif not method and inspect.isclass(getattr(module, owner)):
        _attribute(getattr(module, owner), tree, mutant)
    else:
        holder = getattr(module, owner) if method else module
        code = next(c for c in _codes(compile(tree, str(path), "exec")) if c.co_qualname == mutant.function)
        function = _plain(vars(holder)[method or owner])
        function.__code__ = code
        _defaults(function, ast.parse(source), tree, mutant)


def _interpret(files: Iterable[str]) -> None:
    """Have loops of these files run by Python, wherever they are imported, instead of what was compiled.

    Loops of other files that call them keep what was compiled of them.
    """
    for module in map(importlib.import_module, map(_module, files)):
        own = {
            id(loop): loop.py_func
            for loop in vars(module).values()
            if getattr(getattr(loop, "py_func", None), "__module__", None) == module.__name__
        }
        for other in list(sys.modules.values()):
            for name, held in list(vars(other).items()):
                if id(held) in own:
                    setattr(other, name, own[id(held)])


def _module(file: str) -> str:
    return ".".join(("seerob", *Path(file).with_suffix("").parts))


def _cached(modules: Iterable[str]) -> Iterator[Any]:
    """Functions that keep their answers; of modules that are imported by now."""
    for module in [sys.modules[name] for name in modules if name in sys.modules]:
        yield from (value for value in vars(module).values() if hasattr(value, "cache_clear"))


def _codes(code: types.CodeType) -> Iterator[types.CodeType]:
    yield code
    for part in code.co_consts:
        if isinstance(part, types.CodeType):
            yield from _codes(part)


def _plain(function: Any) -> Any:
    """The function below its decorators."""
    if isinstance(function, property):
        return _plain(function.fget)
    if isinstance(function, cached_property):
        return _plain(function.func)
    function = getattr(function, "__func__", function)
    return _plain(function.__wrapped__) if hasattr(function, "__wrapped__") else function


def _defaults(function: types.FunctionType, plain: ast.Module, tree: ast.Module, mutant: Mutant) -> None:
    """Those of the arguments, where one of them is what is changed: a function's code does not hold them."""
    old, new = (_arguments(each, mutant.function) for each in (plain, tree))
    if ast.dump(old) == ast.dump(new):
        return

    def value(default: ast.expr) -> Any:
        return eval(compile(ast.Expression(default), mutant.file, "eval"), function.__globals__)

    function.__defaults__ = tuple(map(value, new.defaults))
    function.__kwdefaults__ = {
        argument.arg: value(default)
        for argument, default in zip(new.kwonlyargs, new.kw_defaults, strict=True)
        if default is not None
    }


def _arguments(tree: ast.Module, name: str) -> ast.arguments:
    owner, _, method = name.partition(".")
    body = tree.body
    if method:
        body = next(s.body for s in body if isinstance(s, ast.ClassDef) and s.name == owner)
    return next(s.args for s in body if isinstance(s, ast.FunctionDef) and s.name == (method or owner))


def _rebind(module: types.ModuleType, tree: ast.Module, mutant: Mutant) -> None:
    """A constant, wherever it was imported to."""
    for statement in tree.body:
        for name, value in assigned(statement):
            if name != mutant.assigned or not value.lineno <= mutant.line <= (value.end_lineno or 0):
                continue
            new = eval(compile(ast.Expression(value), mutant.file, "eval"), vars(module))
            old = vars(module)[name]
            for other in list(sys.modules.values()):
                if vars(other).get(name) is old:
                    setattr(other, name, new)


def _attribute(cls: type, tree: ast.Module, mutant: Mutant) -> None:
    for statement in tree.body:
        for part in statement.body if isinstance(statement, ast.ClassDef) else ():
            if isinstance(part, ast.AnnAssign) and part.lineno == mutant.line and part.value is not None:
                value = eval(compile(ast.Expression(part.value), mutant.file, "eval"), {})
                setattr(cls, ast.unparse(part.target), value)
