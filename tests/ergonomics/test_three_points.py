"""Of a body of which a device sees head and hands only, legs and trunk are not scored."""

import pytest
from made_postures import PERSON
from test_rules import parts, station, table

from seerob.core.samples import BodyPoint, BodySample
from seerob.core.transforms import wxyz_from_rotation
from seerob.description.humans.posture import posture
from seerob.description.humans.skeleton import BONES, bone_poses
from seerob.session.run import Judge
from seerob.twin.engine import Engine

THREE = ("head", "left_hand", "right_hand")
PLACE = {"rula": ("trunk", "legs", "neck"), "reba": ("trunk", "legs", "neck")}


def judged_with(folder, bones, kind):
    stage = station(folder, '[[sources]]\nkind = "headset"\nhuman = "op"\n' + table(kind))
    rotations, places = bone_poses(PERSON, posture(PERSON, "standing"))
    points = tuple(
        BodyPoint(
            name=bone,
            bone=bone,
            at=(0.0, 0.0, 0.0),
            position=tuple(places[BONES.index(bone)].tolist()),
            wxyz=tuple(wxyz_from_rotation(rotations[BONES.index(bone)]).tolist()),
            position_weight=1.0,
            orientation_weight=1.0,
        )
        for bone in bones
    )
    engine = Engine(stage.model, driven={"op": 0.2})
    judge = Judge(stage.bound)
    result = None
    for k in range(8):
        sample = BodySample(source="headset", target="op", seq=k, t=k * 0.01, points=points)
        engine.take([sample])
        state = engine.start() if k == 0 else engine.tick()
        (result,) = judge(state)
    return parts(result)


@pytest.mark.parametrize("kind", PLACE)
def test_legs_and_trunk_of_a_headset_with_two_controllers_are_not_assessed(tmp_path, kind):
    few = judged_with(tmp_path / "three", THREE, kind)
    assert {name: few[name].value for name in PLACE[kind]} == dict.fromkeys(PLACE[kind])
    whole = judged_with(tmp_path / "all", BONES, kind)
    assert None not in {whole[name].value for name in PLACE[kind]}
