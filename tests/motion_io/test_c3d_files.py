"""C3D against two foreign libraries, in every number format that a header may announce."""

import struct
import warnings

import ezc3d
import numpy as np
import pytest

from seerob.core.errors import InputError
from seerob.files.motion_capture import c3d
from seerob.files.motion_capture.markers import MarkerReading
from seerob.files.motion_capture.upright import Up, height_of, up_axis, world_from_file

NAMES = ["S:LFHD", "S:C7", "S:LASI", "S:LANK", "S:*5", "box:a"]
FRAMES = 30


def positions(count=6, frames=FRAMES):
    rng = np.random.default_rng(5)
    heights = np.array([1700.0, 1450, 950, 80, 300, 700])[:count]
    return rng.normal(0, 30, (frames, count, 3)) + heights[:, None] * [0.0, 0.0, 1.0]


def written(path, values, *, names=NAMES, unit="mm", rate=100.0, screen="+Z"):
    file = ezc3d.c3d()
    point = file["parameters"]["POINT"]
    point["RATE"]["value"] = [rate]
    point["LABELS"]["value"] = list(names)
    point["UNITS"]["value"] = [unit]
    if screen:
        file.add_parameter("POINT", "Y_SCREEN", [screen])
    data = np.ones((4, len(names), len(values)))
    data[:3] = np.moveaxis(values, 2, 0).swapaxes(1, 2)
    file["data"]["points"] = data
    file.write(str(path))
    return path


def test_the_numbers_are_those_of_two_foreign_readers(tmp_path):
    values = positions()
    values[3:6, 1] = np.nan
    path = written(tmp_path / "r.c3d", values)
    found = c3d.read_points(path, file="r.c3d")
    theirs = ezc3d.c3d(str(path))["data"]["points"]
    np.testing.assert_array_equal(found.points, np.moveaxis(theirs[:3], 0, 2).swapaxes(0, 1))
    other = pytest.importorskip("c3d")
    with path.open("rb") as stream, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that there is no analogue data in it
        rows = np.array([points for _, points, _ in other.Reader(stream).read_frames()])
    seen = rows[..., 3] >= 0
    np.testing.assert_array_equal(np.isfinite(found.points).all(axis=2), seen)
    np.testing.assert_array_equal(found.points[seen], rows[..., :3][seen])
    assert (found.labels, found.units, found.rate) == (tuple(NAMES), "mm", 100.0)


def small(order, processor, scale, rows, *, dec=False):
    """The bytes of a file with points A and B, by hand."""

    def number(value):
        raw = struct.pack(order + "f", value * 4 if dec else value)
        return raw[2:] + raw[:2] if dec else raw

    def parameter(name, group, kind, dims, data):
        head = struct.pack("bb", len(name), group) + name.encode()
        rest = struct.pack(f"bB{len(dims)}B", kind, len(dims), *dims) + data + b"\0"
        return head + struct.pack(order + "h", len(rest) + 2) + rest

    group = struct.pack("bb", 5, -1) + b"POINT" + struct.pack(order + "h", 3) + b"\0"
    section = struct.pack("4B", 0, 0x50, 1, processor) + group
    section += parameter("LABELS", 1, -1, (1, 2), b"AB") + parameter("UNITS", 1, -1, (2,), b"mm")
    section += parameter("RATE", 1, 4, (), number(50.0)) + b"\0\0"
    head = struct.pack(order + "BB5H", 2, 0x50, 2, 0, 1, len(rows), 0) + number(scale)
    head += struct.pack(order + "2H", 3, 0) + number(50.0)
    data = b"".join(
        number(v) if scale < 0 else struct.pack(order + "h", int(v))
        for row in rows
        for x, y, z, state in row
        for v in (x, y, z, state)
    )
    return head.ljust(512, b"\0") + section.ljust(512, b"\0") + data


@pytest.mark.parametrize(
    ("order", "processor", "scale", "dec"),
    [(o, p, scale, p == 85) for o, p in (("<", 84), (">", 86), ("<", 85)) for scale in (-1.0, 0.5)],
)
def test_every_processor_and_both_number_formats(tmp_path, order, processor, scale, dec):
    rows = [[(100, -20, 3, 0), (7, 8, 9, -1)], [(101, -21, 4, 2), (-1, -2, -3, 0)]]
    path = tmp_path / "r.c3d"
    path.write_bytes(small(order, processor, scale, rows, dec=dec))
    found = c3d.read_points(path, file="r.c3d")
    factor = scale if scale > 0 else 1.0
    wanted = factor * np.array(rows, float)[..., :3]
    wanted[0, 1] = np.nan
    np.testing.assert_array_equal(found.points, wanted)
    assert (found.labels, found.units, found.rate) == (("A", "B"), "mm", 50.0)


