"""RULA and REBA once more, one number at a time, from the methods' words and tables alone."""

import random
from dataclasses import fields
from itertools import product

import numpy as np
import pytest
from made_postures import NEUTRAL

from seerob.core.snapshot import Result, Verdict
from seerob.criteria.ergonomics.reba import Coupling, Reba, RebaPhase
from seerob.criteria.ergonomics.rula import LoadUse, Profile, Rula, RulaPhase
from seerob.criteria.figure import result_of, verdict_of
from seerob.criteria.scoring.judgement import score, shown
from seerob.description.humans.angles import SIDED, Angles

RULA_A = [
    "12222333",
    "22223333",
    "23333344",
    "23333444",
    "33333444",
    "34444455",
    "33444455",
    "34444455",
    "44444555",
    "44444555",
    "44444555",
    "44455566",
    "55555667",
    "56666777",
    "66677778",
    "77777889",
    "88888999",
    "99999999",
]
RULA_B = ["132334556677", "232345556777", "333445566777", "555667777788", "777778888888", "888888899999"]
RULA_C = ["1233455", "2234455", "3334456", "3334566", "4445677", "4456677", "5566777", "5567777"]
REBA_A = ["123412343356", "234534564567", "245645675678", "356756786789", "467867897899"]
REBA_B = ["122123", "123234", "345455", "455567", "678788", "788899"]
REBA_C = [
    "111233456777",
    "122344566778",
    "233345677888",
    "344456788999",
    "444567889999",
    "66678899aaaa",
    "7778999aabbb",
    "8889aaaaabbb",
    "999aaabbbccc",
    "aaabbbbccccc",
    "bbbbcccccccc",
    "cccccccccccc",
]
RANGE = {
    "trunk_flexion": (-40, 110), "trunk_side_bend": (-40, 40), "trunk_twist": (-60, 60),
    "neck_flexion": (-50, 60), "neck_side_bend": (-40, 40), "neck_twist": (-80, 80),
    "shoulder_flexion": (-60, 175), "shoulder_elevation": (0, 170), "shoulder_abduction": (-30, 60),
    "shoulder_rotation": (-80, 80), "clavicle_elevation": (-20, 30), "arm_rise": (-90, 80),
    "elbow_flexion": (0, 145), "forearm_out": (-80, 80), "wrist_across": (-30, 20),
    "forearm_rotation": (-80, 80), "wrist_flexion": (-60, 60), "wrist_deviation": (-20, 30),
    "knee_flexion": (0, 120), "shank_tilt": (0, 90), "foot_rise": (0, 20),
}  # fmt: skip
"""Angles [deg] that bodies have."""
HAIR = 5e-7
"""Rounding that no score may hang on [rad]."""
NEAR = 1e-4
"""Nearer to a threshold is at it, for what is written by hand here [deg]."""


def table(rows, row, column):
    return int(rows[row - 1][column - 1], 16)


def at(x, edge):
    """At an edge or beyond it, on the side away from neutral."""
    return x >= edge - NEAR if edge > 0 else x > NEAR


def arm(a, s):
    f = a["shoulder_flexion"][s]
    return 4 if at(f, 90) else 3 if at(f, 45) else 2 if at(f, 20) or at(-f, 20) else 1


def elbow(a, s):
    return 1 if 60 + NEAR < a["elbow_flexion"][s] < 100 - NEAR else 2


def size(a, name, edge, s=None):
    return at(abs(a[name] if s is None else a[name][s]), edge)


