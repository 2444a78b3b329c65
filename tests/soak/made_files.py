"""One small file of every format that is read, and who reads it."""

import gzip
import sys
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from motion_io import made_pictures
from seerob.app.emulation.mvn_person import animated
from seerob.app.emulators.vive import recorded, worn
from seerob.criteria.scoring.zones import read_zones
from seerob.description.capture.captured import Seen
from seerob.description.capture.mapping import read_conventions
from seerob.description.humans import keyframes
from seerob.devices.sources import bvh, mvnx
from seerob.files.motion_capture import (
    body_table,
    c3d,
    joint_angles,
    kinect_recording,
    ros_bag,
    storage,
    tracker_file,
    trc,
)
from seerob.files.motion_capture.frame_arrays import FAR
from seerob.files.motion_capture.kinect_recording import FEWEST, Reading
from seerob.files.motion_capture.markers import MarkerReading
from seerob.files.waypoints.reading import read_program
from seerob.protocols.tracking.kinect import LAYOUT
from soak.mutations import mutated, mutated_gzip, mutated_text, mutated_zip

sys.path.insert(0, str(Path(__file__).parents[1] / "sources"))

from made_mvnx import PERSON, Q
from made_mvnx import made as made_mvnx

MARKERS = MarkerReading(file="f")
NAMES = ("LFHD", "C7", "LASI", "LANK")
T = np.arange(6) / 60
VALUES = np.random.default_rng(0).normal(0, 0.03, (6, 4, 3))
VALUES[..., 2] += (1.7, 1.45, 0.95, 0.08)
KEYS = """
title = "k"
[[keyframes]]
t = 0.0
posture = "standing"
[[keyframes]]
t = 1.2
joints_deg = { right_shoulder_flexion = 60 }
position = [0.2, 0.0]
heading_deg = 30
"""
ZONES = """
title = "z"
[[rows]]
angle = "trunk_flexion"
high_deg = 20
score = 0
[[rows]]
angle = "trunk_flexion"
low_deg = 20
high_deg = 180
hold = 4.5
score = 2
"""
ZONE_ROWS = (
    ("angle", "from_deg", "to_deg", "score", "hold_s", "per_minute", "side"),
    ("trunk flexion", None, 20, 0, None, None, None),
    ("shoulder elevation", 20.5, 180, 2, 4, 2, "left"),
)
BVH = """HIERARCHY
ROOT Hips
{
  OFFSET 0.0 95.2 0.0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT Spine
  {
    OFFSET 0.0 12.5 0.0
    CHANNELS 3 Zrotation Yrotation Xrotation
    JOINT Head
    {
      OFFSET 0.0 48.0 2.5
      CHANNELS 3 Xrotation Yrotation Zrotation
      End Site
      {
        OFFSET 0.0 18.0 0.0
      }
    }
  }
  JOINT LeftUpLeg
  {
    OFFSET 10.0 0.0 0.0
    CHANNELS 3 Zrotation Xrotation Yrotation
    End Site
    {
      OFFSET 0.0 -84.0 0.0
    }
  }
}
MOTION
Frames: 2
Frame Time: 0.0333333
30.5 92.1 -20.0 1.5 -2.5 90.0 3.0 0.0 -4.0 10.0 0.0 0.5 -20.0 3.0 0.0
31.5 92.0 -19.0 1.0 -2.0 91.0 3.5 0.5 -4.5 11.0 1.0 0.0 -25.0 2.0 1.0
"""
SKELETON = """
[acme]
source = "a"
rest = "t_pose"
position = 0.5
axes = { x = "forward", y = "left", z = "up" }
names = { "{side}Foot" = "{side}_foot", pelvis = { bone = "pelvis", at = [0.1, 0.0, 0], orientation = 1.0 } }
"""
POINTS = """
[[waypoints]]
q_deg = [0, -90, 90, 0, 45.5, 0]
[[waypoints]]
q_deg = [9, 0, 1, 2, 3, 4]
pause = 0.5
"""
YAML = """
waypoints:
  - q_deg: [0, -90, 90, 0, 45.5, 0]
  - {q_deg: [1], pause: 0.5}
"""
SCRIPT = """def p():
  set_tcp(p[0, 0, 0.1, 0, 0, 0])
  a = d2r(45)
  movej([0, -1.57, a, 0, 0.5, 0], a=1.2, v=0.8, r=0.05)
  movel(p[0.4, -0.2, 0.5, 0, 3.14, 0], a=0.5, v=0.2)
  sleep(0.5)
end
"""
POLYSCOPE = """<URProgram name='p'><children><MainProgram><children>
<Move motionType="MoveJ" speed="0.8" acceleration="1.2"><children>
<Waypoint type="Fixed" name="a"><motionParameters/><position><JointAngles angles="0, -1.5, 1.5, 0, 0.5, 0"/>
</position></Waypoint></children></Move><Wait><waitTime>0.5</waitTime></Wait>
</children></MainProgram></children></URProgram>"""


