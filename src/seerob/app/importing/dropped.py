"""A CAD file that a page brings to a workstation: read in a process of its own, its meshes beside the file.

    python -P -m seerob.app.importing.dropped '{"file": "…", "folder": "…", "under": "imported/line"}'

The process says how far it is and how it ended in lines of JSON, and is limited in memory and time. Files
that it writes have names by their content, so that none that a workstation file names becomes another.
"""

from __future__ import annotations

import asyncio
import hashlib
import json
import sys
from collections.abc import AsyncIterator, Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from seerob.core.errors import InputError, Problem, SeerobError
from seerob.core.snapshot import Change

MEMORY, SECONDS = 8 << 30, 1800
"""Memory [byte] and computing time [s] of the process; what OpenCASCADE takes has its own bounds."""
LONGEST_LINE = 1 << 20
"""No line that the process says is longer [byte]."""
LARGEST_TABLE = 256 << 20
"""No table of what a file became is larger [byte]."""
MOST_AXES = 20
"""Proposals that are told."""
TABLES = "import-*.json"
OPTIONS = (
    *("units", "up", "accept", "ground", "tolerance", "density"),
    *("without", "smaller", "unreachable", "triangles"),
)
"""What a page may say of a file, as the options of ``seerob import``; several values have commas between."""
_LISTS, _NUMBERS, _COUNTS = ("density", "without"), ("tolerance", "smaller", "unreachable"), ("triangles",)


async def read_apart(
    file: Path, folder: Path, under: str, options: Mapping[str, str], former: Mapping[str, Any]
) -> AsyncIterator[dict[str, Any]]:
    """What the process says: lines ``say``, and at last ``table`` (a file in the folder) or ``problems``.

    Args:
        file: The CAD file.
        folder: Where its meshes and the table go; there already.
        under: The folder as paths of the workstation file say it.
        options: Of `OPTIONS`, as text; those that are left out are as they were for this file before, and
            those that are empty are none.
        former: Options of before, as `former` tells them.
    """
    asked = {"file": str(file), "folder": str(folder), "under": under, "options": dict(options)}
    asked["former"] = dict(former)
    command = (sys.executable, "-P", "-m", __name__, json.dumps(asked))
    process = await asyncio.create_subprocess_exec(
        *command,
        stdin=asyncio.subprocess.DEVNULL,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.DEVNULL,
        limit=LONGEST_LINE,
        process_group=0,  # Ctrl-C is for this process, which ends it
    )
    assert process.stdout is not None
    try:
        async with asyncio.timeout(4 * SECONDS):
            async for line in process.stdout:
                told = json.loads(line)
                yield told
                if "say" not in told:
                    return
    except (TimeoutError, ValueError):
        pass
    finally:
        with suppress(ProcessLookupError):
            process.kill()
        await process.wait()
    what = "ends the process that reads it, or takes too long"
    yield {"problems": [(file.name, "", what, "export it again, or import it with seerob import")]}


def changes(
    raw: bytes, folder: Path, table: str, file: str
) -> tuple[tuple[Change, ...], tuple[tuple[str, str], ...], dict[str, Any]]:
    """What of a workstation file changes by what was read, what is told of that, and the table.

    Of an older revision of the CAD file, the table counts that says most of what the workstation file has.

    Args:
        raw: The workstation file.
        folder: Where the table is.
        table: Its name.
        file: Name of the workstation file, for messages.

    Raises:
        InputError: Something new has the name of one of the user's.
    """
    from seerob.app.importing.revision import changes_of, read_tables

    made = _table(folder / table)
    assert made is not None
    tables = read_tables(raw, file)
    before = _older(tables, folder)[0]
    now = {group: tuple(made[group]) for group in ("parts", "robots", "left_out")}
    found, told = changes_of(tables, before, now, file)
    return tuple(found), tuple(told), made


def former(raw: bytes, folder: Path, file: str) -> dict[str, Any]:
    """Options of the revision that the workstation file says most of; none where it says nothing of one.

    Args:
        raw: The workstation file.
        folder: Where the tables of revisions are.
        file: Name of the workstation file, for messages.
    """
    from seerob.app.importing.revision import read_tables

    options = _older(read_tables(raw, file), folder)[1].get("options")
    return options if isinstance(options, dict) else {}


