"""Least distance: verdicts at the ends of its interval, one instant and many, in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from made_cell import TWO_R, made, results_at, state_at, two_r
from seerob.criteria.judging import Judge
from seerob.description.humans.skeleton import BONES
from seerob.recording.series import CODES, NO_VERDICT

CELL = "engine = { gravity = [0, 0, 0], physics = false }\n" + TWO_R
BOX = '[[parts]]\nname = "box"\nshape = {{ box = [0.2, 0.2, 0.2] }}\nat = {{ position = [{x}, 0, 0] }}\n'
ASKED = '[[safety]]\nkind = "minimum_distance"\nname = "d"\nbetween = ["arm", "{other}"]\n'
ZERO = (0.0, 0.0)


def asked(folder, more, *, x=2.4, proud=False):
    """The stretched arm ends at x = 2, the box begins at 2.3; many instants say what each of them says."""
    visual = '<visual><origin xyz="0.5 0 0"/><geometry><box size="1.04 0.14 0.14"/></geometry></visual>'
    urdf = two_r().replace("</collision></link>", f"</collision>{visual}</link>") if proud else two_r()
    station = made(folder, CELL + BOX.format(x=x) + ASKED.format(other="box") + more, {"arm.urdf": urdf})
    found = results_at(station, arm=(ZERO, ZERO))["d"]
    many = station.batch({"arm": np.zeros((2, 2))}, {"arm": np.zeros((2, 2))})["d"].answers
    assert many.value.tolist() == pytest.approx([found.value] * 2)
    assert many.verdict.tolist() == [NO_VERDICT if found.verdict is None else CODES[found.verdict]] * 2
    assert (many.interval is None) == (found.interval is None)
    if found.interval is not None:
        assert np.array(many.interval)[:, 0] == pytest.approx(found.interval)
    assert found.at_most is False
    return found


@pytest.mark.parametrize(
    ("more", "verdict"),
    [
        ("limit = 0.2999\n", "within"),
        ("limit = 0.3001\n", "exceeded"),
        ("", None),
        ("uncertainty_mm = 20\nlimit = 0.2799\n", "within"),
        ("uncertainty_mm = 20\nlimit = 0.2801\n", "undecided"),
        ("uncertainty_mm = 20\nlimit = 0.3199\n", "undecided"),
        ("uncertainty_mm = 20\nlimit = 0.3201\n", "exceeded"),
        ("uncertainty_mm = 20\n", None),
    ],
)
def test_an_uncertainty_is_taken_off_and_added(tmp_path, more, verdict):
    found = asked(tmp_path, more)
    assert (found.value, found.verdict) == (pytest.approx(0.3), verdict)
    assert found.interval == (pytest.approx((0.28, 0.32)) if "uncertainty" in more else None)


def test_a_surface_that_may_stick_out_is_taken_off_and_never_added(tmp_path):
    plain = asked(tmp_path / "plain", "", proud=True)
    off = plain.value - plain.interval[0]
    assert 0.02 - 1e-9 <= off <= 0.02 * np.sqrt(3) + 1e-9
    assert plain.interval[1] == plain.value
    for k, (less, limit, verdict) in enumerate(
        [
            (0.0, 0.3 - off - 1e-4, "within"),
            (0.0, 0.3 - off + 1e-4, "undecided"),
            (0.0, 0.3 + 1e-4, "exceeded"),
            (0.01, 0.3 - off - 0.01 - 1e-4, "within"),
            (0.01, 0.3 - off - 0.01 + 1e-4, "undecided"),
            (0.01, 0.31 - 1e-4, "undecided"),
            (0.01, 0.31 + 1e-4, "exceeded"),
        ]
    ):
        more = f"limit = {limit}\n" + (f"uncertainty = {less}\n" if less else "")
        assert asked(tmp_path / str(k), more, proud=True).verdict == verdict
    # The surface is off by so much to one side, the uncertainty to both.
    for half, named in ((0.51, "uncertainty ± "), (0.49, "surfaces that may stick out ± ")):
        found = asked(tmp_path / named[:4], f"limit = 0.3\nuncertainty = {half * off}\n", proud=True)
        assert found.verdict == "undecided"
        assert f"decided by {named}" in found.reason
        assert found.reason.endswith(" mm")


@pytest.mark.parametrize(("more", "verdict"), [("limit = 0\n", "exceeded"), ("", None)])
@pytest.mark.parametrize("uncertainty", ["", "uncertainty = 0.5\n"])
def test_shapes_that_cross_exceed_whatever_is_uncertain(tmp_path, more, verdict, uncertainty):
    assert asked(tmp_path, more + uncertainty, x=1.5).verdict == verdict


def test_what_bones_are_off_by_counts_with_the_uncertainty(tmp_path):
    person = (
        '[[humans]]\nname = "op"\nstature = 1.75\nmass = 75\nsex = "male"\nat = { position = [4, 0, -1] }\n'
    )
    text = CELL + person + ASKED.format(other="op") + "uncertainty = 0.1\n"
    station = made(tmp_path, text, {"arm.urdf": two_r()})
    state = state_at(station, arm=(ZERO, ZERO))
    (exact,) = Judge(station.bound)(state)
    state.hearings["op"].bones = dict.fromkeys(BONES, (0.3, None))
    (found,) = Judge(station.bound)(state)
    assert found.value == exact.value
    assert exact.interval == pytest.approx((exact.value - 0.1, exact.value + 0.1))
    assert found.interval == pytest.approx((exact.value - 0.4, exact.value + 0.4))
    # The larger of the two decides.
    for off, named in ((0.099, "uncertainty ± 100 mm"), (0.101, "tracking of the person ± 101 mm")):
        station = made(tmp_path / str(off), text + f"limit = {exact.value}\n", {"arm.urdf": two_r()})
        state = state_at(station, arm=(ZERO, ZERO))
        state.hearings["op"].bones = dict.fromkeys(BONES, (off, None))
        assert Judge(station.bound)(state)[0].reason.endswith(f"; decided by {named}")
    station = made(tmp_path, text, {"arm.urdf": two_r()})
    state = state_at(station, arm=(ZERO, ZERO))
    # One that is farther than it is off changes nothing.
    state.hearings["op"].bones = {"right_toes": (0.05, None)}
    (found,) = Judge(station.bound)(state)
    assert found.interval == exact.interval
