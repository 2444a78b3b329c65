"""A subscriber of ROBOTIS' SDK: prints five joint states that it hears at a router, and ends."""

from __future__ import annotations

import json
import os
import sys
import threading
from pathlib import Path

from zenoh_ros2_sdk import ROS2Subscriber

sys.path.insert(0, str(Path(__file__).parents[1]))
from soak.elsewhere import JOINT_STATE, JOINT_STATE_HASH

heard, enough = 0, threading.Event()


def show(message: object) -> None:
    global heard
    stamp = message.header.stamp
    row = {
        "name": list(message.name),
        "position": message.position.tolist(),
        "stamp": stamp.sec + 1e-9 * stamp.nanosec,
    }
    if heard < 5:
        print(json.dumps(row), flush=True)
    heard += 1
    if heard >= 5:
        enough.set()


ROS2Subscriber(
    "/joint_states",
    "sensor_msgs/msg/JointState",
    callback=show,
    msg_definition=JOINT_STATE,
    type_hash=JOINT_STATE_HASH,
    router_ip="127.0.0.1",
    router_port=int(sys.argv[1]),
)
os._exit(0 if enough.wait(60.0) else 1)