@dataclass(frozen=True)
class Malformed:
    """A format: a small valid file, how it is broken, and what reads it."""

    suffix: str
    make: Callable[[Path], object]
    read: Callable[[Path], object]
    change: Callable[..., bytes] = mutated_text


def _lines(*rows, by=","):
    return "\n".join(by.join("" if cell is None else str(cell) for cell in row) for row in rows)


def _c3d(path):
    import ezc3d

    file = ezc3d.c3d()
    file["parameters"]["POINT"]["RATE"]["value"] = [60.0]
    file["parameters"]["POINT"]["UNITS"]["value"] = ["m"]
    file["parameters"]["POINT"]["LABELS"]["value"] = list(NAMES)
    file.add_parameter("POINT", "Y_SCREEN", ["+Z"])
    file["data"]["points"] = np.concatenate([VALUES.transpose(2, 1, 0), np.ones((1, 4, len(T)))])
    file.write(str(path))


def _kinect_text(path):
    """No more joints than a table has at least: a change then meets what decides more often."""
    head = ["t_ms", "body", *(f"{name}_{axis} [m]" for name in LAYOUT.names[:FEWEST] for axis in "xyz")]
    rows = (
        [p.frame * 33, 1, *p.bodies[0].positions[:FEWEST].ravel().round(4)] for p in made_pictures.pictures(2)
    )
    path.write_text(_lines(head, *rows))


def _marker_table(path):
    head = ["time [s]", *(f"{name}_{axis} [mm]" for name in NAMES for axis in "xyz")]
    rows = ([t, *row.ravel() * 1000] for t, row in zip(T, VALUES, strict=True))
    path.write_text(_lines(head, *rows, by=";"))


def _workbook(path, rows):
    """The least that a program for tables takes for a workbook: what is broken then is what matters."""
    office = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
    package = "http://schemas.openxmlformats.org/package/2006"
    sheet = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
    kind = "application/vnd.openxmlformats-officedocument.spreadsheetml"

    def cell(column, row, value):
        at = f'<c r="{chr(65 + column)}{row}"'
        if isinstance(value, str):
            return f'{at} t="inlineStr"><is><t>{value}</t></is></c>'
        return "" if value is None else f"{at}><v>{value}</v></c>"

    cells = "".join(
        f'<row r="{k}">{"".join(cell(c, k, value) for c, value in enumerate(row))}</row>'
        for k, row in enumerate(rows, start=1)
    )
    with zipfile.ZipFile(path, "w") as book:
        for name, text in {
            "[Content_Types].xml": f'<Types xmlns="{package}/content-types"><Default Extension="rels" '
            f'ContentType="application/vnd.openxmlformats-package.relationships+xml"/>'
            f'<Override PartName="/xl/workbook.xml" ContentType="{kind}.sheet.main+xml"/>'
            f'<Override PartName="/xl/worksheets/sheet1.xml" ContentType="{kind}.worksheet+xml"/></Types>',
            "_rels/.rels": f'<Relationships xmlns="{package}/relationships"><Relationship Id="rId1" '
            f'Type="{office}/officeDocument" Target="xl/workbook.xml"/></Relationships>',
            "xl/workbook.xml": f'<workbook xmlns="{sheet}" xmlns:r="{office}"><sheets>'
            '<sheet name="rules" sheetId="1" r:id="rId1"/></sheets></workbook>',
            "xl/_rels/workbook.xml.rels": f'<Relationships xmlns="{package}/relationships"><Relationship '
            f'Id="rId1" Type="{office}/worksheet" Target="worksheets/sheet1.xml"/></Relationships>',
            "xl/worksheets/sheet1.xml": f'<worksheet xmlns="{sheet}"><sheetData>{cells}</sheetData>'
            "</worksheet>",
        }.items():
            book.writestr(name, text)


def _said(value):
    return lambda path: path.write_text(value)


