"""A link that moves and has a mass but no shape is somewhere: nothing that is about shapes is within."""

from __future__ import annotations

import re
from typing import ClassVar

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from made_cell import FLOATING, TWO_R, made, person, results_at, state_at, two_r
from seerob.core.errors import InputError, Undecided
from seerob.core.snapshot import Basis, Result, Verdict
from seerob.criteria.criterion import Criterion
from seerob.model.mounting.mechanisms import stands_out
from seerob.session.permissible.between_samples import BetweenSamples
from seerob.session.permissible.ceilings import ceilings_of
from seerob.session.permissible.path import GivenMotion
from seerob.session.planning.clearance import Clearance
from seerob.session.run import Bound, Judge

LAST = re.compile(r'(<link name="l2">.*?)<collision>.*?</collision>')
BARE = LAST.sub(r"\1", two_r())
FIXED = (
    '<link name="tip"><inertial><mass value="0.1"/><inertia ixx="4e-4" iyy="4e-4" izz="4e-4" ixy="0" ixz="0" '
    'iyz="0"/></inertial><collision><geometry><sphere radius="0.1"/></geometry></collision></link>'
)
COVER = (
    '[[tools]]\nname = "cover"\non = "arm/l2"\nshape = {{ box = [1, 0.1, 0.1] }}\nmass = 0.1\n'
    "at = {{ position = [{}, 0, 0] }}\n"
)
TERMS = "intrusion = 0\nhuman_uncertainty = 0\nrobot_uncertainty = 0\n"
STOP = "stop = { acceleration = 0, reaction = 0.01, stopping = 0.01 }\n"
STUB = '<collision><geometry><box size="{0} {0} {0}"/></geometry></collision>'
SIX = ("xx", "yy", "zz", "xy", "xz", "yz")
ABOUT = {
    "minimum_distance": 'between = ["arm", "op"]\nlimit = 0.01\n',
    "separation": f'between = ["arm", "op"]\n{STOP}{TERMS}',
    "separation_area": 'separation = "separation"\nof = "op"\n',
    "safety_area": 'area = "zone"\nof = "arm"\n',
    "power_and_force": 'robot = "arm"\nhuman = "op"\n',
    "swept_volume": 'of = "arm"\nvoxel = 0.1\nlimit = 9\n',
    "velocity": 'of = "arm"\nlimit = 9\n',
}
ZONE = '[[areas]]\nname = "zone"\nshape = { sphere = 0.1 }\nat = { position = [0, 0, 9] }\n'


def cell(folder, urdf, x=9.0, more=""):
    kinds = (f'[[safety]]\nkind = "{kind}"\nname = "{kind}"\n{rest}' for kind, rest in ABOUT.items())
    point = '[[safety]]\nkind = "velocity"\nname = "point"\nat = "arm"\nlimit = 9\n'
    point += '[[safety]]\nkind = "minimum_distance"\nname = "figure"\nbetween = ["arm", "op"]\n'
    text = FLOATING + TWO_R + more + person("op", x, 0, -1) + ZONE + "".join(kinds) + point
    return made(folder, text, {"arm.urdf": urdf})


def verdicts(station):
    return {name: result.verdict for name, result in results_at(station, arm=((0, 0), (1, 0))).items()}


def test_nothing_about_shapes_is_within(tmp_path):
    station = cell(tmp_path, BARE)
    results = results_at(station, arm=((0.0, 0.0), (1.0, 0.0)))
    for kind in ABOUT:
        assert (kind, results[kind].verdict) == (kind, "undecided")
        assert "no shape shows arm/l2, which has a mass" in results[kind].reason
        coloured = [getattr(marker, "verdict", None) for marker in results[kind].markers]
        assert set(coloured) <= {None, "undecided"}
    assert results["minimum_distance"].markers[0].verdict == "undecided"
    assert results["point"].verdict == "within"
    assert results["figure"].verdict is None  # nothing to be within of
    still = {"arm": np.zeros((2, 2))}
    batch = station.batch(still, still)
    assert {kind: int(batch[kind].answers.verdict.min()) for kind in ABOUT} == dict.fromkeys(ABOUT, 2)


