"""BVH: against pybvh, in every order of channels, in every unit, and files that are wrong."""

from __future__ import annotations

import random
from itertools import permutations

import numpy as np
import pybvh
import pytest
from scipy.spatial.transform import Rotation

from seerob.core.errors import InputError
from seerob.description.capture.captured import Seen
from seerob.devices.sources import bvh as _bvh_file
from seerob.devices.sources.bvh import METRES, Unit, Up, guess_unit, read

BODY = {  # joint → parent, offset [m] with y up, facing z
    "Hips": (None, (0, 0, 0)),
    "Spine": ("Hips", (0, 0.12, 0)),
    "Neck": ("Spine", (0, 0.4, 0)),
    "Head": ("Neck", (0, 0.1, 0.02)),
    "LeftArm": ("Spine", (0.18, 0.36, 0)),
    "LeftForeArm": ("LeftArm", (0.28, 0, 0)),
    "LeftHand": ("LeftForeArm", (0.25, 0, 0)),
    "RightArm": ("Spine", (-0.18, 0.36, 0)),
    "RightForeArm": ("RightArm", (-0.28, 0, 0)),
    "RightHand": ("RightForeArm", (-0.25, 0, 0)),
    "LeftUpLeg": ("Hips", (0.1, 0, 0)),
    "LeftLeg": ("LeftUpLeg", (0, -0.42, 0)),
    "LeftFoot": ("LeftLeg", (0, -0.42, 0)),
    "RightUpLeg": ("Hips", (-0.1, 0, 0)),
    "RightLeg": ("RightUpLeg", (0, -0.42, 0)),
    "RightFoot": ("RightLeg", (0, -0.42, 0)),
}
END = {
    "Head": (0, 0.18, 0),
    "LeftHand": (0.17, 0, 0),
    "RightHand": (-0.17, 0, 0),
    "LeftFoot": (0, -0.06, 0.14),
}
END |= {"RightFoot": (0, -0.06, 0.14)}
RNG = np.random.default_rng(3)
FRAMES = 12
ANGLES = RNG.uniform(-40, 40, (FRAMES, len(BODY), 3))
ROOT = np.array([0.3, 0.9, -0.2]) + RNG.uniform(-0.2, 0.2, (FRAMES, 3))
EYE = np.eye(3)
REST = "Xposition Yposition Zposition"


def made(path, *, order="ZXY", scale=100.0, dt=1 / 30, root=REST, change=str, turn=EYE):
    """Writes a file; ``turn`` is the file's axes from those with y up."""
    names = list(BODY)
    lines = ["HIERARCHY"]

    def offset(xyz):
        return " ".join(f"{x:.6f}" for x in scale * turn @ np.array(xyz, float))

    def joint(name, depth):
        pad = "\t" * depth
        channels = " ".join(f"{axis}rotation" for axis in order)
        lines.append(f"{pad}{'ROOT' if depth == 0 else 'JOINT'} {name}")
        lines.append(f"{pad}{{\n{pad}  OFFSET {offset(BODY[name][1])}")
        lines.append(f"{pad}  CHANNELS {f'6 {root} {channels}' if depth == 0 else f'3 {channels}'}")
        for child in (n for n in names if BODY[n][0] == name):
            joint(child, depth + 1)
        if name in END:
            lines.append(f"{pad}  End Site\n{pad}  {{\n{pad}    OFFSET {offset(END[name])}\n{pad}  }}")
        lines.append(f"{pad}}}")

    joint("Hips", 0)
    lines += ["MOTION", f"Frames: {FRAMES}", f"Frame Time: {dt:.7f}"]
    in_order = [names.index(word) for word in written(names)]
    for k in range(FRAMES):
        shift = scale * turn @ ROOT[k]
        shift = shift[["XYZ".index(word[0]) for word in root.split()]]
        lines.append(" ".join(f"{x:.6f}" for x in [*shift, *ANGLES[k, in_order].ravel()]))
    path.write_text(change("\n".join(lines) + "\n"), encoding="utf-8")
    return path


