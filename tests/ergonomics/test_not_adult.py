"""Children and adolescents: distances are judged, and what tables of adults say is never within."""

import pytest

from made_cell import made, person, results_at
from seerob.core.errors import InputError
from seerob.core.snapshot import Verdict
from seerob.description.humans.anthropometry import body

CELL = """
[[robots]]
name = "arm"
model = "library:ur10"
q = [0, -1.2, 1.4, -1.5, -1.5, 0]
[[humans]]
name = "kid"
stature = {stature}
mass = {mass}
sex = "female"
at = {{ position = [3.0, 0, 0] }}
{more}
[[safety]]
kind = "minimum_distance"
name = "distance"
between = ["arm", "kid"]
limit = 0.3
[[safety]]
kind = "power_and_force"
name = "contact"
robot = "arm"
human = "kid"
[[ergonomics]]
kind = "rula"
name = "rula"
human = "kid"
[[ergonomics]]
kind = "owas"
name = "owas"
human = "kid"
"""


def station(folder, *, stature=1.05, mass=18, more="adult = false"):
    return made(folder, CELL.format(stature=stature, mass=mass, more=more))


@pytest.mark.parametrize(("stature", "mass"), [(1.05, 18), (1.55, 45)])
def test_distances_are_judged_and_tables_of_adults_are_not(tmp_path, stature, mass):
    found = results_at(station(tmp_path, stature=stature, mass=mass))
    assert found["distance"].verdict is Verdict.WITHIN
    for name in ("rula", "owas", "contact"):
        assert found[name].verdict is Verdict.UNDECIDED
        assert "kid is no adult: outside the tables" in found[name].reason
    grown = results_at(station(tmp_path, stature=1.55, mass=45, more=""))
    assert grown["rula"].reason != found["rula"].reason
    assert grown["distance"].verdict is Verdict.WITHIN


def test_who_is_small_is_asked_whether_tables_hold(tmp_path):
    for options, what in (
        ({"stature": 1.05, "mass": 40}, "stature 1.05 m"),
        ({"stature": 1.4}, "mass 18 kg"),
    ):
        with pytest.raises(InputError, match=f"{what} is not an adult's: say adult = false"):
            station(tmp_path, **options, more="")
    with pytest.raises(InputError, match=r"0\.5 m is not a person's"):
        body(name="op", stature=0.5, mass=18, sex="female", adult=False)


def test_limits_of_contact_hold_for_no_child_beside_the_adult_who_is_named(tmp_path):
    """Everybody in the workstation can be hit: hands of a child within reach were within limits of adults."""
    contact = (
        '[[safety]]\nkind = "power_and_force"\nname = "named"\nrobot = "arm"\nhuman = "op"\n'
        'excluded = ["Skull and forehead", "Face"]\nhorizon = 0.9\ncontact_area = { arm = 1e-4 }\n'
    )
    q = [0, -1.5, 1.4, -1.5, -1.5, 0]
    arm = f'[[robots]]\nname = "arm"\nmodel = "library:ur5e"\nq = {q}\n'
    adult, kid = person("op", 3, 0, 0), person("kid", 0.6, 1.1, 0)
    small = kid.replace("1.75", "1.05\nadult = false").replace("75\n", "18\n")
    for other, expected in ((kid, Verdict.WITHIN), (small, Verdict.UNDECIDED)):
        cell = made(tmp_path, arm + adult + other + contact)
        found = results_at(cell, arm=(q, [0.001] * 6))["named"]
        assert found.verdict is expected
