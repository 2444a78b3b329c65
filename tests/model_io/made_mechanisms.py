"""Mechanisms as STEP files without joints, made by OpenCASCADE, and the axes that they truly have [mm]."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np


class Axis(NamedTuple):
    """A true axis: which parts, turning or sliding, a point of it and its direction [mm]."""

    kind: str
    parts: tuple[str, str]
    point: tuple[float, float, float]
    along: tuple[float, float, float]


def _box(x, y, z, at=(0, 0, 0)):
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox
    from OCP.gp import gp_Pnt

    return BRepPrimAPI_MakeBox(gp_Pnt(*map(float, at)), float(x), float(y), float(z)).Shape()


def _cylinder(radius, height, at, along=(0, 0, 1)):
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeCylinder
    from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt

    axis = gp_Ax2(gp_Pnt(*map(float, at)), gp_Dir(*map(float, along)))
    return BRepPrimAPI_MakeCylinder(axis, float(radius), float(height)).Shape()


def _cut(shape, *others):
    from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut

    for other in others:
        shape = BRepAlgoAPI_Cut(shape, other).Shape()
    return shape


def _fuse(shape, *others):
    from OCP.BRepAlgoAPI import BRepAlgoAPI_Fuse

    for other in others:
        shape = BRepAlgoAPI_Fuse(shape, other).Shape()
    return shape


def door():
    """A frame with two pins in which a leaf turns, until it meets the frame."""
    frame = _fuse(_box(100, 60, 1000), _box(100, 60, 30, (0, -60, 0)))
    pins = [_cylinder(8, 40, (50, 90, z)) for z in (100, 800)]
    arms = [_box(40, 60, 20, (30, 50, z)) for z in (80, 780)]
    frame = _fuse(frame, *arms, *pins)
    leaf = _box(700, 30, 700, (30, 75, 120))
    leaf = _cut(leaf, *(_cylinder(8.2, 40, (50, 90, z)) for z in (110, 790)))
    leaf = _cut(leaf, _box(60, 60, 20, (20, 60, 780)))
    return {"frame": frame, "leaf": leaf}, [Axis("revolute", ("frame", "leaf"), (50, 90, 0), (0, 0, 1))]


def clamp():
    """A lever on a pin between two cheeks, a second part screwed to the base with four screws' holes."""
    base = _fuse(_box(120, 80, 20), _box(30, 15, 60, (20, 10, 20)), _box(30, 15, 60, (20, 55, 20)))
    base = _cut(base, _cylinder(5, 100, (35, -5, 60), (0, 1, 0)))
    holes = [(90 + dx, 40 + dy) for dx in (-15, 15) for dy in (-25, 25)]
    base = _cut(base, *(_cylinder(3, 30, (x, y, -5)) for x, y in holes))
    pin = _cylinder(5, 70, (35, 5, 60), (0, 1, 0))
    lever = _fuse(_cylinder(12, 28, (35, 26, 60), (0, 1, 0)), _box(120, 28, 10, (35, 26, 60)))
    lever = _cut(lever, _cylinder(5.05, 100, (35, -5, 60), (0, 1, 0)))
    block = _cut(_box(50, 70, 15, (65, 5, 20)), *(_cylinder(3, 30, (x, y, 15)) for x, y in holes))
    screws = {
        f"screw_{i}": _fuse(_cylinder(3, 30, (x, y, 5)), _cylinder(5, 5, (x, y, 35)))
        for i, (x, y) in enumerate(holes)
    }
    parts = {"base": base, "pin": pin, "lever": lever, "block": block, **screws}
    return parts, [Axis("revolute", ("pin", "lever"), (35, 0, 60), (0, 1, 0))]


def linear_axis():
    """A carriage on two rods between two ends."""
    rods = [_cylinder(10, 600, (0, y, 60), (1, 0, 0)) for y in (40, 160)]
    ends = [_fuse(_box(30, 200, 100, (x, 0, 0))) for x in (-30, 600)]
    frame = _fuse(ends[0], ends[1], _box(660, 200, 10, (-30, 0, -10)), *rods)
    carriage = _box(120, 180, 50, (200, 10, 35))
    carriage = _cut(carriage, *(_cylinder(10.05, 200, (150, y, 60), (1, 0, 0)) for y in (40, 160)))
    return (
        {"frame": frame, "carriage": carriage},
        [Axis("prismatic", ("frame", "carriage"), (0, 100, 60), (1, 0, 0))],
    )


def slide():
    """A block in a slot, held on three sides."""
    base = _cut(_box(400, 100, 60), _box(400, 40, 40, (0, 30, 20)))
    block = _box(80, 40, 60, (100, 30, 20))
    return {"base": base, "block": block}, [Axis("prismatic", ("base", "block"), (0, 50, 20), (1, 0, 0))]


def cylinder():
    """A piston with its rod in a tube: it turns as well, but the way is what it is made for."""
    tube = _cut(
        _cylinder(25, 200, (0, 0, 0)), _cylinder(20, 180, (0, 0, 10)), _cylinder(8.05, 30, (0, 0, 180))
    )
    rod = _fuse(_cylinder(19.95, 15, (0, 0, 60)), _cylinder(8, 200, (0, 0, 70)))
    return {"tube": tube, "rod": rod}, [Axis("prismatic", ("tube", "rod"), (0, 0, 0), (0, 0, 1))]


