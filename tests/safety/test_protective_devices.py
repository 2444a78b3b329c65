"""Scanner, curtain and mat: a person in the open, in a shadow, between beams; ISO 13855."""

from __future__ import annotations

import numpy as np
import pytest

from made_cell import FLOATING, TWO_R, heard, judged, made, results_at, state_at, two_r
from seerob.core.errors import InputError
from seerob.session.run import Judge
from seerob.twin.engine import Engine

PERSON = """
[[humans]]
name = "operator"
stature = 1.75
mass = 75
sex = "male"
at = {{ position = [{x}, {y}, 0] }}
"""
POLE = '[[parts]]\nname = "pole"\nshape = {{ cylinder = [{r}, 2] }}\nat = {{ position = [{x}, {y}, 0] }}\n'
SCANNER = """
[[sensors]]
name = "scan"
at = { position = [0, 0, 0.3] }
capability = 0.07
response = 0.08
source = "data sheet"
[sensors.laser_scanner]
range = 5.5
angle_deg = 270
resolution_deg = 0.5
fields = [{ name = "protective", corners = [[-1, -3], [4, -3], [4, 3], [-1, 3]] }]
"""
WATCH = '[[safety]]\nkind = "scanner_field"\nname = "s"\nsensor = "scan"\nof = "{of}"\n'
BLOCK = '[[parts]]\nname = "block"\nshape = { box = [0.5, 0.5, 1] }\nat = { position = [1.5, 0, 0.5] }\n'


def results(folder, text):
    return results_at(made(folder, FLOATING + text, {"arm.urdf": two_r()}))


def part(result, name):
    return next(p for p in result.parts if p.name == name)


@pytest.mark.parametrize(
    ("x", "y", "verdict", "words"),
    [
        (2.5, 1.5, "exceeded", "detected: operator/right_shank"),
        (2.8, 0.0, "exceeded", "NOT detected: operator/right_shank, in the shadow of block"),
        (-0.9, 0.0, "exceeded", "outside the angle that is scanned"),
        (4.5, 0.0, "within", ""),
    ],
)
def test_a_person_is_seen_in_the_open_and_not_in_a_shadow(tmp_path, x, y, verdict, words):
    s = results(tmp_path, PERSON.format(x=x, y=y) + BLOCK + SCANNER + WATCH.format(of="operator"))["s"]
    assert s.verdict == verdict
    assert words in s.reason
    assert (s.value <= 0) == (verdict == "exceeded")
    hidden = [m for m in s.markers if type(m).__name__ == "Label"]
    assert bool(hidden) == ("NOT" in s.reason or "outside" in s.reason)


@pytest.mark.parametrize(("r", "seen"), [(0.1, "detected"), (0.036, "detected"), (0.03, "may be missed")])
def test_what_is_narrower_than_the_detection_capability_may_be_missed(tmp_path, r, seen):
    s = results(tmp_path, SCANNER + POLE.format(r=r, x=2, y=0.5) + WATCH.format(of="pole"))["s"]
    assert part(s, "pole").reason.startswith(seen)
    assert s.verdict == "exceeded"


def test_the_shadow_of_a_block_has_the_area_of_its_trapezoid(tmp_path):
    """The block's front at x = 1.25 spans ±0.25; behind the scanner 90° are not scanned."""
    s = results(tmp_path, SCANNER + BLOCK + POLE.format(r=0.1, x=9, y=9) + WATCH.format(of="pole"))["s"]
    shadow = 0.25 / 1.25 * (4**2 - 1.25**2)
    assert part(s, "blind area").value == pytest.approx(shadow + 1.0, abs=0.15)
    assert part(s, "blind area now").value == part(s, "blind area").value