@pytest.mark.parametrize(
    "shown",
    [
        (two_r(), ""),
        (BARE, COVER.format(0.5)),
        (LAST.sub(r"\1", two_r(masses=(1.0, 0.001))), ""),
        (BARE.replace('<link name="tip"/>', FIXED), ""),
    ],
    ids=["itself", "mounted", "as light as a frame", "fixed to it"],
)
def test_what_is_shown_is_enough(tmp_path, shown):
    urdf, more = shown
    found = verdicts(cell(tmp_path, urdf, more=more))
    assert found.pop("power_and_force") is None  # nobody is near
    assert found.pop("figure") is None
    assert set(found.values()) == {"within"}


def lump(mass=5.0, x=1.0, inertia=1e-3, shape=""):
    """The arm with a mass at a place ahead of its end [m], which is at 2 m."""
    six = " ".join(f'i{axes}="{inertia if axes[0] == axes[1] else 0}"' for axes in SIX)
    inertial = f'<inertial><origin xyz="{x} 0 0"/><mass value="{mass}"/><inertia {six}/></inertial>'
    return two_r().replace('<link name="tip"/>', f'<link name="tip">{inertial}{shape}</link>')


@pytest.mark.parametrize(
    ("urdf", "shown"),
    [
        (lump(), False),
        (lump(x=0.0), True),  # at the end of the last link's box
        (lump(x=-0.5, inertia=0.01), True),  # spread by 0.03 m in a box of half 0.05 m
        (lump(x=-0.5, inertia=5 * 0.6**2), False),  # and one that is too large for it
        (lump(mass=0.04), False),
        (lump(mass=0.001), True),
        (lump(x=0.0, shape=STUB.format(0.2)), True),
        (lump(x=0.25, shape=STUB.format(0.2)), False),
        (lump(x=0.0, shape=STUB.format(0.005)), True),
        (BARE.replace('<link name="tip"/>', f'<link name="tip">{STUB.format(0.005)}</link>'), False),
        (two_r().replace('size="1 0.1 0.1"', 'size="0.005 0.005 0.005"'), False),
    ],
    ids=[
        "1 m out",
        "inside",
        "thin",
        "wide",
        "light",
        "as light as a frame",
        "own",
        "beside its own",
        "stub on a box",
        "a stub",
        "stubs",
    ],
)
def test_what_is_fixed_to_a_shape_is_in_it_or_not_shown(tmp_path, urdf, shown):
    """5 kg whose centre lies 1 m ahead of everything that has a shape are somewhere."""
    result = results_at(cell(tmp_path, urdf), arm=((0.0, 0.0), (1.0, 0.0)))["minimum_distance"]
    assert (result.verdict, "no shape shows" in result.reason) == (
        ("within", False) if shown else ("undecided", True)
    )


WITHOUT_BOTH = re.sub(r'(<link name="l1">).*?</collision>', r"\1", two_r())
FIRST = re.compile(r'(<link name="l1">.*?)<collision>.*?</collision>')
REFUSED = lump(x=0.0).replace('<mass value="5.0"/>', "")


@pytest.mark.parametrize("urdf", [WITHOUT_BOTH, REFUSED], ids=["said nothing of", "refused"])
def test_a_body_whose_mass_nobody_knows_either_is_not_shown(tmp_path, urdf):
    """A link of 1 m between two joints of which the file says nothing, and a mass that it does not tell."""
    result = results_at(cell(tmp_path, urdf), arm=((0.0, 0.0), (1.0, 0.0)))["minimum_distance"]
    assert result.verdict == "undecided"
    assert "no shape shows" in result.reason


def test_a_mass_in_a_point_beside_its_shape_is_not_shown(tmp_path):
    """Nobody knows how heavy it is, but where its centre is said to be there is no shape."""
    beside = two_r().replace('ixx="0.002" iyy="0.002"', 'ixx="1e-11" iyy="1e-11"')
    beside = beside.replace('<box size="1 0.1 0.1"/>', '<box size="0.4 0.1 0.1"/>')
    station = cell(tmp_path, beside)
    assert "radius of gyration" in station.model.robot("arm").unknown_masses[0]
    result = results_at(station, arm=((0.0, 0.0), (1.0, 0.0)))["minimum_distance"]
    assert (result.verdict, "no shape shows" in result.reason) == ("undecided", True)


