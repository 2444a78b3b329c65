"""``seerob capture``: a recording of a person in; a twin that follows it, scores and tables out."""

from __future__ import annotations

import argparse
import json
import os
from pathlib import Path

from seerob.commands import line
from seerob.commands.measure import add_person, measured, person_table, reader
from seerob.errors import InputError
from seerob.workstation import FILE_NAME

HELP = "make a workstation of a recorded person, let the twin follow it, and export the motion and its scores"
EXAMPLE = "seerob capture bvh session.bvh --mass 72 --sex female -o my_session"

_TABLES = """
# Scores ask for what no posture shows (loads, support, repetition): give it in [[phases]].
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


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    add_person(sub)
    sub.add_argument("-o", "--output", type=Path, required=True, help="folder to make the workstation in")
    sub.add_argument("--json", action="store_true", help="results as JSON on standard output")


def run(options: argparse.Namespace) -> int:
    """Make the workstation, and assess it.

    Raises:
        InputError: The folder exists, or the recording or the person cannot be used.
    """
    from seerob.commands import assess

    if options.output.exists():
        raise InputError.at(options.output, "", "exists already", "give another folder with -o")
    recording = Path(options.file)
    table = _person(options, recording)
    source = [f"kind = {_quoted(options.kind)}", f"human = {_quoted(options.name)}"]
    source.append(f"file = {_quoted(_path(recording, options.output))}")
    if options.subject:
        source.append(f"subject = {_quoted(options.subject)}")
    source += [" = ".join(map(str.strip, text.split("=", 1))) for text in options.set]
    text = "\n".join(
        [f"title = {_quoted(recording.stem)}", "", table, "", "[[sources]]", *source, ""]
    ) + _TABLES.format(human=_quoted(options.name))
    try:
        options.output.mkdir(parents=True)
        (options.output / FILE_NAME).write_text(text, encoding="utf-8")
    except OSError as error:
        what = f"cannot be made: {error.strerror}"
        raise InputError.at(options.output, "", what, "give a folder that may be written") from error
    if not options.json:
        line("wrote", str(options.output / FILE_NAME))
    # By its own parser: it knows its options and their defaults.
    same = argparse.ArgumentParser()
    assess.add(same)
    return assess.run(same.parse_args([str(options.output), *(["--json"] if options.json else [])]))


def _person(options: argparse.Namespace, recording: Path) -> str:
    """The person as it was measured; of markers, which show no joint centres, as the tables have it."""
    source = reader(options)
    source.read(recording)  # what is wrong with it is said first
    try:
        found, findings = measured(source, recording, options)
    except InputError as error:
        if options.stature is None or not any(p.key == "morphology" for p in error.problems):
            raise
        if not options.json:
            text = (
                f"the bones of {options.name} are not measured ({error.problems[0].what}): usual proportions"
            )
            line("assumed", text, "yellow")
        return person_table(options, options.stature, {})
    if not options.json:
        for finding in (*findings, *found.findings):
            line(finding.level, finding.text, "" if finding.level == "note" else "yellow")
    return person_table(options, found.stature, found.lengths)


def _path(recording: Path, folder: Path) -> str:
    try:
        return os.path.relpath(recording, folder).replace(os.sep, "/")
    except ValueError:  # another drive
        return str(recording.resolve())


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)