def slider_crank():
    """A crank on a base, a rod on its pin, and a piston between two guides."""
    guides = [_box(150, 12, 40, (120, y, 0)) for y in (-32, 20)]
    base = _fuse(_box(400, 100, 20, (-100, -50, -20)), _cylinder(15, 30, (0, 0, 0)), *guides)
    base = _cut(base, _cylinder(8.1, 40, (0, 0, -10)))
    crank = _fuse(
        _cylinder(30, 10, (0, 0, 32)), _box(60, 20, 10, (0, -10, 32)), _cylinder(6, 22, (50, 0, 42))
    )
    crank = _fuse(crank, _cylinder(8, 32, (0, 0, 0)))
    rod = _fuse(_box(130, 14, 10, (50, -7, 43)), *(_cylinder(12, 10, (x, 0, 43)) for x in (50, 180)))
    rod = _cut(rod, *(_cylinder(6.1, 40, (x, 0, 30)) for x in (50, 180)))
    piston = _fuse(_box(50, 40, 40, (160, -20, 0)), _cylinder(6, 20, (180, 0, 40)))
    return {"base": base, "crank": crank, "rod": rod, "piston": piston}, [
        Axis("revolute", ("base", "crank"), (0, 0, 0), (0, 0, 1)),
        Axis("revolute", ("crank", "rod"), (50, 0, 0), (0, 0, 1)),
        Axis("revolute", ("rod", "piston"), (180, 0, 0), (0, 0, 1)),
        Axis("prismatic", ("base", "piston"), (180, 0, 0), (1, 0, 0)),
    ]


def arm(count=6):
    """Links of an arm with a shaft at one end and a hole at the other; each axis is across the one before."""
    parts, axes = {}, []
    point, along = np.zeros(3), np.array([0.0, 0, 1])
    parts["link_0"] = _cut(_box(200, 200, 80, (-100, -100, -80)), _cylinder(30.1, 50, (0, 0, -50)))
    for number in range(1, count + 1):
        side = np.array([1.0, 0, 0]) if abs(along[0]) < 0.5 else np.array([0, 1.0, 0])
        reach = 140.0
        shaft = _cylinder(30, 50, point - 50 * along, along)
        body = _cylinder(45, 100, point, along)
        tip = point + 50 * along + reach * side
        bar = _cylinder(35, reach, point + 50 * along, side)
        head = _cylinder(50, 90, tip, side)
        made = _fuse(shaft, body, bar, head)
        next_point, next_along = tip + 90 * side, side
        if number < count:
            made = _cut(made, _cylinder(30.1, 50, next_point - 50 * next_along, next_along))
        name = f"link_{number}"
        parts[name] = made
        axes.append(Axis("revolute", (f"link_{number - 1}", name), tuple(point), tuple(along)))
        point, along = next_point, next_along
    return parts, axes


MECHANISMS = {
    "door": door,
    "clamp": clamp,
    "linear_axis": linear_axis,
    "slide": slide,
    "cylinder": cylinder,
    "slider_crank": slider_crank,
    "arm": arm,
}


def write(path: Path, parts: dict) -> None:
    """A STEP file of parts under one assembly, in place."""
    from OCP.STEPCAFControl import STEPCAFControl_Writer
    from OCP.TCollection import TCollection_ExtendedString
    from OCP.TDataStd import TDataStd_Name
    from OCP.TDocStd import TDocStd_Document
    from OCP.TopLoc import TopLoc_Location
    from OCP.XCAFDoc import XCAFDoc_DocumentTool

    document = TDocStd_Document(TCollection_ExtendedString("XmlXCAF"))
    tool = XCAFDoc_DocumentTool.ShapeTool_s(document.Main())
    top = tool.NewShape()
    TDataStd_Name.Set_s(top, TCollection_ExtendedString(path.stem))
    for name, shape in parts.items():
        label = tool.AddShape(shape, False)
        TDataStd_Name.Set_s(label, TCollection_ExtendedString(name))
        used = tool.AddComponent(top, label, TopLoc_Location())
        TDataStd_Name.Set_s(used, TCollection_ExtendedString(name))
    tool.UpdateAssemblies()
    writer = STEPCAFControl_Writer()
    writer.SetNameMode(True)
    writer.Transfer(document)
    writer.Write(str(path))


def is_it(proposal, axis: Axis, names: list[str]) -> bool:
    """Whether a proposal is a true axis."""
    found = {names[proposal.a].rpartition("/")[2], names[proposal.b].rpartition("/")[2]}
    if found != set(axis.parts) or proposal.kind.value != axis.kind:
        return False
    if abs(abs(float(proposal.axis @ np.array(axis.along))) - 1) > 1e-6:
        return False
    if axis.kind == "prismatic":
        return True
    between = np.array(axis.point) * 1e-3 - proposal.point
    return bool(np.linalg.norm(between - (between @ proposal.axis) * proposal.axis) < 1e-4)