def written(names, at="Hips"):
    return [at, *(n for child in names if BODY[child][0] == at for n in written(names, child))]


def expected(order):
    """Joint centres [m] with z up, facing x, and turns there: by scipy, joint by joint."""
    z_up = np.array([[0, 0, 1.0], [1, 0, 0], [0, 1, 0]])
    where, how = {}, {}
    for name, (parent, offset) in BODY.items():
        own = Rotation.from_euler(order, ANGLES[:, list(BODY).index(name)], degrees=True)
        where[name] = ROOT if parent is None else where[parent] + how[parent].apply(offset)
        how[name] = own if parent is None else how[parent] * own
    points = {name: p @ z_up.T for name, p in where.items()}
    points |= {f"{n} end": (where[n] + how[n].apply(offset)) @ z_up.T for n, offset in END.items()}
    flip = Rotation.from_matrix(z_up)
    return points, {name: flip * turn * flip.inv() for name, turn in how.items()}


def told(captured):
    return "\n".join(f"{f.level}: {f.text}" for f in captured.findings)


# -- against others ------------------------------------------------------------------------------


@pytest.mark.parametrize("order", ["".join(p) for p in permutations("XYZ")])
def test_every_order_of_channels_is_turned_about_the_moved_axes(tmp_path, order):
    captured = read(made(tmp_path / "x.bvh", order=order))
    points, turns = expected(order)
    frames = list(captured.frames)
    assert set(captured.layout.names) == set(points)
    for row, name in enumerate(captured.layout.names):
        np.testing.assert_allclose([f.positions[row] for f in frames], points[name], atol=1e-6)
        found = np.array([f.orientations[row] for f in frames])
        if name in turns:
            off = np.abs(np.einsum("ij,ij->i", found, turns[name].as_quat(scalar_first=True)))
            assert off.min() > 1 - 1e-9
        else:
            assert np.isnan(found).all()


def test_pybvh_has_the_same_joint_centres(tmp_path):
    path = made(tmp_path / "x.bvh", order="YXZ")
    captured = read(path, up=Up.Y)
    theirs = pybvh.read_bvh_file(path)
    names = [node.name for node in theirs.nodes]
    positions = 0.01 * theirs.node_positions()
    frames = np.stack([f.positions for f in captured.frames])
    for row, name in enumerate(captured.layout.names):
        if not name.endswith(" end"):
            np.testing.assert_allclose(
                frames[:, row], positions[:, names.index(name)][:, [2, 0, 1]], atol=1e-6
            )


def test_a_tree_and_its_lengths(tmp_path):
    captured = read(made(tmp_path / "x.bvh"))
    names, parents = captured.layout.names, captured.layout.parents
    assert captured.layout.seen is Seen.JOINTS
    assert names[0] == "Hips"
    assert {n: names[p] if p >= 0 else None for n, p in zip(names, parents, strict=True) if n in BODY} == {
        n: parent for n, (parent, _) in BODY.items()
    }
    assert captured.lengths["LeftArm"] == pytest.approx(0.28)
    assert captured.lengths["RightLeg"] == pytest.approx(0.42)
    assert "Hips" not in captured.lengths  # has three other ends
    assert (captured.count, captured.rate) == (FRAMES, pytest.approx(30, rel=1e-5))
    assert [f.t for f in captured.frames] == pytest.approx(np.arange(FRAMES) / 30, abs=1e-6)


def test_chunks_do_not_show(tmp_path, monkeypatch):
    whole = [f.positions for f in read(made(tmp_path / "x.bvh")).frames]
    monkeypatch.setattr("seerob.devices.sources.bvh.CHUNK", 5)
    np.testing.assert_array_equal([f.positions for f in read(tmp_path / "x.bvh").frames], whole)


# -- what a file does not say --------------------------------------------------------------------


@pytest.mark.parametrize("unit", [u for u in Unit if u is not Unit.GUESS])
def test_the_unit_is_guessed_from_the_skeleton_and_said(tmp_path, unit):
    captured = read(made(tmp_path / "x.bvh", scale=1 / METRES[unit]))
    assert next(iter(captured.frames)).positions[0] == pytest.approx(ROOT[0][[2, 0, 1]], abs=1e-4)
    assert f"assumed: unit {unit} assumed" in told(captured)
    given = read(tmp_path / "x.bvh", unit=unit)
    assert "unit" not in told(given)


