"""An emulated camera: where OpenCV finds things in its picture, against where OpenCV projects them to."""

from __future__ import annotations

import time
from http.client import HTTPConnection
from itertools import islice
from pathlib import Path

import cv2
import numpy as np
import pytest

from seerob.app.commands.emulate import options_of
from seerob.app.emulation.seen_cell import Photographer
from seerob.app.emulation.serving import served
from seerob.app.emulators.camera import named
from seerob.core.errors import InputError
from seerob.core.transforms import rotation_from_rpy, transform, wxyz_from_rotation
from seerob.description.description import base_from_links
from seerob.description.robots import library
from seerob.devices.live.camera_pictures import CameraPictures, Picture
from seerob.protocols.links.mjpeg import boundary, pictures, size_of

CELLS = Path(__file__).parents[2] / "workstations"
SIZE = (480, 320)
K = np.array([[390.0, 0, 251.0], [0, 386.0, 149.0], [0, 0, 1]])
DISTORTION = np.array([-0.24, 0.07, 2e-3, -1.5e-3, 0.0])
EYE = np.array([0.1, -1.9, 1.6])
ROUND = 4.0
SQUARE, ACROSS, DOWN = 0.12, 7, 5


def camera_turn():
    """World from camera: at the middle of the board and the robot, and a little rolled."""
    forward = np.array([0.1, 0.3, 0.7]) - EYE
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, (0.05, 0, 1))
    right /= np.linalg.norm(right)
    return np.column_stack([right, np.cross(forward, right), forward])


def by_opencv(points):
    """Where points of the cell are in a picture [px]."""
    R = camera_turn().T
    found, _ = cv2.projectPoints(np.asarray(points, float), cv2.Rodrigues(R)[0], -R @ EYE, K, DISTORTION)
    return found.reshape(-1, 2)


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    """A board of squares on a table and a robot with a red ball, of which an emulated controller tells."""
    folder = tmp_path_factory.mktemp("seen")
    lens = f"fx = {K[0, 0]}\nfy = {K[1, 1]}\ncx = {K[0, 2]}\ncy = {K[1, 2]}\n"
    (folder / "lens.toml").write_text(
        f"[camera]\nwidth = {SIZE[0]}\nheight = {SIZE[1]}\n{lens}distortion = {DISTORTION.tolist()}\n"
        f"position = {EYE.tolist()}\nwxyz = {wxyz_from_rotation(camera_turn()).tolist()}\nerror = 0.004\n"
    )
    (folder / "motion.toml").write_text(
        "[[waypoints]]\nq_deg = [20, -70, 80, -100, -90, 0]\npause = 0.5\n"
        "[[waypoints]]\nq_deg = [45, -75, 85, -100, -90, 0]\npause = 9\n"
    )
    text = """
[[robots]]
name = "ur10"
model = "library:ur10"
base = { position = [-0.6, 0.7, 0.3], rpy_deg = [0, 0, -90] }
[[tools]]
name = "ball"
shape = { sphere = 0.05 }
color = [1, 0, 0]
on = "ur10/tool0"
at = { position = [0, 0, 0.05] }
[[sources]]
kind = "rtde"
robot = "ur10"
host = "127.0.0.1"
[[cameras]]
name = "over_it"
calibration = "lens.toml"
address = "http://127.0.0.1:8081/"
[[emulators]]
kind = "rtde"
robot = "ur10"
waypoints = "motion.toml"
in_step = 4.0
[[areas]]
name = "before_it"
shape = { box = [3, 0.1, 3] }
at = { position = [0, -1, 1] }
"""
    for i in range(ACROSS):
        for j in range(DOWN):
            at = [SQUARE * (i - (ACROSS - 1) / 2) + 0.3, SQUARE * (j - (DOWN - 1) / 2), 0.295]
            color = [0.02] * 3 if (i + j) % 2 else [0.95] * 3
            text += f'[[parts]]\nname = "square_{i}_{j}"\nshape = {{ box = [{SQUARE}, {SQUARE}, 0.01] }}\n'
            text += f"color = {color}\nat = {{ position = {at} }}\n"
    (folder / "workstation.toml").write_text(text)
    return folder


@pytest.fixture(scope="module")
def photographer(cell):
    return Photographer(*named(cell / "workstation.toml", "over_it"))


def test_corners_of_a_board_are_found_where_opencv_projects_them(photographer):
    grey = cv2.cvtColor(photographer.picture(0.0), cv2.COLOR_RGB2GRAY)
    ok, corners = cv2.findChessboardCornersSB(grey, (ACROSS - 1, DOWN - 1), cv2.CALIB_CB_EXHAUSTIVE)
    assert ok
    middles = np.array(
        [
            (SQUARE * (i - (ACROSS - 2) / 2) + 0.3, SQUARE * (j - (DOWN - 2) / 2), 0.3)
            for j in range(DOWN - 1)
            for i in range(ACROSS - 1)
        ]
    )
    found, wanted = corners.reshape(-1, 2), by_opencv(middles)
    off = np.linalg.norm(found[:, None] - wanted, axis=-1).min(axis=0)
    assert off.max() < 0.6


