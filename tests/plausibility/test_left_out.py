"""A robot's description holds more than a tree of joints: what rests on it is not within until confirmed."""

from __future__ import annotations

import pytest

from made_cell import made, results_at

ARM = """<mujoco model="arm"><worldbody><body name="base">
  <geom type="box" size="0.05 0.05 0.05" mass="2"/>
  <body name="upper" pos="0 0 0.1"><joint name="a" axis="0 1 0" range="-3 3"/>
    <geom type="box" size="0.02 0.02 0.1" pos="0 0 0.1" mass="1"/>
    <body name="fore" pos="0 0 0.2"><joint name="b" axis="0 1 0" range="-3 3"/>
      <geom type="box" size="0.02 0.02 0.1" pos="0 0 0.1" mass="1"/>
    </body></body>
  <body name="rod" pos="0.1 0 0.1"><joint name="c" axis="0 1 0" range="-3 3"/>
    <geom type="box" size="0.01 0.01 0.1" pos="0 0 0.1" mass="0.2"/></body>
</body></worldbody>{equality}</mujoco>"""
LOOP = '<equality><connect body1="fore" body2="rod" anchor="0 0 0.1"{more}/></equality>'
CELL = """
[[robots]]
name = "arm"
model = "arm.xml"
[[safety]]
kind = "velocity"
name = "v"
at = "arm"
limit = 5.0
"""
CONFIRMED = '[[confirmed]]\nkey = "robots[0].constraints_left_out"\nof = "arm"\nvalue = 1\nwhy = "a dummy"\n'


@pytest.mark.parametrize(
    ("equality", "confirmed", "verdict"),
    [
        ("", "", "within"),
        (LOOP.format(more=""), "", "undecided"),
        (LOOP.format(more=' active="false"'), "", "within"),
        (LOOP.format(more=""), CONFIRMED, "within"),
        (LOOP.format(more="") + LOOP.format(more=""), CONFIRMED, "undecided"),
    ],
)
def test_a_loop_that_is_left_out_holds_what_rests_on_the_robot(tmp_path, equality, confirmed, verdict):
    cell = made(tmp_path, CELL + confirmed, {"arm.xml": ARM.format(equality=equality)})
    found = results_at(cell, arm=((0.1, 0.1, 0.1), (0.0, 0.0, 0.0)))["v"]
    assert found.verdict == verdict
    assert ("equality of kind connect" in found.reason) == (verdict == "undecided")
