"""The lifting equation as a rule: limits, refusals, composite jobs."""

import pytest

from made_cell import made, results_at
from seerob.core.errors import InputError
from seerob.session.run import bind

HUMAN = """
[[humans]]
name = "op"
stature = 1.75
mass = 75
sex = "male"
"""
LIFT = """[[ergonomics]]
kind = "niosh"
name = "lift"
human = "op"
limit = 1
work = 3000
recovery = 3000
exclusions = {exclusions}
[[ergonomics.lifts]]
load = {load}
control = true
per_minute = 3
coupling = "fair"
origin = {{ horizontal = 0.25, vertical_mm = 550, asymmetry = 0 }}
destination = {{ horizontal = {far}, vertical = 1.475, asymmetry = 0 }}
"""


@pytest.mark.parametrize(
    ("load", "far", "value", "verdict"),
    [(6, 0.5, 0.872, "within"), (12, 0.5, 1.745, "exceeded"), (1, 0.7, None, "exceeded")],
)
def test_a_lift_against_its_limit(tmp_path, load, far, value, verdict):
    found = results_at(made(tmp_path, HUMAN + LIFT.format(load=load, far=far, exclusions="[]")))["lift"]
    assert found.value == (None if value is None else pytest.approx(value, abs=1e-3))
    assert found.verdict == verdict
    assert "destination" in found.reason or "beyond the reach" in found.reason


def test_lifts_to_which_the_equation_does_not_apply_are_refused(tmp_path):
    tables = LIFT.format(load=5, far=0.5, exclusions='["one_handed", "slippery_floor"]')
    with pytest.raises(InputError, match=r"(?s)does not apply: one handed.*slippery floor"):
        bind(made(tmp_path, HUMAN + tables).model)
    tables = LIFT.format(load=5, far=0.5, exclusions="[]")
    for wrong, message in (
        (tables.replace("exclusions = []\n", ""), "exclusions: missing"),
        (tables.replace("work = 3000", "work = 30000"), "work"),
        (tables.replace("load = 5", "load = 5\nheaviest = 4"), "less than the average"),
    ):
        with pytest.raises(InputError, match=message):
            bind(made(tmp_path, HUMAN + wrong).model)


def test_several_lifts_make_a_composite_index(tmp_path):
    one = LIFT.format(load=6, far=0.5, exclusions="[]")
    two = one + one[one.index("[[ergonomics.lifts]]") :]
    alone = results_at(made(tmp_path, HUMAN + one))["lift"]
    both = results_at(made(tmp_path, HUMAN + two))["lift"]
    assert both.value > alone.value
    assert [p.value for p in both.parts] == pytest.approx([alone.value] * 2)


def test_a_lift_on_its_own_is_judged_by_its_greatest_mass(tmp_path):
    """5 kg on average and 12 kg at times is as much as 12 kg."""
    usual = LIFT.format(load=12, far=0.5, exclusions="[]")
    varied = LIFT.format(load=5, far=0.5, exclusions="[]").replace("load = 5", "load = 5\nheaviest = 12")
    values = [
        results_at(made(tmp_path / name, HUMAN + text))["lift"].value
        for name, text in (("a", usual), ("b", varied))
    ]
    assert values[0] == values[1] == pytest.approx(1.745, abs=1e-3)
