"""``seerob capture``: a recording of a person in; a twin that follows it, scores and tables out."""

from __future__ import annotations

import argparse
import re
import shutil
from pathlib import Path
from typing import TYPE_CHECKING

from seerob.app.commands.measure import add_person, measured, person_table, reader
from seerob.app.console.terminal import line
from seerob.core.errors import InputError
from seerob.core.files.whole_file import whole_folder
from seerob.workstation.workstation import FILE_NAME

if TYPE_CHECKING:
    from seerob.description.capture.fit_check import MarkerStature
    from seerob.description.capture.observing import Observer
    from seerob.description.description import Description
    from seerob.devices.capture.file_source import CaptureFile

COMMAND = "seerob capture"
HELP = "make a workstation of a recorded person, let the twin follow it, and export the motion and its scores"
EXAMPLE = "seerob capture bvh session.bvh --mass 72 --sex female -o my_session"

_TABLES = """
# Scores ask for what no posture shows (loads, support, repetition): give it in [[phases]], as --ask does.
[[ergonomics]]
kind = "rula"
human = {human}

[[ergonomics]]
kind = "reba"
human = {human}

[[sinks]]
kind = "csv"

[[sinks]]
kind = "opensim"
"""


_DEVICE = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)(\.|$)", re.IGNORECASE)
"""Names that Windows takes for devices."""


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    add_person(sub)
    sub.add_argument("-o", "--output", type=Path, required=True, help="folder to make the workstation in")
    sub.add_argument("--json", action="store_true", help="results as JSON on standard output")
    text = "ask on the terminal for what no posture shows (loads, grips, cycle, phases), as the rules need it"
    sub.add_argument("--ask", action="store_true", help=text)


def run(options: argparse.Namespace) -> int:
    """Make the workstation, and assess it.

    Raises:
        InputError: The folder exists, or the recording or the person cannot be used.
    """
    from seerob.app.commands import assess

    if options.output.exists():
        raise InputError.at(options.output, "", "exists already", "give another folder with -o")
    text = _workstation(options, Path(options.file))
    if options.ask:
        text = _with_phases(text, options)
    try:
        with whole_folder(options.output) as working:
            (working / FILE_NAME).write_text(text, encoding="utf-8")
            recording = Path(options.file)
            copied = shutil.copytree if recording.is_dir() else shutil.copyfile
            copied(recording, working / _copied_as(recording))
    except OSError as error:
        what = f"cannot be made: {error.strerror}"
        raise InputError.at(options.output, "", what, "give a folder that may be written") from error
    if not options.json:
        line("wrote", str(options.output / FILE_NAME))
    # By its own parser: it knows its options and their defaults.
    same = argparse.ArgumentParser()
    assess.add(same)
    return assess.run(same.parse_args([str(options.output), *(["--json"] if options.json else [])]))


def _copied_as(recording: Path) -> str:
    """What a recording is called in the folder: a name that every system takes, and no other has there."""
    name = re.sub(r'[<>:"|?*\\\x00-\x1f]', "_", recording.resolve().name).rstrip(". ") or "recording"
    taken = name.casefold() in (FILE_NAME, "runs") or _DEVICE.match(name)
    return f"recording_{name}" if taken else name


def _workstation(options: argparse.Namespace, recording: Path) -> str:
    """The workstation file; what is wrong with the options is said before anything is made."""
    import tomllib

    from seerob.app.commands.probe import options_of
    from seerob.files.tables.mapping import toml_value
    from seerob.session.reading import convert_workstation

    table = _person(options, recording)
    given = {"kind": options.kind, "human": options.name, "file": _copied_as(recording)}
    given |= {"subject": options.subject} if options.subject else {}
    given |= options_of(options.set, COMMAND)
    source = [f"{key} = {toml_value(value)}" for key, value in given.items()]
    head = [f"title = {toml_value(recording.stem)}", "", table, "", "[[sources]]", *source, ""]
    text = "\n".join(head) + _TABLES.format(human=toml_value(options.name))
    _, problems = convert_workstation(tomllib.loads(text), COMMAND)
    if problems:
        raise InputError(problems)
    return text


def _with_phases(text: str, options: argparse.Namespace) -> str:
    """The workstation file with the phases that are entered; its comments stay.

    Raises:
        InputError: Nobody is there to answer, or an answer does not fit the others.
    """
    import tomllib

    from seerob.app.console.phase_questions import ask_phases, needed, on_a_terminal
    from seerob.app.console.terminal import STATUS
    from seerob.core.page_messages import Change
    from seerob.core.plugin import load
    from seerob.session.reading import BASES, convert_workstation
    from seerob.workstation.editing import changed

    base = BASES["ergonomics"]
    rules = [load("ergonomics", each["kind"], base) for each in tomllib.loads(text)["ergonomics"]]
    captured = reader(options, COMMAND).read(Path(options.file))

    def tell(said: str) -> None:
        STATUS.print(said, markup=False)

    phases = ask_phases(needed(rules), (captured.count - 1) / captured.rate, on_a_terminal, tell)
    changes = [Change(kind="add", path=("phases",), value={**p, "human": options.name}) for p in phases]
    text = changed(text.encode(), changes, FILE_NAME)[0].decode()
    _, problems = convert_workstation(tomllib.loads(text), COMMAND)
    if problems:
        raise InputError(problems)
    return text


def _person(options: argparse.Namespace, recording: Path) -> str:
    """The person as it was measured; of markers, which show no joint centres, as the tables have it."""
    source = reader(options, COMMAND)
    source.read(recording)  # what is wrong with it is said first
    try:
        found, findings = measured(source, recording, options)
    except InputError as error:
        if not any(p.key == "morphology" for p in error.problems):
            raise
        stature = options.stature
        if stature is None:
            told = _marker_stature(source, recording, options)
            stature = told.stature
            if not options.json:
                line("assumed", told.finding(options.name).text, "yellow")
        if not options.json:
            text = (
                f"the bones of {options.name} are not measured ({error.problems[0].what}): usual proportions"
            )
            line("assumed", text, "yellow")
        return person_table(options, stature, {})
    if not options.json:
        for finding in (*findings, *found.findings):
            line(finding.level, finding.text, "" if finding.level == "note" else "yellow")
    return person_table(options, found.stature, found.lengths)


def _marker_stature(source: CaptureFile, recording: Path, options: argparse.Namespace) -> MarkerStature:
    """The stature that markers tell.

    Raises:
        InputError: They do not tell it.
    """
    from seerob.description.capture.fit_check import marker_stature
    from seerob.description.humans import manikin
    from seerob.devices.capture.options import observer

    captured = source.read(recording)

    def bound(stature: float) -> tuple[Description, Observer]:
        person = manikin.build(name=options.name, stature=stature, mass=options.mass, sex=options.sex)
        return person, observer(source, captured.layout, person, file=recording.name)[0]

    return marker_stature(captured, bound, name=options.name)
