"""A table of limits as the inputs of a `Basis`: every figure with edition, clause and confidence.

The force that a robot may exert on a body region at rest is the quasi-static limit of the table.
"""

from __future__ import annotations

from seerob.core.errors import InputError, UnknownName
from seerob.core.snapshot import Input, Origin
from seerob.description.norms.body_limits import BodyLimits, BodyRegion, Figure

_ORIGIN = {"M": Origin.ESTIMATED, "D": Origin.COMPUTED, "own": Origin.GIVEN}


def table_input(limits: BodyLimits, edition: str) -> tuple[Input, tuple[str, ...]]:
    """The table itself, and what is doubtful about it.

    Args:
        limits: The table.
        edition: Of the norm that the workstation file asks for.
    """
    label = f"{limits.edition}; {limits.title}"
    undecided_reasons: tuple[str, ...] = ()
    if edition != limits.edition:
        label += f"; used for {edition}"
        undecided_reasons = (
            f"{edition}: whether any figure of its Annex M differs is not known row by row; "
            f"the figures are those of {limits.edition}",
        )
    if limits.reviewed_by:
        label += f"; figures outside the usual ranges: {limits.reviewed_by}"
    return Input(name="limits", value=limits.file, origin=Origin.STATED, source=label), undecided_reasons


def excluded_input(region: str) -> Input:
    """A body region that the workstation file keeps from contact."""
    source = "workstation file; by measures that are not evaluated here"
    return Input(name=f"{region}: kept from contact", origin=Origin.GIVEN, source=source)


def limit_inputs(limits: BodyLimits, *, own: bool, multiplier: float | None = None) -> tuple[Input, ...]:
    """Every figure of a table.

    Args:
        limits: The table.
        own: Whether it is the user's own file.
        multiplier: Of the transient limits, where it is lower than the table's.
    """
    found = []
    for region in limits.regions.values():
        if not region.permitted:
            source = region.permission_source
            value = "contact not permitted"
            found.append(Input(name=region.name, value=value, origin=_origin(None, own=own), source=source))
            continue
        figures = {
            "F_s": region.force,
            "transient multiplier": region.multiplier,
            "k": region.stiffness,
            "m_H": region.mass,
            "transient energy": region.energy,
            **{f"p_s {area.name}": area.pressure for area in region.areas},
        }
        for name, figure in figures.items():
            if figure is None:
                continue
            if name == "transient multiplier" and multiplier is not None and multiplier < figure.value:
                source = f"workstation file, instead of {figure.value:g}: {figure.source}"
                given = Input(
                    name=f"{region.name}: {name}", value=multiplier, origin=Origin.GIVEN, source=source
                )
                found.append(given)
            else:
                found.append(
                    Input(
                        name=f"{region.name}: {name}",
                        value=figure.value,
                        unit=figure.unit,
                        origin=_origin(figure, own=own),
                        source=figure.source,
                    )
                )
    return tuple(found)


def _origin(figure: Figure | None, *, own: bool) -> Origin:
    if own:
        return Origin.GIVEN
    return Origin.STATED if figure is None else _ORIGIN.get(figure.confidence, Origin.STATED)


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
    table, undecided_reasons = table_input(limits, edition)
    force = tuple(i for i in limit_inputs(limits, own=own) if i.name == f"{region}: F_s")
    return (table, *force), undecided_reasons
