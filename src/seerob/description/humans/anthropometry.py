"""A body from stature, body mass and sex: where the joints are, what segments weigh, what is given by hand.

Lengths: Drillis and Contini 1966 (fractions of stature; the paper cites Drillis et al. 1964) or de Leva 1996
(distances of joint centres). Masses, centres and radii of gyration: de Leva 1996, Table 4, or for men the
regressions of Zatsiorsky and Seluyanov 1979 (what the paper cites). The tables with their sources are
``data/*.toml``. What has no published source is a choice that the findings name.

The regressions are ``y = b0 + b1 · body mass [kg] + b2 · stature [cm]``. They are made for ordinary builds:
far from them a mass or a moment becomes impossible, and the person is refused.

The published tables that ship with seerob, read once.

The chain from the sole to the vertex keeps its sum, the stature, and all bones together keep the body mass:
what was given stands, what was not is scaled.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np

from seerob.core.errors import InputError, Problem, UnknownName, suggestion
from seerob.core.snapshot import Finding
from seerob.core.transforms import Array
from seerob.description.humans.skeleton import BONES, SIDES, without_side


@cache
def table(name: str) -> dict[str, Any]:
    """One of the tables in ``data/``, by name without ending."""
    return tomllib.loads(files("seerob.description.humans").joinpath(f"data/{name}.toml").read_text("utf-8"))


KG_CM2 = 1e-4
"""[kg·m²]"""


def zatsiorsky_masses(*, mass: float, stature: float) -> dict[str, float]:
    """Masses [kg] of the segments of a man of that body mass [kg] and stature [m]; limbs of one side."""
    return {name: _value(row["mass"], mass, stature) for name, row in table("zatsiorsky")["segments"].items()}


def zatsiorsky_moments(segment: str, *, mass: float, stature: float) -> tuple[float, float, float]:
    """Moments [kg·m²] about the sagittal, transverse and longitudinal axis through a segment's centre."""
    row = table("zatsiorsky")["segments"][segment]
    sagittal, transverse, longitudinal = (
        _value(row[axis], mass, stature) * KG_CM2 for axis in ("sagittal", "transverse", "longitudinal")
    )
    return sagittal, transverse, longitudinal


def _value(row: list[float], mass: float, stature: float) -> float:
    b0, b1, b2 = row
    return b0 + b1 * mass + b2 * stature * 100


STATURE_RANGE = (1.2, 2.3)
"""Statures that are believed [m]; the tables are of adults."""
MASS_RANGE = (30.0, 250.0)
"""Body masses that are believed [kg]."""
SMALL_RANGES = (0.8, 2.3), (10.0, 250.0)
"""Statures and body masses of children and adolescents that are believed [m, kg]; no table here is theirs."""
BODY_MASS_INDEX_RANGE = (15.0, 45.0)
"""[kg/m²] outside, proportions of the tables are far from the person: a warning."""


class Sex(StrEnum):
    """Which of the two published tables."""

    MALE = "male"
    FEMALE = "female"


class Lengths(StrEnum):
    """Which set of segment lengths."""

    DRILLIS = "drillis"
    DELEVA = "deleva"


def stature(population: str, sex: str, percentile: int) -> float:
    """Published stature [m] of a population.

    A person scaled from the stature alone is not that percentile in every dimension.

    Args:
        population: A table of ``data/statures.toml``: ``british_19_65``, ``germany`` …
        sex: ``male`` or ``female``.
        percentile: 5, 50 or 95, where the table has it.

    Raises:
        UnknownName: No such population, sex or percentile.
    """
    populations = table("statures")
    if population not in populations:
        raise UnknownName("population", population, populations)
    people = populations[population].get(Sex(sex).value, {})
    key = f"p{percentile}"
    if key not in people:
        raise UnknownName(f"percentile of {population}, {sex},", key, people)
    return float(people[key]) * 1e-3


