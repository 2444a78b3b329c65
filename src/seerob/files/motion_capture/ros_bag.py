"""Joint states, trajectories and transforms out of ROS bags: ROS 1, and ROS 2 in SQLite or MCAP.

Read by the definitions that this package knows: those of a bag are not made into code.

Azure Kinect body tracking out of a ROS bag: ``visualization_msgs/MarkerArray``, a sphere per joint.

As the Azure Kinect ROS driver publishes it: ``id`` is 100 times the number of the body and the joint,
positions in metres in the frame of the depth camera (x right, y down, z forward). An array without markers
is a picture in which nobody was seen. ROS 1 bags, and ROS 2 bags in SQLite and MCAP.
"""

from __future__ import annotations

import struct
from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from enum import StrEnum
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from seerob.core.errors import InputError
from seerob.core.extras import need
from seerob.core.files.bounded import regular
from seerob.core.files.parser_process import parsed, parsed_one_by_one
from seerob.core.printable import printable
from seerob.core.snapshot import Finding
from seerob.description.capture.captured import Captured
from seerob.files.motion_capture.frame_arrays import check_size
from seerob.files.motion_capture.kinect_recording import ROWS, Reading, recording
from seerob.protocols import ProtocolError
from seerob.protocols.ros.ros_messages import MAX_BYTES, Content, Edition, RosMessage, decode, same_type
from seerob.protocols.tracking.kinect import JOINTS, MAX_BODIES, Body, Picture, camera_body

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
    said: RosMessage


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


TYPE = "visualization_msgs/msg/MarkerArray"
LARGEST_BAG = 64 << 30
MAX_MESSAGE = 16 << 20
"""Of one message [byte]; a skeleton takes 5 kB."""
PER_BODY = 100
SPHERE, ADD = 2, 0
MAX_STAMP = 4_000_000_000
MEMORY = 2 << 30
"""What reading a bag may take [byte]: its chunks are unpacked whole."""
REMEDY = "repair it with rosbag reindex or ros2 bag reindex, or record anew"


def read(path: Path, reading: Reading, *, topic: str = "") -> Captured:
    """A recording out of a bag.

    Args:
        path: A ROS 1 bag, or the folder or file of a ROS 2 bag.
        reading: How.
        topic: The one with the skeletons; empty when there is only one of its type.

    Raises:
        InputError: It is no bag, has no such topic, or nobody says which person is meant.
    """
    if not path.exists():
        raise InputError.at(reading.file, "", "no such file", "give the path from the workstation's folder")
    chosen = _topic(path, reading.file, topic)
    found, frame = pictures(path, chosen, reading)
    text = f"{reading.file}: topic {chosen}, in the frame {frame or 'without a name'} of the depth camera"
    note = Finding(level="note", subject="", text=text)
    return recording(found, reading, (note,))


def pictures(path: Path, topic: str, reading: Reading) -> tuple[list[Picture], str]:
    """Every message of a topic.

    Args:
        path: The bag.
        topic: Of the skeletons.
        reading: How.

    Returns:
        Pictures in the order of the bag, and the name of the frame that positions are in.

    Raises:
        InputError: A message that cannot be read; names its number.
    """
    found: list[Picture] = []
    delays, stamped = [], []
    frame, bodies = "", 0
    for index, (recorded, message) in enumerate(_messages(path, topic, reading.file)):
        stamp = _stamp(message.markers)
        stamped.append(stamp is not None)
        if stamp is not None:
            delays.append(recorded - stamp)
            frame = frame or str(message.markers[0].header.frame_id)[:100]
        seen = _bodies(message.markers, reading.file, f"{topic} message {index}")
        bodies += max(1, len(seen))
        check_size(reading.file, bodies, ROWS * 8)
        found.append(Picture(t=recorded if stamp is None else stamp, bodies=seen, frame=index))
    # A message without markers has no stamp: it was recorded as late after its instant as the others.
    delay = float(np.median(delays)) if delays else 0.0
    return [p if s else replace(p, t=p.t - delay) for p, s in zip(found, stamped, strict=True)], frame


