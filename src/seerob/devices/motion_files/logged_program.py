"""Logs of motions as programs of waypoints: RoboDK's joint lists and KUKA's DataRecorder."""

from __future__ import annotations

import re
from pathlib import Path

from seerob.core.errors import InputError
from seerob.core.plugin import load
from seerob.devices.motion_files.trajectory_file import TrajectoryFile
from seerob.files.waypoints.reduction import reduced
from seerob.files.waypoints.waypoint import Program
from seerob.workstation.source import Target

HEAD = 16 << 10
"""Of a file in which its header is looked for [bytes]."""


def log_kind(path: Path) -> str | None:
    """The kind of source that plays a file, told by its header; None for what is no log."""
    if path.suffix.lower() not in (".log", ".csv", ".tsv", ".txt") or not path.is_file():
        return None
    with path.open("rb") as file:
        head = file.read(HEAD).decode("latin-1")
    if "ZeitInSec" in head:
        return "kuka_log"
    lines = (set(re.split(r"[^A-Z0-9_]+", line.upper())) for line in head.splitlines()[:20])
    return "robodk" if any({"J1", "ERROR"} <= words for words in lines) else None


def logged_program(kind: str, path: Path, file: str, robot: str, tolerance: float | None) -> Program:
    """The waypoints that a log is reduced to.

    Args:
        kind: What `log_kind` says.
        path: The file.
        file: Its name, for messages.
        robot: The robot that it is to drive.
        tolerance: See `reduced`.

    Raises:
        InputError: The log is wrong, or nobody gave a tolerance.
    """
    if tolerance is None:
        what = "is a log of a motion: how far waypoints may leave it, nobody said"
        remedy = f'give tolerance [rad or m], or play it as it is with kind = "{kind}"'
        raise InputError.at(file, "tolerance", what, remedy)
    log = load("sources", kind, TrajectoryFile)
    motion, findings = log(robot=robot, file=file).read(path, Target(name=robot))
    program = reduced(motion, tolerance)
    return Program(file, program.waypoints, (*(f.text for f in findings), *program.remarks))
