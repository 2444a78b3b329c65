"""The force that a robot may exert on a body region at rest: the quasi-static limit of the table."""

from __future__ import annotations

from seerob.core.errors import InputError, UnknownName
from seerob.core.snapshot import Input
from seerob.description.norms.body_limits import BodyLimits, BodyRegion
from seerob.description.norms.limit_inputs import limit_inputs, table_input


def pushed_region(limits: BodyLimits, region: str) -> BodyRegion:
    """A region of a table that may be pushed.

    Raises:
        UnknownName: Not in the table.
        InputError: Contact with it is not permitted: no force is a limit.
    """
    found = limits.region(region)
    if found is None:
        raise UnknownName("body region (body_region)", region, sorted(limits.regions))
    if not found.permitted:
        raise InputError.at(
            limits.file,
            f"regions ({region})",
            "contact is not permitted, so there is no force to compare with",
            "name a region where it is, or give a limit of your own",
        )
    return found


def force_inputs(
    limits: BodyLimits, region: str, edition: str, *, own: bool
) -> tuple[tuple[Input, ...], tuple[str, ...]]:
    """The table and the limit of a region as inputs of a `Basis`, and what is doubtful about them.

    Args:
        limits: The table.
        region: That is pushed.
        edition: Of the norm that the workstation file asks for.
        own: Whether the table is the user's own file.
    """
    table, doubts = table_input(limits, edition)
    force = tuple(i for i in limit_inputs(limits, own=own) if i.name == f"{region}: F_s")
    return (table, *force), doubts
