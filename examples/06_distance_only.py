"""Only the distance engine: two concave meshes, exact where a convex hull would say they touch."""

import numpy as np

from seerob.core.shapes import Mesh, Solid, capsule
from seerob.description.shapes.shapes import box_mesh
from seerob.distance.least import DistanceKind, Query, Shapes


def channel() -> Mesh:
    """A U of three plates, 0.2 m wide inside, open at the top."""
    plates = [
        box_mesh(np.array(low), np.array(high))
        for low, high in (
            ([-0.12, -0.5, -0.02], [0.12, 0.5, 0.0]),
            ([-0.12, -0.5, 0.0], [-0.10, 0.5, 0.3]),
            ([0.10, -0.5, 0.0], [0.12, 0.5, 0.3]),
        )
    ]
    offsets = np.cumsum([0, *(len(plate.vertices) for plate in plates[:-1])])
    faces = np.vstack([plate.faces + k for plate, k in zip(plates, offsets, strict=True)])
    return Mesh(np.vstack([plate.vertices for plate in plates]), faces.astype(np.int32))


finger = capsule(np.array([0.0, 0.0, -0.05]), np.array([0.0, 0.0, 0.05]), 0.03)
shapes = Shapes.build([("channel", [Solid(mesh=channel())]), ("finger", [finger])])
query = Query(shapes, [0], [1])

heights = np.linspace(0.5, 0.2, 7)
positions = np.zeros((len(heights), 2, 3))
positions[:, 1, 2] = heights
found = query.batch(np.broadcast_to(np.eye(3), (len(heights), 2, 3, 3)), positions)
for height, distance in zip(heights, found.distance[:, 0], strict=True):
    print(f"finger at {height:.2f} m: {distance * 1e3:6.1f} mm to the channel")

# Inside the channel, the walls are 0.10 m from its middle and the finger is 0.03 m thick.
assert np.isclose(found.distance[-1, 0], 0.07, atol=1e-12)
assert (found.kind == DistanceKind.EXACT).all()
assert np.isclose(query.minimum(np.tile(np.eye(3), (2, 1, 1)), np.zeros((2, 3))).distance, -0.03)
