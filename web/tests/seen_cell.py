"""A cell with balls, and what a camera with distortion sees where they are: OpenCV projects, not seerob.

``python seen_cell.py FOLDER ADDRESS`` writes the workstation file, lenses, seen.y4m (for a browser's fake
camera) and seen.jpg (for a network camera at ADDRESS), and prints where OpenCV has each ball [px] as JSON.
"""

import json
import sys
from pathlib import Path

import cv2
import numpy as np

WIDTH, HEIGHT = 640, 360
K = np.array([[520.0, 0, 331.0], [0, 514.0, 172.0], [0, 0, 1]])
DISTORTION = np.array([-0.21, 0.06, 1.5e-3, -1e-3, 0.0])
BALLS = {
    "middle": (0.0, 0.0, 0.9),
    "corner": (-0.75, 0.15, 1.0),
    "other": (0.78, -0.45, 0.8),
    "edge": (0.8, 0.4, 1.1),
    "hidden": (-0.35, -0.3, 0.5),
}
PLATE = (-0.24, -0.26, 1.0)
"""Over one of the balls, seen from the camera, and real."""
EMULATED = "http://127.0.0.1:9/emulated"
"""To be replaced by the address of an emulator."""
EYE, ROLL = np.array([0.2, -0.1, 3.0]), 0.15
SEEN, BACK = (40, 220, 40), (90, 60, 50)
"""Blue, green, red."""


def world_from_camera():
    """Looks down, a little rolled: x to the right, y down in the picture, z ahead."""
    c, s = np.cos(ROLL), np.sin(ROLL)
    return np.column_stack([[c, s, 0], [s, -c, 0], [0, 0, -1]])


def main():
    """Write everything."""
    folder, address = Path(sys.argv[1]), sys.argv[2]
    R = world_from_camera().T
    turn, _ = cv2.Rodrigues(R)
    points = np.array(list(BALLS.values()))
    pixels, _ = cv2.projectPoints(points, turn, -R @ EYE, K, DISTORTION)
    pixels = pixels.reshape(-1, 2)
    picture = np.full((HEIGHT, WIDTH, 3), BACK, np.uint8)
    for u, v in pixels:
        cv2.circle(picture, (round(16 * u), round(16 * v)), 16 * 15, SEEN, -1, cv2.LINE_AA, 4)
    cv2.imwrite(str(folder / "seen.jpg"), picture, [cv2.IMWRITE_JPEG_QUALITY, 95])
    planes = cv2.cvtColor(picture, cv2.COLOR_BGR2YUV_I420).tobytes()
    head = f"YUV4MPEG2 W{WIDTH} H{HEIGHT} F4:1 Ip A1:1 C420jpeg\n".encode()
    (folder / "seen.y4m").write_bytes(head + 2 * (b"FRAME\n" + planes))
    from seerob.core.transforms import wxyz_from_rotation

    lens = (
        f"[camera]\nwidth = {WIDTH}\nheight = {HEIGHT}\nfx = {K[0, 0]}\nfy = {K[1, 1]}\ncx = {K[0, 2]}\n"
        f"cy = {K[1, 2]}\ndistortion = {DISTORTION.tolist()}\n"
    )
    wxyz = wxyz_from_rotation(world_from_camera()).tolist()
    placed = f'position = {EYE.tolist()}\nwxyz = {wxyz}\nerror_px = 0.2\ntool = "the board"\n'
    (folder / "camera.toml").write_text(f"{lens}{placed}error = 0.004\n")
    (folder / "worse.toml").write_text(f"{lens}{placed}error = 0.2\n")
    (folder / "unplaced.toml").write_text(lens)
    cell = 'title = "Seen by a camera"\n'
    for name, at in BALLS.items():
        cell += f'[[parts]]\nname = "{name}"\nshape = {{ sphere = 0.018 }}\ncolor = [1, 0, 0]\n'
        cell += f"at = {{ position = {list(at)} }}\n"
    cell += '[[parts]]\nname = "plate"\nreal = true\nshape = { box = [0.2, 0.2, 0.01] }\ncolor = [0, 0, 1]\n'
    cell += f"at = {{ position = {list(PLATE)} }}\n"
    for name, file, more in (
        ("webcam", "camera", ""),
        ("network", "camera", f'address = "{address}"\nrecord = true\n'),
        ("emulated", "camera", f'address = "{EMULATED}"\n'),
        ("unplaced", "unplaced", ""),
        ("worse", "worse", ""),
    ):
        cell += f'[[cameras]]\nname = "{name}"\ncalibration = "{file}.toml"\n{more}'
    (folder / "workstation.toml").write_text(cell)
    sys.stdout.write(json.dumps(dict(zip(BALLS, pixels.tolist(), strict=True))))


main()
