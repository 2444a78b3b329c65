"""Intervals from tolerances: exact ends, the verdict between them, and the input that decides it by name."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from made_cell import FLOATING, TWO_R, basis_in, heard, judged, made, results_at, state_at, two_r
from seerob.core.errors import InputError
from seerob.core.tolerances import Tolerance, deciding, spread
from seerob.criteria.contact.impact_mass import simplified_mass
from seerob.criteria.judging import Judge
from seerob.description.humans.skeleton import BONES
from seerob.distance.least import Query
from seerob.twin import joint_torques
from seerob.twin.accuracy.mass_tolerances import MassTolerances
from seerob.twin.accuracy.tracking_error import TrackingError
from seerob.twin.engine import Engine

POSE = ((0.0, np.pi / 2), (1.0, -2.0))
GRIP = '[[tools]]\nname = "grip"\non = "arm/tip"\nshape = {{ sphere = 0.02 }}\nmass = {mass}\n'
GRIP += "uniform_density = true\n{more}\n"
PART = '[[workpieces]]\nname = "part"\non = "grip"\nshape = {{ box = [0.1, 0.2, 0.3] }}\nmass = {mass}\n'
PART += "uniform_density = true\n{more}\n"
PERSON = """[[humans]]
name = "op"
stature = 1.75
mass = 75
sex = "male"
at = {{ position = [{x}, 0, -1] }}
"""
PLATE = '[[parts]]\nname = "wall"\nshape = { box = [0.1, 9, 9] }\nat = { position = [-3, 0, 0] }\n'


def loaded(folder, *, links=(1.0, 1.0), tool=0.7, part=0.4, robot="", grip="", piece="", criteria=""):
    text = FLOATING + TWO_R + robot + GRIP.format(mass=tool, more=grip) + PART.format(mass=part, more=piece)
    return made(folder, text + criteria, {"arm.urdf": two_r(masses=links)})


def criterion(kind, options):
    return f'[[safety]]\nkind = "{kind}"\nname = "it"\n{options}\n'


def test_ends_are_those_of_all_corners_and_the_widest_input_decides():
    """x²y/z over a box: monotone in each, so the ends are among the eight corners."""
    middle, half = np.array([2.0, 3.0, 4.0]), np.array([0.1, 0.5, 0.2])

    def figure(shifts):
        x, y, z = middle + half * np.array([shifts[0], shifts[1], -shifts[2]])
        return np.array([x * x * y / z, x])

    found = spread(figure, 3)
    corners = np.array([figure(s) for s in itertools.product((-1, 1), repeat=3)])
    assert (found.low == corners.min(axis=0)).all()
    assert (found.high == corners.max(axis=0)).all()
    assert found.widths[:, 1] == pytest.approx([0.2, 0, 0])
    names = [Tolerance(name, 0.02, unit) for name, unit in (("x", "m"), ("stop.reaction", "s"), ("z", "%"))]
    assert deciding(names, found.widths[:, 0]) == "decided by stop.reaction ± 20 ms"


def test_a_mass_that_is_off_is_a_robot_of_another_mass(tmp_path):
    """M of a twin whose masses really are 10, 20 and 50 % larger, inertia with them."""
    off = loaded(
        tmp_path / "a",
        robot="mass_tolerance = 0.1\n",
        grip="mass_tolerance = 0.2",
        piece="mass_tolerance = 0.5",
    )
    robot = off.model.robot("arm")
    tolerances = MassTolerances(off.model, robot)
    assert [str(t) for t in tolerances.tolerances] == [
        "mass_tolerance of arm ± 10 %",
        "mass_tolerance of grip ± 20 %",
        "mass_tolerance of part ± 50 %",
    ]
    state = state_at(off, arm=POSE)
    nominal = simplified_mass(off.model, robot)
    for k, (sides, masses) in enumerate(
        [((1, 1, 1), (1.1, 0.84, 0.6)), ((-1, 1, -1), (0.9, 0.84, 0.2)), ((0, -1, 1), (1.0, 0.56, 0.6))]
    ):
        link, tool, part = masses
        real = loaded(tmp_path / f"b{k}", links=(link, link), tool=tool, part=part)
        other = real.model.robot("arm")
        # The library's point masses have an inertia of 1e-12 that is not scaled in the other twin.
        np.testing.assert_allclose(
            tolerances.matrices(state).at(sides), state_at(real, arm=POSE).mass_matrix(other), atol=1e-9
        )
        found = tolerances.simplified(nominal, sides)
        assert found == pytest.approx(simplified_mass(real.model, other), abs=1e-12)


@pytest.mark.parametrize(
    ("kind", "options"),
    [
        ("kinetic_energy", 'robot = "arm"'),
        ("effective_mass", 'at = "arm"'),
        ("effective_mass", 'at = "arm"\ntoward = "wall"'),
        ("effective_mass", 'at = "arm"\ntoward = "wall"\nalong = "worst"'),
    ],
)
def test_energy_and_mass_lie_between_those_of_the_lightest_and_the_heaviest(tmp_path, kind, options):
    def value(name, limit="", **masses):
        text = PLATE + criterion(kind, options + limit)
        return results_at(loaded(tmp_path / name, criteria=text, **masses), arm=POSE)["it"]

    light = value("light", links=(0.9, 0.9), tool=0.35).value
    heavy = value("heavy", links=(1.1, 1.1), tool=1.05).value
    off = {"robot": "mass_tolerance = 0.1\n", "grip": "mass_tolerance = 0.5"}
    result = value("off", **off)
    assert result.interval == pytest.approx((light, heavy), rel=1e-9)
    assert light < result.value < heavy
    for name, limit, verdict in (
        ("under", light * 0.999, "exceeded"),
        ("within", heavy * 1.001, "within"),
        ("low", light * 1.001, "undecided"),
        ("high", heavy * 0.999, "undecided"),
    ):
        found = value(name, f"\nlimit = {limit}", **off)
        assert found.verdict == verdict
        assert ("decided by mass_tolerance of" in found.reason) == (verdict == "undecided")
    inputs = {i.name: i.value for i in basis_in(tmp_path / "off").inputs}
    assert (inputs["mass_tolerance of arm"], inputs["mass_tolerance of grip"]) == (0.1, 0.5)


def test_heaviest_direction_is_bounded_whatever_direction_that_becomes(tmp_path):
    """In the plane, by brute force over masses; the third direction is infinite and has no interval."""
    text = criterion("effective_mass", 'at = "arm"\nalong = "worst"\nlimit = 9')
    result = results_at(loaded(tmp_path, robot="mass_tolerance = 0.1\n", criteria=text), arm=POSE)["it"]
    assert (result.value, result.interval, result.verdict) == (None, None, "exceeded")


def separation(folder, stop, *, x=6.0, more="", qd=(1.0, 0.0)):
    text = FLOATING + TWO_R + PERSON.format(x=x)
    text += criterion("separation", f'between = ["arm", "op"]\nstop = {{ {stop} }}\n{KNOWN}{more}')
    station = made(folder, text, {"arm.urdf": two_r()})
    return results_at(station, arm=((0.0, 0.0), qd))["it"]


TIMES = "acceleration = 0, reaction = {0}, stopping = {1}"
KNOWN = "intrusion = 0.2\nhuman_uncertainty = 0.1\nrobot_uncertainty = 0.05\nhuman_speed = 1.6\n"


@pytest.mark.parametrize(
    ("stop", "halves", "low", "high", "decides"),
    [
        (
            "acceleration = 0, reaction = {0}, stopping = {1}",
            "reaction = 0.02, stopping = 0.1",
            (0.08, 0.2),
            (0.12, 0.4),
            "stop.stopping ± 100 ms",
        ),
        (
            'model = "constant_deceleration", acceleration = 0, reaction = {0}, deceleration = {1}',
            "reaction = 0.02, deceleration = 2.0",
            (0.08, 6.0),
            (0.12, 2.0),
            "stop.deceleration ± 2 m/s²",
        ),
        (
            "acceleration = 0, reaction = {0}, stopping = {1}",
            "reaction = 0.02",
            (0.08, 0.3),
            (0.12, 0.3),
            "stop.reaction ± 20 ms",
        ),
    ],
)
@pytest.mark.parametrize("mode", ["dynamic", "fixed"])
def test_separation_lies_between_those_of_the_ends(tmp_path, stop, halves, low, high, decides, mode):
    """The shown interval is the distance, with what S_p may be off on its side."""
    middle = (0.1, (low[1] + high[1]) / 2)
    more = f'mode = "{mode}"\n'
    ends = [separation(tmp_path / n, stop.format(*at), more=more) for n, at in (("l", low), ("h", high))]
    off = stop.format(*middle) + f", tolerance = {{ {halves} }}"
    result = separation(tmp_path / "off", off, more=more)
    assert ends[0].limit < result.limit < ends[1].limit
    least, largest = (
        result.value - (ends[1].limit - result.limit),
        result.value + (result.limit - ends[0].limit),
    )
    assert result.interval == pytest.approx((least, largest), abs=1e-12)
    for k, (gap, verdict) in enumerate(
        [
            (ends[1].limit + 1e-3, "within"),
            (ends[1].limit - 1e-3, "undecided"),
            (ends[0].limit + 1e-3, "undecided"),
            (ends[0].limit - 1e-3, "exceeded"),
        ]
    ):
        found = separation(tmp_path / str(k), off, x=6.0 - result.value + gap, more=more)
        assert found.value == pytest.approx(gap, abs=1e-9)
        assert found.verdict == verdict
        assert (f"decided by {decides}" in found.reason) == (verdict == "undecided")
    assert any(
        i.name == "tolerance of stop.reaction" and i.value == 0.02 for i in basis_in(tmp_path / "off").inputs
    )


@pytest.mark.parametrize(
    ("stop", "word"),
    [
        (
            "acceleration = 0, reaction = 0.1, stopping = 0.3, tolerance = { reaction = 0.1 }",
            "reaction = 0.1 is not more",
        ),
        (
            "acceleration = 0, reaction = 0.1, stopping = 0.3, tolerance = { deceleration = 1 }",
            "deceleration is not given",
        ),
        ("acceleration = 0, reaction = 0.1, stopping = 0.3, tolerance = { reaction = -0.1 }", ">= 0"),
    ],
)
def test_a_tolerance_that_cannot_be_is_named_before_the_run(tmp_path, stop, word):
    with pytest.raises(InputError, match=word):
        separation(tmp_path, stop)


@pytest.mark.parametrize(
    ("limit", "verdict"),
    [(2.9, "within"), (2.9301, "undecided"), (2.9699, "undecided"), (2.9701, "exceeded")],
)
def test_a_distance_is_known_to_its_uncertainty(tmp_path, limit, verdict):
    """From the tip of the arm along x, 2 m, to the wall's face at 4.95 m: 2.95 m ± 20 mm."""
    wall = PLATE.replace("-3", "5")
    text = criterion("minimum_distance", f'between = ["arm", "wall"]\nlimit = {limit}\nuncertainty_mm = 20')
    station = made(tmp_path, FLOATING + TWO_R + wall + text, {"arm.urdf": two_r()})
    result = results_at(station, arm=((0.0, 0.0), (0.0, 0.0)))["it"]
    assert result.interval == pytest.approx((2.93, 2.97))
    assert result.verdict == verdict
    assert ("decided by uncertainty ± 20 mm" in result.reason) == (verdict == "undecided")


