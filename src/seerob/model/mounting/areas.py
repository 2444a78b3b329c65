"""Mounting areas that are made elsewhere: what something sweeps, and the fields of protective devices."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from seerob.core.errors import InputError, UnknownName
from seerob.core.shapes.geometry import Solid
from seerob.description.shapes.detail import display_mesh
from seerob.distance.fields import about, fields
from seerob.model.mounting.specification import Mounting, pose_matrix
from seerob.model.mounting.things import AREA_COLOR, MadeArea
from seerob.workstation.tables.sensors import Sensor
from seerob.workstation.workstation import Area


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
