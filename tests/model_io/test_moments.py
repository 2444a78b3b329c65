from math import pi

import numpy as np
import pytest
import trimesh

from seerob.core.shapes import Mesh, capsule, dilated_rectangle
from seerob.core.snapshot import Origin
from seerob.core.transforms import rotation_from_rpy
from seerob.description.shapes.moments import (
    combined,
    of_capsule,
    of_closed_mesh,
    of_dilated_rectangle,
    of_solid,
)

R = rotation_from_rpy((0.3, -0.7, 1.1))
X, Y, Z = R.T


def mesh_of(body):
    return Mesh(np.array(body.vertices), np.array(body.faces, np.int32))


def test_box():
    a, b, c = 0.3, 0.2, 0.5
    found = of_closed_mesh(mesh_of(trimesh.creation.box((a, b, c)).apply_translation([100, 50, -70])))
    volume = a * b * c
    assert found.volume == pytest.approx(volume, rel=1e-9)
    np.testing.assert_allclose(found.com, [100, 50, -70], rtol=1e-12)
    expected = volume / 12 * np.diag([b * b + c * c, a * a + c * c, a * a + b * b])
    np.testing.assert_allclose(found.inertia, expected, atol=1e-12)


@pytest.mark.parametrize("offset", [(0, 0, 0), (3, -2, 1)])
def test_the_integral_over_a_mesh_agrees_with_trimesh(offset):
    body = trimesh.creation.torus(0.3, 0.1).apply_scale((1, 2, 3)).apply_translation(offset)
    found = of_closed_mesh(mesh_of(body))
    assert found.volume == pytest.approx(body.volume, rel=1e-12)
    np.testing.assert_allclose(found.com, body.center_mass, atol=1e-12)
    np.testing.assert_allclose(found.inertia, body.moment_inertia, atol=1e-9)


def test_torus_cylinder_and_ball_converge_to_their_closed_forms():
    big, small = 0.3, 0.1
    torus = of_closed_mesh(mesh_of(trimesh.creation.torus(big, small, 400, 400)))
    volume = 2 * pi**2 * big * small**2
    assert torus.volume == pytest.approx(volume, rel=1e-3)
    assert torus.inertia[2, 2] / torus.volume == pytest.approx(big**2 + 0.75 * small**2, rel=1e-3)
    assert torus.inertia[0, 0] / torus.volume == pytest.approx(big**2 / 2 + 5 / 8 * small**2, rel=1e-3)
    r, h = 0.05, 0.4
    cylinder = of_closed_mesh(mesh_of(trimesh.creation.cylinder(r, h, sections=2000)))
    assert cylinder.volume == pytest.approx(pi * r * r * h, rel=1e-5)
    assert cylinder.inertia[0, 0] / cylinder.volume == pytest.approx((3 * r * r + h * h) / 12, rel=1e-5)
    ball = of_closed_mesh(mesh_of(trimesh.creation.icosphere(6, r)))
    np.testing.assert_allclose(ball.inertia / ball.volume, 0.4 * r * r * np.eye(3), rtol=1e-3, atol=1e-9)


def test_capsule_is_a_cylinder_and_two_half_balls():
    r, length = 0.05, 0.3
    center = np.array([1.0, 2, 3])
    found = of_capsule(center - Z * length / 2, center + Z * length / 2, r)
    cylinder, ball = pi * r * r * length, 4 / 3 * pi * r**3
    along = cylinder * r * r / 2 + ball * 0.4 * r * r
    # A half ball's centre is 3/8 r from its flat side, about which its moment is 83/320 m r².
    across = cylinder * (3 * r * r + length**2) / 12
    across += ball * (83 / 320 * r * r + (length / 2 + 3 / 8 * r) ** 2)
    assert found.volume == pytest.approx(cylinder + ball, rel=1e-14)
    np.testing.assert_allclose(found.com, center)
    np.testing.assert_allclose(found.inertia, R @ np.diag([across, across, along]) @ R.T, atol=1e-15)


def test_ball_is_a_capsule_without_length():
    found = of_capsule(X, X, 0.1)
    np.testing.assert_allclose(found.inertia, 0.4 * found.volume * 0.01 * np.eye(3), atol=1e-15)
    assert found.volume == pytest.approx(4 / 3 * pi * 1e-3)


def test_dilated_rectangle_by_simpson_over_parallel_sections():
    """At height z it is a rectangle dilated in the plane by s = √(r² − z²): area and moments by heart."""
    a, b, r = 0.4, 0.25, 0.07
    angle, step = np.linspace(-pi / 2, pi / 2, 2001, retstep=True)
    z, s, weight = r * np.sin(angle), r * np.cos(angle), r * np.cos(angle)
    simpson = np.ones(2001)
    simpson[1:-1:2], simpson[2:-1:2] = 4, 2
    weight = weight * simpson * step / 3
    area = a * b + 2 * (a + b) * s + pi * s**2

    def second(p, q):
        # ∫x² of the p × q rectangle, of the strips beside it, and of the four quarter discs.
        inner = q * p**3 / 12 + 2 * s * p**3 / 12 + q * ((p + 2 * s) ** 3 - p**3) / 12
        return inner + pi * s**2 * p**2 / 4 + 4 / 3 * p * s**3 + pi * s**4 / 4

    xx, yy, zz = weight @ second(a, b), weight @ second(b, a), weight @ (area * z**2)
    found = of_dilated_rectangle(Z, a * X, b * Y, r)
    assert found.volume == pytest.approx(weight @ area, rel=1e-9)
    np.testing.assert_allclose(found.com, Z + (a * X + b * Y) / 2)
    np.testing.assert_allclose(found.inertia, R @ np.diag([yy + zz, xx + zz, xx + yy]) @ R.T, atol=1e-12)


def test_a_rectangle_without_width_is_a_capsule_whichever_edge_is_zero():
    expected = of_capsule(Z, Z + 0.3 * X, 0.05)
    for u, v in ((0.3 * X, 0 * Y), (0 * Y, 0.3 * X)):
        found = of_dilated_rectangle(Z, u, v, 0.05)
        assert found.volume == pytest.approx(expected.volume, rel=1e-14)
        np.testing.assert_allclose(found.inertia, expected.inertia, atol=1e-15)


def test_solids_and_their_sum():
    parts = [of_solid(capsule(X, Y, 0.1)), of_solid(dilated_rectangle(Z, X, Y, 0.1))]
    whole = combined(parts)
    assert whole.volume == pytest.approx(sum(p.volume for p in parts))
    # The parallel axis theorem about any point, here the origin.
    about_origin = sum(
        p.inertia + p.volume * (p.com @ p.com * np.eye(3) - np.outer(p.com, p.com)) for p in parts
    )
    c = whole.com
    np.testing.assert_allclose(
        whole.inertia, about_origin - whole.volume * (c @ c * np.eye(3) - np.outer(c, c))
    )


def test_mass_scales_the_inertia():
    ball = of_capsule(X, X, 0.1).inertial(mass=5.0, origin=Origin.GIVEN, source="scale")
    np.testing.assert_allclose(ball.inertia, 0.4 * 5 * 0.01 * np.eye(3), atol=1e-15)


def test_what_has_no_volume_is_refused():
    with pytest.raises(ValueError, match="no volume"):
        of_capsule(X, Y, 0.0)
    box = trimesh.creation.box((1, 1, 1))
    box.invert()
    with pytest.raises(ValueError, match="inside out"):
        of_closed_mesh(mesh_of(box))
