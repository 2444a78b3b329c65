"""One change at a time to a source file: comparisons, signs, limits, units and verdicts.

A `Mutant` says which node of the syntax tree is replaced by what; `mutated` makes the changed tree. Each of
these is changed:

- each comparison, also within a chain: turned round, and with or without the edge;
- each sign: ``+`` and ``-``, ``*`` and ``/``, ``+=``, a minus, an ``abs``, ``not``, ``and`` and ``or``;
- each number: a tenth and a thousandfold more (one more of whole ones), and each ``True`` and ``False``,
  defaults of arguments among them;
- each name of a unit of the SI, to a thousand of it, in functions as in what a module or class binds;
- each verdict, and each name with an opposite, such as ``min``.

No verdict hangs on what only draws or describes, and that is left alone by name: markers and what they are
made with (classes of markers are named so), bases and inputs, messages, how much of the work is done
(`DRAWN`, `SPOKEN`), what is raised or asserted, text with fields in it.
So are indices and shapes of arrays, where a wrong one is another array and no other limit. Options, with
their bounds and defaults, are fixed when their class is made and cannot be changed in a living process: the
tables of docs/ say them a second time, and ``tests/test_docs.py`` fails where the two differ.
"""

from __future__ import annotations

import ast
import copy
from collections.abc import Iterator
from typing import NamedTuple

FLIPPED = {
    ast.Lt: (ast.GtE, ast.LtE),
    ast.LtE: (ast.Gt, ast.Lt),
    ast.Gt: (ast.LtE, ast.GtE),
    ast.GtE: (ast.Lt, ast.Gt),
    ast.Eq: (ast.NotEq,),
    ast.NotEq: (ast.Eq,),
    ast.Is: (ast.IsNot,),
    ast.IsNot: (ast.Is,),
    ast.In: (ast.NotIn,),
    ast.NotIn: (ast.In,),
}
TURNED = {ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.Pow: ast.Mult}
OPPOSITE = {
    one: other
    for pair in (
        ("min", "max"),
        ("fmin", "fmax"),
        ("minimum", "maximum"),
        ("argmin", "argmax"),
        ("any", "all"),
        ("floor", "ceil"),
        ("WITHIN", "EXCEEDED"),
        ("transient", "static"),
    )
    for one, other in (pair, pair[::-1])
} | {"UNDECIDED": "WITHIN"}
"""Names of functions, methods and members that say the opposite."""
UNIT = 1e3
"""A figure in millimetres, grams, milliseconds or kilonewtons where another was meant."""
SLIGHT = 1.1
"""A figure that is wrong by a tenth."""
ROUNDING = 1e-6
"""Figures up to this absorb rounding: no limit."""

UNITS = frozenset(("m", "s", "kg", "N", "J", "Pa", "m/s", "rad", "rad/s", "N/m", "N·m", "m/rad", "%"))

DRAWN = ("Arrow", "Ellipsoid", "Highlight", "Hull", "Label", "Polyline", "markers.Rays", "Segment", "Sphere",
         "Basis", "Input", "provenance.given", "InputError", "InputError.at", "Undecided", "ValueError",
         "UnknownName", "Meta", "np.errstate", "say", "progress", "self._progress")  # fmt: skip
"""Calls whose arguments no verdict depends on."""
SPOKEN = ("basis", "subjects", "inputs", "_markers", "_fan", "_shells", "_line", "_vector", "_rounded",
          "_Way.hull", "_Curtain.shown", "_Scan._hidden", "Presence._worst_sight", "_limits_given",
          "_places")  # fmt: skip
"""Functions whose result no verdict depends on, by their name or, where others are called so too, in full."""


class Mutant(NamedTuple):
    """One change."""

    file: str
    """Relative to the package."""
    function: str
    """Qualified name of the outermost function, or ``<module>``, or a class whose attribute it is."""
    line: int
    node: int
    """Number of the node in the order of `ast.walk`."""
    choice: int
    before: str
    after: str
    again: int
    """How often the same change was met before in the same function."""
    assigned: str = ""
    """Constant or attribute of a class whose value it is."""

    @property
    def key(self) -> str:
        """Names it as long as the code around it stays: no line number."""
        times = f" #{self.again + 1}" if self.again else ""
        return f"{self.file} {self.function}: {self.before} → {self.after}{times}"


def _choices(node: ast.AST) -> Iterator[ast.AST]:
    """Whatever a node could be mistaken for."""
    new = copy.deepcopy(node)
    if isinstance(node, ast.Compare):
        for k, old in enumerate(node.ops):
            for kind in FLIPPED[type(old)]:
                assert isinstance(new, ast.Compare)
                new.ops = [*node.ops[:k], kind(), *node.ops[k + 1 :]]
                yield copy.deepcopy(new)
    elif isinstance(node, (ast.BinOp, ast.AugAssign)) and type(node.op) in TURNED:
        assert isinstance(new, (ast.BinOp, ast.AugAssign))
        new.op = TURNED[type(node.op)]()
        yield new
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.USub, ast.Not)):
        yield copy.deepcopy(node.operand)
    elif isinstance(node, ast.Call) and _called(node) in ("abs", "np.abs", "np.fabs", "math.fabs"):
        yield copy.deepcopy(node.args[0])
    elif isinstance(node, ast.BoolOp):
        assert isinstance(new, ast.BoolOp)
        new.op = ast.And() if isinstance(node.op, ast.Or) else ast.Or()
        yield new
    elif isinstance(node, ast.Constant):
        value = node.value
        if isinstance(value, bool):
            yield ast.Constant(not value)
        elif isinstance(value, float) and ROUNDING < abs(value) < float("inf"):
            yield ast.Constant(value * SLIGHT)
            yield ast.Constant(value * UNIT)
        elif isinstance(value, (int, float)) and not 0 < abs(value) <= ROUNDING:
            yield ast.Constant(value + 1)
        elif value in UNITS:
            yield ast.Constant(f"k{value}")
    elif isinstance(node, ast.Name) and node.id in OPPOSITE and isinstance(node.ctx, ast.Load):
        yield ast.Name(OPPOSITE[node.id], ast.Load())
    elif isinstance(node, ast.Attribute) and node.attr in OPPOSITE and isinstance(node.ctx, ast.Load):
        assert isinstance(new, ast.Attribute)
        new.attr = OPPOSITE[node.attr]
        yield new


