"""OCRA checklist: its rows, what never relieves, and what is missing."""

import re

import numpy as np
import pytest
from msgspec.structs import replace

from made_cell import made, person, results_at
from seerob.criteria.ergonomics.ocra_checklist import OcraArm, points, time_factor

IDLE = OcraArm(
    actions=0,
    static_grip=0,
    moderate_force=0,
    strong_force=0,
    greatest_force=0,
    shoulder=0,
    arm_off_support=0,
    elbow=0,
    wrist=0,
    hand=0,
    same_gestures=0,
)
ARM = "actions = {}\n" + "".join(
    f"{name} = 0\n" for name in IDLE.__struct_fields__ if name not in ("actions", "interruptions")
)
CELL = (
    person()
    + '[[ergonomics]]\nkind = "ocra_checklist"\nname = "ocra"\nhuman = "op"\nlimit = 7.5\n'
    + "daily = 25200\nrecovery = 4\nphysical = 0\npace = 1\n[ergonomics.right]\n"
    + ARM.format(30).replace("wrist = 0", "wrist = 0.35")
    + "[ergonomics.left]\n"
    + ARM.format(10)
)


@pytest.mark.parametrize(
    ("changed", "total"),
    [
        ({}, 0),
        ({"actions": 40, "interruptions": True}, 3),
        ({"actions": 40, "interruptions": False}, 4),
        ({"actions": 70, "interruptions": False}, 10),
        ({"actions": 30, "static_grip": 1}, 4.5),
        ({"strong_force": 0.01, "moderate_force": 1 / 3}, 10),
        ({"greatest_force": 0.2}, 32),
        ({"wrist": 0.6, "elbow": 0.4, "same_gestures": 0.9}, 7),
        ({"shoulder": 0.1}, 2),
    ],
)
def test_points_are_those_of_the_rows(changed, total):
    assert sum(points(replace(IDLE, **changed)).values()) == total


def test_no_more_of_anything_relieves():
    for name in IDLE.__struct_fields__:
        if name == "interruptions":
            continue
        values = np.linspace(0, 90 if name == "actions" else 1, 181)
        told = [
            sum(points(replace(IDLE, **{name: float(x), "interruptions": True})).values()) for x in values
        ]
        assert np.all(np.diff(told) >= 0)
        assert told[-1] > told[0]
    assert np.all(np.diff([time_factor(x) for x in np.linspace(0, 86400, 97)]) >= 0)


def test_the_worse_arm_counts_and_what_is_missing_is_asked_for(tmp_path):
    """(4 recovery + 1 frequency + 2 wrist + 1 pace) · 0.95 of 7 h; the left arm has no frequency or wrist."""
    found = results_at(made(tmp_path / "a", CELL))["ocra"]
    assert (found.value, found.verdict) == (pytest.approx(7.6), "exceeded")
    assert [part.value for part in found.parts] == pytest.approx([7.6, 4.75])
    for i, (gone, said) in enumerate(
        [
            (r"daily = 25200\n", "daily"),
            (r"recovery = 4\n", "recovery"),
            (r"actions = 10\n", r"left\.actions"),
            (r"wrist = 0.35\n", r"right\.wrist"),
        ]
    ):
        open_ = results_at(made(tmp_path / str(i), re.sub(gone, "", CELL)))["ocra"]
        assert open_.verdict == "undecided"
        assert re.search(f"not entered: {said}", open_.reason)
    fast = results_at(made(tmp_path / "f", CELL.replace("actions = 30", "actions = 40")))["ocra"]
    assert (fast.verdict, fast.reason) == ("undecided", "not entered: right.interruptions")
