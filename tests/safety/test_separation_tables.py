"""Speed and separation of a robot that stops by its maker's table: by hand, and what is unknown."""

from __future__ import annotations

import numpy as np
import pytest

from made_cell import UR10, basis_in, made, results_at
from made_separation import HEAD, JOINT, KNOWN, PERSON, TABLE, V, separation, terms
from seerob.core.errors import InputError


def test_table_by_hand_with_levers(tmp_path):
    """Only the base turns: 0.1 rad while reacting and the table's 0.4 rad, but at most 1 rad/s · 0.3 s."""
    S = separation(tmp_path, TABLE)
    S_s = 0.4 * V - 0.1 * V
    assert terms(S)[:3] == pytest.approx([1.6 * 0.4, 0.1 * V, S_s])
    assert any(
        "the lesser of its first way and speed times time" in t for t in basis_in(tmp_path).not_modelled
    )


def test_table_at_full_speed(tmp_path):
    """At 3 rad/s the tabulated 0.4 rad is less than 3 · 0.3."""
    S = separation(tmp_path, TABLE, qd=(3.0, 0.0), x=9.0)
    assert terms(S)[:3] == pytest.approx([1.6 * 0.4, 0.3 * V, 0.4 * V])


def test_table_bounds_both_joints_and_the_longer_time_counts(tmp_path):
    S = separation(tmp_path, TABLE, qd=(1.0, -2.0), x=9.0)
    outer = (0.2 + 0.2) * np.hypot(1, 0.05)
    total = outer + 0.4 * (V + outer)
    assert terms(S)[0] == pytest.approx(1.6 * 0.4)
    assert terms(S)[1] + terms(S)[2] == pytest.approx(total)


def test_table_is_undecided_above_its_speed_or_payload_and_without_a_mass(tmp_path):
    fast = separation(tmp_path / "v", TABLE, qd=(3.1, 0.0), x=11.0)
    assert fast.verdict == "undecided"
    assert "speed is 1.03" in fast.reason
    tool = '[[tools]]\nname = "t"\non = "arm/tip"\nshape = { box = [0.1, 0.1, 0.1] }\n'
    heavy = separation(tmp_path / "m", TABLE, more=tool + "mass = 5.1\n", x=11.0)
    assert "payload is 1.02" in heavy.reason
    unknown = separation(tmp_path / "u", TABLE, more=tool, x=11.0)
    assert unknown.verdict == "undecided"
    assert "mass" in unknown.reason
    light = separation(tmp_path / "l", TABLE, more=tool + "mass = 4.9\n", x=11.0)
    assert light.verdict == "within"


def test_joint_without_a_table_needs_a_stopping_time(tmp_path):
    one = TABLE.replace(", " + JOINT.format(j=1, way=0.2, time=0.1), "")
    unknown = separation(tmp_path / "u", one, qd=(1.0, 1.0), x=11.0)
    assert unknown.verdict == "undecided"
    assert "j2" in unknown.reason
    given = separation(tmp_path / "g", one + ", stopping = 0.5", qd=(0.0, 1.0), x=11.0)
    arm = np.hypot(1, 0.05)
    assert terms(given)[:3] == pytest.approx([1.6 * 0.6, 0.1 * arm, 0.5 * arm])


UR10_TABLE = 'acceleration = 0, reaction = 0.1, model = "table", table = "ur10_cb3"'


def test_table_by_tool_speed_is_undecided_above_its_payload_and_without_a_mass(tmp_path):
    tool = '[[tools]]\nname = "t"\non = "arm/tip"\nshape = { box = [0.1, 0.1, 0.1] }\n'
    stop = UR10_TABLE + ', table_for = "arm"'
    heavy = separation(tmp_path / "h", stop, more=tool + "mass = 15\n", x=11.0)
    assert (heavy.verdict, "payload is 1.5" in heavy.reason) == ("undecided", True)
    unknown = separation(tmp_path / "u", stop, more=tool, x=11.0)
    assert (unknown.verdict, "mass" in unknown.reason) == ("undecided", True)
    light = separation(tmp_path / "l", stop, more=tool + "mass = 9.9\n", x=11.0)
    assert light.verdict == "within"
    inputs = {i.name: i.value for i in basis_in(tmp_path / "l").inputs}
    assert inputs["payload of arm"] == pytest.approx(9.9)
    assert inputs["rated payload of the stopping table"] == 10.0


@pytest.mark.parametrize("stop", [UR10_TABLE, TABLE.replace('robot = "arm"', 'robot = "another"')])
def test_table_of_another_robot_keeps_nothing_within_unless_the_file_says_so(tmp_path, stop):
    far = separation(tmp_path / "far", stop, x=11.0)
    assert (far.verdict, "stop.table_for" in far.reason) == ("undecided", True)
    assert separation(tmp_path / "near", stop, x=3.0).verdict == "exceeded"
    said = separation(tmp_path / "said", stop + ', table_for = "arm"', x=11.0)
    assert said.verdict == "within"
    assert any(
        (i.name, i.origin) == ("stopping table is of", "given") for i in basis_in(tmp_path / "said").inputs
    )


