"""Xacro in, without ROS: expands a file to URDF text.

Xacro evaluates Python expressions: open only xacro files that you would also run. What can be kept out
is: names and attributes that begin with an underscore, lambdas, huge powers, ``$(eval …)``, and the
environment of this process. A URDF that was expanded elsewhere needs none of this.
"""

from __future__ import annotations

import ast
import contextlib
import importlib
import io
import threading
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

from seerob.core.errors import InputError, Problem, suggestion
from seerob.description.formats.resolve import Resolver
from seerob.description.xml_values import MAX_BYTES, parse_xml

MAX_EXPRESSION = 2000
"""Longest expression evaluated [characters]."""
FORBIDDEN = {"python", "format", "format_map", "gi_frame", "gi_code", "mro"}
"""Names an expression may not use: they lead out of plain values; xacro keeps ``type`` in ``python``."""

_ONE_AT_A_TIME = threading.Lock()


class _Refused(Exception):
    """An expression or substitution that is not evaluated here."""


class _Arguments(dict[str, str]):
    """Values of arguments; xacro adds the defaults of those that were not given."""

    def __init__(self, given: Mapping[str, str]) -> None:
        super().__init__(given)
        self.known: set[str] = set()
        """Every name that the file declared or asked for."""

    def __contains__(self, name: object) -> bool:
        self.known.add(str(name))
        return super().__contains__(name)

    def __getitem__(self, name: str) -> str:
        self.known.add(name)
        return super().__getitem__(name)


def expanded(
    path: Path, resolver: Resolver, arguments: Mapping[str, str] | None = None
) -> tuple[bytes, dict[str, bytes]]:
    """The URDF that a xacro file expands to, and every file that was read for it.

    Args:
        path: The file.
        resolver: Knows where ``$(find package)`` is; is told which arguments kept their defaults.
        arguments: Values of its ``xacro:arg``.

    Raises:
        InputError: An argument that the file does not declare or that has no value, an unknown package,
            include or symbol, or a refused expression.
    """
    parse_xml(path.read_bytes(), resolver.file)
    xacro = importlib.import_module("xacro")
    values = _Arguments(arguments or {})
    said = io.StringIO()
    with _ONE_AT_A_TIME, _guarded(xacro, resolver), contextlib.redirect_stderr(said):
        xacro.all_includes.clear()
        try:
            document = xacro.process_file(str(path), mappings=values)
        except Exception as error:  # xacro passes on whatever an expression raises
            raise InputError.at(resolver.file, _place(xacro, path), _what(error), _remedy(error)) from None
        included = [Path(name) for name in xacro.all_includes]
    text: bytes = document.toxml(encoding="utf-8")
    files = {path.name: path.read_bytes()}
    for file in included:
        with contextlib.suppress(OSError):
            files[str(file)] = file.read_bytes()
    known = values.known.union(*(_declared(content, resolver.file) for content in files.values()))
    _refuse_unknown(arguments or {}, known, resolver.file)
    for name in sorted(values.keys() - (arguments or {}).keys()):
        resolver.remarks.append(f"xacro argument {name} = {values[name]} (default of the file)")
    return text, files


def _declared(content: bytes, file: str) -> set[str]:
    """Arguments that a file declares, also behind a condition that does not hold."""
    # Yaml and the like are included too and declare nothing.
    if len(content) > MAX_BYTES or b"<" not in content[:1000]:
        return set()
    tags = parse_xml(content, file).iter()
    return {e.get("name", "") for e in tags if "xacro" in str(e.tag) and str(e.tag).endswith("}arg")}


def _refuse_unknown(given: Mapping[str, str], known: set[str], file: str) -> None:
    unknown = sorted(given.keys() - known)
    if unknown:
        what = "is no argument of this file"
        raise InputError(
            [Problem(file, f"arguments.{n}", what, suggestion(n, sorted(known))) for n in unknown]
        )


@contextlib.contextmanager
def _guarded(xacro: ModuleType, resolver: Resolver) -> Iterator[None]:
    """Xacro with expressions checked before they are evaluated and packages found by the resolver."""
    substitution = importlib.import_module("xacro.substitution_args")
    evaluate = xacro.safe_eval

    def checked(expression: str, *scopes: Any) -> Any:
        refuse_hostile(expression)
        return evaluate(expression, *scopes)

    def find(package: str) -> str:
        for root in resolver.roots(package):
            if root.is_dir():
                return str(root)
        raise _Refused(f"no package {package!r} was found")

    def refused(*_: Any, **__: Any) -> Any:
        raise _Refused("$(eval …), $(env …) and $(optenv …) are not evaluated")

    patches = [
        (xacro, "safe_eval", checked),
        (substitution, "_eval_find", find),
        (substitution, "_eval_env", refused),
        (substitution, "_eval_optenv", refused),
        (substitution, "_eval", refused),
    ]
    before = [(module, name, getattr(module, name)) for module, name, _ in patches]
    for module, name, value in patches:
        setattr(module, name, value)
    try:
        yield
    finally:
        for module, name, value in before:
            setattr(module, name, value)


def refuse_hostile(expression: str) -> None:
    """Raises when a ``${…}`` expression could leave the world of numbers, texts, lists and tables."""
    if len(expression) > MAX_EXPRESSION:
        raise _Refused(f"an expression of {len(expression)} characters")
    for node in ast.walk(ast.parse(expression.strip(), mode="eval")):
        name = node.attr if isinstance(node, ast.Attribute) else node.id if isinstance(node, ast.Name) else ""
        if name.startswith("_") or name in FORBIDDEN:
            raise _Refused(f"{name!r} in {expression!r} is not evaluated")
        if isinstance(node, ast.Lambda):
            raise _Refused(f"a lambda in {expression!r} is not evaluated")
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow | ast.LShift):
            exponent = node.right.operand if isinstance(node.right, ast.UnaryOp) else node.right
            if not (isinstance(exponent, ast.Constant) and isinstance(exponent.value, int | float)) or (
                exponent.value > 16
            ):
                raise _Refused(f"a power in {expression!r} is not evaluated: exponents are numbers up to 16")


def _what(error: Exception) -> str:
    cause: BaseException = error
    # Xacro wraps what went wrong, sometimes twice.
    while isinstance(getattr(cause, "exc", None), Exception) and not isinstance(cause, _Refused):
        cause = cause.exc  # type: ignore[attr-defined]
    text = " ".join(str(cause if isinstance(cause, _Refused) else error).split())
    return f"cannot be expanded: {text[:500] or type(error).__name__}"


def _remedy(error: Exception) -> str:
    text = str(error)
    if "ubstitution argument" in text:
        return 'say the value of the argument: arguments = { name = "value" }'
    if "no package" in text:
        return 'say where it is: packages = { name = "folder of the package" }'
    return "correct it, or expand the file elsewhere and name the URDF"


def _place(xacro: ModuleType, path: Path) -> str:
    stack = [str(file) for file in (xacro.filestack or []) if file]
    return stack[-1] if stack and stack[-1] != str(path) else ""
