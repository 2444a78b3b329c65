"""One person of ours before a camera: every format of a body tracker gives back where the joints were."""

from dataclasses import replace

import made_pictures
import numpy as np
import pytest

from seerob.app.emulators.kinect import CAMERA
from seerob.core.errors import InputError
from seerob.files.motion_capture import kinect_recording, ros_bag
from seerob.files.motion_capture.kinect_recording import Reading
from seerob.protocols.tracking.kinect import JOINTS, body_object

LOST = range(10, 14)
KNOWN = Reading("r", level=True)


@pytest.fixture(scope="module")
def pictures():
    return made_pictures.pictures(lost=LOST)


def expected(pictures):
    rows = [p.bodies[0].positions if p.bodies else np.full((32, 3), np.nan) for p in pictures]
    return np.stack(rows)


def write(path, pictures, kind):
    if kind == "json":
        path = path / "r.json"
        path.write_text(made_pictures.offline_json(pictures))
        return path, kinect_recording.read_json
    if kind in ("ros1", "ros2"):
        path = path / ("r.bag" if kind == "ros1" else "r")
        return made_pictures.bag(path, pictures, ros2=kind == "ros2"), ros_bag.read
    path = path / "r.csv"
    path.write_text(wide(pictures) if kind == "wide" else long(pictures))
    return path, kinect_recording.read_text


def wide(pictures):
    head = ["timestamp_usec", "body_id", *(f"{n}_{a} [mm]" for n in JOINTS for a in "XYZ")]
    lines = [",".join(head)]
    for p in pictures:
        values = np.array(body_object(p.bodies[0]).joint_positions).ravel() if p.bodies else []
        cells = [f"{x:.2f}" for x in values] or [""] * 96
        lines.append(",".join([str(round(p.t * 1e6)), "1" if p.bodies else "", *cells]))
    return "\n".join(lines)


def long(pictures):
    lines = ["time [s]\tbody id\tjoint\tx [mm]\ty [mm]\tz [mm]\tconfidence"]
    for p in pictures:
        for body in p.bodies:
            for name, xyz in zip(JOINTS, body_object(body).joint_positions, strict=True):
                lines.append("\t".join([f"{p.t:.6f}", "1", name, *map(str, xyz), "2"]))
    return "\n".join(lines)


@pytest.mark.parametrize("kind", ["json", "ros1", "ros2", "wide", "long"])
def test_joints_are_where_they_were_in_the_frame_of_the_camera(tmp_path, pictures, kind):
    path, read = write(tmp_path, pictures, kind)
    captured = read(path, KNOWN)
    wanted = expected(pictures)
    if kind == "long":  # a table with a row per joint has none for a picture in which nobody is
        wanted = wanted[[k for k in range(len(pictures)) if k not in LOST]]
    found = np.stack([frame.positions for frame in captured.frames])
    np.testing.assert_allclose(found, wanted, atol=2e-5)
    t = np.array([frame.t for frame in captured.frames])
    when = np.array([p.t for p in pictures if kind != "long" or p.bodies])
    np.testing.assert_allclose(t, when, atol=1e-6)  # the camera counts microseconds
    assert captured.count == len(wanted)
    if kind != "long":
        assert any("not seen in 4 of 40 frames" in f.text for f in captured.findings)


def test_a_camera_whose_pose_nobody_gave_is_put_upright_over_the_floor(tmp_path):
    path, read = write(tmp_path, made_pictures.pictures(file="library:walk"), "json")
    captured = read(path, Reading("r"))
    (told,) = (f.text for f in captured.findings if "pose of the camera estimated" in f.text)
    tilt = float(told.split("tilted by ")[1].split("°")[0])
    height = float(told.split("°, ")[1].split(" m above")[0])
    assert tilt == pytest.approx(12.0, abs=3.0)
    assert height == pytest.approx(CAMERA[2, 3], abs=0.1)


def test_two_persons_are_asked_about_and_each_is_found_by_number(tmp_path, pictures):
    aside = np.array([0, 1.5, 0])
    both = []
    for p in pictures:
        for body in p.bodies:
            other = replace(body, id=7, positions=body.positions + aside)
            both.append(replace(p, bodies=(body, other)))
    path, read = write(tmp_path, both, "json")
    with pytest.raises(InputError, match=r"several persons at once: 1 .*7"):
        read(path, KNOWN)
    first, second = (read(path, replace(KNOWN, subject=s)) for s in ("1", "7"))
    way = next(iter(second.frames)).positions - next(iter(first.frames)).positions
    np.testing.assert_allclose(way, np.tile([0, 1.5, 0], (32, 1)), atol=3e-5)
    with pytest.raises(InputError, match="no body '3'"):
        read(path, replace(KNOWN, subject="3"))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{}", "no list 'frames'"),
        ('{"frames": [{"timestamp_usec": 1', "the file ends in element 0"),
        ('{"frames": [{"timestamp_usec": "x"}]}', "frames\\[0\\]"),
        ('{"frames": [{"timestamp_usec": 1, "num_bodies": 3, "bodies": []}]}', "num_bodies is 3"),
        ('{"frames": [5, {"timestamp_usec": 1}]}', "nobody is seen"),
        ('{"frames": [' + "[" * 99, "not an object|nested deeper"),
        ('{"joint_names": ["A", "B"], "frames": []}', "2 joints"),
        ("[1]", "does not begin with"),
    ],
)
def test_what_is_wrong_with_a_json_file_is_said(tmp_path, text, message):
    path = tmp_path / "r.json"
    path.write_text(text)
    with pytest.raises(InputError, match=message):
        kinect_recording.read_json(path, KNOWN)


def test_a_table_without_a_unit_is_asked_about(tmp_path, pictures):
    path = tmp_path / "r.csv"
    path.write_text(wide(pictures).replace(" [mm]", ""))
    with pytest.raises(InputError, match="no header says the unit"):
        kinect_recording.read_text(path, KNOWN)
    assert kinect_recording.read_text(path, KNOWN, unit="mm").count == len(pictures)


def test_a_topic_that_is_not_there_is_named_with_those_that_are(tmp_path, pictures):
    path = made_pictures.bag(tmp_path / "r.bag", pictures[:3])
    with pytest.raises(InputError, match="/body_tracking_data"):
        ros_bag.read(path, KNOWN, topic="/other")
    path.write_bytes(path.read_bytes()[:300])
    with pytest.raises(InputError, match="not a ROS bag that can be read"):
        ros_bag.read(path, KNOWN)


def test_what_the_tracker_only_predicts_is_not_seen(tmp_path, pictures):
    """Low, 1, is a joint that is not observed: as none, 0, and unlike medium and high."""
    text = long(pictures).splitlines()
    for level, seen in ((0, False), (1, False), (2, True), (3, True)):
        path = tmp_path / f"{level}.csv"
        rows = [line[:-1] + str(level) if "\tELBOW_LEFT\t" in line else line for line in text]
        path.write_text("\n".join(rows))
        captured = kinect_recording.read_text(path, KNOWN)
        elbow = np.stack([frame.confidence for frame in captured.frames])[:, JOINTS.index("ELBOW_LEFT")]
        assert set(elbow[np.isfinite(elbow)]) == {float(seen)}
        assert not any("no confidences in it" in f.text for f in captured.findings)


def test_a_file_without_confidences_says_what_that_means(tmp_path, pictures):
    for kind in ("json", "ros1"):
        path, read = write(tmp_path, pictures, kind)
        assert any("only predicts count as seen" in f.text for f in read(path, KNOWN).findings)