def stature_given(given: float | str, sex: str, *, name: str) -> tuple[float, tuple[Finding, ...]]:
    """Stature [m] of a number, or of a population and percentile, with what is to be said of it.

    Args:
        given: [m], or ``"germany P50"``: of that sex, from ``data/statures.toml``.
        sex: ``male`` or ``female``.
        name: Of the person, for messages.

    Raises:
        InputError: No such population or percentile.
    """
    if not isinstance(given, str):
        return given, ()
    population, _, percentile = given.strip().rpartition(" ")
    digits = percentile[1:]
    known = table("statures")
    example = f'give metres or one of {", ".join(known)} with P5, P50 or P95, such as "germany P50"'
    if not (percentile[:1] in ("P", "p") and digits.isdecimal() and len(digits) <= 2):
        raise InputError.at(name, "stature", f"{given!r} is no percentile of a population", example)
    try:
        found = stature(population.strip(), sex, int(digits))
    except UnknownName as error:
        raise InputError.at(name, "stature", str(error), example) from error
    people = known[population.strip()]
    text = (
        f"stature {found:.3f} m: P{int(digits)} of {sex} {people['source']} "
        f"(figure {'read in a publication' if people['confidence'] == 'read' else 'quoted from memory'}); "
        "no other dimension is of that percentile"
    )
    return found, (Finding(level="assumed", subject=name, text=text),)


class Masses(StrEnum):
    """Where the segments' masses and moments of inertia come from."""

    DELEVA = "deleva"
    """Shares of the body mass and radii of gyration; men and women."""
    ZATSIORSKY = "zatsiorsky"
    """Regressions on body mass and stature; men only."""


@dataclass(frozen=True, eq=False)
class Body:
    """A person's dimensions and segment masses, all in SI."""

    name: str
    stature: float
    mass: float
    sex: Sex
    lengths: Lengths
    masses: Masses
    length: dict[str, float]
    """Heights and lengths [m] by name, as in `_lengths`."""
    offset: dict[str, Array]
    """Bone → its origin in its parent's frame at zero [m], (3,); the pelvis' in the root's, ISB axes."""
    share: dict[str, float]
    """Bone → share of the body mass; they sum to 1."""
    findings: tuple[Finding, ...]
    overridden: bool = False
    """Whether lengths or masses were given beside the tables."""

    def bone_mass(self, bone: str) -> float:
        """Mass of a bone with its flesh [kg]."""
        return self.share[bone] * self.mass


def body(
    *,
    name: str,
    stature: float,
    mass: float,
    sex: str,
    lengths: str = "drillis",
    masses: str = "deleva",
    own_lengths: Mapping[str, float] | None = None,
    own_masses: Mapping[str, float] | None = None,
    adult: bool = True,
) -> Body:
    """The body of a person of that stature [m], body mass [kg] and sex.

    ``own_lengths`` [m] (`seerob.description.humans.anthropometry.LENGTHS`) and ``own_masses`` [kg], by bone,
    replace the tables'; the other lengths and masses make up for it, so that stature and body mass stay.
    Who is no ``adult`` has an adult's proportions, which a finding says.

    Raises:
        InputError: A value is not a plausible adult's, or not one of the choices; all are named.
    """
    ranges = (STATURE_RANGE, MASS_RANGE) if adult else SMALL_RANGES
    _check(name, (stature, mass), ranges, {"sex": sex, "lengths": lengths, "masses": masses})
    chosen, kind, by = Sex(sex), Lengths(lengths), Masses(masses)
    length, findings = _lengths(name, stature, chosen, kind)
    if own_lengths:
        length = with_lengths(length, own_lengths, stature=stature, name=name)
        shown = ", ".join(f"{key} {value * 1e3:.0f} mm" for key, value in own_lengths.items())
        text = f"given by hand: {shown}; the other lengths up to the vertex make up for it"
        findings.append(Finding(level="note", subject=name, text=text))
    if not adult:
        text = (
            "no adult, and proportions are an adult's: children have larger heads and shorter legs; give "
            "lengths, and an uncertainty of distances"
        )
        findings.append(Finding(level="warning", subject=name, text=text))
    index = mass / stature**2
    low, high = BODY_MASS_INDEX_RANGE
    if adult and not low <= index <= high:
        text = f"body mass index {index:.1f} kg/m² is outside {low:g}…{high:g}: the tables fit badly"
        findings.append(Finding(level="warning", subject=name, text=text))
    share = _shares(chosen, by, mass, stature)
    if own_masses:
        share = with_masses(share, own_masses, mass=mass, name=name)
        shown = ", ".join(f"{key} {value:g} kg" for key, value in own_masses.items())
        text = f"given by hand: {shown}; the other bones make up for it"
        findings.append(Finding(level="note", subject=name, text=text))
    if min(share.values()) <= 0:
        raise unfit(name, mass, stature)
    offset = _offsets(length)
    return Body(
        name,
        stature,
        mass,
        chosen,
        kind,
        by,
        length,
        offset,
        share,
        tuple(findings),
        bool(own_lengths or own_masses),
    )