def test_what_a_person_is_off_by_is_in_every_distance(tmp_path):
    """A hand 30 mm from where a device sees it, turned by 0.1 rad: its points are within 30 mm + 0.1 ρ.

    Each bone counts with its own error: by brute force over all pairs.
    """
    text = FLOATING + TWO_R + PERSON.format(x=3.0)
    text += criterion("minimum_distance", 'between = ["arm", "op"]\nlimit = 0.3')
    text += criterion(
        "separation",
        f'between = ["arm", "op"]\nstop = {{ acceleration = 0, reaction = 0.1, stopping = 0.3 }}\n{KNOWN}',
    ).replace('"it"', '"S"')
    station = made(tmp_path, text, {"arm.urdf": two_r()})
    state = state_at(station, arm=((0.0, 0.0), (1.0, 0.0)))
    hand = next(b for b in station.model.bodies if b.name == "op/right_hand")
    reach = float(np.linalg.norm(hand.corners, axis=1).max()) + hand.radius
    before = {r.name: r for r in Judge(station.bound)(state)}
    assert before["S"].interval is None
    rng = np.random.default_rng(4)
    robot, person = station.model.robot("arm").moving, station.model.human("op").bodies
    apart = Query(station.model.shapes, person, robot).per_pair(state.rotations, state.positions)
    d = apart.distance.reshape(len(person), len(robot))
    for _ in range(20):
        state.hearings["op"].bones = {
            "right_hand": (0.03, 0.1),
            "left_hand": (None, None),
            **{
                bone: (float(rng.exponential(0.1)), 0.0)
                for bone in rng.choice(BONES, 5)
                if "hand" not in bone
            },
        }
        e = TrackingError(station.model, person).at(state)[:, None]
        assert e[person.index(hand.index), 0] == pytest.approx(0.03 + 0.1 * reach)
        after = {r.name: r for r in Judge(station.bound)(state)}
        interval = after["it"].interval or (after["it"].value,) * 2
        assert interval == pytest.approx(((d - e).min(), (d + e).min()), abs=1e-12)
        for k, body in enumerate(robot):
            part = next(p for p in after["S"].parts if p.name == station.model.bodies[body].name)
            interval = part.interval or (part.value,) * 2
            assert interval == pytest.approx(((d - e)[:, k].min(), (d + e)[:, k].min()), abs=1e-12)