@pytest.mark.parametrize(("first", "second", "shown"), [(5e-4, 1.0, False), (5e-4, 5e-4, True)])
def test_what_carries_something_a_metre_ahead_is_no_frame(tmp_path, first, second, shown):
    """Half a gram between two joints 1 m apart; it is a frame where nothing hangs on it."""
    urdf = FIRST.sub(r"\1", two_r(masses=(first, second)))
    station = cell(tmp_path, urdf)
    result = results_at(station, arm=((0.0, 0.0), (1.0, 0.0)))["minimum_distance"]
    assert (result.verdict, "no shape shows arm/l1" in result.reason) == (
        ("within", False) if shown else ("undecided", True)
    )
    (told,) = [f for f in station.model.findings if f.subject == "arm/l1" and "but no shape" in f.text]
    assert (told.level, "taken for a frame" in told.text) == ("assumed", True)


def test_what_has_a_shape_of_its_own_is_shown_however_light_it_is(tmp_path):
    """Half a gram in a cube of 1 cm³, with a metre and a kilogram behind it."""
    urdf = two_r(masses=(5e-4, 1.0)).replace('size="1 0.1 0.1"', 'size="0.01 0.01 0.01"', 1)
    result = results_at(cell(tmp_path, urdf), arm=((0.0, 0.0), (1.0, 0.0)))["minimum_distance"]
    assert (result.verdict, "no shape shows" in result.reason) == ("within", False)


LIGHT = """<mujoco><compiler angle="radian"/><worldbody><body name="base" pos="1 0 0"><body name="light">
<inertial pos="0 0 0" mass="5e-4" diaginertia="1e-8 1e-8 1e-8"/>{}</body></body></worldbody></mujoco>"""
TWO = '<joint name="{0}1" axis="0 0 1"/><joint name="{0}2" axis="0 1 0" pos="{1} 0 0"/>'
BEHIND = '<body name="heavy">{}<geom type="box" size="0.1 0.1 0.1" mass="{}"/></body>'


@pytest.mark.parametrize(
    ("inside", "shown"),
    [
        (TWO.format("a", 0.5), True),  # nothing hangs on it
        (TWO.format("a", 0) + BEHIND.format(TWO.format("b", 0), 1), True),  # all joints in one place
        (TWO.format("a", 0) + BEHIND.format(TWO.format("b", 5e-4), 1), True),
        (TWO.format("a", 0) + BEHIND.format(TWO.format("b", 0.5), 1), False),
        (TWO.format("a", 0.5) + BEHIND.format(TWO.format("b", 0), 1), False),
    ],
)
def test_a_frame_between_joints_that_are_in_one_place_is_one(tmp_path, inside, shown):
    text = '[[robots]]\nname = "arm"\nmodel = "arm.xml"\n'
    robot = made(tmp_path, text, {"arm.xml": LIGHT.format(inside)}).model.robot("arm")
    assert ("arm/light" not in robot.unshaped) is shown


@given(
    st.lists(st.tuples(st.floats(-1, 1), st.floats(0.1, 9)), min_size=1, max_size=9),
    st.floats(-2, 2),
    st.floats(0, 3),
)
def test_no_body_that_lies_in_a_span_reaches_out_of_it(points, low, length):
    """Of points with masses: the bound is never more than what they do, and is reached by two at the ends."""
    x, m = np.array(points).T
    mean = float(m @ x / m.sum())
    variance = float(m @ (x - mean) ** 2 / m.sum())
    high = low + length
    out = max(low - x.min(), x.max() - high)
    assert stands_out(mean - low, high - mean, variance) <= out + 1e-9
    if len(points) == 2:
        assert stands_out(mean - x.min(), x.max() - mean, variance) == pytest.approx(0.0, abs=1e-9)


def test_names_of_links_and_patterns_mean_what_is_not_shown_too(tmp_path):
    kinds = "".join(
        f'[[safety]]\nkind = "velocity"\nname = "{of}"\nof = "{of}"\nlimit = 9\n'
        for of in ("arm/*", "*", "arm/l1", "arm/l?", "op")
    )
    text = FLOATING + TWO_R + person("op", 9.0, 0, -1) + kinds
    results = results_at(made(tmp_path, text, {"arm.urdf": BARE}), arm=((0.0, 0.0), (1.0, 0.0)))
    undecided = {name for name, result in results.items() if "no shape shows arm/l2" in result.reason}
    assert undecided == {"arm/*", "*", "arm/l?"}
    assert results["arm/l1"].verdict == "within"