def unfit(name: str, mass: float, stature: float) -> InputError:
    """The regressions give a segment that cannot exist."""
    what = f"the regressions give impossible segments for {mass:g} kg and {stature:g} m"
    return InputError.at(name, "masses", what, "give masses = deleva")


CHOICES: dict[str, type[StrEnum]] = {"sex": Sex, "lengths": Lengths, "masses": Masses}


def _check(
    name: str,
    sizes: tuple[float, float],
    ranges: tuple[tuple[float, float], tuple[float, float]],
    chosen: dict[str, str],
) -> None:
    problems = []
    for key, unit, value, (low, high) in zip(("stature", "mass"), ("m", "kg"), sizes, ranges, strict=True):
        if not low <= value <= high:  # false for NaN too
            problems.append(
                Problem(name, key, f"{value:g} {unit} is not a person's", f"give {low:g}…{high:g} {unit}")
            )
    for key, text in chosen.items():
        choices = tuple(CHOICES[key])
        if text not in choices:
            problems.append(Problem(name, key, f"{text!r} is not known", f"give one of {', '.join(choices)}"))
    if chosen["masses"] == Masses.ZATSIORSKY and chosen["sex"] == Sex.FEMALE:
        what = "the women's regressions as published do not conserve mass"
        problems.append(Problem(name, "masses", what, "give masses = deleva"))
    if problems:
        raise InputError(problems)


def _lengths(name: str, stature: float, sex: Sex, kind: Lengths) -> tuple[dict[str, float], list[Finding]]:
    tables, split = table("lengths"), table("lengths")["split"]
    fractions = {k: v for k, v in tables["shape"].items() if k != "source"}
    findings = [Finding(level="note", subject=name, text=tables["split"]["source"])]
    if kind is Lengths.DRILLIS:
        drillis = tables["drillis"]
        fractions |= {k: v for k, v in drillis.items() if k not in ("source", "trunk_and_head")}
        bones = ("pelvis", "lumbar", "thorax", "neck", "head")
        scale = drillis["trunk_and_head"] / math.fsum(split[b] for b in bones)
        fractions |= {b: split[b] * scale for b in bones}
    else:
        people = table("de_leva")[sex]
        rows = people["segments"] | people["alternatives"]
        fraction = {k: row["length"] / people["stature"] for k, row in rows.items()}
        fractions |= {k: fraction[k] for k in ("shank", "thigh", "upper_arm", "forearm", "foot")}
        fractions["hand"] = fraction["hand_2"]
        for chain in (("pelvis", "lumbar", "thorax"), ("neck", "head")):
            whole = fraction["head_2" if "head" in chain else "trunk_2"]
            scale = whole / math.fsum(split[b] for b in chain)
            fractions |= {b: split[b] * scale for b in chain}
        legs = fraction["shank"] + fraction["thigh"]
        # The table stops at the ankle; what is left of the stature is the ankle's height.
        fractions["ankle_height"] = 1.0 - math.fsum((legs, fraction["trunk_2"], fraction["head_2"]))
        fractions["shoulder_height"] = fractions["ankle_height"] + legs + fraction["trunk_3"]
        text = (
            f"ankle height {fractions['ankle_height'] * stature * 1e3:.0f} mm is what the {sex} de Leva "
            f"lengths leave of the stature ({fractions['ankle_height']:.4f} of it; male 0.0222, female "
            "0.0436, Drillis 0.039)"
        )
        findings.append(Finding(level="assumed", subject=name, text=text))
    length = {k: v * stature for k, v in fractions.items() if k != "toe_joint"}
    length["toe_joint"] = fractions["toe_joint"] * length["foot"] - length["heel"]  # ahead of the ankle
    choices = tables["choices"]
    length["toe_joint_height"] = choices["toe_joint_height"] * length["ankle_height"]
    length["foot_com_height"] = choices["foot_com_height"] * length["ankle_height"]
    length["hand_breadth"] = choices["hand_breadth"] * length["hand"]
    # Rounding must not open the chain: the last link takes what is left.
    others = ("ankle_height", "shank", "thigh", "pelvis", "lumbar", "thorax", "neck")
    length["head"] = stature - math.fsum(length[k] for k in others)
    length["hip_height"] = math.fsum(length[k] for k in ("ankle_height", "shank", "thigh"))
    length["trunk"] = math.fsum(length[k] for k in ("pelvis", "lumbar", "thorax"))
    # Centre of the shoulder above the thorax' origin.
    length["shoulder"] = (
        length["shoulder_height"] - length["hip_height"] - length["pelvis"] - length["lumbar"]
    )
    return length, findings