def test_table_of_the_librarys_robot_is_known_to_be_its_own(tmp_path):
    q = ([0.0, -1.2, 1.4, -1.5, -1.5, 0.0], [0.3, 0, 0, 0, 0, 0])
    for model, verdict in (("ur10", "within"), ("ur10e", "undecided")):
        text = UR10.replace("library:ur10", f"library:{model}") + PERSON.format(x=11.0)
        text += f'[[safety]]\nkind = "separation"\nname = "S"\nbetween = ["arm", "op"]\n{KNOWN}'
        cell = made(tmp_path / model, text + f"stop = {{ {UR10_TABLE} }}\n")
        assert results_at(cell, arm=q)["S"].verdict == verdict


@pytest.mark.parametrize("scale", [1.01, 0.5])
def test_table_of_the_librarys_robot_is_none_of_one_of_another_size(tmp_path, scale):
    q = ([0.0, -1.2, 1.4, -1.5, -1.5, 0.0], [0.05, 0, 0, 0, 0, 0])
    text = UR10.replace('"library:ur10"', f'"library:ur10"\nscale = {scale}') + PERSON.format(x=11.0)
    text += f'[[safety]]\nkind = "separation"\nname = "S"\nbetween = ["arm", "op"]\n{KNOWN}'
    found = results_at(made(tmp_path, text + f"stop = {{ {UR10_TABLE} }}\n"), arm=q)["S"]
    assert (found.verdict, f"library:ur10, × {scale:g}" in found.reason) == ("undecided", True)


def test_table_without_a_payload_gives_its_printed_figures_once_the_file_says_which(tmp_path):
    """First axis of the shipped KUKA table: 30.47° in 0.38 s at full speed, here that of the UR10's base."""
    full = np.radians(120)
    q = ([0.0, -1.2, 1.4, -1.5, -1.5, 0.0], [full, 0, 0, 0, 0, 0])
    found = {}
    for key in ("", ", rated_payload = 20.0"):
        stop = 'acceleration = 0, reaction = 0.1, model = "table", table = "kuka_kr20_r3100"'
        stop += f', table_for = "arm"{key}'
        text = UR10 + PERSON.format(x=11.0)
        text += f'[[safety]]\nkind = "separation"\nname = "S"\nbetween = ["arm", "op"]\n{KNOWN}'
        found[key] = results_at(made(tmp_path / str(len(key)), text + f"stop = {{ {stop} }}\n"), arm=q)["S"]
    assert found[""].verdict == "undecided"
    assert "give stop.rated_payload" in found[""].reason
    S = found[", rated_payload = 20.0"]
    S_h, S_r, S_s = terms(S)[:3]
    assert S_h == pytest.approx(1.6 * (0.1 + 0.38))
    # Its lever is bounded by the corners of the link's box, its speed found at its vertices.
    assert S_s >= S_r * np.radians(30.47) / (full * 0.1) - 1e-4
    assert S_s == pytest.approx(S_r * np.radians(30.47) / (full * 0.1), rel=0.1)
    assert any(
        (i.value, i.origin) == (20.0, "given")
        for i in basis_in(tmp_path / str(len(", rated_payload = 20.0"))).inputs
        if "rated payload" in i.name
    )


def test_payload_of_a_table_that_says_its_own_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"5 kg.*leave it out"):
        separation(tmp_path, TABLE + ", rated_payload = 6.0")


def test_table_by_tool_speed(tmp_path):
    S = separation(tmp_path, UR10_TABLE, x=9.0)
    T_s = 0.55 + 0.1 * (V - 2)
    assert terms(S)[:3] == pytest.approx([1.6 * (0.1 + T_s), 0.1 * V, T_s * V])


@pytest.mark.parametrize(
    ("way", "time", "full", "verdict"),
    [
        (0.9, 0.3, "full_speed = 3.0, ", "within"),
        (0.95, 0.3, "full_speed = 3.0, ", "undecided"),
        # By the robot's own limit of 10 rad/s where the table says none.
        (3.0, 0.3, "", "within"),
        (4.0, 0.3, "", "undecided"),
    ],
)
def test_a_way_longer_than_at_full_speed_for_all_of_its_time_is_no_table(tmp_path, way, time, full, verdict):
    """Of way and speed times time the lesser counted: a time in another unit made every stop short."""
    joint = "{{ joint = {j}, {full}way = [[[{way}]]], time = [[[{time}]]] }}"
    joints = ", ".join(joint.format(j=j, full=full, way=way, time=time) for j in range(2))
    head = f"{HEAD}, rated_payload = 5.0, joints = [{joints}]"
    stop = f'acceleration = 0, reaction = 0.1, model = "table", table_for = "arm", table = {{ {head} }}'
    found = separation(tmp_path, stop, x=8.0)
    assert found.verdict == verdict
    assert ("contradicts itself" in found.reason) is (verdict != "within")
