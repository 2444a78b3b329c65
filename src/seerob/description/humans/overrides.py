"""Lengths and masses of bones by hand: they are kept, the others make up for it.

The chain from the sole to the vertex keeps its sum, the stature, and all bones together keep the body mass:
what was given stands, what was not is scaled.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from seerob.core.errors import InputError, Problem, suggestion
from seerob.description.humans.skeleton import BONES, SIDES, without_side

CHAIN = ("ankle_height", "shank", "thigh", "pelvis", "lumbar", "thorax", "neck", "head")
"""Lengths that add up to the stature."""
BESIDE = ("upper_arm", "forearm", "hand", "foot", "hip_centres", "half_shoulders")
"""Lengths that do not."""
LENGTHS = CHAIN + BESIDE
"""What may be given by hand."""
FOLLOWING = {
    "foot": ("heel", "toe_joint", "foot_breadth"),
    "hand": ("hand_breadth",),
    "ankle_height": ("toe_joint_height", "foot_com_height"),
    "half_shoulders": ("clavicle_side",),
}
"""Lengths that keep their proportion to another."""
FACTOR = 2.0
"""A length or a mass that differs from the tables by more is a mistake, not a person."""
CLOSED = 1e-6
"""A chain of which every length is given may miss the stature by this [m]."""
LARGER = 5.0
"""A mass that differs from the tables by a larger factor is a mistake; it is more than `FACTOR`, because a
piece of a segment is small."""


def with_lengths(
    length: Mapping[str, float], given: Mapping[str, float], *, stature: float, name: str
) -> dict[str, float]:
    """Heights and lengths of a body with some of them given [m].

    Args:
        length: Of the tables, before the derived ones.
        given: By hand, names of `LENGTHS`.
        stature: What the chain adds up to.
        name: Of the person, for messages.

    Raises:
        InputError: A name that is not there, a length that is no person's, or a chain that cannot close;
            all of them.
    """
    problems = []
    for key, value in given.items():
        if key not in LENGTHS:
            remedy = suggestion(key, LENGTHS)
            problems.append(Problem(name, f"lengths.{key}", "no such length", remedy))
        elif not length[key] / FACTOR <= value <= length[key] * FACTOR:  # false for NaN too
            low, high = length[key] / FACTOR, length[key] * FACTOR
            what = f"{value:g} m is not that of a person of {stature:g} m"
            problems.append(Problem(name, f"lengths.{key}", what, f"give {low:.3f}…{high:.3f} m"))
    if problems:
        raise InputError(problems)
    out = {**length, **given}
    fixed = [key for key in CHAIN if key in given]
    free = [key for key in CHAIN if key not in given]
    left = stature - math.fsum(given[key] for key in fixed)
    wanted = math.fsum(length[key] for key in free)
    closes = wanted / FACTOR <= left <= wanted * FACTOR if free else abs(left) < CLOSED
    if fixed and not closes:
        what = f"{', '.join(fixed)} leave {left:.3f} m of {stature:g} m for the rest"
        remedy = f"leave one out, or give lengths that leave about {wanted:.3f} m"
        raise InputError.at(name, "lengths", what, remedy)
    for key in free:
        out[key] = length[key] * (left / wanted if fixed else 1.0)
    for key, others in FOLLOWING.items():
        for other in others:
            out[other] = length[other] * out[key] / length[key]
    out["shoulder"] = length["shoulder"] * out["thorax"] / length["thorax"]
    out["hip_height"] = math.fsum(out[key] for key in ("ankle_height", "shank", "thigh"))
    out["trunk"] = math.fsum(out[key] for key in ("pelvis", "lumbar", "thorax"))
    out["shoulder_height"] = math.fsum(out[k] for k in ("hip_height", "pelvis", "lumbar", "shoulder"))
    # Rounding must not open the chain.
    last = free[-1] if free else "head"
    out[last] = stature - math.fsum(out[key] for key in CHAIN if key != last)
    return out


def with_masses(
    share: Mapping[str, float], given: Mapping[str, float], *, mass: float, name: str
) -> dict[str, float]:
    """Shares of the body mass with the masses of some bones given [kg].

    Args:
        share: Of the tables, per bone.
        given: By hand: ``left_thigh``, or ``thigh`` for both sides.
        mass: Body mass [kg], which the sum keeps.
        name: Of the person, for messages.

    Raises:
        InputError: As `with_lengths`.
    """
    plain = {without_side(bone) for bone in BONES}
    problems = []
    fixed: dict[str, float] = {}
    for key, value in given.items():
        bones = [key] if key in BONES else [f"{side}_{key}" for side in SIDES] if key in plain else []
        if not bones:
            remedy = suggestion(key, (*BONES, *plain))
            problems.append(Problem(name, f"masses.{key}", "no such bone", remedy))
            continue
        usual = share[bones[0]] * mass
        if not usual / LARGER <= value <= usual * LARGER:
            what = f"{value:g} kg is not that of a person of {mass:g} kg"
            remedy = f"give {usual / LARGER:.2f}…{usual * LARGER:.2f} kg"
            problems.append(Problem(name, f"masses.{key}", what, remedy))
        fixed |= dict.fromkeys(bones, value / mass)
    left = 1.0 - math.fsum(fixed.values())
    free = math.fsum(value for bone, value in share.items() if bone not in fixed)
    if not problems and fixed and not (free > 0 and free / FACTOR <= left <= free * FACTOR):
        what = f"the given masses leave {left * mass:.2f} kg of {mass:g} kg for the other bones"
        problems.append(Problem(name, "masses", what, f"leave about {free * mass:.2f} kg"))
    if problems:
        raise InputError(problems)
    return (
        {bone: fixed.get(bone, value * left / free) for bone, value in share.items()} if fixed else {**share}
    )
