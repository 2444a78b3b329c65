"""How a part looks, in the workstation file, while a variable has a value: lamps, and what comes and goes."""

from __future__ import annotations

from msgspec import field

from seerob.core.quantities import Share, Table

Color = tuple[Share, Share, Share]


class Display(Table, frozen=True, kw_only=True):
    """A look that follows a variable: a lamp's colour, or whether something is there to be seen."""

    of: str
    """Name of a part, a machine or an area; wildcards allowed."""
    variable: str
    """Variable of the dictionary: a bool, a choice or a text."""
    colors: dict[str, Color] = field(default_factory=dict)
    """Value → red, green, blue in 0…1: ``{ true = [0.9, 0.1, 0.1] }``; its own colour at any other."""
    hidden: tuple[str, ...] = ()
    """Values at which it is not drawn. It counts in distances all the same."""

    def __post_init__(self) -> None:
        if not self.colors and not self.hidden:
            raise ValueError("give colors, hidden or both")
