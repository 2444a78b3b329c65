"""Finding a plug-in: the ``kind`` in the file is the name of a module, and that is all.

``kind = "separation"`` under ``[[safety]]`` is the one `Criterion` defined in
``seerob/safety/separation.py``; a dotted kind, ``acme.brake_rules``, is a module of your own.
"""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from typing import TypeVar

from seerob.errors import UnknownName

T = TypeVar("T")


def kinds(package: str) -> tuple[str, ...]:
    """Kinds that ship in ``seerob.<package>``, sorted."""
    found = importlib.import_module(f"seerob.{package}")
    return tuple(sorted(m.name for m in pkgutil.iter_modules(found.__path__) if not m.name.startswith("_")))


def load(package: str, kind: str, base: type[T]) -> type[T]:
    """The plug-in class of a kind.

    Args:
        package: ``safety``, ``ergonomics``, ``sources`` or ``sinks``.
        kind: Module name in that package, or a dotted module name of your own.
        base: What the class must derive from.

    Raises:
        UnknownName: No such module, or not exactly one class of that base in it.
    """
    if "." in kind:
        name = kind
    elif kind in kinds(package):
        name = f"seerob.{package}.{kind}"
    else:
        raise UnknownName(f"kind of [[{package}]]", kind, kinds(package))
    try:
        module = importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name is not None and not name.startswith(error.name):
            raise UnknownName(f"package, needed by kind {kind!r},", error.name, ()) from error
        raise UnknownName(f"module for kind of [[{package}]]", kind, kinds(package)) from error
    classes = [
        c
        for _, c in inspect.getmembers(module, inspect.isclass)
        if issubclass(c, base) and c is not base and c.__module__ == name and not c.__name__.startswith("_")
    ]
    if len(classes) != 1:
        raise UnknownName(f"single {base.__name__} in module", name, [c.__name__ for c in classes])
    return classes[0]
