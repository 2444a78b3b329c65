"""Finds the files that a robot description names, says where it looked, and touches nothing else."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from importlib import metadata
from pathlib import Path
from urllib.parse import unquote

from seerob.core.errors import InputError, Problem, UnknownName
from seerob.core.files.bounded import REMEDY

MAX_URI = 4096
"""Longest file reference accepted [characters]."""
_PACKAGE = re.compile(r"[A-Za-z][A-Za-z0-9_.-]*")
"""Names of packages: of ROS and of Python, never of hidden folders."""
_ROS = (("ROS_PACKAGE_PATH", ""), ("AMENT_PREFIX_PATH", "share"))


def installed_packages() -> tuple[Path, ...]:
    """Folders that hold the ROS packages installed for whoever started this, as the environment says."""
    found = ((prefix, inner) for name, inner in _ROS for prefix in os.environ.get(name, "").split(os.pathsep))
    return tuple(Path(prefix) / inner for prefix, inner in found if prefix)


@dataclass(frozen=True)
class ResolvedFile:
    """A file that exists."""

    path: Path
    remark: str = ""
    """How it was found when not as written."""


@dataclass(frozen=True)
class Resolver:
    """Where the files of one description may be."""

    file: str
    """The description, as the user named it, for messages."""
    folder: Path
    """The folder it is in; relative references start there."""
    packages: Mapping[str, Path] = field(default_factory=dict)
    """Folder of each ROS package that the user named."""
    within: tuple[Path, ...] = ()
    """Folders of which files may be read, besides its own and what is installed, wherever links lead."""
    outside: bool = False
    """Whether files elsewhere may be read too."""
    installed: tuple[Path, ...] = field(default_factory=installed_packages)
    """Folders that hold installed ROS packages."""
    remarks: list[str] = field(default_factory=list)
    """What was taken as the files have it because the user did not say otherwise."""
    notes: list[str] = field(default_factory=list)
    """What was done to read it that whoever opens the file wants to know."""

    def find(self, uri: str) -> ResolvedFile | Problem:
        """The file behind ``package://``, ``model://``, ``file://`` or a path; a problem when there is none.

        A name that differs from the reference in upper and lower case only is accepted with a remark.
        """
        if len(uri) > MAX_URI or "\0" in uri:
            return Problem(self.file, uri[:80], "is not a file reference", f"at most {MAX_URI} characters")
        scheme, separator, rest = uri.partition("://")
        if not separator:
            scheme, rest = "", uri
        if scheme not in {"", "file", "package", "model"}:
            return Problem(
                self.file,
                uri,
                f"is behind {scheme}://, which is never fetched",
                "download it and name the copy",
            )
        searched: list[Path] = []
        for candidate in self._candidates(scheme, rest.replace("\\", "/")):
            if candidate in searched:
                continue
            searched.append(candidate)
            found = as_written_or_in_other_case(candidate)
            if found is not None:
                if not self.may_read(found):
                    what = f"is {found.resolve()}, outside the folders that this description may read"
                    return Problem(self.file, uri, what, REMEDY)
                remark = (
                    "" if found == candidate else f"{uri}: upper and lower case differ, used {found.name}"
                )
                return ResolvedFile(found, remark)
        package = rest.partition("/")[0]
        remedies = ["searched " + ", ".join(map(str, searched))] if searched else []
        if scheme in {"package", "model"}:
            if package not in self.packages:
                where = f'say where the package is: packages = {{ {package} = "folder of the package" }}'
                remedies.append(f"or {where}" if searched else where)
            elif not searched:
                remedies.append("what a package names stays in the package")
        return Problem(self.file, uri, "no such file", "; ".join(remedies))

    def may_read(self, path: Path) -> bool:
        """Whether a path leads into the folders of which files may be read."""
        real = path.resolve()
        folders = (self.folder, *self.within, *self.installed)
        return self.outside or any(real.is_relative_to(folder.resolve()) for folder in folders)

    def _candidates(self, scheme: str, rest: str) -> Iterator[Path]:
        if scheme in {"package", "model"}:
            package, _, inner = rest.partition("/")
            for root in self.roots(package):
                # What a package names stays in the package.
                if _inside(root, root / inner):
                    yield root / inner
        elif scheme == "file":
            path = Path(unquote(rest.removeprefix("localhost")))
            yield path if path.is_absolute() else self.folder / path
        else:
            yield self.folder / rest

    def roots(self, package: str) -> Iterator[Path]:
        """Folders that may be the ROS package of that name and may be read, the likeliest first."""
        if _PACKAGE.fullmatch(package):
            yield from filter(self.may_read, self._roots(package))

    def _roots(self, package: str) -> Iterator[Path]:
        if package in self.packages:
            yield self.packages[package]
            return
        folder = self.folder.absolute()
        for ancestor in (folder, *folder.parents):
            if ancestor.name == package:
                yield ancestor
        for ancestor in (folder, *folder.parents[:-1]):
            if (ancestor / package).is_dir():
                yield ancestor / package
        for folder in self.installed:
            yield folder / package


def _inside(root: Path, path: Path) -> bool:
    return Path(os.path.normpath(path)).is_relative_to(os.path.normpath(root))


def as_written_or_in_other_case(path: Path) -> Path | None:
    """The file itself, or the only one whose path differs in upper and lower case only; else None."""
    try:
        if path.is_file():
            return path
        existing = path.parent
        missing = [path.name]
        while not existing.is_dir():
            if existing == existing.parent:
                return None
            missing.append(existing.name)
            existing = existing.parent
        for name in reversed(missing):
            matches = [p for p in existing.iterdir() if p.name.casefold() == name.casefold()]
            exact = [p for p in matches if p.name == name] or matches
            if len(exact) != 1:
                return None
            existing = exact[0]
        return existing if existing.is_file() else None
    except OSError:
        return None


def of_distribution(reference: str) -> tuple[Path, Path]:
    """A file of an installed Python distribution, and the folder that is installed in.

    Args:
        reference: ``<distribution>/<path>``, where the path is any tail of the path of one of its
            files, starting at a folder: ``example-robot-data/robots/ur_description/urdf/ur10_robot.urdf``.

    Raises:
        UnknownName: No such distribution is installed.
        InputError: It has no such file, or several.
    """
    name, _, inner = reference.partition("/")
    try:
        distribution = metadata.distribution(name)
    except (metadata.PackageNotFoundError, ValueError):
        installed = (d.metadata["Name"] for d in metadata.distributions())
        raise UnknownName("installed Python distribution", name, sorted(filter(None, installed))) from None
    parts = tuple(p for p in inner.split("/") if p)
    files = distribution.files or []
    matches = [f for f in files if parts and f.parts[-len(parts) :] == parts and ".." not in f.parts]
    if not matches:
        endings = {".urdf", ".xacro", ".xml"}
        known = [str(f) for f in files if f.suffix in endings and parts and f.name.startswith(parts[-1][:3])]
        hint = f"it has {', '.join(sorted(known)[:6])}" if known else "look at the files it installs"
        raise InputError.at(f"package:{reference}", "", f"{name} has no file {inner!r}", hint)
    if len(matches) > 1:
        raise InputError.at(
            f"package:{reference}",
            "",
            f"{len(matches)} files of {name} end like this",
            "name more folders of " + ", ".join(map(str, matches[:4])),
        )
    return Path(str(matches[0].locate())), Path(str(distribution.locate_file("")))
