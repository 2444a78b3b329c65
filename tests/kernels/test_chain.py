"""Rows along directions are those of the Jacobian, and displacements are bounds that are reached."""

from __future__ import annotations

import numpy as np
import pytest

from made_cell import UR10, made, state_at
from seerob.kernels.displacement import displacements
from seerob.model.model import Frame

TOLERANCE = 1e-13


@pytest.fixture(scope="module")
def station(tmp_path_factory):
    return made(tmp_path_factory.mktemp("chain"), UR10)


def test_rows_along_are_those_of_the_jacobian(station):
    rng = np.random.default_rng(2)
    robot = station.model.robot("arm")
    for _ in range(5):
        state = state_at(station, arm=(rng.uniform(-3, 3, 6), np.zeros(6)))
        offsets, u = rng.normal(size=(2, len(robot.moving), 3))
        points = np.array(
            [state.positions[i] + state.rotations[i] @ o for i, o in zip(robot.moving, offsets, strict=True)]
        )
        found = state.along(robot.moving, robot, points, u)
        for row, i, offset, direction in zip(found, robot.moving, offsets, u, strict=True):
            frame = Frame("", station.model.bodies[i].mj, np.eye(4))
            J_v = state.jacobian(frame, robot, offset)[:3]
            np.testing.assert_allclose(row, direction @ J_v, atol=TOLERANCE)


def test_displacements_bound_every_point_and_are_reached():
    rng = np.random.default_rng(4)
    corners = rng.normal(size=(12, 3))
    start = np.array([0, 8, 8, 12])
    pairs = np.array([[-1, 0], [2, 0], [0, 2], [-1, 1]])
    R = [np.array([np.linalg.qr(rng.normal(size=(3, 3)))[0] for _ in range(3)]) for _ in range(2)]
    x = list(rng.normal(size=(2, 3, 3)))
    found = np.empty(4)
    displacements(R[0], x[0], R[1], x[1], pairs, corners, start, found)

    def seen(k, i, j, points):
        world = points @ R[k][j].T + x[k][j]
        return world if i < 0 else (world - x[k][i]) @ R[k][i]

    for (i, j), most in zip(pairs[:3], found, strict=False):
        hull = corners[start[j] : start[j + 1]]
        ways = np.linalg.norm(seen(1, i, j, hull) - seen(0, i, j, hull), axis=1)
        assert most == pytest.approx(ways.max(), rel=1e-12)
        inner = rng.dirichlet(np.ones(len(hull)), 200) @ hull
        assert (np.linalg.norm(seen(1, i, j, inner) - seen(0, i, j, inner), axis=1) <= most + 1e-12).all()
    assert found[3] == 0.0


def test_a_frame_that_is_forgotten_leaves_nothing_to_the_next_that_gets_its_place_in_memory(station):
    state = state_at(station, arm=(np.linspace(-1, 1, 6), np.zeros(6)))
    robot = station.model.robot("arm")
    for _ in range(50):
        for i in robot.moving:
            assert np.array_equal(
                state.pose(Frame("", station.model.bodies[i].mj, np.eye(4)))[1], state.positions[i]
            )