def rula_of(a, s, p, profile):
    kilograms, use = p["load"], p["load_use"]
    if use is LoadUse.SHOCK:
        force = 3
    elif kilograms < 2:
        force = 0
    elif kilograms <= 10:
        force = 1 if use is LoadUse.INTERMITTENT else 2
    else:
        force = 2 if use is LoadUse.INTERMITTENT and profile is Profile.ORIGINAL_1993 else 3
    upper = arm(a, s) + at(a["shoulder_abduction"][s], 20) + at(a["clavicle_elevation"][s], 5)
    upper = max(1, upper - (p["supported_arms"] in ("both", ("right", "left")[s])))
    lower = elbow(a, s) + (at(a["wrist_across"][s], 0) or at(a["forearm_out"][s], 45))
    wrist = 3 if size(a, "wrist_flexion", 15, s) else 2 if size(a, "wrist_flexion", 5, s) else 1
    wrist += size(a, "wrist_deviation", 10, s)
    twist = 1 + size(a, "forearm_rotation", 45, s)
    A = table(RULA_A, 3 * (upper - 1) + lower, 2 * (wrist - 1) + twist)
    f = a["neck_flexion"]
    neck = 4 if at(-f, 5) else 3 if at(f, 20) else 2 if at(f, 10) else 1
    neck += size(a, "neck_twist", 10) + size(a, "neck_side_bend", 10)
    f = max(a["trunk_flexion"], 0.0) if p["back_supported"] else a["trunk_flexion"]
    trunk = 4 if at(f, 60) else 3 if at(f, 20) else 2 if at(abs(f), 5) else 1
    trunk += size(a, "trunk_twist", 10) + size(a, "trunk_side_bend", 10)
    uneven = at(abs(a["knee_flexion"][0] - a["knee_flexion"][1]), 15) or at(max(a["foot_rise"]), 7)
    legs = {"balanced": 1, "unbalanced": 2, "posture": 2 if uneven else 1}[p["legs"]]
    B = table(RULA_B, neck, 2 * (trunk - 1) + legs)
    C = A + p["muscle_arms"] + force * (p["hand"] in ("both", ("right", "left")[s]))
    D = B + p["muscle_body"] + force
    return table(RULA_C, min(C, 8), min(D, 7))


def reba_of(a, s, p, profile):
    f = a["trunk_flexion"]
    trunk = 4 if at(f, 60) else 3 if at(abs(f), 20) else 2 if at(abs(f), 5) else 1
    trunk += size(a, "trunk_twist", 10) or size(a, "trunk_side_bend", 10)
    f = a["neck_flexion"]
    neck = (2 if at(f, 20) or at(-f, 5) else 1) + (size(a, "neck_twist", 10) or size(a, "neck_side_bend", 10))
    knee = max(a["knee_flexion"])
    legs = {"unilateral": 2, "posture": 1 + at(max(a["foot_rise"]), 7)}.get(p["legs"], 1)
    legs += 0 if p["legs"] == "sitting" else 2 if at(knee, 60) else 1 if at(knee, 30) else 0
    load = (0 if p["load"] < 5 else 1 if p["load"] <= 10 else 2) + p["shock"]
    A = min(table(REBA_A, trunk, 4 * (neck - 1) + legs) + load, 12)
    upper = arm(a, s) + (at(a["shoulder_abduction"][s], 20) or size(a, "shoulder_rotation", 45, s))
    upper += at(a["clavicle_elevation"][s], 5)
    upper = max(1, upper - (p["supported_arms"] in ("both", ("right", "left")[s])))
    wrist = 2 if size(a, "wrist_flexion", 15, s) else 1
    wrist += size(a, "wrist_deviation", 10, s) or size(a, "forearm_rotation", 45, s)
    grip = ["good", "fair", "poor", "unacceptable"].index(p["coupling"].value)
    B = min(table(REBA_B, upper, 3 * (elbow(a, s) - 1) + wrist) + grip, 12)
    return table(REBA_C, A, B) + p["static"] + p["repeated"] + p["rapid"]


def drawn(rng):
    """Angles [deg] of a posture, of which most are multiples of 5° and lie on thresholds."""

    calm = rng.choice((0.0, 0.5, 0.9))

    def one(name):
        if rng.random() < calm:
            return NEUTRAL.get(name, 0.0)
        low, high = RANGE[name]
        x = rng.uniform(low, high)
        return x if rng.random() < 0.3 else 7.0 if name == "foot_rise" and x > 7 else 5.0 * round(x / 5)

    return {n: [one(n), one(n)] if n in SIDED else one(n) for n in (f.name for f in fields(Angles))}


