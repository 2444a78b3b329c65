"""A picture of one instant: the bodies, what a criterion draws, and a view that shows why."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from seerob.errors import InputError
from seerob.kernels.raster import raster
from seerob.sinks._camera import Camera, look_along
from seerob.sinks._canvas import Canvas, Color, font, png, words
from seerob.sinks._glb_reader import read_glb
from seerob.sinks._marker_shapes import draw_marker, label_of, points_of
from seerob.sinks._palette import DARK, FILL
from seerob.snapshot import Finding, Highlight, Result, Scene, Segment, Snapshot
from seerob.transforms import Array, rotation_from_wxyz

SIZE = (1000, 640)
"""Width and height [px]."""

_VIEWS = [(np.deg2rad(a), np.deg2rad(e)) for e in (18, 35) for a in range(-150, 210, 30)]
_PREFERRED = np.deg2rad(-60)
"""Azimuth taken when nothing speaks for another [rad]."""
_MOVERS = ("robot", "human", "tool", "workpiece")


class Stage:
    """The scene's meshes, read once; `picture` places them for any snapshot."""

    def __init__(self, scene: Scene, meshes: dict[str, bytes]) -> None:
        self.scene = scene
        findings = []
        vertices, normals, faces, nodes, ids, colors = [], [], [], [], [], []
        count = 0
        for i, node in enumerate(scene.nodes):
            data = meshes.get(node.mesh or "")
            if data is None:
                continue
            try:
                primitives = read_glb(data, node.name)
            except InputError as error:
                text = f"its mesh cannot be shown in pictures: {error.problems[0].what}"
                findings.append(Finding(level="warning", subject=node.name, text=text))
                continue
            for p in primitives:
                vertices.append(p.vertices)
                normals.append(p.normals)
                faces.append(p.faces + count)
                nodes.append(np.full(len(p.vertices), i))
                ids.append(np.full(len(p.faces), len(colors), np.int32))
                colors.append((*p.color, i))
                count += len(p.vertices)
        self.findings = tuple(findings)
        """Nodes whose mesh cannot be read."""
        self._vertices = np.concatenate([np.zeros((0, 3)), *vertices])
        self._normals = np.concatenate([np.zeros((0, 3)), *normals])
        self._faces: NDArray[np.int32] = np.concatenate([np.zeros((0, 3), np.int32), *faces]).astype(np.int32)
        self._node = np.concatenate([np.zeros(0), *nodes]).astype(np.int64)
        self._ids: NDArray[np.int32] = np.concatenate([np.zeros(0, np.int32), *ids]).astype(np.int32)
        table = np.array(colors).reshape(-1, 4)
        self._colors, self._color_node = table[:, :3], table[:, 3].astype(np.int64)

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
        vertices, normals = self._placed(snapshot)
        markers = () if result is None else result.markers
        if camera is None:
            camera = self._view(vertices, result, tuple(subjects), size)
        canvas = Canvas(camera)
        canvas.shadow(vertices, self._faces, 0.0)
        self._grid(canvas, vertices)
        colors = self._painted(result)
        canvas.bodies(vertices, normals, self._faces, self._ids, colors)
        for marker in markers:
            draw_marker(canvas, marker)
        return png(self._with_labels(canvas, result))

    def _placed(self, snapshot: Snapshot) -> tuple[Array, Array]:
        poses = np.frombuffer(snapshot.poses, "<f4").reshape(-1, 7).astype(float)
        # A node that nobody placed has no orientation; it stays where it was drawn.
        wxyz = np.where(np.linalg.norm(poses[:, 3:], axis=1, keepdims=True) > 0, poses[:, 3:], [1.0, 0, 0, 0])
        rotation = rotation_from_wxyz(wxyz)[self._node]
        vertices = np.einsum("nij,nj->ni", rotation, self._vertices) + poses[self._node, :3]
        return vertices, np.einsum("nij,nj->ni", rotation, self._normals)

    def _painted(self, result: Result | None) -> Array:
        """Colours with highlighted bodies in the colour of their verdict and bystanders pale."""
        colors = self._colors.copy()
        names = [node.name for node in self.scene.nodes]
        for i, node in enumerate(self.scene.nodes):
            if node.role not in _MOVERS:
                rows = self._color_node == i
                colors[rows] = 0.55 * colors[rows] + 0.45 * np.array([0.86, 0.87, 0.88])
        for marker in () if result is None else result.markers:
            if isinstance(marker, Highlight) and marker.body in names:
                colors[self._color_node == names.index(marker.body)] = FILL[marker.verdict]
        return colors

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
        self, vertices: Array, result: Result | None, subjects: tuple[str, ...], size: tuple[int, int]
    ) -> Camera:
        focus = self._focus(vertices, result, subjects)
        if result is None or not result.markers:
            return look_along(_PREFERRED, np.deg2rad(22), focus, size)
        width = 160
        small = (width, max(1, round(width * size[1] / size[0])))
        views = [(self._worth(vertices, result, a, e, focus, small), a, e) for a, e in _VIEWS]
        _, azimuth, elevation = max(views)
        return look_along(azimuth, elevation, focus, size)

    def _focus(self, vertices: Array, result: Result | None, subjects: tuple[str, ...]) -> Array:
        def belongs(name: str, owner: str, role: str) -> bool:
            if subjects:
                return any(s in (name, owner) or name.startswith(s + "/") for s in subjects)
            return role in _MOVERS

        wanted = [i for i, n in enumerate(self.scene.nodes) if belongs(n.name, n.owner, n.role)]
        shown = vertices[np.isin(self._node, wanted)]
        if not len(shown):
            shown = vertices if len(vertices) else np.array([[-1.0, -1, 0], [1, 1, 2]])
        marks = [] if result is None else [p for m in result.markers for p in points_of(m)]
        extremes = shown[:: max(1, len(shown) // 5000)]
        return np.concatenate([extremes, np.array(marks).reshape(-1, 3)])

    def _worth(
        self,
        vertices: Array,
        result: Result,
        azimuth: float,
        elevation: float,
        focus: Array,
        size: tuple[int, int],
    ) -> float:
        """How well a view shows the markers: in sight, seen from the side, and not from odd angles."""
        camera = look_along(azimuth, elevation, focus, size)
        screen, inverse = camera.project(vertices)
        shape = (camera.height, camera.width)
        depth, owner = np.zeros(shape), np.full(shape, -1, np.int32)
        raster(
            screen,
            inverse,
            np.zeros(len(vertices)),
            self._faces,
            self._node[self._faces[:, 0]].astype(np.int32) if len(self._faces) else self._ids,
            depth,
            np.zeros(shape),
            owner,
        )
        worth = 0.15 * np.cos(azimuth - _PREFERRED) - 0.1 * abs(elevation - np.deg2rad(22))
        names = [node.name for node in self.scene.nodes]
        for marker in result.markers:
            if isinstance(marker, Segment):
                a, b = np.array(marker.start), np.array(marker.end)
                samples = a + np.linspace(0, 1, 12)[:, None] * (b - a)
                worth += _in_sight(camera, depth, samples)
                length = float(np.linalg.norm(b - a))
                if length > 1e-6:
                    worth += 0.8 * float(np.linalg.norm(np.cross((b - a) / length, camera.axes[2])))
            elif isinstance(marker, Highlight) and marker.body in names:
                share = np.count_nonzero(owner == names.index(marker.body)) / owner.size
                worth += min(10 * share, 0.5)
            else:
                points = np.array(points_of(marker)).reshape(-1, 3)
                worth += 0.3 * _in_sight(camera, depth, points)
        return float(worth)

    def _with_labels(self, canvas: Canvas, result: Result | None) -> NDArray[np.uint8]:
        from PIL import Image, ImageDraw

        pixels = canvas.pixels()
        if result is None:
            return pixels
        image = Image.fromarray(pixels)
        draw, type_ = ImageDraw.Draw(image), font(max(12, round(canvas.camera.height / 38)))
        taken: list[tuple[float, float, float, float]] = []
        for marker in result.markers:
            text, at = label_of(marker)
            if not text:
                continue
            screen, inverse = canvas.camera.project(np.array(at))
            if inverse[0] <= 0:
                continue
            text = text if len(text) <= 48 else text[:47] + "…"
            half = draw.textlength(text, type_) / 2 + 6
            x = float(np.clip(screen[0, 0], half, max(half, canvas.camera.width - half)))
            y = float(np.clip(screen[0, 1] - 16, 14, canvas.camera.height - 14))
            while any(abs(x - u) < half + w and abs(y - v) < 20 for u, v, w, _ in taken) and y > 20:
                y -= 20
            taken.append((x, y, half, 0.0))
            words(draw, (x, y), text, DARK[marker.verdict], type_)
        return np.asarray(image)


def _in_sight(camera: Camera, depth: Array, points: Array) -> float:
    """Share of points (n, 3) that lie in the picture with nothing before them."""
    if not len(points):
        return 0.0
    screen, inverse = camera.project(points)
    x = np.clip(screen[:, 0].astype(int), 0, camera.width - 1)
    y = np.clip(screen[:, 1].astype(int), 0, camera.height - 1)
    # Points lie on surfaces; coarse pixels need 2 % of slack.
    return float(((inverse > 0) & (inverse >= 0.98 * depth[y, x])).mean())
