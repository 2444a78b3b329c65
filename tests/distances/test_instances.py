"""Bodies that share a mesh have its arrays once, and distances as if each had its own."""

from dataclasses import replace

import numpy as np

from seerob.core.shapes import Solid, capsule
from seerob.description.shapes import shapes as made
from seerob.distance.least import Query
from seerob.kernels.shapes import Shapes


def test_instances_of_a_mesh_answer_as_copies_of_it():
    random = np.random.default_rng(3)
    box = Solid(mesh=made.box_mesh((-0.1, -0.2, -0.3), (0.1, 0.2, 0.3)))
    ball = Solid(mesh=made.sphere_mesh(np.zeros(3), 0.15))
    stick = capsule(np.array([0, 0, -0.2]), np.array([0, 0, 0.2]), 0.05)
    solids = [box, stick, ball, box, ball, box]
    shared = Shapes.build([(f"b{k}", (s,)) for k, s in enumerate(solids)])
    copies = [
        s if s.mesh is None else replace(s, mesh=replace(s.mesh, vertices=s.mesh.vertices.copy()))
        for s in solids
    ]
    apart = Shapes.build([(f"b{k}", (s,)) for k, s in enumerate(copies)])
    assert len(shared.triangles) == len(box.mesh.faces) + len(ball.mesh.faces)
    assert len(apart.triangles) == 3 * len(box.mesh.faces) + 2 * len(ball.mesh.faces)
    for _ in range(20):
        rotations = np.array([np.linalg.qr(random.normal(size=(3, 3)))[0] for _ in solids])
        rotations *= np.linalg.det(rotations)[:, None, None]
        positions = random.normal(size=(len(solids), 3)) * 0.4
        for a in range(len(solids)):
            others = tuple(b for b in range(len(solids)) if b != a)
            one, other = (Query(s, (a,), others).minimum(rotations, positions) for s in (shared, apart))
            assert one.distance == other.distance
            assert np.array_equal(one.point_a, other.point_a, equal_nan=True)
            assert (one.body_a, one.body_b, one.kind) == (other.body_a, other.body_b, other.kind)
