"""Separation at many instants at once is that of each of them by itself."""

from __future__ import annotations

import numpy as np
import pytest

from made_cell import FLOATING, TWO_R, made, results_at, two_r
from seerob.criteria.stopping import many_instants
from seerob.recording.series import CODES, NO_VERDICT

PERSON = '[[humans]]\nname = "op"\nstature = 1.75\nmass = 75\nsex = "male"\nat = { position = [6, 0, -1] }\n'
ASKED = (
    '[[safety]]\nkind = "separation"\nname = "{name}"\nbetween = ["arm", "op"]\nhuman_uncertainty = 0\n'
    "robot_uncertainty = 0\nstop = {{ acceleration = 0, reaction = 0.1, {stop} }}\n{more}\n"
)
GIVEN = "intrusion = 0.2\n"
TIMED = {
    "bound": ("stopping = 0.3", GIVEN),
    "half": ('stopping = 0.3, model = "constant_deceleration"', GIVEN),
    "open": ("stopping = 0.3", ""),
}
OTHERS = {
    "braking": ('deceleration = 2, model = "constant_deceleration"', GIVEN),
    "simulated": ('model = "simulated", brakes = [9, 9]', GIVEN),
    "table": ('model = "table", table = "ur10_cb3", stopping = 0.3', GIVEN),
    "off": ("stopping = 0.3, tolerance = { reaction = 0.01 }", GIVEN),
    "fixed": ("stopping = 0.3", f'{GIVEN}mode = "fixed"'),
    "off, too": ("stopping = 0.3", f"{GIVEN}intrusion_tolerance = 0.1"),
}
# From 0 m/s to where the slower link, farther away, has more room than the faster one by more than both.
MOTION = [((0.0, 0.0), (v, 0.0)) for v in (0.0, 1.0, -2.0, 3.5, 10.0)]


def test_only_what_depends_on_its_instant_and_has_a_stopping_time_is_asked_in_one_go(tmp_path):
    text = "".join(ASKED.format(name=k, stop=s, more=m) for k, (s, m) in {**TIMED, **OTHERS}.items())
    cell = made(tmp_path, FLOATING + TWO_R + PERSON + text, {"arm.urdf": two_r()})
    asked = {bound.criterion.name: bound.criterion.batch(cell.model) is not None for bound in cell.bound}
    assert asked == dict.fromkeys(TIMED, True) | dict.fromkeys(OTHERS, False)


@pytest.mark.parametrize("name", TIMED)
def test_many_instants_are_each_of_them(tmp_path, name):
    stop, more = TIMED[name]
    text = FLOATING + TWO_R + PERSON + ASKED.format(name=name, stop=stop, more=more)
    cell = made(tmp_path, text, {"arm.urdf": two_r()})
    alone = [results_at(cell, arm=each)[name] for each in MOTION]
    q, qd = (np.array([each[k] for each in MOTION]) for k in (0, 1))
    many = cell.batch({"arm": q}, {"arm": qd})[name].answers
    np.testing.assert_allclose(many.value, [result.value for result in alone], rtol=1e-9)
    np.testing.assert_allclose(many.limit, [result.limit for result in alone], rtol=1e-9)
    assert many.verdict.tolist() == [CODES[result.verdict] for result in alone]
    assert {result.verdict for result in alone} == {"undecided" if more == "" else "within", "exceeded"}


AHEAD = [
    ("reaction = 0.1, stopping = 0.1", 3.6),
    ('model = "constant_deceleration", reaction = 0.033, stopping = 0.2', 3.2),
]


@pytest.mark.parametrize(("stop", "x"), AHEAD)
def test_what_a_file_does_ahead_is_that_of_each_instant_by_itself(tmp_path, monkeypatch, stop, x):
    asked = (
        '[[safety]]\nkind = "separation"\nname = "apart"\nbetween = ["arm", "op"]\nhuman_uncertainty = 0\n'
        f"robot_uncertainty = 0\nintrusion = 0.2\nstop = {{ {stop} }}\n"
    )
    source = '[[sources]]\nkind = "csv"\nrobot = "arm"\nfile = "motion.csv"\nbegins = 0.004\n'
    source += 'mapping = { time = "t", joints = ["a", "b"], time_unit = "s", joint_unit = "rad" }\n'
    t = np.arange(0, 1.2, 0.03)  # most of its samples lie between two ticks
    rows = [f"{s:.3f},{np.sin(3 * s)},{0.5 * np.cos(4 * s)}" for s in t]
    text = FLOATING + TWO_R + PERSON.replace("[6, 0, -1]", f"[{x}, 0, -1]") + source + asked
    files = {"arm.urdf": two_r(), "motion.csv": "\n".join(["t,a,b", *rows])}
    cell = made(tmp_path, text, files)
    found = cell.batch()["apart"]
    assert not found.note
    ahead = many_instants._Ahead.at

    def left_alone(self, states, v_r):
        """Whoever was asked before may have left instants to be asked one by one, and they stay so."""
        states.alone[::3] = True
        onset = ahead(self, states, v_r)
        assert states.alone[::3].all()
        return onset

    with monkeypatch.context() as patch:
        patch.setattr(many_instants._Ahead, "at", left_alone)
        np.testing.assert_array_equal(cell.batch()["apart"].answers.verdict, found.answers.verdict)
    monkeypatch.setattr(many_instants._Ahead, "of", lambda *_: None)
    alone = cell.batch()["apart"]
    assert "worked out at each instant" in alone.note
    np.testing.assert_array_equal(found.answers.verdict, alone.answers.verdict)
    np.testing.assert_allclose(found.value, alone.value, rtol=1e-12)
    np.testing.assert_allclose(found.answers.limit, alone.answers.limit, rtol=1e-12)
    assert set(found.answers.verdict.tolist()) == set(CODES.values()) - {NO_VERDICT}
    # Where the motion ends, nobody says what it does after: that is asked of each instant by itself.
    assert found.reasons[-1] == alone.reasons[-1] != ""
