"""A picture of one instant: the bodies, what a criterion draws, and a view that shows why."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from seerob.errors import InputError
from seerob.sinks._camera import Camera
from seerob.sinks._canvas import Canvas, Color, font, png, words
from seerob.sinks._close_up import close_up, inset
from seerob.sinks._glb_reader import read_glb
from seerob.sinks._marker_shapes import draw_marker, label_of, points_of
from seerob.sinks._palette import DARK, FILL
from seerob.sinks._viewpoint import best_view, scattered
from seerob.snapshot import Finding, Highlight, Result, Scene, Segment, Snapshot
from seerob.transforms import Array, rotation_from_wxyz

SIZE = (1000, 640)
"""Width and height [px]."""

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
        self._scatter_weight, self._scatter_face = scattered(self._vertices, self._faces, 20_000)
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
        placed = self._placed(snapshot)
        if camera is None:
            camera = self._view(placed[0], result, tuple(subjects), size)
        canvas = self._drawn(camera, placed, result)
        image = self._with_labels(canvas, result)
        near = close_up(camera, () if result is None else result.markers)
        if near is not None:
            image = inset(image, canvas, self._drawn(near, placed, result).pixels())
        return png(image)

    def _drawn(self, camera: Camera, placed: tuple[Array, Array], result: Result | None) -> Canvas:
        vertices, normals = placed
        canvas = Canvas(camera)
        canvas.shadow(vertices, self._faces, 0.0)
        self._grid(canvas, vertices)
        canvas.bodies(vertices, normals, self._faces, self._ids, self._painted(result))
        for marker in () if result is None else result.markers:
            draw_marker(canvas, marker)
        return canvas

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
        corners = vertices[self._faces[self._scatter_face]]
        surface = np.einsum("nk,nkj->nj", self._scatter_weight, corners)
        owner = self._node[self._faces[self._scatter_face, 0]]
        markers = () if result is None else result.markers
        names = [node.name for node in self.scene.nodes]
        return best_view(surface, owner, markers, names, self._focus(vertices, result, subjects), size)

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

    # -- words ----------------------------------------------------------------------------------

    def _with_labels(self, canvas: Canvas, result: Result | None) -> NDArray[np.uint8]:
        from PIL import Image, ImageDraw

        pixels = canvas.pixels()
        if result is None:
            return pixels
        image = Image.fromarray(pixels)
        camera = canvas.camera
        height = max(12, round(camera.height / 38))
        draw, type_ = ImageDraw.Draw(image), font(height)
        taken: list[tuple[float, float, float]] = []
        for marker in result.markers:
            text, at = label_of(marker)
            screen, inverse = camera.project(np.array([at, *points_of(marker)]))
            if not text or inverse[0] <= 0:
                continue
            text = text if len(text) <= 48 else text[:47] + "…"
            half = draw.textlength(text, type_) / 2 + 6
            # Above a line, not on it.
            top = screen[inverse > 0, 1].min() if isinstance(marker, Segment) else screen[0, 1]
            x = float(np.clip(screen[0, 0], half, max(half, camera.width - half)))
            y = float(np.clip(top - 1.4 * height, height, camera.height - height))
            while y > height and any(abs(x - u) < half + w and abs(y - v) < 1.3 * height for u, v, w in taken):
                y -= 1.3 * height
            taken.append((x, y, half))
            words(draw, (x, y), text, DARK[marker.verdict], type_)
        return np.asarray(image)