@pytest.mark.parametrize("kind", ["kinetic_energy", "effective_mass"])
def test_a_centre_of_mass_that_is_off_in_any_direction_is_within_the_interval(tmp_path, kind):
    """Hundreds of shifts of 2 cm; the energy's upper end is met where the shift is along the motion."""
    options = 'robot = "arm"' if kind == "kinetic_energy" else 'at = "arm"'
    off = loaded(tmp_path / "off", grip="com_tolerance = 0.02", criteria=criterion(kind, options))
    found = results_at(off, arm=POSE)["it"]
    low, high = found.interval
    real = loaded(tmp_path / "real", criteria=criterion(kind, options))
    mj = real.model.mj
    body = mj.body("grip").id
    given = mj.body_ipos[body].copy()
    mj.body_sameframe[body] = mj.body_simple[body] = 0
    mj.dof_simplenum[:] = 0
    rng = np.random.default_rng(7)
    ways = rng.normal(size=(60, 3))
    ways[:2] = (0, 1, 0), (0, -1, 0)
    values = []
    for way in 0.02 * ways / np.linalg.norm(ways, axis=1)[:, None]:
        mj.body_ipos[body] = given + way
        values.append(results_at(real, arm=POSE)["it"].value)
    assert low <= min(values) < found.value < max(values) <= high
    assert "com_tolerance of grip" in {i.name for i in off.bound[0].basis.inputs}
    if kind == "kinetic_energy":
        state = state_at(off, arm=POSE)
        J = state.jacobian(off.model.frame("grip"), off.model.robot("arm"))
        v, w = (np.linalg.norm(rows @ POSE[1]) for rows in (J[:3], J[3:]))
        assert high - found.value == pytest.approx(0.5 * 0.7 * ((v + 0.02 * w) ** 2 - v**2), rel=1e-9)
        assert found.value - low == pytest.approx(0.5 * 0.7 * (v**2 - (v - 0.02 * w) ** 2), rel=1e-9)


