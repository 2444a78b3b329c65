"""A run in a notebook: the page's scene with a slider, from frames that are kept, without a server.

Uses anywidget (extra ``notebook``), which Jupyter, VS Code and marimo show.
"""

from __future__ import annotations

import gzip
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec

from seerob.core.errors import InputError
from seerob.core.extras import need
from seerob.core.markers import plain
from seerob.core.samples import Sample
from seerob.core.snapshot import Scene, Snapshot
from seerob.outputs.sink import Closing

if TYPE_CHECKING:
    from anywidget import AnyWidget

SPACING = 0.04
"""Between two frames at least [s]."""
MOST = 3000
"""Frames; of a longer run every other one is left out until it is that many."""

_encode = msgspec.msgpack.Encoder(enc_hook=plain).encode
_PAGE = Path(__file__).parents[1] / "app/server/page"


class Film(Closing):
    """Frames of a run, thinned evenly: an open `seerob.outputs.sink.Writer`.

    Args:
        scene: Of the run.
        meshes: Binary glTF per mesh hash of the scene's nodes.
    """

    def __init__(self, scene: Scene, meshes: dict[str, bytes]) -> None:
        self._scene, self._meshes = scene, meshes
        self._spacing, self._next = SPACING, 0.0
        self.frames: list[bytes] = []
        """Snapshots as they go over the wire."""
        self.last: Snapshot | None = None

    def write(self, snapshot: Snapshot, samples: tuple[Sample, ...] = ()) -> None:
        """Keep one tick, if it is due."""
        self.last = snapshot
        if snapshot.t < self._next - 1e-9:
            return
        self._next = snapshot.t + self._spacing
        self.frames.append(_encode(snapshot))
        if len(self.frames) > MOST:
            self.frames, self._spacing = self.frames[::2], 2 * self._spacing

    def close(self) -> None:
        """Keep the last tick, too, which the spacing may have left out."""
        if self.last is not None and _encode(self.last) != self.frames[-1]:
            self.frames.append(_encode(self.last))

    def widget(self, *, height: int, verdict: str) -> AnyWidget:
        """What a notebook shows.

        Args:
            height: Of the scene [px].
            verdict: Of the whole run, beside the time; of an instant, when it was not run.

        Raises:
            MissingPackage: anywidget is not installed (extra ``notebook``).
            InputError: The page is not built.
        """
        need("anywidget")
        view: AnyWidget = _kind()(
            scene=_encode(self._scene),
            meshes=self._meshes,
            frames=self.frames,
            height=height,
            verdict=verdict,
        )
        return view


@cache
def _kind() -> Any:
    """The class of the widget; made when first asked for, as its base is an extra's."""
    import anywidget
    import traitlets

    script = _PAGE / "notebook.js.gz"
    if not script.is_file():
        raise InputError.at(script, "", "is not built", "run make web; a released package contains it")

    class RunView(anywidget.AnyWidget):
        _esm = gzip.decompress(script.read_bytes()).decode()
        scene = traitlets.Bytes().tag(sync=True)
        meshes = traitlets.Dict().tag(sync=True)
        frames: Any = traitlets.List().tag(sync=True)
        height = traitlets.Int().tag(sync=True)
        verdict = traitlets.Unicode().tag(sync=True)

    return RunView