def _topic(path: Path, file: str, topic: str) -> str:
    listed = connections(path, file)
    topics = sorted({name for name, kind in listed if kind == TYPE})
    others = sorted({f"{name} ({kind})" for name, kind in listed})[:12]
    if topic and topic not in topics:
        raise InputError.at(file, "topic", f"no {TYPE} called {topic!r}", f"there are: {', '.join(others)}")
    if not topics:
        what = f"no {TYPE}: {', '.join(others) or 'nothing'}"
        raise InputError.at(file, "topic", what, "record the topic body_tracking_data of the camera's driver")
    if not topic and len(topics) > 1:
        raise InputError.at(file, "topic", f"several: {', '.join(topics)}", "name one: topic = …")
    return topic or topics[0]


@cache
def _store(name: str) -> Any:
    """Definitions of messages that we know: those of a bag are not made into code."""
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores[name])


def _is_ros2(path: Path) -> bool:
    return path.suffix.lower() != ".bag"


def connections(path: Path, file: str) -> list[tuple[str, str]]:
    """Topics of a bag with the types of their messages.

    Args:
        path: A ROS 1 bag, or the folder or file of a ROS 2 bag.
        file: It, as messages name it.

    Raises:
        InputError: It is no bag.
    """
    _check(path, file)
    return parsed(_connections, path, file, file=file, remedy=REMEDY, memory=MEMORY)


def raw_messages(
    path: Path, file: str, topics: Sequence[str], most: int
) -> Iterator[tuple[str, str, int, bytes, bool]]:
    """Topic, type, instant of recording [ns], bytes, and whether markers have textures, of each message.

    Args:
        path: The bag.
        file: It, as messages name it.
        topics: Of whose messages.
        most: Bytes of one message.

    Raises:
        InputError: It is no bag that can be read, or a message is larger.
    """
    _check(path, file)
    given = path, file, tuple(topics), most
    return parsed_one_by_one(_raw, *given, file=file, remedy=REMEDY, memory=MEMORY)


def _check(path: Path, file: str) -> None:
    size = path.stat().st_size if path.is_file() else sum(p.stat().st_size for p in path.glob("*"))
    if size > LARGEST_BAG:
        raise InputError.at(file, "", f"{size} bytes, more than {LARGEST_BAG}", "split the bag")
    profile, library = mcap_header(path) or (_ROS2, "")
    if library.startswith("seerob"):
        raise InputError.at(file, "", "a recording of seerob, not a ROS bag", 'write kind = "recording"')
    if profile != _ROS2:
        what = (
            f"an MCAP file of the profile {profile!r} (written by {library or 'nobody says'}), not of ROS 2"
        )
        remedy = (
            "only that profile says that messages are those of ROS 2: record with ros2 bag, or export a table"
        )
        raise InputError.at(file, "", what, remedy)
    need("rosbags")


_MAGIC, _HEADER, _ROS2 = b"\x89MCAP0\r\n", 1, "ros2"
_MOST_NAMED = 1000
"""Bytes of a name in a file's header."""


def mcap_header(path: Path) -> tuple[str, str] | None:
    """Profile and library that an MCAP file names in its first record; None of any other file.

    Args:
        path: A file, or the folder of a ROS 2 bag, which is none.
    """
    if not path.is_file():
        return None
    with path.open("rb") as file:
        begin = file.read(len(_MAGIC) + 9)
        if len(begin) < len(_MAGIC) + 9 or not begin.startswith(_MAGIC) or begin[len(_MAGIC)] != _HEADER:
            return None
        texts = []
        for _ in range(2):
            (length,) = struct.unpack("<I", file.read(4).ljust(4, b"\0"))
            texts.append(file.read(min(length, _MOST_NAMED)).decode("utf-8", "replace"))
    return printable(texts[0]), printable(texts[1])


