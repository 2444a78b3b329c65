"""A sensible cell, and what of it is implausible once it is changed: ``from made_sensible import …``."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from seerob.core.snapshot import Finding, Verdict
from seerob.session.station import Station, load

CELL = {
    "base": "position = [0, 0, 0.75]",
    "tool": "shape = { box = [0.08, 0.1, 0.12] }\nmass = 1.2",
    "at": "at = { position = [1.75, 0, 0], rpy_deg = [0, 0, 180] }",
    "stop": "reaction = 0.1, stopping = 0.35",
    "separation": "human_speed = 1.6",
    "limit": "limit = 1.0",
    "table": "at = { position = [0.8, 0, 0.37] }",
    "more": "",
    "person": "stature = 1.75\nmass = 75",
}


def cell(**changed: str) -> str:
    """A sensible cell whose three criteria are within, but for what is changed."""
    c = CELL | changed
    return f"""
[[robots]]
name = "ur5"
model = "library:ur5"
base = {{ {c["base"]} }}
q_deg = [180, -90, -90, -90, 90, 0]
[[tools]]
name = "gripper"
on = "ur5/tool0"
{c["tool"]}
[[parts]]
name = "table"
shape = {{ box = [0.8, 1.4, 0.74] }}
{c["table"]}
[[humans]]
name = "operator"
sex = "male"
{c["person"]}
{c["at"]}
[[safety]]
kind = "velocity"
name = "speed"
at = "ur5"
{c["limit"]}
[[safety]]
kind = "minimum_distance"
name = "distance"
between = ["ur5", "operator"]
limit = 0.2
[[safety]]
kind = "separation"
name = "separation"
between = ["ur5", "operator"]
stop = {{ {c["stop"]} }}
{c["separation"]}
intrusion = 0.0
human_uncertainty = 0.05
robot_uncertainty = 0.005
{c["more"]}
"""


STANDS = np.radians([180, -90, -90, -90, 90, 0]), np.zeros(6)
"""Its robot, heard."""


def station_of(folder: Path, text: str) -> Station:
    """The workstation of a text."""
    (folder / "workstation.toml").write_text(text)
    return load(folder, allow_plugins=True)


def doubted(station: Station) -> list[Finding]:
    """What is implausible of it."""
    return [f for f in station.model.findings if "not plausible" in f.text]


def verdicts(station: Station) -> dict[str, Verdict | None]:
    """At the first tick."""
    from seerob.session.run import Judge, bind
    from seerob.twin.engine import Engine as Twin

    return {r.name: r.verdict for r in Judge(bind(station.model))(Twin(station.model).start())}
