"""A device's camera sees a printed board: rendered pictures through the page's door, and what follows."""

import httpx
import numpy as np
import pytest
from msgspec.structs import replace

pytest.importorskip("cv2")

from seerob.app.server.access import Tokens
from seerob.app.server.live import Live
from seerob.app.server.serving import Server
from seerob.core.snapshot import Place
from seerob.core.transforms import inverse, rotation_from_wxyz, transform, wxyz_from_rotation
from seerob.description.capture import registration as solve
from seerob.description.capture.registration import turn
from seerob.protocols.tracking.vive import WORLD_FROM_XR
from server.frames import MESHES
from server.test_registering import CELL_FROM_ROOM, MIXED, Toucher
from test_camera_calibration import BOARD, CELL_FROM_BOARD, SIZE, photo

TOOL = np.array([0.9, 0.3, 1.1])
FOCAL = (720.0, 716.0, 489.0, 262.0)
CV_FROM_XR = transform(np.diag([1.0, -1.0, -1.0]), np.zeros(3))
ACCURACY = (1e-4, 1e-4)
SCENE = replace(
    MIXED,
    landmarks=(
        *MIXED.landmarks,
        Place(
            name="sheet",
            position=tuple(CELL_FROM_BOARD[:3, 3]),
            wxyz=tuple(wxyz_from_rotation(CELL_FROM_BOARD[:3, :3])),
            accuracy=ACCURACY[0],
            accuracy_turn=ACCURACY[1],
            board=str(BOARD),
        ),
    ),
)


def cameras(rng, count):
    """Board from cameras that look at its middle from so many places about a metre away, (count, 4, 4)."""
    middle = np.array([BOARD.across, BOARD.up, 0]) * BOARD.square / 2
    found = []
    for k in range(count):
        eye = middle + np.array([0.5 * np.cos(2.4 * k), 0.4 * np.sin(2.4 * k), -0.8 - 0.1 * (k % 3)])
        z = middle + rng.uniform(-0.03, 0.03, 3) - eye
        z /= np.linalg.norm(z)
        x = np.cross([0, 1, 0], z)
        x /= np.linalg.norm(x)
        found.append(transform(np.column_stack([x, np.cross(z, x), z]), eye))
    return np.array(found)


def test_the_stated_covariance_holds_the_true_error():
    rng = np.random.default_rng(5)
    spread = np.array([0.002, 0.002, 0.006, 0.004, 0.004, 0.001])
    device = np.array([0.003] * 3 + [0.003] * 3)
    within = 0
    trials = 200
    for _ in range(trials):
        cells = CELL_FROM_BOARD @ cameras(rng, 5)
        rooms = inverse(CELL_FROM_ROOM) @ cells
        seen = []
        for cell in cells:
            x = rng.normal(0, spread)
            seen.append(cell @ transform(turn(x[3:]), x[:3]))
        told = [room @ transform(turn(y[3:]), y[:3]) for room in rooms for y in [rng.normal(0, device)]]
        board = CELL_FROM_BOARD[:3, 3]
        found = solve.looked(
            np.array(seen), np.array(told), np.tile(np.diag(spread**2), (5, 1, 1)),
            about=board, place_error=(0.0, 0.0), level=np.inf,
        )  # fmt: skip
        off = solve.put(found, (inverse(CELL_FROM_ROOM) @ [*TOOL, 1])[:3]) - TOOL
        S = solve.at(found, TOOL)
        within += float(off @ np.linalg.solve(S, off)) < solve.CHI**2
    assert within / trials >= 0.93


class Looker(Toucher):
    """A page whose device has a camera that it may read."""

    def picture(self, server, camera, **more):
        """What the server finds in a picture of the board, by camera from board."""
        grey = photo(camera, self.rng, noise=1.0)
        asked = {"board": str(BOARD), "width": str(SIZE[0])} | more
        return httpx.post(server.url.rstrip("/") + "/board", params=asked, content=grey.tobytes())

    def look(self, server, board_from_camera, name="sheet"):
        found = self.picture(server, inverse(board_from_camera))
        assert found.status_code == 200, found.text
        room = inverse(CELL_FROM_ROOM) @ CELL_FROM_BOARD @ board_from_camera @ CV_FROM_XR
        position = room[:3, 3] @ WORLD_FROM_XR
        pose = np.array([*position, *wxyz_from_rotation(WORLD_FROM_XR.T @ room[:3, :3])], "<f4")
        return self.step("seen", landmark=name, poses=pose.tobytes(), corners=found.content, by=FOCAL)


@pytest.fixture(name="straight")
def a_lens_without_distortion(monkeypatch):
    """What WebXR hands over is straight already."""
    import test_camera_calibration as rendering

    u, v = np.meshgrid(*(np.arange(n, dtype=float) for n in SIZE))
    rays = np.stack([(u - FOCAL[2]) / FOCAL[0], (v - FOCAL[3]) / FOCAL[1]], -1).reshape(-1, 2)
    monkeypatch.setattr(rendering, "RAYS", rays)


@pytest.mark.usefixtures("straight")
def test_looks_from_three_places_register_the_room():
    with Server(scene=SCENE, meshes=MESHES, feed=Live(), port=0) as server, Looker(server) as page:
        answers = [page.look(server, each) for each in cameras(page.rng, 4)]
        assert [bool(answer.at) for answer in answers] == [False, False, True, True]
        assert "3 or more" in answers[0].doubt
        last = answers[-1]
        assert (last.accepted, last.doubt, last.landmarks) == (True, "", ("sheet",) * 4)
        T = transform(rotation_from_wxyz(last.at[3:]), last.at[:3])
        off = np.linalg.norm((T @ inverse(CELL_FROM_ROOM) @ [*TOOL, 1])[:3] - TOOL)
        S = solve.covariance_at(np.reshape(last.covariance, (6, 6)), np.array(last.about), TOOL)
        assert off < 0.005
        assert off < 1.5 * solve.CHI * np.sqrt(np.linalg.eigvalsh(S)[-1])
        # Of another place nothing is told by the same board, and touches begin anew.
        assert "no landmark" in page.look(server, cameras(page.rng, 1)[0], "elsewhere").reason
        assert "what is printed" in page.look(server, cameras(page.rng, 1)[0], "corner_1").reason
        # What cannot be is refused: a picture without the board, of another width, or too large.
        away = transform(None, [0, 0, 1.0]) @ transform(turn(np.array([0, 3.0, 0])), np.zeros(3))
        assert page.picture(server, away).status_code == 204
        assert page.picture(server, away, width="7").status_code == 400
        assert page.picture(server, away, width="961").status_code == 413
        assert page.picture(server, away, board="aruco").status_code == 400
        large = httpx.post(
            server.url + "board", params={"width": "1024", "board": str(BOARD)}, content=bytes(1 << 21)
        )
        assert large.status_code == 413


def test_who_may_only_look_has_no_picture_looked_at():
    tokens = Tokens.made()
    with Server(scene=SCENE, meshes=MESHES, feed=Live(), port=0, tokens=tokens) as server:
        for token, status in ((tokens.view, 403), (tokens.track, 204), ("wrong", 401)):
            asked = {"token": token, "width": "64", "board": str(BOARD)}
            assert (
                httpx.post(
                    server.url.split("?")[0] + "board", params=asked, content=bytes(64 * 64)
                ).status_code
                == status
            )
