"""``seerob measure``: the size of a recorded person, as a table for the workstation file."""

from __future__ import annotations

import argparse
from pathlib import Path

from seerob.commands import OUT, Exit, line
from seerob.errors import InputError

HELP = "measure the bones of a recorded person (depth camera, skeleton file) for [[humans]]"
EXAMPLE = "seerob measure kinect_recording session.json --mass 72 --sex female"


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    sub.add_argument("kind", help="kind of source that reads the file, such as kinect_recording or bvh")
    sub.add_argument("file", help="the recording")
    sub.add_argument("--mass", type=float, required=True, help="body mass [kg]")
    sub.add_argument("--sex", choices=("male", "female"), required=True)
    sub.add_argument("--stature", type=float, help="[m]; estimated from the lengths when not given")
    sub.add_argument("--name", default="operator", help="of the person")
    sub.add_argument("--subject", default="", help="which person of the recording")


def run(options: argparse.Namespace) -> int:
    """Measure, tell, and print the table."""
    from seerob.human import manikin
    from seerob.human.morphology import measure
    from seerob.plugin import load
    from seerob.source import Source
    from seerob.sources._capture_file import CaptureFile
    from seerob.sources._capture_options import observer

    kind = load("sources", options.kind, Source)
    if not issubclass(kind, CaptureFile):
        what = f"{options.kind} reads no recording of a person"
        raise InputError.at("seerob measure", "kind", what, "see: seerob kinds sources")
    path = Path(options.file)
    source = kind(human=options.name, file=path.name, subject=options.subject)
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
    for finding in (*captured.findings, *findings, *found.findings):
        line(finding.level, finding.text, "" if finding.level == "note" else "yellow")
    shown = ", ".join(f"{key} = {value:.4f}" for key, value in found.lengths.items())
    table = (
        f'[[humans]]\nname = "{options.name}"\nstature = {found.stature:.4f}\nmass = {options.mass:g}\n'
        f'sex = "{options.sex}"\nlengths = {{ {shown} }}'
    )
    OUT.print(table, markup=False, soft_wrap=True)
    return Exit.WITHIN
