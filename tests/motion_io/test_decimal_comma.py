"""Tables of people with decimal commas, as the sink `csv` writes them on request."""

import numpy as np
import pytest

from seerob.core.errors import InputError
from seerob.description.capture.captured import Seen
from seerob.description.humans.skeleton import JOINTS
from seerob.files.motion_capture import body_table, joint_angles
from seerob.files.motion_capture.body_table import Commas
from seerob.files.motion_capture.markers import MarkerReading

KNEE = JOINTS.index("right_knee_extension")


def joints(path, *rows):
    path.write_text("\n".join(["time [s];right_knee_flexion [rad]", *rows]), encoding="utf-8")
    return joint_angles.from_table(path, file="r.csv")


def test_joints(tmp_path):
    found = joints(tmp_path / "r.csv", "0;0", "0,125;1,5", "0,250;-1,25e-1")
    np.testing.assert_array_equal(found.t, [0, 0.125, 0.25])
    np.testing.assert_array_equal(found.q[:, KNEE], [0, -1.5, 0.125])


def test_points(tmp_path):
    rows = [f"{k / 10:.1f};{k / 8};0.2;0.9;0.1;0.2;1.6".replace(".", ",") for k in range(4)]
    names = ("PELVIS", "HEAD")
    head = ";".join(["time [s]", *(f"{name} {axis} [m]" for name in names for axis in "xyz")])
    path = tmp_path / "r.csv"
    path.write_text("\n".join([head, *rows]), encoding="utf-8")
    captured = body_table.read_person(path, MarkerReading(file="r.csv"), seen=Seen.JOINTS, time_unit="")
    places = np.stack([frame.positions for frame in captured.frames])
    np.testing.assert_allclose(places[:, 0, 0], np.arange(4) / 8)
    np.testing.assert_allclose(places[:, 1], np.tile([0.1, 0.2, 1.6], (4, 1)))


def test_commas_that_may_separate_thousands_are_refused(tmp_path):
    with pytest.raises(InputError, match="decimals or thousands"):
        joints(tmp_path / "r.csv", "0;0", "1;1,125", "2;12,250")
    # One that cannot be of thousands tells what the others are.
    assert joints(tmp_path / "r.csv", "0;0", "1;1,125", "2;1,25").q[1, KNEE] == -1.125


@pytest.mark.parametrize("text", ["1,2,5", "1.000,5", "1,5.2", ",5", "5,", "a,5", "1,5 m", "１,5", ""])
def test_what_is_no_number(text):
    with pytest.raises(ValueError, match=r"is no number|could not convert"):
        Commas("r.csv").number(text)
