"""Swept volumes: nothing is missed, closed forms, memory, stopping."""

from itertools import pairwise

import mujoco
import numpy as np
import pytest

from made_cell import TWO_R, made, two_r
from made_sweep import inside, missed
from seerob.core.errors import InputError
from seerob.model.volumes.moving import posed
from seerob.model.volumes.swept import Sweep, swept_volume

GRIPPED = """
[[tools]]
name = "gripper"
shape = { cylinder = [0.03, 0.2] }
on = "arm/tip"
mass = 1

[[workpieces]]
name = "ball"
shape = { sphere = 0.05 }
on = "gripper"
at = { position = [0.1, 0, 0.1] }
mass = 1
"""


@pytest.fixture(scope="module")
def ur10(tmp_path_factory):
    text = '[[robots]]\nname = "arm"\nmodel = "library:ur10"\n' + GRIPPED.replace("arm/tip", "arm/tool0")
    return made(tmp_path_factory.mktemp("ur10"), text).model


@pytest.fixture(scope="module")
def planar(tmp_path_factory):
    return made(tmp_path_factory.mktemp("planar"), TWO_R, {"arm.urdf": two_r()}).model


def wander(n, rng, step):
    """Joint positions of a UR10 that jump by up to ``step`` per sample."""
    return np.array([0, -1.2, 1.4, -1.5, -1.57, 0]) + np.cumsum(rng.uniform(-step, step, (n, 6)), axis=0)


@pytest.mark.parametrize(("step", "voxel", "slack"), [(0.02, 0.02, 0.5), (0.3, 0.04, 0.25), (0.3, 0.03, 8.0)])
def test_no_point_of_the_moving_bodies_at_any_time_is_outside(ur10, step, voxel, slack):
    rng = np.random.default_rng(int(step * 100))
    bodies = ur10.select("arm")
    motion = {"arm": wander(12, rng, step)}
    swept = swept_volume(ur10, bodies, motion, voxel=voxel, slack=slack)
    mesh = swept.mesh()
    assert missed(ur10, bodies, motion, swept.grid.contains, 40_000, rng) == 0
    assert missed(ur10, bodies, motion, lambda p: inside(mesh, p), 1_500, rng) == 0
    assert swept.dilation > 0.2 * min(slack, 0.5) * voxel


def test_none_of_a_million_points_is_outside(ur10):
    rng = np.random.default_rng(8)
    bodies, motion = ur10.select("arm"), {"arm": wander(12, rng, 0.1)}
    swept = swept_volume(ur10, bodies, motion, voxel=0.02)
    assert missed(ur10, bodies, motion, swept.grid.contains, 1_000_000, rng, each=1000) == 0


def test_coarse_pieces_cover_every_way_between_the_two_samples(planar):
    """With one piece, joints may go from end to end at any pace of their own."""
    rng = np.random.default_rng(3)
    ends = np.array([[0.0, 0.3], [0.4, 0.9]])
    bodies = planar.select("arm")
    swept = swept_volume(planar, bodies, {"arm": ends}, voxel=0.05, slack=100)
    anywhere = {"arm": rng.uniform(ends[0], ends[1], (200, 2)).repeat(2, axis=0)}
    assert missed(planar, bodies, anywhere, swept.grid.contains, 50_000, rng) == 0


def test_cubic_way_with_given_velocities_is_covered(planar):
    rng = np.random.default_rng(4)
    bodies, h = planar.select("arm"), 0.5
    (a, b), (u, v) = np.array([[0.0, 0.0], [0.1, -0.1]]), np.array([[1.5, -1.0], [-2.0, 1.0]])
    sweep = Sweep(planar, bodies, voxel=0.03)
    sweep.start(a, u)
    sweep.advance(b, v, h)
    s = np.linspace(0, 1, 400)[:, None]
    cubic = (
        (2 * s**3 - 3 * s**2 + 1) * a + (s**3 - 2 * s**2 + s) * h * u
        + (3 * s**2 - 2 * s**3) * b + (s**3 - s**2) * h * v
    )  # fmt: skip
    assert missed(planar, bodies, {"arm": cubic}, sweep.grid.contains, 60_000, rng) == 0
    straight = Sweep(planar, bodies, voxel=0.03)
    straight.start(a)
    straight.advance(b)
    assert missed(planar, bodies, {"arm": cubic}, straight.grid.contains, 60_000, rng) > 0


@pytest.mark.parametrize("voxel", [0.03, 0.02, 0.01])
def test_full_turn_is_a_disc_and_no_more_than_its_voxels(planar, voxel):
    """A bar of 1 m × 0.1 m × 0.1 m about its end; the farthest corner draws the rim."""
    turn = np.column_stack([np.linspace(0, 2 * np.pi, 60), np.zeros(60)])
    swept = swept_volume(planar, planar.select("arm/l1"), {"arm": turn}, voxel=voxel)
    rim, half = np.hypot(1, 0.05), 0.05
    layers = 2 * np.ceil((half + swept.dilation + 0.1 * voxel) / voxel)
    assert np.pi * rim**2 * 2 * half < swept.volume
    assert swept.volume < np.pi * (rim + swept.dilation + 1.5 * voxel) ** 2 * layers * voxel


