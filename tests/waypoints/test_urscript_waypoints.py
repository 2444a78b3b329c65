"""URScript: what is read, what is refused and where, and hostile text."""

import contextlib
import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from seerob.core.errors import InputError
from seerob.files.waypoints.urscript import FUNCTIONS, NotConstant, PoseValue, Reader, read_urscript, tokens
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


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("while True:", "`while`"),
        ("if x > 1:", "`if`"),
        ("thread t():", "`thread`"),
        ("movej(get_actual_joint_positions())", "'get_actual_joint_positions'"),
        ("movel(pose_trans(p[0,0,0,0,0,0], q))", "'pose_trans'"),
        ("servoj([0,0,0,0,0,0])", "not modelled"),
        ("speedl([0,0,0,0,0,0])", "not modelled"),
        ("force_mode(1)", "not modelled"),
        ("movej([0,0], 1, 1, 0, 0, 7)", "at most 5"),
        ("movej([0,0,0,0,0,0], v=-1)", "v = -1"),
        ("movel(p[0,0,0,0,0])", "5 numbers"),
        ("movec([0,0,0,0,0,0], p[0,0,0,0,0,0])", "constant poses"),
        ("movej([0,0,0,0,0,0], q=[0])", "given twice"),
        ("movej(1/0)", "division by zero"),
        ("x", "no statement"),
        ("sleep(-1)", "0 s or more"),
        ("movej([1e999,0,0,0,0,0])", "beyond all bounds"),
        ("movej([sqrt(0-1),0,0,0,0,0])", "no number"),
    ],
)
def test_what_only_a_controller_knows_is_named_with_its_line(line, said):
    with pytest.raises(InputError) as caught:
        read_urscript(f"movej([0,0,0,0,0,0])\n{line}\n".encode(), "a.script")
    (problem,) = caught.value.problems
    assert problem.key == "line 2"
    assert said in problem.what
    assert problem.remedy


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
    assert (a.move, a.near) == (Move.JOINT, (-1.6006, -1.7271, -2.2029, -0.8079, 1.5951, -0.0309))
    assert a.pose == b.pose
    assert (b.move, b.speed, b.near) == (Move.LINEAR, 0.1, None)
    said = " ".join(program.remarks)
    assert "read as one round" in said
    assert "def (1), grip (1), if (1), run (1), thread (1), while (1)" in said


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        ("x = movej(q)", "line 3: `movej`: what moves the robot stands in a statement of its own"),
        ("log(movel(q))", "line 3: `log`: moves the robot in a way that is not modelled"),
        ("if (x):|movej(q)|end", "line 3: `if`"),
        ("for_each(movec(q))", "line 3: `for_each`"),
        ("def away():|movej(q)|end|away()", "line 3: `def`"),
        ("thread t():|movej(q)|end", "line 3: `thread`"),
        ("if (x):|return|end|movej(q)", "line 3: `if`"),
        ("if (x):|while True:|sync()|end|end|movej(q)", "line 3: `if`"),
        ("if (x):|set_tcp(p[0,0,0,0,0,0])|end|movej(q)", "line 3: `if`"),
        ("if (x):|q = [1,0,0,0,0,0]|end|movej(q)", "line 6: `movej`: 'q' is not a constant"),
        ("thread t():|q = 1|end|q = [0,0,0,0,0,1]|movej(q)", "line 7: `movej`: 'q' is not a constant"),
        ("while True:|sync()|end|movej(q)", "line 6: `movej`: stands behind a loop that never ends"),
        ("while True:|while (x):|movej(q)|end|end", "line 4: `while`"),
        ("while True:|movej(q)", "line 3: `while`: its `end` is missing"),
        ("if (x):|y = 1", "line 3: `if`: its `end` is missing"),
        ("movej(get_inverse_kin(p[0,0,0,0,0,0]))", "constant qnear"),
        ("movej(get_inverse_kin(q, q))", "a constant pose"),
        ("movej(get_inverse_kin(p[0,0,0,0,0,0], q, tcp=p[0,0,0,0,0,0]))", "another tool point"),
    ],
)
def test_nothing_that_moves_is_passed_over(lines, said):
    text = "\n".join(["q = [0,0,0,0,0,0]", "movej([0,0,0,0,0,2])", *lines.split("|")])
    with pytest.raises(InputError) as caught:
        read_urscript(text.encode(), "a")
    assert said in str(caught.value)


def test_a_name_that_is_no_constant_matters_only_where_it_is_needed():
    text = "x = read_sensor()\nmovej([0,0,0,0,0,1])\n"
    assert len(read_urscript(text.encode(), "a").waypoints) == 1
    with pytest.raises(InputError, match="line 3: `movej`: 'x' is not a constant"):
        read_urscript((text + "movej(x)").encode(), "a")


def test_a_tool_point_that_changes_on_the_way_is_refused():
    text = b"set_tcp(p[0,0,0,0,0,0])\nmovej([0,0,0,0,0,0])\nset_tcp(p[0,0,1,0,0,0])"
    with pytest.raises(InputError, match="changes the tool point"):
        read_urscript(text, "a")


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
    assert set(FUNCTIONS) == {"d2r", "r2d", "sqrt", "sin", "cos"}
    assert Reader(tokens("2 * (3 - 1) / -d2r(180)"), {}).value() == pytest.approx(-4 / math.pi)
    with pytest.raises(NotConstant):
        Reader(tokens("[1, [2]]"), {}).value()
