"""Errors: one base; each says what is wrong, where, and what would be right."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches
from typing import NamedTuple


class SeerobError(Exception):
    """Base of every error this package raises on purpose."""


class Problem(NamedTuple):
    """One mistake in one place of a file."""

    file: str
    """The file, as the user named it; empty when none is meant."""
    key: str
    """The place in it: ``robots[0].base.position``, ``sheet 'J' row 4``; empty for the whole file."""
    what: str
    """What is wrong, with the offending value."""
    remedy: str = ""
    """What would be right."""

    def __str__(self) -> str:
        where = "".join(f"{part}: " for part in (self.file, self.key) if part)
        return where + self.what + (f"; {self.remedy}" if self.remedy else "")


class InputError(SeerobError):
    """A file, or several, cannot be used as they are; carries every mistake that was found."""

    def __init__(self, problems: Problem | Iterable[Problem]) -> None:
        self.problems = (problems,) if isinstance(problems, Problem) else tuple(problems)
        super().__init__("\n".join(map(str, self.problems)))

    @classmethod
    def at(cls, file: object, key: str, what: str, remedy: str = "") -> InputError:
        """An error with a single mistake."""
        return cls(Problem(str(file), key, what, remedy))


class UnknownName(SeerobError):
    """A name that nothing in the workstation carries."""

    def __init__(self, what: str, name: str, known: Iterable[str]) -> None:
        self.what, self.name, self.known = what, name, tuple(known)
        super().__init__(f"no {what} named {name!r}; {suggestion(name, self.known)}")


class Undecided(SeerobError):
    """What was asked for is not known: not heard, too old, or given by nobody.

    Raised by `State` accessors; the run loop turns it into a result whose verdict is
    UNDECIDED and whose reason is this message.
    """


class Unweighed(Undecided):
    """A mass that nobody gave; what is known of the others may be enough to exceed a limit."""


class NotAsked(SeerobError):
    """A criterion read what does not say whether it may be relied on, instead of asking `State`."""


class SimulationDiverged(SeerobError):
    """The physics gave up, or produced a number that is not finite; the message names body and time."""


def ended_by(error: BaseException) -> str:
    """What ended a run or a command before it was over, in words."""
    if isinstance(error, Exception):
        return str(error) or type(error).__name__
    return f"something called for the end of the program ({type(error).__name__}: {error})"


def suggestion(name: str, known: Iterable[str]) -> str:
    """``did you mean 'ur10'? known: …`` for a wrong name, with at most a dozen of the known ones.

    Of a name with an owner, ``ur10/tool1``, those of the same owner come first.
    """
    known = tuple(known)
    close = get_close_matches(name, known, n=1, cutoff=0.6)
    head = f"did you mean {close[0]!r}? " if close else ""
    if not known:
        return head + "known: none"
    owner = name.rpartition("/")[0]
    shown = ", ".join(sorted(known, key=lambda each: (each.rpartition("/")[0] != owner, each))[:12])
    return head + f"known: {shown}" + (f" and {len(known) - 12} more" if len(known) > 12 else "")
