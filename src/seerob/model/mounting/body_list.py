"""The bodies of a workstation that has been mounted, before `mujoco` has numbered them."""

from __future__ import annotations

from seerob.model.model import Body
from seerob.model.mounting.specification import Mounting, extreme_points


def listed(mounting: Mounting) -> tuple[Body, ...]:
    """The bodies, with `mujoco` indices still to come: contacts are added by name first."""
    bodies = []
    for index, entry in enumerate(mounting.entries):
        corners, radius = extreme_points(entry.solids)
        notes = list(dict.fromkeys(solid.note for solid in entry.solids if solid.note))
        bodies.append(
            Body(
                index=index,
                name=entry.name,
                role=entry.role,
                owner=entry.owner,
                carrier=entry.carrier,
                mj=-1,
                solids=entry.solids,
                corners=corners,
                radius=radius,
                mass=entry.mass,
                mesh=entry.mesh,
                triangles=entry.triangles,
                note="; ".join(notes),
                holder=entry.holder,
            )
        )
    return tuple(bodies)
