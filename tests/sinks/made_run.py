"""A small made-up run for the tests of sinks: every kind of marker, verdict, sample and hostile name."""

import json
import math
import struct

import numpy as np
from msgspec.structs import replace

from seerob.core.samples import JointSample, PoseSample, Quality, SignalSample
from seerob.core.snapshot import (
    Arrow,
    Basis,
    Box,
    CriterionInfo,
    Ellipsoid,
    Finding,
    Highlight,
    Hull,
    Input,
    JointInfo,
    Label,
    MechanismInfo,
    Node,
    Origin,
    Result,
    Scene,
    Segment,
    Snapshot,
    Sphere,
    Verdict,
)

HOSTILE = "<script>alert('1')</script> & \"q\" =cmd|' /C calc'!A0"


def glb(vertices, faces, color=(0.7, 0.72, 0.75, 1.0)):
    """A one-primitive binary glTF, written from the specification."""
    vertices, faces = np.asarray(vertices, "<f4"), np.asarray(faces, "<u4")
    blob = vertices.tobytes() + faces.tobytes()
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "materials": [{"pbrMetallicRoughness": {"baseColorFactor": list(color)}}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]}],
        "accessors": [
            {
                "bufferView": 0,
                "componentType": 5126,
                "count": len(vertices),
                "type": "VEC3",
                "min": vertices.min(0).tolist(),
                "max": vertices.max(0).tolist(),
            },
            {"bufferView": 1, "componentType": 5125, "count": faces.size, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": vertices.nbytes},
            {"buffer": 0, "byteOffset": vertices.nbytes, "byteLength": faces.nbytes},
        ],
        "buffers": [{"byteLength": len(blob)}],
    }
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    blob += b"\0" * (-len(blob) % 4)
    total = 12 + 8 + len(text) + 8 + len(blob)
    head = struct.pack("<4sII", b"glTF", 2, total)
    return (
        head
        + struct.pack("<I4s", len(text), b"JSON")
        + text
        + struct.pack("<I4s", len(blob), b"BIN\0")
        + blob
    )


def box(size=(1, 1, 1)):
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]) * size
    faces = [
        [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
        [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
    ]  # fmt: skip
    return corners, np.array(faces)


def ball(radius, n=24):
    u, v = np.meshgrid(np.linspace(0, math.pi, n), np.linspace(0, 2 * math.pi, 2 * n), indexing="ij")
    points = radius * np.stack([np.sin(u) * np.cos(v), np.sin(u) * np.sin(v), np.cos(u)], -1)
    i = np.arange(n * 2 * n).reshape(n, 2 * n)
    a, b, c, d = i[:-1, :-1].ravel(), i[1:, :-1].ravel(), i[1:, 1:].ravel(), i[:-1, 1:].ravel()
    return points.reshape(-1, 3), np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])


MESHES = {
    "a" * 64: glb(*box((0.12, 0.12, 0.6)), color=(0.85, 0.87, 0.9, 1)),
    "b" * 64: glb(*ball(0.15), color=(0.9, 0.75, 0.6, 1)),
    "c" * 64: glb(*box((1.6, 0.8, 0.05)), color=(0.5, 0.42, 0.35, 1)),
}

SEPARATION = Basis(
    formula="S_p = (v_h + v_r) T_r + ½ v_r T_s + v_h T_s + C",
    source="paper Eq. 2; ISO/TS 15066:2016, 5.5.4.2.3",
    inputs=(
        Input(name="T_r", value=0.1, unit="s", origin=Origin.GIVEN, source="workstation.toml"),
        Input(name="v_h", value=1.6, unit="m/s", origin=Origin.STATED, source="ISO 13855:2010, 6.2"),
        Input(name="stopping time", origin=Origin.ASSUMED, source="nobody gave it"),
        Input(name="norm", value="ISO 13855", origin=Origin.STATED, source=HOSTILE),
    ),
    not_modelled=("position uncertainty of the sensor", HOSTILE),
)
SPEED = Basis(formula="|v| = |J_v qd|", source="paper Eq. 4")


