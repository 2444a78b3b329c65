"""The files a MJCF model names, checked before MuJoCo opens any of them."""

from __future__ import annotations

from pathlib import Path
from xml.etree.ElementTree import Element

from seerob.core.errors import InputError, Problem
from seerob.description.mesh import MAX_BYTES as MAX_MESH_BYTES
from seerob.description.xml_values import MAX_BYTES, parse_xml

DIRECTORIES = {"mesh": "meshdir", "texture": "texturedir", "skin": "meshdir", "hfield": "meshdir"}
"""Element → attribute of ``<compiler>`` that says where its files are; ``assetdir`` says it for all."""
FILE_ATTRIBUTES = ("file", "fileright", "fileleft", "fileup", "filedown", "filefront", "fileback")


def checked_files(path: Path) -> dict[str, bytes]:
    """The model and every file it names, by path relative to its folder.

    Raises:
        InputError: A file is missing, too large, or outside the folder of the model; all of them at once.
    """
    problems: list[Problem] = []
    folder = path.parent.resolve()
    files: dict[str, bytes] = {}
    elements: list[Element] = []
    waiting = [path.resolve()]
    while waiting:
        current = waiting.pop()
        name = current.relative_to(folder).as_posix()
        if name in files:
            continue
        if current.stat().st_size > MAX_BYTES:
            raise InputError.at(
                path, name, f"has {current.stat().st_size} bytes", f"at most {MAX_BYTES} are read"
            )
        files[name] = current.read_bytes()
        root = parse_xml(files[name], str(current))
        elements += root.iter()
        for include in root.iter("include"):
            # Relative to the main file, or to the file that includes.
            near = [folder / include.get("file", ""), current.parent / include.get("file", "")]
            found = _inside(path, folder, include, near, problems)
            waiting += [found] if found else []
    compilers = [e for e in elements if e.tag == "compiler"]
    for element in elements:
        for attribute in FILE_ATTRIBUTES:
            if element.tag == "include" or element.get(attribute) is None:
                continue
            roots = _roots(folder, compilers, str(element.tag))
            near = [root / element.attrib[attribute] for root in roots]
            found = _inside(path, folder, element, near, problems)
            if found and found.stat().st_size > MAX_MESH_BYTES:
                size = found.stat().st_size
                problems.append(
                    Problem(str(path), found.name, f"has {size} bytes", f"at most {MAX_MESH_BYTES}")
                )
            elif found:
                files[found.relative_to(folder).as_posix()] = found.read_bytes()
    if problems:
        raise InputError(problems)
    return files


def _roots(folder: Path, compilers: list[Element], tag: str) -> list[Path]:
    said = [c.get(name) for c in compilers for name in (DIRECTORIES.get(tag, ""), "assetdir") if name]
    named = [folder / directory for directory in said if directory]
    return [*named, folder]


def _inside(
    path: Path, folder: Path, element: Element, near: list[Path], problems: list[Problem]
) -> Path | None:
    """The first candidate that exists; a problem when it lies outside the folder or there is none."""
    key = f"<{element.tag} {element.get('name', '')}".strip() + ">"
    for candidate in near:
        resolved = candidate.resolve()
        if resolved.is_file():
            if resolved.is_relative_to(folder):
                return resolved
            problems.append(
                Problem(
                    str(path), key, f"{candidate} is outside the model's folder", "keep its files together"
                )
            )
            return None
    searched = ", ".join(dict.fromkeys(str(c) for c in near))
    problems.append(Problem(str(path), key, "no such file", f"searched {searched}"))
    return None
