"""Planning beside others that move: against distances by Coal at poses of MuJoCo, looked at densely."""

import coal
import mujoco
import numpy as np
import pytest
from numba.core.sigutils import normalize_signature
from test_planning import ARM

import seerob
from seerob.app import cli
from seerob.app.console.terminal import Exit
from seerob.core.errors import InputError
from seerob.kernels import ways
from seerob.kernels._beforehand import PLANNING, PLANNING_IN_TIME
from seerob.session.permissible.joint_limits import limits_of
from seerob.session.permissible.path import GivenMotion
from seerob.session.planning.among_moving import ClearanceInTime
from seerob.session.planning.clearance import Clearance
from seerob.session.planning.in_time import plan_in_time
from seerob.session.planning.others import alone, course, movers
from seerob.session.planning.plan import NoPath
from seerob.session.planning.timed_moves import Move, Rows, rows
from seerob.session.station import Station

CELL = """
[[robots]]
name = "arm"
model = "arm.urdf"
q = [-1.2, 0.0]
acceleration_limits = [3.0, 3.0]
jerk_limits = [30.0, 30.0]

[[robots]]
name = "other"
model = "arm.urdf"
base = {{ position = [{x}, 0.0, 0.0], rpy_deg = [0, 0, {turned}] }}
q = [0.0, 0.0]

[[parts]]
name = "post"
shape = {{ sphere = 0.1 }}
at = {{ position = [0.0, 1.2, 0.0] }}

[[sources]]
kind = "csv"
robot = "other"
file = "other.csv"
"""
START, GOAL, MARGIN = np.array([-1.2, 0.0]), np.array([1.2, 0.0]), 0.03
PACE = 2.5
"""Of the other arm, from one posture to the next [s]."""
ACROSS, AWAY = (0.0, 0.0), (1.5, 0.5)
"""Of the other arm: over the middle of the planned one's way, and beside it."""


def cell(folder, x=1.75, turned=180.0, postures=(ACROSS, ACROSS), missing=(), period=0.05):
    """The other goes from posture to posture within `PACE` each, with a row every 50 ms."""
    q = np.array(postures, float)
    k, share = np.divmod(np.arange(0, len(q) - 1 + 1e-9, period / PACE), 1.0)
    k = np.minimum(k.astype(int), len(q) - 2)
    share = np.where(np.arange(len(share)) == len(share) - 1, 1.0, share)[:, None]
    way = q[k] + (q[k + 1] - q[k]) * share * share * (3 - 2 * share)
    t = period * np.arange(len(way))
    text = "t [s],j1 [rad],j2 [rad]\n"
    text += "".join(
        f"{s:.3f},{a:.9f},{b:.9f}\n"
        for s, (a, b) in zip(t, way.tolist(), strict=True)
        if not any(low < s < high for low, high in missing)
    )
    folder.mkdir(exist_ok=True)
    (folder / "arm.urdf").write_text(ARM, encoding="utf-8")
    (folder / "other.csv").write_text(text, encoding="utf-8")
    (folder / "workstation.toml").write_text(CELL.format(x=x, turned=turned), encoding="utf-8")
    return seerob.load(folder)


def planned(station, goals=(GOAL,), **how):
    who = movers(station.workstation, "arm")
    bare = Station(alone(station.workstation, "arm", who, ()))
    limits = limits_of(bare.model, bare.model.robot("arm"))
    known = course(bare, who, lambda: False)
    return plan_in_time(
        bare.model, "arm", goals, course=known, who=who, limits=limits, margin=MARGIN, **how
    ), limits


