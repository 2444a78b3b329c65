"""The emulated Foxglove bridge: what it says is the motion, and hostile clients do not matter to others."""

from __future__ import annotations

import json

import pytest
from websockets.sync.client import connect

from seerob.app.emulation.ros_robot import EPOCH
from seerob.app.emulators.foxglove import FoxgloveBridge
from seerob.devices.sources.foxglove import Foxglove
from seerob.protocols.ros import foxglove
from seerob.protocols.ros.ros_messages import Edition
from sources.listening import heard

NAMES = ("a", "b")


def motion(t):
    return (0.1 * t, -0.2), (0.1, 0.0)


def drained(client):
    """What was on its way, until nothing comes any more."""
    for _ in range(10_000):
        client.recv(timeout=0.3)


@pytest.mark.parametrize("edition", Edition)
def test_what_is_heard_is_the_motion(edition):
    with FoxgloveBridge(motion, NAMES, edition=edition) as bridge:
        source = Foxglove(robot="arm", host="127.0.0.1", port=bridge.port)
        samples = heard(source, lambda said: len(said) > 5)
    for sample in samples:
        t = sample.t_device - EPOCH
        # A second of 2023 is known to a quarter of a microsecond.
        assert sample.q == pytest.approx((0.1 * t, -0.2), abs=1e-6)
        assert sample.qd == pytest.approx((0.1, 0.0))


def test_nonsense_is_passed_over_and_an_unsubscribed_channel_is_silent():
    with (
        FoxgloveBridge(motion, NAMES, rate=200.0) as bridge,
        connect(f"ws://127.0.0.1:{bridge.port}", subprotocols=foxglove.SUBPROTOCOLS[:1]) as client,
    ):
        assert json.loads(client.recv())["op"] == "serverInfo"
        (channel,) = foxglove.channels(foxglove.operation(client.recv()))
        listed = [{"id": 2**40, "channelId": channel.id}, {"id": "x"}, 5, {"id": 3, "channelId": 99}]
        for said in ("{", "[]", b"\0\1", {"op": "subscribe"}, {"op": "subscribe", "subscriptions": listed}):
            client.send(json.dumps(said) if isinstance(said, dict) else said)
        client.send(foxglove.subscribe({7: channel.id}))
        assert {foxglove.message(client.recv()).subscription for _ in range(5)} == {7}
        client.send(json.dumps({"op": "unsubscribe", "subscriptionIds": [7, "x"]}))
        with pytest.raises(TimeoutError):
            drained(client)


def test_what_a_server_sends_is_read_by_the_listener():
    offered = [foxglove.ServerChannel(4, "/tf", "cdr", "tf2_msgs/msg/TFMessage")]
    assert foxglove.channels(foxglove.operation(foxglove.offer(offered))) == offered
    assert foxglove.subscriptions(foxglove.operation(foxglove.subscribe({1: 4, 2: 9}))) == {1: 4, 2: 9}
    assert foxglove.message(foxglove.pack(5, 1.5, b"abc")) == foxglove.Message(5, 1.5, b"abc")
