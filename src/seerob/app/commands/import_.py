"""``seerob import``: a workstation folder from a CAD file or a plant, to be completed by hand."""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from seerob.app.console.progress import spinner
from seerob.app.console.terminal import Exit, cache_folder, line, tell
from seerob.core.errors import InputError, suggestion
from seerob.core.files.whole_file import hidden_folder, whole_folder

if TYPE_CHECKING:
    from seerob.app.importing.folder import Densities, Files
    from seerob.description.cad.assembly import Assembly

HELP = "make a workstation folder from CAD: parts with names, places, colours and meshes"
EXAMPLE = "seerob import line.step my_line"

_KEPT = (
    *("density", "tolerance", "units", "up", "accept", "ground"),
    *("without", "smaller", "unreachable", "triangles"),
)
"""Options that a new revision takes over where they are not given again."""
_SHOWN = 20
"""Lines about what was left out."""


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    text = "STEP, IGES, 3DXML, glTF, OBJ, STL, PLY, OFF, 3MF, COLLADA, USD, SDF, URDF, MJCF or AutomationML"
    sub.add_argument("file", type=Path, help=text)
    sub.add_argument("folder", type=Path, help="folder to make, or one that an older revision made")
    text = "how far triangles may be from a STEP or IGES surface [mm] (default: 0.1); counts as uncertainty"
    sub.add_argument("--tolerance", type=float, metavar="MM", help=text)
    text = (
        "density of every part [kg/m³], of one material as S235JR=7850, or library for those that come with "
        "seerob, by words in the material's name; may be given several times"
    )
    sub.add_argument("--density", action="append", default=[], metavar="[NAME=]DENSITY", help=text)
    text = "TOML file of densities by material name, S235JR = 7850 [kg/m³]; --density goes before it"
    sub.add_argument("--densities", type=Path, metavar="FILE", help=text)
    sub.add_argument("--units", help="unit of lengths of a file that does not say it: mm, m, inch")
    text = "leave out parts by full name, with wildcards, as '*/screw*'; may be given several times"
    sub.add_argument("--without", action="append", default=[], metavar="PATTERN", help=text)
    text = "leave out parts that are smaller than this in every direction [mm]"
    sub.add_argument("--smaller", type=float, metavar="MM", help=text)
    text = "leave out parts inside of others, which nothing that is thicker than this can touch [mm]"
    sub.add_argument("--unreachable", type=float, metavar="MM", help=text)
    text = "most triangles of each part on the screen (default: 20000); distances use all"
    sub.add_argument("--triangles", type=int, metavar="COUNT", help=text)
    text = "propose axes that parts can move about or along, from shapes of a STEP or IGES file that fit"
    sub.add_argument("--axes", action="store_true", help=text)
    text = "make a mechanism of proposed axes, by their numbers: 1,3; implies --axes"
    sub.add_argument("--accept", metavar="NUMBERS", help=text)
    text = "part that stands, by its full name (default: of the lowest ones the largest)"
    sub.add_argument("--ground", metavar="NAME", help=text)
    sub.add_argument(
        "--up", choices=("x", "y", "z"), help="axis that points up in a file that does not say it"
    )


def run(options: argparse.Namespace) -> int:
    """Write the folder, or the new revision into one that was made so.

    Raises:
        InputError: The file cannot be read, or the folder exists.
        MissingPackage: The file needs OpenCASCADE, which is not installed.
    """
    from seerob.description.cad.recognised import recognised
    from seerob.description.mesh import MAX_BYTES, file_content

    folder: Path = options.folder
    before = _before(folder)
    ending = recognised(options.file, file_content(options.file, MAX_BYTES))
    if ending not in (".aml", ".amlx"):
        return _assembly(options, ending, folder, before)
    if before is not None:
        raise InputError.at(folder, "", "exists already", "give the name of a new folder")
    return _plant(options.file, folder)


def _before(folder: Path) -> dict[str, Any] | None:
    """The table of an older revision in a folder; None where there is no folder.

    Raises:
        InputError: There is something else.
    """
    from seerob.app.importing.folder import TABLE

    if not folder.exists() or (folder.is_dir() and not any(folder.iterdir())):
        return None
    if not (folder / TABLE).is_file() or not (folder / "workstation.toml").is_file():
        what = f"exists already, and has no {TABLE} of an older revision"
        raise InputError.at(folder, "", what, "give the name of a new folder")
    try:
        before: dict[str, Any] = json.loads((folder / TABLE).read_bytes())
        for row in before["parts"]:
            for key in ("name", "mesh", "shape", "box", "written"):
                row[key]
        before["options"].get("density")
        before["left_out"] = before.get("missing", [])
    except (ValueError, LookupError, TypeError, AttributeError, OSError) as error:
        raise InputError.at(folder / TABLE, "", f"cannot be read ({error})", "import anew") from error
    return before


