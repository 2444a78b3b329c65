"""Bounds on the way between two ticks, in closed form: not below what happens, and not above what is said."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from made_cell import FLOATING, TWO_R, made, two_r
from seerob.twin.spans import (
    ROUNDING,
    Fall,
    Path,
    Points,
    Relative,
    Ways,
    change_of_motion,
    coupling_of,
    down_to,
    joints_of,
    rows_of,
)

OTHER = TWO_R.replace('"arm"\n', '"other"\nbase = { position = [0, 3, 0] }\n', 1)
POST = '[[parts]]\nname = "post"\nshape = { sphere = 0.1 }\nat = { position = [9, 0, 0] }\nmass = 1\n'
MASSES = (0.5, 3.0)
"""Of links, each a point at its end [kg]."""
BEGIN = 0.3
"""Of the way [s]."""
V, A, T = np.array([0.7, -1.1, 0.4, 0.9]), np.array([2.0, 3.0, -5.0, 0.5]), 0.02
"""Of two joints of each arm: at the begin [rad/s], and while it lasts [rad/s²]; how long [s]."""


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    folder = tmp_path_factory.mktemp("ways")
    return made(folder, FLOATING + TWO_R + OTHER + POST, {"arm.urdf": two_r(masses=MASSES)}).model


def reference(v, a, c, lengths):
    """Of a chain of turning joints, as `seerob.kernels.spans` states it: speed, acceleration, and J."""
    W = W1 = W2 = speed = quick = varies = 0.0
    for k, length in enumerate(lengths):
        W2 += c[k] + T * (2 * a[k] * W + v[k] * (W1 + W * W))
        W1 += a[k] + v[k] * W
        W += v[k]
        speed, quick = speed + W * length, quick + (W1 + W * W) * length
        varies += (W2 + T * (3 * W * W1 + W**3)) * length
    return speed, quick, varies


def evenly(v=V, a=A):
    """The way of joints that speed up evenly."""
    q0 = np.array([0.3, -0.4, 0.5, 0.6])
    return Path(
        np.array([BEGIN, BEGIN + T]), np.array([q0, q0 + v * T + a * T * T / 2]), np.array([v, v + a * T])
    )


def ids_of(model):
    return np.array([body.mj for body in model.bodies], np.int64)


def body(model, name):
    return next(b for b in model.bodies if b.name == name)


def bounded(model, path=None, points=None):
    points = points or Points(model)
    return points, points.span(path or evenly(), BEGIN, BEGIN + T, ids_of(model), model.mj)


def test_accelerations_are_those_at_the_ends_of_each_piece_or_of_each_step():
    rng = np.random.default_rng(3)
    t = np.array([0.0, 0.1, 0.25, 0.3, 0.5])
    path = Path(t, rng.normal(size=(5, 3)), rng.normal(size=(5, 3)))
    dofs = np.array([2, 0])

    def slope(at, h):
        return (path.at(at + h)[1] - path.at(at - h)[1])[dofs] / (2 * h)

    for begin, end, pieces in (
        (0.0, 0.5, range(4)),
        (0.1, 0.3, (1, 2)),
        (0.15, 0.2, (1,)),
        (0.2, 0.4, (1, 2, 3)),
    ):
        expected, steps = [], []
        for k in pieces:
            low, high = max(begin, t[k]), min(end, t[k + 1])
            h = (high - low) / 8
            # Velocities are parabolas: slopes are exact, and lie on a line.
            near, far = slope(low + 2 * h, h), slope(high - 2 * h, h)
            expected += [near - (far - near) / 2, far + (far - near) / 2]
            steps.append((path.v[k + 1] - path.v[k])[dofs] / (t[k + 1] - t[k]))
        np.testing.assert_allclose(path.accelerations(begin, end, dofs, stepped=False), expected, rtol=1e-9)
        np.testing.assert_allclose(path.accelerations(begin, end, dofs, stepped=True), steps, rtol=1e-12)


def test_a_span_is_cut_at_the_knot_nearest_to_its_middle_else_there():
    path = Path(np.array([0.0, 0.3, 0.5, 1.0]), np.zeros((4, 1)), np.zeros((4, 1)))
    cuts = {
        (0.0, 1.0): 0.5,
        (0.0, 0.5): 0.3,
        (0.2, 0.7): 0.5,
        (0.3, 0.5): 0.4,
        (0.5, 1.0): 0.75,
        (0.1, 0.3): 0.2,
    }
    assert {ends: path.middle(*ends) for ends in cuts} == pytest.approx(cuts)
    assert path.captured_at(0.4) is None
    told = Path(path.t, path.q, path.v, captured=(path.q + 1, path.v + 2))
    assert [part.tolist() for part in told.captured_at(0.3)] == [[1.0], [2.0]]


def test_ways_share_their_ends():
    t = np.arange(7.0)
    q = np.arange(14.0).reshape(7, 2)
    ways = Ways(t, q, -q, np.array([1, 3, 4, 6]))
    assert len(ways) == 3
    assert [path.t.tolist() for path in ways] == [[1, 2, 3], [3, 4], [4, 5, 6]]
    assert ways[-1].t.tolist() == [4, 5, 6]
    assert ways[1].v.tolist() == (-q[3:5]).tolist()
    assert ways.joined(0, 2).q.tolist() == q[1:5].tolist()
    assert [path.t.tolist() for path in ways[1:]] == [[3, 4], [4, 5, 6]]
    assert len(ways[2:1]) == len(Ways(t, q, q, np.array([], np.int64))) == 0
    assert ways.knots_inside().tolist() == [2, 5]
    assert ways[1:2].knots_inside().tolist() == []
    assert Ways(t, q, q, np.array([0, 2, 4])).knots_inside().tolist() == [1, 3]
    with pytest.raises(ValueError, match="without a step"):
        ways[::2]
    on, when = np.array([2, 0, 1, 0, 2]), np.array([4.3, 1.0, 3.7, 2.6, 6.0])
    each = [ways[way].at(instant) for way, instant in zip(on.tolist(), when.tolist(), strict=True)]
    for found, alone in zip(ways.at(on, when), zip(*each, strict=True), strict=True):
        assert found.tolist() == np.array(alone).tolist()


def test_points_are_as_fast_as_all_joints_before_them_with_the_segments_between(model):
    points = Points(model)
    own = points.add(body(model, "arm/l2").mj, np.array([0.3, 0.4, 0.0]), 0.1)
    still = points.add(0, np.array([9.0, 0.0, 0.0]), 0.5)
    bare = points.add(body(model, "arm/l1").mj, np.array([0.0, 0.5, 0.0]))
    assert (own, still, bare, points.count) == (5, 6, 7, 8)
    points, span = bounded(model, points=points)
    v, a, c = np.maximum(np.abs(V), np.abs(V + A * T)), np.abs(A), np.zeros(4)
    np.testing.assert_allclose(span.qd, v, rtol=1e-9)
    np.testing.assert_allclose(span.qdd, a, rtol=1e-9)
    outermost = [
        float(np.linalg.norm(b.corners, axis=1).max()) + b.radius + b.deviation for b in model.bodies[:4]
    ]
    lengths = [
        outermost[:1],
        [1.0, outermost[1]],
        outermost[2:3],
        [1.0, outermost[3]],
        [],
        [1.0, 0.6],
        [],
        [0.5],
    ]
    first = [0, 0, 2, 2, 0, 0, 0, 0]
    for k, (segments, j) in enumerate(zip(lengths, first, strict=True)):
        joints = slice(j, j + len(segments))
        expected = reference(v[joints], a[joints], c[joints], segments)
        found = span.fast[k], span.quick[k], 4 * span.bend[k] / T
        assert found == pytest.approx(expected, rel=1e-9, abs=1e-12), k
        which, turns, far = points.chain(k)
        assert (which.tolist(), turns.all()) == ([*range(4)][joints], True)
        assert far == pytest.approx(segments)
        most, varies = points.at_constant_speeds(span)
        assert most[k] == pytest.approx(reference(v[joints], c[joints], c[joints], segments)[1])
        assert varies[k] == pytest.approx(expected[2])
    dofs, chains = points.chains(rows_of([3, 5, 4]), ids_of(model), model.mj)
    assert dofs.tolist() == [0, 1, 2, 3]
    assert chains.start.tolist() == [0, 2, 4, 4]
    assert dofs[chains.joints].tolist() == [2, 3, 0, 1]
    assert chains.lengths == pytest.approx([*lengths[3], *lengths[5]])
    dofs, chain = points.chains(rows_of([4]), ids_of(model), model.mj)
    assert [len(part) for part in (dofs, *chain)] == [0, 2, 0, 0, 0]
    dofs, chain = Points(model).chains(rows_of([]), ids_of(model), model.mj)
    assert [len(part) for part in (dofs, *chain)] == [0, 1, 0, 0, 0]
    assert span.way(rows_of([0, 1, 4])) == span.fast[1] * span.T + ROUNDING
    assert span.way(rows_of([4])) == ROUNDING


def test_a_surface_is_as_much_farther_out_as_it_may_lie_outside_its_shape(model):
    rough = replace(body(model, "arm/l1"), solids=(replace(model.bodies[0].solids[0], deviation=0.25),))
    usual, more = bounded(model)[1], bounded(replace(model, bodies=(rough, *model.bodies[1:])))[1]
    assert more.fast[0] - usual.fast[0] == pytest.approx(0.25 * usual.qd[0])
    assert more.fast[1:].tolist() == usual.fast[1:].tolist()


def test_who_is_captured_elsewhere_is_as_fast_as_either_way(model):
    slow, fast = evenly(V * [1, 0.1, 1, 0.1], A * [0.1, 1, 0.1, 1]), evenly(V * 0.5, A * 0.5)
    _, both = bounded(model, Path(slow.t, slow.q, slow.v, captured=(fast.q, fast.v)))
    alone = [bounded(model, path)[1] for path in (slow, fast)]
    for what in ("fast", "quick", "bend", "qd", "qdd", "away"):
        np.testing.assert_array_equal(getattr(both, what), np.max([getattr(s, what) for s in alone], axis=0))
    none = np.zeros(5)
    both.between_speeds(none, none)
    np.testing.assert_array_less(alone[1].fast[:5] - 1e-15, both.fast[:5])
    assert bounded(model, slow)[1].fast[0] > 0


def test_who_jumps_has_no_bound_and_nobody_else(model):
    path = evenly()
    _, span = bounded(model, Path(path.t, path.q, path.v, broken=("other",)))
    usual = bounded(model)[1]
    for what in ("fast", "quick", "bend"):
        found, before = getattr(span, what), getattr(usual, what)
        assert np.isposinf(found[2:4]).all()
        assert found[[0, 1, 4]].tolist() == before[[0, 1, 4]].tolist()
    assert np.isposinf(span.qd[2:]).all()
    assert np.isposinf(span.qdd[2:]).all()
    assert span.qd[:2].tolist() == usual.qd[:2].tolist()


def test_speeds_at_both_ends_bound_those_between(model):
    _, span = bounded(model)
    before, after = np.array([0.1, 3.0, 0.2, 0.5, 0.0]), np.array([0.3, 2.9, 0.1, 0.6, 0.0])
    fast, changes = span.fast.copy(), span.quick * T
    span.between_speeds(before, after)
    ends, mean = np.maximum(before, after), (before + after) / 2
    most = np.minimum(mean + changes[:5] / 2, ends + span.bend[:5])
    np.testing.assert_allclose(span.ends, ends)
    np.testing.assert_allclose(span.slow, np.maximum(mean - changes[:5] / 2, 0.0))
    np.testing.assert_allclose(span.fast[:5], np.minimum(fast[:5], most))


def test_noise_of_speeds_is_that_at_one_end_and_what_points_and_axes_move_from_there(model):
    _, span = bounded(model)
    assert not span.noisy
    assert not span.noise.any()
    joints = np.array([0.03, 0.04, 0.0, 0.0])
    span.derived(np.array([0.0, 0.2, 0.0, 0.1, 0.0]), joints)
    moved = 0.05 * 2 * span.fast.max() * T
    np.testing.assert_allclose(span.noise, [0.0, 0.2 + moved, 0.0, 0.1 + moved, 0.0])
    assert span.joint_noise is joints
    assert span.noisy
    span.derived(np.zeros(5), joints)
    assert not span.noisy
    span.fast[:] = 0.5
    span.derived(np.ones(5), joints)
    np.testing.assert_allclose(span.noise, 1 + 0.05 * 2 * 0.5 * T)


def test_motion_changes_by_all_that_has_a_mass_and_by_rotors(model):
    model.mj.dof_armature[:] = [0.5, 0.0, 0.0, 0.0]
    try:
        points = Points(model)
        links = [body(model, f"arm/l{k}").mj for k in (1, 2)]
        change = change_of_motion(
            model,
            [0, *links, links[0]],
            np.array([0, 1]),
            points,
            lambda b: (1.2, 0.05) if b == links[1] else (1, 0),
        )
        assert points.count == 7
        _, span = bounded(model, points=points)
        turned = 0.5 * (span.qdd[0] * T) ** 2
        masses, rows = np.array([0.5, 3.6]), [5, 6]
        fall = np.sqrt(masses @ (span.quick[rows] * T) ** 2 + turned)
        assert change(span) == pytest.approx((fall, np.sqrt(masses @ span.bend[rows] ** 2 + turned / 4)))
        # A mass at 1 m from its joint, spread by what its inertia says, and by how far it may be off.
        spread = np.sqrt((2 * 2e-3 + 1e-11) / 2)
        v, a, c = span.qd, span.qdd, np.zeros(2)
        for row, more, lengths in ((5, 0.0, [1.0]), (6, 0.05, [1.0, 1.0])):
            lengths = [*lengths[:-1], lengths[-1] + spread + more]
            assert span.quick[row] == pytest.approx(reference(v, a, c, lengths)[1])
        plain = change_of_motion(model, links, np.array([2]), more := Points(model))
        _, alone = bounded(model, points=more)
        assert plain(alone)[0] == pytest.approx(np.sqrt(MASSES @ (alone.quick[5:] * T) ** 2))
        assert alone.quick[6] == pytest.approx(reference(v, a, c, [1.0, 1.0 + spread])[1])
        for what, where in ((span.quick, 6), (span.qdd, 1)):
            kept, what[where] = what[where], np.inf
            assert change(span) == (np.inf, np.inf)
            what[where] = kept
    finally:
        model.mj.dof_armature[:] = 0.0


def test_points_are_as_quick_seen_from_another_body_as_the_joints_between_them_make_them(model):
    l1, l2, far = (body(model, name).mj for name in ("arm/l1", "arm/l2", "other/l1"))
    tip = np.array([[1.0, 0.0, 0.0], [0.5, 0.0, 0.0]])
    pairs = [(l1, l2), (l2, l1), (l1, l1), (0, l2), (l2, far)]
    seen = Relative(model.mj, pairs, [tip] * 5, np.array([0.1, 0.2, 0.3, 0.0, 0.0]))
    _, span = bounded(model)
    v, a = span.qd, span.qdd
    quick = [
        reference(v[[1]], a[[1]], a[[1]], [1.1])[1],
        reference(v[[1]], a[[1]], a[[1]], [0.5 + 0.2])[1],  # the joint between them is at 1 m of the first
        0.0,
        reference(v[[0, 1]], a[[0, 1]], a[[0, 1]], [1.0, 1.0])[1],
        reference(v[[1, 0, 2]], a[[1, 0, 2]], a[[1, 0, 2]], [1.0, 3.0, 1.0])[1],
    ]
    assert seen.quick(span) == pytest.approx(quick)
    assert [joints_of(model.mj, b) for b in (0, l1, l2, far)] == [[], [0], [0, 1], [2]]


def test_margins_fall_to_what_is_left_and_no_farther():
    assert down_to(5.0, 2.0) == Fall(np.inf, 3.0)
    assert down_to(1.0, 2.0) == Fall(np.inf, 0.0)
    assert down_to(np.array([5.0, 1.0]), 2.0).bend.tolist() == [3.0, 0.0]


def test_what_follows_a_joint_moves_with_its_share(tmp_path):
    mimic = '<mimic joint="j1" multiplier="-0.5"/>'
    model = made(tmp_path, FLOATING + OTHER + TWO_R, {"arm.urdf": two_r(mimic=mimic)}).model
    moves, shares = coupling_of(model, model.robot("arm"))
    assert moves.tolist() == [False, False, True, True]
    assert shares.tolist() == [[0.0], [0.0], [1.0], [0.5]]


def test_a_machine_is_moved_by_its_own_slide(tmp_path):
    axis = '[[machines]]\nname = "axis"\nshape = { box = [0.2, 0.2, 0.1] }\nmass = 5\n'
    axis += "slide = { along = [1, 0, 0], lower = -1, upper = 1 }\n"
    model = made(tmp_path, FLOATING + axis).model
    assert joints_of(model.mj, model.bodies[0].mj) == [0]
    points = Points(model)
    points.chains(rows_of([0]), ids_of(model), model.mj)
    assert points.chain(0)[1].tolist() == [False]
