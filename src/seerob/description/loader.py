"""One loader for every robot: library, published description, file of an installed package, or path."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from seerob.core.errors import InputError, suggestion
from seerob.core.files.bounded import TooLarge, content, missing_file
from seerob.core.snapshot import Finding
from seerob.description.description import Description
from seerob.description.formats import mjcf, urdf
from seerob.description.formats.resolve import Resolver, as_written_or_in_other_case, of_distribution
from seerob.description.formats.xacro_files import expanded
from seerob.description.robots import library, published
from seerob.description.robots.maker_geometry import with_geometry_of
from seerob.description.xml_values import MAX_BYTES, parse_xml


def load_robot(
    model: str,
    *,
    folder: Path,
    packages: Mapping[str, str] | None = None,
    meshes: str | None = None,
    arguments: Mapping[str, str] | None = None,
    name: str = "robot",
    outside: bool = False,
    visuals: bool = True,
) -> Description:
    """A robot, read, repaired where it can be, and checked.

    Args:
        model: ``library:ur10``; ``description:ur5e_description``, one of the package robot_descriptions;
            ``package:<distribution>/<path in it>``, a file of an installed Python distribution; or a path
            to a URDF, xacro or MJCF file.
        folder: What relative paths are relative to: the folder of the workstation file.
        packages: Folder of each ROS package that ``package://`` names.
        meshes: A description (as ``model``) whose geometry replaces the library's envelope.
        arguments: Values of the arguments of a xacro file.
        name: Name of the robot; findings speak of ``name/link``.
        outside: Whether a description may name files outside ``folder``, its own folder and what is
            installed.
        visuals: Whether shapes that only the eye needs are read.

    Raises:
        InputError: The file is missing, not a robot, or wrong beyond repair; all mistakes at once.
        UnknownName: The library has no such robot.
    """
    if model.startswith("library:"):
        description = library.load(model.removeprefix("library:"), name=name)
    else:
        asked = _Asked(model, folder, packages or {}, arguments or {}, name, outside, visuals)
        read = _from_published if model.startswith("description:") else _from_file
        description = read(asked)
        # Numba is imported only where a file brings shapes of its own.
        from seerob.description.robots.maker_geometry import with_protrusions

        description = with_protrusions(description)
    if meshes is None:
        return description
    maker = load_robot(meshes, folder=folder, packages=packages, name=name, outside=outside, visuals=visuals)
    return with_geometry_of(description, maker)


_XML = re.compile(rb"(?:\xef\xbb\xbf)?\s*<")
"""How XML begins."""


class _Asked(NamedTuple):
    """Which robot of a file, and how it is read: arguments of `load_robot`."""

    model: str
    folder: Path
    packages: Mapping[str, str]
    arguments: Mapping[str, str]
    name: str
    outside: bool
    visuals: bool

    def resolver(self, path: Path, home: Path, known: Mapping[str, Path]) -> Resolver:
        """What finds the files that a description names.

        Args:
            path: The description.
            home: A folder of which it may name files, beside that of the workstation.
            known: Folders of ROS packages that nobody need name.
        """
        named = {package: self.folder / root for package, root in self.packages.items()}
        within, roots = (self.folder, home), {**known, **named}
        return Resolver(self.model, path.parent, roots, within=within, outside=self.outside)


def _from_file(asked: _Asked) -> Description:
    path, home = _path(asked.model, asked.folder)
    return _read(asked, path, asked.resolver(path, home, {}))


def _from_published(asked: _Asked) -> Description:
    model, name = asked.model, asked.name
    found = published.find(model.removeprefix("description:"))
    if asked.arguments and found.path.suffix != ".xacro":
        raise InputError.at(model, "arguments", "is not a xacro file and takes none", "leave them out")
    asked = asked._replace(arguments={**found.arguments, **asked.arguments})
    known = {found.package.name: found.package}
    read = _read(asked, found.path, asked.resolver(found.path, found.repository, known))
    source = f"{model}: {found.address} {found.commit[:12]}"
    said = f"licence {found.licence}" if found.licence else "whose licence is not known to the package"
    finding = Finding(level="note", subject=name, text=f"read from {source}, {said}")
    licence = {f"{found.name}/LICENSE": found.licence_text} if found.licence_text else {}
    files = {found.path.name if key == model else key: content for key, content in read.files.items()}
    return replace(read, source=source, findings=(finding, *read.findings), files={**files, **licence})


def _read(asked: _Asked, path: Path, resolver: Resolver) -> Description:
    model, name, visuals = asked.model, asked.name, asked.visuals
    if path.suffix.lower() == ".xacro":
        text, files = expanded(path, resolver, asked.arguments)
        robot = urdf.from_text(text, resolver=resolver, name=name, visuals=visuals)
        return replace(robot, files={**robot.files, **files})
    try:
        text = content(path, MAX_BYTES)
    except (OSError, TooLarge) as error:
        raise InputError.at(model, "", f"cannot be read: {error}", f"at most {MAX_BYTES} are read") from None
    if path.suffix.lower() not in {".urdf", ".xml"} and not _XML.match(text):
        # What a file is, is in it: some packages install URDF without an ending.
        readable = "URDF, MJCF and .xacro are read"
        raise InputError.at(model, "", f"{path.name!r} is not a robot description", readable)
    root = parse_xml(text, str(path)).tag
    if root == "robot":
        return urdf.from_text(text, resolver=resolver, name=name, visuals=visuals)
    if root == "mujoco":
        read = mjcf.read_mjcf(path, resolver=resolver, name=name)
        return read if visuals else _without_visuals(read)
    raise InputError.at(
        model, "", f"the root element is <{root}>", "<robot> (URDF) or <mujoco> (MJCF) is expected"
    )


def _without_visuals(description: Description) -> Description:
    """The description with the shapes alone that distances use."""
    if not any(link.solids and link.visual for link in description.links):
        return description
    links = tuple(replace(link, visual=()) if link.solids else link for link in description.links)
    finding = Finding(level="assumed", subject=description.name, text=urdf.IGNORED_VISUALS)
    return replace(description, links=links, findings=(*description.findings, finding))


def _path(model: str, folder: Path) -> tuple[Path, Path]:
    """A description, and the folder of which it may name files."""
    if model.startswith("package:") and not model.startswith("package://"):
        return of_distribution(model.removeprefix("package:"))
    path = folder / model
    try:
        if path.is_file():
            return path, path.parent
    except (OSError, ValueError) as error:
        raise InputError.at(model[:200], "", f"is no name of a file: {error.args[-1]}", "name one") from error
    found = as_written_or_in_other_case(path)
    if found is None:
        hint = missing_file(model, suggestion(model, [f"library:{known}" for known in library.names()]))
        raise InputError.at(model, "", "is a folder" if path.is_dir() else f"no such file {path}", hint)
    raise InputError.at(model, "", f"no such file {path}", f"upper and lower case differ from {found.name}")
