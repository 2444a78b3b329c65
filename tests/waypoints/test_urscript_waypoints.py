"""URScript: what is read, what is refused and where, and hostile text."""

import contextlib
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from seerob.core.errors import InputError
from seerob.files.waypoints.urscript import FUNCTIONS, NotKnown, PoseValue, Reader, read_urscript, tokens
from seerob.files.waypoints.waypoint import Move

PROGRAM = """
def cell():
  # set_tcp(p[9,9,9,9,9,9])
  set_tcp(p[0, 0, 0.15, 0, 0, 0])
  global home = [0, -1.2, d2r(90), -pi/2, -1.5, 0]
  h = 0.3
  movej(home, a=1.2, v=0.9)
  movel(p[0.5, 0.1, h + 2*0.05, 0, 3.14, 0], 0.8, 0.2, 0, 0.02)
  sleep(0.5)
  sleep(0.25)
  movep(p[0.5, 0.2, h, 0, 3.14, 0], r=0.01)
  movec(p[0.6, 0.2, h, 0, 3.14, 0], p[0.6, 0.1, h, 0, 3.14, 0], v=0.1)
  textmsg("movej([0])  # not a comment")
  set_digital_out(1, True)
  movej(p[0.5, 0.1, 0.4, 0, 3.14, 0], t=3)
end
"""


def test_moves_with_constants():
    program = read_urscript(PROGRAM.encode(), "cell.script")
    a, b, c, d, e = program.waypoints
    assert program.controller
    assert program.tcp is not None
    assert program.tcp.position == (0, 0, 0.15)
    assert a.q == pytest.approx((0, -1.2, math.pi / 2, -math.pi / 2, -1.5, 0))
    assert (a.speed, a.acceleration, a.place) == (0.9, 1.2, "line 7")
    assert (b.move, b.speed, b.acceleration, b.blend, b.pause) == (Move.LINEAR, 0.2, 0.8, 0.02, 0.75)
    assert b.pose is not None
    assert b.pose.position == pytest.approx((0.5, 0.1, 0.4))
    assert b.pose.wxyz == pytest.approx((math.cos(1.57), 0, math.sin(1.57), 0))
    # The defaults of the language.
    assert (c.move, c.speed, c.acceleration, c.blend) == (Move.PROCESS, 0.25, 1.2, 0.01)
    assert d.move is Move.CIRCULAR
    assert d.via is not None
    assert d.via.position == (0.6, 0.2, 0.3)
    assert (e.move, e.duration, e.speed) == (Move.JOINT, 3.0, 1.05)
    assert "set_digital_out (1), textmsg (1)" in " ".join(program.remarks)


def told(text, values=None):
    """What is said of a program: parts that were left out, or what it needs."""
    try:
        return " ".join(read_urscript(text.encode(), "a.script", values).left_out)
    except InputError as error:
        return str(error)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("while True:", "`while`"),
        ("if x > 1:", "`if`"),
        ("thread t():", "`thread`"),
        ("movej(camera(1, x))", "needs camera(1,x), which the program does not give; give it"),
        ("movel(pose_trans(p[0,0,0,0,0,0], q))", "needs q"),
        ("servoj([0,0,0,0,0,0])", "not modelled"),
        ("speedl([0,0,0,0,0,0])", "not modelled"),
        ("force_mode(1)", "not modelled"),
        ("movej([0,0], 1, 1, 0, 0, 7)", "at most 5"),
        ("movej([0,0,0,0,0,0], v=-1)", "v = -1"),
        ("movel(p[0,0,0,0,0])", "5 numbers"),
        ("movec(3, p[0,0,0,0,0,0])", "via must be"),
        ("movej([0,0,0,0,0,0], q=[0])", "given twice"),
        ("movej(1/0)", "division by zero"),
        ("x", "no statement"),
        ("sleep(-1)", "0 s or more"),
        ("movej([1e999,0,0,0,0,0])", "beyond all bounds"),
        ("movej([sqrt(0-1),0,0,0,0,0])", "no number"),
        ("movej([0,0,[1],0,0,0][1:2])", "is missing"),
    ],
)
def test_what_only_a_controller_knows_is_named_with_its_line(line, said):
    found = told(f"movej([0,0,0,0,0,0])\n{line}\n")
    assert "line 2" in found
    assert said in found


