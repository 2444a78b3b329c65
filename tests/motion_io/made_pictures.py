"""A person of ours in front of a depth camera, and the files that trackers and drivers make of that."""

import json

import numpy as np

from seerob.app.emulators import kinect
from seerob.protocols.tracking.kinect import JOINTS, Picture, body_object

RATE = 30.0


def scene(file="library:reach"):
    return kinect.animated(file)


def pictures(count=40, file="library:reach", lost=()):
    """Pictures of a motion; nobody is seen in those of ``lost``."""
    seen = scene(file)
    return [
        Picture(t=2.0 + k / RATE, bodies=() if k in lost else seen(k / RATE).bodies, frame=k)
        for k in range(count)
    ]


def frame_object(picture):
    """As offline_processor writes it: without confidences."""
    bodies = [body_object(body) for body in picture.bodies]
    return {
        "timestamp_usec": round(picture.t * 1e6),
        "frame_id": picture.frame,
        "num_bodies": len(bodies),
        "bodies": [
            {
                "body_id": b.body_id,
                "joint_positions": b.joint_positions,
                "joint_orientations": b.joint_orientations or [[1.0, 0.0, 0.0, 0.0]] * len(JOINTS),
            }
            for b in bodies
        ],
    }


def offline_json(given, **more):
    """Keys in alphabetic order and one number per line, as the JSON library of the tool does."""
    text = {
        "k4abt_sdk_version": "1.1.2",
        "source_file": 'a "quoted" \\ {path}].mkv',
        "joint_names": [name.replace("_", " ") for name in JOINTS],
        "bone_list": [["SPINE_CHEST", "SPINE_NAVEL"]],
        "frames": [frame_object(picture) for picture in given],
        **more,
    }
    return json.dumps(text, indent=4, sort_keys=True)


def bag(path, given, *, ros2=False, topic="/body_tracking_data", delay=0.03):
    """As the ROS driver publishes it, recorded a little later."""
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import StoragePlugin
    from rosbags.rosbag2 import Writer as Writer2
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE if ros2 else Stores.ROS1_NOETIC)
    writer = Writer2(path, version=9, storage_plugin=StoragePlugin.MCAP) if ros2 else Writer1(path)
    kind = "visualization_msgs/msg/MarkerArray"
    with writer as out:
        connection = out.add_connection(topic, kind, typestore=store)
        for picture in given:
            message = store.types[kind](markers=_markers(store, picture, ros2))
            pack = store.serialize_cdr if ros2 else store.serialize_ros1
            out.write(connection, round((picture.t + delay) * 1e9), pack(message, kind))
    return path


def _markers(store, picture, ros2):
    types = {name.rpartition("/")[2]: cls for name, cls in store.types.items()}
    types["Time"] = store.types["builtin_interfaces/msg/Time"]
    types["Duration"] = store.types["builtin_interfaces/msg/Duration"]
    seconds, rest = divmod(round(picture.t * 1e9), 10**9)
    stamp = types["Time"](sec=seconds, nanosec=rest)
    header = {"stamp": stamp, "frame_id": "depth_camera_link"}
    if not ros2:
        header["seq"] = 0
    more = {"text": "", "mesh_resource": "", "mesh_use_embedded_materials": False, "points": [], "colors": []}
    if ros2:
        # Textures came with ROS 2.
        image = types["CompressedImage"](
            header=types["Header"](**header), format="", data=np.zeros(0, np.uint8)
        )
        more |= {"texture_resource": "", "texture": image, "uv_coordinates": [], "mesh_file": None}
        more["mesh_file"] = types["MeshFile"](filename="", data=np.zeros(0, np.uint8))
    markers = []
    for body in picture.bodies:
        for joint, (x, y, z) in enumerate(body_object(body).joint_positions):
            pose = types["Pose"](
                position=types["Point"](x=x / 1e3, y=y / 1e3, z=z / 1e3),
                orientation=types["Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0),
            )
            markers.append(
                types["Marker"](
                    header=types["Header"](**header),
                    ns="",
                    id=100 * body.id + joint,
                    type=2,
                    action=0,
                    pose=pose,
                    scale=types["Vector3"](x=0.05, y=0.05, z=0.05),
                    color=types["ColorRGBA"](r=0.0, g=1.0, b=0.0, a=1.0),
                    lifetime=types["Duration"](sec=0, nanosec=250_000_000),
                    frame_locked=False,
                    **more,
                )
            )
    return markers