def scene(**changes):
    return replace(
        Scene(
            title="Made-up cell",
            edition="ISO/TS 15066:2016",
            version="0.1.0",
            workstation_hash="f" * 64,
            period=0.01,
            nodes=(
                Node(name="table", role="part", owner="table", mesh="c" * 64, moves=False, mass=40.0),
                Node(name="ur10/base", role="robot", owner="ur10", mesh="a" * 64),
                Node(name="ur10/forearm_link", role="robot", owner="ur10", mesh="a" * 64, mass=3.0),
                Node(name="operator/head", role="human", owner="operator", mesh="b" * 64),
                Node(name="operator/" + HOSTILE, role="human", owner="operator", mesh="b" * 64),
                Node(name="frame", role="part", owner="frame"),
            ),
            mechanisms=(
                MechanismInfo(
                    name="ur10",
                    role="robot",
                    joints=tuple(JointInfo(name=n, unit="rad") for n in ("j1", "j2")),
                ),
            ),
            criteria=(
                CriterionInfo(
                    name="separation",
                    kind="separation",
                    group="safety",
                    title="Protective separation distance.",
                    subjects=("ur10", "operator"),
                    unit="m",
                    at_most=False,
                    basis=SEPARATION,
                ),
                CriterionInfo(
                    name="tool speed",
                    kind="velocity",
                    group="safety",
                    title="Speed.",
                    unit="m/s",
                    limit=1.0,
                    basis=SPEED,
                ),
                CriterionInfo(name=HOSTILE, kind="mass", group="safety", title="Hostile.", unit="kg"),
                CriterionInfo(
                    name="never heard", kind="energy", group="safety", title="Silent.", unit="J", limit=2.0
                ),
            ),
            findings=(
                Finding(level="assumed", subject="ur10", text="rotor inertia: none published"),
                Finding(level="warning", subject=HOSTILE, text=HOSTILE),
            ),
        ),
        **changes,
    )


def snapshot(k, *, period=0.01):
    """Tick ``k``: separation is exceeded for k in 41…59, the hostile one is undecided for k < 30."""
    t = k * period
    swing = math.sin(2 * math.pi * k / 100)
    distance = 0.8 - 0.5 * math.exp(-(((k - 50) / 12) ** 2))
    limit = 0.8 - 0.5 * math.exp(-((10 / 12) ** 2))
    x = 0.5 + distance
    verdict = Verdict.WITHIN if distance >= limit else Verdict.EXCEEDED
    poses = np.zeros((6, 7), "<f4")
    poses[:, 3] = 1
    poses[0, :3] = 0.5, 0, 0.7
    poses[1, :3] = 0.0, 0, 1.0
    poses[2] = 0.25, 0, 1.3, math.cos(0.7 + swing / 8), 0, math.sin(0.7 + swing / 8), 0
    poses[3, :3] = x + 0.15, 0.2, 1.55
    poses[4, :3] = x + 0.15, -0.1, 1.25
    red = (
        Segment(start=(0.5, 0.0, 1.3), end=(x, 0.0, 1.3), label="d", verdict=verdict),
        Highlight(body="ur10/forearm_link", verdict=verdict),
    )
    every = (
        Arrow(origin=(0.5, 0, 1.3), vector=(0, swing, 0), label="v"),
        Sphere(center=(0.5, 0, 1.3), radius=0.2, verdict=Verdict.WITHIN),
        Ellipsoid(center=(0.5, 0, 1.3), wxyz=(1, 0, 0, 0), radii=(0.1, 0.2, 0.3)),
        Box(center=(1, 1, 1), wxyz=(1, 0, 0, 0), size=(0.2, 0.2, 0.2), verdict=Verdict.UNDECIDED),
        Hull(
            vertices=((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)),
            faces=((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)),
        ),
        Label(position=(0, 0, 2), text=HOSTILE),
    )
    undecided = k < 30

    def part(name, value, verdict):
        return Result(name=name, value=value, unit="m", limit=limit, at_most=False, verdict=verdict)

    return Snapshot(
        seq=k,
        t=t,
        poses=poses.tobytes(),
        joints={"ur10": (0.1 + 1e-17, swing)},
        tracking={"ur10": abs(swing) * 1e-3},
        results=(
            Result(
                name="separation",
                value=distance,
                unit="m",
                limit=limit,
                at_most=False,
                verdict=verdict,
                reason="ur10/forearm_link ↔ operator/head",
                interval=(distance - 0.01, distance + 0.01),
                parts=(
                    part("head", distance, verdict),
                    part("hand", distance + 1, Verdict.WITHIN),
                ),
                markers=red,
            ),
            Result(
                name="tool speed",
                value=abs(swing),
                unit="m/s",
                limit=1.0,
                verdict=Verdict.WITHIN,
                markers=every,
            ),
            Result(
                name=HOSTILE,
                value=None if undecided else 3.0 + k,
                unit="kg",
                verdict=Verdict.UNDECIDED if undecided else None,
                reason=f"not heard for {k} ticks" if undecided else "",
            ),
        ),
    )


def samples(k, *, period=0.01):
    """What tick ``k`` consumed."""
    if k % 3 == 2:
        return ()
    t = k * period
    joint = JointSample(source="excel", seq=k, t=t, t_device=1e9 / 7 + k, target="ur10", q=(0.1, k / 3))
    pose = PoseSample(
        source="vive",
        seq=k,
        t=t,
        target="cart",
        position=(0.1, 0, -0.0),
        wxyz=(1, 0, 0, 0),
        quality=Quality.DEGRADED,
    )
    signal = SignalSample(
        source="plc", seq=k, t=k * period, values={"lamp": True, "belt": 0.1 + 0.2, "mode": "auto"}
    )
    return (joint, pose, signal)[: 1 + k % 3]


FILES = {"workstation.toml": b'title = "Made-up cell"\n', "motion/cycle.csv": b"t;q\n0;1\n"}
