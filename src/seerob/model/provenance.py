"""Where the inputs of a result come from, for its `Basis`. Asked once, when a criterion is bound."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from seerob.core.snapshot import Input, Origin
from seerob.model.model import Gap, Mechanism, Model
from seerob.workstation.source import Source
from seerob.workstation.workstation import Mounted, Robot

FILE = "workstation file"
PRELIMINARY = ("vendor_emulator", "simulator", "planned")
"""Origins of a motion that no real controller has executed, [Weistroffer2022]_ 2.1.3.1."""
CAPTURED = {"live": "captured, live", "file": "captured, from a file"}
"""By `seerob.workstation.source.Source.captured`."""
WORST_FIRST = list(reversed(Origin))


def motion(model: Model, *names: str) -> tuple[Input, ...]:
    """Where the motion of robots and people comes from."""
    found = []
    for name in dict.fromkeys(names):
        mechanism = model.mechanism(name)
        sources = [s for s in model.workstation.sources if s.target() == name]
        if sources:
            # A twin follows what was heard; whether that was measured, the source's own findings say.
            found += [_motion_of(name, source) for source in sources]
        elif mechanism.home_given:
            where = "posture" if mechanism.role == "human" else "q"
            found.append(
                Input(
                    name=f"pose of {name}",
                    origin=Origin.GIVEN,
                    source=f"workstation file ({where}), stands still",
                )
            )
        else:
            found.append(Input(name=f"pose of {name}", origin=Origin.MISSING))
    return tuple(found)


def _motion_of(name: str, source: Source) -> Input:
    origin = getattr(source, "origin", None)
    said = None if origin is None else f"{origin}, preliminary" * (origin in PRELIMINARY) or str(origin)
    kind = Origin.MEASURED if origin == "controller" else Origin.GIVEN
    if source.captured:
        live = source.captured == "live"
        said, kind = CAPTURED[source.captured], Origin.MEASURED if live else Origin.STATED
    return Input(name=f"motion of {name}", value=said, origin=kind, source=source.name)


def masses(model: Model, mechanism: Mechanism) -> tuple[Input, ...]:
    """Masses that the mass matrix of a robot is made of, and whether rotors are in it."""
    links = [link.inertial for link in mechanism.description.links if link.inertial is not None]
    found = [
        Input(
            name=f"link masses of {mechanism.name}",
            value=sum(inertial.mass for inertial in links),
            unit="kg",
            origin=_worst(inertial.origin for inertial in links),
            source="; ".join(dict.fromkeys(inertial.source for inertial in links)),
        )
    ]
    off = max((inertial.error for inertial in links), default=0.0)
    if off:
        found.append(
            Input(
                name=f"masses of links of {mechanism.name} may be off by",
                value=off,
                origin=Origin.ESTIMATED,
                source=links[0].source,
            )
        )
    if any(inertial.within for inertial in links):
        found.append(
            Input(
                name=f"where masses are in links of {mechanism.name}",
                value="anywhere in their shapes",
                origin=Origin.MISSING,
            )
        )
    turned = [
        f"{mechanism.name}/{link.name}"
        for link in mechanism.description.links
        if link.inertial is not None and link.inertial.gyration
    ]
    weighed = [model.bodies[index] for index in mechanism.carried if model.bodies[index].mass is not None]
    turned += [body.owner for body in weighed if body.mass is not None and body.mass.gyration]
    found += [
        Input(
            name=f"moments of inertia of {name}", value="any that fit into its shape", origin=Origin.MISSING
        )
        for name in turned
    ]
    found += [
        Input(name=f"where the mass of {body.owner} is", value="anywhere in its shape", origin=Origin.MISSING)
        for body in weighed
        if body.mass is not None and body.mass.within
    ]
    found += [
        Input(name=text.removeprefix("nobody gave ").strip(), origin=Origin.MISSING)
        for text in mechanism.unknown_masses
    ]
    for index in mechanism.carried:
        body = model.bodies[index]
        if body.mass is not None:
            found.append(
                Input(
                    name=f"mass of {body.owner}",
                    value=body.mass.value,
                    unit="kg",
                    origin=body.mass.origin,
                    source=body.mass.source,
                )
            )
            if body.mass.error:
                found.append(
                    Input(
                        name=f"mass of {body.owner} may be off by",
                        value=body.mass.error,
                        origin=Origin.ESTIMATED,
                        source=body.mass.source,
                    )
                )
    station = model.workstation
    tables: tuple[Robot | Mounted, ...] = (*station.robots, *station.tools, *station.workpieces)
    carried = {model.bodies[index].owner for index in mechanism.carried}
    found += [
        Input(name=f"{key} of {table.name}", value=value, unit=unit, origin=Origin.GIVEN, source=FILE)
        for table in tables
        for key, unit in (("mass_tolerance", ""), ("density_tolerance", ""), ("com_tolerance", "m"))
        if (value := getattr(table, key, None)) and (table.name == mechanism.name or table.name in carried)
    ]
    rotors = [joint.armature for joint in mechanism.joints if joint.armature is not None]
    found.append(
        Input(
            name="rotor inertia",
            origin=rotors[0].origin if mechanism.rotor_inertia_known and rotors else Origin.MISSING,
            source=rotors[0].source if rotors else "not given: link side only",
        )
    )
    return tuple(found)


def shapes(gap: Gap) -> tuple[Input, ...]:
    """What the surfaces are that a distance was measured between."""
    found = [Input(name="shape", value=note, origin=Origin.ESTIMATED, source="model") for note in gap.notes]
    if gap.deviation > 0:
        found.append(
            Input(
                name="surfaces may be nearer by",
                value=gap.deviation,
                unit="m",
                origin=Origin.COMPUTED,
                source="display meshes against collision meshes, and what is said of the meshes of things",
            )
        )
    return tuple(found)


def point(model: Model, at: str, offset: tuple[float, float, float]) -> Input:
    """Which point a figure is of: a name may mean a tool's working point or a link's origin."""
    frame = model.frame(at)
    local = frame.body_from_frame[:3, 3]
    shown = [round(float(x), 4) for x in local + frame.body_from_frame[:3, :3] @ np.array(offset)]
    return Input(
        name="point",
        value=f"{shown} m in the frame of {frame.name}",
        origin=Origin.GIVEN if at != model.carrier(frame).name or local.any() else Origin.CHOICE,
        source="workstation file" if at != model.carrier(frame).name else f"point of interest of {at}",
    )


def given(name: str, value: float, unit: str) -> Input:
    """A number that the workstation file gives."""
    return Input(name=name, value=value, unit=unit, origin=Origin.GIVEN, source="workstation file")


def option(name: str, value: float, usual: float, unit: str) -> Input:
    """A number that the workstation file may give, and that of seerob when it does not."""
    if value != usual:
        return given(name, value, unit)
    shown = f"{usual:g} {unit}"
    source = f"workstation file, {shown} when not given"
    return Input(name=name, value=value, unit=unit, origin=Origin.CHOICE, source=source)


def limit(value: float | None, unit: str) -> tuple[Input, ...]:
    """The limit that the workstation file gives, if any."""
    return () if value is None else (given("limit", value, unit),)


def _worst(origins: Iterable[Origin]) -> Origin:
    return min(origins, key=WORST_FIRST.index, default=Origin.MISSING)
