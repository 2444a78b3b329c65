"""The body of a person as the workstation file describes it."""

from __future__ import annotations

from seerob.core.snapshot import Finding
from seerob.description.description import Description
from seerob.description.humans import manikin
from seerob.description.humans.anthropometry import Body, body, stature_given
from seerob.workstation.workstation import Human

SLIPS = (
    "follow = task with contacts: hands that are pushed against something hard may slip through it; "
    "follow = posture holds there"
)


def describe(human: Human, *, touches: bool) -> tuple[Description, tuple[Finding, ...]]:
    """Tree of bones and joints, and what is to be said of it beside its own findings.

    Args:
        human: The table of the file.
        touches: Whether the file asks for contacts.

    Raises:
        InputError: A value is not a plausible adult's, or not known.
    """
    stature, findings = stature_given(human.stature, human.sex, name=human.name)
    if touches and human.follow == "task":
        findings = (*findings, Finding(level="warning", subject=human.name, text=SLIPS))
    description = manikin.build(
        name=human.name,
        stature=stature,
        mass=human.mass,
        sex=human.sex,
        lengths=human.lengths if isinstance(human.lengths, str) else "drillis",
        masses=human.masses if isinstance(human.masses, str) else "deleva",
        own_lengths=None if isinstance(human.lengths, str) else human.lengths,
        own_masses=None if isinstance(human.masses, str) else human.masses,
        hand=human.hand,
    )
    return description, findings


def size(human: Human) -> Body:
    """Lengths of the person."""
    return body(
        name=human.name,
        stature=stature_given(human.stature, human.sex, name=human.name)[0],
        mass=human.mass,
        sex=human.sex,
        lengths=human.lengths if isinstance(human.lengths, str) else "drillis",
        own_lengths=None if isinstance(human.lengths, str) else human.lengths,
    )
