"""Cameras: boards that are rendered as a lens with distortion sees them, against where they truly are."""

import re

import numpy as np
import pytest

cv2 = pytest.importorskip("cv2")

from seerob.core.errors import InputError  # noqa: E402
from seerob.core.transforms import inverse, transform  # noqa: E402
from seerob.description.camera import board as boards  # noqa: E402
from seerob.description.camera import calibration  # noqa: E402
from seerob.description.camera.lens import Camera, project, seen  # noqa: E402
from seerob.description.capture.registration import turn  # noqa: E402

BOARD = boards.read("charuco 8x6 60 45")
SIZE = (960, 540)
LENS = np.array([720.0, 716.0, 489.0, 262.0, -0.12, 0.05, 8e-4, -5e-4, 0.0])
CELL_FROM_BOARD = transform(turn(np.array([0.0, 0.0, 0.5])), [0.8, 0.2, 0.75])
TOOL = np.array([0.9, 0.3, 1.1])
DOTS = 1500.0
"""Of the print [px/m]."""


def drawn():
    """The print of the board's own file, as a picture."""
    edge = boards.MARGIN / 1e3
    width, height = (round(DOTS * (n * BOARD.square + 2 * edge)) for n in (BOARD.across, BOARD.up))
    picture = np.full((height, width), 255, np.uint8)
    for found in re.finditer(
        r'<rect x="([\d.]+)" y="([\d.]+)" width="([\d.]+)" height="([\d.]+)"', boards.svg(BOARD)
    ):
        x, y, w, h = (round(float(v) / 1e3 * DOTS) for v in found.groups())
        picture[y : y + h, x : x + w] = 0
    return cv2.GaussianBlur(picture, (0, 0), 0.6)


PRINT = drawn()


def looked_along():
    """The ray of every pixel, x and y at z = 1, shape (n, 2)."""
    K = np.array([[LENS[0], 0, LENS[2]], [0, LENS[1], LENS[3]], [0, 0, 1]])
    u, v = np.meshgrid(*(np.arange(n, dtype=float) for n in SIZE))
    return cv2.undistortPoints(np.stack([u, v], -1).reshape(-1, 1, 2), K, LENS[4:]).reshape(-1, 2)


RAYS = looked_along()


def photo(camera_from_board, rng, noise=3.0):
    """What a camera sees of the board: every pixel of it followed back to the print."""
    rays = RAYS
    R, t = camera_from_board[:3, :3], camera_from_board[:3, 3]
    # H maps the board's plane to the picture's; its inverse a ray to the board.
    H = np.linalg.inv(np.column_stack([R[:, 0], R[:, 1], t]))
    on = np.column_stack([rays, np.ones(len(rays))]) @ H.T
    xy = (on[:, :2] / on[:, 2:] + boards.MARGIN / 1e3) * DOTS - 0.5
    xy = xy.reshape(SIZE[1], SIZE[0], 2).astype(np.float32)
    picture = cv2.remap(PRINT, xy[..., 0], xy[..., 1], cv2.INTER_LINEAR, borderValue=140)
    picture = (
        cv2.GaussianBlur(picture.astype(float), (0, 0), 0.7) * 0.8 + 20 + rng.normal(0, noise, picture.shape)
    )
    return np.clip(picture, 0, 255).astype(np.uint8)


def looking(rng, far):
    """Camera from a board that is tilted, about so far away, whole in the picture."""
    tilt = np.array([rng.uniform(-0.5, 0.5), rng.uniform(-0.5, 0.5), rng.uniform(-0.3, 0.3)])
    middle = np.array([BOARD.across, BOARD.up, 0]) * BOARD.square / 2
    shift = np.array([rng.uniform(-0.3, 0.3) * far, rng.uniform(-0.15, 0.15) * far, far])
    return transform(turn(tilt), shift - turn(tilt) @ middle)


@pytest.fixture(scope="module", name="found")
def a_lens():
    rng = np.random.default_rng(1)
    return calibration.lens([photo(looking(rng, far), rng) for far in np.linspace(0.6, 1.2, 9)], BOARD)


def test_the_lens_is_found_within_half_a_pixel(found):
    assert found.error_px <= 0.5
    assert found.pictures == 9
    np.testing.assert_allclose(found.lens[:2], LENS[:2], rtol=5e-3)
    rng = np.random.default_rng(0)
    points = np.column_stack([rng.uniform(-1, 1, 200), rng.uniform(-0.55, 0.55, 200), np.full(200, 2.0)])
    off = np.linalg.norm(project(found.lens, points) - project(LENS, points), axis=1)
    assert np.sqrt((off**2).mean()) < 3


