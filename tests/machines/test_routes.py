"""Ways on the floor, carts that follow them, and grippers that follow variables."""

from __future__ import annotations

import math

import numpy as np
import pytest

from seerob.core.shapes import Track
from seerob.twin.machines.following import follow
from seerob.workstation.tables.machines import Fingers, Route

SQUARE = ((0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0))


def test_a_rounded_square_is_as_long_as_its_sides_and_arcs():
    track = Track.rounded(SQUARE, 1.0, closed=True)
    assert track.length == pytest.approx(4 * 2 + math.tau, abs=1e-12)
    # Half way round the first corner: on the circle about (3, 1), looking north-east.
    q, per_metre = track.at(2 + math.pi / 4)
    np.testing.assert_allclose(q, [3 + math.sqrt(0.5), 1 - math.sqrt(0.5), math.pi / 4], atol=1e-12)
    np.testing.assert_allclose(per_metre, [math.sqrt(0.5), math.sqrt(0.5), 1.0], atol=1e-12)


@pytest.mark.parametrize("closed", [True, False])
def test_places_and_headings_go_on_without_a_jump(closed):
    points = ((0.0, 0.0), (3.0, 0.5), (4.0, 3.0), (1.0, 5.0), (-2.0, 2.0))
    track = Track.rounded(points, 0.4, closed=closed)
    s = np.linspace(0, track.length, 4001)
    q = np.array([track.at(x)[0] for x in s])
    rate = np.array([track.at(x)[1] for x in s])
    turned = np.unwrap(q[:, 2])
    middle = (rate[1:] + rate[:-1]) / 2
    step = s[1] - s[0]
    np.testing.assert_allclose(np.diff(q[:, :2], axis=0) / step, middle[:, :2], atol=5e-3)
    assert np.abs(np.diff(turned)).max() <= step / 0.4 * (1 + 1e-9)
    ends = points[0] if closed else points[-1]
    np.testing.assert_allclose(q[-1, :2], q[0, :2] if closed else ends, atol=1e-9)


@pytest.mark.parametrize(
    ("points", "radius", "closed", "message"),
    [
        (((0, 0), (0, 0)), 0.0, False, "in one place"),
        (((0, 0), (1, 0), (1, 1)), 0.0, False, "needs a radius"),
        (((0, 0), (1, 0), (0, 0)), 0.1, False, "turns back"),
        (((0, 0), (1, 0), (1, 1)), 2.0, False, "does not fit"),
        (((0, 0), (1, 0)), 0.1, True, "three points"),
        (((0, 0), (1, 0)), 0.0, False, "start = 2 m lies behind"),
    ],
)
def test_ways_that_cannot_be_are_told(points, radius, closed, message):
    with pytest.raises(ValueError, match=message):
        Route(points=points, radius=radius, closed=closed, start=2.0)


def test_a_cart_goes_round_and_round_at_its_speed():
    route = Route(points=SQUARE, radius=1.0, closed=True, speed="v", placed="p", start=0.5)
    at = follow(route)
    places = [at(0.1 * k, {"v": 0.7, "p": False}) for k in range(400)]
    expected = np.array([route.track.at((0.5 + 0.07 * k) % route.track.length)[0] for k in range(400)])
    q = np.array([place.q for place in places])
    np.testing.assert_allclose(q[:, :2], expected[:, :2], atol=1e-9)
    # Round it goes, its heading has gone on turning, and it was never put anywhere.
    np.testing.assert_allclose(q[:, 2], np.unwrap(expected[:, 2]), atol=1e-9)
    assert not any(place.anew for place in places)
    assert places[-1].qd is not None
    assert np.hypot(*places[-1].qd[:2]) == pytest.approx(0.7)
    lost = at(60.0, {"v": 0.7, "p": False})
    assert "not known since" in lost.invalid_reason
    again = at(60.1, {"v": 0.7, "p": True})
    assert (again.invalid_reason, again.anew) == ("", True)
    np.testing.assert_allclose(again.q[:2], [1.5, 0.0], atol=1e-9)


def test_fingers_go_half_the_way_each():
    at = follow(Fingers(opening="w", upper=0.1))
    assert at(0.0, {"w": 0.06}).q.tolist() == [0.03]
    ends = follow(Fingers(open="o", lower=0.0, upper=0.08, travel=0.4))
    assert ends(0.0, {"o": True}).q.tolist() == [0.04]
    going = ends(0.2, {"o": False})
    assert going.q == pytest.approx([0.02])
    assert "on its way since o changed" in going.invalid_reason
    shut = ends(0.4, {"o": False})
    assert (shut.q.tolist(), shut.invalid_reason) == ([0.0], "")
    with pytest.raises(ValueError, match="right angles to z"):
        Fingers(along=(0, 1, 1))
