"""Cameras of a workstation file: lens and pose as a page is told, or why they are not known."""

import numpy as np
import pytest

import seerob as sr
from seerob.app.commands.calibrate import _carried
from seerob.core.errors import InputError
from seerob.core.transforms import rotation_from_wxyz, transform
from seerob.description.camera import lens
from seerob.session.inspection import inspected

LENS = "[camera]\nwidth = 640\nheight = 480\nfx = 500\nfy = 501\ncx = 320\ncy = 240\n"
POSE = 'position = [0, 0, 2]\nwxyz = [0, 1, 0, 0]\nerror_px = 0.2\ntool = "arm"\n'
CELL = """
[[parts]]
name = "table"
shape = { box = [1, 1, 0.1] }
at = { position = [1, 0, 0.5] }
"""


def told(folder, file, entry="", **more):
    (folder / "camera.toml").write_text(file)
    more = "".join(f"{key} = {value!r}\n" for key, value in more.items())
    (folder / "workstation.toml").write_text(
        f'{CELL}[[cameras]]\nname = "shelf"\ncalibration = "camera.toml"\n{entry}{more}'
    )
    return sr.load(folder).scene().cameras[0]


def test_lens_pose_and_error_are_those_of_the_file(tmp_path):
    found = told(tmp_path, f"{LENS}{POSE}error = 0.004\n")
    assert (found.size, found.lens[:4], found.fetched, found.mistake) == (
        (640, 480),
        (500, 501, 320, 240),
        False,
        "",
    )
    assert (found.place.node, found.place.position, found.place.wxyz) == ("", (0, 0, 2), (0, 1, 0, 0))
    assert (found.error, found.tool) == (0.004, "arm")


@pytest.mark.parametrize(
    ("file", "why"),
    [
        (LENS, "where it stands is not known"),
        (LENS + POSE, "where it stands is not known"),
        (f"{LENS}{POSE}error = 0.0501\n", "off by 50 mm at arm, more than 50 mm"),
        (f"{LENS}{POSE}error = inf\n", "off by inf"),
        (f"{LENS}{POSE}error = nan\n", "where it stands is not known"),
    ],
)
def test_a_pose_that_is_missing_or_bad_is_said(tmp_path, file, why):
    assert why in told(tmp_path, file).mistake


def test_the_limit_is_of_the_file(tmp_path):
    file = f"{LENS}{POSE}error = 0.06\n"
    assert told(tmp_path, file).mistake
    assert not told(tmp_path, file, limit=0.07).mistake


def test_a_camera_that_is_carried_is_told_in_the_frame_of_what_carries_it(tmp_path):
    found = told(tmp_path, f'{LENS}{POSE}error = 0.004\non = "table"\n')
    assert found.place.node == "table"
    np.testing.assert_allclose(found.place.position, (0, 0, 2), atol=1e-12)
    camera = lens.read(tmp_path / "camera.toml")
    rng = np.random.default_rng(4)
    q = rng.normal(size=4)
    carrier = transform(rotation_from_wxyz(q / np.linalg.norm(q)), rng.normal(size=3))
    carried = _carried(camera, carrier, "table")
    np.testing.assert_allclose(carrier @ carried.world_from_camera, camera.world_from_camera, atol=1e-12)
    assert _carried(camera, carrier, None) == camera


@pytest.mark.parametrize(
    ("file", "entry", "what"),
    [
        ("[lens]\n", "", "cameras\\[0\\].calibration"),
        (f'{LENS}{POSE}error = 0.004\non = "cat"\n', "", "cameras\\[0\\].calibration.*table"),
        (LENS, "record = true\n", "give address, too"),
        (LENS, 'address = "rtsp://127.0.0.1/a"\n', "no http://HOST:PORT/PATH"),
        (LENS, 'address = "http://me:secret@127.0.0.1/a"\n', "without a login"),
    ],
)
def test_what_cannot_be_is_refused_with_its_key(tmp_path, file, entry, what):
    with pytest.raises(InputError, match=what):
        told(tmp_path, file, entry)


def test_inspect_tells_whom_a_run_would_fetch_pictures_from(tmp_path):
    told(tmp_path, LENS, 'address = "http://192.0.2.7/a"\n')
    said = [fact.what for fact in inspected(tmp_path) if fact.does == "connects"]
    assert said == ["run: cameras[0] fetches pictures from http://192.0.2.7/a, only with run --allow-camera"]
