"""Options of separation that go together, and what is put in where S_p is largest."""

from __future__ import annotations

import pytest

from seerob.criteria.safety.separation import Detection, Separation, Stop
from seerob.criteria.stopping.models import StopTolerance

STOP = Stop(acceleration=0.0, reaction=0.1, stopping=0.3)


def separation(**options):
    return Separation(**{"name": "S", "between": ("arm", "op"), "stop": STOP, **options})


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"human_speed": 1.6, "human_speed_tolerance": 1.599},
        {"intrusion": 0.0, "intrusion_tolerance": 0.1},
        {"detection": Detection(), "intrusion_tolerance": 0.1},
        {"sensor": "scanner", "intrusion_tolerance": 0.1},
        {"sensor": "scanner", "intrusion": 0.2},
    ],
)
def test_options_that_go_together(options):
    assert separation(**options).mode == "dynamic"


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"human_speed_tolerance": 0.1}, "human_speed that is larger"),
        ({"human_speed": 0.5, "human_speed_tolerance": 0.5}, "human_speed that is larger"),
        ({"human_speed": 0.5, "human_speed_tolerance": 0.9}, "human_speed that is larger"),
        ({"intrusion_tolerance": 0.1}, "a C that is not given"),
        ({"intrusion": 0.1, "detection": Detection()}, "either intrusion or detection"),
    ],
)
def test_options_that_do_not(options, said):
    with pytest.raises(ValueError, match=said):
        separation(**options)


def test_the_worst_of_every_tolerance_is_put_in():
    """Long times, fast people, deep intrusion; without tolerances it is itself."""
    stop = Stop(
        acceleration=0.0, reaction=0.1, stopping=0.3, tolerance=StopTolerance(reaction=0.02, stopping=0.05)
    )
    given = {"human_speed": 1.6, "intrusion": 0.1}
    off = separation(
        stop=stop, human_speed_tolerance=0.2, intrusion_tolerance=0.03, human_uncertainty=0.1, **given
    )
    worst = off.at_worst(None)
    assert (worst.stop.reaction, worst.stop.stopping) == pytest.approx((0.12, 0.35))
    assert (worst.human_speed, worst.intrusion) == pytest.approx((1.8, 0.13))
    assert worst.human_uncertainty == 0.1
    assert worst.stop.tolerance is None
    assert (worst.human_speed_tolerance, worst.intrusion_tolerance) == (0.0, 0.0)
    plain = separation(**given)
    assert plain.at_worst(None) is plain
    one = separation(human_speed_tolerance=0.2, **given).at_worst(None)
    assert (one.human_speed, one.intrusion) == pytest.approx((1.8, 0.1))
    other = separation(intrusion_tolerance=0.03, intrusion=0.1).at_worst(None)
    assert (other.human_speed, other.intrusion) == (None, pytest.approx(0.13))
    field = Detection(approach="orthogonal", edition="2010", capability=0.03, reach_over=0)
    C = separation(detection=field, intrusion_tolerance=0.03).at_worst(None)
    assert (C.detection, C.intrusion) == (None, pytest.approx(0.128 + 0.03))
    open_ = Detection(approach="orthogonal", edition="2010", capability=0.08, reach_over=0)
    assert separation(detection=open_, intrusion_tolerance=0.03).at_worst(None).intrusion == 0.03
    same = separation(detection=field, human_speed=1.6, human_speed_tolerance=0.2).at_worst(None)
    assert (same.detection, same.intrusion) == (field, None)
