"""The fields of a protective device as thin bodies that can be drawn and asked for distances."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from seerob.core.shapes.floor_polygon import prism_mesh
from seerob.core.shapes.geometry import Mesh, Solid, dilated_rectangle
from seerob.core.snapshot import Finding
from seerob.workstation.tables.sensors import Sensor

Color = tuple[float, float, float, float]
FIELD_COLOR: Color = (0.98, 0.75, 0.35, 0.20)

HALF_THICKNESS = 1e-3
"""Of a plane of light as a body [m]."""


@dataclass(frozen=True, eq=False)
class FieldBody:
    """A field in its sensor's frame."""

    name: str
    """Empty for a device with one."""
    solid: Solid
    visual: Mesh


def fields(sensor: Sensor) -> Iterator[FieldBody]:
    """Bodies of the fields of a sensor."""
    if sensor.laser_scanner is not None:
        for field in sensor.laser_scanner.fields:
            mesh = prism_mesh(field.corners, -HALF_THICKNESS, HALF_THICKNESS, FIELD_COLOR)
            yield FieldBody(field.name, Solid(mesh=mesh), mesh)
    elif sensor.light_curtain is not None:
        a, b = (np.array(end) for end in sensor.light_curtain.ends)
        up = np.array([0.0, 0.0, sensor.light_curtain.height])
        from seerob.description.shapes.glb import solid_mesh

        solid = dilated_rectangle(a, b - a, up, HALF_THICKNESS)
        yield FieldBody("", solid, solid_mesh(solid, color=FIELD_COLOR))
    elif sensor.pressure_mat is not None:
        mat = sensor.pressure_mat
        mesh = prism_mesh(mat.corners, 0.0, mat.height, FIELD_COLOR)
        yield FieldBody("", Solid(mesh=mesh), mesh)


def about(sensor: Sensor) -> list[Finding]:
    """What nobody said of a sensor."""
    missing = [
        text
        for value, text in (
            (sensor.response, "response time"),
            (sensor.capability if sensor.pressure_mat is None else 0.0, "detection capability"),
        )
        if value is None
    ]
    found = []
    if missing:
        text = f"{' and '.join(missing)} not given: what depends on it is undecided"
        found.append(Finding(level="warning", subject=sensor.name, text=text))
    if not sensor.source and len(missing) < 2:
        text = "no source is named for its figures: take them from its data sheet"
        found.append(Finding(level="assumed", subject=sensor.name, text=text))
    return found