@pytest.mark.parametrize("seed", range(3))
def test_the_tool_is_within_5_mm_at_2_m_and_the_stated_error_holds(found, seed):
    rng = np.random.default_rng(20 + seed)
    camera_from_board = looking(rng, 2.0)
    pictures = [photo(camera_from_board, rng) for _ in range(1)]
    corners = [calibration.corners(picture, BOARD) for picture in pictures]
    made = calibration.placed(
        found, corners, CELL_FROM_BOARD, accuracy=0.0, tools={"arm": TOOL}, board=BOARD
    ).camera
    truth = project(LENS, (camera_from_board @ inverse(CELL_FROM_BOARD) @ [*TOOL, 1])[:3])
    off = np.linalg.norm(seen(made, TOOL) - truth) / LENS[0] * 2.0
    assert made.error_px <= 0.5
    assert off <= 5e-3
    assert off <= made.error <= 0.01
    assert made.tool == "arm"


def test_a_board_whose_place_is_known_worse_or_a_tool_farther_from_it_is_never_stated_better(found):
    rng = np.random.default_rng(3)
    corners = [calibration.corners(photo(looking(rng, 2.0), rng), BOARD)]

    def stated(accuracy, tool=TOOL):
        told = {"accuracy": accuracy, "tools": {"arm": tool}, "board": BOARD}
        return calibration.placed(found, corners, CELL_FROM_BOARD, **told).camera.error

    assert stated(0.0) < stated(1e-3) < stated(4e-3)
    assert stated(1e-3, np.add(TOOL, [0.5, 0.5, 0])) > stated(1e-3)


def test_pictures_without_enough_of_the_board_are_refused_with_what_to_do(found):
    rng = np.random.default_rng(5)
    empty = rng.integers(0, 255, (SIZE[1], SIZE[0])).astype(np.uint8)
    assert calibration.corners(empty, BOARD) is None
    with pytest.raises(InputError, match=r"in 0 of 8 pictures.*tilted"):
        calibration.lens([empty] * 8, BOARD)
    with pytest.raises(InputError, match="no picture shows the board"):
        calibration.placed(found, [], CELL_FROM_BOARD, accuracy=0, tools={}, board=BOARD)


@pytest.mark.parametrize("text", ["charuco 2x6 60 45", "charuco 8x6 60 59", "chess 8x6", "charuco 8x6 1 0.7"])
def test_boards_that_cannot_be_are_refused(text):
    with pytest.raises(InputError, match="say charuco"):
        boards.read(text)


def test_the_print_is_to_scale_and_both_files_hold_the_same():
    shapes = boards.rectangles(BOARD)
    drawn = boards.svg(BOARD)
    assert 'width="500mm" height="380mm"' in drawn
    assert drawn.count("<rect") == len(shapes) + 1
    page = boards.pdf(BOARD)
    assert page.count(b" re\n") == len(shapes)
    width, height = map(float, re.search(rb"MediaBox \[0 0 ([\d.]+) ([\d.]+)\]", page).groups())
    np.testing.assert_allclose([width, height], np.array([500, 380]) * 72 / 25.4, atol=1e-3)


def test_a_camera_without_distortion_sees_what_a_pinhole_sees():
    camera = Camera(width=100, height=80, fx=100, fy=100, cx=50, cy=40, position=(0, 0, -2))
    np.testing.assert_allclose(seen(camera, np.array([0.2, -0.1, 0.0])), [60, 35])


def test_the_command_prints_a_board_and_writes_a_camera_that_is_read_back(tmp_path, found, capsys):
    from seerob.app.cli import main
    from seerob.description.camera.lens import read

    told = ["--board", str(BOARD)]
    assert main(["calibrate", "camera", *told, "--print-board", str(tmp_path / "board.svg")]) == 0
    assert (tmp_path / "board.svg").read_text() == boards.svg(BOARD)
    rng, files = np.random.default_rng(9), []
    for k, far in enumerate(np.linspace(0.6, 1.1, 6)):
        files.append(str(tmp_path / f"{k}.png"))
        cv2.imwrite(files[-1], photo(looking(rng, far), rng))
    camera_from_board = looking(rng, 2.0)
    cv2.imwrite(str(tmp_path / "placed.png"), photo(camera_from_board, rng))
    (tmp_path / "workstation.toml").write_text(
        '[[landmarks]]\nname = "corner"\nat = { position = [0.8, 0.2, 0.75] }\naccuracy_mm = 0.5\n'
        '[[parts]]\nname = "table"\nshape = { box = [1, 1, 0.7] }\n'
    )
    out = str(tmp_path / "camera.toml")
    placed = ["--placed", str(tmp_path / "placed.png"), "--at", "corner", "--out", out]
    assert main(["calibrate", "camera", str(tmp_path), *told, "--pictures", *files, *placed]) == 0
    camera = read(tmp_path / "camera.toml")
    corner = np.array([0.8, 0.2, 0.75])
    off = np.linalg.norm(seen(camera, corner) - project(LENS, camera_from_board[:3, 3])) / LENS[0] * 2.0
    assert off <= camera.error <= 0.01
    assert "mm at the board" in capsys.readouterr().out