def red_ball(pixels):
    """Middle of what is red [px], and how much there is; None where nothing is."""
    red, green, blue = np.moveaxis(pixels.astype(int), -1, 0)
    rows, columns = np.nonzero((red > 90) & (red > 2 * green) & (red > 2 * blue))
    return (np.array([columns.mean(), rows.mean()]) if len(rows) else None), len(rows)


def projected_ball(*q_deg):
    """Where the ball is in the picture, of joint angles [deg], by the description of the arm."""
    arm = library.load("ur10")
    world_from_base = transform(rotation_from_rpy((0, 0, np.radians(-90))), (-0.6, 0.7, 0.3))
    q = dict(zip([joint.name for joint in arm.joints()], np.radians(q_deg), strict=True))
    ball = world_from_base @ base_from_links(arm, q)["tool0"] @ (0, 0, 0.05, 1)
    return by_opencv([ball[:3]])[0]


STANDS_AT = {0.1: (20, -70, 80, -100, -90, 0), 3.9: (45, -75, 85, -100, -90, 0)}
"""Where the robot stands at times of a round [s], by its waypoints."""


def test_the_robot_is_where_its_waypoints_have_it_at_that_time_of_the_clock(photographer):
    places = []
    for t, q_deg in STANDS_AT.items():
        place, area = red_ball(photographer.picture(1000 * ROUND + t))
        assert area > 100
        assert np.linalg.norm(place - projected_ball(*q_deg)) < 2.0
        places.append(place)
    assert np.linalg.norm(places[1] - places[0]) > 20


def test_what_does_not_exist_is_not_in_the_picture_and_who_is_lost_is_named(cell, photographer, tmp_path):
    seen = dict(
        zip([node.name for node in photographer.cell.scene.nodes], photographer.cell.seen, strict=True)
    )
    assert not seen["before_it"]
    assert seen["square_0_0"]
    assert photographer.cell.unknown == ()
    text = (cell / "workstation.toml").read_text()
    for file in ("lens.toml", "motion.toml"):
        (tmp_path / file).write_bytes((cell / file).read_bytes())
    (tmp_path / "workstation.toml").write_text(text.replace("in_step = 4.0\n", ""))
    lost = Photographer(*named(tmp_path / "workstation.toml", ""))
    assert lost.cell.unknown == ("ur10",)
    assert red_ball(lost.picture(0.0))[1] == 0


def test_a_run_fetches_its_pictures_and_they_show_the_present(cell):
    asked = options_of("camera", ["--cell", str(cell), "--port", "0", "--rate", "20"])
    with served("camera", asked) as camera:
        address = f"http://127.0.0.1:{camera.ports['port']}/"
        with CameraPictures(address, SIZE) as fetched:
            newest = fetched.newest()
            while not isinstance(newest, Picture):
                time.sleep(0.02)
                newest = fetched.newest()
        decoded = cv2.imdecode(np.frombuffer(newest.jpeg, np.uint8), cv2.IMREAD_COLOR)[..., ::-1]
        place, _ = red_ball(decoded)
        assert min(np.linalg.norm(place - projected_ball(*q)) for q in STANDS_AT.values()) < 200
        connection = HTTPConnection("127.0.0.1", camera.ports["port"], timeout=60)
        connection.request("GET", "/anything")
        answer = connection.getresponse()
        each = pictures(answer, boundary(answer.getheader("Content-Type")))
        assert [size_of(jpeg) for jpeg in islice(each, 3)] == [SIZE] * 3
        connection.close()


def test_what_it_cannot_see_is_refused(cell, tmp_path):
    (tmp_path / "workstation.toml").write_text('title = "none"\n')
    with pytest.raises(InputError, match=r"cameras"):
        options_of("camera", ["--cell", str(tmp_path)]).ready()
    lens = (cell / "lens.toml").read_text()
    (tmp_path / "lens.toml").write_text(lens.replace("error = 0.004\n", ""))
    text = '[[cameras]]\nname = "a"\ncalibration = "lens.toml"\n'
    (tmp_path / "workstation.toml").write_text(text)
    with pytest.raises(InputError, match="nothing of where the camera stands"):
        options_of("camera", ["--cell", str(tmp_path)]).ready()
    (tmp_path / "lens.toml").write_text(lens.replace(str(DISTORTION[0]), "9.0"))
    with pytest.raises(InputError, match="too strong"):
        Photographer(*named(tmp_path / "workstation.toml", ""))


@pytest.mark.parametrize("name", ["motor_station", "assembly_line"])
def test_cells_of_the_paper_say_where_their_pictures_come_from_and_everybody_in_them_keeps_step(name):
    station, number = named(CELLS / name, "")
    (emulator,) = (e for e in station.emulators if hasattr(e, "cell"))
    assert station.cameras[number].address == f"http://127.0.0.1:{emulator.port}/"
    photographer = Photographer(station, number)
    assert photographer.cell.unknown == ()
    assert not photographer.cell.info.mistake
    roles = {
        node.role
        for node, seen in zip(photographer.cell.scene.nodes, photographer.cell.seen, strict=True)
        if seen
    }
    assert {"robot", "human", "tool", "part"} <= roles
