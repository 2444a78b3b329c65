"""Tables of captured motion: headers say what is what, everything else is asked."""

import numpy as np
import pytest

from seerob.core.errors import InputError
from seerob.description.capture.captured import Seen
from seerob.files.motion_capture import body_table
from seerob.files.motion_capture.body_table import Column, column
from seerob.files.motion_capture.markers import MarkerReading

NAMES = ("Head", "Left Foot", "pelvis")
READING = MarkerReading(file="r.csv")


@pytest.mark.parametrize(
    ("header", "wanted"),
    [
        ("PELVIS_X [mm]", Column("PELVIS", "position", 0, "mm")),
        ("LeftHand position y (m)", Column("LeftHand", "position", 1, "m")),
        ("LeftHandZ", Column("LeftHand", "position", 2)),
        ("head.qw", Column("head", "orientation", 0)),
        ("Left Hand rotation Z", Column("Left Hand", "orientation", 3)),
        ("wrist confidence", Column("wrist", "confidence")),
        ("Left Foot TrackingState", Column("Left Foot", "level")),
        ("tracking_state", Column("", "level")),
        ("timestamp_usec", Column("", "time", unit="us")),
        ("Time (ms)", Column("", "time", unit="ms")),
        ("body_id", Column("", "person")),
        ("joint", Column("", "point")),
        ("qx", Column("", "orientation", 1)),
        ("y [cm]", Column("", "position", 1, "cm")),
        ("frame", None),
        ("INDEX", None),
    ],
)
def test_headers(header, wanted):
    assert column(header) == wanted


def values():
    rng = np.random.default_rng(2)
    return rng.normal(0, 0.02, (12, 3, 3)) + np.array([1.7, 0.05, 0.95])[:, None] * [0.0, 0.0, 1.0]


def text(delimiter=",", *, time="time [s]", unit=" [m]", person=None):
    head = [time, *([] if person is None else ["person"])]
    head += [f"{name} {axis}{unit}" for name in NAMES for axis in "xyz"]
    rows = [delimiter.join(head)]
    for k, row in enumerate(values().reshape(12, -1)):
        rows += [
            delimiter.join([str(k / 10), *([] if person is None else [p]), *(f"{x:.6f}" for x in row)])
            for p in person or ("",)
        ]
    return "\n".join(rows)


def read(tmp_path, content, reading=READING, **more):
    path = tmp_path / "r.csv"
    path.write_text(content)
    return body_table.read_person(path, reading, seen=Seen.JOINTS, **more)


@pytest.mark.parametrize("delimiter", [",", ";", "\t", "|"])
def test_points_are_where_the_table_says(tmp_path, delimiter):
    captured = read(tmp_path, text(delimiter))
    found = np.stack([frame.positions for frame in captured.frames])
    np.testing.assert_allclose(found, values(), atol=1e-6)
    assert captured.layout.names == NAMES
    assert captured.rate == pytest.approx(10.0)


def test_what_is_open_is_asked(tmp_path):
    with pytest.raises(InputError, match='give unit = "m"'):
        read(tmp_path, text(unit=""))
    with pytest.raises(InputError, match="no unit in the header of the time"):
        read(tmp_path, text(time="time"))
    assert read(tmp_path, text(time="time"), time_unit="ms").rate == pytest.approx(10_000.0)
    with pytest.raises(InputError, match="several persons"):
        read(tmp_path, text(person=("a", "b")))
    chosen = MarkerReading(file="r.csv", subject="b")
    assert read(tmp_path, text(person=("a", "b")), chosen).count == 12


def test_empty_cells_were_not_seen_and_words_are_refused(tmp_path):
    lines = text().splitlines()
    lines[3] = ",".join([*lines[3].split(",")[:-3], "", "NaN", ""])
    captured = read(tmp_path, "\n".join(lines))
    assert np.isnan(list(captured.frames)[2].positions).sum() == 3
    lines[4] = lines[4].replace(",", ",lost", 1)
    with pytest.raises(InputError, match="row 5: 'lost"):
        read(tmp_path, "\n".join(lines))


def test_a_table_with_a_row_per_point_is_the_same(tmp_path):
    rows = ["t [s];marker;x [mm];y [mm];z [mm];qw;qx;qy;qz"]
    for k, row in enumerate(values() * 1000):
        rows += [
            ";".join([str(k / 10), name, *(f"{x:.4f}" for x in point), "1", "0", "0", "0"])
            for name, point in zip(NAMES, row, strict=True)
        ]
    captured = read(tmp_path, "\n".join(rows))
    frames = list(captured.frames)
    np.testing.assert_allclose([f.positions for f in frames], values(), atol=1e-6)
    np.testing.assert_allclose([f.orientations for f in frames], np.tile([1.0, 0, 0, 0], (12, 3, 1)))


def by_point(more="", header="", every=lambda k, name: ""):
    rows = [f"t [s];marker;x [m];y [m];z [m]{header}"]
    for k, row in enumerate(values()):
        rows += [
            ";".join([str(k / 10), name, *(f"{x:.4f}" for x in point)]) + every(k, name)
            for name, point in zip(NAMES, row, strict=True)
        ]
    return "\n".join(rows) + more


@pytest.mark.parametrize(
    ("header", "said", "shares"),
    [
        ("confidence", (0, 1, 2, 3), (0, 0, 1, 1)),
        ("confidence", (0, 0.4, 1, 1), (0, 0.4, 1, 1)),
        ("tracking_state", (0, 1, 1, 1), (0, 0, 0, 0)),
        ("tracking_state", (0, 1, 2, 2), (0, 0, 1, 1)),
    ],
)
def test_a_joint_that_a_tracker_only_predicts_is_not_seen(tmp_path, header, said, shares):
    """A level of 1 was a whole share: fully seen."""
    content = by_point(header=f";{header}", every=lambda k, name: f";{said[k % 4]}")
    found = [frame.confidence.tolist() for frame in read(tmp_path, content).frames]
    assert found == [[shares[k % 4]] * 3 for k in range(12)]


@pytest.mark.parametrize("largest", [100, 1.5, 4])
def test_confidences_that_are_neither_shares_nor_levels_are_refused(tmp_path, largest):
    content = by_point(header=";confidence", every=lambda k, name: f";{largest if k else 1}")
    with pytest.raises(InputError, match=f"confidences up to {largest}; give shares from 0 to 1"):
        read(tmp_path, content)


def test_two_rows_for_one_point_of_one_instant_are_refused(tmp_path):
    """The last one won without a word: of two people without a column for them, the second."""
    twice = f"\n0.5;pelvis;{';'.join(f'{x:.4f}' for x in values()[5, 2])}"
    assert read(tmp_path, by_point(more=twice)).count == 12
    with pytest.raises(InputError, match="1 rows of an instant that has another of the same point: pelvis"):
        read(tmp_path, by_point(more="\n0.5;pelvis;0.2;0.1;0.9"))


def test_incomplete_coordinates_are_named(tmp_path):
    with pytest.raises(InputError, match="2 columns for the position of pelvis"):
        read(tmp_path, text().replace("pelvis z [m]", "pelvis"))