def _offsets(length: dict[str, float]) -> dict[str, Array]:
    offset = {
        "pelvis": np.array([0.0, length["hip_height"], 0.0]),
        "lumbar": np.array([0.0, length["pelvis"], 0.0]),
        "thorax": np.array([0.0, length["lumbar"], 0.0]),
        "neck": np.array([0.0, length["thorax"], 0.0]),
        "head": np.array([0.0, length["neck"], 0.0]),
    }
    for side, z in zip(SIDES, (1.0, -1.0), strict=True):
        joint = np.array(
            [
                length["clavicle_forward"],
                length["shoulder"] + length["clavicle_up"],
                z * length["clavicle_side"],
            ]
        )
        shoulder = np.array([0.0, length["shoulder"], z * length["half_shoulders"]])
        offset[f"{side}_clavicle"] = joint
        offset[f"{side}_upper_arm"] = shoulder - joint
        offset[f"{side}_forearm"] = np.array([0.0, -length["upper_arm"], 0.0])
        offset[f"{side}_hand"] = np.array([0.0, -length["forearm"], 0.0])
        offset[f"{side}_thigh"] = np.array([0.0, 0.0, z * length["hip_centres"] / 2])
        offset[f"{side}_shank"] = np.array([0.0, -length["thigh"], 0.0])
        offset[f"{side}_foot"] = np.array([0.0, -length["shank"], 0.0])
        drop = length["toe_joint_height"] - length["ankle_height"]
        offset[f"{side}_toes"] = np.array([length["toe_joint"], drop, 0.0])
    return offset


def _shares(sex: Sex, by: Masses, mass: float, stature: float) -> dict[str, float]:
    people = table("de_leva")[sex]
    percent = {k: row["mass"] for k, row in people["segments"].items()}
    pieces = dict(people["pieces"])
    if by is Masses.ZATSIORSKY:
        shares = zatsiorsky_masses(mass=mass, stature=stature)
        # Pieces keep their part of the segment that they belong to.
        for piece, of in (("neck", "head"), ("clavicle", "upper_trunk"), ("toes", "foot")):
            pieces[piece] *= shares[of] / percent[of]
        percent = shares
    bones = {
        "pelvis": percent["lower_trunk"],
        "lumbar": percent["middle_trunk"],
        "thorax": percent["upper_trunk"] - 2 * pieces["clavicle"],
        "neck": pieces["neck"],
        "head": percent["head"] - pieces["neck"],
    }
    limbs = {k: percent[k] for k in ("upper_arm", "forearm", "hand", "thigh", "shank")}
    limbs |= {
        "clavicle": pieces["clavicle"],
        "toes": pieces["toes"],
        "foot": percent["foot"] - pieces["toes"],
    }
    bones |= {f"{side}_{k}": v for k, v in limbs.items() for side in SIDES}
    # Neither the female table (99.99 %) nor the regressions sum to the whole.
    total = math.fsum(bones.values())
    return {k: v / total for k, v in bones.items()}


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
