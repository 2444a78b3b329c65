"""A picture of one instant: the bodies, what a criterion draws, and a view that shows why."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from seerob.core.snapshot import Finding, Highlight, Result, Scene, Segment, Snapshot, Verdict
from seerob.core.transforms import Array
from seerob.outputs.palette import DARK, FILL
from seerob.outputs.picture.camera import Camera
from seerob.outputs.picture.canvas import Canvas, Color, font, png, words
from seerob.outputs.picture.close_up import close_up, inset
from seerob.outputs.picture.marker_shapes import draw_marker, label_of, points_of
from seerob.outputs.picture.stage_bodies import MOVERS, poses, read_bodies
from seerob.outputs.picture.viewpoint import best_view, scattered
from seerob.outputs.sentences import shortened

SIZE = (1000, 640)
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
        canvas = self._drawn(camera, placed, snapshot, result)
        image = self._with_labels(canvas, result)
        near = close_up(camera, () if result is None else result.markers)
        if near is not None:
            image = inset(image, canvas, self._drawn(near, placed, snapshot, result).pixels())
        return png(image)

    def _drawn(
        self, camera: Camera, placed: tuple[Array, Array], snapshot: Snapshot, result: Result | None
    ) -> Canvas:
        vertices, normals = placed
        bodies = self._bodies
        canvas = Canvas(camera)
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
            text = shortened(text, _LONGEST)
            half = draw.textlength(text, type_) / 2 + 6
            # Above a line, not on it.
            top = screen[inverse > 0, 1].min() if isinstance(marker, Segment) else screen[0, 1]
            x = float(np.clip(screen[0, 0], half, max(half, camera.width - half)))
            y = float(np.clip(top - 1.4 * height, height, camera.height - height))
            while y > height and any(
                abs(x - u) < half + w and abs(y - v) < 1.3 * height for u, v, w in taken
            ):
                y -= 1.3 * height
            taken.append((x, y, half))
            words(draw, (x, y), text, DARK[marker.verdict], type_)
        return np.asarray(image)