def test_the_picture_ends_at_the_first_thing_in_each_beam(tmp_path):
    s = results(tmp_path, SCANNER + BLOCK + POLE.format(r=0.1, x=9, y=9) + WATCH.format(of="pole"))["s"]
    fan = next(m for m in s.markers if type(m).__name__ == "Rays")
    assert fan.filled
    assert fan.starts == ((0.0, 0.0, 0.3),)
    points = np.array(fan.ends)
    np.testing.assert_allclose(points[:, 2], 0.3, atol=1e-3)
    behind = (points[:, 0] > 1.26) & (np.abs(points[:, 1]) < 0.19 * points[:, 0])
    assert not behind.any()
    assert points[:, 0].max() == pytest.approx(4.0, abs=1e-3)


@pytest.mark.parametrize(
    ("change", "verdict", "words"),
    [
        (("capability = 0.07\n", ""), "undecided", "detection capability not given"),
        (("resolution_deg = 0.5", "resolution_deg = 1.0"), "undecided", "beams are 87 mm apart"),
        (("response = 0.08\n", ""), "within", ""),
    ],
)
def test_an_empty_field_says_nothing_when_the_device_may_miss_somebody(tmp_path, change, verdict, words):
    text = SCANNER.replace(*change) + POLE.format(r=0.1, x=9, y=9) + WATCH.format(of="pole")
    s = results(tmp_path, text)["s"]
    assert s.verdict == verdict
    assert words in s.reason


def test_the_way_before_detection_is_measured(tmp_path):
    """An arm that turns into the field behind a block is not seen until it comes out of the shadow."""
    arm = TWO_R + "base = { position = [3.8, 0, 0.3] }\n"
    station = made(
        tmp_path, FLOATING + arm + BLOCK + SCANNER + WATCH.format(of="arm/l2"), {"arm.urdf": two_r()}
    )
    judge = Judge(station.bound)
    first = judge(state_at(station, arm=((np.pi - 0.02, 0.0), (0, 0))))[0]
    assert part(first, "walked before detection").value == 0.0
    assert "in the shadow of block" in first.reason


def test_the_way_in_the_shadow_and_until_the_output_switched_is_the_path_of_the_link(tmp_path):
    """At 1 rad/s out of the shadow, whose edge is the ray past the block's near corner, atan(0.25/1.25).

    The first beam beyond it is that of 11.5°; the link's own frame turns 1 m from the base.
    """
    arm = TWO_R + "base = { position = [3.8, 0, 0.3] }\n"
    text = "engine = { gravity = [0, 0, 0], physics = false }\n" + arm + BLOCK + SCANNER
    station = made(tmp_path, text + WATCH.format(of="arm/l2"), {"arm.urdf": two_r()})
    engine, judge = Engine(station.model, driven={"arm": 1.0}), Judge(station.bound)
    corners = np.array([[x, y] for x in (1.0, 2.0) for y in (-0.05, 0.05)])
    unseen = until = 0.0
    seen_at = last = None
    for k in range(60):
        t = 0.01 * k
        q = np.pi - 0.02 - t
        engine.take([heard("arm", t, (q, 0.0), (-1.0, 0.0))])
        state = engine.tick() if k else engine.start()
        result = judge(state)[0]
        R = np.array([[np.cos(q), -np.sin(q)], [np.sin(q), np.cos(q)]])
        at = corners @ R.T + [3.8, 0]
        joint = R @ [1.0, 0.0]
        chord = 0.0 if last is None else np.linalg.norm(joint - last)
        last = joint
        if seen_at is None:
            unseen += chord
            if np.degrees(np.arctan2(at[:, 1], at[:, 0])).max() >= 11.5:
                seen_at = t
        elif t - seen_at <= 0.08 + 1e-9:
            until += chord
        assert part(result, "walked before detection").value == pytest.approx(unseen, abs=1e-6)
        assert ("NOT" in result.reason) == (seen_at is None)
        if seen_at is not None:
            assert part(result, "walked until the output switched").value == pytest.approx(until, abs=1e-6)
    assert 0.05 < unseen < 0.3
    assert until == pytest.approx(0.08, abs=1e-4)