class Forgetful(Criterion, frozen=True, kw_only=True):
    """An own criterion that says nothing of shapes, and not of whom it speaks."""

    at_most: ClassVar[bool] = False

    def bind(self, model):
        """See `Criterion.bind`."""
        gap = model.gap(model.select("arm"), model.select("op"))
        return lambda state: Result(
            name="own", value=state.closest(gap).distance, limit=0.0, at_most=False, verdict=Verdict.WITHIN
        )


def test_nobody_has_to_think_of_it(tmp_path):
    for urdf, verdict in ((BARE, "undecided"), (two_r(), "within")):
        station = cell(tmp_path / verdict, urdf)
        state = state_at(station, arm=((0.0, 0.0), (1.0, 0.0)))
        own = Bound(
            Forgetful(name="own"), "safety", Forgetful().bind(station.model), Basis(formula="", source="")
        )
        assert [result.verdict for result in Judge([own])(state)] == [verdict]


def test_an_area_that_a_robot_sweeps_of_which_a_part_is_not_shown_is_not_safe_outside(tmp_path):
    area = '[[areas]]\nname = "reach"\nswept = { of = "arm", reach = true, voxel = 0.2 }\n'
    area += '[[safety]]\nkind = "safety_area"\narea = "reach"\nof = "op"\n'
    for urdf, verdict in ((BARE, "undecided"), (two_r(), "within")):
        urdf = re.sub('type="continuous"', 'type="revolute"', urdf)
        urdf = urdf.replace("<limit ", '<limit lower="-0.1" upper="0.1" ')
        station = made(
            tmp_path / verdict, FLOATING + TWO_R + person("op", 9.0, 0, -1) + area, {"arm.urdf": urdf}
        )
        (result,) = results_at(station, arm=((0.0, 0.0), (0.0, 0.0))).values()
        assert result.verdict == verdict


def test_no_way_is_proven_clear_of_what_is_not_shown(tmp_path):
    model = cell(tmp_path, BARE).model
    with pytest.raises(InputError, match="no shape shows arm/l2"):
        Clearance(model, model.robot("arm"), np.zeros(2))


def test_a_robot_that_must_stay_outside_counts_whole(tmp_path):
    """The area is that of a robot whose shapes are all there."""
    other = '[[robots]]\nname = "other"\nmodel = "{}.urdf"\nbase = {{ position = [0, 6, 0] }}\nq = [0, 0]\n'
    kinds = (
        f'[[safety]]\nkind = "{kind}"\nname = "{kind}"\n{ABOUT[kind].replace(old, new)}'
        for kind, old, new in (("separation", "", ""), ("separation_area", '"op"', '"other"'))
    )
    text = FLOATING + TWO_R + person("op", 9.0, 0, -1) + "".join(kinds)
    for name, verdict in (("bare", "undecided"), ("arm", "within")):
        files = {"arm.urdf": two_r(), "bare.urdf": BARE}
        station = made(tmp_path / name, text + other.format(name), files)
        assert verdicts(station) == {"separation": "within", "separation_area": verdict}


def test_what_is_seen_exceeds_by_itself(tmp_path):
    found = verdicts(cell(tmp_path, BARE, x=0.5))
    assert [found[kind] for kind in ("minimum_distance", "separation", "separation_area")] == ["exceeded"] * 3


def test_no_speed_is_permitted_and_nothing_bounded(tmp_path):
    model = cell(tmp_path, BARE).model
    state = state_at(cell(tmp_path / "again", BARE), arm=((0.0, 0.0), (1.0, 0.0)))
    asked = [
        ceilings_of(c, model, "arm", anywhere=False) for c in model.workstation.safety if c.name in ABOUT
    ]
    for ask in filter(None, asked):
        assert [c.undecided for c in ask.ceilings(state)] == [True]
    t, q = np.array([0.0, 1.0]), np.array([[0.0, 0.0], [1.0, 0.0]])
    motion = GivenMotion("arm", t, q, np.zeros_like(q), np.ones(2, bool))
    between = BetweenSamples(model, {"arm": motion})
    for ask in (lambda: between.distance("arm", "op"), lambda: between.speed("arm")):
        with pytest.raises(Undecided, match="no shape shows arm/l2"):
            ask()
    assert between.distance("arm/l1", "op").value > 6
