"""What a limit says of a value, the same word everywhere."""

from __future__ import annotations

from enum import StrEnum


class Verdict(StrEnum):
    """What a limit says of a value. An evaluation, never a certificate."""

    WITHIN = "within"
    EXCEEDED = "exceeded"
    UNDECIDED = "undecided"
