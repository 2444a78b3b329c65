"""Reachable volumes of odd chains: axes askew, joints that follow one without limits."""

from __future__ import annotations

import numpy as np
import pytest

from made_cell import TWO_R, made
from made_sweep import outside
from seerob.core.errors import InputError
from seerob.model.volumes.reachable import reachable_volume

BOX = '<collision><origin xyz="0.1 0.1 0"/><geometry><box size="{}"/></geometry></collision>'
LIMIT = '<limit lower="{}" upper="{}" effort="1" velocity="1"/>'
ENDLESS = '<limit effort="1" velocity="1"/>'


def chain(folder, *joints, more=""):
    """Boxes in a row: kind, origin, axis and the rest of each joint."""
    text = '<robot name="arm"><link name="l0"/>'
    for k, (kind, origin, axis, rest) in enumerate(joints, 1):
        text += f'<link name="l{k}">{BOX.format("0.3 0.1 0.2" if k == 1 else "0.2 0.2 0.1")}</link>'
        text += f'<joint name="j{k}" type="{kind}"><parent link="l{k - 1}"/><child link="l{k}"/>'
        text += f'<origin {origin}/><axis xyz="{axis}"/>{rest}</joint>'
    return made(folder, TWO_R + more, {"arm.urdf": f"{text}</robot>"}).model


def test_layers_that_are_empty_after_the_cut_to_what_can_be_reached(tmp_path):
    """Their fine voxels go on beyond the coarse ones of the whole."""
    tool = '[[tools]]\nname = "t"\non = "arm/l2"\nshape = { capsule = [0.03, 0.2] }\n'
    model = chain(
        tmp_path,
        ("revolute", 'xyz="0.3 0.2 0.3" rpy="-0.3 -0.7 0"', "0.9 0.4 0", LIMIT.format(-0.58, 0.72)),
        ("prismatic", 'xyz="0.4 -0.2 0.3" rpy="1.8 1.5 0"', "0.7 -0.6 -0.2", LIMIT.format(-0.24, 0.68)),
        more=tool + "at = { position = [0.1, 0.2, 0] }\nmass = 1\n",
    )
    reach = reachable_volume(model, model.select("arm"), voxel=0.08)
    assert outside(model, reach.grid.contains, 60, np.random.default_rng(0)) == 0


FOLLOWS = '<mimic joint="j1" multiplier="2.0" offset="0.1"/>'


def test_a_slide_that_follows_an_endless_turn_goes_as_far_as_its_own_limits(tmp_path):
    """From -0.2 to 0.7 m of the second box along the axis that it turns about: 0.9 m and its height."""
    model = chain(
        tmp_path,
        ("continuous", 'xyz="0 0 0"', "0 0 1", ENDLESS),
        ("prismatic", 'xyz="0 0 0"', "0 0 1", FOLLOWS + LIMIT.format(-0.2, 0.7)),
    )
    reach = reachable_volume(model, model.select("arm/l2"), voxel=0.02)
    low, high = reach.grid.bounds()
    spans = low[2] * 0.02, (high[2] + 1) * 0.02
    assert spans[0] <= -0.25
    assert spans[1] >= 0.75
    assert spans == pytest.approx((-0.25, 0.75), abs=0.1)


def test_without_limits_of_its_own_either_it_is_refused(tmp_path):
    model = chain(
        tmp_path,
        ("continuous", 'xyz="0 0 0"', "0 0 1", ENDLESS),
        ("prismatic", 'xyz="0 0 0"', "0 0 1", FOLLOWS + ENDLESS),
    )
    with pytest.raises(InputError, match="a joint that slides has no limits"):
        reachable_volume(model, model.select("arm"), voxel=0.05)
