"""What a plug-in of your own is made from: criteria, rules, sources, sinks, and what they give.

Names here stay; where they live inside may change. A plug-in imports nothing else of seerob.
docs/extending.md has a tutorial per kind.
"""

from typing import Final

from seerob.core.errors import InputError, SeerobError, Undecided, UnknownName
from seerob.core.markers import (
    Arrow,
    Box,
    Ellipsoid,
    Highlight,
    Hull,
    Label,
    Marker,
    Polyline,
    Prism,
    Rays,
    Segment,
    Sphere,
    plain,
)
from seerob.core.samples import BodySample, JointSample, PoseSample, Quality, Sample, SignalSample
from seerob.core.snapshot import Basis, Finding, Input, Origin, Result, Row, Scene, Snapshot
from seerob.core.verdict import Verdict, judge, judge_interval, worst
from seerob.criteria.criterion import Criterion, Evaluate, EvaluateMany
from seerob.criteria.figure import Compute, Figure, Parts, Present, Shown, Twin
from seerob.criteria.scoring.phases import Phase, phase_at, shared_phases
from seerob.criteria.scoring.rule import PostureRule as Rule
from seerob.criteria.scoring.rule import bind_posture
from seerob.criteria.scoring.spans import Span, between, beyond, exactly
from seerob.devices.live.listening import LiveSource
from seerob.model.model import Model
from seerob.outputs.sink import Closing, Sink, Writer
from seerob.outputs.tables.growing_table import no_formula
from seerob.recording.answers import Answers
from seerob.twin.spans import Falls, Points, approaching
from seerob.twin.state import State
from seerob.twin.states import States
from seerob.workstation.source import Opened, Source, Target

VERSION: Final = 1
"""Goes up when a name here is taken away or means something else; a new name leaves it as it is."""

__all__ = [
    "VERSION",
    "Answers",
    "Arrow",
    "Basis",
    "BodySample",
    "Box",
    "Closing",
    "Compute",
    "Criterion",
    "Ellipsoid",
    "Evaluate",
    "EvaluateMany",
    "Falls",
    "Figure",
    "Finding",
    "Highlight",
    "Hull",
    "Input",
    "InputError",
    "JointSample",
    "Label",
    "LiveSource",
    "Marker",
    "Model",
    "Opened",
    "Origin",
    "Parts",
    "Phase",
    "Points",
    "Polyline",
    "PoseSample",
    "Present",
    "Prism",
    "Quality",
    "Rays",
    "Result",
    "Row",
    "Rule",
    "Sample",
    "Scene",
    "SeerobError",
    "Segment",
    "Shown",
    "SignalSample",
    "Sink",
    "Snapshot",
    "Source",
    "Span",
    "Sphere",
    "State",
    "States",
    "Target",
    "Twin",
    "Undecided",
    "UnknownName",
    "Verdict",
    "Writer",
    "approaching",
    "between",
    "beyond",
    "bind_posture",
    "exactly",
    "judge",
    "judge_interval",
    "no_formula",
    "phase_at",
    "plain",
    "shared_phases",
    "worst",
]
