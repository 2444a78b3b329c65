"""Any bytes may be given to a reader of captured motion: it reads them, or says what is wrong."""

import random
from functools import cache
from itertools import pairwise

import ezc3d
import numpy as np
import pytest
from test_mutated_recordings import mutated

from motion_io import made_pictures
from seerob.emulators.kinect_person import animated
from seerob.errors import InputError
from seerob.human.captured import Seen
from seerob.motion_io import body_csv, c3d, joint_angles, kinect_bag, kinect_json, kinect_text, storage, trc
from seerob.motion_io.frame_arrays import FAR
from seerob.motion_io.kinect_recording import Reading
from seerob.motion_io.markers import MarkerReading
from seerob.protocols import ProtocolError
from seerob.protocols.kinect import LAYOUT, decode_message, encode_message

MARKERS = MarkerReading(file="f")
NAMES = ("LFHD", "C7", "LASI", "LANK")
T = np.arange(10) / 60
VALUES = np.random.default_rng(0).normal(0, 0.03, (10, 4, 3))
VALUES[..., 2] += (1.7, 1.45, 0.95, 0.08)


def a_json(path):
    path.write_text(made_pictures.offline_json(made_pictures.pictures(4)))


def a_bag(path):
    made_pictures.bag(path, made_pictures.pictures(4))


def a_text(path):
    head = ["t_ms", "body", *(f"{name}_{axis} [m]" for name in LAYOUT.names for axis in "xyz")]
    rows = [
        [str(p.frame * 33), "1", *map(str, p.bodies[0].positions.ravel())] for p in made_pictures.pictures(4)
    ]
    path.write_text("\n".join(map(",".join, [head, *rows])))


def a_table(path):
    head = ["time [s]", *(f"{name}_{axis} [mm]" for name in NAMES for axis in "xyz")]
    rows = [[str(t), *map(str, row.ravel() * 1000)] for t, row in zip(T, VALUES, strict=True)]
    path.write_text("\n".join(map(";".join, [head, *rows])))


def a_c3d(path):
    file = ezc3d.c3d()
    file["parameters"]["POINT"]["RATE"]["value"] = [60.0]
    file["parameters"]["POINT"]["UNITS"]["value"] = ["m"]
    file["parameters"]["POINT"]["LABELS"]["value"] = list(NAMES)
    file.add_parameter("POINT", "Y_SCREEN", ["+Z"])
    file["data"]["points"] = np.concatenate([VALUES.transpose(2, 1, 0), np.ones((1, 4, 10))])
    file.write(str(path))


def a_trc(path):
    path.write_text("".join(trc.written(NAMES, T, VALUES)))


def a_mot(path):
    labels = ("knee_angle_r", "hip_flexion_l", "pelvis_ty")
    path.write_text("".join(storage.written(labels, T, VALUES[:, 0])))


def a_joint_table(path):
    path.write_text("time [s],right_knee_flexion [deg]\n" + "".join(f"{t},{t}\n" for t in T))


DECODERS = {
    "json": (a_json, lambda path: kinect_json.read(path, Reading("f"))),
    "bag": (a_bag, lambda path: kinect_bag.read(path, Reading("f"))),
    "text": (a_text, lambda path: kinect_text.read(path, Reading("f"))),
    "table": (a_table, lambda path: body_csv.read(path, MARKERS, seen=Seen.MARKERS)),
    "c3d": (a_c3d, lambda path: c3d.read(path, MARKERS)),
    "trc": (a_trc, lambda path: trc.read(path, MARKERS)),
    "mot": (a_mot, lambda path: joint_angles.from_storage(path, file="f")),
    "joints": (a_joint_table, lambda path: joint_angles.from_table(path, file="f")),
}
SHORT_AND_LONG = [pytest.param(50, id="short"), pytest.param(100_000, id="long", marks=pytest.mark.soak)]


@pytest.mark.parametrize("files", SHORT_AND_LONG)
@pytest.mark.parametrize("kind", DECODERS)
def test_mutated_files_are_read_or_refused(tmp_path, kind, files):
    make, read = DECODERS[kind]
    path = tmp_path / f"f.{kind}"
    make(path)
    read(path)
    whole = path.read_bytes()
    rng = random.Random(7)
    refused = 0
    for _ in range(files):
        path.write_bytes(mutated(whole, rng))
        try:
            captured = read(path)
        except InputError:
            refused += 1
            continue
        if kind in ("mot", "joints"):
            continue  # what is not finite there the source leaves out
        frames = list(captured.frames)
        assert len(frames) == captured.count >= 2
        assert all(b.t > a.t for a, b in pairwise(frames))
        assert not any((np.abs(f.positions) > 3 * FAR).any() for f in frames)
    assert refused > 0


@cache
def message():
    return encode_message(animated("library:reach")(0.0))


@pytest.mark.parametrize(
    "count", [pytest.param(2000, id="short"), pytest.param(100_000, id="long", marks=pytest.mark.soak)]
)
def test_mutated_messages_are_read_or_refused(count):
    rng = random.Random(3)
    refused = 0
    for _ in range(count):
        try:
            picture = decode_message(mutated(message(), rng))
        except ProtocolError:
            refused += 1
            continue
        assert np.isfinite(picture.t)
        assert all(body.positions.shape == (32, 3) for body in picture.bodies)
    assert 0 < refused < count
