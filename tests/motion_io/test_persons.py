"""Numbers of persons change, persons do not."""

import numpy as np
import pytest

from seerob.core.errors import InputError
from seerob.files.motion_capture.persons import Follower, numbers
from seerob.protocols.tracking.kinect import Body, Picture


def body(number, x):
    return Body(number, np.tile([x, 0.0, 0.0], (32, 1)), None, None)


def followed(*pictures, subject=""):
    follower = Follower(subject)
    scenes = (Picture(t=k / 30, bodies=tuple(body(*b) for b in bodies)) for k, bodies in enumerate(pictures))
    return follower, [None if b is None else b.positions[0, 0] for b in map(follower.choose, scenes)]


def test_exchanged_numbers_are_followed_by_place():
    walk = [[(1, 0.01 * k), (2, 3 - 0.01 * k)] for k in range(10)]
    exchanged = [[(2, 0.01 * k), (1, 3 - 0.01 * k)] for k in range(10, 20)]
    follower, x = followed(*walk, *exchanged, subject="1")
    np.testing.assert_allclose(x, 0.01 * np.arange(20))
    assert len(follower.exchanged) == 1


def test_a_person_who_comes_back_with_a_new_number_is_the_same_when_alone():
    follower, x = followed([(1, 0.0)], [], [], [(4, 0.1)])
    assert x == [0.0, None, None, 0.1]
    assert [number for _, number in follower.renamed] == [4]


def test_of_several_the_one_near_by_is_taken_and_else_nobody():
    follower, x = followed([(1, 0.0)], [(5, 2.0), (6, 0.1)], [(7, 2.0), (8, 4.0)])
    assert x == [0.0, 0.1, None]
    assert len(follower.crowded) == 1


def test_a_jump_without_anybody_in_the_old_place_is_passed_on():
    # Whether a person can be that fast is judged where speeds are known.
    assert followed([(1, 0.0)], [(1, 4.0)], subject="1")[1] == [0.0, 4.0]


@pytest.mark.parametrize("text", ["x", "1;2", "1,,2"])
def test_a_number_that_is_none_is_refused(text):
    with pytest.raises(InputError, match="is no number of a body"):
        numbers(text)
