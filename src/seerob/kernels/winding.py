r"""Whether a point lies inside a mesh: the generalised winding number, [Jacobson2013]_.

.. math:: w(q) = \frac{1}{4\pi}\sum_t \Omega_t(q), \qquad
   \tan\frac{\Omega}{2} = \frac{\det(a, b, c)}
   {|a||b||c| + (a \cdot b)|c| + (b \cdot c)|a| + (c \cdot a)|b|}

with a, b, c the corners seen from q ([VanOosterom1983]_). It is an integer for closed meshes, whatever
their number of shells, and degrades gracefully when they leak. A point is inside when
:math:`|w| > 1/2` (an inside-out mesh has its inside too).

Far boxes are replaced by their dipole ([Barill2018]_) with centre p, area vector N, area A and radius R,
:math:`\Omega \approx N \cdot (p - q)/|p - q|^3`. Since :math:`\|\nabla (x/|x|^3)\| = 2/|x|^3`, what is left
out is at most :math:`2 A R/(|p - q| - R)^3`. These bounds are summed; a point they leave in doubt is asked
again with smaller boxes and in the end with every triangle, so the answer is the brute force one.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from seerob.core.transforms import Array

Links = NDArray[np.int32]


@njit(cache=True, nogil=True, error_model="numpy")
def solid_angle(T: Array, k: int, x: float, y: float, z: float) -> float:
    """Signed solid angle of triangle ``T[k]`` seen from a point [sr]."""
    ax = T[k, 0] - x
    ay = T[k, 1] - y
    az = T[k, 2] - z
    bx = ax + T[k, 3]
    by = ay + T[k, 4]
    bz = az + T[k, 5]
    cx = ax + T[k, 6]
    cy = ay + T[k, 7]
    cz = az + T[k, 8]
    a = math.sqrt(ax * ax + ay * ay + az * az)
    b = math.sqrt(bx * bx + by * by + bz * bz)
    c = math.sqrt(cx * cx + cy * cy + cz * cz)
    det = ax * T[k, 9] + ay * T[k, 10] + az * T[k, 11]
    den = (
        a * b * c
        + (ax * bx + ay * by + az * bz) * c
        + (bx * cx + by * cy + bz * cz) * a
        + (cx * ax + cy * ay + cz * az) * b
    )
    return 2.0 * math.atan2(det, den)


@njit(cache=True, nogil=True, error_model="numpy")
def winding_number(
    nodes: Array, links: Links, T: Array, x: float, y: float, z: float, far: float
) -> tuple[float, float]:
    """Winding number of a mesh about a point, and a bound of its error.

    Args:
        nodes: As built by `seerob.kernels.tree.build_tree`.
        links: Likewise.
        T: Likewise.
        x: Point in the mesh's frame [m].
        y: Likewise.
        z: Likewise.
        far: Distance in box radii from which a box is a dipole; infinity for the plain sum.
    """
    total = 0.0
    error = 0.0
    stack = np.empty(128, np.int32)
    stack[0] = 0
    depth = 1
    while depth > 0:
        depth -= 1
        i = stack[depth]
        rx = nodes[i, 0] - x
        ry = nodes[i, 1] - y
        rz = nodes[i, 2] - z
        d = math.sqrt(rx * rx + ry * ry + rz * rz)
        R = nodes[i, 19]
        if d > far * R:
            total += (rx * nodes[i, 6] + ry * nodes[i, 7] + rz * nodes[i, 8]) / (d * d * d)
            error += 2.0 * nodes[i, 9] * R / (d - R) ** 3
        elif links[i, 1] > 0:
            for k in range(links[i, 0], links[i, 0] + links[i, 1]):
                total += solid_angle(T, k, x, y, z)
        else:
            stack[depth] = links[i, 0]
            stack[depth + 1] = i + 1
            depth += 2
    return total / (4.0 * math.pi), error / (4.0 * math.pi)


@njit(cache=True, nogil=True, error_model="numpy")
def contains(nodes: Array, links: Links, T: Array, x: float, y: float, z: float) -> bool:
    """Whether the mesh contains the point; nothing outside its box is inside."""
    if (
        abs(x - nodes[0, 0]) > nodes[0, 3]
        or abs(y - nodes[0, 1]) > nodes[0, 4]
        or abs(z - nodes[0, 2]) > nodes[0, 5]
    ):
        return False
    for far in (6.0, 16.0):
        w, error = winding_number(nodes, links, T, x, y, z, far)
        if abs(abs(w) - 0.5) > error + 1e-6:
            return abs(w) > 0.5
    w, error = winding_number(nodes, links, T, x, y, z, np.inf)
    return abs(w) > 0.5
