"""How far the tool point of a planar arm is from the nearest waypoint of its program, in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from made_cell import FLOATING, TWO_R, made, results_at, two_r
from seerob.core.errors import InputError

SOURCE = """[[sources]]
kind = "waypoints"
name = "program"
robot = "arm"
joint_speed = 1.0
joint_acceleration = 4.0
joint_jerk = 40.0
points = [{ q_deg = [0, 0] }, { name = "side", q_deg = [90, 0] }]
"""
ASKED = '[[safety]]\nkind = "waypoints"\nname = "w"\nrobot = "arm"\n'


@pytest.mark.parametrize(
    ("q", "value", "reason"),
    [
        ((0.0, 0.0), 0.0, "nearest is 1"),
        # From (2 cos q, 2 sin q) to (2, 0) and to (0, 2): chords of a circle of 2 m.
        ((0.5, 0.0), 4 * np.sin(0.25), "nearest is 1"),
        ((1.2, 0.0), 4 * np.sin((np.pi / 2 - 1.2) / 2), "nearest is side"),
        # The tip at (1, 1): √2 from both, the first is named.
        ((0.0, np.pi / 2 + 1e-9), np.sqrt(2), "nearest is side"),
    ],
)
def test_distance_to_the_nearest_waypoint(tmp_path, q, value, reason):
    station = made(tmp_path, FLOATING + TWO_R + SOURCE + ASKED, {"arm.urdf": two_r()})
    found = results_at(station, arm=(q, (0.0, 0.0)))["w"]
    assert found.value == pytest.approx(value, abs=1e-8)
    assert (found.unit, found.limit, found.verdict, found.reason) == ("m", None, None, reason)
    spheres = [m.center for m in found.markers if type(m).__name__ == "Sphere"]
    np.testing.assert_allclose(spheres, [(2, 0, 0), (0, 2, 0)], atol=1e-5)


def test_a_robot_without_a_program_is_refused(tmp_path):
    with pytest.raises(InputError, match="no source of kind waypoints"):
        results_at(made(tmp_path, FLOATING + TWO_R + ASKED, {"arm.urdf": two_r()}))


def test_waypoints_are_those_of_the_robots_own_program(tmp_path):
    """Of two arms at one place, each has its own; one of them states no largest speed."""
    text = TWO_R.replace('"arm"', '"other"') + TWO_R + SOURCE.replace('"arm"', '"other"')
    text = text.replace('"program"', '"its"') + SOURCE.replace("q_deg = [90, 0]", "q_deg = [180, 0]") + ASKED
    urdf = two_r().replace(' velocity="10"', "")
    station = made(tmp_path, FLOATING + text.replace("model = \"arm.urdf\"", 'model = "a.urdf"', 1),
                   {"arm.urdf": urdf, "a.urdf": two_r()})  # fmt: skip
    found = results_at(station, arm=((np.pi / 2, 0.0), (0.0, 0.0)))["w"]
    # From (0, 2) to (2, 0) and to (-2, 0).
    assert found.value == pytest.approx(2 * np.sqrt(2))


def test_the_working_point_of_the_tool_counts(tmp_path):
    """0.3 m beyond the tip, on which the tool sits."""
    tool = '[[tools]]\nname = "pin"\non = "arm/tip"\nshape = { sphere = 0.02 }\nmass = 1\n'
    tool += "tcp = { position = [0.3, 0, 0] }\n"
    station = made(tmp_path, FLOATING + TWO_R + tool + SOURCE + ASKED, {"arm.urdf": two_r()})
    for q, name in ((0.0, "1"), (np.pi / 2, "side")):
        found = results_at(station, arm=((q, 0.0), (0.0, 0.0)))["w"]
        assert (found.value, found.reason) == (pytest.approx(0, abs=1e-6), f"nearest is {name}")
    spheres = [m.center for m in found.markers if type(m).__name__ == "Sphere"]
    np.testing.assert_allclose(spheres, [(2.3, 0, 0), (0, 2.3, 0)], atol=1e-5)
