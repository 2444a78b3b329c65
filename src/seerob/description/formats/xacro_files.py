"""Xacro in, without ROS: expands a file to URDF text.

Xacro evaluates Python expressions, so a file is expanded in the parsers' process
(`seerob.core.files.parser_process`), whose memory and time are bounded. There every file that is opened is
looked at: what lies outside the folders that the description may read is refused, wherever a link leads, and
so is a device, a pipe, a process and a connection. Names and attributes that begin with an underscore,
lambdas, huge powers, ``$(eval …)``, ``$(env …)``, ``$(optenv …)`` and ``$(cwd)`` are refused besides.
"""

from __future__ import annotations

import ast
import contextlib
import importlib
import os
import stat
import sys
import sysconfig
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

from seerob.core.errors import InputError, Problem, suggestion
from seerob.core.files.bounded import REMEDY
from seerob.core.files.parser_process import parsed
from seerob.description.formats.resolve import Resolver

MAX_EXPRESSION = 2000
"""Longest expression evaluated [characters]."""
MAX_BYTES = 64 * 2**20
"""Largest file that is read, and largest URDF that comes of it [byte]."""
MEMORY, SECONDS = 1 << 30, 30.0
"""What expanding a file may take [byte, s of computing]."""
FORBIDDEN = {"python", "format", "format_map", "gi_frame", "gi_code", "mro"}
"""Names an expression may not use: they lead out of plain values; xacro keeps ``type`` in ``python``."""

_NEVER = (
    "subprocess.",
    "os.system",
    "os.exec",
    "os.fork",
    "os.posix_spawn",
    "os.spawn",
    "socket.",
    "ctypes.",
)
"""Audit events of what no expression needs."""


