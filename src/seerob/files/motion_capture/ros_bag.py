"""Joint states, trajectories and transforms out of ROS bags: ROS 1, and ROS 2 in SQLite or MCAP.

Read by the definitions that this package knows: those of a bag are not made into code.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from enum import StrEnum
from pathlib import Path
from typing import NamedTuple

from seerob.core.errors import InputError
from seerob.core.files.bounded import regular
from seerob.files.motion_capture.kinect_bag import connections, raw_messages
from seerob.protocols import ProtocolError
from seerob.protocols.ros.ros_messages import Content, Said, same_type
from seerob.protocols.ros.ros_serialised import MAX_BYTES, Edition, decode

MOST_MESSAGES = 5_000_000


class TimeBase(StrEnum):
    """Which instants count."""

    HEADER = "header"
    """Time in the messages themselves, as the robot stamped them."""
    RECEIVED = "received"
    """When whoever recorded the bag got them: with the delays of the network."""


class Recorded(NamedTuple):
    """A message of a bag."""

    topic: str
    received: float
    """When it was recorded [s]."""
    said: Said


def topics_of(path: Path, file: str) -> dict[str, str]:
    """What a bag has: type of the messages, by topic.

    Args:
        path: A ROS 1 bag, or the folder or file of a ROS 2 bag.
        file: It, as the user named it.

    Raises:
        InputError: It is missing or no bag.
    """
    try:
        regular(path)
    except FileNotFoundError:
        raise InputError.at(file, "", "no such file", "give the path from the workstation's folder") from None
    except OSError as error:
        what = f"cannot be read: {error.strerror}"
        raise InputError.at(file, "", what, "give a bag that may be read") from error
    return dict(connections(path, file))


def chosen(found: dict[str, str], content: Content, topic: str, file: str) -> str:
    """The topic that is meant.

    Args:
        found: Type by topic.
        content: What it is to say.
        topic: As the user named it; empty for the usual one, or the only one of its type.
        file: The bag, for messages.

    Raises:
        InputError: There is none, or there are several.
    """
    fitting = sorted(name for name, kind in found.items() if same_type(kind, content.message_type))
    others = ", ".join(f"{name} ({kind})" for name, kind in sorted(found.items())[:12]) or "nothing"
    if topic:
        if topic not in fitting:
            what = f"no {content.message_type} called {topic!r}"
            raise InputError.at(file, "topic", what, f"there is: {others}")
        return topic
    if content.topic in fitting:
        return content.topic
    if not fitting:
        raise InputError.at(file, "content", f"no {content.message_type}", f"there is: {others}")
    if len(fitting) > 1:
        raise InputError.at(file, "topic", f"several: {', '.join(fitting[:12])}", "name one: topic = …")
    return fitting[0]


def messages(path: Path, content: Content, topics: Sequence[str], file: str) -> Iterator[Recorded]:
    """What topics say, in the order of the bag.

    Raises:
        InputError: A message that cannot be read; names its number.
    """
    edition = Edition.ROS1 if path.suffix.lower() == ".bag" else Edition.ROS2
    for index, item in enumerate(raw_messages(path, file, topics, MAX_BYTES)):
        topic, _, received, raw, _ = item
        if index >= MOST_MESSAGES:
            raise InputError.at(file, "", f"more than {MOST_MESSAGES} messages", "split the bag")
        try:
            said = decode(content, raw, edition)
        except ProtocolError as error:
            raise InputError.at(file, f"{topic} message {index}", str(error)) from error
        yield Recorded(topic, received * 1e-9, said)