def nearest(station, found):
    """By Coal, every 4 ms: both arms' cylinders and the post."""
    model = station.model
    data, mj = mujoco.MjData(model.mj), model.mj
    opened = next(o for s, o in station.sources if s.target() == "other")
    other = GivenMotion.of(list(opened.samples))
    own = GivenMotion("arm", found.t, found.q, found.qd, np.ones(len(found.t), bool))
    link = coal.Cylinder(0.02, 0.5)
    turn = np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])
    least = np.inf
    for t in np.arange(0.0, found.t[-1], 0.004):
        for name, motion in (("arm", own), ("other", other)):
            m = model.mechanisms[name]
            data.qpos[m.q_address] = m.coupling @ motion.at(np.array([t]))[0][0] + m.offset
        mujoco.mj_kinematics(mj, data)

        def placed(name, data=data):
            body = next(b for b in model.bodies if b.name == name)
            R, x = data.xmat[body.mj].reshape(3, 3), data.xpos[body.mj]
            return coal.Transform3s(R @ turn, x + R @ np.array([0.25, 0, 0]))

        ball = coal.Transform3s(np.eye(3), np.array([0.0, 1.2, 0.0]))
        mine = [placed(f"arm/{name}") for name in ("upper", "fore")]
        pairs = [(link, placed(f"other/{name}")) for name in ("upper", "fore")] + [(coal.Sphere(0.1), ball)]
        for a in mine:
            for shape, b in pairs:
                result = coal.DistanceResult()
                least = min(least, coal.distance(link, a, shape, b, coal.DistanceRequest(), result))
    return least


def test_moves_stay_within_limits_and_rows_say_them_without_loss():
    random, reached = np.random.default_rng(0), []
    for k in range(300):
        v, a, j = random.uniform(0.2, 3, 2), random.uniform(0.2, 10, 2), 10 ** random.uniform(-0.5, 2.5, 2)
        limits = type("Limits", (), {"velocity": v, "acceleration": a, "jerk": j})
        start, goal = random.uniform(-3, 3, (2, 2))
        goal = start + (goal - start) * (10 ** random.uniform(-4, 0) if k % 2 else 1.0)
        move = Move.of(0.5, start, goal, limits)
        first, second, third = move.windows
        way = np.abs(goal - start)
        shares = (
            (way / first / v).max(),
            (way / first / second / a).max(),
            (way / first / second / third / j).max() * 2,
        )
        reached.append(max(shares))
        assert max(shares) <= 1.0
        found = rows([move], start, 0.0, move.end)
        assert found.within(limits)
        t = np.linspace(0.0, move.end, 200)
        again = GivenMotion("", found.t, found.q, found.qd, np.ones(len(found.t), bool)).at(t)[0]
        np.testing.assert_allclose(again, start + move.at(t)[0], atol=1e-6)
    assert min(reached) > 0.98


def test_who_passes_is_waited_for_or_gone_around_and_never_met(tmp_path):
    """Random motions of the other; the nearer of two the same never permits less distance."""
    random, times = np.random.default_rng(4), []
    for k in range(3):
        postures = [random.uniform(-1.0, 1.0, 2) for _ in range(4)] + [AWAY] * 4
        for x in (1.95, 1.55):
            station = cell(tmp_path / f"{k}{x}", x=x, postures=postures)
            try:
                found, limits = planned(station, seed=k)
            except NoPath:
                continue
            motion = found.rows
            assert motion.within(limits)
            assert nearest(station, motion) >= MARGIN
            np.testing.assert_array_equal(motion.q[0], START)
            np.testing.assert_allclose(motion.q[-1], GOAL, atol=1e-12)
            times.append(motion.t[-1])
    assert len(times) >= 3


