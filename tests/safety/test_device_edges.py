"""Edges of scanner, curtain and their distances, one figure, sign and comparison at a time."""

from __future__ import annotations

import math

import numpy as np
import pytest

from made_cell import FLOATING, TWO_R, made, results_at, state_at, two_r
from seerob.core.errors import InputError
from seerob.core.plugin import kinds, load
from seerob.criteria.criterion import Criterion
from seerob.criteria.judging import Judge
from seerob.criteria.safety import device_distance
from test_testing import BELOW

ZERO = ((0.0, 0.0), (0.0, 0.0))
ROD = '[[parts]]\nname = "{name}"\nshape = {{ box = [{x}, {y}, {z}] }}\nat = {{ position = {at} }}\n'
POLE = '[[parts]]\nname = "{name}"\nshape = {{ cylinder = [{r}, 2] }}\nat = {{ position = {at} }}\n'
SCANNER = """
[[sensors]]
name = "scan"
at = {{ position = [0, 0, 0.3] }}
{more}
[sensors.laser_scanner]
range = 5.5
angle_deg = 270
resolution = {resolution!r}
fields = [{{ name = "protective", corners = [[-1, -3], [4, -3], [4, 3], [-1, 3]] }}]
"""
SEEN = '[[safety]]\nkind = "scanner_field"\nname = "s"\nsensor = "scan"\nof = "{of}"\n'
HALF = math.radians(0.5)


def results(folder, text, motion=ZERO):
    more = {"arm": motion} if "[[robots]]" in text else {}
    return results_at(made(folder, FLOATING + text, {"arm.urdf": two_r()}), **more)


def bounded(result):
    """Every limit in it, and whether it bounds from above."""
    own = [] if result.limit is None else [(result.limit, result.at_most)]
    return own + [each for part in result.parts for each in bounded(part)]


def scanned(folder, tables, *, more="capability = 0.07", resolution=HALF, of="pole"):
    return results(folder, tables + SCANNER.format(more=more, resolution=resolution) + SEEN.format(of=of))[
        "s"
    ]


def test_which_kinds_bound_from_below():
    for name in kinds("safety"):
        kind = load("safety", name, Criterion)
        if name != "variable":  # what it is told says on which side its limit is
            assert kind.at_most is (name not in BELOW), name


def test_units_of_all_kinds():
    units = dict.fromkeys(BELOW & {*kinds("safety")} | {"waypoints"}, "m") | {
        "effective_mass": "kg",
        "force_polytope": "N",
        "kinetic_energy": "J",
        "manipulability": "m/rad",
        "path_speed": "",
        "power_and_force": "m/s",
        "swept_volume": "m³",
        "tool_force": "N",
        "velocity": "m/s",
    }
    for name, unit in units.items():
        assert load("safety", name, Criterion).unit == unit, name


FIELDS = SCANNER.format(more="capability = 0.07\nresponse = 0.08", resolution=HALF)
MAT = (
    '[[sensors]]\nname = "mat"\nresponse = 0.03\n'
    "pressure_mat = { corners = [[-1, -3], [4, -3], [4, 3], [-1, 3]] }\n"
)
CURTAIN = (
    '[[sensors]]\nname = "curtain"\ncapability = 0.03\nresponse = 0.02\n'
    "light_curtain = { ends = [[4, -3, 0], [4, 3, 0]], height = 1.5 }\n"
)
BALL = """
[[machines]]
name = "ball"
shape = { sphere = 0.3 }
at = { position = [4, 0, 0.3] }
slide = { along = [1, 0, 0], lower = -8, upper = 8 }
"""
PRESENT = '[[safety]]\nkind = "{kind}"\nname = "s"\nsensor = "{sensor}"\nof = "ball"\n'
FAR = (
    '[[safety]]\nkind = "device_distance"\nname = "s"\nsensor = "{sensor}"\nhazard = "ball"\nstopping = 0.2\n'
)
SETTLED = "reach_over = 0\nreach_under = 0\nsupplement = 0.1\n"