def test_a_density_that_is_off_is_a_mass_that_is_off(tmp_path):
    """And a tolerance of a density that nobody gave is refused."""
    text = (
        FLOATING
        + TWO_R
        + GRIP.format(mass=0.7, more="MORE").replace("mass = 0.7\nuniform_density = true\nMORE", "{}")
    )
    text += criterion("kinetic_energy", 'robot = "arm"')
    density = 0.7 / (4 / 3 * np.pi * 0.02**3)
    by_density, by_mass = (
        results_at(made(tmp_path / str(i), text.replace("{}", more), {"arm.urdf": two_r()}), arm=POSE)["it"]
        for i, more in enumerate(
            (
                f"density = {density}\ndensity_tolerance = 0.1",
                "mass = 0.7\nuniform_density = true\nmass_tolerance = 0.1",
            )
        )
    )
    assert by_density.interval == pytest.approx(by_mass.interval, rel=1e-9)
    with pytest.raises(InputError, match="density_tolerance is of a density"):
        made(
            tmp_path / "none", text.replace("{}", "mass = 1\ndensity_tolerance = 0.1"), {"arm.urdf": two_r()}
        )


@pytest.mark.parametrize(
    ("more", "low", "high", "decides"),
    [
        (
            "human_speed_tolerance = 0.2\n",
            "human_speed = 1.4\n",
            "human_speed = 1.8\n",
            "human_speed ± 0.2 m/s",
        ),
        ("intrusion_tolerance = 0.03\n", "intrusion = 0.02\n", "intrusion = 0.08\n", "intrusion ± 30 mm"),
        ("intrusion_tolerance = 0.3\n", "intrusion = 0\n", "intrusion = 0.35\n", "intrusion ± 300 mm"),
    ],
)
@pytest.mark.parametrize("mode", ["dynamic", "fixed"])
def test_approach_speed_and_intrusion_that_are_off(tmp_path, more, low, high, decides, mode):
    nominal = "human_speed = 1.6\nintrusion = 0.05\n"
    given = dict(line.split(" = ") for line in nominal.splitlines())

    def result(name, changed, x=3.4):
        keys = {**given, **dict(line.split(" = ") for line in changed.splitlines())}
        text = FLOATING + TWO_R + PERSON.format(x=x)
        text += criterion(
            "separation",
            'between = ["arm", "op"]\nstop = { acceleration = 0, reaction = 0.1, stopping = 0.3 }\n'
            "human_uncertainty = 0\n"
            f'robot_uncertainty = 0\nmode = "{mode}"\n' + "\n".join(f"{k} = {v}" for k, v in keys.items()),
        )
        return results_at(made(tmp_path / name, text, {"arm.urdf": two_r()}), arm=((0, 0), (0.3, 0)))["it"]

    found, least, most = result("off", more), result("low", low), result("high", high)
    middle = result("middle", "")
    a, b = found.interval
    assert found.value - a == pytest.approx(most.limit - middle.limit, abs=1e-12)
    assert b - found.value == pytest.approx(middle.limit - least.limit, abs=1e-12)
    # Just outside of the nominal S_p.
    x = 3.4 - (middle.value - middle.limit) + 0.01
    open_ = result("open", more, x=x)
    assert open_.verdict == "undecided"
    assert f"decided by {decides}" in open_.reason


