"""Concave meshes and motions for the tests of distances."""

import manifold3d
import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from seerob.core.shapes import Mesh, Solid, capsule, dilated_rectangle
from seerob.distance.least import Shapes

IDENTITY = np.eye(3)


def bumpy_ball(seed: int, size: float = 1.0, subdivisions: int = 2) -> Mesh:
    """A concave star about the origin."""
    ball = trimesh.creation.icosphere(subdivisions=subdivisions)
    noise = np.random.default_rng(seed).uniform(0.4, 1.2, len(ball.vertices)) * size
    return Mesh(np.array(ball.vertices * noise[:, None]), np.array(ball.faces, np.int32))


def boxes(*bounds) -> Mesh:
    """Overlapping boxes, each its own shell."""
    mesh = trimesh.util.concatenate([trimesh.creation.box(bounds=np.array(b, float)) for b in bounds])
    return Mesh(np.array(mesh.vertices), np.array(mesh.faces, np.int32))


def cut(solid: manifold3d.Manifold) -> Mesh:
    mesh = solid.to_mesh64()
    return Mesh(np.array(mesh.vert_properties[:, :3], float), np.array(mesh.tri_verts, np.int32))


def cube(x, y, z):
    return manifold3d.Manifold.cube((x, y, z), True)


SLOT = cut(cube(0.6, 0.4, 0.3) - cube(0.7, 0.1, 0.2).translate((0, 0, 0.1)))
U_BOXES = [
    ((-0.4, -0.4, 0), (-0.3, 0.4, 0.2)),
    ((0.3, -0.4, 0), (0.4, 0.4, 0.2)),
    ((-0.4, -0.4, 0), (0.4, -0.3, 0.2)),
]


def poses(n: int, bodies: int, spread: float, seed: int = 0):
    rng = np.random.default_rng(seed)
    R = Rotation.random(n * bodies, rng).as_matrix().reshape(n, bodies, 3, 3)
    return R, rng.uniform(-spread, spread, (n, bodies, 3))


def walk(n: int, bodies: int, spread: float, seed: int = 0):
    """Poses that follow each other closely."""
    rng = np.random.default_rng(seed)
    turn = np.cumsum(rng.normal(size=(n, bodies, 3)) * 0.05, axis=0)
    x = np.cumsum(rng.normal(size=(n, bodies, 3)) * 0.02, axis=0) + rng.uniform(-spread, spread, (bodies, 3))
    return Rotation.from_rotvec(turn.reshape(-1, 3)).as_matrix().reshape(n, bodies, 3, 3), x


SOLIDS = {
    "concave mesh": Solid(mesh=bumpy_ball(5, 0.7)),
    "dilated mesh": Solid(mesh=bumpy_ball(6, 0.5), radius=0.05),
    "capsule": capsule([-0.2, 0.1, 0], [0.4, 0.2, 0.1], 0.07),
    "ball": capsule([0.1, 0, 0], [0.1, 0, 0], 0.1),
    "rectangle": dilated_rectangle([0.1, 0, 0.2], [0.5, 0, 0], [0, 0.2, 0.3], 0.06),
    "narrow rectangle": dilated_rectangle([0, 0, 0], [0, 0, 0], [0, 0.6, 0], 0.03),
}


def made_crowd() -> Shapes:
    """Two robots' worth of meshes, one of them open, and a few parts of a person."""
    open_ball = bumpy_ball(12, 0.5)
    open_ball = Mesh(open_ball.vertices, open_ball.faces[: len(open_ball.faces) * 2 // 3])
    return Shapes.build(
        [
            ("link 0", [Solid(mesh=bumpy_ball(10, 0.4))]),
            ("link 1", [Solid(mesh=bumpy_ball(11, 0.3)), Solid(mesh=boxes(*U_BOXES), radius=0.01)]),
            ("link 2", [Solid(mesh=open_ball)]),
            ("hand", [SOLIDS["capsule"], SOLIDS["ball"]]),
            ("chest", [SOLIDS["rectangle"]]),
            ("ghost", []),
            ("tool", [Solid(mesh=bumpy_ball(13, 0.2, 1))]),
        ]
    )


def said(found) -> list[np.ndarray]:
    """All that an answer says."""
    return [found.distance, found.point_a, found.point_b, found.body_a, found.body_b, found.kind]
