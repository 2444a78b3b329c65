"""Speed along a path of two joints against a map by hand: shares, edges, and where it says nothing."""

from __future__ import annotations

import numpy as np
import pytest

from made_cell import FLOATING, TWO_R, made, results_at, two_r
from seerob.core.errors import InputError
from seerob.criteria.safety.path_speed import passed
from seerob.files.trajectories.path_map import (
    GIVEN,
    PERMISSIBLE,
    PIECE,
    TOOL,
    TOOL_GIVEN,
    TOOL_PERMISSIBLE,
    WHO,
    WHY,
)

HEAD = (PIECE, "J1 [rad]", "J2 [rad]", PERMISSIBLE, GIVEN, TOOL_PERMISSIBLE, TOOL_GIVEN, *TOOL, *WHO, WHY)
WATCH = '[[safety]]\nkind = "path_speed"\nname = "P"\nrobot = "arm"\nmap = "map.csv"\n'
ALONG = ((0, 0.0, 0.0, 2.0, "a"), (0, 1.0, 0.0, 0.5, "b"), (0, 2.0, 0.0, 0.8, "c"))
"""Piece, joints, permissible path speed and who says so: along the first joint."""


def watched(folder, q, qd, places=ALONG, more=""):
    rows = [[p, j1, j2, v, 1, v, 1, 0, 0, 0, who, "", "", "", ""] for p, j1, j2, v, who in places]
    table = "\n".join(",".join(map(str, row)) for row in (HEAD, *rows))
    station = made(folder, FLOATING + TWO_R + WATCH + more, {"arm.urdf": two_r(), "map.csv": table})
    return results_at(station, arm=(q, qd))["P"]


@pytest.mark.parametrize(
    ("q", "speed", "share", "verdict"),
    [
        # Of two places beside each other the lesser counts: 0.5 on both stretches.
        (0.25, 0.25, 0.5, "within"),
        (0.25, -0.5, 1.0, "exceeded"),
        (1.75, 0.5 - 1e-9, 1.0 - 2e-9, "within"),
        (1.75, 0.5, 1.0, "exceeded"),
        (1.75, 0.75, 1.5, "exceeded"),
    ],
)
def test_the_share_of_the_lesser_of_two_places(tmp_path, q, speed, share, verdict):
    found = watched(tmp_path, (q, 0.0), (speed, 0.0))
    assert (found.verdict, found.limit, found.at_most) == (verdict, 1.0, True)
    assert found.value == pytest.approx(share, rel=1e-12)
    assert found.reason == "b"


def test_speed_counts_all_joints(tmp_path):
    assert watched(tmp_path, (0.5, 0.0), (0.3, -0.4)).value == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("more", "off", "verdict"),
    [
        ("", 0.02, "within"),
        ("", np.nextafter(0.02, 1), "undecided"),
        ("", -0.021, "undecided"),
        ("tolerance = 0.5\n", 0.5, "within"),
        ("tolerance = 0.5\n", 0.51, "undecided"),
    ],
)
def test_off_the_path_by_more_than_the_tolerance_the_map_says_nothing(tmp_path, more, off, verdict):
    found = watched(tmp_path, (0.5, off), (0.1, 0.0), more=more)
    assert found.verdict == verdict
    assert ("off the path" in found.reason) == (verdict == "undecided")


@pytest.mark.parametrize(
    ("speed", "verdict", "value"),
    [(1e-3, "within", 0.0), (-1e-3, "within", 0.0), (1.001e-3, "exceeded", None)],
)
def test_where_no_speed_is_permitted_it_may_stand(tmp_path, speed, verdict, value):
    """A millimetre or a milliradian per second is standing."""
    found = watched(tmp_path, (0.5, 0.0), (speed, 0.0), [(*row[:3], 0.0, "n") for row in ALONG])
    assert (found.verdict, found.value) == (verdict, value)


def test_where_the_map_is_undecided_not_even_standing_is_within(tmp_path):
    places = [ALONG[0], (0, 1.0, 0.0, "", "nobody"), ALONG[2]]
    for q in (0.5, 1.5):
        found = watched(tmp_path, (q, 0.0), (0.0, 0.0), places)
        assert (found.verdict, found.value) == ("undecided", None)
        assert "map is undecided" in found.reason


def test_between_two_pieces_there_is_no_path(tmp_path):
    """The map goes 0 … 1 and 3 … 4; 2 is a radian from either."""
    places = [(p, x, 0.0, 1.0, "a") for p, x in ((0, 0.0), (0, 1.0), (1, 3.0), (1, 4.0))]
    for x, verdict in ((0.5, "within"), (2.0, "undecided"), (3.5, "within"), (4.5, "undecided")):
        assert watched(tmp_path, (x, 0.0), (0.5, 0.0), places).verdict == verdict
    alone = [(p, float(p), 0.0, 1.0, "a") for p in range(3)]
    with pytest.raises(InputError, match="no two places"):
        watched(tmp_path, (0.0, 0.0), (0.0, 0.0), alone)


def test_stretches_a_thousandth_farther_than_the_nearest_are_passed_too():
    away = np.array([0.0, 1.0, np.nextafter(1.0, 2), 2.0])
    legs = np.stack([np.zeros(4), away * 1e-3], 1), np.tile([1.0, 0.0], (4, 1))
    found = passed(np.array([0.5, 0.0]), np.array([1.0, 0.0]), legs)
    assert found.legs.tolist() == [0, 1]
    assert found.distance == 0


def test_a_stretch_without_a_length_is_its_place_and_distances_end_at_the_ends():
    legs = np.array([[0.0, 0.0], [5.0, 0.0]]), np.array([[0.0, 0.0], [3.0, 0.0]])
    for x, distance, leg in ((3.0, 2.0, 1), (1.0, 1.0, 0), (9.0, 1.0, 1), (6.0, 0.0, 1)):
        found = passed(np.array([x, 0.0]), np.zeros(2), legs)
        assert (found.distance, found.legs.tolist()) == (pytest.approx(distance), [leg])


def test_of_stretches_that_meet_the_one_that_it_follows_counts():
    """At a corner from x to y and back: along it, not across it, however slowly."""
    legs = np.zeros((3, 2)), np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0]])
    for qd, followed in (([0.1, 0.0], [0]), ([0.0, 0.1], [1]), ([-0.1, 0.0], [2]), ([0.0, 0.0], [0, 1, 2])):
        assert passed(np.zeros(2), np.array(qd), legs).legs.tolist() == followed


def test_at_a_place_between_two_stretches_the_lesser_counts_and_names_its_place(tmp_path):
    rising = [(0, float(k), 0.0, v, name) for k, (v, name) in enumerate(((0.3, "a"), (0.5, "b"), (0.8, "c")))]
    for x, speed, share, who in ((0.5, 0.3, 1.0, "a"), (1.0, 0.3, 1.0, "a"), (1.5, 0.25, 0.5, "b")):
        found = watched(tmp_path, (x, 0.0), (speed, 0.0), rising)
        assert (found.value, found.reason) == (pytest.approx(share), who)
