"""What must hold of clamping whatever the cell is: arms among random parts, posed and moved at random."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh.transformations as transforms

from made_cell import FLOATING, made, results_at, two_r
from seerob.core.snapshot import Verdict
from seerob.session.station import Station

pytestmark = pytest.mark.soak

RANK = {None: -1, Verdict.WITHIN: 0, Verdict.UNDECIDED: 1, Verdict.EXCEEDED: 2}
Placed = tuple[list[float], list[float], list[float]]


def cell(folder: Path, robot: str, world: np.ndarray, parts: list[Placed], name: str = "arm") -> Station:
    """An arm and parts (size, position, rpy), all of it moved by ``world``."""

    def at(position: list[float], rpy: list[float]) -> str:
        pose = transforms.euler_matrix(*rpy, "sxyz")
        pose[:3, 3] = position
        pose = world @ pose
        turned = [float(angle) for angle in transforms.euler_from_matrix(pose, "sxyz")]
        return f"{{ position = {pose[:3, 3].tolist()}, rpy = {turned} }}"

    flange = "tool0" if robot.startswith("library") else "tip"
    text = f'{FLOATING}[[robots]]\nname = "{name}"\nmodel = "{robot}"\nbase = {at([0, 0, 0], [0, 0, 0])}\n'
    text += (
        f'[[tools]]\nname = "load"\non = "{name}/{flange}"\nshape = {{ box = [0.1, 0.1, 0.1] }}\nmass = 1\n'
    )
    for k, (size, position, rpy) in enumerate(parts):
        text += f'[[parts]]\nname = "p{k}"\nshape = {{ box = {size} }}\nat = {at(position, rpy)}\n'
    text += (
        f'[[safety]]\nkind = "power_and_force"\nname = "pfl"\nrobot = "{name}"\nmass = "simplified"\n'
        f"floor = false\ncontact_area = {{ {name} = 1e-4, load = 1e-4 }}\n"
    )
    return made(folder, text, {"arm.urdf": two_r()})


def regions(station: Station, q: np.ndarray, qd: np.ndarray, name: str = "arm") -> dict:
    return {p.name: p for p in results_at(station, **{name: (q, qd)})["pfl"].parts if p.unit == "m/s"}


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize(("robot", "joints"), [("arm.urdf", 2), ("library:ur10", 6), ("library:ur5e", 6)])
def test_one_more_part_and_a_faster_motion_never_relieve_and_the_world_does_not_matter(
    tmp_path: Path, robot: str, joints: int, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    parts = [
        (
            rng.uniform(0.05, 0.6, 3).tolist(),
            rng.uniform(-0.9, 0.9, 3).tolist(),
            rng.uniform(-1, 1, 3).tolist(),
        )
        for _ in range(3)
    ]
    world = transforms.random_rotation_matrix(rng.random(3))
    world[:3, 3] = rng.uniform(-2, 2, 3)
    here = cell(tmp_path / "a", robot, np.eye(4), parts[:2])
    more = cell(tmp_path / "b", robot, np.eye(4), parts)
    there = cell(tmp_path / "c", robot, world, parts[:2])
    renamed = cell(tmp_path / "d", robot, np.eye(4), parts[:2], name="another")
    for k in range(6):
        q, qd = rng.uniform(-3, 3, joints), rng.uniform(-1, 1, joints) * rng.choice([0.05, 0.3, 1.0])
        qd *= rng.random(joints) < (0.4 if k % 2 else 1.0)
        found, worse, faster = (regions(s, q, w) for s, w in ((here, qd), (more, qd), (here, 2 * qd)))
        same = regions(there, q, qd), regions(renamed, q, qd, "another")
        for name, part in found.items():
            assert RANK[worse[name].verdict] >= RANK[part.verdict], (name, q, qd)
            assert RANK[faster[name].verdict] >= RANK[part.verdict], (name, q, qd)
            if part.limit is not None:
                assert worse[name].limit <= part.limit * (1 + 1e-9), (name, q, qd)
                for other in same:
                    assert other[name].limit == pytest.approx(part.limit, rel=1e-6), (name, q, qd)