EXPORTED = """
def Unnamed():
  step_count = 0.0
  thread Step_Counter_Thread():
    while (True):
      step_count = step_count + 1.0
      sync()
    end
  end
  run Step_Counter_Thread()
  def grip(width, force=40):
    if (width > 0):
      return True
    end
    return False
  end
  global Above_p=p[.117, -.364, .451, -.001, 3.116, .039]
  global Above_q=[-1.6006, -1.7271, -2.2029, -0.8079, 1.5951, -0.0309]
  while (True):
    $ 1 "Robot Program"
    $ 3 "Above" "breakAfter"
    movej(get_inverse_kin(Above_p, qnear=Above_q), a=1.4, v=1.05)
    while (get_standard_digital_in(0) == False):
      sync()
    end
    grip(20)
    if (step_count > 3):
      counted = 0
    elif (step_count > 2):
      textmsg("movej(nowhere)")
    else:
      counted = 1
    end
    movel(Above_p, v=0.1)
  end
end
"""


def test_a_program_as_polyscope_exports_it_is_one_round_of_its_moves():
    program = read_urscript(EXPORTED.encode(), "cell.script")
    a, b = program.waypoints
    assert program.left_out == ()
    assert (a.move, a.near) == (Move.JOINT, (-1.6006, -1.7271, -2.2029, -0.8079, 1.5951, -0.0309))
    assert a.place == "line 22 (node 3 Above)"
    assert a.pose == b.pose
    assert (b.move, b.speed, b.near) == (Move.LINEAR, 0.1, None)
    said = " ".join(program.remarks)
    assert "read as one round" in said
    assert "set_standard" not in said
    assert "run (1), thread (1), while (1)" in said


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        ("x = movej(q)", "line 3: `x = movej(q)` is left out: movej moves the robot inside"),
        (
            "log(movel(q))",
            "line 3: `log(movel(q))` is left out: moves the robot in a way that is not modelled",
        ),
        ("if (x):|movej(q)|end", "line 3: `if` is left out: whether (x) holds only a controller knows"),
        ("for_each(movec(q))", "line 3: `for_each"),
        ("def away():|movej(q)|servoj(q)|end|away()", "line 5: `servoj(q)` is left out"),
        ("thread t():|movej(q)|end", "line 3: `thread`"),
        ("if (x):|return|end|movej(q)", "line 3: `if`"),
        ("if (x):|while True:|sync()|end|end|movej(q)", "line 3: `if`"),
        ("if (x):|set_tcp(p[0,0,0,0,0,0])|end|movej(q)", "line 3: `if`"),
        ("if (x):|q = [1,0,0,0,0,0]|end|movej(q)", "line 6: `movej(q)` needs q"),
        ("thread t():|q = 1|end|q = [0,0,0,0,0,1]|movej(q)", "line 7: `movej(q)` needs q"),
        ("while True:|while (x):|movej(q)|end|end", "line 4: `while`"),
        ("while True:|movej(q)", "line 3: `while`: its `end` is missing"),
        ("if (x):|y = 1", "line 3: `if`: its `end` is missing"),
        ("movej(get_inverse_kin(p[0,0,0,0,0,0]))", "constant qnear"),
        ("movej(get_inverse_kin(q, q))", "a constant pose"),
        ("movej(get_inverse_kin(p[0,0,0,0,0,0], q, tcp=p[0,0,0,0,0,0]))", "another tool point"),
        ("servoj(q)|x = get_actual_joint_positions()|movej(x)", "needs x"),
    ],
)
def test_nothing_that_moves_is_passed_over(lines, said):
    assert said in told("\n".join(["q = [0,0,0,0,0,0]", "movej([0,0,0,0,0,2])", *lines.split("|")]))


KNOWN = """
places = [p[0.1,0,0,0,0,0], p[0.2,0,0,0,0,0]]
step = p[0, 0, 0.05, 0, 0, 0]
count = 0
def over(pose, up=0.1):
  height = pose_trans(pose, p[0, 0, up, 0, 0, 0])
  movel(height, v=0.3)
  return height
end
while count < length(places):
  last = over(places[count])
  count = count + 1
end
if count == 2 and not False:
  movel(over(places[0], up=0.2), v=0.4)
elif unheard():
  movel(nowhere)
end
step[2] = 0.5
while True:
  count = count - 1
  movep(pose_add(step, places[1]))
  if count <= 0:
    break
  end
end
set_tcp(p[0, 0, 0.1, 0, 0, 0])
movec([0,0,0,0,0,1], pose_inv(p[0,0,-1,0,0,0]))
movel(interpolate_pose(p[0,0,0,0,0,0], p[1,0,0,0,0,pi], 0.25))
movej(get_actual_joint_positions())
"""


