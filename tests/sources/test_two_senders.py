"""Two who send to one port, over real sockets: nobody is moved by the second, and nothing is relied on."""

import asyncio
import socket
import time

import pytest
from msgspec.structs import replace
from test_kinect_live import animated
from test_mvn import playing

from free_ports import free_port
from seerob.app.emulators.kinect import KinectSender
from seerob.app.emulators.mvn import MvnSender
from seerob.core.samples import Quality
from seerob.devices.live.device_clock import HOLD
from seerob.devices.live.listening import Listener
from seerob.devices.sources.kinect import Kinect
from seerob.devices.sources.mvn import Mvn
from seerob.protocols.links import datagrams

PATIENCE = 60.0
HERE = "127.0.0.1"


def mvn(port):
    return MvnSender({0: playing}, to=(HERE, port))


def kinect(port):
    return KinectSender(animated("library:reach"), to=(HERE, port))


SENDERS = {
    "mvn": (mvn, lambda port: Mvn(human="op", port=port, name="suit")),
    "kinect": (kinect, lambda port: Kinect(human="op", port=port, name="camera")),
}


def wait(found):
    end = time.monotonic() + PATIENCE
    while not found():
        assert time.monotonic() < end
        time.sleep(0.01)


@pytest.mark.parametrize("kind", SENDERS)
@pytest.mark.parametrize("named", [False, True], ids=["anyone", "sender given"])
def test_a_second_sender_leaves_the_person_undecided_with_the_reason(kind, named):
    send, source = SENDERS[kind]
    port = free_port()
    samples = []
    option = {"mvn": "sender", "kinect": "host"}[kind]
    made = source(port)
    if named:
        made = replace(made, **{option: HERE})
    listener = Listener(made, None, samples.append)
    listener.start()
    first = send(port).start()
    try:
        wait(lambda: sum(s.quality is Quality.GOOD and not s.reason for s in samples) > 10)
        second = send(port).start()
        try:
            wait(lambda: "heard is" in samples[-1].reason)
            begun = len(samples)
            wait(lambda: len(samples) > begun + 20)
            both = samples[begun:]
        finally:
            second.stop()
        assert {s.quality for s in both} == {Quality.DEGRADED}
        # A person of the emulator who stands still is doubted for that, too.
        assert all(f"sends to port {port}" in s.reason or "to the last bit" in s.reason for s in both)
        # One stream was heard, not a mixture: the device's time goes on.
        times = [s.t_device for s in both if s.t_device is not None]
        assert times == sorted(times)
        # Alone again, it counts again.
        wait(lambda: samples[-1].quality is Quality.GOOD and not samples[-1].reason)
    finally:
        first.stop()
        listener.ask_to_stop()
        assert listener.join(PATIENCE)


def a_socket():
    return socket.socket(socket.AF_INET, socket.SOCK_DGRAM)


@pytest.mark.parametrize(("kind", "back"), [("kinect", 12), ("mvn", 60)])
def test_packets_of_the_first_that_are_played_again_leave_the_person_undecided(kind, back):
    send, source = SENDERS[kind]
    port, inner = free_port(), free_port()
    samples = []
    listener = Listener(source(port), None, samples.append)
    listener.start()
    # All of them from one socket: address and port are the sender's own.
    with a_socket() as tap, a_socket() as way:
        tap.bind((HERE, inner))
        tap.settimeout(PATIENCE)
        sender = send(inner).start()
        try:
            seen = []
            while len(seen) < 2 * back or sum(not s.reason for s in samples) < 10:
                seen.append(tap.recv(1 << 16))
                way.sendto(seen[-1], (HERE, port))
            begun = len(samples)
            end = time.monotonic() + 3 * HOLD
            while time.monotonic() < end:
                seen.append(tap.recv(1 << 16))
                way.sendto(seen[-back], (HERE, port))
                way.sendto(seen[-1], (HERE, port))
        finally:
            sender.stop()
            listener.ask_to_stop()
            assert listener.join(PATIENCE)
    late = samples[begun:]
    assert late
    assert any("played again, or of two senders" in s.reason for s in late)
    assert Quality.GOOD not in {s.quality for s in late[2:]}


def test_another_port_of_the_same_address_is_another_sender():
    told = []

    async def run():
        datagrams.DISTRUST.set(told.append)
        async with datagrams.listening(HERE, 0, sender=HERE) as port:
            with a_socket() as a, a_socket() as b:
                for link, data in ((a, b"1"), (b, b"2"), (a, b"3")):
                    link.sendto(data, (HERE, port.port))
                    await asyncio.sleep(0.05)
                names = [link.getsockname()[1] for link in (a, b)]
            found = []
            async for datagram in port.receive(1.0):
                found.append(datagram.data)
                if len(found) == 2:
                    return found, port.strangers, names, port.port

    found, strangers, names, port = asyncio.run(run())
    assert found == [b"1", b"3"]
    assert strangers == 1
    assert told == [f"{HERE} port {names[1]} sends to port {port}, too; heard is {HERE} port {names[0]}"]


def test_after_a_silence_the_address_that_was_heard_is_waited_for_and_no_other():
    told, found = [], []

    async def listen(port, count):
        async with datagrams.listening("0.0.0.0", port) as heard:
            async for datagram in heard.receive(0.3):
                found.append(datagram.data)
                if len(found) == count:
                    return

    async def run():
        datagrams.DISTRUST.set(told.append)
        datagrams.HEARD.set({})
        port = free_port()
        with a_socket() as first, a_socket() as other, a_socket() as again:
            first.bind((HERE, 0))
            other.bind(("127.0.0.2", 0))
            again.bind((HERE, 0))

            def send(link, data):
                link.sendto(data, (HERE, port))

            loop = asyncio.get_running_loop()
            loop.call_later(0.05, send, first, b"first")
            with pytest.raises(TimeoutError):
                await listen(port, 0)
            for k, link in enumerate((other, again, other)):
                loop.call_later(0.05 * (k + 1), send, link, b"%d" % k)
            with pytest.raises(TimeoutError):
                await listen(port, 0)

    asyncio.run(run())
    assert found == [b"first", b"1"]
    assert [text.partition("heard is ")[2].split(" port")[0] for text in told] == [HERE, HERE]