def _older(tables: Mapping[str, Any], folder: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """Rows of the older revision that the workstation file has, and the revision's table."""
    older = [t for name in sorted(folder.glob(TABLES)) if (t := _table(name)) is not None]
    found = [(*_there(table, tables), table) for table in older]
    same, rows, table = max(found, key=lambda one: one[0], default=(0, {}, {}))
    return (rows, table) if same else ({}, {})


def _table(file: Path) -> dict[str, Any] | None:
    try:
        if file.stat().st_size > LARGEST_TABLE:
            return None
        found: dict[str, Any] = json.loads(file.read_bytes())
        for group in ("parts", "robots", "left_out"):
            for row in found[group]:
                row["name"], row["shape"], row["written"].items()
    except (OSError, ValueError, LookupError, TypeError, AttributeError):
        return None
    return found


def _there(table: Mapping[str, Any], tables: Mapping[str, Any]) -> tuple[int, dict[str, Any]]:
    """How many rows of a table the workstation file has as they were written, and those that it names."""
    same, rows = 0, dict[str, Any]()
    for group in ("parts", "robots", "left_out"):
        entries = {e.get("name"): e for e in tables.get(group, []) if isinstance(e, dict)}
        rows[group] = [row for row in table[group] if row["name"] in entries]
        same += sum(entries[row["name"]] == row["written"] for row in rows[group])
    return same, rows if same else {}


# -- in the process -----------------------------------------------------------------------------


def _main(asked: Mapping[str, Any]) -> None:
    _limit()
    try:
        table = _read(
            Path(asked["file"]), Path(asked["folder"]), asked["under"], asked["options"], asked["former"]
        )
        _tell({"table": table})
    except InputError as error:
        _tell({"problems": [_plain(problem) for problem in error.problems][:20]})
    except MemoryError:
        _tell({"problems": [(Path(asked["file"]).name, "", "takes too much memory to read", "")]})
    except (SeerobError, OSError) as error:
        _tell({"problems": [(Path(asked["file"]).name, "", str(error), "")]})


def _plain(problem: Problem) -> tuple[str, ...]:
    """A problem as a page shows it, where options are no words with dashes."""
    file, *rest = problem
    return (file.removeprefix("--"), *rest)


def _tell(what: Mapping[str, Any]) -> None:
    print(json.dumps(what), flush=True)  # noqa: T201 - to the process that asked


def _limit() -> None:
    with suppress(ImportError, ValueError, OSError):  # not on Windows, and macOS knows no bound of memory
        import resource

        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        for kind, most in ((resource.RLIMIT_CPU, SECONDS), (resource.RLIMIT_AS, MEMORY)):
            resource.setrlimit(kind, (most, resource.getrlimit(kind)[1]))


def _read(file: Path, folder: Path, under: str, options: Mapping[str, str], former: Mapping[str, Any]) -> str:
    """Write meshes and the table of a file; name of the table."""
    from seerob.app.console.terminal import cache_folder
    from seerob.app.importing.folder import densities, files
    from seerob.app.importing.wanted import wanted
    from seerob.core.files.whole_file import whole_file
    from seerob.description.cad import reading
    from seerob.description.cad.recognised import recognised
    from seerob.description.mesh import MAX_BYTES, file_content

    def say(text: str) -> None:
        _tell({"say": text})

    ending = recognised(file, file_content(file, MAX_BYTES))
    if ending in (".aml", ".amlx"):
        raise InputError.at(
            file.name, "", "is a plant, not a part of one", "seerob import makes a cell of it"
        )
    asked = _asked(former, options)
    given = densities(asked["density"])
    assembly = reading.read(
        file,
        ending,
        tolerance=asked["tolerance"],
        units=asked["units"],
        up=asked["up"],
        cache=cache_folder(),
        progress=say,
    )
    assembly = wanted(
        assembly,
        patterns=asked["without"],
        smaller=asked["smaller"],
        unreachable=asked["unreachable"],
        triangles=asked["triangles"],
    )
    axes: list[dict[str, Any]] = []
    told: list[str] = []
    if any(shape.surfaces for shape in assembly.shapes) and len(assembly.instances) > 1:
        from seerob.description.cad.axes import accepted, proposals
        from seerob.description.cad.names import plain_name

        say("looking for axes that shapes speak for")
        found, names = proposals(assembly), assembly.names()
        axes = [
            {
                "kind": p.kind.value,
                "between": [names[p.a], names[p.b]],
                "point": p.point.tolist(),
                "axis": p.axis.tolist(),
                "reason": p.reason,
            }
            for p in found[:MOST_AXES]
        ]
        numbers = _numbers(asked["accept"] or "", len(axes))
        if numbers:
            stands = asked["ground"]
            if stands is not None and stands not in names:
                raise InputError.at(file.name, "ground", f"there is no part {stands!r}", "give a full name")
            ground = None if stands is None else names.index(stands)
            chosen = [found[n - 1] for n in numbers]
            try:
                assembly, told = accepted(assembly, chosen, plain_name(file.stem), ground, given.weighed)
            except ValueError as error:
                raise InputError.at(file.name, "axes", str(error), "accept other ones") from None
    made = files(assembly, file, given, options=asked, progress=say)
    renamed = {}
    for name, content in made.meshes.items():
        renamed[name] = _by_content(name, content, made.robots)
        target = folder / renamed[name]
        target.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(target) as hidden:
            hidden.write_bytes(content)
    table = json.loads(made.texts["import.json"])
    rows = {"parts": made.parts, "robots": made.robots, "left_out": made.missing}
    for row in made.parts:
        row["mesh"] = row["written"]["mesh"] = f"{under}/{renamed[row['mesh']]}"
    for row in made.robots:
        row["files"] = [f"{under}/{renamed[name]}" for name in row["files"]]
        row["written"]["model"] = f"{under}/{renamed[row['written']['model']]}"
    for row in made.missing:
        # Two files may lack the same one.
        row["name"] = row["written"]["name"] = f"{file.stem}: {row['name']}"[:500]
    table |= {**rows, "axes": axes, "accepted": told}
    text = json.dumps(table, ensure_ascii=False).encode()
    name = f"import-{hashlib.sha256(text).hexdigest()[:12]}.json"
    with whole_file(folder / name) as hidden:
        hidden.write_bytes(text)
    return name


def _asked(former: Mapping[str, Any], options: Mapping[str, str]) -> dict[str, Any]:
    """Options by name, as ``seerob import`` has them, those of before where none is given.

    Raises:
        InputError: One is no number.
    """
    asked: dict[str, Any] = {}
    for key in OPTIONS:
        text = options.get(key)
        if text is None:
            asked[key] = former.get(key)
        elif key in _LISTS:
            asked[key] = [word for piece in text.split(",") if (word := piece.strip())]
        elif key in _NUMBERS or key in _COUNTS:
            try:
                asked[key] = (int if key in _COUNTS else float)(text) if text.strip() else None
            except ValueError:
                raise InputError.at(f"--{key}", "", f"{text!r} is no number", "give one") from None
        else:
            asked[key] = text or None
    return asked | {key: asked[key] or [] for key in _LISTS}


def _by_content(name: str, content: bytes, robots: Iterable[Mapping[str, Any]]) -> str:
    """``cad/pin.glb`` as ``cad/pin-1a2b3c4d.glb``; of a mechanism, its folder by all that is in it."""
    head, _, rest = name.partition("/")
    if head != "robots":
        digest = hashlib.sha256(content).hexdigest()[:8]
        return str(Path(name).with_stem(f"{Path(name).stem}-{digest}").as_posix())
    folder, _, rest = rest.partition("/")
    shape = next(row["shape"] for row in robots if row["name"] == folder)
    return f"robots/{folder}-{shape[:8]}/{rest}"


def _numbers(text: str, most: int) -> list[int]:
    words = text.replace(",", " ").split()
    numbers = [int(word) for word in words if word.isdecimal() and 1 <= int(word) <= most]
    if len(numbers) != len(words):
        raise InputError(Problem("", "accept", f"{text!r} are no numbers of proposals", f"1 to {most}"))
    return list(dict.fromkeys(numbers))


if __name__ == "__main__":
    _main(json.loads(sys.argv[1]))
