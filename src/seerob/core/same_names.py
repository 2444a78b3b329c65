"""Data made of another object's attributes of the same names."""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

T = TypeVar("T", bound="DataclassInstance")


def by_name(kind: type[T], given: object, **instead: object) -> T:
    """Fill a dataclass from whoever has attributes of the same names.

    Args:
        kind: The dataclass; fields that ``given`` does not have keep their defaults.
        given: A command line's options, or the table of a file.
        instead: Fields whose values are others.
    """
    alike = {field.name: getattr(given, field.name) for field in fields(kind) if hasattr(given, field.name)}
    return kind(**(alike | instead))
