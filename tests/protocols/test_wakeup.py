"""Who waits goes on in the call that rings, in time, and can be cancelled."""

from __future__ import annotations

import asyncio
import time

import pytest

from seerob.protocols.links.reception import Wakeup


async def turns(count=3):
    for _ in range(count):
        await asyncio.sleep(0)


def test_who_waits_has_gone_on_when_it_has_rung():
    async def story():
        wakeup, waiting, said = Wakeup(), [], []

        async def wait():
            while True:
                waiting.append(len(said))
                await wakeup.wait(60.0)
                said.append(asyncio.current_task())

        task = asyncio.create_task(wait())
        await turns()
        done = asyncio.Event()

        def wake():
            for k in range(100):
                wakeup.wake()
                assert len(said) == k + 1
            done.set()

        asyncio.get_running_loop().call_soon(wake)
        await done.wait()
        assert waiting == list(range(101))
        assert set(said) == {task}
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task

    asyncio.run(story())


def test_a_task_that_rings_is_not_interrupted_and_who_waits_goes_on_soon():
    async def story():
        wakeup, said = Wakeup(), []

        async def wait():
            await wakeup.wait(60.0)
            said.append("heard")

        task = asyncio.create_task(wait())
        await turns()
        wakeup.wake()
        wakeup.wake()
        assert said == []
        await task
        assert said == ["heard"]

    asyncio.run(story())


def test_it_rings_for_nobody_and_remembers_nothing():
    async def story():
        wakeup = Wakeup()
        wakeup.wake()
        with pytest.raises(TimeoutError):
            await wakeup.wait(0.01)

    asyncio.run(story())


def test_patience_is_counted_from_each_wait_whatever_it_was_before():
    async def story():
        wakeup, loop = Wakeup(), asyncio.get_running_loop()
        for _ in range(5):
            loop.call_later(0.03, wakeup.wake)
            await wakeup.wait(0.2)
        begun = time.monotonic()
        with pytest.raises(TimeoutError):
            await wakeup.wait(0.2)
        assert time.monotonic() - begun >= 0.2
        loop.call_later(0.001, wakeup.wake)
        await wakeup.wait(60.0)
        begun = time.monotonic()
        with pytest.raises(TimeoutError):
            await wakeup.wait(0.05)  # shorter than what is left of the one before
        assert 0.05 <= time.monotonic() - begun < 30

    asyncio.run(story())


def test_one_that_is_cancelled_ends_and_another_may_wait():
    async def story():
        wakeup = Wakeup()
        for _ in range(3):
            task = asyncio.create_task(wakeup.wait(60.0))
            await turns()
            task.cancel("why")
            wakeup.wake()  # too late
            with pytest.raises(asyncio.CancelledError):
                await task
        with pytest.raises(TimeoutError):
            async with asyncio.timeout(0.01):
                await wakeup.wait(60.0)
        asyncio.get_running_loop().call_soon(wakeup.wake)
        await wakeup.wait(60.0)

    asyncio.run(story())


def test_what_a_task_remembers_is_its_own_after_it_was_woken():
    import contextvars

    mine = contextvars.ContextVar("mine", default="nobody's")

    async def story():
        wakeup, said = Wakeup(), []

        async def wait():
            mine.set("its own")
            await wakeup.wait(60.0)
            said.append(mine.get())

        task = asyncio.create_task(wait())
        await turns()
        asyncio.get_running_loop().call_soon(wakeup.wake)
        await task
        assert said == ["its own"]

    asyncio.run(story())
