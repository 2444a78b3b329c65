"""Finding a plug-in: the ``kind`` in the file is the name of a module, and that is all.

``kind = "separation"`` under ``[[safety]]`` is the one `Criterion` defined in
``seerob/criteria/safety/separation.py``. A dotted kind, ``acme.brake_rules``, is an entry point of an
installed package in the group ``seerob.safety``, or, where whoever starts seerob allows that, a module of
that name. None is taken from the workstation's folder or from where seerob is started: opening a folder runs
nothing of it.
"""

from __future__ import annotations

import importlib
import inspect
import os
import pkgutil
import sys
from collections.abc import Hashable, Sequence
from functools import cache
from importlib.machinery import PathFinder
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Protocol, TypeVar, cast, runtime_checkable

from seerob.core.errors import SeerobError, UnknownName

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

T = TypeVar("T")

HOMES = {
    "safety": "seerob.criteria.safety",
    "ergonomics": "seerob.criteria.ergonomics",
    "sources": "seerob.devices.sources",
    "sinks": "seerob.outputs.sinks",
    "emulators": "seerob.app.emulators",
}
"""Table of the workstation file → the package of its kinds."""


class PluginError(SeerobError):
    """A module that a kind names cannot be used; says what is wrong with it."""


def home(package: str) -> str:
    """The package of the modules that are the kinds of a table which ship."""
    return HOMES[package]


def kind_of(package: str, plugin: object) -> str:
    """The kind that a plug-in is of, as the workstation file says it: dotted where it is one's own."""
    return _kind_of(package, type(plugin).__module__, type(plugin).__qualname__)


@cache
def _kind_of(package: str, module: str, name: str) -> str:
    """Kind of a class: what a package offers it as, else the name of its module."""
    if module.startswith(f"{home(package)}."):
        return module.removeprefix(f"{home(package)}.")
    for kind, point in offered(package).items():
        found = getattr(sys.modules.get(point.module), point.attr, None) if point.attr else None
        if (point.module if found is None else found.__module__) != module:
            continue
        if found is None or found.__qualname__ == name:
            return kind
    return module


@runtime_checkable
class Complete(Protocol):
    """A base that knows what classes of one's own must define although there is a default."""

    @classmethod
    def undefined(cls) -> str:
        """What a class leaves out for which no default may stand, and what to define; empty when nothing."""


@cache
def kinds(package: str) -> tuple[str, ...]:
    """Kinds of a table that ship, sorted."""
    found = importlib.import_module(home(package))
    return tuple(sorted(m.name for m in pkgutil.iter_modules(found.__path__) if not m.name.startswith("_")))


def offered(package: str) -> dict[str, EntryPoint]:
    """Kinds that installed packages offer, by name; nothing of them is imported."""
    return dict(_offered(package, tuple((path, _changed(path)) for path in sys.path)))


def _changed(path: str) -> int:
    """When something was last installed in a folder, or taken away [ns]; -1 where there is none."""
    try:
        return os.stat(path or ".").st_mtime_ns
    except OSError:
        return -1


@cache
def _offered(package: str, _paths: tuple[tuple[str, int], ...]) -> dict[str, EntryPoint]:
    """`offered`, of folders that are as they were: every package that is installed has a file to be read."""
    from importlib.metadata import entry_points  # and with it email, which who listens needs not

    found = entry_points(group=f"seerob.{package}")
    return {point.name: point for point in sorted(found) if "." in point.name}


