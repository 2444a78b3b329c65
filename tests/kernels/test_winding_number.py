import numpy as np
import trimesh

from seerob.kernels.tree import build_tree, component_of
from seerob.kernels.winding import contains, winding_number

RNG = np.random.default_rng(2)


def bumpy_ball(seed: int, subdivisions: int = 3) -> tuple[np.ndarray, np.ndarray]:
    """A concave star about the origin."""
    ball = trimesh.creation.icosphere(subdivisions=subdivisions)
    noise = np.random.default_rng(seed).uniform(0.4, 1.2, len(ball.vertices))
    return np.array(ball.vertices * noise[:, None]), np.array(ball.faces, np.int32)


def test_every_triangle_is_in_every_box_above_it_once():
    vertices, faces = bumpy_ball(0)
    nodes, links, T = build_tree(vertices, faces)
    seen = np.zeros(len(T), int)

    def visit(i: int, above: list[int]) -> tuple[np.ndarray, float]:
        above = [*above, i]
        if links[i, 1]:
            ks = range(links[i, 0], links[i, 0] + links[i, 1])
            for k in ks:
                seen[k] += 1
                corners = T[k, :3] + np.array([np.zeros(3), T[k, 3:6], T[k, 6:9]])
                for n in above:
                    axes = nodes[n, 10:19].reshape(3, 3)
                    assert (abs((corners - nodes[n, :3]) @ axes.T) <= nodes[n, 3:6]).all()
            total = T[list(ks), 9:12].sum(0) / 2, np.linalg.norm(T[list(ks), 9:12], axis=1).sum() / 2
        else:
            left, right = visit(i + 1, above), visit(links[i, 0], above)
            total = left[0] + right[0], left[1] + right[1]
        np.testing.assert_allclose(nodes[i, 6:9], total[0], atol=1e-12)
        np.testing.assert_allclose(nodes[i, 9], total[1], rtol=1e-12)
        return total

    visit(0, [])
    assert (seen == 1).all()
    original = np.sort(vertices[faces].mean(1), axis=0)
    np.testing.assert_allclose(np.sort(T[:, :3] + (T[:, 3:6] + T[:, 6:9]) / 3, axis=0), original, atol=1e-14)


def test_triangles_on_one_spot_still_make_a_shallow_tree():
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    _, links, T = build_tree(vertices, np.tile(np.arange(3, dtype=np.int32), (3000, 1)))
    assert len(T) == 3000
    depth = {0: 1}
    for i in range(len(links)):
        if not links[i, 1]:
            depth[i + 1] = depth[int(links[i, 0])] = depth[i] + 1
    assert max(depth.values()) <= 13


def test_dipoles_err_by_less_than_they_say():
    """And a closed surface has an integer winding number."""
    vertices, faces = bumpy_ball(1)
    nodes, links, T = build_tree(vertices, faces)
    for q in RNG.uniform(-1.2, 1.2, (300, 3)):
        exact, none = winding_number(nodes, links, T, *q, np.inf)
        assert none == 0.0
        assert abs(exact - round(exact)) < 1e-9
        for far in (1.5, 3.0, 6.0):
            w, error = winding_number(nodes, links, T, *q, far)
            assert abs(w - exact) <= error + 1e-12


def test_the_inside_of_an_open_or_broken_mesh_is_what_brute_force_says():
    """On soup with holes, where the winding number takes every value, the tree decides like the plain sum."""
    vertices, faces = bumpy_ball(2)
    faces = faces[RNG.permutation(len(faces))[: len(faces) * 2 // 3]]
    nodes, links, T = build_tree(vertices, faces)
    middling = 0
    for q in RNG.uniform(-0.9, 0.9, (1500, 3)):
        w, _ = winding_number(nodes, links, T, *q, np.inf)
        middling += 0.4 < abs(w) < 0.6
        assert contains(nodes, links, T, *q) == (abs(w) > 0.5)
    assert middling > 50


def test_components_are_those_of_a_second_library():
    boxes = [trimesh.creation.box(bounds=np.array([[i, 0, 0], [i + 0.5, 1, 1]])) for i in range(7)]
    mesh = trimesh.util.concatenate(boxes)
    root = component_of(np.array(mesh.faces, np.int64), len(mesh.vertices))
    assert len(np.unique(root)) == 7 == mesh.body_count
