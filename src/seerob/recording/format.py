"""What our recordings hold, in one place for the writer and the reader.

A recording is an MCAP file. Per tick there is one message on `SAMPLES` (what came in) and one on `SNAPSHOT`
(what went out), both MessagePack with float64. `SCENE` is the first message, with what does not change: the
basis of each criterion is there. Attachments hold the meshes and every input file. All other channels serve
foreign viewers only and are never read back.

Under which name each file that was read travels in a recording.

Files inside the folder of the workstation file go where that file finds them, so that unpacking a
recording gives a folder that can be read again. What lies outside (an installed package, another
folder) is kept below `OUTSIDE`, to be looked at and compared: nothing finds it there.
"""

from __future__ import annotations

import hashlib
import os
import platform
from collections.abc import Iterable, Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path, PurePosixPath

from msgspec import Struct

from seerob.core.files.bounded import leads_outside
from seerob.core.samples import Sample, Vec3, Vec4

OUTSIDE = "outside"


def filed(
    owner: str,
    files: Mapping[str, bytes],
    *,
    folder: Path,
    references: Iterable[str | None],
    packages: Mapping[str, str] | None = None,
) -> dict[str, bytes]:
    """The files of a robot or a thing by the names that they travel under.

    Args:
        owner: Its name.
        files: Content by the name its description has for it: a path relative to the description,
            or a ``package://`` reference.
        folder: Folder of the workstation file.
        references: What the workstation file calls its descriptions; nothing for None.
        packages: Folder of each ROS package that the workstation file names.
    """
    bases = [PurePosixPath(r).parent for r in references if r is not None and ":" not in r]
    placed: dict[str, bytes] = {}
    for name, content in files.items():
        for candidate in _candidates(name, bases, packages or {}, folder):
            if candidate is not None and _is(folder / candidate, content):
                break
        else:
            candidate = _kept(owner, name, inside=any(map(_inside, bases)))
        placed[candidate] = content
    return placed


SOURCES = f"{OUTSIDE}/sources/"
"""Below it, hashes of files of sources and criteria that lie outside the folder: what was used of them is in
samples and bases."""
LARGEST = 64 * 2**20
"""A file of a source that is larger [B] is not kept, only its hash: bags with pictures have gigabytes."""
MOST = 1000
"""Files of a folder, such as a bag of ROS 2, whose hashes are kept."""


def source_files(references: Iterable[str], *, folder: Path, outside: bool = False) -> dict[str, bytes]:
    """Trajectories and motions that the sources of a workstation name, as far as they are files.

    Of what lies outside the folder, of a folder and of a large file there are only hashes, in the words of
    ``sha256sum``.

    Args:
        references: What the workstation file calls them; ``library:walk`` is no file.
        folder: Folder of the workstation file.
        outside: Whether what lies outside it may be read.
    """
    found: dict[str, bytes] = {}
    for reference in filter(None, references):  # an empty one would be the folder itself
        path = folder / reference
        inside = _inside(PurePosixPath(os.path.relpath(path, folder).replace(os.sep, "/")))
        hashes = f"{SOURCES}{path.name}.sha256"
        try:
            away = leads_outside(path, folder) is not None
            if path.is_dir() or (path.is_file() and (away or path.stat().st_size > LARGEST)):
                found |= {hashes: _hashes(path)} if outside or not away else {}
            elif path.is_file() and inside is not None:
                found[inside] = path.read_bytes()
            if hashes not in found and (folder / hashes).is_file():  # unpacked from a recording
                found[hashes] = (folder / hashes).read_bytes()
        except OSError:
            continue  # opening the source has said so, or says so better
    return found


def content_hash(files: Mapping[str, bytes]) -> str:
    """SHA-256 over the names and contents of files, independent of their order."""
    digest = hashlib.sha256()
    for name in sorted(files):
        digest.update(f"{name}\0{len(files[name])}\0".encode())
        digest.update(files[name])
    return digest.hexdigest()


