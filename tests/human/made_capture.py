"""A person who walks, as a device would see it, and workstations around it."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
from msgspec.structs import replace

from seerob.core.transforms import wxyz_from_rotation
from seerob.description.capture.captured import Captured, CaptureFrame, Layout, Seen
from seerob.description.humans import keyframes, manikin
from seerob.description.humans.skeleton import BONES, bone_poses
from seerob.devices.capture.file_source import CaptureFile
from seerob.session import run as road
from seerob.session.reading import convert_workstation
from seerob.session.station import Station
from seerob.twin.engine import Engine
from seerob.workstation.workstation import Workstation

PERSON = manikin.build(name="operator", stature=1.75, mass=75, sex="male")
TABLE = {"name": "operator", "stature": 1.75, "mass": 75.0, "sex": "male"}
RATE = 60.0


@cache
def walking(seconds: float = 1.5) -> tuple[np.ndarray, np.ndarray]:
    """Times [s] (n,) and joint values (n, 53) of a walk."""
    played = keyframes.read("library:walk", PERSON, folder=Path())
    sampled = keyframes.sample(played, PERSON, RATE)
    n = round(seconds * RATE)
    return sampled.t[:n], sampled.q[:n]


def frames_of(t: np.ndarray, q: np.ndarray, *, turned: bool = True) -> list[CaptureFrame]:
    """What a device that sees every bone would say; its clock began long ago."""
    R, p = bone_poses(PERSON, q)
    wxyz = [np.array([wxyz_from_rotation(r) for r in each]) for each in R] if turned else [None] * len(t)
    return [CaptureFrame(t=s + 7.0, positions=p[i].copy(), orientations=wxyz[i]) for i, s in enumerate(t)]


def captured(frames: list[CaptureFrame], **more: object) -> Captured:
    """A recording of all bones in our own names and frames."""
    layout = Layout(Seen.SEGMENTS, BONES, "seerob")
    return Captured(layout, frames, RATE, len(frames), **more)  # type: ignore[arg-type]


class Made(CaptureFile, frozen=True, kw_only=True):
    """A source that reads nothing: ``made`` is what its file holds."""

    made: Callable[[], Captured]

    def read(self, path: Path) -> Captured:
        return self.made()


def source(recording: Captured, **options: object) -> Made:
    given = {"human": "operator", "file": "made", "name": "device", **options}
    return Made(made=lambda: recording, **given)  # type: ignore[arg-type]


def workstation(
    *sources: CaptureFile, person: dict[str, object] | None = None, **tables: object
) -> Workstation:
    """One person, with more of the table in ``person``, and what ``tables`` add."""
    made, problems = convert_workstation({"humans": [TABLE | (person or {})], **tables}, "made.toml")
    assert made is not None, problems
    return replace(made, sources=sources, folder=".")


Played = tuple[float, str, dict[str, tuple[float | None, float | None]], float, np.ndarray]


def play(*sources: CaptureFile, **tables: object) -> list[Played]:
    """Tick by tick: time, doubt, errors per bone, largest joint speed, positions of the joints."""
    station = Station(workstation(*sources, **tables))
    engine = Engine(station.model, driven={"operator": 0.2})
    mechanism = station.model.mechanisms["operator"]
    told = []
    for seq, samples in enumerate(road.pump(station.sources, 0.01)):
        engine.take(samples)
        state = engine.tick() if seq else engine.start()
        hearing = state.hearings["operator"]
        speed = float(np.abs(state.data.qvel[mechanism.v_address]).max())
        q = state.joint_positions(mechanism).copy()
        told.append((state.t, state.invalid_reason("operator"), dict(hearing.bones), speed, q))
    return told
