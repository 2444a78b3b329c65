"""``seerob measure``: the size of a recorded person, as a table for the workstation file."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from seerob.app.console.terminal import OUT, Exit, line
from seerob.core.errors import InputError, Problem

if TYPE_CHECKING:
    from seerob.core.snapshot import Finding
    from seerob.description.capture.morphology import Morphology
    from seerob.devices.capture.file_source import CaptureFile

HELP = "measure the bones of a recorded person (depth camera, skeleton file) for [[humans]]"
EXAMPLE = "seerob measure kinect_recording session.json --mass 72 --sex female"


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    add_person(sub)


def add_person(sub: argparse.ArgumentParser) -> None:
    """Arguments about a recording and the person in it."""
    sub.add_argument("kind", help="kind of source that reads the file, such as kinect_recording or bvh")
    sub.add_argument("file", help="the recording")
    sub.add_argument("--mass", type=float, required=True, help="body mass [kg]")
    sub.add_argument("--sex", choices=("male", "female"), required=True, help="of the person")
    sub.add_argument("--stature", type=float, help="[m]; estimated from the lengths when not given")
    sub.add_argument("--name", default="operator", help="of the person")
    sub.add_argument("--subject", default="", help="which person of the recording")
    sub.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="an option of the source, value as in the workstation file; may be repeated",
    )


def run(options: argparse.Namespace) -> int:
    """Measure, tell, and print the table."""
    found, findings = measured(reader(options, "seerob measure"), Path(options.file), options)
    for finding in (*findings, *found.findings):
        line(finding.level, finding.text, "" if finding.level == "note" else "yellow")
    OUT.print(person_table(options, found.stature, found.lengths), markup=False, soft_wrap=True)
    return Exit.WITHIN


GIVEN = {"human": "--name", "file": "give it as the argument", "subject": "--subject"}
"""Options of the source that the command has arguments for."""


def reader(options: argparse.Namespace, command: str) -> CaptureFile:
    """The source that reads a recording.

    Args:
        options: Of `add_person`.
        command: For messages.

    Raises:
        InputError: It is none of a person's motion; or every option that it does not have, or that is the
            command's own.
    """
    from seerob.app.commands.probe import options_of
    from seerob.core.plugin import load
    from seerob.devices.capture.file_source import CaptureFile
    from seerob.workstation.conversion import convert
    from seerob.workstation.source import Source

    kind = load("sources", options.kind, Source)
    if not issubclass(kind, CaptureFile):
        what = f"{options.kind} reads no recording of a person"
        raise InputError.at(command, "kind", what, "see: seerob kinds sources")
    where, more = f"{command} {options.kind}", options_of(options.set, command)
    problems = [
        Problem(where, f"--set {key}", "is an argument of the command itself", GIVEN[key])
        for key in more
        if key in GIVEN
    ]
    given = {"human": options.name, "file": Path(options.file).name, "subject": options.subject}
    source = convert(more | given, kind, file=where, key="", problems=problems)
    if problems or source is None:
        raise InputError(problems)
    return source


def measured(
    source: CaptureFile, path: Path, options: argparse.Namespace
) -> tuple[Morphology, tuple[Finding, ...]]:
    """The size of a recorded person, and what was found in the recording.

    Raises:
        InputError: The recording cannot be read, or has no joint centres to measure between.
    """
    from seerob.description.capture.morphology import measure
    from seerob.description.humans import manikin
    from seerob.devices.capture.options import observer

    captured = source.read(path)
    somebody = manikin.build(
        name=options.name, stature=options.stature or 1.75, mass=options.mass, sex=options.sex
    )
    bound, findings = observer(source, captured.layout, somebody, file=path.name)
    found = measure(
        captured.frames,
        bound,
        name=options.name,
        sex=options.sex,
        mass=options.mass,
        stature=options.stature,
    )
    return found, (*captured.findings, *findings)


def person_table(options: argparse.Namespace, stature: float, lengths: dict[str, float]) -> str:
    """The table ``[[humans]]``; lengths of the tables where none are given [m]."""
    from seerob.files.tables.mapping import toml_value

    shown = ", ".join(f"{key} = {value:.4f}" for key, value in lengths.items())
    table = (
        f"[[humans]]\nname = {toml_value(options.name)}\nstature = {stature:.4f}\nmass = {options.mass:g}\n"
        f"sex = {toml_value(options.sex)}"
    )
    return f"{table}\nlengths = {{ {shown} }}" if shown else table
