"""Mounting areas that are made elsewhere: what something sweeps, and the fields of protective devices."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from seerob.core.errors import InputError, UnknownName
from seerob.core.shapes import Mesh, Solid, dilated_rectangle, prism_mesh
from seerob.core.snapshot import Finding
from seerob.description.shapes.detail import display_mesh
from seerob.model.mounting.specification import Mounting, pose_matrix
from seerob.model.mounting.things import AREA_COLOR, MadeArea
from seerob.workstation.tables.sensors import Sensor
from seerob.workstation.workstation import Area

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


def mount_swept(mounting: Mounting, area: Area, made: Mapping[str, MadeArea], *, file: str) -> None:
    """Mount an area that is swept, in the world.

    Raises:
        InputError: It has not been made.
    """
    if area.name not in made:
        what = "what is swept is known only to a station that has its sources"
        raise InputError.at(file, "swept", what, "load the workstation with seerob.load")
    found = made[area.name]
    mounting.body(area.name, None, np.eye(4))
    mounting.findings += found.findings
    mounting.shape(
        area.name,
        role="area",
        owner=area.name,
        carrier="",
        solids=(Solid(mesh=found.mesh, note=found.note),),
        visual=(display_mesh(replace(found.mesh, color=AREA_COLOR)),),
        mass=None,
    )


def mount_sensor(mounting: Mounting, carriers: dict[str, str], sensor: Sensor) -> None:
    """Mount a sensor and its fields; ``carriers`` tells who carries each body, and receives those added.

    Raises:
        UnknownName: There is nothing to mount it on.
    """
    if sensor.on is not None and not mounting.has(sensor.on):
        raise UnknownName("link, tool or bone", sensor.on, carriers)
    mounting.body(sensor.name, sensor.on, pose_matrix(sensor.at))
    carrier = "" if sensor.on is None else carriers[sensor.on]
    if carrier:
        carriers[sensor.name] = carrier
    for field in fields(sensor):
        name = f"{sensor.name}/{field.name}" if field.name else sensor.name
        if field.name:
            mounting.body(name, sensor.name, np.eye(4))
        mounting.shape(
            name,
            role="area",
            owner=sensor.name,
            carrier=carrier,
            solids=(field.solid,),
            visual=(field.visual,),
            mass=None,
        )
    mounting.findings += about(sensor)