@pytest.mark.parametrize(
    ("text", "x", "away"),
    [
        (FIELDS + PRESENT.format(kind="scanner_field", sensor="scan"), 0.5, 1),
        (MAT + PRESENT.format(kind="pressure_mat", sensor="mat"), 0.5, 1),
        (CURTAIN + PRESENT.format(kind="light_curtain", sensor="curtain"), 0.5, 1),
        (CURTAIN + PRESENT.format(kind="light_curtain", sensor="curtain"), -0.5, -1),
        (CURTAIN + FAR.format(sensor="curtain") + SETTLED, -3.0, -1),
        (CURTAIN + FAR.format(sensor="curtain") + SETTLED + 'edition = "2010"\n', -3.0, -1),
        (FIELDS + FAR.format(sensor="scan") + SETTLED + "edges = [1]\n", -3.0, -1),
        (FIELDS + FAR.format(sensor="scan") + SETTLED + 'edges = [1]\nedition = "2010"\n', -3.0, -1),
        (MAT + FAR.format(sensor="mat") + SETTLED + "edges = [1]\n", -3.0, -1),
    ],
)
def test_who_is_exactly_where_a_device_says_is_too_near(tmp_path, text, x, away):
    """Whoever is on the border, or at S, to the last bits is not beyond it; a tenth of a millimetre is."""
    station = made(tmp_path, FLOATING + BALL + text)

    def at(x):
        state = state_at(station, ball=((x,), (0.0,)))
        return Judge(station.bound)(state)[0]

    far = at(x)
    assert far.verdict == "within", far.reason
    for _ in range(60):  # a mat is met aslant
        now = at(x)
        x -= away * (now.value - now.limit)
    assert at(x).value == pytest.approx(far.limit, abs=1e-9)
    for off in (-1e-12, 0.0, 1e-12):
        assert at(x + off).verdict == "exceeded"
    assert at(x + 1e-4 * away).verdict == "within"


# -- scanner --------------------------------------------------------------------------------------


@pytest.mark.parametrize("others", [0, 1, 2, 3])
def test_a_thin_pole_may_be_missed_whatever_else_there_is(tmp_path, others):
    """Whichever number its body has: 60 mm at 2 m, seen against 70 mm."""
    far = "".join(POLE.format(name=f"far{k}", r=0.1, at=[9, 9 + k, 0]) for k in range(others))
    s = scanned(tmp_path, far + POLE.format(name="pole", r=0.03, at=[2, 0.5, 0]))
    (pole,) = (part for part in s.parts if part.name == "pole")
    assert pole.reason.startswith("may be missed: 5")
    assert set(bounded(s)) == {(0.0, False)}


def test_a_wire_that_only_one_beam_meets_has_no_width(tmp_path):
    s = scanned(tmp_path, POLE.format(name="pole", r=1e-4, at=[2, 0, 0]))
    assert "may be missed" in s.reason
    assert s.verdict == "exceeded"


@pytest.mark.parametrize(("at", "verdict"), [([4.5, 0.5, 0], "within"), ([-1.5, 1, 0], "within")])
def test_a_pole_beside_the_field_is_seen_but_not_in_it(tmp_path, at, verdict):
    s = scanned(tmp_path, POLE.format(name="pole", r=0.1, at=at))
    assert s.verdict == verdict


def test_beams_as_far_apart_as_the_capability_are_near_enough(tmp_path):
    """The field's farthest corner is 5 m away."""
    pole = POLE.format(name="pole", r=0.1, at=[9, 9, 0])
    apart = math.hypot(4, 3) * HALF
    assert scanned(tmp_path / "a", pole, more=f"capability = {apart!r}").verdict == "within"
    finer = scanned(tmp_path / "b", pole, more=f"capability = {float(np.nextafter(apart, 0))!r}")
    assert finer.verdict == "undecided"


def test_a_scanner_on_a_link_looks_at_what_stands_from_where_it_is_now(tmp_path):
    """A wall ahead of the arm hides a part of the field; with the arm turned away it hides none."""
    wall = ROD.format(name="wall", x=0.1, y=6, z=2, at=[4, 0, 0]) + POLE.format(
        name="far", r=0.1, at=[99, 9, 0]
    )
    scan = SCANNER.format(more='capability = 0.07\non = "arm/l2"\nignores = ["arm"]', resolution=HALF)
    scan = scan.replace("[0, 0, 0.3]", "[1.1, 0, 0.3]")
    station = made(tmp_path, FLOATING + TWO_R + wall + scan + SEEN.format(of="far"), {"arm.urdf": two_r()})
    judge = Judge(station.bound)

    def blind(q):
        (found,) = judge(state_at(station, arm=((q, 0.0), (0.0, 0.0))))
        return next(part.value for part in found.parts if part.name == "blind area")

    ahead, away = blind(0.0), blind(np.pi)
    assert ahead > away + 5
    assert blind(0.0) == ahead


