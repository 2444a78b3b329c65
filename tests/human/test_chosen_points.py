"""Of two devices that see a bone one is followed, and a confidence that wobbles does not change which."""

from seerob.core.samples import BodyPoint
from seerob.description.capture.handover import BETTER, best


def point(name, weight, bone="head"):
    return BodyPoint(
        name=name, bone=bone, at=(0.0, 0.0, 0.0), position=(0.0, 0.0, 0.0), position_weight=weight
    )


def followed(*weights):
    chosen = {}
    return "".join(p.name for a, b in weights for p in best([[point("a", a)], [point("b", b)]], chosen))


def test_a_wobble_changes_nothing_and_a_clear_difference_does():
    assert followed((1.0, 0.9), (0.9, 1.0), (1.0, 0.9), (0.85, 1.0)) == "aaaa"
    assert followed((0.9, 1.0), (1.0, 0.9), (0.9, 1.0)) == "bbb"
    assert followed((1.0, 0.9), (0.5, 1.0), (1.0, 0.9), (1.0, 0.9 / BETTER)) == "abba"


def test_a_device_that_sees_nothing_loses_the_bone_at_once():
    assert followed((1.0, 0.9), (0.0, 0.1)) == "ab"


def test_every_bone_is_chosen_by_itself():
    chosen = {}
    first = best(
        [[point("a", 1.0), point("c", 0.1, "neck")], [point("b", 0.5), point("d", 0.5, "neck")]], chosen
    )
    assert [p.name for p in first] == ["a", "d"]