def test_variables_functions_loops_and_poses_are_followed():
    program = read_urscript(KNOWN.replace("movej(get", "movej([0,0,0,0,0,1])\nmovej(get").encode(), "a")
    assert program.left_out == ()
    places = [w.pose.position for w in program.waypoints if w.pose is not None]
    expected = [(0.1, 0, 0.1), (0.2, 0, 0.1), (0.1, 0, 0.2), (0.1, 0, 0.2), (0.2, 0, 0.5), (0.2, 0, 0.5)]
    assert [tuple(np.round(p, 9)) for p in places] == [*expected, (0, 0, 1), (0.25, 0, 0)]
    assert program.waypoints[-1].q == (0, 0, 0, 0, 0, 1)
    turned = program.waypoints[-3].pose.wxyz
    np.testing.assert_allclose(turned, np.roll(Rotation.from_euler("z", 45, degrees=True).as_quat(), 1))
    assert program.waypoints[6].via_q == (0, 0, 0, 0, 0, 1)
    assert [w.tool is None for w in program.waypoints] == [True] * 6 + [False] * 4


@settings(max_examples=30, deadline=None)
@given(st.lists(st.floats(-3, 3), min_size=12, max_size=12))
def test_arithmetic_on_poses_is_that_of_another_library(numbers):
    a, b = numbers[:6], numbers[6:]
    turns = [Rotation.from_rotvec(v[3:]) for v in (a, b)]
    of = {
        "pose_trans": (np.add(a[:3], turns[0].apply(b[:3])), turns[0] * turns[1]),
        "pose_add": (np.add(a[:3], b[:3]), turns[0] * turns[1]),
        "pose_inv": (-turns[0].inv().apply(a[:3]), turns[0].inv()),
    }
    for name, (position, turn) in of.items():
        both = "" if name == "pose_inv" else f", p{b}"
        found = Reader(tokens(f"{name}(p{a}{both})"), {}).whole()
        np.testing.assert_allclose(found.numbers[:3], position, atol=1e-9)
        off = Rotation.from_rotvec(found.numbers[3:]) * turn.inv()
        assert off.magnitude() < 1e-7


def test_a_goal_that_the_program_does_not_give_is_asked_for_and_taken():
    text = b"pick = camera()\nmovel(pick)\nif get_standard_digital_in(3):\n  movej([0,0,0,0,0,1])\nend\n"
    with pytest.raises(InputError, match=r"`movel\(pick\)` needs pick.*values = \{ pick = … \}"):
        read_urscript(text, "a")
    values = {"pick": "p[0.4, 0, 0.3, 0, pi, 0]"}
    program = read_urscript(text, "a", values)
    assert program.waypoints[0].pose.position == (0.4, 0, 0.3)
    assert [s.split(":")[0] for s in program.left_out] == ["line 3"]
    known = read_urscript(text, "a", values | {"get_standard_digital_in(3)": True})
    assert (len(known.waypoints), known.left_out) == (2, ())


@pytest.mark.parametrize("text", [b"", b"def a():\nend", b"\xff\xfe\x00", b"x = 3"])
def test_nothing_to_go_to(text):
    with pytest.raises(InputError):
        read_urscript(text, "a")


@pytest.mark.parametrize(
    "text", ["movej(" + "(" * 3000, "movej(" + "[" * 3000, "movej(" + "1+" * 9000, "a" * 9000]
)
def test_deep_and_long_statements_end_with_an_error(text):
    with pytest.raises(InputError):
        read_urscript(text.encode(), "a")


@settings(max_examples=200, deadline=None)
@given(st.text(alphabet="movejlpc()[]=,.0123456789+-*/ \n\"'#abdefq:", max_size=200))
def test_no_text_does_anything_but_parse_or_raise_an_input_error(text):
    with contextlib.suppress(InputError):
        read_urscript(text.encode(), "a")


@settings(max_examples=100, deadline=None)
@given(st.lists(st.floats(-1e3, 1e3), min_size=6, max_size=6))
def test_numbers_come_out_as_python_reads_them(numbers):
    text = "p[" + ", ".join(map(repr, numbers)) + "]"
    assert Reader(tokens(text), {}).value() == PoseValue(tuple(numbers))


def test_functions_are_the_few_that_are_constant():
    assert {"d2r", "pose_trans", "get_inverse_kin"} < set(FUNCTIONS)
    assert Reader(tokens("2 * (3 - 1) / -d2r(180)"), {}).value() == pytest.approx(-4 / math.pi)
    assert Reader(tokens("[1, [2]][1][0]"), {}).value() == 2
    with pytest.raises(NotKnown):
        Reader(tokens("[1, [2]][2]"), {}).value()


def test_a_function_that_moves_nothing_may_return_early_and_then_says_nothing():
    text = """def clear(x):
  if heard():
    return 0
  end
  return 1
end
place = clear(
  1
)
rpc.call(1)
movej([0,0,0,0,0,1])
movej([place,0,0,0,0,1])
"""
    assert "needs place" in told("main = 1\n" + text)
    assert told("main = 1\n" + text, {"place": 2}) == ""
