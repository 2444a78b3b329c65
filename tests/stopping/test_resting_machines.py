"""Up to which speed what carries a robot, and what it carries, rests; and which results wait for it."""

from __future__ import annotations

import numpy as np
import pytest

from made_cell import FLOATING, TWO_R, made, state_at, two_r
from seerob.criteria.contact.clamping import STILL
from seerob.criteria.contact.impact_mass import Behind
from seerob.criteria.stopping.models import Stop, bind_stop
from seerob.criteria.stopping.simulated import StopSimulation
from seerob.twin.moving_base import RESTS

AXIS = """
[[machines]]
name = "axis"
shape = { box = [0.1, 0.1, 0.1] }
mass = 2
slide = { along = [1, 0, 0], lower = -1, upper = 1 }
"""
WALL = '[[parts]]\nname = "wall"\nshape = { box = [0.1, 1, 1] }\nat = { position = [9, 0, 0] }\n'
SPEEDS = [(0.0, True), (RESTS, True), (-RESTS, True), (1.05e-3, False), (-1.05e-3, False)]


PRESSED = [(0.0, True), (STILL, True), (-STILL, True), (1.05e-6, False), (-1.05e-6, False), (RESTS, False)]
"""A drive behind the robot presses however slowly it moves it."""


def moving(cell, speed):
    state = state_at(cell, arm=((0.0, 0.0), (0.1, 0.0)), axis=([0.0], [0.0]))
    state.data.qvel[cell.model.mechanisms["axis"].v_address] = speed
    return state


def test_both_rest_up_to_a_millimetre_a_second():
    assert RESTS == 1e-3


@pytest.mark.parametrize(("speed", "rests"), SPEEDS)
def test_a_machine_on_the_robot_stops_by_neither_its_brakes_nor_its_table(tmp_path, speed, rests):
    text = FLOATING + TWO_R + AXIS.replace("mass = 2", 'mass = 2\non = "arm/tip"') + WALL
    cell = made(tmp_path, text, {"arm.urdf": two_r()})
    robot = cell.model.robot("arm")
    gap = cell.model.gap(cell.model.select("wall"), robot.moving)
    stop = bind_stop(
        Stop(acceleration=0.0, reaction=0.1, model="simulated", brakes=(9.0, 9.0)), cell.model, robot, gap
    )
    if rests:
        assert stop.courses(moving(cell, speed))(1.0).T_s > 0
        return
    found = stop.courses(moving(cell, speed))(1.0)
    assert "axis moves on arm" in found.unbounded_reason
    # How far it gets before it brakes is known all the same.
    assert (found.S_r > 0).all()
    assert not found.S_s.any()


def test_a_simulated_stop_is_that_of_the_robot_alone(tmp_path):
    """What carries it stands still where it is, however it moves now."""
    cell = made(tmp_path, FLOATING + AXIS + TWO_R + 'on = "axis"\n', {"arm.urdf": two_r()})
    robot = cell.model.robot("arm")
    simulation = StopSimulation(cell.model, robot, np.array([9.0, 9.0]), robot.moving)
    rests, moves = (simulation.stop(moving(cell, speed), 0.1) for speed in (0.0, 0.7))
    assert rests.speeds[0] == pytest.approx([0.1 * np.hypot(1, 0.05), 0.1 * np.hypot(2, 0.05)])
    np.testing.assert_array_equal(rests.speeds, moves.speeds)


@pytest.mark.parametrize(("speed", "rests"), PRESSED)
def test_all_that_moves_is_behind_an_arm_that_is_carried_about(tmp_path, speed, rests):
    cell = made(tmp_path, FLOATING + AXIS + TWO_R + 'on = "axis"\n', {"arm.urdf": two_r()})
    state, behind = moving(cell, speed), Behind(cell.model, cell.model.robot("arm"))
    mover = behind.mover(state)
    assert (mover is None) is rests
    assert behind.simplified(mover) == pytest.approx(1.0 if rests else 4.0)