def _left_alone(node: ast.AST, function: str) -> bool:
    if function.partition(".")[0].endswith("Markers"):
        return True
    if isinstance(node, ast.Call):
        return _called(node) in DRAWN
    if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
        return node.name in SPOKEN or function in SPOKEN
    return isinstance(node, (ast.JoinedStr, ast.Import, ast.ImportFrom, ast.Assert, ast.Raise))


def _called(node: ast.Call) -> str:
    """What is called, as it is written."""
    return ast.unparse(node.func)


def _nodes(tree: ast.Module) -> Iterator[tuple[ast.AST, str, str]]:
    """Nodes that may be changed, the outermost function they are in, and the name that they are bound to."""

    def inside(node: ast.AST, function: str, depth: int) -> Iterator[tuple[ast.AST, str]]:
        if _left_alone(node, function):
            return
        if depth:
            yield node, function
        for name, value in ast.iter_fields(node):
            if name in ("annotation", "returns", "decorator_list"):
                continue
            # Which element of what: a wrong one is no wrong limit. A strict zip only guards its author.
            if name == "slice" and isinstance(value, (ast.Constant, ast.Slice, ast.Tuple, ast.UnaryOp)):
                continue
            if isinstance(node, ast.keyword) and node.arg == "strict":
                continue
            # Of `seerob.core.domains`: the unit in its message.
            if name == "keywords" and isinstance(node, ast.Call) and _called(node) in ("number", "whole"):
                continue
            # Of a new shape: whatever is left.
            if name == "args" and isinstance(node, ast.Call) and _called(node).endswith(".reshape"):
                continue
            for child in value if isinstance(value, list) else [value]:
                if isinstance(child, ast.AST):
                    yield from inside(child, function, depth + 1)

    def named(node: ast.AST, function: str, depth: int, name: str = "") -> Iterator[tuple[ast.AST, str, str]]:
        yield from ((inner, where, name) for inner, where in inside(node, function, depth))

    for statement in tree.body:
        if isinstance(statement, ast.FunctionDef):
            yield from named(statement, statement.name, 0)
        elif isinstance(statement, ast.ClassDef):
            for part in statement.body:
                if isinstance(part, ast.FunctionDef):
                    yield from named(part, f"{statement.name}.{part.name}", 0)
                elif (
                    isinstance(part, ast.AnnAssign)
                    and "ClassVar" in ast.unparse(part.annotation)
                    and part.value
                ):
                    yield part.value, statement.name, ast.unparse(part.target)
        else:
            for name, value in assigned(statement):
                if "DRAWN" not in name:
                    yield from named(value, "<module>", 1, name)


def assigned(statement: ast.stmt) -> Iterator[tuple[str, ast.expr]]:
    """Names that a statement binds, each with what it is bound to: ``A, B = 1.0, 0.5`` binds two."""
    if not isinstance(statement, (ast.Assign, ast.AnnAssign)) or statement.value is None:
        return
    target = statement.targets[0] if isinstance(statement, ast.Assign) else statement.target
    pairs = [(target, statement.value)]
    if isinstance(target, ast.Tuple) and isinstance(statement.value, ast.Tuple):
        pairs = list(zip(target.elts, statement.value.elts, strict=True))
    yield from ((name.id, value) for name, value in pairs if isinstance(name, ast.Name))


def mutants(source: str, file: str) -> list[Mutant]:
    """Every change of a file, in a stable order."""
    tree = ast.parse(source)
    numbers = {id(node): k for k, node in enumerate(ast.walk(tree))}
    found: list[Mutant] = []
    met: dict[tuple[str, str, str], int] = {}
    for node, function, assigned in _nodes(tree):
        for choice, new in enumerate(_choices(node)):
            before, after = _text(node), _text(ast.fix_missing_locations(new))
            again = met.get((function, before, after), -1) + 1
            met[function, before, after] = again
            line = getattr(node, "lineno", 0)
            number = numbers[id(node)]
            found.append(Mutant(file, function, line, number, choice, before, after, again, assigned))
    return found


def mutated(source: str, mutant: Mutant) -> ast.Module:
    """The tree of a file with one change."""
    tree = ast.parse(source)
    old = next(node for k, node in enumerate(ast.walk(tree)) if k == mutant.node)
    new = list(_choices(old))[mutant.choice]

    class Swap(ast.NodeTransformer):
        def visit(self, node: ast.AST) -> ast.AST:
            return ast.copy_location(new, old) if node is old else self.generic_visit(node)

    return ast.fix_missing_locations(Swap().visit(tree))


def _text(node: ast.AST) -> str:
    text = " ".join(ast.unparse(node).split())
    return text if len(text) <= 120 else text[:117] + "..."
