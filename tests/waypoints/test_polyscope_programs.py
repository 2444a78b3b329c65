"""PolyScope's tree: what is followed in it, and what is left out with its node path."""

import math

import pytest

from seerob.core.errors import InputError
from seerob.files.waypoints.urp import read_urp
from seerob.files.waypoints.waypoint import Move

TREE = """<URProgram name="p"><children><MainProgram runOnlyOnce="false"><children>
<Assignment><variable name="n"/><expression>{}</expression></Assignment>
<Assignment><variable name="pick"/><expression>{}</expression></Assignment>
<Loop type="Count" count="2"><children>{}</children></Loop>
<If type="If"><expression>{}</expression><children>{}</children></If>
<If type="Else"><children>{}</children></If>
<If type="If"><expression><ExpressionToken token="digital_in[1]"/></expression><children>{}</children></If>
<Folder name="work"><children><Force name="press"/><Popup/></children></Folder>
<Script type="File"><cachedContents>n = n - 1
movel(pose_trans(pick, p[0,0,0.1,0,0,0]), v=0.1)</cachedContents></Script>
<CallSubProgram><subprogram name="away"><children>{}</children></subprogram></CallSubProgram>
<Wait type="Sleep"><waitTime>0.5</waitTime></Wait>
<CallSubProgram><subprogram reference="../../CallSubProgram/subprogram"/></CallSubProgram>
</children></MainProgram></children></URProgram>"""


def spelled(text):
    return "".join(f'<ExpressionChar character="{c.replace("<", "&lt;")}"/>' for c in text)


def move(kind, *waypoints):
    inside = f"<children>{''.join(waypoints)}</children>"
    return f'<Move motionType="{kind}" speed="0.5" acceleration="1">{inside}</Move>'


def fixed(name, first):
    own = '<motionParameters jointSpeed="0.7" cartesianSpeed="0.07" blendRadius="0.01"/>'
    held = f'<JointAngles angles="{first}, 0, 0, 0, 0, 0"/><TCPOffset pose="0, 0, {first}, 0, 0, 0"/>'
    return f'<Waypoint type="Fixed" name="{name}">{own}<position>{held}</position></Waypoint>'


VARIABLE = '<Waypoint type="Variable" name="v"><variable name="pick"/></Waypoint>'


def tree(n="2", pick="p[0.4,0,0.3,0,0,0]"):
    return TREE.format(
        spelled(n), spelled(pick), move("MoveJ", fixed("a", 0.1)),
        spelled("n<3"), move("MoveL", VARIABLE), move("MoveL", fixed("never", 9)),
        move("MoveJ", fixed("in", 9)),
        move("MoveP", fixed("b", 0.2), f"<CircleMove>{fixed('via', 0.3)}{fixed('end', 0.4)}</CircleMove>"),
    ).encode()  # fmt: skip


def test_the_tree_is_followed_and_what_is_not_known_has_its_node_path():
    program = read_urp(tree(), "p.urp")
    again, other, variable, scripted, b, arc, *called = program.waypoints
    assert (again, again.speed, again.blend) == (other, 0.7, 0.01)
    assert (variable.move, variable.speed, variable.pose.position) == (Move.LINEAR, 0.5, (0.4, 0, 0.3))
    assert scripted.pose.position == pytest.approx((0.4, 0, 0.4))
    assert scripted.place == "MainProgram / Script, line 2"
    assert (b.speed, b.tool.position) == (0.07, (0, 0, 0.2))
    assert (arc.move, arc.via_q[0], arc.q[0], arc.pause) == (Move.CIRCULAR, 0.3, 0.4, 0.5)
    assert [w.q for w in called] == [b.q, arc.q]
    condition, force = program.left_out
    assert condition.startswith("MainProgram / If: `If` is left out: whether digital_in[1] holds")
    assert force.startswith("MainProgram / Folder 'work' / Force 'press': `Force` is left out")
    assert "Popup (1)" in " ".join(program.remarks)


def test_a_variable_waypoint_is_asked_for_by_its_name():
    asked = tree(pick="camera()")
    with pytest.raises(InputError, match=r"needs pick, which the program does not give") as caught:
        read_urp(asked, "p.urp")
    assert "MainProgram / If / Move 'MoveL' / Waypoint 'v'" in str(caught.value)
    program = read_urp(asked, "p.urp", {"pick": "p[1, 0, 0, 0, 0, pi]", "digital_in[1]": True})
    assert len(program.left_out) == 1
    assert (program.waypoints[3].q or ())[0] == 9
    w, *_, z = next(w.pose.wxyz for w in program.waypoints if w.pose is not None)
    assert (w, z) == pytest.approx((math.cos(math.pi / 2), 1))
