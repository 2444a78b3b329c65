"""Edges of safety areas, swept volumes and force polytopes, one figure, sign and comparison at a time."""

from __future__ import annotations

import numpy as np
import pytest

from made_cell import FLOATING, TWO_R, heard, made, results_at, two_r
from seerob.core.errors import InputError
from seerob.criteria.judging import Judge
from seerob.criteria.safety.force_polytope import ForcePolytope
from seerob.twin.engine import Engine

BOX = '[[parts]]\nname = "{name}"\nshape = {{ box = [0.2, 0.2, 0.2] }}\nat = {{ position = {at} }}\n'
ZONE = '[[areas]]\nname = "zone"\nshape = { sphere = 0.5 }\n'
WATCH = (
    '[[safety]]\nkind = "safety_area"\nname = "a"\narea = {area}\nof = ["one", "two"]\ntolerance = 0.001\n'
)
PLANAR = ((0.0, np.pi / 2), (0.0, 0.0))
FORCE = '[[safety]]\nkind = "force_polytope"\nname = "f"\nat = "arm"\n'


# -- areas ----------------------------------------------------------------------------------------


def test_the_deepest_is_shown_whoever_comes_first(tmp_path):
    text = ZONE + BOX.format(name="one", at=[0.55, 0, 0]) + BOX.format(name="two", at=[0.3, 0, 0])
    a = results_at(made(tmp_path, text + WATCH.format(area='"zone"')))["a"]
    assert [part.name for part in a.parts] == ["one", "two"]
    one, two = a.parts
    assert two.value < one.value < 0
    assert (a.value, a.interval) == (two.value, two.interval)
    for found in (a, one, two):
        assert (found.limit, found.at_most, found.verdict) == (0.0, False, "exceeded")
        assert found.interval[0] <= found.interval[1] == found.value


def test_of_two_areas_the_one_that_is_entered_or_near_is_named(tmp_path):
    text = ZONE + ZONE.replace("zone", "other").replace("0.5 }", "0.5 }\nat = { position = [5, 0, 0] }")
    text += BOX.format(name="two", at=[20, 0, 0]) + WATCH.format(area='["zone", "other"]')
    for x, verdict, who in ((4.5, "exceeded", "other"), (1.0, "within", "zone"), (4.0, "within", "other")):
        station = made(tmp_path / str(x), text + BOX.format(name="one", at=[x, 0, 0]))
        a = results_at(station)["a"]
        assert (a.verdict, "one" in a.reason, who in a.reason) == (verdict, True, True)


@pytest.mark.parametrize(
    ("x", "verdict", "reason"),
    [(0.75, "exceeded", "one"), (0.75 + 5e-10, "exceeded", "one"), (0.75 + 2e-9, "within", "one")],
)
def test_what_touches_an_area_is_in_it(tmp_path, x, verdict, reason):
    """A cube of 1 m and one of 1/2 m: figures without rounding. Of one area the reason names none."""
    text = ZONE.replace("sphere = 0.5", "box = [1, 1, 1]") + BOX.format(name="two", at=[9, 0, 0])
    text += BOX.replace("0.2, 0.2, 0.2", "0.5, 0.5, 0.5").format(name="one", at=[x, 0, 0])
    a = results_at(made(tmp_path, text + WATCH.format(area='"zone"')))["a"]
    assert (a.verdict, a.reason) == (verdict, reason)
    assert a.value == pytest.approx(0, abs=2e-3)
    both = results_at(made(tmp_path / "both", text + WATCH.format(area='["zone", "zone"]')))["a"]
    assert both.verdict == verdict
    assert both.reason.startswith("one in zone")


@pytest.mark.parametrize("name", ["one", "arm", "arm/l2"])
def test_only_areas_are_areas(tmp_path, name):
    text = (
        FLOATING + TWO_R + ZONE + BOX.format(name="one", at=[5, 0, 0]) + BOX.format(name="two", at=[6, 0, 0])
    )
    with pytest.raises(InputError, match="no area named"):
        results_at(made(tmp_path, text + WATCH.format(area=f'"{name}"'), {"arm.urdf": two_r()}))


# -- swept volume ---------------------------------------------------------------------------------


def swept(folder, more, instants, judge=None):
    text = FLOATING + TWO_R + '[[safety]]\nkind = "swept_volume"\nname = "s"\nof = "arm"\nvoxel = 0.05\n'
    station = made(folder, f"{text}limit = 5\n{more}", {"arm.urdf": two_r()})
    engine, judge = Engine(station.model, driven={"arm": 0.5}), Judge(station.bound)
    return [asked(engine, judge, t) for t in instants], station, judge


def asked(engine, judge, t, q=None):
    engine.take([heard("arm", t, [t if q is None else q, 0.0], [1.0, 0.0])])
    return judge(engine.tick() if t else engine.start())[0]


@pytest.mark.parametrize(
    ("every", "verdict"), [(0.01, "within"), (0.014, "within"), (0.0125, "undecided"), (0.016, "undecided")]
)
def test_what_is_asked_at_less_than_two_thirds_of_the_ticks_is_undecided(tmp_path, every, verdict):
    """At 12.5 ms it is asked every other tick of 10 ms: more than one and a half of its periods apart."""
    found, _, _ = swept(tmp_path, f"every = {every}\n", np.arange(9) * 0.01)
    assert found[-1].verdict == verdict


