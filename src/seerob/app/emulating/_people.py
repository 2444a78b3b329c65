"""What an emulated device for people sees: the arguments that say so, and the person they mean."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from seerob.core.errors import InputError

if TYPE_CHECKING:
    from seerob.app.emulators.mvn_person import Person

LIBRARY = "library:reach"
"""What is played when nothing is given."""


def add_person(sub: argparse.ArgumentParser, *, rate: float) -> None:
    """Arguments of every emulated device that sees a person."""
    what = f"motion to play: an .mvnx or .bvh recording, or keyframes (.toml, library:…; default: {LIBRARY})"
    sub.add_argument("--file", default=LIBRARY, help=what)
    sub.add_argument("--rate", type=float, default=rate, help=f"samples per second (default: {rate:g})")


def person_of(options: argparse.Namespace, *, fastest: float) -> Person:
    """The person that the arguments mean.

    Raises:
        InputError: The motion is missing or wrong, or the rate is none of the device's.
    """
    from seerob.app.emulators.mvn_person import animated, followed, recorded

    if not 1 <= options.rate <= fastest:
        remedy = f"it does 1 to {fastest:g} Hz"
        raise InputError.at("seerob emulate", "--rate", f"{options.rate:g} Hz", remedy)
    given = Path(options.file)
    match given.suffix.lower():
        case ".mvnx":
            return recorded(given)
        case ".bvh":
            return followed(given)
        case _:
            return animated(options.file)