def _messages(path: Path, topic: str, file: str) -> Iterator[tuple[float, Any]]:
    """Instant of recording [s] and content of each message."""
    ros2 = _is_ros2(path)
    for _, kind, recorded, raw, textures in raw_messages(path, file, (topic,), MAX_MESSAGE):
        if kind != TYPE:
            continue
        try:
            # Textures of markers came with ROS 2 Humble.
            store = _store("ROS2_HUMBLE" if textures else "ROS2_FOXY") if ros2 else _store("ROS1_NOETIC")
            message = (store.deserialize_cdr if ros2 else store.deserialize_ros1)(raw, TYPE)
        except Exception as error:  # the reader of messages trusts their bytes
            raise _wrong(file, error) from error
        yield recorded * 1e-9, message


def _wrong(file: str, error: Exception) -> InputError:
    """What the reader of bags says, as a mistake in the file."""
    what = f"not a ROS bag that can be read: {type(error).__name__}: {str(error)[:200]}"
    return InputError.at(file, "", what, REMEDY)


# -- in the parsers' process: what is packed in a bag may be of any size ------------------------


@contextmanager
def _opened(path: Path, file: str) -> Iterator[Any]:
    from rosbags import rosbag1, rosbag2

    # The reader of bags trusts their bytes: whatever it raises, the file is wrong.
    try:
        bag: Any = rosbag2.Reader(path) if _is_ros2(path) else rosbag1.Reader(path)
        bag.open()
    except MemoryError:
        raise
    except Exception as error:
        raise _wrong(file, error) from error
    try:
        yield bag
    finally:
        bag.close()


def _connections(path: Path, file: str) -> list[tuple[str, str]]:
    with _opened(path, file) as bag:
        return [(str(c.topic), str(c.msgtype)) for c in bag.connections]


def _raw(
    path: Path, file: str, topics: Sequence[str], most: int
) -> Iterator[tuple[str, str, int, bytes, bool]]:
    with _opened(path, file) as bag:
        wanted = [c for c in bag.connections if c.topic in topics]
        if not wanted:
            return
        listed = bag.messages(connections=wanted)
        while True:
            try:
                item = next(listed, None)
            except MemoryError:
                raise
            except Exception as error:
                raise _wrong(file, error) from error
            if item is None:
                return
            connection, recorded, raw = item
            if len(raw) > most:
                raise InputError.at(file, str(connection.topic), f"a message of {len(raw)} bytes")
            said = getattr(connection.msgdef, "data", "") or ""
            textures = not said or "texture_resource" in said
            yield str(connection.topic), str(connection.msgtype), int(recorded), bytes(raw), textures


def _stamp(markers: Any) -> float | None:
    if not markers:
        return None
    stamp = markers[0].header.stamp
    if not 0 < stamp.sec < MAX_STAMP:
        return None
    return float(stamp.sec) + 1e-9 * float(stamp.nanosec)


def _bodies(markers: Any, file: str, place: str) -> tuple[Body, ...]:
    found: dict[int, np.ndarray[Any, np.dtype[np.float64]]] = defaultdict(
        lambda: np.full((len(JOINTS), 7), np.nan)
    )
    for marker in markers:
        if marker.action != ADD or marker.type != SPHERE:
            continue  # what takes old markers away, and drivers' extra labels
        body, joint = divmod(int(marker.id), PER_BODY)
        if body < 0 or joint >= len(JOINTS):
            what = f"marker {marker.id}: no joint {joint}"
            raise InputError.at(file, place, what, "ids are expected as 100 × body + joint")
        p, o = marker.pose.position, marker.pose.orientation
        found[body][joint] = (p.x, p.y, p.z, o.w, o.x, o.y, o.z)
        if len(found) > MAX_BODIES:
            raise InputError.at(file, place, f"more than {MAX_BODIES} bodies")
    return tuple(camera_body(i, rows[:, :3], rows[:, 3:], None) for i, rows in sorted(found.items()))
