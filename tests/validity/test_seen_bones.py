"""What is said of bones that no device sees."""

from __future__ import annotations

import pytest

from seerob.twin.validity.hearing import unobserved_reason

BONES = ("head", "chest", "pelvis", "left_hand", "right_hand", "left_foot", "right_foot", "left_thigh")


@pytest.mark.parametrize(
    ("n", "said"),
    [
        (0, ""),
        (1, "operator: no device sees head"),
        (6, "operator: no device sees head, chest, pelvis, left_hand, right_hand, left_foot"),
        (7, "operator: no device sees head, chest, pelvis, left_hand, right_hand, left_foot and 1 more"),
        (8, "operator: no device sees head, chest, pelvis, left_hand, right_hand, left_foot and 2 more"),
    ],
)
def test_the_first_six_are_named_and_the_others_counted(n, said):
    assert unobserved_reason("operator", BONES[:n]) == said