@pytest.mark.parametrize("voxel", [0.02, 0.027, 0.05])
def test_no_voxel_is_marked_that_the_bodies_do_not_come_near(ur10, voxel):
    rng = np.random.default_rng(8)
    bodies, motion = ur10.select("arm/*"), wander(4, rng, 0.2)
    swept = swept_volume(ur10, bodies, {"arm": motion}, voxel=voxel)
    centres = swept.grid.centres()
    centres = centres[rng.integers(0, len(centres), 300)]
    data, nearest = mujoco.MjData(ur10.mj), np.full(300, np.inf)
    shares = np.linspace(0, 1, 12)[:, None]
    dense = np.vstack([a + shares * (b - a) for a, b in pairwise(motion)])
    solids = [(ur10.bodies[i].mj, solid) for i in bodies for solid in ur10.bodies[i].solids]
    for qpos in posed(ur10, {"arm": dense}):
        data.qpos[:] = qpos
        mujoco.mj_kinematics(ur10.mj, data)
        for mj, solid in solids:
            local = (centres - data.xpos[mj]) @ data.xmat[mj].reshape(3, 3)
            v = solid.mesh.vertices[solid.mesh.faces]
            n = np.cross(v[:, 1] - v[:, 0], v[:, 2] - v[:, 0])
            n = n / np.linalg.norm(n, axis=1, keepdims=True)
            # Of a convex solid, the farthest face plane is a lower bound of the distance.
            nearest = np.minimum(nearest, (local @ n.T - (v[:, 0] * n).sum(axis=1)).max(axis=1))
    between = 0.2 / 11 / 2 * 6 * 1.5 / 3  # Joints seldom all add up.
    assert nearest.max() < swept.dilation + 1.25 * voxel + between


def test_standing_still_marks_exactly_the_voxels_that_are_touched(planar):
    """The second link lies along x from 1 to 2 m, 0.1 m wide: no voxel face is grazed."""
    swept = swept_volume(planar, planar.select("arm/l2"), {"arm": np.zeros((3, 2))}, voxel=0.03)
    low, high = np.floor(np.array([[1, -0.05, -0.05], [2, 0.05, 0.05]]) / 0.03).astype(int)
    assert swept.grid.count == np.prod(high - low + 1)
    assert (swept.grid.bounds()[0] == low).all()
    assert (swept.grid.bounds()[1] == high).all()
    assert swept.dilation == 0


def test_parts_of_a_trajectory_unite_to_the_whole(ur10):
    motion = wander(9, np.random.default_rng(5), 0.1)
    bodies = ur10.select("arm")
    whole = swept_volume(ur10, bodies, {"arm": motion}, voxel=0.04)
    low, high = whole.grid.bounds()
    centres = (np.indices(high - low + 1).reshape(3, -1).T + low + 0.5) * 0.04
    parts = [swept_volume(ur10, bodies, {"arm": motion[i : i + 5]}, voxel=0.04) for i in (0, 4)]
    united = parts[0].grid.contains(centres) | parts[1].grid.contains(centres)
    assert (united == whole.grid.contains(centres)).all()


def test_memory_is_asked_for_before_anything_is_swept(ur10):
    told = []
    with pytest.raises(InputError, match=r"voxel: 1e-05 m needs .* MB .*; use voxels of .* m or more"):
        swept_volume(ur10, ur10.select("arm"), {"arm": np.zeros((5, 6))}, voxel=1e-5, progress=told.append)
    assert told == []


def test_remedy_of_too_fine_voxels_is_one(ur10):
    motion, bodies = {"arm": wander(3, np.random.default_rng(1), 0.1)}, ur10.select("arm")
    with pytest.raises(InputError) as error:
        swept_volume(ur10, bodies, motion, voxel=0.01, memory=20_000)
    fits = float(str(error.value).split("use voxels of ")[1].split(" ")[0])
    assert 0.02 < fits < 0.1
    assert swept_volume(ur10, bodies, motion, voxel=fits, memory=30_000).grid.cells.nbytes < 30_000


@pytest.mark.parametrize("voxel", [0.0, -0.01, float("nan"), float("inf")])
def test_voxel_must_be_a_length(ur10, voxel):
    with pytest.raises(InputError, match=r"voxel: .* is not a length"):
        swept_volume(ur10, ur10.select("arm"), {"arm": np.zeros((2, 6))}, voxel=voxel)


@pytest.mark.parametrize(
    ("q", "says"),
    [(np.full((2, 6), np.nan), "is nan"), (np.zeros((2, 5)), "give 6"), (np.zeros((0, 6)), "1 or more")],
)
def test_motion_that_does_not_fit_is_refused(ur10, q, says):
    with pytest.raises(InputError, match=says):
        swept_volume(ur10, ur10.select("arm"), {"arm": q}, voxel=0.05)


def test_progress_rises_to_one_and_stop_stops(ur10):
    motion = {"arm": wander(200, np.random.default_rng(6), 0.02)}
    shares = []
    whole = swept_volume(ur10, ur10.select("ball"), motion, voxel=0.05, progress=shares.append)
    assert shares == sorted(shares)
    assert shares[-1] == 1
    part = swept_volume(ur10, ur10.select("ball"), motion, voxel=0.05, stop=lambda: True)
    assert 0 < part.stamps < whole.stamps