def test_no_length_is_a_persons_in_two_units():
    lengths = np.geomspace(1e-4, 1e5, 20_000)
    low, high = 0.9, 1.9
    for length in lengths:
        fitting = [unit for unit, metres in METRES.items() if low <= metres * length <= high]
        assert len(fitting) <= 1
        assert guess_unit(length) == (fitting[0] if fitting else None)


def test_a_unit_that_is_none_has_to_be_given(tmp_path):
    path = made(tmp_path / "x.bvh", scale=5.0)
    with pytest.raises(InputError, match=r'give unit = "m"'):
        read(path)
    assert read(path, unit=Unit.M).count == FRAMES
    assert "in cm the longest" in told(read(made(tmp_path / "y.bvh", scale=1.0), unit=Unit.CM))


def test_z_up_is_noticed(tmp_path):
    z_up = np.array([[0, 0, 1.0], [1, 0, 0], [0, 1, 0]])
    order = "YZX"  # the axes that X, Y, Z with y up become

    def calm(text):
        head, _, rows = text.partition("Frame Time:")
        first, *others = rows.splitlines()
        still = [" ".join([*row.split()[:3], *["0"] * (len(row.split()) - 3)]) for row in others]
        return "\n".join([f"{head}Frame Time:{first}", *still])

    captured = read(made(tmp_path / "x.bvh", order=order, turn=z_up, change=calm))
    assert "z is taken as up: the person extends along it" in told(captured)
    head = captured.layout.names.index("Head")
    frame = next(iter(captured.frames))
    assert frame.positions[head] - frame.positions[0] == pytest.approx([0.02, 0, 0.62], abs=1e-6)


def test_channels_of_position_replace_the_offset(tmp_path):
    def shifts(text):
        head, _, rows = text.partition("Frame Time:")
        head = head.replace(
            "OFFSET 0.000000 12.000000 0.000000\n\t  CHANNELS 3", "OFFSET 0 12 0\n\t  CHANNELS 4 Yposition"
        )
        first, *others = rows.splitlines()
        return "\n".join(
            [f"{head}Frame Time:{first}", *(" ".join([*r.split()[:6], "20", *r.split()[6:]]) for r in others)]
        )

    captured = read(made(tmp_path / "x.bvh", change=shifts))
    spine = captured.layout.names.index("Spine")
    for frame in captured.frames:
        assert np.linalg.norm(frame.positions[spine] - frame.positions[0]) == pytest.approx(0.2, abs=1e-6)
    assert "joints that also shift: Spine" in told(captured)


def test_rows_that_are_wrong_are_left_out_and_told(tmp_path):
    def holes(text):
        lines = text.rstrip().split("\n")
        lines[-3] = lines[-3].replace(" ", " nan ", 1)
        lines[-4] = "1 2 3"
        lines[-5] = lines[-5].replace("0", "O")
        lines[-6] = lines[-6].rsplit(" ", 1)[0] + " nan"
        return "\n".join([*lines[:-1], "", lines[-1], lines[-1], lines[-1]])

    captured = read(made(tmp_path / "x.bvh", change=holes))
    frames = list(captured.frames)
    assert len(frames) == captured.count == FRAMES - 4
    assert "4 frames are no rows of numbers" in told(captured)
    assert f"2 rows after the announced {FRAMES} frames" in told(captured)
    fewer = read(
        made(tmp_path / "y.bvh", change=lambda text: text.replace("Frames: 12", "Frames: 999999999999"))
    )
    assert "12 frames are there, 999999999999 are announced" in told(fewer)