# -- curtain --------------------------------------------------------------------------------------

CURTAIN = """
[[sensors]]
name = "curtain"
at = {{ position = {at} }}
{more}
light_curtain = {{ ends = [[0, 2, 0.2], [3, 2, 0.2]], height = {height}{pitch} }}
"""
THROUGH = '[[safety]]\nkind = "light_curtain"\nname = "c"\nsensor = "curtain"\nof = "rod"\n'


def curtained(
    folder, *, at=(0, 0, 0), more="capability = 0.03", height=1.5, pitch="", z=0.1, rod=(1, 2, 0.5)
):
    text = CURTAIN.format(at=list(at), more=more, height=height, pitch=pitch)
    text += ROD.format(name="rod", x=0.1, y=0.2, z=z, at=list(rod))
    station = made(folder, FLOATING + text + THROUGH, {})
    return results_at(station)["c"], station


@pytest.mark.parametrize(("height", "beams"), [(1.5, 51), (1.49, 51), (1.51, 52), (0.03, 2)])
def test_a_curtain_has_a_beam_at_both_ends_and_none_too_far_from_the_next(tmp_path, height, beams):
    found, _ = curtained(tmp_path, height=height, rod=(1, 2, 0.25), z=0.3)
    (rod,) = (part for part in found.parts if part.name == "rod")
    assert rod.reason.endswith(f"of {beams} beams")
    assert set(bounded(found)) == {(0.0, False)}


@pytest.mark.parametrize("x", [0.1, 1.5, 2.9])
def test_beams_go_from_post_to_post_at_every_height(tmp_path, x):
    for k, z in enumerate((0.3, 1.0, 1.6)):
        found, _ = curtained(tmp_path / str(k), at=(10, -4, 1), rod=(10 + x, -2, 1 + z))
        assert found.reason == "detected: rod"


def test_nobody_is_beside_a_curtain_that_stands_elsewhere(tmp_path):
    assert curtained(tmp_path, at=(10, -4, 1))[0].verdict == "within"


@pytest.mark.parametrize(
    ("capability", "z", "words"),
    [(0.03, 0.0301, "detected"), (0.0305, 0.0275, "may be missed"), (0.0265, 0.0275, "detected")],
)
def test_heights_are_known_to_two_of_the_finer_beams(tmp_path, capability, z, words):
    """Those are 30 / 16 mm apart: of 27.5 mm, 26.25 mm are seen, and 26.75 mm are asked for."""
    low = 0.3 * 0.03 / 16
    height = 0.2 + 10 * 0.03 - low + z / 2 - 0.03 / 16 * 3
    found, _ = curtained(
        tmp_path, more=f"capability = {capability}", pitch=", pitch = 0.03", z=z, rod=(1, 2, height)
    )
    assert found.reason.startswith(words)


# -- distance to the hazard -----------------------------------------------------------------------

SAW = ROD.format(name="saw", x=0.2, y=0.2, z=0.2, at=[0.5, 0, 0.5])
FAR = '[[safety]]\nkind = "device_distance"\nname = "d"\nsensor = "{sensor}"\nstopping = 0.3\n'
FAR += 'hazard = "{hazard}"\n'
SCAN = SCANNER.format(more="capability = 0.07\nresponse = 0.08", resolution=HALF)
MORE = "reach_under = 0\nsupplement = 0\n"


@pytest.mark.parametrize("edges", [[4], [0, 4], [4, 0], []])
def test_edges_that_the_field_does_not_have_are_refused(tmp_path, edges):
    text = SCAN + SAW + FAR.format(sensor="scan", hazard="saw") + MORE
    with pytest.raises(InputError, match="numbers from 0 to 3"):
        results(tmp_path, f"{text}edges = {edges}\n")
    assert results(tmp_path / "last", f"{text}edges = [3]\n")["d"].value == pytest.approx(1.4)


def test_a_curtain_has_no_edges(tmp_path):
    text = CURTAIN.format(at=[0, 0, 0], more="capability = 0.03", height=1.5, pitch="") + SAW
    with pytest.raises(InputError, match="a curtain has none"):
        results(tmp_path, text + FAR.format(sensor="curtain", hazard="saw") + "edges = [0]\n")