def test_the_person_is_the_one_with_most_markers_in_metres(tmp_path):
    values = positions()
    captured = c3d.read(written(tmp_path / "r.c3d", values), MarkerReading(file="r.c3d"))
    assert captured.layout.names == ("LFHD", "C7", "LASI", "LANK")
    found = np.stack([frame.positions for frame in captured.frames])
    np.testing.assert_allclose(found, values[:, :4] / 1000, atol=1e-6)
    assert captured.rate == pytest.approx(100.0)
    told = "\n".join(f.text for f in captured.findings)
    assert "S is taken for the person" in told
    assert "1 points without a name are left out" in told


@pytest.mark.parametrize("up", list(Up))
def test_the_vertical_is_told_by_the_person_when_the_file_does_not_say(tmp_path, up):
    values = positions(4) @ world_from_file(up)
    path = written(tmp_path / "r.c3d", values, names=NAMES[:4], screen="")
    captured = c3d.read(path, MarkerReading(file="r.c3d"))
    found = np.stack([frame.positions for frame in captured.frames])
    np.testing.assert_allclose(found, positions(4) / 1000, atol=1e-6)
    assert any(f.level == "assumed" and f"{up} is taken for up" in f.text for f in captured.findings)


@pytest.mark.parametrize("up", list(Up))
def test_turning_upright_keeps_right_handed(up):
    turn = world_from_file(up)
    assert np.linalg.det(turn) == pytest.approx(1.0)
    axis = np.eye(3)["xyz".index(up[-1])] * (-1 if up.startswith("-") else 1)
    np.testing.assert_array_equal(turn @ axis, [0, 0, 1])


def test_names_that_say_nothing_are_asked_about(tmp_path):
    names = ["a", "b", "c", "d"]
    path = written(tmp_path / "r.c3d", positions(4), names=names, screen="")
    with pytest.raises(InputError, match="which axis is up"):
        c3d.read(path, MarkerReading(file="r.c3d"))
    assert up_axis(tuple(names), positions(4)) is None
    assert [height_of(n) for n in ("LFHD", "P:RASI", "LANK", "RTOE", "LWRA")] == [4, 2, 1, 0, None]


def test_a_wrong_unit_is_noticed(tmp_path):
    path = written(tmp_path / "r.c3d", positions(4), names=NAMES[:4], unit="m")
    with pytest.raises(InputError, match="m apart"):
        c3d.read(path, MarkerReading(file="r.c3d"))
    path = written(tmp_path / "s.c3d", positions(4), names=NAMES[:4], unit="furlong")
    with pytest.raises(InputError, match='give unit = "mm"'):
        c3d.read(path, MarkerReading(file="s.c3d"))


def test_a_file_that_ends_early_says_so(tmp_path):
    path = written(tmp_path / "r.c3d", positions(), names=NAMES)
    data = path.read_bytes()
    start = 512 * (struct.unpack_from("<H", data, 16)[0] - 1)
    path.write_bytes(data[: start + (FRAMES - 10) * len(NAMES) * 16])
    captured = c3d.read(path, MarkerReading(file="r.c3d"))
    assert captured.count == FRAMES - 10
    assert any("10 frames are missing at the end" in f.text for f in captured.findings)


TWICE = ["S:LFHD", "S:C7", "S:LASI", "S:LANK", "S:L-Asi", "S:RANK"]


def test_one_name_for_two_points_is_refused_and_may_be_left_out(tmp_path):
    path = written(tmp_path / "r.c3d", positions(), names=TWICE)
    with pytest.raises(InputError, match=r"one name for several points: LASI \(2 times, up to 0.7"):
        c3d.read(path, MarkerReading(file="r.c3d"))
    left_out = c3d.read(path, MarkerReading(file="r.c3d", unused=frozenset({"LASI"})))
    assert left_out.layout.names == ("LFHD", "C7", "LASI", "LANK", "RANK")


def test_one_name_for_points_that_are_never_seen_together_is_refused(tmp_path):
    values = positions()
    values[:, 4] = values[:, 2]
    values[:15, 4], values[15:, 2] = np.nan, np.nan
    path = written(tmp_path / "r.c3d", values, names=TWICE)
    with pytest.raises(InputError, match="never seen together"):
        c3d.read(path, MarkerReading(file="r.c3d"))


def test_one_point_under_one_name_twice_is_its_mean_and_said(tmp_path):
    values = positions()
    values[:, 4] = values[:, 2] + [0.0, 4.0, 0.0]
    values[3, 2] = np.nan
    path = written(tmp_path / "r.c3d", values, names=TWICE)
    found = c3d.read(path, MarkerReading(file="r.c3d"))
    k = found.layout.names.index("LASI")
    got = np.array([frame.positions[k] for frame in found.frames])
    expected = values[:, 2] + [0.0, 2.0, 0.0]
    expected[3] = values[3, 4]
    np.testing.assert_allclose(got, 1e-3 * expected, atol=1e-6)
    assert any("LASI is there 2 times, at most 4 mm apart" in f.text for f in found.findings)