def test_an_unheard_robot_may_cast_a_shadow(tmp_path):
    text = SCANNER + TWO_R + POLE.format(r=0.1, x=9, y=9) + WATCH.format(of="pole")
    station = made(tmp_path, FLOATING + text, {"arm.urdf": two_r()})
    result = judged(station.bound, Engine(station.model).start())[0]
    assert result.verdict == "undecided"
    assert "arm" in result.reason


CURTAIN = """
[[sensors]]
name = "curtain"
capability = 0.03
response = 0.02
light_curtain = { ends = [[0, 2, 0.2], [3, 2, 0.2]], height = 1.5 }
"""
THROUGH = '[[safety]]\nkind = "light_curtain"\nname = "c"\nsensor = "curtain"\nof = "{of}"\n'
ROD = '[[parts]]\nname = "rod"\nshape = {{ box = [0.2, 0.2, {h}] }}\nat = {{ position = [1, 2, {z}] }}\n'


@pytest.mark.parametrize(
    ("h", "z", "verdict", "words"),
    [
        (0.10, 0.50, "exceeded", "detected: rod"),
        (0.01, 0.50, "exceeded", "may be missed: rod"),
        (0.01, 0.515, "exceeded", "NOT detected: rod, between two beams that are 30.0 mm apart"),
        (0.10, 0.10, "within", "rod"),
        (0.10, 1.80, "within", "rod"),
    ],
)
def test_what_reaches_through_a_curtain(tmp_path, h, z, verdict, words):
    c = results(tmp_path, CURTAIN + ROD.format(h=h, z=z) + THROUGH.format(of="rod"))["c"]
    assert c.verdict == verdict
    assert words in c.reason


def test_a_curtain_that_something_else_interrupts_is_undecided(tmp_path):
    text = CURTAIN + ROD.format(h=0.1, z=0.5) + POLE.format(r=0.1, x=9, y=9) + THROUGH.format(of="pole")
    c = results(tmp_path, text)["c"]
    assert c.verdict == "undecided"
    assert "beams are interrupted by rod" in c.reason


@pytest.mark.parametrize(("x", "verdict"), [(0.5, "exceeded"), (2.0, "within")])
def test_who_stands_on_a_mat(tmp_path, x, verdict):
    mat = '[[sensors]]\nname = "mat"\nresponse = 0.03\n'
    mat += "pressure_mat = { corners = [[0, -1], [1, -1], [1, 1], [0, 1]] }\n"
    watch = '[[safety]]\nkind = "pressure_mat"\nname = "m"\nsensor = "mat"\nof = "operator"\n'
    m = results(tmp_path, PERSON.format(x=x, y=0) + mat + watch)["m"]
    assert m.verdict == verdict
    assert all("foot" in p.name or "toes" in p.name for p in m.parts if p.name.startswith("operator"))


HAZARD = (
    '[[parts]]\nname = "saw"\nshape = {{ box = [0.2, 0.2, 0.2] }}\nat = {{ position = [{x}, {y}, 0.5] }}\n'
)
DISTANCE = (
    '[[safety]]\nkind = "device_distance"\nname = "d"\nsensor = "{sensor}"\nhazard = "saw"\nstopping = {t}\n'
)


@pytest.mark.parametrize(
    ("t", "S"), [(0.08, 0.2 + 0.128), (0.28, 1.6 * 0.3 + 0.128), (0.175, 0.5), (0.98, 1.6 + 0.128)]
)
def test_distance_of_a_curtain_by_the_2010_edition(tmp_path, t, S):
    """S = 2000 T + 8 (d - 14), or 1600 T + 8 (d - 14) but not less than 500 mm; d = 30 mm, t_1 = 20 ms."""
    more = 'edition = "2010"\nreach_over = 0\n'
    d = results(tmp_path, CURTAIN + HAZARD.format(x=1, y=1) + DISTANCE.format(sensor="curtain", t=t) + more)[
        "d"
    ]
    assert d.limit == pytest.approx(S, abs=1e-9) if t != 0.175 else d.limit >= 0.5
    assert d.value == pytest.approx(0.9, abs=2e-3)
    assert d.verdict == ("within" if S <= 0.89 else "exceeded")


