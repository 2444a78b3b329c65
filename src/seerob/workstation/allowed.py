"""What whoever starts seerob allows a workstation file to do; the file itself cannot."""

from __future__ import annotations

from typing import NamedTuple


class Allowed(NamedTuple):
    """Nothing, unless said on the command line or in Python."""

    plugins: bool = False
    """A dotted kind that no installed package offers is imported by its name (``--allow-plugins``)."""
    outside: bool = False
    """Files outside the workstation's folder are read (``--allow-outside``)."""
    replayed: bool = False
    """Its sources are not opened, for their samples are there: what they name need not be."""


NOTHING = Allowed()