def test_a_second_run_that_begins_at_the_same_instant_begins_anew(tmp_path):
    (first,), station, judge = swept(tmp_path, "", [0.0])
    again = asked(Engine(station.model, driven={"arm": 0.5}), judge, 0.0, q=0.5)
    assert again.value < 1.2 * first.value


# -- force polytope -------------------------------------------------------------------------------


def crane(efforts):
    """Slides along x, y and z with 2 kg at the end: J_v = 1."""
    links = ['<link name="base"/>']
    for i, (axis, effort) in enumerate(zip(("1 0 0", "0 1 0", "0 0 1"), efforts, strict=True)):
        parent = f"l{i - 1}" if i else "base"
        links.append(
            f'<link name="l{i}"><inertial><mass value="2"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" '
            f'ixz="0" iyz="0"/></inertial></link><joint name="j{i}" type="prismatic">'
            f'<parent link="{parent}"/><child link="l{i}"/><axis xyz="{axis}"/>'
            f'<limit lower="-1" upper="1" effort="{effort}" velocity="1"/></joint>'
        )
    return f'<robot name="crane">{"".join(links)}</robot>'


def pushed(folder, options, *, efforts=(100, 100, 100), urdf=None, motion=((0, 0, 0), (0, 0, 0)), tool=""):
    text = FLOATING + TWO_R + tool + FORCE + options
    return results_at(made(folder, text, {"arm.urdf": urdf or crane(efforts)}), arm=motion)["f"]


def direction(found):
    return [part.value for part in found.parts if part.name.startswith("direction")]


def test_a_robot_without_any_torque_pushes_nowhere(tmp_path):
    found = pushed(tmp_path, 'torque_limits = [[0, 0], [0, 0], [0, 0]]\nload = "none"\n')
    assert found.value == 0
    assert direction(found) == [0, 0, 0]
    assert "cannot hold" not in found.reason


def test_a_weak_robot_pushes_as_far_as_it_can(tmp_path):
    """Of a box of ± 0.5, ± 0.3 and ± 0.2 N the corners are farthest; torque limits of 0.2 N are limits."""
    found = pushed(tmp_path, "", efforts=(0.5, 0.3, 0.2))
    assert found.value == pytest.approx(np.sqrt(0.38))
    np.testing.assert_allclose(np.abs(direction(found)), np.array([0.5, 0.3, 0.2]) / np.sqrt(0.38))
    assert "cannot hold" not in found.reason
    assert next(part.value for part in found.parts if part.name == "in every direction") == pytest.approx(0.2)


@pytest.mark.parametrize(
    "pairs", ["[[nan, 1], [-1, 1], [-1, 1]]", "[[1, -1], [-1, 1], [-1, 1]]", "[[-1, 1]]"]
)
def test_torque_limits_that_are_none_are_refused(tmp_path, pairs):
    with pytest.raises(InputError, match="torque_limits"):
        pushed(tmp_path, f"torque_limits = {pairs}\n")


def test_definitions_by_hand(tmp_path):
    """Of a planar arm at (0, 90°) with its grip: M bears what no force does, so more force is left.

    τ = Jᵀ f + m with J = [[-1, -1], [1, 0]] in the plane. A moment m takes τ₂ = -F_x + m, τ₁ = -F_x + F_y + m
    up, so F_y alone is bounded, by |τ₁ - τ₂| ≤ 15, and F_x by nothing.
    """
    limits = "torque_limits = [[-10, 10], [-5, 5]]\n"
    found = {
        name: pushed(
            tmp_path / name,
            f'{limits}definition = "{name}"\n',
            urdf=two_r(),
            motion=PLANAR,
            tool='tool = "tip"\n',
        )
        for name in ("zero_moment", "free_moment", "torque_box")
    }
    across = {
        name: next((part.value for part in each.parts if "across" in part.name), each.value)
        for name, each in found.items()
    }
    assert across["zero_moment"] == pytest.approx(np.hypot(5, 15))
    assert across["free_moment"] == pytest.approx(15)
    J_v = np.array([[-1.0, -1.0], [1.0, 0.0]])
    corners = np.array([[a, b] for a in (-10, 10) for b in (-5, 5)]) @ np.linalg.inv(J_v)
    assert across["torque_box"] == pytest.approx(np.linalg.norm(corners, axis=1).max())


def test_the_force_acts_at_the_offset(tmp_path):
    found = pushed(tmp_path, "offset = [0.3, 0, 0]\n", urdf=two_r(), motion=PLANAR, tool='tool = "tip"\n')
    arrow = next(marker for marker in found.markers if type(marker).__name__ == "Arrow")
    assert arrow.origin == pytest.approx((1, 1.3, 0))


@pytest.mark.parametrize("wrong", [np.nan, np.inf])
def test_torque_limits_that_are_not_finite_are_refused_whoever_gives_them(tmp_path, wrong):
    model = made(tmp_path, FLOATING + TWO_R, {"arm.urdf": two_r()}).model
    with pytest.raises(InputError, match="torque_limits"):
        ForcePolytope(name="f", at="arm", torque_limits=((-1.0, wrong), (-1.0, 1.0))).bind(model)