def load(
    package: str, kind: str, base: type[T], *, folder: Path | None = None, allow_plugins: bool = False
) -> type[T]:
    """The plug-in class of a kind.

    Args:
        package: ``safety``, ``ergonomics``, ``sources``, ``sinks`` or ``emulators``.
        kind: Module name in that package, the name of an entry point, or a dotted module name of your own.
        base: What the class must derive from.
        folder: Of the workstation file that says so, from which no module is taken.
        allow_plugins: Whether a dotted name that no installed package offers is imported.

    Raises:
        UnknownName: No such kind.
        PluginError: A module that is not there, that is not allowed, that fails, or that has not exactly one
            such class.
    """
    what = "emulator" if package == "emulators" else f"kind of [[{package}]]"
    if not all(part.isidentifier() for part in kind.split(".")):
        raise UnknownName(what, kind, kinds(package))
    if "." not in kind:
        if kind not in kinds(package):
            raise UnknownName(what, kind, (*kinds(package), *offered(package)))
        return cast(type[T], _shipped(package, kind, cast(Hashable, base)))
    point = offered(package).get(kind)
    if point is None and not allow_plugins:
        known = ", ".join(offered(package)) or "none"
        raise PluginError(
            f"no installed package offers the kind {kind!r} (entry points in 'seerob.{package}': {known}), "
            "and modules are not imported by their names: install its package, or, if you trust it, "
            "--allow-plugins (in Python allow_plugins=True)"
        )
    name = kind if point is None else point.module
    spec = PathFinder.find_spec(name.split(".", maxsplit=1)[0])
    places = [] if spec is None else [*(spec.submodule_search_locations or ()), spec.origin or ""]
    if point is not None and point.dist is not None:
        places.append(str(point.dist.locate_file("entry_points")))
    _refuse_beside(folder, kind, places)
    module = _imported(package, kind, name)
    found = getattr(module, point.attr, None) if point is not None and point.attr else _only(module, base)
    if not (isinstance(found, type) and issubclass(found, base)):
        raise PluginError(f"the entry point of kind {kind!r} must be a {base.__name__}, it is {found!r}")
    left = [name for name in dir(found) if getattr(getattr(found, name), "__isabstractmethod__", False)]
    if left:
        described = next(c.__name__ for c in found.__mro__ if left[0] in vars(c))
        whose = f"{found.__name__} of {found.__module__}"
        raise PluginError(f"{whose} has no {', no '.join(left)}: define it as {described} describes it")
    if text := found.undefined() if issubclass(found, Complete) else "":
        raise PluginError(f"{found.__name__} of {found.__module__} {text}")
    return found


@cache
def _shipped(package: str, kind: str, base: type) -> type:
    """The plug-in class of a kind that ships, whose module is the same in the whole process."""
    return _only(_imported(package, kind, f"{home(package)}.{kind}"), base)


def _imported(package: str, kind: str, name: str) -> ModuleType:
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name is not None and not (name + ".").startswith(error.name + "."):
            raise PluginError(f"kind {kind!r} needs the package {error.name!r}: install it") from error
        raise PluginError(
            f"no module {name!r} for this kind; install it or put its folder on PYTHONPATH, "
            f"or take one of: {', '.join(kinds(package)) or 'none'}"
        ) from error
    except (Exception, SystemExit) as error:  # a script, too, ends with what it is called by
        what = f"{type(error).__name__}: {error}"
        raise PluginError(f"the module of kind {kind!r} fails when it is imported: {what}") from error


def _only(module: ModuleType, base: type[T]) -> type[T]:
    name = module.__name__
    classes = [
        c
        for _, c in inspect.getmembers(module, inspect.isclass)
        if issubclass(c, base) and c is not base and c.__module__ == name and not c.__name__.startswith("_")
    ]
    if len(classes) != 1:
        found = ", ".join(c.__name__ for c in classes) or "none"
        raise PluginError(f"module {name!r} must define one {base.__name__}, it defines: {found}")
    return classes[0]


def _refuse_beside(folder: Path | None, kind: str, places: Sequence[str]) -> None:
    """Refuse a kind that would be taken from the workstation's folder or from the present one.

    What is installed for the interpreter that runs is not meant, wherever that lies.

    Raises:
        PluginError: It would.
    """
    installed, present = Path(sys.prefix).resolve(), Path.cwd()
    for place in (Path(place).resolve() for place in places if place):
        where = place.parent if place.suffix != ".py" or place.stem != "__init__" else place.parent.parent
        if place.is_relative_to(installed):
            continue
        if folder is not None and place.is_relative_to(folder.resolve()):
            what = "the workstation's folder"
        elif where == present and str(present) not in os.environ.get("PYTHONPATH", "").split(os.pathsep):
            what = "the folder that seerob is started in"
        else:
            continue
        raise PluginError(
            f"the module of kind {kind!r} lies in {what}, and opening a folder runs nothing of it; "
            "install its package, or keep it in a folder of its own that PYTHONPATH names in full"
        )
