"""How parts of a robot touch, by word of the workstation file instead of their meshes."""

from __future__ import annotations

from collections.abc import Mapping

from seerob.core.errors import UnknownName
from seerob.model.model import Mechanism, Model


def given_contacts(
    model: Model, robot: Mechanism, radii: Mapping[str, float], areas: Mapping[str, float]
) -> tuple[dict[int, float], dict[int, float], dict[int, str]]:
    """Radii and areas by moving body: of several names that mean it, that of the fewest bodies counts.

    Of names that mean as many an area counts before a radius, and the lesser one. The robot's name means the
    links up to its flange here, for how an arm touches says nothing of its tool.

    Args:
        model: The compiled workstation.
        robot: The robot.
        radii: Of its sharpest edges, by name [m].
        areas: Of its smallest contacts, by name [m²].

    Returns:
        Radii [m], areas [m²], and the name by which each is given.

    Raises:
        UnknownName: A part that the robot does not move.
    """
    meant: list[tuple[int, int, float, str, list[int]]] = []
    arm = {i for i in robot.bodies if model.bodies[i].mj not in robot.load}
    for kind, given in enumerate((radii, areas)):
        for name, value in given.items():
            named = {*model.select(name)}
            bodies = [i for i in robot.moving if i in (arm if name == robot.name else named)]
            if not bodies:
                known = [model.bodies[i].name for i in robot.moving]
                raise UnknownName(f"moving part of {robot.name}", name, known)
            meant.append((-len(named.intersection(robot.moving)), kind, -value, name, bodies))
    found: tuple[dict[int, float], dict[int, float]] = {}, {}
    by: dict[int, str] = {}
    for _, kind, value, name, bodies in sorted(meant):
        for body in bodies:
            found[1 - kind].pop(body, None)
            found[kind][body] = -value
            by[body] = name
    return *found, by
