"""What is said again with a doubt holds from now on: also for what was heard before and lies ahead."""

from seerob.core.samples import Quality, SignalSample
from seerob.twin.signals import Signals
from seerob.twin.validity.hearing import Heard, Hearing
from seerob.workstation.variables import Variable

AFTER = 1e-6


def test_samples_that_lie_ahead_are_in_doubt_with_the_last_one():
    hearing = Hearing(given=False, driven=True, timeout=0.2)
    for k in range(8, 13):
        hearing.take(Heard(k / 100))
    hearing.forget(0.085)
    assert hearing.invalid_reason(0.085) == ""
    hearing.take(Heard(0.12 + AFTER, "run time fell behind"))
    assert {hearing.invalid_reason(t) for t in (0.085, 0.095, 0.105, 0.115, 0.12)} == {"run time fell behind"}


def test_a_doubt_of_a_later_instant_leaves_those_before_it_alone():
    hearing = Hearing(given=False, driven=True, timeout=0.2)
    for k in range(8, 12):
        hearing.take(Heard(k / 100))
    hearing.take(Heard(0.12, "late"))
    assert [hearing.invalid_reason(t) for t in (0.085, 0.095, 0.105, 0.115)] == ["", "", "", "late"]


def test_values_of_machines_that_lie_ahead_are_late_with_the_last_one():
    signals = Signals({"door": Variable(name="door", source="plc", address="x", type="bool")}, {"plc": 1.0})

    def picture(t, quality=Quality.GOOD):
        return SignalSample(source="plc", seq=0, t=t, values={"door": True}, quality=quality)

    for t in (0.08, 0.10, 0.12):
        signals.take(picture(t))
    assert signals.at("door", 0.105).invalid_reason == ""
    signals.take(picture(0.12 + AFTER, Quality.LATE))
    assert "fell behind" in signals.at("door", 0.105).invalid_reason