def _hashes(path: Path) -> bytes:
    lines = []
    for part in sorted(p for p in path.rglob("*") if p.is_file())[:MOST] if path.is_dir() else [path]:
        with part.open("rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
        lines.append(f"{digest}  {part.relative_to(path.parent).as_posix()}\n")
    return "".join(lines).encode()


def _candidates(
    name: str, bases: list[PurePosixPath], packages: Mapping[str, str], folder: Path
) -> Iterable[str | None]:
    _, separator, rest = name.partition("://")
    if separator:
        package, _, inner = rest.partition("/")
        yield _inside(PurePosixPath(packages.get(package, package)) / inner)
        for base in bases:
            for ancestor in (base, *base.parents):
                yield _inside(ancestor / package / inner)
    elif Path(name).is_absolute():
        yield _inside(PurePosixPath(os.path.relpath(name, folder)))
    else:
        for base in bases:
            yield _inside(base / name)


def _inside(path: PurePosixPath) -> str | None:
    """The path without detours when it stays in its folder, else None."""
    plain = os.path.normpath(path.as_posix()).replace("\\", "/")
    return None if plain.startswith(("..", "/")) or ":" in plain.split("/")[0] else plain


def _is(path: Path, content: bytes) -> bool:
    try:
        return path.stat().st_size == len(content) and path.read_bytes() == content
    except OSError:
        return False


def _kept(owner: str, name: str, *, inside: bool) -> str:
    scheme, separator, rest = name.partition("://")
    if separator and scheme in ("package", "model") and inside:
        # A robot finds its packages beside it or above, so also here.
        beside = _inside(PurePosixPath(rest))
        if beside is not None:
            return beside
    parts = [
        part
        for part in (rest if separator else name).replace("\\", "/").split("/")
        if part not in ("", ".", "..")
    ]
    return "/".join([OUTSIDE, owner, *(part.replace(":", "_") for part in parts)])


VERSION = "2"
"""Of this layout; a reader refuses one that it does not know."""
WITH_NAMES = "1"
"""The layout before: results, rows, aspects and markers are maps, in which a field may be missing."""

METADATA = "seerob"
"""Name of the metadata record at the start: layout, versions, wall-clock time."""
END_METADATA = "seerob.end"
"""Name of the metadata record at the end: how many ticks, how many were left out, and `DIGEST`."""
BROKEN_OFF = "broken_off"
"""Of `END_METADATA`: the error that ended the run before it was over; only where one did."""
DIGEST = "sha256"
"""Of `END_METADATA`: of all messages on `SAMPLES` and `SNAPSHOT`, one after the other. It finds what was cut
out, put in or changed since; whoever wants to deceive can write another."""

SCENE = "/seerob/scene"
SAMPLES = "/seerob/samples"
SNAPSHOT = "/seerob/snapshot"

VIEW_SCENE, VIEW_MARKERS, VIEW_FRAMES, VIEW_RESULTS = "/scene", "/markers", "/tf", "/results"
VIEW_PEOPLE = "/people"
"""For foreign viewers; `VIEW_SCENE` is sent once, the others from time to time."""
VISITORS = "/visitors"
PRESENCES = "/presences"
PICTURES = "/cameras/"
"""Before the name of a camera, and `LENS` after it for what it is of."""
LENS = "/lens"
"""Who looked on; only where somebody did."""

MESH_PREFIX = "mesh/"
"""Attachments ``mesh/<hash>.glb``."""
FILE_PREFIX = "file/"
"""Attachments ``file/<relative name>``."""


class Tick(Struct, frozen=True, kw_only=True):
    """One tick's input: what the engine consumed before it stepped."""

    seq: int
    t: float
    """Run time [s]."""
    samples: tuple[Sample, ...] = ()


class Visitor(Struct, frozen=True, kw_only=True):
    """A page that was connected to the run, or an address that was not let in."""

    event: str
    """``came``, ``introduced`` (who they are, or where they stand, is another), ``left``, ``there`` (at the
    end of the recording) or ``refused``."""
    role: str
    """``view``, ``track``, ``control``; ``any`` where no token is asked for, ``none`` of strangers."""
    address: str
    since: str
    """Wall-clock time, ISO 8601 in UTC."""
    until: str | None = None
    refused: dict[str, int] = {}
    """What was asked for in vain, and how often by now."""
    id: int = 0
    """Number of the visitor, by which `/presences` names them; 0 of who was not let in."""
    name: str = ""
    """What they call themselves, where the run was told to record it; empty otherwise."""
    device: str = ""
    human: str = ""
    """Person of the workstation file whom they are."""
    scale: float = 1.0
    """Metres of the world in a metre of theirs."""
    position: Vec3 = (0.0, 0.0, 0.0)
    """Where the floor of their room lies in the world [m]."""
    turn: Vec4 = (1.0, 0.0, 0.0, 0.0)
    """How the axes of their room (x right, y up, z backward) are turned in the world, w first."""


def nanoseconds(t: float) -> int:
    """Log time [ns] of a run time [s]."""
    return max(0, round(t * 1e9))


def versions() -> dict[str, str]:
    """Name → version of Python and of the packages that results depend on; absent ones are left out."""
    found = {"python": platform.python_version()}
    for name in ("seerob", "mujoco", "mujoco-core", "numpy", "numba", "scipy"):
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found
