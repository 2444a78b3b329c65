"""How far somebody walked in a field before the device saw them, and until its output had switched."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from made_cell import FLOATING, TWO_R, made, results_at, state_at, two_r
from seerob.criteria.figure import verdict_of
from seerob.criteria.sensors.sensing import Presence, Seen, Sight
from seerob.recording.series import CODES

MAT = '[[sensors]]\nname = "mat"\n{more}pressure_mat = {{ corners = [[0, 0], [1, 0], [1, 1], [0, 1]] }}\n'
BOX = '[[parts]]\nname = "{name}"\nshape = {{ box = [0.1, 0.1, 0.1] }}\n'


def walked(folder, steps, more="response = 0.25\n"):
    """Ways after each step of (instant, x of one, x of two, inside, triggered)."""
    text = MAT.format(more=more) + BOX.format(name="one") + BOX.format(name="two")
    model = made(folder, text).model
    index = {body.name: body.index for body in model.bodies}
    bodies = index["one"], index["two"]
    presence = Presence(model, model.workstation.sensors[0], index["mat"], bodies)
    ways = [(presence.undetected, presence.until_output)]
    for t, one, two, inside, triggered in steps:
        positions = np.zeros((len(model.bodies), 3))
        positions[bodies, 0] = one, two
        state = SimpleNamespace(t=t, placed=lambda _, x=positions: (None, x))
        presence.follow(state, np.array(inside), triggered)
        ways.append((presence.undetected, presence.until_output))
    return np.array(ways)


BOTH, ONE, NONE = (True, True), (True, False), (False, False)


def test_the_way_of_the_fastest_that_is_inside_counts(tmp_path):
    steps = [
        (0.0, 0.0, 0.0, ONE, False),
        (0.1, 0.1, 0.5, ONE, False),
        (0.2, 0.2, 0.8, BOTH, False),
        (0.3, 0.4, 0.9, BOTH, True),
        (0.4, 0.5, 0.9, BOTH, True),
        (0.5, 0.6, 1.1, ONE, True),
        (0.6, 0.8, 1.1, BOTH, True),
        (0.7, 1.8, 1.1, BOTH, True),
    ]
    # Seen at 0.3 s; the output switches at 0.55 s.
    undetected = [0, 0, 0.1, 0.4, 0.6, 0.6, 0.6, 0.6, 0.6]
    until = [0, 0, 0, 0, 0, 0.1, 0.2, 0.2 + 0.5 * 0.2, 0.3]
    np.testing.assert_allclose(walked(tmp_path, steps), np.column_stack([undetected, until]), atol=1e-12)


@pytest.mark.parametrize("leave", [(0.3, 0.4, 0.0, NONE, False), (0.0, 0.4, 0.0, ONE, False)])
def test_who_leaves_and_a_run_that_begins_again_begin_at_nothing(tmp_path, leave):
    """Also a run that begins at the instant at which the last one ended."""
    steps = [(-0.2, 0, 0, ONE, False), (-0.1, 0.1, 0, ONE, True), (0.0, 0.2, 0, ONE, True), leave]
    ways = walked(tmp_path, steps)
    assert ways[3] == pytest.approx((0.1, 0.1))
    assert ways[4] == pytest.approx((0, 0))
    again = (leave[0] + 0.1, 0.7, 0.0, ONE, True)
    assert walked(tmp_path, [*steps, again])[5] == pytest.approx((0.3, 0))


def test_without_a_response_time_the_way_until_the_output_is_not_counted(tmp_path):
    steps = [(0.0, 0, 0, ONE, True), (0.1, 0.1, 0, ONE, True)]
    assert walked(tmp_path, steps, more="").tolist() == [[0, 0]] * 3


def test_a_device_that_has_seen_somebody_who_is_not_inside_goes_on(tmp_path):
    steps = [(0.0, 0, 0, ONE, True), (0.1, 0.1, 0, ONE, True), (0.2, 0.3, 0, NONE, True)]
    np.testing.assert_allclose(walked(tmp_path, steps)[-1], (0.0, 0.1), atol=1e-12)


@pytest.mark.parametrize(
    ("x", "verdict"),
    [
        (2.05, "within"),
        (2.021, "undecided"),
        (2.005, "undecided"),
        # On its border but for rounding is on it.
        (2.0 + 5e-10, "exceeded"),
        (1.99, "exceeded"),
    ],
)
@pytest.mark.parametrize("more", ["", "response = 0.25\n"])
def test_nearly_on_the_mat_is_open_and_the_response_time_is_asked_for(tmp_path, x, verdict, more):
    """Of an arm that ends at 2 m, with a display mesh 20 mm larger than its collision box."""
    visual = '<visual><origin xyz="0.5 0 0"/><geometry><box size="1.04 0.14 0.14"/></geometry></visual>'
    urdf = two_r().replace("</collision></link>", f"</collision>{visual}</link>")
    text = FLOATING + TWO_R + MAT.format(more=f"at = {{ position = [{x}, -0.5, -0.01] }}\n{more}")
    text += '[[safety]]\nkind = "pressure_mat"\nname = "m"\nsensor = "mat"\nof = "arm"\n'
    station = made(tmp_path, text, {"arm.urdf": urdf})
    found = results_at(station, arm=((0.0, 0.0), (0.0, 0.0)))["m"]
    assert (found.verdict, found.limit, found.at_most) == (verdict, 0.0, False)
    many = station.batch({"arm": np.zeros((2, 2))}, {"arm": np.zeros((2, 2))})["m"]
    assert many.answers.verdict.tolist() == [CODES[found.verdict]] * 2
    np.testing.assert_allclose(np.array(many.answers.interval).T, [found.interval] * 2, rtol=1e-12)
    named = {part.name: part for part in found.parts}
    if verdict != "exceeded":
        assert not named
        return
    link, until = named["arm/l2"], named["walked until the output switched"]
    assert (link.verdict, link.limit, link.at_most) == ("exceeded", 0.0, False)
    assert link.value == found.value <= 1e-9
    assert named["walked before detection"].value == 0
    assert (until.value, until.verdict) == ((0.0, None) if more else (None, "undecided"))
    assert bool(until.reason) is not bool(more)


def test_one_body_that_the_device_sees_switches_it_and_one_alone_that_it_misses_does_not(tmp_path):
    text = FLOATING + MAT.format(more="response = 0.25\n") + BOX.format(name="one") + BOX.format(name="two")
    station = made(tmp_path, text)
    state, index = state_at(station), {body.name: body.index for body in station.model.bodies}
    bodies = index["one"], index["two"]
    missed, seen = (Sight(kind, "why") for kind in (Seen.MISSED, Seen.DETECTED))
    for sights, reason, output in (
        ({bodies[0]: missed, bodies[1]: seen}, "detected: two", True),
        ({bodies[0]: missed, bodies[1]: missed}, "NOT detected: one, why", False),
    ):
        presence = Presence(station.model, station.model.workstation.sensors[0], index["mat"], bodies)
        figure = presence.of_one(state, state.closest_per_body(presence.gap), sights)
        verdict = verdict_of(figure, at_most=False)
        found = presence.shown(state, figure, verdict)
        assert (verdict, found.reason) == ("exceeded", reason)
        assert ("walked until the output switched" in {part.name for part in found.parts}) is output