def _assembly(options: argparse.Namespace, ending: str, folder: Path, before: dict[str, Any] | None) -> Exit:
    from seerob.app.importing.folder import densities, densities_of_table, files
    from seerob.app.importing.picture import FILE, picture
    from seerob.app.importing.revision import under_former_root
    from seerob.app.importing.wanted import wanted
    from seerob.description.cad import reading

    if options.densities is not None:
        # Of the table the figures are kept, for the next revision.
        options.density = [*densities_of_table(options.densities), *options.density]
    former = {} if before is None else before["options"]
    for key in _KEPT:
        if not getattr(options, key):
            setattr(options, key, former.get(key) or getattr(options, key))
    kept = {key: getattr(options, key) for key in _KEPT}
    given = densities(options.density)
    with spinner() as say:
        assembly = reading.read(
            options.file,
            ending,
            tolerance=options.tolerance,
            units=options.units,
            up=options.up,
            cache=cache_folder(),
            progress=say,
        )
    renamed = ""
    if before is not None:
        assembly, renamed = under_former_root(assembly, before)
    assembly = wanted(
        assembly,
        patterns=options.without,
        smaller=options.smaller,
        unreachable=options.unreachable,
        triangles=options.triangles,
    )
    assembly = _moving(options, assembly, given)
    own = set[str]()
    if before is not None:
        made_before = {row["mesh"] for row in before["parts"]}
        own = {f"cad/{file.name}" for file in (folder / "cad").glob("*")} - made_before
    with spinner() as say:
        made = files(assembly, options.file, given, options=kept, taken=own, progress=say)
        say("drawing the picture")
        shown = picture(assembly)
    if before is None:
        _write(folder, made.texts, {**made.meshes, FILE: shown})
    else:
        _revise(folder, before, made, shown)
        if renamed:
            line("renamed", renamed, "yellow")
    _say(options.file, assembly, made)
    return Exit.WITHIN


def _moving(options: argparse.Namespace, assembly: Assembly, given: Densities) -> Assembly:
    """The assembly with axes that the user accepts as a mechanism; tells what is proposed."""
    if not (options.axes or options.accept):
        if options.ground:
            raise InputError.at(
                "--ground", "", "is of --accept", "say which axes are accepted, or leave it out"
            )
        return assembly
    from seerob.description.cad.axes import accepted, proposals
    from seerob.description.cad.names import plain_name

    if not any(shape.surfaces for shape in assembly.shapes):
        raise InputError.at("--axes", "", "only STEP and IGES files say which faces are round", "export STEP")
    found, names = proposals(assembly), assembly.names()
    for number, p in enumerate(found[:_SHOWN], 1):
        line("axis", f"{number}: {p.kind.value}, {names[p.b]} on {names[p.a]}: {p.reason}")
    if not found:
        line("axis", "no shapes fit into each other")
    if not options.accept:
        return assembly
    words = options.accept.replace(",", " ").split()
    numbers = [int(word) for word in words if word.isdecimal() and 1 <= int(word) <= len(found)]
    if not words or len(numbers) != len(words):
        what = f"{options.accept!r} are no numbers of proposals"
        raise InputError.at("--accept", "", what, f"from 1 to {len(found)}, as --axes lists them")
    if options.ground is not None and options.ground not in names:
        raise InputError.at(
            "--ground", "", f"there is no part {options.ground!r}", suggestion(options.ground, names)
        )
    ground = None if options.ground is None else names.index(options.ground)
    try:
        chosen = [found[number - 1] for number in dict.fromkeys(numbers)]
        made, told = accepted(assembly, chosen, plain_name(options.file.stem), ground, given.weighed)
    except ValueError as error:
        raise InputError.at("--accept", "", str(error), "accept other axes, or say --ground") from None
    for text in told:
        line("accepted", text)
    return made


def _revise(folder: Path, before: dict[str, Any], made: Files, shown: bytes) -> None:
    """Write a new revision, and its picture, into a folder."""
    from seerob.app.importing.folder import TABLE
    from seerob.app.importing.picture import FILE
    from seerob.app.importing.revision import revised

    file = folder / "workstation.toml"
    try:
        revision = revised(file.read_bytes(), before, made.rows(), str(file))
        contents = {
            **made.meshes,
            FILE: shown,
            TABLE: made.texts[TABLE].encode(),
            file.name: revision.text,
        }
        with hidden_folder(folder / "new") as working:
            for name, content in contents.items():
                (working / name).parent.mkdir(parents=True, exist_ok=True)
                (working / name).write_bytes(content)
            try:
                _replace(working, folder, contents)
            except KeyboardInterrupt:  # half of it would be worse, and the rest takes no time
                _replace(working, folder, contents)
                raise
        for name in revision.unused:
            (folder / name).unlink(missing_ok=True)
    except OSError as error:
        what = f"cannot be written: {error.strerror}"
        raise InputError.at(folder, "", what, "give a folder that may be written") from error
    line("wrote", f"{file}, of which everything that was edited by hand stays")
    for word, text in revision.told:
        line(word, text, "yellow" if word in ("lost", "kept", "renamed?") else "")
    if not revision.told:
        line("same", "no part was added, moved, resized or lost")


