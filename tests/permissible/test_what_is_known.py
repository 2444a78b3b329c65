"""What a permissible speed begins with: limits of joints, and where everybody was in the run."""

from __future__ import annotations

import numpy as np
import pytest

from made_cell import FLOATING, TWO_R, heard, made, person, two_r
from seerob.core.errors import InputError
from seerob.core.snapshot import Origin
from seerob.session.permissible.ceilings import By, Ceiling
from seerob.session.permissible.joint_limits import joint_limits
from seerob.session.permissible.speed_map import Stations
from seerob.session.permissible.witness import Posed, Witness
from seerob.twin.engine import Engine

MIMIC = '<mimic joint="j1" multiplier="-2" offset="0.5"/>'


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    text = FLOATING.replace("{ ", "{ physics = false, ") + TWO_R + "q = [0, 0]\n" + person("op", 3.0, 0, 0)
    return made(tmp_path_factory.mktemp("arm"), text, {"arm.urdf": two_r()}).model


def test_limits_are_those_that_are_given_and_speeds_else_those_of_the_description(model):
    robot = model.mechanisms["arm"]
    found = joint_limits(robot, acceleration=3.0, jerk=[4.0, 5.0], written=("jerk",))
    assert found.joints == ("j1", "j2")
    np.testing.assert_array_equal(
        [found.velocity, found.acceleration, found.jerk], [[10, 10], [3, 3], [4, 5]]
    )
    said = [(i.name, i.value, i.unit, i.origin, i.source) for i in found.inputs]
    call, file = "with the command or the call", "workstation file"
    assert said == [
        *((f"velocity limit of j{k}", 10.0, "rad/s", Origin.STATED, f"arm.urdf: joint j{k}") for k in (1, 2)),
        *((f"acceleration limit of j{k}", 3.0, "rad/s²", Origin.GIVEN, call) for k in (1, 2)),
        *((f"jerk limit of j{k}", 3.0 + k, "rad/s³", Origin.GIVEN, file) for k in (1, 2)),
    ]
    slower = joint_limits(robot, velocity=[0.5, 2.0], acceleration=3.0, jerk=4.0)
    assert slower.velocity.tolist() == [0.5, 2.0]


@pytest.mark.parametrize("file", ["", "cell.toml"])
def test_what_nobody_gave_is_asked_for_and_every_mistake_is_told_at_once(model, tmp_path, file):
    bare = two_r().replace('velocity="10"', "", 1)
    robot = made(tmp_path, FLOATING + TWO_R, {"arm.urdf": bare}).model.mechanisms["arm"]
    with pytest.raises(InputError) as caught:
        joint_limits(robot, jerk=[1.0, 2.0, 3.0], file=file)
    assert [(p.file, p.key, p.what) for p in caught.value.problems] == [
        (file or "workstation", "robots.arm.velocity_limits", "nobody gave the velocity limit of j1"),
        (
            file or "workstation",
            "robots.arm.acceleration_limits",
            "nobody gave the acceleration limit of j1, j2",
        ),
        (file or "workstation", "robots.arm.jerk_limits", "3 values for 2 joints"),
    ]
    first, second, _ = (p.remedy for p in caught.value.problems)
    assert "[rad/s or m/s] in the workstation file, or with --velocity" in first
    assert "[rad/s² or m/s²] with --acceleration" in second


@pytest.mark.parametrize(
    "wrong", [0.0, -1.0, [1.0, 0.0], [1.0, np.nan], [1.0, np.inf], np.inf, [[1.0, 2.0]], []]
)
@pytest.mark.parametrize("file", ["", "cell.toml"])
def test_every_limit_is_a_number_above_nought(model, wrong, file):
    robot = model.mechanisms["arm"]
    with pytest.raises(InputError) as caught:
        joint_limits(robot, velocity=wrong, acceleration=0.5, jerk=0.5, file=file)
    (problem,) = caught.value.problems
    assert (problem.file, problem.key) == (file or "workstation", "robots.arm.velocity_limits")


