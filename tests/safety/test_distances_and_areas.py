"""Least distance and safety area of an arm of boxes, in closed form and against Coal."""

from __future__ import annotations

import coal
import numpy as np
import pytest

from made_cell import FLOATING, TWO_R, made, results_at, state_at, two_r
from seerob.core.errors import InputError
from seerob.session.run import Judge, bind

ZERO = (0.0, 0.0)
BOX = '[[parts]]\nname = "{name}"\nshape = {{ box = [0.2, 0.2, 0.2] }}\nat = {{ position = {at} }}\n'


def judged(folder, tables, pose=(0.0, 0.0)):
    station = made(folder, FLOATING + TWO_R + tables, {"arm.urdf": two_r()})
    return results_at(station, arm=(pose, ZERO))


def distance(limit=None, between='["arm", "box"]'):
    more = "" if limit is None else f"limit = {limit}\n"
    return f'[[safety]]\nkind = "minimum_distance"\nname = "d"\nbetween = {between}\n{more}'


@pytest.mark.parametrize(("limit", "verdict"), [(0.29999, "within"), (0.30001, "exceeded"), (None, None)])
def test_distance_in_closed_form(tmp_path, limit, verdict):
    """The stretched arm ends at x = 2, the box begins at 2.3."""
    d = judged(tmp_path, BOX.format(name="box", at=[2.4, 0, 0]) + distance(limit))["d"]
    assert d.value == pytest.approx(0.3, abs=1e-9)
    assert d.verdict == verdict
    assert d.reason == "arm/l2 ↔ box"
    segment = d.markers[0]
    assert segment.start[0] == pytest.approx(2.0)
    assert segment.end[0] == pytest.approx(2.3)


def test_shapes_that_cross_are_exceeded_whatever_the_limit(tmp_path):
    """Their figure is 0, at least that deep: 0 against a limit of 0 is not within."""
    d = judged(tmp_path, BOX.format(name="box", at=[1.5, 0, 0]) + distance(0.0))["d"]
    assert d.value <= 0
    assert d.verdict == "exceeded"


def test_distance_of_boxes_is_coals(tmp_path):
    boxes = [[0.9, 1.3, 0.4], [-1.2, -0.4, 0.0], [0.1, -1.7, -0.3]]
    tables = "".join(BOX.format(name=f"cell/box{i}", at=at) for i, at in enumerate(boxes))
    tables += distance(between='["arm", "cell"]')
    station = made(tmp_path, FLOATING + TWO_R + tables, {"arm.urdf": two_r()})
    judge = bind(station.model)
    rng = np.random.default_rng(0)
    for _ in range(60):
        q = rng.uniform(-3, 3, 2)
        value = Judge(judge)(state_at(station, arm=(q, ZERO)))[0].value
        expected = []
        for k in range(2):
            angle = q[: k + 1].sum()
            x = np.array([np.cos(angle), np.sin(angle), 0])
            R = np.array([[x[0], -x[1], 0], [x[1], x[0], 0], [0, 0, 1]])
            start = np.zeros(3) if k == 0 else np.array([np.cos(q[0]), np.sin(q[0]), 0])
            link = coal.Transform3s(R, start + 0.5 * x)
            for at in boxes:
                result = coal.DistanceResult()
                box = coal.Transform3s(np.eye(3), np.array(at))
                expected.append(
                    coal.distance(
                        coal.Box(1, 0.1, 0.1),
                        link,
                        coal.Box(0.2, 0.2, 0.2),
                        box,
                        coal.DistanceRequest(),
                        result,
                    )
                )
        # None of these poses touches; how deep a body is in another is asked elsewhere.
        assert min(expected) > 0
        assert value == pytest.approx(min(expected), abs=1e-6)


def test_a_set_cannot_be_compared_with_itself(tmp_path):
    with pytest.raises(InputError, match="is in both sets"):
        judged(tmp_path, distance(between='["arm", "arm/l1"]'))


AREA = '[[areas]]\nname = "zone"\nshape = {{ box = [1, 1, 1] }}\nat = {{ position = [{x}, 0, 0] }}\n{on}'
WATCH = '[[safety]]\nkind = "safety_area"\nname = "a"\narea = "zone"\nof = "{of}"\n'


