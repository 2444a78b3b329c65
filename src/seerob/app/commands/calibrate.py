"""``seerob calibrate camera``: lens and pose of a camera from pictures of a printed board."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from seerob.app.console.terminal import OUT, Exit, line
from seerob.core.errors import InputError

if TYPE_CHECKING:
    from seerob.core.transforms import Array
    from seerob.description.camera.board import Board
    from seerob.description.camera.lens import Camera

HELP = "find the lens and the pose of a camera from a printed board"
EXAMPLE = "seerob calibrate camera my_cell --pictures lens/*.png --placed board.png --at board_corner"
BOARD = "charuco 8x6 40 30"
TAKEN = 20
"""Pictures that are taken from a device, one per second, while the board is moved."""


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    sub.add_argument("what", choices=("camera",), help="what is calibrated")
    sub.add_argument(
        "cell", nargs="?", help="workstation file or its folder, for where the board and the tool are"
    )
    sub.add_argument("--board", default=BOARD, help=f"what was printed, default: {BOARD!r}")
    sub.add_argument("--print-board", metavar="FILE", help="write the board to FILE.svg or FILE.pdf, and end")
    sub.add_argument(
        "--pictures", nargs="+", default=[], metavar="FILE", help="pictures of the board, for the lens"
    )
    sub.add_argument(
        "--device", help=f"number or address of a camera: {TAKEN} pictures are taken, one a second"
    )
    sub.add_argument(
        "--placed", nargs="+", default=[], metavar="FILE", help="pictures of the board at its place"
    )
    sub.add_argument(
        "--at", metavar="LANDMARK", help="entry of [[landmarks]] at which the board's corner lies"
    )
    sub.add_argument(
        "--on", metavar="NAME", help="link, tool, part or machine that carries the camera, where it begins"
    )
    sub.add_argument("--out", default="camera.toml", help="file to write, default: camera.toml")


def run(options: argparse.Namespace) -> int:
    """Print the board, or calibrate, tell and write."""
    from seerob.description.camera import board as boards

    board = boards.read(options.board)
    if options.print_board:
        _print(board, Path(options.print_board))
        return Exit.WITHIN
    from seerob.description.camera import calibration

    pictures = [*_read(options.pictures), *(_taken(options.device) if options.device else ())]
    found = calibration.lens(pictures, board)
    line("note", f"lens: {found.error_px:.2f} px over {found.pictures} pictures with {board}", "")
    if not options.placed:
        fx, fy, cx, cy, k1, k2, p1, p2, k3 = found.lens.tolist()
        from seerob.description.camera.lens import Camera

        camera = Camera(
            width=found.size[0],
            height=found.size[1],
            fx=fx,
            fy=fy,
            cx=cx,
            cy=cy,
            distortion=(k1, k2, p1, p2, k3),
            error_px=found.error_px,
            board=str(board),
        )
        line("warning", "where it stands is not known: give --placed, --at and the cell", "yellow")
    else:
        cell_from_board, accuracy, tools, carrier = _places(options)
        seen = [one for picture in _read(options.placed) if (one := calibration.corners(picture, board))]
        placed = calibration.placed(found, seen, cell_from_board, accuracy=accuracy, tools=tools, board=board)
        camera = _carried(placed.camera, carrier, options.on)
        assert camera.error is not None  # it is placed
        text = f"pose: {camera.error_px:.2f} px, {1e3 * camera.error:.1f} mm at {camera.tool} (95 %)"
        line("note", f"{text}; the camera itself within {1e3 * placed.along:.1f} mm", "")
    _write(camera, Path(options.out))
    OUT.print(f"wrote {options.out}", markup=False)
    return Exit.WITHIN


def _print(board: Board, path: Path) -> None:
    from seerob.core.files.whole_file import whole_file
    from seerob.description.camera import board as boards

    if path.suffix not in (".svg", ".pdf"):
        raise InputError.at("--print-board", "", f"{path.name} is neither .svg nor .pdf", "name one of them")
    data = boards.pdf(board) if path.suffix == ".pdf" else boards.svg(board).encode()
    with whole_file(path) as hidden:
        hidden.write_bytes(data)
    OUT.print(
        f"wrote {path}: print it at 100 %, glue it on something flat, measure a row of squares", markup=False
    )


def _read(files: Sequence[str]) -> Iterator[Array]:
    from seerob.core.extras import need

    need("cv2")
    import cv2

    for file in files:
        picture: Any = cv2.imread(file, cv2.IMREAD_GRAYSCALE) if Path(file).is_file() else None
        if picture is None:
            raise InputError.at(file, "", "is no picture that can be read", "give PNG or JPEG files")
        yield picture


def _taken(device: str) -> Iterator[Array]:
    import time

    from seerob.core.extras import need

    need("cv2")
    import cv2

    camera = cv2.VideoCapture(int(device) if device.isdecimal() else device)
    try:
        if not camera.isOpened():
            raise InputError.at(
                "--device", "", f"no camera at {device}", "give its number, or its address (rtsp://…)"
            )
        for k in range(TAKEN):
            OUT.print(f"{k + 1} of {TAKEN}: tilt the board, up to the edges of the picture", markup=False)
            end = time.monotonic() + 1.0
            picture: Any = None
            while time.monotonic() < end:
                there, newest = camera.read()
                picture = newest if there else picture
            if picture is None:
                raise InputError.at(
                    "--device", "", f"{device} sends no pictures", "is another program using it?"
                )
            yield cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
    finally:
        camera.release()


def _places(options: argparse.Namespace) -> tuple[Array, float, dict[str, Array], Array]:
    """Cell from board, its accuracy [m], the robots' points of interest [m], and what carries the camera.

    All where everybody begins.

    Raises:
        InputError: There is no cell, no such landmark, or it moves.
    """
    import numpy as np

    from seerob.core.transforms import transform
    from seerob.devices.capture.options import placement
    from seerob.model.model import Frame
    from seerob.session.station import load
    from seerob.twin.engine import Engine

    if options.cell is None or options.at is None:
        what = "--placed says nothing without the cell and --at"
        raise InputError.at("calibrate", "", what, "seerob calibrate camera my_cell --at LANDMARK …")
    station = load(Path(options.cell))
    landmarks = {landmark.name: landmark for landmark in station.workstation.landmarks}
    landmark = landmarks.get(options.at)
    if landmark is None or landmark.on is not None:
        what = f"no landmark {options.at!r} that stands in the world"
        raise InputError.at("--at", "", what, f"[[landmarks]] has {', '.join(landmarks) or 'none'}")
    state = Engine(station.model, controllers=False).start()
    carrier = np.eye(4)
    if options.on is not None:
        bodies = {body.name: body for body in station.model.bodies}
        body = bodies.get(options.on)
        frame = station.model.frame(options.on) if body is None else Frame(body.name, body.mj, np.eye(4))
        carrier = transform(*state._pose(frame))
    tips = {m.name: m.tip for m in station.model.mechanisms.values() if m.role == "robot"}
    return (
        placement(landmark.at),
        landmark.accuracy,
        {name: state._pose(tip)[1] for name, tip in tips.items()},
        carrier,
    )


def _carried(camera: Camera, carrier: Array, name: str | None) -> Camera:
    """A camera of which the pose is in the frame of what carries it, shape (4, 4)."""
    from msgspec.structs import replace

    from seerob.core.transforms import inverse, wxyz_from_rotation

    if name is None:
        return camera
    there = inverse(carrier) @ camera.world_from_camera
    x, y, z = there[:3, 3].tolist()
    w, i, j, k = wxyz_from_rotation(there[:3, :3]).tolist()
    return replace(camera, position=(x, y, z), wxyz=(w, i, j, k), on=name)


def _write(camera: Camera, path: Path) -> None:
    from msgspec.structs import asdict

    from seerob.core.files.whole_file import whole_file
    from seerob.files.tables.mapping import toml_value

    rows = "".join(
        f"{key} = {toml_value(value)}\n" for key, value in asdict(camera).items() if value is not None
    )
    with whole_file(path) as hidden:
        hidden.write_text(f"[camera]\n{rows}", encoding="utf-8")
