"""Speed and separation monitoring behind a protective device: what its data sheet adds to S_p."""

from __future__ import annotations

import pytest

from made_cell import FLOATING, TWO_R, made, person, results_at, two_r
from seerob.core.errors import InputError, UnknownName

CELL = (
    FLOATING
    + TWO_R
    + person("operator", 4, 0, 0)
    + """
[[sensors]]
name = "scan"
at = { position = [0, 0, 0.3] }
capability = 0.07
response = 0.08
source = "data sheet"
laser_scanner = { range = 5, angle = 3, resolution = 0.01, fields = [
  { name = "p", corners = [[0, -1], [2, -1], [2, 1]] } ] }
[[sensors]]
name = "curtain"
capability = 0.03
response = 0.02
light_curtain = { ends = [[3, -2, 0.2], [3, 2, 0.2]], height = 1.5 }
"""
)
ASKED = """
[[safety]]
kind = "separation"
name = "{name}"
between = ["arm", "operator"]
stop = {{ acceleration = 0, reaction = {reaction}, stopping = 0.3 }}
human_speed = 1.6
human_uncertainty = 0.05
robot_uncertainty = 0.01
{more}
"""
MOTION = {"arm": ((0.0, 0.0), (1.0, 0.0))}
PARALLEL = "detection = { reach_under = 0, supplement = 0 }\n"


def asked(name, more, reaction=0.1):
    return ASKED.format(name=name, more=more, reaction=reaction)


def results(folder, text):
    return results_at(made(folder, CELL + text, {"arm.urdf": two_r()}), **MOTION)


def test_a_scanner_adds_its_response_and_its_capability(tmp_path):
    """Bit for bit what one gets by writing its data sheet into the criterion."""
    by_hand = "detection = { capability = 0.07, height = 0.3, reach_under = 0, supplement = 0 }\n"
    found = results(
        tmp_path,
        asked("device", 'sensor = "scan"\n' + PARALLEL) + asked("hand", by_hand, reaction=0.1 + 0.08),
    )
    device, hand = found["device"], found["hand"]
    assert (device.value, device.limit, device.verdict) == (hand.value, hand.limit, hand.verdict)
    terms = {p.name: p.value for p in device.parts}
    assert terms["S_h"] == pytest.approx(1.6 * (0.18 + 0.3), abs=1e-12)
    assert device.verdict in {"within", "exceeded"}


def test_a_curtain_is_crossed(tmp_path):
    across = 'detection = { approach = "orthogonal", reach_over = 0, reach_under = 0, supplement = 0 }\n'
    by_hand = across.replace("{ ", "{ capability = 0.03, ", 1)
    found = results(
        tmp_path,
        asked("device", 'sensor = "curtain"\n' + across) + asked("hand", by_hand, reaction=0.1 + 0.02),
    )
    assert found["device"].limit == found["hand"].limit


def test_a_stated_intrusion_stays_what_it_is(tmp_path):
    found = results(
        tmp_path,
        asked("device", 'sensor = "scan"\nintrusion = 0.2') + asked("hand", "intrusion = 0.2", 0.18),
    )
    assert found["device"].limit == found["hand"].limit


def test_without_a_response_time_it_is_undecided(tmp_path):
    text = CELL.replace("response = 0.08\n", "") + asked("device", 'sensor = "scan"\nintrusion = 0')
    station = made(tmp_path, text, {"arm.urdf": two_r()})
    result = results_at(station, **MOTION)["device"]
    assert result.verdict == "undecided"
    assert "response of scan" in result.reason
    basis = station.bound[0].criterion.basis(station.model)
    assert any(i.name == "response time of the sensor" and i.origin == "missing" for i in basis.inputs)


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ('sensor = "scan"\ndetection = { capability = 0.05 }', "detection.capability"),
        ('sensor = "scan"\ndetection = { height = 0.5 }', "detection.height"),
        ('sensor = "curtain"\ndetection = { approach = "parallel" }', "detection.approach"),
        ('sensor = "scam"', "scan"),
    ],
)
def test_what_contradicts_the_sensor_is_refused(tmp_path, more, words):
    with pytest.raises((InputError, UnknownName), match=words):
        made(tmp_path, CELL + asked("device", more), {"arm.urdf": two_r()}).bound  # noqa: B018