@pytest.mark.parametrize(
    ("x", "verdict", "who"),
    [
        (2.6, "within", []),
        (2.4999, "exceeded", ["arm/l2"]),
        (2.0, "exceeded", ["arm/l2"]),
        (0.9, "exceeded", ["arm/l1", "arm/l2"]),
        (-0.4, "exceeded", ["arm/l1"]),
        (-0.6, "within", []),
    ],
)
def test_area_is_entered_from_its_border_on_by_each_body(tmp_path, x, verdict, who):
    a = judged(tmp_path, AREA.format(x=x, on="") + WATCH.format(of="arm"))["a"]
    assert a.verdict == verdict
    assert [part.name for part in a.parts] == who
    assert (a.value <= 0) == (verdict == "exceeded")
    assert all(part.value <= 0 for part in a.parts)
    if verdict == "within":
        assert a.value == pytest.approx(0.1)


def test_a_body_wholly_inside_is_inside(tmp_path):
    small = BOX.format(name="box", at=[5, 0, 0])
    a = judged(tmp_path, AREA.format(x=5, on="") + small + WATCH.format(of="box"))["a"]
    assert (a.verdict, a.reason) == ("exceeded", "box")
    assert a.value < 0


@pytest.mark.parametrize("depth", [4e-5, 1.2341e-3, 0.0999])
def test_how_deep_somebody_is_inside_is_never_said_to_be_less(tmp_path, depth):
    a = judged(tmp_path, AREA.format(x=2.5 - depth, on="") + WATCH.format(of="arm"))["a"]
    (said,) = (m.label for m in a.markers if getattr(m, "label", None))
    low, high = said.removeprefix("between ").removesuffix(" m deep").split(" m and ")
    assert float(low) <= depth <= float(high)
    assert float(high) <= -a.interval[0] + 1e-4


def test_area_on_a_link_moves_with_it_and_is_not_part_of_the_robot(tmp_path):
    tables = (
        AREA.format(x=1.5, on='on = "arm/l2"\n')
        + BOX.format(name="box", at=[1, 2.05, 0])
        + WATCH.format(of="box")
        + distance()
        + '[[safety]]\nkind = "velocity"\nname = "v"\nof = "arm"\n'
    )
    station = made(tmp_path, FLOATING + TWO_R + tables, {"arm.urdf": two_r()})
    model = station.model
    zone = next(b.index for b in model.bodies if b.role == "area")
    for name in ("arm", "arm/l2", "*", "a*"):
        assert zone not in model.select(name)
    assert model.select("zone") == (zone,)
    assert zone not in model.robot("arm").moving + model.robot("arm").carried
    aside = results_at(station, arm=((0, 0), (1, 0)))
    up = results_at(station, arm=((0, np.pi / 2), (1, 0)))
    assert (aside["a"].verdict, up["a"].verdict) == ("within", "exceeded")
    # Link 2 ends at (1, 1); the box in the area that it carries begins at y = 1.95.
    assert up["d"].value == pytest.approx(0.95)
    assert aside["v"].value == pytest.approx(np.hypot(2, 0.05))


def test_area_that_moves_with_an_unheard_robot_is_undecided(tmp_path):
    from seerob.twin.engine import Engine

    tables = (
        AREA.format(x=1.5, on='on = "arm/l2"\n')
        + BOX.format(name="box", at=[9, 9, 9])
        + WATCH.format(of="box")
    )
    station = made(tmp_path, FLOATING + TWO_R + tables, {"arm.urdf": two_r()})
    result = Judge(bind(station.model))(Engine(station.model).start())[0]
    assert (result.verdict, result.value) == ("undecided", None)
    assert "arm" in result.reason


def test_surface_that_may_stick_out_leaves_a_band_of_undecided(tmp_path):
    """A display mesh 20 mm larger than the collision box on every side."""
    visual = '<visual><origin xyz="0.5 0 0"/><geometry><box size="1.04 0.14 0.14"/></geometry></visual>'
    urdf = two_r().replace("</collision></link>", f"</collision>{visual}</link>")

    def at(folder, x):
        tables = BOX.format(name="box", at=[x, 0, 0]) + distance(0.1) + AREA.format(x=x + 0.4, on="")
        station = made(folder, FLOATING + TWO_R + tables + WATCH.format(of="arm"), {"arm.urdf": urdf})
        results = results_at(station, arm=((0, 0), (0, 0)))
        return results["d"], results["a"]

    for k, (x, verdict, area) in enumerate(
        [
            (2.25, "within", "within"),
            (2.21, "undecided", "within"),
            (2.19, "exceeded", "within"),
            (2.11, "exceeded", "undecided"),
        ]
    ):
        d, a = at(tmp_path / str(k), x)
        assert (d.verdict, a.verdict) == (verdict, area), x
        assert d.interval[1] == d.value
        assert 0.02 - 1e-9 <= d.value - d.interval[0] <= 0.02 * np.sqrt(3) + 1e-9