def test_tolerances_of_what_is_not_given_are_refused(tmp_path):
    for key in ("human_speed_tolerance", "intrusion_tolerance"):
        text = PERSON.format(x=3) + criterion(
            "separation",
            f'between = ["arm", "op"]\nstop = {{ acceleration = 0, reaction = 1, stopping = 1 }}\n'
            f"{key} = 0.1",
        )
        with pytest.raises(InputError, match=key):
            made(tmp_path, FLOATING + TWO_R + text, {"arm.urdf": two_r()})


def test_noise_of_speeds_counts_with_the_heaviest_masses(tmp_path):
    """Of a load that may weigh twice as much, noise of speeds has its energy, too."""

    def interval(name, **masses):
        cell = loaded(
            tmp_path / name, criteria=PLATE + criterion("kinetic_energy", 'robot = "arm"'), **masses
        )
        engine = Engine(cell.model, controllers=False)
        engine.take([heard("arm", 0.0, *POSE, qd_error=(0.2, 0.2))])
        return judged(cell.bound, engine.start())[0].interval

    heavy = interval("heavy", links=(1.1, 1.1), tool=1.05)
    off = interval("off", robot="mass_tolerance = 0.1\n", grip="mass_tolerance = 0.5")
    assert off[1] == pytest.approx(heavy[1], rel=1e-9)
    assert off[0] <= interval("light", links=(0.9, 0.9), tool=0.35)[0]


@pytest.mark.parametrize(
    ("kind", "options"),
    [
        ("joint_torque", 'robot = "arm"\ntorques = "model"\ntorque_uncertainty = [5, 5, 5, 5, 5, 5]'),
        ("joint_torque", 'robot = "arm"\nlargest_residual = [5, 5, 5, 5, 5, 5]'),
        ("force_polytope", 'at = "arm"\nlimit = 4900'),
        (
            "tool_force",
            'at = "arm"\nlimit = 1e3\ntorques = "measured"\ntorque_uncertainty = [1, 1, 1, 1, 1, 1]',
        ),
    ],
)
def test_torques_that_a_model_needs_are_not_within_where_masses_may_be_off(tmp_path, kind, options):
    """A load of 6 kg ± 40 %: what holds it is off by as much, and nobody follows it here."""
    q, still = (0.3, -1.2, 1.5, -1.8, -1.57, 0.2), (0.0,) * 6

    def said(name, more):
        load = '[[tools]]\nname = "grip"\non = "arm/tool0"\nshape = { box = [0.1, 0.1, 0.1] }\nmass = 6\n'
        robot = '[[robots]]\nname = "arm"\nmodel = "library:ur10"\n'
        cell = made(tmp_path / name, robot + load + more + criterion(kind, options))
        held = np.zeros(6)
        for _ in range(2):  # what holds it is what is measured
            engine = Engine(cell.model)
            engine.take([heard("arm", 0.0, q, still, tau=tuple(held.tolist()))])
            state = engine.start()
            held = joint_torques.gravity(state, cell.model.robot("arm"))
        engine.take([heard("arm", 0.01, q, still, tau=tuple(held.tolist()))])
        judge = Judge(cell.bound)
        judge(state)
        return judge(engine.tick())[0]

    even = "uniform_density = true\n"
    sure = said("sure", even)
    assert sure.verdict == "within", sure.reason
    off = said("off", f"{even}mass_tolerance = 0.4\n")
    assert off.verdict == "undecided"
    assert "mass_tolerance of grip ± 40 % not followed in torques that the model needs" in off.reason
    assert said("alone", "").verdict == "undecided"
    # A centre alone says nothing of moments; these do not count for what stands.
    off = said("turned", "com = [0.03, 0, 0]\n")
    assert off.verdict == ("within" if kind == "force_polytope" else "undecided")
    given = "com = [0.03, 0, 0]\ninertia = [0.01, 0.01, 0.01, 0, 0, 0]\n"
    assert said("given", given).verdict == "within"
