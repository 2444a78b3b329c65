"""One picture of all variables of a machine, with a doubt for everything that is not known to be so now."""

from __future__ import annotations

import asyncio
from contextlib import aclosing

import pytest

from seerob.devices.variables.live_source import Change, Picture, VariablesSource
from seerob.workstation.source import Target
from seerob.workstation.variables import Kind, Variable

SPEED = Variable(name="speed", source="plc", address=1, unit="mm/s", range=(0, 2000), timeout=0.5)
DOOR = Variable(name="door", source="plc", address=2, type=Kind.BOOL)
LAMP = Variable(name="lamp", source="plc", address=3, type=Kind.BOOL, write=True)


class Scripted(VariablesSource, frozen=True, kw_only=True):
    """Says what it is given."""

    said: tuple[tuple[float, tuple[Change, ...]], ...]

    async def changes(self, variables, folder):
        assert [v.name for v in variables] == ["speed", "door"]
        for pause, changes in self.said:
            await asyncio.sleep(pause)
            yield changes


@pytest.mark.parametrize("by_exception", [True, False])
def test_a_value_stands_or_grows_old(by_exception):
    picture = Picture((SPEED, DOOR, LAMP), by_exception=by_exception)
    picture.take((Change("speed", 500),), 10.0)
    first = picture.sample(10.4)
    assert first.values == {"speed": 0.5}
    assert list(first.doubts) == ["door"]
    later = picture.sample(10.6)
    assert ("speed" in later.doubts) == (not by_exception)
    assert later.values == {"speed": 0.5}


def test_a_doubt_is_there_until_a_good_value_comes():
    picture = Picture((SPEED, DOOR), by_exception=True)
    picture.take((Change("speed", 500), Change("door", True), Change("unknown", 1)), 0.0)
    assert picture.sample(0.0).doubts == {}
    for bad, why in (
        (Change("speed", 3000), "not in"),
        (Change("speed", 1, invalid_reason="bad sensor"), "bad sensor"),
    ):
        picture.take((bad,), 1.0)
        sample = picture.sample(1.0)
        assert why in sample.doubts["speed"]
        assert sample.values["speed"] == 0.5
    picture.take((Change("speed", 100),), 2.0)
    assert picture.sample(2.0).doubts == {}


def test_old_news_is_as_old_as_it_says():
    picture = Picture((SPEED,), by_exception=False)
    picture.take((Change("speed", 500, age=0.4),), 10.0)
    assert "speed" not in picture.sample(10.05).doubts
    assert "not heard for 0.60 s" in picture.sample(10.2).doubts["speed"]


def test_silence_with_a_connection_is_heard_as_beats_and_the_end_ends():
    source = Scripted(name="plc", said=((0.0, (Change("speed", 500),)), (0.2, (Change("door", False),))))
    target = Target(
        name="", joints=(), units=(), lower=(), upper=(), velocity=(), variables=(SPEED, DOOR, LAMP)
    )

    async def heard():
        async with aclosing(source.listen(target)) as samples:
            return [sample async for sample in samples]

    samples = asyncio.run(heard())
    assert len(samples) >= 3
    assert samples[-1].values == {"speed": 0.5, "door": False}
    assert all("lamp" not in s.values for s in samples)
