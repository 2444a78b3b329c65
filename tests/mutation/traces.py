"""What each test runs of the files that are changed, seen while nothing is changed, and kept in a file.

A trace that was kept holds as long as the test's file and all files that it ran are as they were. What a
trace does not know only lets mutants survive: each that is killed was seen to fail a test.
"""

from __future__ import annotations

import ast
import hashlib
import json
import sys
import threading
import time
import types
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

OFTEN = 50
"""Traces are written each time so many more are known."""


class Trace(NamedTuple):
    """Of one test."""

    seconds: float
    """How long it takes while it is followed."""
    called: int
    """How many functions it calls, anywhere; few where it asks one."""
    lines: dict[str, list[int]]
    """That it runs, by file."""
    functions: dict[str, list[str]]
    """Qualified names of those it calls, by file."""
    names: list[str]
    """Names bound at the top of a file or class of which its functions speak."""


class Traces:
    """Of all tests.

    Args:
        sources: Text of the files whose lines are followed, by their place in the package.
        package: Where the package is.
        kept: File in which traces are kept from run to run; None keeps none.
        interpreted: Files whose loops Python runs instead of what was compiled: traces differ with them.
    """

    def __init__(
        self, sources: Mapping[str, str], package: Path, kept: Path | None, interpreted: list[str]
    ) -> None:
        self._files = {str(package / file): file for file in sources}
        self._bound = {name for source in sources.values() for name in _bound(source)}
        self._digests = {file: _digest(source) for file, source in sources.items()}
        self._digests[""] = " ".join(sorted(interpreted))
        self._kept, self._new = kept, 0
        self._known: dict[str, list[Any]] = {}
        if kept is not None and kept.exists():
            self._known = json.loads(kept.read_text("utf-8"))

    def of(self, test: str, path: Path, run: Callable[[], bool]) -> Trace | None:
        """Trace of a test, which is run where none is kept; None of one that fails.

        Args:
            test: Its name.
            path: File that it is in.
            run: Runs it; whether it passes.
        """
        digest = _digest(path.read_text("utf-8"))
        if known := self._known.get(test):
            (written, files), trace = known[0], Trace(*known[1])
            if written == digest and all(self._digests.get(file) == kept for file, kept in files.items()):
                return trace
        found = self._followed(run)
        if found is not None and self._kept is not None:
            files = {file: self._digests[file] for file in ("", *found.lines)}
            self._known[test] = [[digest, files], list(found)]
            self._new += 1
            if self._new % OFTEN == 0:
                self.write()
        return found

    def write(self) -> None:
        """Keep what is known by now."""
        if self._kept is not None and self._new:
            self._kept.write_text(json.dumps(self._known), "utf-8")

    def _followed(self, run: Callable[[], bool]) -> Trace | None:
        seen: set[types.CodeType] = set()
        lines: set[tuple[types.CodeType, int]] = set()

        def follow(frame: types.FrameType, event: str, _: object) -> Any:
            lines.add((frame.f_code, frame.f_lineno))
            return follow

        # Lines are followed in what is changed; of all else a tracer is told calls of Python's functions.
        def note(frame: types.FrameType, event: str, _: object) -> Any:
            seen.add(frame.f_code)
            return follow if frame.f_code.co_filename in self._files else None

        threading.settrace(note)
        sys.settrace(note)
        start = time.perf_counter()
        try:
            passed = run()
        finally:
            sys.settrace(None)
            threading.settrace(None)
        seconds = time.perf_counter() - start
        if not passed:
            return None
        # A thread of the test may live on and add to them.
        codes, run_lines = seen.copy(), lines.copy()
        trace = Trace(seconds, len(codes), {}, {}, [])
        for code in codes:
            if file := self._files.get(code.co_filename):
                trace.functions.setdefault(file, []).append(code.co_qualname.split(".<")[0])
        for code, line in run_lines:
            trace.lines.setdefault(self._files[code.co_filename], []).append(line)
        trace.names.extend(sorted(self._bound.intersection(name for code in codes for name in code.co_names)))
        return trace


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def _bound(source: str) -> set[str]:
    """Names that a file binds at its top and in its classes."""
    tree = ast.parse(source)
    parts = [*tree.body, *(part for c in tree.body if isinstance(c, ast.ClassDef) for part in c.body)]
    targets = [
        target
        for part in parts
        if isinstance(part, (ast.Assign, ast.AnnAssign))
        for target in (part.targets if isinstance(part, ast.Assign) else [part.target])
    ]
    return {node.id for target in targets for node in ast.walk(target) if isinstance(node, ast.Name)}