def test_distance_of_a_field_is_that_to_the_edges_a_person_can_cross(tmp_path):
    """2024, parallel: 1600 T + 1200 + Z; the field's height of 0.3 m is 15 (70 - 50) mm, just enough."""
    more = "reach_under = 0\nsupplement = 0.1\n"
    text = SCANNER + HAZARD.format(x=0.5, y=0) + DISTANCE.format(sensor="scan", t=0.3) + more
    d = results(tmp_path / "all", text)["d"]
    assert d.limit == pytest.approx(1.6 * 0.38 + 1.2 + 0.1)
    assert d.value == pytest.approx(1.4)
    assert d.verdict == "exceeded"
    d = results(tmp_path / "front", text + "edges = [0, 1, 2]\n")["d"]
    assert (d.value, d.verdict) == (pytest.approx(2.9), "within")


@pytest.mark.parametrize(
    ("sensor", "more", "words"),
    [
        (
            SCANNER.replace("response = 0.08\n", ""),
            "reach_under = 0\nsupplement = 0\n",
            "response time is not given",
        ),
        (SCANNER, "reach_under = 0\n", "supplement Z is not given"),
        (SCANNER, "supplement = 0\n", "crawling under"),
        (SCANNER.replace("0.3]", "0.1]"), "reach_under = 0\nsupplement = 0\n", "too low"),
    ],
)
def test_what_a_distance_needs_and_nobody_said_is_undecided(tmp_path, sensor, more, words):
    text = sensor + HAZARD.format(x=0.5, y=0) + DISTANCE.format(sensor="scan", t=0.3) + more
    d = results(tmp_path, text)["d"]
    assert (d.verdict, d.value) == ("undecided", None)
    assert words in d.reason


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("[4, 3], [-1, 3]", "[-1, 3], [4, 3]", "crosses or touches itself"),
        ("range = 5.5", "range = 3", "beyond the range of 3 m"),
        ("resolution_deg = 0.5", "resolution_deg = 0.0001", "at most 20000"),
        (
            "[sensors.laser_scanner]",
            "pressure_mat = { corners = [[0,0],[1,0],[0,1]] }\n[sensors.laser_scanner]",
            "exactly one of",
        ),
        ("[[-1, -3], [4, -3], [4, 3], [-1, 3]]", "[[-1, -3], [4, -3]]", "corners"),
        ('name = "scan"', 'name = "scan"\non = "nobody/hand"', "nothing named 'nobody/hand'"),
        ('sensor = "scan"', 'sensor = "scam"', "did you mean 'scan'"),
        ('of = "pole"', 'of = "poles"', "poles"),
        ('of = "pole"', 'of = "pole"\nfield = "warning"', "no field 'warning'"),
    ],
)
def test_mistakes_are_told_before_the_run(tmp_path, old, new, words):
    text = SCANNER + POLE.format(r=0.1, x=9, y=9) + WATCH.format(of="pole")
    with pytest.raises(InputError, match=words.replace("(", r"\(")):
        results_at(made(tmp_path, FLOATING + text.replace(old, new, 1)))


def test_missing_figures_are_findings(tmp_path):
    text = SCANNER.replace("response = 0.08\n", "").replace('source = "data sheet"\n', "")
    said = [(f.level, f.text) for f in made(tmp_path, text + BLOCK).model.findings if f.subject == "scan"]
    assert ("warning", "response time not given: what depends on it is undecided") in said
    assert any(level == "assumed" for level, _ in said)
