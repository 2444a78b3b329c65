"""A picture of one instant: the bodies, what a criterion draws, and a view that shows why.

What decides and is too small to see has a close-up in a corner. The view has the markers in sight, seen from
the side, and everything named in the picture. Views are compared by points scattered over the bodies on a
coarse grid: exact enough to choose, and a hundred times cheaper than drawing each.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from seerob.core.snapshot import Arrow, Finding, Highlight, Marker, Result, Scene, Segment, Snapshot, Verdict
from seerob.core.transforms import Array
from seerob.kernels.paint import nearest_of
from seerob.outputs.palette import DARK, FILL
from seerob.outputs.picture import lettering
from seerob.outputs.picture.canvas import (
    OVERSAMPLING,
    Camera,
    Canvas,
    Color,
    Room,
    look_along,
)
from seerob.outputs.picture.marker_shapes import draw_marker, label_of, points_of
from seerob.outputs.picture.stage_bodies import MOVERS, poses, read_bodies
from seerob.outputs.sentences import shortened

PREFERRED = (float(np.deg2rad(-60)), float(np.deg2rad(22)))
"""Azimuth and elevation taken when nothing speaks for others [rad]."""
_VIEWS = [(float(np.deg2rad(a)), float(np.deg2rad(e))) for e in (18, 35) for a in range(-150, 210, 30)]
_GRID_WIDTH = 100


def scattered(vertices: Array, faces: NDArray[np.int32], n: int) -> tuple[Array, NDArray[np.int64]]:
    """``n`` points spread evenly over triangles: barycentric weights (n, 3) and triangle (n,)."""
    corners = vertices[faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    total = np.cumsum(area)
    if not len(total) or not total[-1] > 0:
        return np.zeros((0, 3)), np.zeros(0, np.int64)
    rng = np.random.default_rng(0)
    chosen = np.minimum(np.searchsorted(total, (np.arange(n) + 0.5) / n * total[-1]), len(faces) - 1)
    u, v = np.sqrt(rng.random(n)), rng.random(n)
    return np.stack([1 - u, u * (1 - v), u * v], -1), chosen.astype(np.int64)


def best_view(
    surface: Array,
    owner: NDArray[np.int64],
    markers: tuple[Marker, ...],
    names: list[str],
    focus: Array,
    size: tuple[int, int],
) -> Camera:
    """The camera that shows the markers best.

    Args:
        surface: Points on the bodies [m], shape (n, 3).
        owner: Index into ``names`` of the body each lies on, shape (n,).
        markers: What is to be seen; the preferred view when there is none.
        names: Of the bodies.
        focus: Points that must be in the picture [m], shape (m, 3).
        size: Width and height of the picture [px].
    """
    if not markers:
        return look_along(*PREFERRED, focus, size)
    grid = (_GRID_WIDTH, max(1, round(_GRID_WIDTH * size[1] / size[0])))
    azimuth, elevation = max(
        _VIEWS,
        key=lambda view: _worth(
            look_along(view[0], view[1], focus, grid), view, surface, owner, markers, names
        ),
    )
    return look_along(azimuth, elevation, focus, size)


def _worth(
    camera: Camera,
    view: tuple[float, float],
    surface: Array,
    owner: NDArray[np.int64],
    markers: tuple[Marker, ...],
    names: list[str],
) -> float:
    depth, body = _coarse(camera, surface, owner)
    worth = 0.15 * np.cos(view[0] - PREFERRED[0]) - 0.1 * abs(view[1] - PREFERRED[1])
    for marker in markers:
        if isinstance(marker, Highlight):
            if marker.body in names:
                share = np.count_nonzero(body == names.index(marker.body)) / body.size
                worth += min(10 * share, 0.5)
            continue
        points = np.array(points_of(marker)).reshape(-1, 3)
        if isinstance(marker, Segment | Arrow):
            along = points[1] - points[0]
            length = float(np.linalg.norm(along))
            if length > 1e-6:
                worth += 0.8 * float(np.linalg.norm(np.cross(along / length, camera.axes[2])))
            # The ends are where the figure comes from: a view that hides one is worth little.
            worth += 1.5 * _in_sight(camera, depth, points)
            points = points[0] + np.linspace(0, 1, 12)[:, None] * along
            worth += _in_sight(camera, depth, points)
        else:
            worth += 0.3 * _in_sight(camera, depth, points)
    return float(worth)


def _coarse(camera: Camera, surface: Array, owner: NDArray[np.int64]) -> tuple[Array, NDArray[np.int64]]:
    """Nearest 1/z and its body per cell of the camera's grid; 0 and -1 where there is nothing."""
    depth = np.zeros((camera.height, camera.width))
    body = np.full(depth.shape, -1, np.int64)
    screen, inverse = camera.project(surface)
    nearest_of(screen, inverse, owner, depth, body)
    return depth, body


