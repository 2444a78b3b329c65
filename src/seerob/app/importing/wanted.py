"""A CAD file without what its user leaves out."""

from __future__ import annotations

from collections.abc import Sequence

from seerob.core.errors import InputError
from seerob.description.cad.assembly import Assembly, without, without_numbers
from seerob.description.mesh import MAX_FACES


def wanted(
    assembly: Assembly,
    *,
    patterns: Sequence[str] = (),
    smaller: float | None = None,
    unreachable: float | None = None,
    triangles: int | None = None,
) -> Assembly:
    """The assembly without what the user leaves out.

    Args:
        assembly: With rigid places.
        patterns: Full names of parts that go, with wildcards.
        smaller: Parts smaller than this in every direction go [mm].
        unreachable: Parts inside of others that nothing thicker can touch go [mm].
        triangles: Most of each part on the screen; only looked at.

    Raises:
        InputError: A pattern is nobody's name, a number is out of bounds, or nothing is left.
    """
    for key, given in (("--smaller", smaller), ("--unreachable", unreachable)):
        if given is not None and not 0 < given <= 1e4:
            raise InputError.at(key, "", f"{given:g} mm", "more than 0 and at most 10000 mm")
    if triangles is not None and not 100 <= triangles <= MAX_FACES:
        what = f"{triangles} triangles"
        raise InputError.at("--triangles", "", what, "at least 100 are needed to show a shape")
    try:
        kept = without(assembly, patterns, None if smaller is None else smaller * 1e-3)
    except ValueError as error:
        names = ", ".join(assembly.names()[:5])
        raise InputError.at("--without", "", str(error), f"full names, as {names}") from None
    if unreachable is None:
        return kept
    from seerob.app.importing.unreachable import unreachable as inside_of

    try:
        inside = inside_of(kept, unreachable * 1e-3)
    except ValueError as error:
        raise InputError.at("--unreachable", "", f"{unreachable:g} mm", str(error)) from None
    return without_numbers(kept, inside, f"--unreachable {unreachable:g}; inside of others")
