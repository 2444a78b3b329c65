"""Measured Denavit–Hartenberg parameters against their own product, and against the types they are of."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from seerob.core.errors import InputError
from seerob.description import loader
from seerob.description.robots.calibration import (
    Calibration,
    calibrated,
    off_by,
    poses,
    read_calibration,
    written,
)


def load_robot(model):
    return loader.load_robot(model, folder=Path())


QUARTER = np.pi / 2
ALPHA = (QUARTER, 0.0, 0.0, QUARTER, -QUARTER, 0.0)
TYPES = {
    "ur3": ((0, -0.24365, -0.21325, 0, 0, 0), (0.1519, 0, 0, 0.11235, 0.08535, 0.0819)),
    "ur5": ((0, -0.425, -0.39225, 0, 0, 0), (0.089159, 0, 0, 0.10915, 0.09465, 0.0823)),
    "ur10": ((0, -0.612, -0.5723, 0, 0, 0), (0.1273, 0, 0, 0.163941, 0.1157, 0.0922)),
    "ur10e": ((0, -0.6127, -0.57155, 0, 0, 0), (0.1807, 0, 0, 0.17415, 0.11985, 0.11655)),
}
"""Stated by the maker: a and d [m]."""


def nominal(name):
    a, d = TYPES[name]
    return Calibration(theta=(0.0,) * 6, a=tuple(map(float, a)), d=tuple(map(float, d)), alpha=ALPHA)


def measured(name, seed, *, far=False):
    """As one would be measured: millimetres and tenths of a degree; ``far`` as the parallel axes come out."""
    rng, type_ = np.random.default_rng(seed), nominal(name)
    small = {k: rng.normal(0, s, 6) for k, s in (("theta", 3e-3), ("a", 1e-3), ("d", 1e-3), ("alpha", 2e-3))}
    if far:
        small["d"][1:3] += (300.0, -300.0)
        small["alpha"][1] = 1e-6
    return Calibration(
        **{k: tuple((np.array(getattr(type_, k)) + small[k]).tolist()) for k in small},
        checksum=(1, 2, 3, 4, 5, 6),
    )


@pytest.mark.parametrize("name", TYPES)
def test_that_of_the_type_changes_nothing(name):
    robot = load_robot(f"library:{name}")
    assert off_by(robot, nominal(name), "f") < 1e-5
    same = calibrated(robot, nominal(name), "f")
    before, after = poses(robot, np.zeros(6)), poses(same, np.zeros(6))
    assert max(np.abs(before[link] - after[link]).max() for link in before) < 2e-5


@pytest.mark.parametrize("far", [False, True])
@pytest.mark.parametrize("name", TYPES)
def test_the_flange_is_where_the_product_says_at_all_angles(name, far):
    robot, found = load_robot(f"library:{name}"), measured(name, 1, far=far)
    very = calibrated(robot, found, "f")
    (before,) = {
        tuple(np.round(poses(robot, q)["tool0"] @ np.linalg.inv(nominal(name).frames(q)[-1]), 4).ravel())
        for q in (np.zeros(6), np.ones(6))
    }
    root_from_base = np.round(np.reshape(before, (4, 4)))
    rng = np.random.default_rng(2)
    for q in rng.uniform(-6, 6, (20, 6)):
        expected = root_from_base @ found.frames(q)[-1]
        assert np.abs(poses(very, q)["tool0"] - expected).max() < 1e-9
    assert off_by(very, found, "f") < 1e-9
    assert off_by(robot, found, "f") > 1e-3
    # Links stay where they can be seen: they go by millimetres, however far the frames are.
    here, there = poses(robot, np.zeros(6)), poses(very, np.zeros(6))
    assert max(np.linalg.norm(here[k][:3, 3] - there[k][:3, 3]) for k in here) < 0.03
    assert "up to" in very.findings[-1].text
    assert "00000001 00000002" in very.findings[-1].text


def test_a_link_is_turned_with_its_zero():
    """An encoder whose zero is off turns the link, not only what follows it."""
    type_ = nominal("ur10")
    off = Calibration(theta=(0.0, 0.01, 0.0, 0.0, 0.0, 0.0), a=type_.a, d=type_.d, alpha=type_.alpha)
    robot = load_robot("library:ur10")
    very, turned = calibrated(robot, off, "f"), np.array([0, 0.01, 0, 0, 0, 0])
    here, there = poses(very, np.zeros(6)), poses(robot, turned)
    assert max(np.abs(here[k] - there[k]).max() for k in here) < 2e-5


def test_that_of_another_type_is_refused():
    with pytest.raises(InputError, match="not of this type of robot"):
        calibrated(load_robot("library:ur5"), nominal("ur10"), "f")
    with pytest.raises(InputError, match="only an arm of six"):
        calibrated(load_robot("library:iiwa14"), nominal("ur10"), "f")


def test_a_file_comes_back_and_another_is_refused():
    found = measured("ur5", 3)
    assert read_calibration(written(found, "made here").encode(), "f") == found
    for wrong in (b"theta = 1", b"\xff", b"x" * (1 << 17), b"theta = [1"):
        with pytest.raises(InputError, match="calibration"):
            read_calibration(wrong, "f")
    infinite = written(found, "x").replace(repr(found.a[0]), "inf")
    with pytest.raises(InputError, match="not finite"):
        read_calibration(infinite.encode(), "f")