def watched(model, ticks, way=0.01):
    """A run in which the first joint goes a way at each tick, and what stood beside its judge."""
    engine, witness = Engine(model, driven={"arm": 1.0}), Witness(lambda state: ())
    for k in range(ticks):
        engine.take([heard("arm", 0.01 * k, (way * k, 0.0), (100 * way, 0.0))])
        assert witness(engine.start() if k == 0 else engine.tick()) == ()
    return witness


@pytest.mark.parametrize("ticks", [1, 2, 3, 7])
def test_others_are_seen_at_the_nearest_tick(model, ticks):
    witness = watched(model, ticks)
    address = model.mechanisms["arm"].q_address[0]
    for t in np.concatenate([np.arange(-1.3, ticks + 1, 0.4) * 0.01, [9.0]]):
        k = int(np.abs(np.array(witness.t) - t).argmin())
        positions, _, invalid_reasons = witness.others(t)
        assert positions[address] == pytest.approx(0.01 * k)
        assert invalid_reasons["arm"] == ""
        assert witness.heard(t) == ({}, {})


@pytest.mark.parametrize(("way", "moves"), [(0.95e-3, False), (1.05e-3, True), (0.0, False)])
def test_who_goes_a_millimetre_or_a_milliradian_moves(model, way, moves):
    assert watched(model, 2, way).moves(model.mechanisms["arm"]) is moves
    assert watched(model, 2, way).moves(model.mechanisms["op"]) is False


@pytest.mark.parametrize("mimic", ["", MIMIC])
def test_a_robot_is_put_on_its_path_and_goes_on_as_it_is_put(tmp_path, mimic):
    text = FLOATING.replace("{ ", "{ physics = false, ") + TWO_R + person("op", 3.0, 0, 0)
    model = made(tmp_path, text, {"arm.urdf": two_r(mimic=mimic)}).model
    robot = model.mechanisms["arm"]
    n = len(robot.joints)
    engine, witness = Engine(model, driven={"arm": 1.0}), Witness(lambda state: ())
    engine.take([heard("arm", 0.0, (0.0,) * n, (0.0,) * n)])
    witness(engine.start())
    posed = Posed(model, robot, witness)
    q, qd = np.array([0.3, -0.7])[:n], np.array([1.5, 2.5])[:n]
    posed.place(5.0, 0.0, q, qd)
    np.testing.assert_allclose(posed.q(robot), q)
    expected = [0.3, 0.5 - 2 * 0.3] if mimic else q
    np.testing.assert_allclose(posed.data.qpos[robot.q_address], expected)
    ahead = posed.foresee("arm", np.array([5.0, 5.1, 5.2]))
    np.testing.assert_allclose(ahead[0], np.tile(q, (3, 1)))
    np.testing.assert_allclose(ahead[1], np.tile(qd, (3, 1)))
    assert posed.foresee("op", np.array([5.0])) is None
    posed.place(5.0, 0.0, q, qd, "it is not there")
    assert posed.invalid_place_reason("arm") == "it is not there"


def test_between_two_stations_the_lesser_counts_and_on_one_that_of_both_its_sides():
    """0.5, 2, 4 and 0.25 rad/s: a quarter of the joints', all of them twice, and an eighth."""
    half, quarter, eighth = (Ceiling("S", 1 / n) for n in (2, 4, 8))
    s, none = np.arange(4.0), np.zeros(4)
    stations = Stations(
        s, s, np.array([2.0, 2.0, 4.0, 2.0]), none.astype(int), none, ((quarter, half), (), (), (eighth,)),
        By.ALL, none, none, none,
    )  # fmt: skip
    np.testing.assert_array_equal(stations.permissible, [0.5, 2.0, 4.0, 0.25])
    at = np.array([0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0])
    np.testing.assert_array_equal(stations.between(at), [0.5, 0.5, 0.5, 2.0, 0.25, 0.25, 0.25])
