"""Bounds between samples against a thousand looks in each gap: never violated, and near what is met."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from made_cell import FLOATING, TWO_R, made, two_r
from seerob.app import cli
from seerob.core.errors import InputError, Undecided, UnknownName
from seerob.session.permissible.between_samples import BetweenSamples, wanted_bounds
from seerob.session.permissible.moving_joints import KinematicChain, MovingJoints, chains_of
from seerob.session.permissible.path import GivenMotion

POST = '[[parts]]\nname = "post"\nshape = {{ box = [0.2, 0.3, 0.2] }}\nat = {{ position = [{x}, 0.4, 0] }}\n'
SLIDING = (
    '<robot name="slider"><link name="base"/><link name="rail"><collision><geometry><box size="0.3 0.2 0.2"/>'
    '</geometry></collision></link><link name="arm"><collision><origin xyz="0.4 0 0"/><geometry>'
    '<box size="0.8 0.1 0.1"/></geometry></collision></link><link name="rod"><collision><geometry>'
    '<box size="0.6 0.05 0.05"/></geometry></collision></link>'
    '<joint name="j1" type="prismatic"><parent link="base"/><child link="rail"/><axis xyz="1 0 0"/>'
    '<limit lower="-9" upper="9" effort="1" velocity="9"/></joint>'
    '<joint name="j2" type="continuous"><parent link="rail"/><child link="arm"/><axis xyz="0 0 1"/>'
    '<limit effort="1" velocity="9"/></joint>'
    '<joint name="j3" type="prismatic"><parent link="arm"/><child link="rod"/><origin xyz="0.8 0 0"/>'
    '<axis xyz="1 0 0"/><limit lower="-9" upper="9" effort="1" velocity="9"/></joint></robot>'
)


def wild(seed, n=5, joints=2, step=0.1, size=0.4):
    """Positions and velocities that do not even belong together."""
    rng = np.random.default_rng(seed)
    q = np.cumsum(rng.normal(size=(n, joints)) * size / 2, axis=0)
    qd = rng.normal(size=(n, joints)) * size * 4
    t = np.cumsum(rng.uniform(0.5, 1.5, n)) * step
    return GivenMotion("arm", t, q, qd, np.ones(n, bool))


@pytest.fixture(scope="module", params=["turning", "sliding"])
def model(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp(request.param)
    urdf = two_r() if request.param == "turning" else SLIDING
    text = FLOATING + TWO_R + POST.format(x=5.5)
    return made(folder, text, {"arm.urdf": urdf}).model


def looks(model, motion, between, count):
    """Distances and speeds of the sets at many instants."""
    gap = model.gap(model.select("post"), model.select("arm"))
    distances, speeds = [], []
    # At the samples the acceleration jumps: a peak may stand there alone.
    for t in np.union1d(np.linspace(motion.t[0], motion.t[-1], count), motion.t):
        state = between._at(float(t))
        distances.append(gap.query.minimum(state.rotations, state.positions).distance)
        speeds.append(max(state.fastest_point(i)[0] for i in gap.b))
    return np.array(distances), np.array(speeds)


@pytest.mark.parametrize("seed", range(1, 3))
def test_bounds_hold_at_every_instant_and_are_tight(model, seed):
    n = len(model.robot("arm").joints)
    motion = wild(seed, joints=n)
    between = BetweenSamples(model, {"arm": motion})
    distance, speed = between.distance("post", "arm", tolerance=2e-3), between.speed("arm", tolerance=5e-3)
    distances, speeds = looks(model, motion, between, 1000 * (len(motion.t) - 1) + 1)
    assert distances.min() > 0
    assert distances.min() >= distance.value
    assert speeds.max() <= speed.value
    assert distances.min() - distance.value <= 2e-3 + 2e-6
    assert speed.value - speeds.max() <= 5e-3 + 2e-6
    # What was met lies between truth and bound.
    assert distance.value <= distance.found
    assert speed.found <= speed.value


def test_the_samples_alone_would_have_missed_it(model):
    """Fast in the middle, at rest at the samples: the bound sees what no sample shows."""
    n = len(model.robot("arm").joints)
    q = np.zeros((2, n))
    q[1, 1] = 1.0
    motion = GivenMotion("arm", np.array([0.0, 0.5]), q, np.zeros((2, n)), np.ones(2, bool))
    bound = BetweenSamples(model, {"arm": motion}).speed("arm/" + ("l2" if n == 2 else "arm"))
    # The middle of the cubic is 1.5 times the mean; the joint's own body reaches a metre, or 0.8 m.
    lever = np.hypot(1.0, 0.05) if n == 2 else np.hypot(0.8, 0.05)
    assert bound.value == pytest.approx(1.5 * 1.0 / 0.5 * lever, abs=2e-3)


def test_no_point_is_faster_or_quicker_than_its_chain_allows(model):
    """Finite differences of the corners of every body against w and A."""
    n = len(model.robot("arm").joints)
    motion = wild(11, joints=n)
    joints = MovingJoints(model, {"arm": motion})
    between = BetweenSamples(model, {"arm": motion})
    bodies = model.robot("arm").moving
    chains = chains_of(model, bodies, joints.slid())
    for t in np.random.default_rng(2).uniform(motion.t[0] + 0.01, motion.t[-1] - 0.01, 60):
        h = 1e-4
        if np.abs(motion.t - t).min() < 2 * h:
            continue
        places = []
        for at in (t - h, t, t + h):
            state = between._at(float(at))
            places.append(
                [model.bodies[i].corners @ state.rotations[i].T + state.positions[i] for i in bodies]
            )
        qd, qdd = joints.largest(np.array([t - h]), np.array([t + h]))
        for k, chain in enumerate(chains):
            a, b, c = (place[k] for place in places)
            acceleration = np.linalg.norm((a - 2 * b + c) / h**2, axis=1).max()
            speed = np.linalg.norm((c - a) / (2 * h), axis=1).max()
            assert acceleration <= chain.agility(qd, qdd)[0] * (1 + 1e-6) + 1e-4
            assert speed <= (qd[0, chain.dofs] * chain.weight).sum() * (1 + 1e-6)


def test_shapes_that_touch_have_no_bound(tmp_path):
    text = FLOATING + TWO_R + POST.format(x=1.0)
    model = made(tmp_path, text, {"arm.urdf": two_r()}).model
    sweep = GivenMotion(
        "arm", np.array([0.0, 1.0]), np.array([[0.0, 0], [1, 0]]), np.ones((2, 2)), np.ones(2, bool)
    )
    bound = BetweenSamples(model, {"arm": sweep}).distance("post", "arm")
    assert bound.value == -np.inf
    assert "no bound, they touch or overlap" in bound.sentence()
    json.dumps(bound.figures(), allow_nan=False)


def test_what_cannot_be_bounded_is_said(model, tmp_path):
    n = len(model.robot("arm").joints)
    motion = wild(0, joints=n)
    with pytest.raises(InputError, match="nobody moves"):
        BetweenSamples(model, {})
    between = BetweenSamples(model, {"arm": motion})
    with pytest.raises(InputError, match="tolerance"):
        between.speed("arm", tolerance=0.0)
    with pytest.raises(UnknownName):
        between.speed("nobody")
    with pytest.raises(Undecided, match="no source drives it"):
        BetweenSamples(
            made(tmp_path, FLOATING + TWO_R + TWO_R.replace('"arm"', '"two"'), {"arm.urdf": two_r()}).model,
            {"two": wild(0)},
        ).distance("arm", "two")


def test_assess_prints_and_reports_them(tmp_path, capsys):
    distance = '[[safety]]\nkind = "minimum_distance"\nbetween = ["post", "arm"]\n'
    source = '[[sources]]\nkind = "csv"\nrobot = "arm"\nfile = "m.csv"\n'
    rows = "".join(f"{t:.2f},{np.sin(t):.9f},{t:.9f}\n" for t in np.arange(0, 0.5, 0.05))
    text = FLOATING + TWO_R + POST.format(x=5.0) + source + distance
    made(tmp_path / "cell", text, {"arm.urdf": two_r(), "m.csv": "t [s],J1 [rad],J2 [rad]\n" + rows})
    words = ["assess", str(tmp_path / "cell"), "--between-samples", "-o", str(tmp_path / "out")]
    cli.main(words)
    assert "at every instant from 0.000 s to 0.450 s" in capsys.readouterr().out
    assert "Between the samples" in (tmp_path / "out/report.html").read_text(encoding="utf-8")


SLIDE = (
    '<robot name="slide"><link name="base"><collision><origin xyz="0 0 1"/><geometry>'
    '<box size="0.2 0.2 0.2"/></geometry></collision></link><link name="cart"><collision><geometry>'
    '<box size="0.2 0.2 0.2"/></geometry></collision></link>'
    '<joint name="j1" type="prismatic"><parent link="base"/><child link="cart"/>'
    '<axis xyz="1 0 0"/><limit lower="-9" upper="9" effort="1" velocity="9"/></joint></robot>'
)
BEAM = '[[parts]]\nname = "beam"\nshape = { box = [0.2, 9, 9] }\nat = { position = [1.5, 0, 0] }\n'


def slide(folder, *more):
    """A base that stands and a cart that slides toward a beam; two of them when ``more`` says so."""
    return made(folder, FLOATING + TWO_R + "".join(more) + BEAM, {"arm.urdf": SLIDE}).model


def cubic(name, t, q, qd, good=True):
    t, q, qd = (np.array(each, float) for each in (t, q, qd))
    return GivenMotion(name, t, q[:, None], qd[:, None], np.broadcast_to(good, t.shape))


def test_one_look_bounds_an_even_acceleration_exactly(tmp_path):
    """From rest at 2 m/s² for 1 s: 0.3 m are left at its end, where 2 m/s are reached."""
    between = BetweenSamples(slide(tmp_path), {"arm": cubic("arm", [0, 1], [0, 1], [0, 2])})
    distance = between.distance("arm", "beam", tolerance=9)
    assert distance.asked == 1
    assert distance.found == pytest.approx(1.3 - 0.25)
    assert distance.value == pytest.approx(1.3 - 1.0, abs=1e-6)
    assert distance.value < 1.3 - 1.0
    speed = between.speed("arm", tolerance=9)
    assert (speed.asked, speed.found) == (1, pytest.approx(1.0))
    assert speed.value == pytest.approx(2.0, abs=1e-6)
    evenly = BetweenSamples(slide(tmp_path), {"arm": cubic("arm", [0, 1], [0, 0.5], [0.5, 0.5])})
    even, left = evenly.speed("arm"), evenly.distance("arm", "beam", tolerance=9)
    assert even.found < even.value < even.found + 1e-6
    assert left.value == pytest.approx(1.3 - 0.5, abs=1e-6)
    assert evenly.distance("arm", "beam").found < 0.81
    assert evenly.distance("arm", "beam").value == pytest.approx(0.8, abs=2e-3)
    assert (left.unit, even.unit) == ("m", "m/s")


def test_bounds_speak_of_the_time_that_all_motions_have_and_say_which_are_doubtful(tmp_path):
    model = slide(tmp_path, TWO_R.replace('"arm"', '"other"') + "base = { position = [0, 3, 0] }\n")
    long, late = cubic("arm", [0, 3], [0, 0.3], [0.1, 0.1]), cubic("other", [1, 2], [0, 0], [0, 0])
    bounds = wanted_bounds(model, {"arm": long, "other": late}, most=9)
    assert {(b.start, b.end) for b in bounds} == {(1.0, 2.0)}
    assert {b.note for b in bounds} == {""}
    with pytest.raises(InputError, match="no time in common"):
        BetweenSamples(model, {"arm": cubic("arm", [0, 1], [0, 0], [0, 0]), "other": late})
    alone = wanted_bounds(model, {"arm": cubic("arm", [0, 1, 2], [0, 0, 0], [0, 0, 0], [1, 0, 1])}, most=9)
    assert [b.what for b in alone if b.what.startswith("speed")] == ["speed of arm"]  # the other one stands
    assert all("does not vouch for count too (arm)" in b.note for b in alone)


def test_the_bound_on_an_acceleration_is_the_sum_of_its_terms():
    """Of a turn, a slide and two turns, term by term as it is derived; of a slide that others turn, twice."""
    rng, turns = np.random.default_rng(2), np.array([True, False, True, True])
    w = np.where(turns, [3.0, 1.0, 0.7, 0.2], 1.0)
    qd, qdd = rng.uniform(0.1, 2, (2, 5, 6))
    dofs = np.array([0, 2, 3, 5])
    found = KinematicChain(dofs, turns, w).agility(qd, qdd)
    for v, a, bound in zip(qd[:, dofs], qdd[:, dofs], found, strict=True):
        total = 0.0
        for j in range(4):
            before = sum(v[i] for i in range(j) if turns[i])
            onward = sum(v[i] * w[i] for i in range(j, 4)) if turns[j] else 0.0
            total += a[j] * w[j] + v[j] * (2 * before * w[j] + onward)
        assert bound == pytest.approx(total, rel=1e-12)


def test_who_has_no_motion_stands_where_the_file_says_with_what_follows_its_joints(tmp_path):
    urdf = two_r(mimic='<mimic joint="j1" multiplier="0.5" offset="0.3"/>')
    model = made(tmp_path, FLOATING + TWO_R + "q = [0.2]\n", {"arm.urdf": urdf}).model
    qpos, qvel = MovingJoints(model, {}).at(0.0)
    assert qpos.tolist() == pytest.approx([0.2, 0.4])
    assert not qvel.any()


def test_every_joint_weighs_as_far_as_its_body_may_ever_be_from_it(tmp_path):
    """Rail, arm and rod in line: corners, ways between anchors, and how far a slide goes, moved or not."""
    urdf = SLIDING.replace('<box size="0.6 0.05 0.05"/>', '<sphere radius="0.05"/>')
    text = FLOATING + TWO_R + "q = [0.5, 0.1, -0.2]\nbase = { position = [1, 3, 0] }\n" + POST.format(x=9)
    model = made(tmp_path, text, {"arm.urdf": urdf}).model
    standing = MovingJoints(model, {}).slid()
    np.testing.assert_allclose(standing, [0.5, 0.1, 0.2])
    q = np.array([[0.1, 1.0, -0.3], [0.4, 2.0, -0.1], [0.0, 2.0, -0.1]])
    qd = np.array([[0.5, 0, 0.2], [-0.5, 0, 0.4], [0.5, 0, 0.1]])
    motion = GivenMotion("arm", np.array([0.0, 1.0, 3.0]), q, qd, np.ones(3, bool))
    joints = MovingJoints(model, {"arm": motion})
    a, b, c = np.diff(motion.t)[:, None] * qd[:-1], np.diff(motion.t)[:, None] * qd[1:], np.diff(q, axis=0)
    most = np.abs([q[:-1], a, 3 * c - 2 * a - b, a + b - 2 * c]).sum(axis=0).max(axis=0)
    np.testing.assert_allclose(joints.slid(), most)
    rail, arm, rod = chains_of(model, model.robot("arm").moving, most)
    assert [chain.turns.tolist() for chain in (rail, arm, rod)] == [
        [False],
        [False, True],
        [False, True, False],
    ]
    own = [model.bodies[i].radius + model.bodies[i].deviation for i in model.robot("arm").moving]
    np.testing.assert_allclose(rail.weight, [1.0])
    np.testing.assert_allclose(arm.weight, [1.0, np.hypot(0.8, np.hypot(0.05, 0.05)) + own[1]])
    assert own[2] >= 0.05
    np.testing.assert_allclose(rod.weight, [1.0, own[2] + most[2] + 0.8, 1.0])
    # Shapes that are simplified reach as far as what they are simplified from.
    bodies = [
        replace(body, solids=tuple(replace(solid, deviation=0.01) for solid in body.solids))
        for body in model.bodies
    ]
    coarse = chains_of(replace(model, bodies=tuple(bodies)), model.robot("arm").moving, most)[2]
    np.testing.assert_allclose(coarse.weight, np.add(rod.weight, [0, 0.01, 0]))
    (post,) = chains_of(model, model.select("post"), most)
    assert post.agility(np.ones((2, 3)), np.ones((2, 3))).tolist() == [0, 0]
    # Where joints are as compiled counts, whichever sign it has.
    model.mj.qpos0[:] = [0.7, -0.3, -0.1]
    np.testing.assert_allclose(MovingJoints(model, {}).slid(), [0.2, 0.4, 0.1])
    np.testing.assert_allclose(joints.slid(), np.add(most, [0.7, 0.3, 0.1]))


def test_no_joint_is_faster_or_quicker_than_is_said_of_a_span_and_one_instant_of_it_is(tmp_path):
    """The second of three joints follows the first, minus twice as fast; before and after it stands."""
    urdf = two_r(mimic='<mimic joint="j1" multiplier="-2" offset="-0.3"/>')
    model = made(tmp_path, FLOATING + TWO_R, {"arm.urdf": urdf}).model
    motion = GivenMotion(
        "arm",
        np.array([1.0, 1.5, 3.0]),
        np.array([[0], [0.4], [0.3]]),
        np.array([[1], [-2], [0.5]]),
        np.ones(3, bool),
    )
    joints = MovingJoints(model, {"arm": motion})
    low = np.array([1.0, 1.1, 1.5, 1.7, 2.9, 0.2, 0.5, 3.0, 3.5])
    high = np.array([1.5, 1.4, 3.0, 2.1, 3.0, 0.9, 1.0, 3.2, 4.0])
    qd, qdd = joints.largest(low, high)
    for i, (begin, end) in enumerate(zip(low, high, strict=True)):
        t = np.linspace(begin, end, 4001)
        v = motion.at(t)[1][:, 0] if begin >= 1.0 and end <= 3.0 else np.zeros(4001)
        np.testing.assert_allclose(qd[i], np.abs(v).max() * np.array([1, 2]), rtol=1e-6, atol=1e-12)
        a = np.abs(np.diff(v)).max() / (t[1] - t[0])
        np.testing.assert_allclose(qdd[i], a * np.array([1, 2]), rtol=1e-3, atol=1e-12)
    # Where it is, the follower with its offset; as far as both could ever be from where they were compiled.
    qpos, qvel = joints.at(1.25)
    at, v = motion.at(np.array([1.25]))
    np.testing.assert_allclose(qpos, [at[0, 0], -0.3 - 2 * at[0, 0]])
    np.testing.assert_allclose(qvel, [v[0, 0], -2 * v[0, 0]])
    most = np.abs(motion.powers()).sum(axis=0).max()
    home = np.abs(model.mj.qpos0)
    np.testing.assert_allclose(joints.slid(), [most + home[0], 2 * most + 0.3 + home[1]])
    other = GivenMotion("x", np.array([0.0, 1.6, 2.0]), motion.q, motion.qd, motion.good)
    both = MovingJoints(model, {"arm": motion, "x": other})
    np.testing.assert_array_equal(both.breaks(1.2, 2.0), [1.2, 1.5, 1.6, 2.0])
