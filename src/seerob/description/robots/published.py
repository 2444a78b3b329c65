"""Published robot descriptions, found in the cache of the package ``robot_descriptions``.

A module of that package clones a repository when it is imported. Here it is imported in the parsers' process,
beside a stand-in for its module of git: one that looks whether the repository is in the cache, at the commit
that is asked for, and says so where it is not. ``seerob robots fetch NAME`` lets the package itself clone it.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module, util
from pathlib import Path
from types import ModuleType
from typing import Any

from seerob.core.errors import InputError, UnknownName
from seerob.core.extras import need
from seerob.core.files.bounded import content
from seerob.core.files.parser_process import parsed

PACKAGE = "robot_descriptions"
CACHE, COMMIT = "ROBOT_DESCRIPTIONS_CACHE", "ROBOT_DESCRIPTION_COMMIT"
"""Variables of the environment that the package goes by."""
_NAME = re.compile(r"[A-Za-z0-9_+]+_description")
_FORMATS = (("URDF_PATH", ""), ("XACRO_PATH", "XACRO_ARGS"), ("MJCF_PATH", ""))
MAX_LICENCE = 2**20
"""Longest licence that is kept [byte]."""


@dataclass(frozen=True)
class Listed:
    """What the package says of one description, without its files."""

    name: str
    robot: str
    maker: str | None
    kind: str
    """URDF or MJCF."""
    arm: bool
    licence: str | None
    cached: bool
    """Whether its repository is in the cache, at whatever commit."""


@dataclass(frozen=True)
class Published:
    """A description whose files are there."""

    name: str
    path: Path
    """URDF, xacro or MJCF."""
    repository: Path
    """Folder of which it may name files."""
    package: Path
    """Folder of its ROS package."""
    arguments: Mapping[str, str]
    """Of its xacro."""
    address: str
    commit: str
    licence: str
    """Its name, as the package has it, with the file; empty where it says none."""
    licence_text: bytes


def cache() -> Path:
    """Folder in which the package keeps repositories."""
    return Path(os.environ.get(CACHE) or "~/.cache/robot_descriptions").expanduser()


def listed() -> tuple[Listed, ...]:
    """Every description that the installed package knows, by name."""
    need(PACKAGE)
    descriptions = import_module(f"{PACKAGE}._descriptions").DESCRIPTIONS
    repositories = import_module(f"{PACKAGE}._repositories").REPOSITORIES
    found = []
    for name, each in sorted(descriptions.items()):
        kept = repositories.get(each.repository)
        found.append(
            Listed(
                name=name,
                robot=each.robot,
                maker=each.maker,
                kind="URDF" if each.has_urdf else "MJCF",
                arm="arm" in each.tags,
                licence=each.license_spdx,
                cached=kept is not None and (cache() / kept.cache_path / ".git").exists(),
            )
        )
    return tuple(found)


def find(name: str) -> Published:
    """A description in the cache.

    Args:
        name: As the package has it: ``ur5e_description``.

    Raises:
        MissingPackage: The package is not installed.
        UnknownName: It has no such description.
        InputError: Its repository is not in the cache, or at another commit.
    """
    wanted = f"description:{name}"
    known = {each.name for each in listed()}
    if not _NAME.fullmatch(name) or name not in known:
        raise UnknownName("published description", name, sorted(known))
    said = parsed(
        _paths,
        name,
        str(cache()),
        os.environ.get(COMMIT),
        file=wanted,
        remedy="name another version of robot_descriptions, or its URDF itself",
    )
    repository, commit = Path(said["repository"]), said["commit"]
    address, fetch = said["address"], f"fetch it: seerob robots fetch {name}"
    if not (repository / ".git").exists():
        raise InputError.at(wanted, "", f"{address} is not in the cache ({repository})", fetch)
    head = _git(repository, "rev-parse", "--verify", "HEAD")
    if head is None or head != _git(repository, "rev-parse", "--verify", f"{commit}^{{commit}}"):
        what = f"{repository} is at {(head or 'no commit')[:12]}, and {commit[:12]} is asked for"
        raise InputError.at(wanted, "", what, fetch)
    path = Path(said["path"])
    if not path.resolve().is_relative_to(repository.resolve()) or not path.is_file():
        what = f"{path} is not a file of {address} at {head[:12]}"
        raise InputError.at(wanted, "", what, "install a version of robot_descriptions that fits")
    text = repository / said["licence_file"] if said["licence_file"] else None
    licence = " ".join(part for part in (said["licence"], said["licence_file"]) if part)
    if text is None or not text.is_file() or not text.resolve().is_relative_to(repository.resolve()):
        text = None
    return Published(
        name=name,
        path=path,
        repository=repository,
        package=Path(said["package"]),
        arguments=said["arguments"],
        address=address,
        commit=head,
        licence=licence,
        licence_text=b"" if text is None else content(text, MAX_LICENCE),
    )


def fetch(name: str) -> Published:
    """Let the package clone what a description needs, as it does on import, and find it.

    Raises:
        UnknownName: It has no such description.
        InputError: Cloning failed, in git's words.
    """
    known = sorted(each.name for each in listed())
    if not _NAME.fullmatch(name) or name not in known:
        raise UnknownName("published description", name, known)
    load = f"import importlib; importlib.import_module('{PACKAGE}.' + '{name}')"
    command = [sys.executable, "-P", "-c", load]
    done = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603 - a known name
    if done.returncode:
        lines = [line.strip() for line in done.stderr.splitlines() if line.strip()]
        told = next((line for line in reversed(lines) if "fatal:" in line), lines[-1] if lines else "")
        raise InputError.at(f"description:{name}", "", f"not fetched: {told[:300]}", "is the network there?")
    return find(name)


def _git(repository: Path, *words: str) -> str | None:
    """What git says of a repository in one line; None where it fails. It runs no hook and no helper."""
    command = ["git", "-c", "core.fsmonitor=false", "-C", str(repository), *words]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)  # noqa: S603
    except OSError as error:
        raise InputError.at(str(repository), "", f"git cannot be started: {error}", "install git") from None
    return done.stdout.strip() if done.returncode == 0 else None


def _paths(name: str, cache_folder: str, commit: str | None) -> dict[str, Any]:
    """Where the module of a description says that its files are; in the parsers' process."""
    repositories = import_module(f"{PACKAGE}._repositories").REPOSITORIES
    asked: dict[str, str] = {}

    def clone_to_cache(description_name: str, commit: str | None = None) -> str:
        kept = repositories[description_name]
        # As the package has it: a folder of its own for a commit of one's own.
        path = kept.cache_path if commit is None else f"{kept.cache_path}-{commit}/{kept.cache_path}"
        folder = os.path.join(cache_folder, path)
        if not asked:
            asked.update(repository=folder, address=kept.url, commit=commit or kept.commit)
        return folder

    stand_in = ModuleType(f"{PACKAGE}._cache")
    stand_in.__dict__.update(clone_to_cache=clone_to_cache)
    before = {key: module for key, module in sys.modules.items() if key.startswith(f"{PACKAGE}.")}
    if commit is None:
        os.environ.pop(COMMIT, None)
    else:
        os.environ[COMMIT] = commit
    try:
        sys.modules[stand_in.__name__] = stand_in
        sys.modules.pop(f"{PACKAGE}.{name}", None)
        module = import_module(f"{PACKAGE}.{name}")
    finally:
        for key in [key for key in sys.modules if key.startswith(f"{PACKAGE}.")]:
            del sys.modules[key]
        sys.modules.update(before)
    path, arguments = next(
        (
            (str(getattr(module, key)), dict(getattr(module, of_xacro, {})) if of_xacro else {})
            for key, of_xacro in _FORMATS
            if hasattr(module, key)
        ),
        ("", {}),
    )
    entry = import_module(f"{PACKAGE}._descriptions").DESCRIPTIONS[name]
    return {
        **asked,
        "path": path,
        "package": str(module.PACKAGE_PATH),
        "arguments": {str(key): str(value) for key, value in arguments.items()},
        "licence": entry.license_spdx or "",
        "licence_file": entry.license_file or "",
    }


def installed() -> bool:
    """Whether the package is installed."""
    return util.find_spec(PACKAGE) is not None