def test_frames_that_are_in_another_town_are_left_out_and_told(tmp_path):
    def dotless(text):
        lines = text.rstrip().split("\n")
        lines[-3:-1] = [line.replace(".", "", 1) for line in lines[-3:-1]]
        return "\n".join(lines)

    captured = read(made(tmp_path / "x.bvh", change=dotless))
    frames = list(captured.frames)
    assert len(frames) == captured.count == FRAMES - 2
    assert max(np.abs(frame.positions).max() for frame in frames) < 3
    assert "2 frames that shift joints by more than 100 m left out" in told(captured)
    with pytest.raises(InputError, match="every frame shifts joints by more than 100 m"):
        read(made(tmp_path / "y.bvh", scale=1e5), unit=Unit.CM)


# -- files that are wrong ------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("HIERARCHY", "SOLID", "begins with HIERARCHY"),
        ("MOTION", "ROOT Other\n{\nOFFSET 0 0 0\n}\nMOTION", "a second root, 'Other'"),
        ("JOINT Neck", "JOINT Spine", "a second joint 'Spine'"),
        ("JOINT Neck", "JOINT", "without a name"),
        ("OFFSET 0.000000 12.000000 0.000000", "OFFSET 0 twelve 0", "OFFSET and three numbers"),
        ("OFFSET 0.000000 12.000000 0.000000", "OFFSET 0 inf 0", "OFFSET and three numbers"),
        ("CHANNELS 3", "CHANNELS 4", "how many"),
        ("Zrotation", "Wrotation", "channel 'Wrotation'"),
        ("Xposition", "Yposition", "position channel twice"),
        ("End Site", "SCALE 3\nEnd Site", "not understood"),
        ("Frames: 12", "Frames: 0", "0 frames"),
        ("Frames: 12", "Pictures: 12", "FRAMES: is expected"),
        ("Frame Time: 0.03", "Frame Time: 30", "a frame time of 3"),
        ("Frame Time: 0.0333333", "Frame Time: nan", "and a number"),
        ("}\nMOTION", "MOTION", "before the hierarchy is closed"),
        ("MOTION", "}\nMOTION", "} too many"),
    ],
)
def test_what_is_wrong_is_said_with_file_and_line(tmp_path, old, new, complaint):
    path = made(tmp_path / "x.bvh", change=lambda text: text.replace(old, new))
    with pytest.raises(InputError, match=complaint) as caught:
        read(path, file="cell/x.bvh")
    assert str(caught.value).startswith("cell/x.bvh: line ")


@pytest.mark.parametrize(
    "text", ["", "HIERARCHY", "HIERARCHY\nMOTION\n", "HIERARCHY\n{", "HIERARCHY\nROOT a\n{\nJOINT b\n{"]
)
def test_a_file_that_ends(tmp_path, text):
    path = tmp_path / "x.bvh"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError):
        read(path)


def test_no_file():
    from pathlib import Path

    with pytest.raises(InputError, match="no such file"):
        read(Path("none.bvh"))


def test_too_much_is_refused(tmp_path, monkeypatch):
    deep = "HIERARCHY\n" + "".join(
        f"{'JOINT' if k else 'ROOT'} j{k}\n{{\nOFFSET 0 1 0\n" for k in range(5000)
    )
    path = tmp_path / "x.bvh"
    path.write_text(deep, encoding="utf-8")
    with pytest.raises(InputError, match="one in another"):
        read(path)
    monkeypatch.setattr(_bvh_file, "LONGEST_LINE", 100)
    path.write_text("HIERARCHY" + "x" * 200, encoding="utf-8")
    with pytest.raises(InputError, match="more than 100 characters"):
        read(path)


def test_damaged_files_are_refused_or_read(tmp_path):
    good = made(tmp_path / "good.bvh").read_bytes()
    rng, refused = random.Random(0), 0
    path = tmp_path / "bad.bvh"
    for _ in range(150):
        bad = bytearray(good)
        for _ in range(rng.randint(1, 6)):
            bad[rng.randrange(len(bad) if rng.random() < 0.3 else 1500)] = rng.randrange(256)
        path.write_bytes(bad[: rng.randint(1, len(bad))] if rng.random() < 0.3 else bad)
        try:
            for frame in read(path).frames:
                assert np.isfinite(frame.positions).all()
        except InputError:
            refused += 1
    assert 20 < refused < 150
