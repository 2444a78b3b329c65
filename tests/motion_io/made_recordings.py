"""Recordings of somebody who reaches, as BVH and C3D: ``from motion_io.made_recordings import …``."""

import ezc3d
import numpy as np

from seerob.description.capture.mapping import conventions, plain
from seerob.description.humans import keyframes, manikin
from seerob.description.humans.skeleton import BONES, bone_poses

PERSON = manikin.build(name="person", stature=1.75, mass=75.0, sex="male")
RATE = 30.0
CENTRES = (
    ("Hips", None, "pelvis"),
    ("Chest", "Hips", "lumbar"),
    ("Chest2", "Chest", "thorax"),
    ("Neck", "Chest2", "neck"),
    ("Head", "Neck", "head"),
    *(
        row
        for s, side in (("Right", "right"), ("Left", "left"))
        for row in (
            (f"{s}Collar", "Chest2", f"{side}_clavicle"),
            (f"{s}Shoulder", f"{s}Collar", f"{side}_upper_arm"),
            (f"{s}Elbow", f"{s}Shoulder", f"{side}_forearm"),
            (f"{s}Wrist", f"{s}Elbow", f"{side}_hand"),
            (f"{s}Hip", "Hips", f"{side}_thigh"),
            (f"{s}Knee", f"{s}Hip", f"{side}_shank"),
            (f"{s}Ankle", f"{s}Knee", f"{side}_foot"),
        )
    ),
)
PAIRS = ("ASI", "PSI", "FHD", "BHD", "SHO", "ELB", "WRA", "KNE", "ANK", "HEE", "TOE")
MARKERS = ["C7", "T10", "CLAV", "STRN", *(side + name for name in PAIRS for side in "RL")]


def reaching(count):
    """Rotations and positions of the bones of `PERSON`."""
    played = keyframes.sample(keyframes.read("library:reach", PERSON), PERSON, RATE)
    return bone_poses(PERSON, played.q[:count])


def bvh(folder, moved):
    """Joint centres by channels of position: nothing turns."""
    _, p = moved
    at = {name: 100 * p[:, BONES.index(bone)][:, [1, 2, 0]] for name, _, bone in CENTRES}  # y up
    lines = ["HIERARCHY"]

    def joint(name, parent):
        offset = at[name][0] - (at[parent][0] if parent else 0)
        lines.extend([f"{'JOINT' if parent else 'ROOT'} {name}", "{", "OFFSET " + " ".join(map(str, offset))])
        lines.append("CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation")
        order.append((name, parent))
        children = [n for n, above, _ in CENTRES if above == name]
        for child in children:
            joint(child, name)
        if not children:
            lines.extend(["End Site", "{", "OFFSET 0 -5 0", "}"])
        lines.append("}")

    order: list[tuple[str, str | None]] = []
    joint("Hips", None)
    lines += ["MOTION", f"Frames: {len(p)}", f"Frame Time: {1 / RATE}"]
    for k in range(len(p)):
        rows = [[*(at[n][k] - (at[above][k] if above else 0)), 0, 0, 0] for n, above in order]
        lines.append(" ".join(str(x) for row in rows for x in row))
    (folder / "r.bvh").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return "bvh", folder / "r.bvh"


def c3d(folder, moved, markers=MARKERS):
    """Markers on the skin, up to 2 cm from where they ought to be."""
    R, p = moved
    places = conventions()["markers"].places
    random = np.random.default_rng(4)
    file = ezc3d.c3d()
    point = file["parameters"]["POINT"]
    point["RATE"]["value"], point["LABELS"]["value"], point["UNITS"]["value"] = [RATE], markers, ["mm"]
    data = np.ones((4, len(markers), len(p)))
    for k, name in enumerate(markers):
        place = places[plain(name)]
        bone = BONES.index(place.bone)
        at = place.at * 1.75 + random.uniform(-0.02, 0.02, 3) / np.sqrt(3)
        data[:3, k] = 1e3 * (p[:, bone] + R[:, bone] @ at).T
    file["data"]["points"] = data
    file.write(str(folder / "r.c3d"))
    return "c3d", folder / "r.c3d"