def _in_sight(camera: Camera, depth: Array, points: Array) -> float:
    """Share of points (n, 3) with nothing before them."""
    if not len(points):
        return 0.0
    screen, inverse = camera.project(points)
    x = np.clip(screen[:, 0].astype(int), 0, camera.width - 1)
    y = np.clip(screen[:, 1].astype(int), 0, camera.height - 1)
    # Points lie on surfaces, and cells are coarse: 2 % of slack.
    return float(((inverse > 0) & (inverse >= 0.98 * depth[y, x])).mean())


SHORT = 0.11
"""A segment shorter than this part of the picture's width gets a close-up."""
_PART = 0.3
_SMALLEST = 0.06
_RIM = (58, 68, 80)


def close_up(camera: Camera, markers: tuple[Marker, ...]) -> Camera | None:
    """The view of the first segment from nearby; None when it is long enough as it is."""
    segment = next((m for m in markers if isinstance(m, Segment)), None)
    if segment is None:
        return None
    ends = np.array([segment.start, segment.end], float)
    screen, inverse = camera.project(ends)
    if not (inverse > 0).all() or np.hypot(*(screen[1] - screen[0])) > SHORT * camera.width:
        return None
    forward = camera.axes[2]
    azimuth = float(np.arctan2(-forward[1], -forward[0]))
    elevation = float(np.arcsin(np.clip(-forward[2], -1, 1)))
    reach = max(float(np.linalg.norm(ends[1] - ends[0])), _SMALLEST)
    middle = ends.mean(axis=0)
    around = middle + reach * np.concatenate([np.eye(3), -np.eye(3)])
    side = round(_PART * camera.width)
    return look_along(azimuth, elevation, around, (side, round(0.8 * side)))


