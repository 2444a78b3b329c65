"""The cell that a report's picture of the map is drawn in, and the segments it lists."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import starmap

from seerob.core.snapshot import Result, Scene
from seerob.files.trajectories.path_markers import Place, path_markers
from seerob.session.permissible.evaluation import PermissibleSpeed
from seerob.session.permissible.segments import PathSegment
from seerob.session.permissible.speed_map import SpeedMap


@dataclass(frozen=True, eq=False)
class ReportPlace:
    """What a report needs beside the result."""

    scene: Scene
    meshes: Mapping[str, bytes]
    """Binary glTF per mesh hash of the scene's nodes."""
    segments: tuple[PathSegment, ...]

    def picture(self, found: PermissibleSpeed) -> bytes:
        """The way of the tool point in the cell, PNG."""
        from seerob.outputs.picture.picture import Stage

        drawn = Result(name=found.map.robot, unit="m/s", markers=path_markers(places(found.map)))
        stage = Stage(self.scene, dict(self.meshes))
        return stage.picture(found.first, drawn, subjects=(found.map.robot,))


def places(found: SpeedMap) -> list[list[Place]]:
    """The stations of every piece as they are drawn."""
    return [
        list(
            starmap(
                Place,
                zip(
                    map(tuple, one.tool.tolist()),
                    (one.permissible * one.lever).tolist(),
                    (one.given * one.lever).tolist(),
                    strict=True,
                ),
            )
        )
        for one in found.stations
    ]