def sound(captured, far=3 * FAR):
    """What holds for whatever is read of a recording: instants go on, nothing is ``far`` off [m]."""
    frames = list(captured.frames)
    assert len(frames) == captured.count >= 1
    assert all(b.t > a.t for a, b in pairwise(frames))
    for frame in frames:
        assert not np.isinf(frame.positions).any()
        assert not (np.abs(frame.positions) > far).any()


def _trackers(path):
    for instant in tracker_file.read(path, file="r"):
        assert all(device.position.shape == (3,) for device in instant.devices)


def _write_trackers(path):
    tracker_file.write(path, recorded(worn(animated("library:reach")), duration=0.07, rate=30))


def _zones(path):
    rows = read_zones(path, "z").rows
    assert rows
    assert all(np.isfinite(row.score) for row in rows)


def _program(path):
    for waypoint in read_program(path, "w").waypoints:
        assert waypoint.q is None or np.isfinite(waypoint.q).all()


def _packed_zones(path):
    _workbook(path, ZONE_ROWS)


def _packed_points(path):
    rows = (("a", 0, -90, 90, 0, 45.5, 0, None), ("b", 9, 0, 1, 2, 3, 4, 0.5))
    _workbook(path, (("name", *(f"q{i + 1}_deg" for i in range(6)), "pause_s"), *rows))


FILES = {
    "bvh": Malformed("bvh", _said(BVH), lambda path: sound(bvh.read(path))),
    "mvnx": Malformed("mvnx", lambda path: made_mvnx(path, Q[:1]), lambda path: sound(mvnx.read(path), 1e4)),
    "c3d": Malformed("c3d", _c3d, lambda path: sound(c3d.read(path, MARKERS)), mutated),
    "trc": Malformed(
        "trc",
        lambda path: path.write_text("".join(trc.written(NAMES, T, VALUES))),
        lambda path: sound(trc.read(path, MARKERS)),
    ),
    "mot": Malformed(
        "mot",
        lambda path: path.write_text(
            "".join(storage.written(("knee_angle_r", "hip_flexion_l", "pelvis_ty"), T, VALUES[:, 0]))
        ),
        lambda path: joint_angles.from_storage(path, file="f"),
    ),
    "joint table": Malformed(
        "csv",
        _said("time [s],right_knee_flexion [deg]\n" + "".join(f"{t},{t}\n" for t in T)),
        lambda path: joint_angles.from_table(path, file="f"),
    ),
    "marker table": Malformed(
        "csv", _marker_table, lambda path: sound(body_table.read_person(path, MARKERS, seen=Seen.MARKERS))
    ),
    "kinect json": Malformed(
        "json",
        lambda path: path.write_text(made_pictures.offline_json(made_pictures.pictures(2))),
        lambda path: sound(kinect_recording.read_json(path, Reading("f"))),
    ),
    "kinect text": Malformed(
        "csv", _kinect_text, lambda path: sound(kinect_recording.read_text(path, Reading("f")))
    ),
    "kinect bag": Malformed(
        "bag",
        lambda path: made_pictures.bag(path, made_pictures.pictures(2)),
        lambda path: sound(ros_bag.read(path, Reading("f"))),
        mutated,
    ),
    "trackers jsonl": Malformed("jsonl", _write_trackers, _trackers),
    "trackers csv": Malformed("csv", _write_trackers, _trackers),
    "keyframes": Malformed(
        "toml", _said(KEYS), lambda path: keyframes.read(path.name, PERSON, folder=path.parent)
    ),
    "skeleton": Malformed("toml", _said(SKELETON), lambda path: read_conventions(path, "s")),
    "zones toml": Malformed("toml", _said(ZONES), _zones),
    "zones csv": Malformed("csv", _said(_lines(*ZONE_ROWS)), _zones),
    "zones xlsx": Malformed("xlsx", _packed_zones, _zones, mutated_zip),
    "waypoints script": Malformed("script", _said(SCRIPT), _program),
    "waypoints urp": Malformed(
        "urp", lambda path: path.write_bytes(gzip.compress(POLYSCOPE.encode())), _program, mutated_gzip
    ),
    "waypoints toml": Malformed("toml", _said(POINTS), _program),
    "waypoints yaml": Malformed(
        "yaml",
        _said(YAML),
        _program,
    ),
    "waypoints csv": Malformed(
        "csv", _said("name,q1_deg,q2_deg,q3_deg,pause_ms\na,0,-90,90,\nb,9,0,1,500\n"), _program
    ),
    "waypoints xlsx": Malformed("xlsx", _packed_points, _program, mutated_zip),
}