def inset(image: NDArray[np.uint8], canvas: Canvas, small: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """``small`` with a rim in the corner of ``image`` where it hides the least of the bodies."""
    height, width = small.shape[:2]
    gap = 10
    down, across = image.shape[0] - height - gap, image.shape[1] - width - gap
    if down < gap or across < gap:
        return image

    def hidden(corner: tuple[int, int]) -> int:
        y, x = corner[0] * OVERSAMPLING, corner[1] * OVERSAMPLING
        window = canvas.owner[y : y + height * OVERSAMPLING, x : x + width * OVERSAMPLING]
        return int(np.count_nonzero(window >= 0))

    y, x = min([(gap, gap), (gap, across), (down, gap), (down, across)], key=hidden)
    result = image.copy()
    result[y - 2 : y + height + 2, x - 2 : x + width + 2] = _RIM
    result[y : y + height, x : x + width] = small
    return result


SIZE = (800, 512)
"""Width and height [px]."""

_CLEAREST, _LIT = 0.14, 0.3
"""Greatest opacity of what a mesh calls translucent, as a bystander and highlighted: what is behind it
must stay readable."""
_MOST_EDGES = 400
_LONGEST = 48
"""Characters of a label."""


class Stage:
    """The scene's meshes, read once; `picture` places them for any snapshot."""

    def __init__(self, scene: Scene, meshes: dict[str, bytes]) -> None:
        self.scene = scene
        self._bodies = read_bodies(scene, meshes)
        self.findings: tuple[Finding, ...] = self._bodies.findings
        """Nodes whose mesh cannot be read."""
        self._names = [node.name for node in scene.nodes]
        self._rooms: list[Room] = []
        """Of pictures that are done, for those that follow: to get memory takes longer than to fill it."""
        self._weight, self._face = scattered(self._bodies.vertices, self._bodies.faces, 12_000)

    def picture(
        self,
        snapshot: Snapshot,
        result: Result | None = None,
        *,
        subjects: Iterable[str] = (),
        size: tuple[int, int] = SIZE,
        camera: Camera | None = None,
    ) -> bytes:
        """PNG of a snapshot.

        Args:
            snapshot: Of this stage's scene.
            result: What is drawn over the bodies; nothing when None.
            subjects: Names to keep in view; robots and humans when none of them has a mesh.
            size: Width and height [px].
            camera: The view; found when not given.
        """
        placed = self._bodies.placed(snapshot)
        if camera is None:
            camera = self._view(placed[0], snapshot, result, tuple(subjects), size)
        try:
            room = self._rooms.pop()
        except IndexError:  # as many as pictures are drawn at once
            room = Room()
        canvas = self._drawn(camera, placed, snapshot, result, room)
        image = self._with_labels(canvas, result)
        near = close_up(camera, () if result is None else result.markers)
        if near is not None:
            image = inset(image, canvas, self._drawn(near, placed, snapshot, result, Room()).pixels())
        self._rooms.append(room)
        return lettering.png(image)

    def view(
        self,
        snapshot: Snapshot,
        result: Result | None = None,
        *,
        subjects: Iterable[str] = (),
        size: tuple[int, int] = SIZE,
    ) -> Camera:
        """Find the view that `picture` takes when none is given, to draw other snapshots from it, too."""
        return self._view(self._bodies.placed(snapshot)[0], snapshot, result, tuple(subjects), size)

    def _drawn(
        self,
        camera: Camera,
        placed: tuple[Array, Array],
        snapshot: Snapshot,
        result: Result | None,
        room: Room,
    ) -> Canvas:
        vertices, normals = placed
        bodies = self._bodies
        canvas = Canvas(camera, room)
        canvas.shadow(vertices, bodies.faces, 0.0)
        self._grid(canvas, vertices)
        lit = self._highlights(result)
        colors = bodies.colors.copy()
        for node, verdict in lit.items():
            colors[bodies.color_node == node] = FILL[verdict]
        canvas.bodies(vertices, normals, bodies.faces, bodies.ids, colors)
        self._clear(canvas, snapshot, lit)
        for marker in () if result is None else result.markers:
            draw_marker(canvas, marker)
        return canvas

    def _highlights(self, result: Result | None) -> dict[int, Verdict | None]:
        markers = () if result is None else result.markers
        named = [m for m in markers if isinstance(m, Highlight) and m.body in self._names]
        return {self._names.index(m.body): m.verdict for m in named}

    def _clear(self, canvas: Canvas, snapshot: Snapshot, lit: dict[int, Verdict | None]) -> None:
        """Translucent bodies, far ones first."""
        position, rotation = poses(snapshot)
        shown = [(c, c.vertices @ rotation[c.node].T + position[c.node]) for c in self._bodies.clear]
        for clear, vertices in sorted(shown, key=lambda s: -canvas.camera.local(s[1].mean(axis=0))[0, 2]):
            fill, line, most = clear.color, (0.42, 0.36, 0.12), _CLEAREST
            if clear.node in lit:
                fill, line, most = FILL[lit[clear.node]], DARK[lit[clear.node]], _LIT
            canvas.veil(vertices, clear.faces, fill, min(clear.alpha, most))
            for a, b in clear.edges[:_MOST_EDGES].tolist():
                canvas.line(vertices[a], vertices[b], line, width=1.3, alpha=0.75)

    def _grid(self, canvas: Canvas, vertices: Array) -> None:
        shown = vertices if len(vertices) else np.zeros((1, 3))
        low = np.floor(np.clip(shown[:, :2].min(axis=0), -20, 20) - 0.5)
        high = np.ceil(np.clip(shown[:, :2].max(axis=0), -20, 20) + 0.5)
        for axis in (0, 1):
            other = 1 - axis
            for k in np.arange(low[axis], high[axis] + 0.25, 0.5):
                ends = np.zeros((2, 3))
                ends[:, axis] = k
                ends[:, other] = low[other], high[other]
                whole = abs(k - round(k)) < 1e-9
                color: Color = (0.72, 0.76, 0.80)
                canvas.line(ends[0], ends[1], color, width=1.0, alpha=0.9 if whole else 0.4)

    # -- the view -------------------------------------------------------------------------------

    def _view(
        self,
        vertices: Array,
        snapshot: Snapshot,
        result: Result | None,
        subjects: tuple[str, ...],
        size: tuple[int, int],
    ) -> Camera:
        # What is translucent hides nothing, so only opaque surfaces count.
        faces = self._bodies.faces[self._face]
        surface = np.einsum("nk,nkj->nj", self._weight, vertices[faces])
        owner = self._bodies.node[faces[:, 0]]
        markers = () if result is None else result.markers
        focus = self._focus(vertices, snapshot, result, subjects)
        return best_view(surface, owner, markers, self._names, focus, size)

    def _focus(
        self, vertices: Array, snapshot: Snapshot, result: Result | None, subjects: tuple[str, ...]
    ) -> Array:
        def belongs(name: str, owner: str, role: str) -> bool:
            if subjects:
                return any(s in (name, owner) or name.startswith(s + "/") for s in subjects)
            return role in MOVERS

        wanted = [i for i, n in enumerate(self.scene.nodes) if belongs(n.name, n.owner, n.role)]
        shown = vertices[np.isin(self._bodies.node, wanted)]
        extremes = [shown[:: max(1, len(shown) // 5000)]]
        position, rotation = poses(snapshot)
        for c in self._bodies.clear:
            if subjects and c.node in wanted:
                extremes.append(c.vertices @ rotation[c.node].T + position[c.node])
        if not sum(map(len, extremes)):
            extremes = [vertices if len(vertices) else np.array([[-1.0, -1, 0], [1, 1, 2]])]
        marks = [] if result is None else [p for m in result.markers for p in points_of(m)]
        return np.concatenate([*extremes, np.array(marks).reshape(-1, 3)])

    # -- words ----------------------------------------------------------------------------------

    def _with_labels(self, canvas: Canvas, result: Result | None) -> NDArray[np.uint8]:
        pixels = canvas.pixels()
        if result is None:
            return pixels
        camera = canvas.camera
        height = max(12, round(camera.height / 26))
        taken: list[tuple[float, float, float]] = []
        for marker in result.markers:
            text, at = label_of(marker)
            screen, inverse = camera.project(np.array([at, *points_of(marker)]))
            if not text or inverse[0] <= 0:
                continue
            text = shortened(text, _LONGEST)
            half = lettering.width(text, height) / 2 + 6
            # Above a line, not on it.
            top = screen[inverse > 0, 1].min() if isinstance(marker, Segment) else screen[0, 1]
            x = float(np.clip(screen[0, 0], half, max(half, camera.width - half)))
            y = float(np.clip(top - 1.4 * height, height, camera.height - height))
            while y > height and any(
                abs(x - u) < half + w and abs(y - v) < 1.3 * height for u, v, w in taken
            ):
                y -= 1.3 * height
            taken.append((x, y, half))
            lettering.write(pixels, (x, y), text, DARK[marker.verdict], height)
        return pixels
