"""How parts of a robot touch, by word of the workstation file instead of their meshes."""

from __future__ import annotations

from collections.abc import Mapping

from seerob.errors import UnknownName
from seerob.model import Mechanism, Model


def given_contacts(
    model: Model, robot: Mechanism, radii: Mapping[str, float], areas: Mapping[str, float]
) -> tuple[dict[int, float], dict[int, float]]:
    """Radii and areas by moving body: of several names that mean it, that of the fewest bodies counts.

    Of names that mean as many an area counts before a radius, and the lesser one.

    Args:
        model: The compiled workstation.
        robot: The robot.
        radii: Of its sharpest edges, by name [m].
        areas: Of its smallest contacts, by name [m²].

    Raises:
        UnknownName: A part that the robot does not move.
    """
    meant: list[tuple[int, int, float, list[int]]] = []
    for kind, given in enumerate((radii, areas)):
        for name, value in given.items():
            bodies = [i for i in model.select(name) if i in robot.moving]
            if not bodies:
                known = [model.bodies[i].name for i in robot.moving]
                raise UnknownName(f"moving part of {robot.name}", name, known)
            meant.append((-len(bodies), kind, -value, bodies))
    found: tuple[dict[int, float], dict[int, float]] = {}, {}
    for _, kind, value, bodies in sorted(meant):
        for body in bodies:
            found[1 - kind].pop(body, None)
            found[kind][body] = -value
    return found
