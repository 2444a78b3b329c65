"""Beside OMPL: a path where it finds one, not much longer, and the same opinion of what is clear."""

from itertools import pairwise

import numpy as np
import pytest
from test_planning import ARM, CELL

import seerob
from seerob.planning.clearance import Clearance
from seerob.planning.plan import plan

MARGIN = 0.03


def test_a_path_is_found_where_ompl_finds_one_and_is_not_much_longer(tmp_path):
    base = pytest.importorskip("ompl.base")
    from ompl import geometric, util

    util.setLogLevel(util.LOG_NONE)
    (tmp_path / "arm.urdf").write_text(ARM, encoding="utf-8")
    (tmp_path / "workstation.toml").write_text(CELL.format(x=0.8), encoding="utf-8")
    model = seerob.load(tmp_path).model
    ours = plan(model, "arm", [[1.2, 0.0]], margin=MARGIN)
    clearance = Clearance(model, model.robot("arm"), ours.q[0])

    space = base.RealVectorStateSpace(2)
    bounds = base.RealVectorBounds(2)
    bounds.setLow(-3)
    bounds.setHigh(3)
    space.setBounds(bounds)
    setup = geometric.SimpleSetup(space)
    setup.setStateValidityChecker(lambda s: not clearance.fault(np.array([s[0], s[1]]), MARGIN))
    start, goal = space.allocState(), space.allocState()
    for state, q in ((start, ours.q[0]), (goal, ours.q[-1])):
        state[0], state[1] = q.tolist()
    setup.setStartAndGoalStates(start, goal)
    setup.setPlanner(geometric.RRTConnect(setup.getSpaceInformation()))
    assert setup.solve(60.0)
    theirs = np.array([[s[0], s[1]] for s in setup.getSolutionPath().getStates()])
    assert np.abs(theirs[[0, -1]] - ours.q[[0, -1]]).max() < 1e-9
    length = [sum(np.linalg.norm(b - a) for a, b in pairwise(path)) for path in (ours.q, theirs)]
    assert length[0] < 1.3 * length[1]
    # What OMPL samples as clear may be nearer between its samples, but not by more than it moves there.
    for a, b in pairwise(theirs):
        assert clearance.least(a, b) > 0