@pytest.mark.parametrize(("tilt", "known"), [(0.9e-3, True), (1.05e-3, False), (0.5, False)])
def test_a_field_that_is_not_level_has_no_height(tmp_path, tilt, known):
    assert device_distance.LEVEL == 1e-3
    at = f"position = [0, 0, 0.5], rpy = [{tilt}, 0, 0]"
    text = SCAN.replace("position = [0, 0, 0.3]", at) + SAW + FAR.format(sensor="scan", hazard="saw") + MORE
    found = results(tmp_path, text)["d"]
    assert (found.value is not None) is known
    assert ("not level" in found.reason) is not known


@pytest.mark.parametrize(("y", "verdict"), [(-0.3, "within"), (0.275, "undecided"), (0.4, "exceeded")])
def test_a_hazard_whose_surface_may_stick_out_leaves_a_band_of_undecided(tmp_path, y, verdict):
    """A display mesh 20 mm larger than the collision box of the second link, which is the second hazard."""
    visual = '<visual><origin xyz="0.5 0 0"/><geometry><box size="1.04 0.14 0.14"/></geometry></visual>'
    urdf = two_r()[::-1].replace("</collision></link>"[::-1], f"</collision>{visual}</link>"[::-1], 1)[::-1]
    text = CURTAIN.format(at=[0, -1, 0], more="capability = 0.014\nresponse = 0.1", height=1.5, pitch="")
    text += TWO_R + f"base = {{ position = [0.5, {y}, 0.5] }}\n"
    text += FAR.format(sensor="curtain", hazard="arm") + 'edition = "2010"\nreach_over = 0\n'
    station = made(tmp_path, FLOATING + text, {"arm.urdf": urdf})
    found = results_at(station, arm=ZERO)["d"]
    S = 1.6 * 0.4
    assert found.limit == pytest.approx(S)
    # The curtain's plane is 2 mm thick.
    assert found.value == pytest.approx(1 - 0.05 - y - 0.001)
    low, high = found.interval
    assert high == found.value
    assert 0.02 - 1e-9 <= high - low <= 0.02 * np.sqrt(3) + 1e-9
    assert found.at_most is False
    assert found.verdict == verdict


def test_the_label_in_the_room_has_no_more_room_than_there_is(tmp_path):
    text = CURTAIN.format(at=[0, 0, 0], more="capability = 0.014\nresponse = 0.1", height=1.5, pitch="")
    text += ROD.format(name="saw", x=0.2, y=0.2, z=0.2, at=[0, 1.00016, 0.5])
    text += FAR.format(sensor="curtain", hazard="saw") + 'edition = "2010"\nreach_over = 0\n'
    found = results(tmp_path, text)["d"]
    assert found.value == pytest.approx(0.89884)
    assert [m.label for m in found.markers] == ["0.8988 m, S 0.64 m"]


@pytest.mark.parametrize(
    ("at", "edges", "value"),
    [
        ([-1.5, 0, 0.5], "", -0.4),
        ([-1.5, 0, 0.5], "edges = [0, 1, 2]\n", np.hypot(0.4, 2.9)),
        ([4.7, 3.7, 0.5], "", -np.hypot(0.6, 0.6)),
        ([0.5, 2, 0.5], "edges = [2]\n", 0.9),
        ([0.5, 2, 0.5], "edges = [0]\n", 4.9),
    ],
)
def test_a_hazard_beyond_an_edge_that_nobody_comes_across_is_inside(tmp_path, at, edges, value):
    """The field is beside the origin: a line is drawn from the border to the hazard, as long as the value."""
    saw = ROD.format(name="saw", x=0.2, y=0.2, z=0.2, at=[at[0] + 7, at[1] - 5, at[2]])
    scan = SCAN.replace("position = [0, 0, 0.3]", "position = [7, -5, 0.3]")
    d = results(tmp_path, scan + saw + FAR.format(sensor="scan", hazard="saw") + MORE + edges)["d"]
    assert d.value == pytest.approx(value, abs=1e-9)
    (line,) = d.markers
    ends = np.array([line.start, line.end])
    assert np.linalg.norm(ends[1, :2] - ends[0, :2]) == pytest.approx(abs(value), abs=1e-9)
    assert (np.abs(ends[:, :2] - [7, -5]) < 6).all()
