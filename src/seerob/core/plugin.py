"""Finding a plug-in: the ``kind`` in the file is the name of a module, and that is all.

``kind = "separation"`` under ``[[safety]]`` is the one `Criterion` defined in
``seerob/criteria/safety/separation.py``; a dotted kind, ``acme.brake_rules``, is a module of your own.
"""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from importlib.machinery import PathFinder
from pathlib import Path
from typing import TypeVar

from seerob.core.errors import SeerobError, UnknownName

T = TypeVar("T")

HOMES = {
    "safety": "seerob.criteria.safety",
    "ergonomics": "seerob.criteria.ergonomics",
    "sources": "seerob.devices.sources",
    "sinks": "seerob.outputs.sinks",
    "emulators": "seerob.app.emulators",
}
"""Table of the workstation file → the package of its kinds; ``emulators`` are of `seerob emulate`."""


class PluginError(SeerobError):
    """A module that a kind names cannot be used; says what is wrong with it."""


def home(package: str) -> str:
    """The package of the modules that are the kinds of a table which ship."""
    return HOMES[package]


def kind_of(package: str, plugin: object) -> str:
    """The kind that a plug-in is of, as the workstation file says it: dotted where it is one's own."""
    return type(plugin).__module__.removeprefix(f"{home(package)}.")


def kinds(package: str) -> tuple[str, ...]:
    """Kinds of a table that ship, sorted."""
    found = importlib.import_module(home(package))
    return tuple(sorted(m.name for m in pkgutil.iter_modules(found.__path__) if not m.name.startswith("_")))


def load(package: str, kind: str, base: type[T], *, folder: Path | None = None) -> type[T]:
    """The plug-in class of a kind.

    Args:
        package: ``safety``, ``ergonomics``, ``sources``, ``sinks`` or ``emulators``.
        kind: Module name in that package, or a dotted module name of your own.
        base: What the class must derive from.
        folder: Of the workstation file that says so, from which no module is taken.

    Raises:
        UnknownName: No such kind.
        PluginError: A module that is not there, that fails, or that has not exactly one such class.
    """
    what = "emulator" if package == "emulators" else f"kind of [[{package}]]"
    if not all(part.isidentifier() for part in kind.split(".")):
        raise UnknownName(what, kind, kinds(package))
    if "." in kind:
        name = kind
        if folder is not None:
            _refuse_beside(folder, kind)
    elif kind in kinds(package):
        name = f"{home(package)}.{kind}"
    else:
        raise UnknownName(what, kind, kinds(package))
    try:
        module = importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name is not None and not (name + ".").startswith(error.name + "."):
            raise PluginError(f"kind {kind!r} needs the package {error.name!r}: install it") from error
        raise PluginError(
            f"no module {name!r} for this kind; install it or put its folder on PYTHONPATH, "
            f"or take one of: {', '.join(kinds(package)) or 'none'}"
        ) from error
    except Exception as error:
        what = f"{type(error).__name__}: {error}"
        raise PluginError(f"the module of kind {kind!r} fails when it is imported: {what}") from error
    classes = [
        c
        for _, c in inspect.getmembers(module, inspect.isclass)
        if issubclass(c, base) and c is not base and c.__module__ == name and not c.__name__.startswith("_")
    ]
    if len(classes) != 1:
        found = ", ".join(c.__name__ for c in classes) or "none"
        raise PluginError(f"module {name!r} must define one {base.__name__}, it defines: {found}")
    return classes[0]


def _refuse_beside(folder: Path, kind: str) -> None:
    """Refuse a kind whose module would be taken from the workstation's folder; imports nothing.

    Raises:
        PluginError: It would.
    """
    spec = PathFinder.find_spec(kind.split(".", maxsplit=1)[0])
    places = [] if spec is None else [*(spec.submodule_search_locations or ()), spec.origin or ""]
    here = folder.resolve()
    for place in places:
        if place and Path(place).resolve().is_relative_to(here):
            raise PluginError(
                f"the module of kind {kind!r} lies in the workstation's folder, and opening a folder runs "
                "nothing of it; install its package, or keep it in a folder of its own on PYTHONPATH"
            )
