"""The report's table of tracking errors says of how many bones it speaks; a score says what it may be."""

from seerob.core.figures import whatever_is_missing
from seerob.outputs.report.evidence import bone_errors
from seerob.recording.bone_errors import BoneErrors


def test_the_median_of_five_bones_is_not_called_that_of_the_person():
    errors = BoneErrors()
    errors.add(dict.fromkeys(("pelvis", "left_foot", "right_foot", "left_hand"), (0.01, 0.1)), 0.0)
    errors.add({"right_hand": (0.01, None)}, 0.1)
    text = str(bone_errors({"operator": errors}))
    assert text.count("of the bones seen: 5 of 21") == 2  # position and angle


def test_one_possible_score_is_no_interval():
    assert whatever_is_missing("score", 7, 7) == "the score is 7 whatever is missing"
    assert whatever_is_missing("score", 2, 7) == "the score lies between 2 and 7"