class _Refused(Exception):
    """An expression, substitution or file that is not evaluated or read here."""


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
        resolver: Knows where ``$(find package)`` is, and outside of what nothing is read; is told that xacro
            ran and which arguments kept their defaults.
        arguments: Values of its ``xacro:arg``.

    Raises:
        InputError: An argument that the file does not declare or that has no value, an unknown package,
            include or symbol, a refused expression or file, or it takes too much memory or time.
    """
    from seerob.description.xml_values import parse_xml

    given = dict(arguments or {})
    text, files, defaults, asked = parsed(
        expand,
        path,
        resolver,
        given,
        file=resolver.file,
        remedy="mend its expressions, or expand it elsewhere and name the URDF",
        memory=MEMORY,
        seconds=SECONDS,
    )
    # What is included, too: it may have an argument behind a condition that does not hold.
    known = {
        *asked,
        *(name for content in files.values() for name in _declared(content, parse_xml, resolver)),
    }
    unknown = sorted(given.keys() - known)
    if unknown:
        what = "is no argument of this file"
        hints = {name: suggestion(name, sorted(known)) for name in unknown}
        raise InputError([Problem(resolver.file, f"arguments.{n}", what, hint) for n, hint in hints.items()])
    resolver.remarks.extend(
        f"xacro argument {name} = {defaults[name]} (default of the file)" for name in defaults
    )
    resolver.notes.append(
        f"xacro ran: it evaluated the expressions of {', '.join(sorted({Path(name).name for name in files}))}"
    )
    return text, files


def _declared(content: bytes, parse_xml: Any, resolver: Resolver) -> set[str]:
    """Arguments that a file declares, also behind a condition that does not hold."""
    # Yaml and the like are included too and declare nothing.
    if b"<" not in content[:1000]:
        return set()
    tags = parse_xml(content, resolver.file).iter()
    return {e.get("name", "") for e in tags if "xacro" in str(e.tag) and str(e.tag).endswith("}arg")}


# -- in the other process -----------------------------------------------------------------------


class _Watch:
    """Which files may be opened while a file is expanded, and which were."""

    def __init__(self, resolver: Resolver) -> None:
        folders = (resolver.folder, *resolver.within, *resolver.installed)
        self.within = [os.path.realpath(folder) for folder in folders]
        self.opened: dict[str, int] = {}
        """Path → bytes."""

    def ask(self, event: str, args: tuple[Any, ...]) -> None:
        """Raise `_Refused` where something is asked for that a file may not have."""
        if event.startswith(_NEVER):
            raise _Refused(f"{event} is not for a xacro file")
        if event in ("os.listdir", "os.scandir"):
            self._inside(os.fspath(args[0] or "."))
        elif event == "open" and not isinstance(args[0], int):
            self._open(os.fsdecode(args[0]), args[1])

    def _open(self, name: str, mode: str | None) -> None:
        if os.path.realpath(name).startswith(_LIBRARIES) and name.endswith((".py", ".pyc", ".so")):
            return  # a module of Python or of xacro
        self._inside(name)
        if mode is not None and set(mode) & set("wax+"):
            raise _Refused(f"{name!r} is not written")
        try:
            found = os.stat(name)
        except OSError:
            return  # opening it says so
        if not stat.S_ISREG(found.st_mode):
            raise _Refused(f"{name!r} is no file")
        self.opened[name] = found.st_size
        if sum(self.opened.values()) > MAX_BYTES:
            raise _Refused(f"more than {MAX_BYTES} bytes are read")

    def _inside(self, name: str) -> None:
        real = os.path.realpath(name)
        if not any(real == folder or real.startswith(os.path.join(folder, "")) for folder in self.within):
            where = "" if real == name else f" (it leads to {real})"
            raise _Refused(f"{name!r} is outside the folders of this description{where} and is not read")


_LIBRARIES = tuple(
    os.path.join(os.path.realpath(sysconfig.get_path(name)), "") for name in ("stdlib", "purelib", "platlib")
)
_watching: list[_Watch] = []
"""Of the file that is expanded, if any is."""


def _hook(event: str, args: tuple[object, ...]) -> None:
    for watch in _watching:
        watch.ask(event, args)


def expand(
    path: Path, resolver: Resolver, arguments: Mapping[str, str]
) -> tuple[bytes, dict[str, bytes], dict[str, str], list[str]]:
    """Expand a file in this process, which has to be that of the parsers: it is watched from then on.

    Returns:
        The URDF, what was read, arguments that kept their defaults, and all that are known.

    Raises:
        InputError: As `expanded`.
    """
    xacro = _xacro()
    values = _Arguments(arguments)
    watch = _Watch(resolver)
    with _guarded(xacro, resolver, watch):
        xacro.all_includes.clear()
        try:
            _watching.append(watch)
            document = xacro.process_file(str(path), mappings=values)
            text: bytes = document.toxml(encoding="utf-8")
            files = {name: Path(name).read_bytes() for name in list(watch.opened) if Path(name).is_file()}
        except Exception as error:  # xacro passes on whatever an expression raises
            cause = _cause(error)
            if isinstance(cause, MemoryError):
                raise cause from None
            raise InputError.at(resolver.file, _place(xacro, path), _what(error), _remedy(error)) from None
        finally:
            _watching.clear()
    if len(text) > MAX_BYTES:
        what = f"expands to {len(text)} bytes"
        raise InputError.at(resolver.file, "", what, f"at most {MAX_BYTES} are read")
    files[path.name] = files.pop(str(path))
    defaults = {name: str(values[name]) for name in sorted(values.keys() - arguments.keys())}
    return text, files, defaults, sorted(values.known)


@cache
def _xacro() -> ModuleType:
    """Xacro, with all that it imports late; whoever opens a file from then on is asked what for."""
    for late in ("yaml", "xml.dom.expatbuilder", "xacro.substitution_args"):
        importlib.import_module(late)
    sys.addaudithook(_hook)
    return importlib.import_module("xacro")


@contextlib.contextmanager
def _guarded(xacro: ModuleType, resolver: Resolver, watch: _Watch) -> Iterator[None]:
    """Xacro with expressions checked before they are evaluated and packages found by the resolver."""
    substitution = importlib.import_module("xacro.substitution_args")
    evaluate, extension = xacro.safe_eval, xacro.eval_extension

    def checked(expression: str, *scopes: object) -> object:
        refuse_hostile(expression)
        return evaluate(expression, *scopes)

    def find(package: str) -> str:
        for root in resolver.roots(package):
            if root.is_dir():
                watch.within.append(os.path.realpath(root))
                return str(root)
        raise _Refused(f"no package {package!r} was found")

    def refused(*_: object, **__: object) -> object:
        raise _Refused("$(eval …), $(env …), $(optenv …) and $(cwd) are not evaluated")

    patches = [
        (xacro, "safe_eval", checked),
        (xacro, "eval_extension", lambda text: refused() if text == "$(cwd)" else extension(text)),
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


def _cause(error: BaseException) -> BaseException:
    # Xacro wraps what went wrong, sometimes twice.
    while isinstance(getattr(error, "exc", None), Exception) and not isinstance(error, _Refused):
        error = error.exc  # type: ignore[attr-defined]
    return error


def _what(error: Exception) -> str:
    cause = _cause(error)
    text = " ".join(str(cause if isinstance(cause, _Refused) else error).split())
    return f"cannot be expanded: {text[:500] or type(error).__name__}"


def _remedy(error: Exception) -> str:
    text = str(error)
    if "ubstitution argument" in text:
        return 'say the value of the argument: arguments = { name = "value" }'
    if "no package" in text:
        return 'say where it is: packages = { name = "folder of the package" }'
    if "outside the folders" in text:
        return REMEDY
    return "correct it, or expand the file elsewhere and name the URDF"


def _place(xacro: ModuleType, path: Path) -> str:
    stack = [str(file) for file in (xacro.filestack or []) if file]
    return stack[-1] if stack and stack[-1] != str(path) else ""
