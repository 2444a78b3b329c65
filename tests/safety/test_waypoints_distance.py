"""How far the tool point of a planar arm is from the nearest waypoint of its program, in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from made_cell import FLOATING, TWO_R, made, results_at, two_r
from seerob.errors import InputError

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
