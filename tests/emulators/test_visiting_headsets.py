"""An emulated headset of one who looks on is seen by others, where and how large they stand."""

import numpy as np
import pytest

from seerob.app.emulation.mvn_person import animated
from seerob.app.emulators.headset import Headset, in_world, seen
from seerob.core.errors import InputError

LOOKS_ON = {"human": "", "name": "B", "scale": 0.1, "stands": "0.45 -0.2 0.75"}


def test_head_and_hands_are_where_the_room_stands_at_its_scale():
    visitor = Headset(**LOOKS_ON).ready().server
    introduction = visitor._introduction
    assert (introduction.name, introduction.device, introduction.scale) == ("B", "vr", 0.1)
    names, poses = seen(animated("library:reach"), body=False)(0.0)
    world = in_world(poses, introduction)
    head = dict(zip(names, world, strict=True))["viewer"]
    own = dict(zip(names, poses, strict=True))["viewer"]
    # y of the room is up; a person of 1.7 m is a tenth of that, above a floor at 0.75 m.
    assert head[2] == pytest.approx(0.75 + 0.1 * own[1])
    assert head[:2] == pytest.approx([0.45 + 0.1 * own[0], -0.2 - 0.1 * own[2]])
    assert np.linalg.norm(world[:, 3:], axis=1) == pytest.approx(np.ones(len(world)))


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"name": ""}, "needs a --name"),
        ({"grabs": "1 right_hand a"}, "has no hands"),
        ({"stands": "1 2"}, "no place"),
    ],
)
def test_what_makes_no_visitor_is_said(given, said):
    with pytest.raises((InputError, ValueError), match=said):
        Headset(**{**LOOKS_ON, **given}).ready()
