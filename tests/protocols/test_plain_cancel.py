"""A time-out is one also where the answer came at the same moment."""

import asyncio

import pytest
from wait_for2 import wait_for

from seerob.protocols.plc.opcua_client import plainly_cancelled


async def answered_when_cancelled(timeout):
    """What wait_for2 waits for is there in the same turn of the loop in which the time-out strikes."""
    loop = asyncio.get_running_loop()
    answer = loop.create_future()

    def strike():
        timeout.reschedule(loop.time())
        answer.set_result("late")

    loop.call_soon(strike)
    await wait_for(answer, 60)


def test_an_answer_at_the_last_moment_is_a_time_out():
    async def ask():
        async with asyncio.timeout(60) as timeout:
            with plainly_cancelled():
                await answered_when_cancelled(timeout)

    with pytest.raises(TimeoutError):
        asyncio.run(ask())


def test_who_is_cancelled_stays_so_and_other_errors_pass():
    async def cancelled():
        with plainly_cancelled():
            asyncio.current_task().cancel()
            await asyncio.sleep(0)

    with pytest.raises(asyncio.CancelledError):
        asyncio.run(cancelled())
    with pytest.raises(ZeroDivisionError), plainly_cancelled():
        _ = 1 / 0