def radians(a, rng, hair):
    """Angles in radians, each off by rounding that nobody can see."""
    return Angles(**{
        n: np.radians(np.asarray(x, float)) + hair * rng.choice((-1, 0, 1)) for n, x in a.items()
    })  # fmt: skip


COMMON = {"load": (0.0, 1.9, 2.0, 4.9, 5.0, 9.0, 10.0, 10.1, 30.0)}
COMMON |= {"supported_arms": ("none", "left", "right", "both")}
ENTERED = {
    Rula: COMMON
    | {"load_use": tuple(LoadUse), "hand": ("left", "right", "both"), "back_supported": (False, True)}
    | {"muscle_arms": (False, True), "muscle_body": (False, True)}
    | {"legs": ("balanced", "unbalanced", "posture")},
    Reba: COMMON
    | {"shock": (False, True), "coupling": tuple(Coupling), "static": (False, True)}
    | {"repeated": (False, True), "rapid": (False, True)}
    | {"legs": ("bilateral", "walking", "unilateral", "sitting", "posture")},
}
BY_HAND = {Rula: (RulaPhase, rula_of), Reba: (RebaPhase, reba_of)}


def scored(rule, angles, phase, limit=None):
    figure = score(rule.METHOD, angles, rule.components(angles, phase), None, limit)
    verdict = verdict_of(figure, at_most=True)
    said = shown(rule.METHOD, figure, verdict, limit=limit, human="op", thresholds=rule.thresholds)
    return result_of(figure, verdict, said, Result(name="r"))


@pytest.mark.parametrize("kind", [Rula, Reba])
def test_a_posture_scores_what_the_methods_words_say(kind):
    """1500 postures of round angles with rounding to either side, and whatever may be entered beside them."""
    rng = random.Random(11)
    phase_of, by_hand = BY_HAND[kind]
    seen = set()
    for k in range(1500):
        a = drawn(rng)
        p = {name: rng.choice(every) for name, every in ENTERED[kind].items()}
        profile = tuple(Profile)[k % 2]
        rule = Rula(human="op", name="r", profile=profile) if kind is Rula else Reba(human="op", name="r")
        expected = [by_hand(a, s, p, profile) for s in (0, 1)]
        limit = max(expected) - rng.choice((0, 1))
        found = scored(rule, radians(a, rng, HAIR), phase_of(**p), limit)
        assert [part.value for part in found.parts[:2]] == expected, (a, p)
        assert found.value == max(expected)
        assert found.verdict is (Verdict.WITHIN if max(expected) <= limit else Verdict.EXCEEDED)
        seen.add(max(expected))
    assert len(seen) >= (5 if kind is Rula else 10)


@pytest.mark.parametrize("kind", [Rula, Reba])
def test_what_is_left_out_is_every_answer_that_there_is(kind):
    """Of one or two things that nobody entered: the score lies between the extremes of all answers."""
    rng = random.Random(7)
    phase_of, by_hand = BY_HAND[kind]
    for _ in range(150):
        a = drawn(rng)
        p = {name: rng.choice(every) for name, every in ENTERED[kind].items()}
        left = rng.sample([n for n in p if n != "hand"], rng.choice((1, 2)))
        rule = kind(human="op", name="r")
        given = {name: x for name, x in p.items() if name not in left}
        if given.get("load") == 0.0:
            continue  # then grip and use of the load need not be entered
        every = [
            max(
                by_hand(a, s, p | dict(zip(left, answers, strict=True)), Profile.ORIGINAL_1993)
                for s in (0, 1)
            )
            for answers in product(*(ENTERED[kind][name] for name in left))
        ]
        found = scored(rule, radians(a, rng, HAIR), phase_of(**given), max(every))
        low, high = found.interval or (found.value, found.value)
        assert low <= min(every), (left, a, p)
        assert max(every) <= high, (left, a, p)
        assert found.verdict in (Verdict.UNDECIDED, Verdict.WITHIN)
        if min(every) < max(every):
            assert found.verdict is Verdict.UNDECIDED, (left, a, p)