def _replace(working: Path, folder: Path, names: Iterable[str]) -> None:
    """Move files into a folder that may have older ones of their names; those that are moved already stay."""
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        if (working / name).exists():
            (working / name).replace(folder / name)


def _say(file: Path, assembly: Assembly, made: Files) -> None:
    line("read", f"{file.name}: {assembly.format}, unit {assembly.unit}")
    if made.parts:
        low = [min(row["box"][0][axis] for row in made.parts) for axis in range(3)]
        high = [max(row["box"][1][axis] for row in made.parts) for axis in range(3)]
        size = " × ".join(f"{b - a:.4g}" for a, b in zip(low, high, strict=True))
        triangles = sum(row["triangles"] for row in made.parts)
        several = "" if len(made.parts) == 1 else "s"
        shapes = f"{len(assembly.shapes)} shape{'' if len(assembly.shapes) == 1 else 's'}"
        parts = f"{len(made.parts)} part{several} of {shapes}"
        line("found", f"{parts}, {triangles} triangles, {size} m")
        _say_masses(made.parts)
    for row in made.robots:
        mass = "no mass stated" if row["mass"] is None else f"{row['mass']:.4g} kg"
        missing = f", no mass of {', '.join(row['without_mass'][:5])}" if row["without_mass"] else ""
        joints = f"{len(row['joints'])} joint{'' if len(row['joints']) == 1 else 's'}"
        line("found", f"robot {row['name']}: {row['links']} links, {joints}, {mass}{missing}")
    for finding in made.findings:
        word = "guessed" if finding.level == "assumed" else finding.level
        line(word, f"{finding.subject}: {finding.text}", "yellow" if word == "warning" else "dim")
    for name, why in assembly.left_out[:_SHOWN]:
        line("left out", f"{name}: {why}", "yellow")
    if len(assembly.left_out) > _SHOWN:
        line("left out", f"and {len(assembly.left_out) - _SHOWN} more, which import.json lists", "yellow")


def _say_masses(parts: Sequence[Mapping[str, Any]]) -> None:
    """The sum of masses that are known, and of how many parts none is."""
    known = [(row["mass"], row["mass_error"]) for row in parts if row["mass"] is not None]
    if known:
        without = len(parts) - len(known)
        rest = f"; of {without} it is not known" if without else ""
        off = sum(mass * error for mass, error in known)
        within = f" ± {off:.2g} kg" if off > 0 else ""
        line(
            "found",
            f"{sum(mass for mass, _ in known):.6g} kg{within} in {len(known)} of {len(parts)} parts{rest}",
        )


def _plant(file: Path, folder: Path) -> Exit:
    from seerob.app.importing.plant import GEOMETRY, VARIABLES, Made
    from seerob.description.formats.automationml import read

    plant = read(file)
    made = Made(plant)
    _write(folder, made.files(), made.meshes)
    tell((*plant.findings, *made.findings))
    count, links = sum(1 for _ in plant.walk()), len(plant.links)
    line("read", f"{file.name}: CAEX {plant.version}, {count} elements, {links} links")
    line("found", f"{made.parts} parts with a shape, {made.robots} robots, {len(made.variables)} variables")
    if not (made.parts or made.robots or made.variables):
        text = (
            f"{count} elements, none of which has a geometry file ({', '.join(sorted(GEOMETRY))}), "
            f"the role Robot or a variable ({', '.join(sorted(VARIABLES))}): the folder is an empty "
            "workstation"
        )
        line("warning", text, "yellow")
    text = f"choose the robots' models and give the variables their units, then seerob check-file {folder}"
    line("next", text)
    return Exit.WITHIN


def _write(folder: Path, texts: Mapping[str, str], meshes: Mapping[str, bytes]) -> None:
    try:
        with whole_folder(folder) as working:
            (working / "cad").mkdir()
            for name, data in meshes.items():
                (working / name).parent.mkdir(parents=True, exist_ok=True)
                (working / name).write_bytes(data)
            for name, text in texts.items():
                (working / name).write_text(text, encoding="utf-8")
    except OSError as error:
        what = f"cannot be written: {error.strerror}"
        raise InputError.at(folder, "", what, "give a folder that may be written") from error
    for name in texts:
        line("wrote", str(folder / name))
