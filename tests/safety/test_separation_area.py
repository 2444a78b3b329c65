"""The area of the present S_p around a robot: against the separation criterion, and drawn."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from made_cell import FLOATING, TWO_R, made, person, results_at, state_at, two_r
from seerob.core.errors import InputError, UnknownName
from seerob.core.figures import against
from seerob.criteria.judging import Judge
from seerob.distance.voxels import offset_shell
from seerob.twin.engine import Engine

CELL = (
    FLOATING
    + TWO_R
    + person("operator", 3.2, 0, 0)
    + """
[[parts]]
name = "post"
shape = { box = [0.1, 0.1, 0.1] }
at = { position = [0, 2.5, 0] }
[[safety]]
kind = "separation"
name = "ssm"
between = ["arm", "operator"]
stop = { acceleration = 0, reaction = 0.1, stopping = 0.3 }
human_speed = 1.6
intrusion = 0.1
human_uncertainty = 0.05
robot_uncertainty = 0.01
"""
)
AREA = '[[safety]]\nkind = "separation_area"\nname = "{of}"\nseparation = "ssm"\nof = "{of}"\n'


def results(folder, text, speed=1.0):
    return results_at(made(folder, text, {"arm.urdf": two_r()}), arm=((0.0, 0.0), (speed, 0.0)))


@pytest.mark.parametrize("speed", [0.0, 0.5, 2.0])
def test_the_room_of_a_person_is_the_least_margin_of_the_separation_criterion(tmp_path, speed):
    found = results(tmp_path, CELL + AREA.format(of="operator"), speed)
    ssm, area = found["ssm"], found["operator"]
    links = [p for p in ssm.parts if p.limit is not None]
    assert area.value == pytest.approx(min(p.value - p.limit for p in links), abs=1e-12)
    assert area.verdict == ssm.verdict


@pytest.mark.parametrize(("share", "verdict"), [(0.9, "within"), (1.1, "undecided")])
def test_what_tolerances_may_add_to_s_p_is_as_much_less_room(tmp_path, share, verdict):
    """Somebody faster by 0.4 s of margin reaches the arm: the area says so as its separation does."""
    text = CELL + AREA.format(of="operator")
    margin = results(tmp_path / "known", text, 0.0)["operator"].value
    assert margin > 0
    off = f"human_speed = 1.6\nhuman_speed_tolerance = {share * margin / 0.4}"
    found = results(tmp_path / "off", text.replace("human_speed = 1.6", off), 0.0)
    assert found["ssm"].verdict == found["operator"].verdict == verdict
    low, high = found["operator"].interval
    assert (low, high) == pytest.approx((margin * (1 - share), margin), abs=1e-9)


def test_a_part_beside_the_arm_is_judged_by_closed_form(tmp_path):
    """Link 1 turns at 1 rad/s: S_p = (v + 1.6) 0.4 + 0.16 with v of its fastest corner."""
    found = results(tmp_path, CELL + AREA.format(of="post"))
    v = np.hypot(1.0, 0.05)
    S_p1 = (v + 1.6) * 0.4 + 0.16
    gap1 = 2.5 - 0.05 - 0.05
    v2 = np.hypot(2.0, 0.05)
    S_p2 = (v2 + 1.6) * 0.4 + 0.16
    gap2 = np.hypot(1.0 - 0.05, gap1)
    assert found["post"].value == pytest.approx(min(gap1 - S_p1, gap2 - S_p2), abs=1e-9)


def test_it_grows_with_the_speed_and_is_drawn_around_every_moving_part(tmp_path):
    slow, fast = (
        results(tmp_path / str(v), CELL + AREA.format(of="operator"), v)["operator"] for v in (0.1, 1.0)
    )
    sizes = []
    for result in (slow, fast):
        hulls = [m for m in result.markers if type(m).__name__ == "Hull"]
        assert len(hulls) == 2
        sizes.append(np.ptp(np.array(hulls[1].vertices), axis=0))
    np.testing.assert_allclose(sizes[1] - sizes[0], 2 * 0.4 * 0.9 * np.hypot(2, 0.05), atol=5e-3)


def test_what_separation_does_not_know_leaves_it_undecided(tmp_path):
    text = CELL.replace("intrusion = 0.1\n", "") + AREA.format(of="post")
    found = results(tmp_path, text)["post"]
    assert found.verdict == "undecided"
    assert "intrusion" in found.reason


def test_of_a_robot_that_is_not_heard_it_says_what_it_would_have_bounded(tmp_path):
    station = made(tmp_path, CELL + AREA.format(of="post"), {"arm.urdf": two_r()})
    found = {result.name: result for result in Judge(station.bound)(Engine(station.model).start())}["post"]
    assert (found.verdict, found.value, found.unit, found.at_most) == ("undecided", None, "m", False)


@pytest.mark.parametrize(
    ("change", "words"),
    [(('separation = "ssm"', 'separation = "sms"'), "ssm"), (('of = "post"', 'of = "arm"'), "itself")],
)
def test_what_makes_no_sense_is_refused(tmp_path, change, words):
    with pytest.raises((InputError, UnknownName), match=words):
        made(tmp_path, CELL + AREA.format(of="post").replace(*change), {"arm.urdf": two_r()}).bound  # noqa: B018


def test_the_shell_lies_on_the_border_and_is_closed():
    rng = np.random.default_rng(3)
    points = rng.normal(size=(30, 3))
    vertices, faces = offset_shell(points, 0.4)
    from scipy.optimize import minimize
    from scipy.spatial import ConvexHull

    hull = ConvexHull(points)
    A, b = hull.equations[:, :3], hull.equations[:, 3]
    for v in vertices[::7]:
        limits = {"type": "ineq", "fun": lambda x: -(A @ x + b)}
        near = minimize(lambda x, v=v: ((x - v) ** 2).sum(), points.mean(axis=0), constraints=limits)
        assert np.sqrt(near.fun) == pytest.approx(0.4, abs=1e-4)
    edges = sorted(tuple(sorted((f[i], f[(i + 1) % 3]))) for f in faces for i in range(3))
    assert len(faces) == 80
    assert all(edges.count(e) == 2 for e in set(edges))


POSTS = '[[safety]]\nkind = "separation_area"\nname = "it"\nseparation = "ssm"\nof = ["far", "post"]\n'
FAR = '[[parts]]\nname = "far"\nshape = { box = [0.1, 0.1, 0.1] }\nat = { position = [0, 9, 0] }\n'


def test_who_is_inside_is_told_with_the_distance_by_which(tmp_path):
    """The post's near side is 1.1 m from the first link, and 0.95 m beside the end of the second's start."""
    text = CELL.replace("[0, 2.5, 0]", "[0, 1.2, 0]") + FAR + POSTS
    found = results(tmp_path, text)["it"]
    S_p1, S_p2 = ((np.hypot(way, 0.05) + 1.6) * 0.4 + 0.16 for way in (1.0, 2.0))
    room = min(1.1 - S_p1, np.hypot(0.95, 1.1) - S_p2)
    post, largest = found.parts
    assert (found.verdict, found.reason, found.limit, found.at_most) == ("exceeded", "post", 0.0, False)
    assert (post.name, post.verdict, post.limit, post.at_most) == ("post", "exceeded", 0.0, False)
    assert found.value == post.value == pytest.approx(room, abs=1e-9)
    shown = against(np.hypot(0.95, 1.1), S_p2, "m", at_most=False)
    assert post.reason == f"{shown.value} m from arm/l2, S_p {shown.limit} m"
    assert (largest.name, largest.value) == ("largest S_p", pytest.approx(S_p2, abs=1e-9))
    assert {found.unit, post.unit, largest.unit} == {"m"}
    lit = [m for m in found.markers if type(m).__name__ == "Segment"]
    assert lit[0].end[1] == pytest.approx(1.15)
    (hull, *_) = (m for m in found.markers if type(m).__name__ == "Hull")
    assert (hull.verdict, len(lit)) == ("exceeded", 1)


def test_the_picture_is_made_anew_when_it_is_old_or_the_verdict_changes(tmp_path):
    station = made(tmp_path, CELL + FAR + POSTS, {"arm.urdf": two_r()})
    state = state_at(station, arm=((0.0, 0.0), (0.1, 0.0)))
    judge, shown = Judge(station.bound), []
    for t, speed in zip((0.0, 0.0, 0.05, 0.1, 0.15, 0.12, 0.01, 0.02), (0.1,) * 7 + (9.0,), strict=True):
        state.data.qvel[0] = speed
        state.refresh(t)
        shown.append(next(m for m in judge(state)[1].markers if type(m).__name__ == "Hull"))
    again = [new is not old for old, new in pairwise(shown)]
    assert again == [False, False, True, False, False, True, True]
    assert [hull.verdict for hull in shown[-2:]] == ["within", "exceeded"]


def test_a_surface_that_may_stick_out_leaves_the_border_open(tmp_path):
    """A display mesh 20 mm larger than the links' boxes, to 35 mm at its corners."""
    visual = '<visual><origin xyz="0.5 0 0"/><geometry><box size="1.04 0.14 0.14"/></geometry></visual>'
    urdf = two_r().replace("</collision></link>", f"</collision>{visual}</link>")
    told = {}
    for k, y in enumerate(np.arange(1.36, 1.5, 0.012)):
        moved = CELL.replace("[0, 2.5, 0]", f"[0, {y}, 0]") + FAR + POSTS
        station = made(tmp_path / str(k), moved, {"arm.urdf": urdf})
        found = results_at(station, arm=((0.0, 0.0), (1.0, 0.0)))["it"]
        told[found.value] = str(found.verdict)
        off = max(body.deviation for body in station.model.bodies)
    assert 0.02 <= off <= 0.02 * np.sqrt(3) + 1e-9
    assert set(told.values()) == {"exceeded", "undecided", "within"}
    for room, verdict in told.items():
        assert verdict == ("exceeded" if room <= 0 else "undecided" if room <= off else "within")


@pytest.mark.parametrize(
    ("x", "verdict"), [(2.75 - 1e-9, "exceeded"), (2.75, "exceeded"), (2.75 + 1e-8, "within")]
)
def test_the_border_is_inside(tmp_path, x, verdict):
    """S_p of an arm at rest is 1 m/s for half a second; the arm ends at 2 m: figures without rounding."""
    text = CELL.replace("0.1, stopping = 0.3", "0.25, stopping = 0.25").replace("1.6\n", "1.0\n")
    text = text.replace("intrusion = 0.1", "intrusion = 0").replace("= 0.05", "= 0").replace("= 0.01", "= 0")
    text = text.replace("box = [0.1, 0.1, 0.1]", "box = [0.5, 0.5, 0.5]").replace(
        "[0, 2.5, 0]", f"[{x!r}, 0, 0]"
    )
    found = results(tmp_path, text + AREA.format(of="post"), 0.0)["post"]
    assert (found.verdict, found.reason) == (verdict, "post")
    assert len(found.parts) == (2 if verdict == "exceeded" else 1)
    assert found.parts[-1].value == 0.5