def test_a_motion_that_is_called_clear_is_clear_at_every_instant(tmp_path):
    station = cell(tmp_path / "cell", postures=(AWAY, ACROSS, AWAY, AWAY))
    who = movers(station.workstation, "arm")
    bare = Station(alone(station.workstation, "arm", who, ()))
    model, known = bare.model, course(bare, who, lambda: False)
    every = Clearance(model, model.robot("arm"), START, places={"other": np.zeros(2)})
    moving, told = ClearanceInTime(model, every, known, known.end), []
    limits = limits_of(model, model.robot("arm"))
    for begin in np.linspace(0.0, 4.0, 9):
        move = Move.of(begin, START, GOAL, limits)
        if move.end > known.end:
            continue
        motion = rows([move], START, 0.0, move.end)
        truth = nearest(station, motion)
        for margin in (truth - 2e-3, truth + 2e-3):
            if margin > 0:
                clear = moving.fault(motion, margin) is None
                told.append(clear)
                # The shapes' own deviation is taken off.
                assert clear <= (margin <= truth)
    assert set(told) == {True, False}
    still = Rows(np.array([0.0, known.end + 1]), np.array([START, START]), np.zeros((2, 2)))
    assert moving.fault(still, 0.0) is not None


def test_where_somebody_stands_across_every_way_there_is_no_plan_until_they_leave(tmp_path):
    """With the elbow locked by the margin nobody gets past a stretched arm that reaches the base."""
    shut = cell(tmp_path / "shut", x=1.15, postures=[ACROSS] * 5)
    with pytest.raises(NoPath, match=r"known until 10\.00 s.*that there is none is not known"):
        planned(shut)
    leaves = cell(tmp_path / "leaves", x=1.15, postures=[ACROSS, ACROSS, ACROSS, AWAY, AWAY, AWAY, AWAY])
    found, _ = planned(leaves)
    assert found.rows.t[-1] > 2 * PACE
    assert nearest(leaves, found.rows) >= MARGIN
    assert planned(leaves, begin=4.0)[0].rows.t[-1] >= found.rows.t[-1] - 0.2


def test_of_whom_is_not_known_where_they_are_nothing_is_planned_beside(tmp_path):
    gap = cell(tmp_path / "gap", x=1.95, postures=[AWAY] * 6, missing=[(0.6, 3.0)])
    with pytest.raises(NoPath, match=r"known until 0\.\d+ s \(other"):
        planned(gap)
    never = cell(tmp_path / "never", x=1.95, postures=[AWAY] * 6, missing=[(0.02, 3.0)])
    with pytest.raises((InputError, NoPath), match="other"):
        planned(never)


def test_a_plan_in_time_is_a_table_that_a_run_finds_within(tmp_path, capsys):
    folder = tmp_path / "cell"
    cell(folder, x=1.15, postures=[ACROSS, ACROSS, AWAY, AWAY, AWAY, AWAY])
    file = folder / "planned.csv"
    call = ["plan", str(folder), "--robot", "arm", "--to=1.2,0", f"--margin={MARGIN}", "--others", "moving"]
    assert cli.main([*call, "-o", str(folder / "planned.toml")]) == Exit.ERROR
    capsys.readouterr()
    assert cli.main([*call, "-o", str(file)]) == Exit.WITHIN
    said = capsys.readouterr().out
    assert "waiting" in said
    assert "other: moves as its source says" in said
    text = (folder / "workstation.toml").read_text(encoding="utf-8")
    text += (
        '[[sources]]\nkind = "csv"\nrobot = "arm"\nfile = "planned.csv"\norigin = "planned"\n'
        "[engine]\nphysics = false\n"
        '[[safety]]\nkind = "minimum_distance"\nname = "apart"\nbetween = ["arm", "other"]\n'
        f"limit = {MARGIN}\n"
    )
    (folder / "workstation.toml").write_text(text, encoding="utf-8")
    summary = seerob.load(folder).run()
    assert summary.results["apart"].min() >= MARGIN


def test_a_plan_compiles_no_loop_with_other_types_than_are_listed(tmp_path):
    planned(cell(tmp_path / "cell", x=1.95, postures=[AWAY, ACROSS, AWAY]))
    for name, types in {**PLANNING, **PLANNING_IN_TIME}.items():
        loop = getattr(ways, name.split()[1])
        assert set(loop.signatures) <= {normalize_signature(types)[0]}
